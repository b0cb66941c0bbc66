//! Values of options that commands share: text to numbers, with what is allowed in words, and choices. Ranges are the settings' affair.

use std::fmt::Display;
use std::num::IntErrorKind;
use std::ops::RangeInclusive;
use std::str::FromStr;

use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use crate::engine::blocks::Share;
use crate::engine::replay::PhotonName;
use crate::gpu::LEAST_MEMORY;
use crate::settings::scene::Effect;
use crate::settings::{Builder, Math, WALL_NAMES};

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

value_enum!(MathArg => Math {
    /// As fast as the device can
    Fast,
    /// The same bits on every device that rounds to nearest
    Strict,
});
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum SwitchArg {
    On,
    Off,
}

/// What `--variant` names; `None` is auto.
pub(super) type BuilderArg = Option<Builder>;

/// Reads a [`BuilderArg`] that is one of `known`, or auto, which means what `auto` says.
pub(super) fn builder_parser(known: impl IntoIterator<Item = Builder>, auto: &'static str) -> impl TypedValueParser<Value = BuilderArg> {
    let help = |builder| match builder {
        Builder::Naive => "One slot per photon and bounce, empty slots included (the paper's first)",
        Builder::Atomic => "Only surviving photons, one atomic per thread (the paper's second)",
        Builder::Ballot => "Only surviving photons, one atomic per subgroup",
        Builder::Group => "Only surviving photons, one atomic per work group",
        Builder::Scan => "Only surviving photons, in their original order, by prefix sums",
        Builder::Persistent => "One invocation traces each photon from emission to its end",
        Builder::Cpu => "The paper's CPU implementation, on one thread or on --threads",
    };
    let values = known.into_iter().map(|builder| PossibleValue::new(builder.name()).help(help(builder)));
    PossibleValuesParser::new(values.chain([PossibleValue::new("auto").help(auto)]))
        .map(|name| Builder::ALL.into_iter().find(|builder| builder.name() == name))
}

pub(super) fn effect_parser() -> impl TypedValueParser<Value = Effect> {
    let known = |name: String| Effect::ALL.into_iter().find(|effect| effect.name() == name).expect("only names of effects pass");
    PossibleValuesParser::new(Effect::ALL.map(Effect::name)).map(known)
}

/// A number that `T` does not hold becomes 0 or the largest of `T`. The setting must allow neither: validation, which knows
/// its range, then refuses both.
pub(super) fn parse_integer<T: TryFrom<u64>>(text: &str) -> Parsed<T> {
    let number = match text.parse::<i128>() {
        Ok(number) => number,
        Err(error) if *error.kind() == IntErrorKind::PosOverflow => i128::MAX,
        Err(error) if *error.kind() == IntErrorKind::NegOverflow => 0,
        Err(_) => return Err("must be a whole number".to_owned()),
    };
    let largest = u64::MAX >> (64 - 8 * size_of::<T>());
    Ok(T::try_from(number.clamp(0, largest.into()) as u64).ok().expect("the number is in the range of T"))
}

/// The same for a setting that allows an end of `T`.
pub(super) fn parse_within<T>(allowed: RangeInclusive<T>) -> impl Fn(&str) -> Parsed<T> + Clone + Send + Sync
where
    T: FromStr + PartialOrd + Display + Clone + Send + Sync,
{
    move |text| {
        let number = text.parse().ok().filter(|number| allowed.contains(number));
        number.ok_or_else(|| format!("must be a whole number from {} to {}", allowed.start(), allowed.end()))
    }
}

pub(super) fn parse_number<T: FromStr>(text: &str) -> Parsed<T> {
    text.parse().map_err(|_| "must be a number".to_owned())
}

/// Stops of an exposure.
pub(super) fn parse_stops(text: &str) -> Parsed<f32> {
    let stops = parse_number(text)?;
    if (-64.0..=64.0).contains(&stops) { Ok(stops) } else { Err("must be from -64 to 64 stops".to_owned()) }
}

/// `1,2,3`.
pub(super) fn parse_numbers<T: FromStr + Copy, const N: usize>(text: &str) -> Parsed<[T; N]> {
    let wanted = format!("must be {N} numbers separated by commas");
    let parts: Option<Vec<T>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    parts.and_then(|parts| parts.try_into().ok()).ok_or(wanted)
}

/// `1%` or `1`: per cent, as a share of 1.
pub(super) fn parse_percent(text: &str) -> Parsed<f64> {
    let number = text.strip_suffix('%').unwrap_or(text).trim();
    number.parse().map(|percent: f64| percent / 100.0).map_err(|_| "must be a number of per cent, such as 1%".to_owned())
}

/// `2s`, `500ms`, `3m`, `1h`, or seconds.
pub(super) fn parse_seconds(text: &str) -> Parsed<f64> {
    let units = [("ms", 1e-3), ("s", 1.0), ("m", 60.0), ("h", 3600.0)];
    let (number, unit) = units.iter().find_map(|(name, unit)| Some((text.strip_suffix(name)?, *unit))).unwrap_or((text, 1.0));
    number.trim().parse().map(|count: f64| count * unit).map_err(|_| "must be a time, such as 2s, 500ms or 3m".to_owned())
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

/// `3/8`, counted from 1.
pub(super) fn parse_share(text: &str) -> Parsed<Share> {
    let share = text.split_once('/').and_then(|(number, of)| {
        let (number, of): (u32, u32) = (number.trim().parse().ok()?, of.trim().parse().ok()?);
        (1..=of).contains(&number).then(|| Share { number: number - 1, of })
    });
    share.ok_or_else(|| "must be K/N, a shard and their number, such as 3/8: K is from 1 to N".to_owned())
}

pub(super) fn parse_shininess(text: &str) -> Parsed<[f32; 5]> {
    match parse_numbers::<f32, 1>(text) {
        Ok([all]) => Ok([all; 5]),
        Err(_) => parse_numbers::<f32, 5>(text).map_err(|_| format!("must be one number, or five for {}", WALL_NAMES.join(","))),
    }
}

pub(super) fn parse_colour(text: &str) -> Parsed<[f32; 3]> {
    let all = match parse_numbers::<f32, 1>(text) {
        Ok([grey]) => [grey; 3],
        Err(_) => parse_numbers::<f32, 3>(text).map_err(|_| "must be one number, or three separated by commas".to_owned())?,
    };
    if all.iter().all(|value| value.is_finite() && *value >= 0.0) { Ok(all) } else { Err("must be 0 or more and finite".to_owned()) }
}

pub(super) fn parse_threads(text: &str) -> Parsed<usize> {
    if text == "all" {
        return Ok(std::thread::available_parallelism().map_or(1, usize::from));
    }
    parse_integer(text).map_err(|_| "must be a number of threads, or all".to_owned())
}

/// `3:4711`, `3:4711:caustic`.
pub(super) fn parse_photon_name(text: &str) -> Parsed<PhotonName> {
    let (numbers, caustic) = text.strip_suffix(":caustic").map_or((text, false), |numbers| (numbers, true));
    let parsed = numbers.split_once(':').and_then(|(round, photon)| Some((round.parse().ok()?, photon.parse().ok()?)));
    parsed
        .map(|(round, photon)| PhotonName { round, photon, caustic })
        .ok_or_else(|| "must be ROUND:PHOTON, two whole numbers, or ROUND:PHOTON:caustic".to_owned())
}
