//! Values of options that commands share: text to numbers, with what is allowed in words, and choices. Ranges are the settings' affair.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

use crate::engine::replay::PhotonName;
use crate::gpu::LEAST_MEMORY;
pub(super) use crate::render::values::{parse_integer, parse_number, parse_stops, parse_threads};

type Parsed<T> = Result<T, String>;

/// An enum of the settings as clap values.
macro_rules! value_enum {
    ($argument:ident => $setting:ident { $($(#[$doc:meta])* $variant:ident),* $(,)? }) => {
        #[derive(Clone, Copy, clap::ValueEnum)]
        pub(super) enum $argument { $($(#[$doc])* $variant),* }

        impl From<$argument> for $setting {
            fn from(argument: $argument) -> $setting {
                match argument { $($argument::$variant => $setting::$variant),* }
            }
        }
    };
}

pub(super) use value_enum;

/// A whole number within a range.
pub(super) fn parse_within<T>(allowed: RangeInclusive<T>) -> impl Fn(&str) -> Parsed<T> + Clone + Send + Sync
where
    T: FromStr + PartialOrd + Display + Clone + Send + Sync,
{
    move |text| {
        let number = text.parse().ok().filter(|number| allowed.contains(number));
        number.ok_or_else(|| format!("must be a whole number from {} to {}", allowed.start(), allowed.end()))
    }
}

/// Bytes, as a number or with K, M, G or T for powers of 1024.
pub(super) fn parse_bytes(text: &str) -> Parsed<u64> {
    let units = [("K", 10), ("M", 20), ("G", 30), ("T", 40)];
    let short = text.strip_suffix("iB").unwrap_or(text);
    let (number, bits) = units.iter().find_map(|(name, bits)| Some((short.strip_suffix(name)?, *bits))).unwrap_or((short, 0));
    let allowed = format!("must be from {}M to 900000T, as bytes or with K, M, G or T behind the number: 512M, 2G", LEAST_MEMORY >> 20);
    let bytes = number.trim().parse::<f64>().ok().map(|number| number * (1u64 << bits) as f64);
    bytes.filter(|bytes| (LEAST_MEMORY as f64..1e18).contains(bytes)).map(|bytes| bytes as u64).ok_or(allowed)
}

/// `3:4711`, `3:4711:caustic`.
pub(super) fn parse_photon_name(text: &str) -> Parsed<PhotonName> {
    let (numbers, caustic) = text.strip_suffix(":caustic").map_or((text, false), |numbers| (numbers, true));
    let parsed = numbers.split_once(':').and_then(|(round, photon)| Some((round.parse().ok()?, photon.parse().ok()?)));
    parsed
        .map(|(round, photon)| PhotonName { round, photon, caustic })
        .ok_or_else(|| "must be ROUND:PHOTON, two whole numbers, or ROUND:PHOTON:caustic".to_owned())
}
