//! `photonmill paper`: every figure and table of the paper, in a folder.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::run::{threads, whole};
use super::stop::seconds;
use super::{DeviceArgs, End, complain, say};
use crate::error::{Error, Result};
use crate::output::destination::Folder;
use crate::paper::bench::Bench;
use crate::paper::{self, Request, published};

#[derive(Args)]
pub(super) struct PaperArgs {
    /// Folder for pictures, tables and index.html; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Photons of a round at the size that fills the device [default: 4194304; 65536 on the CPU]
    #[arg(long, value_name = "N", value_parser = whole::<u32>, allow_negative_numbers = true)]
    large: Option<u32>,
    /// Runs of each case after the first, which is dropped; the median counts. At most 3 at the
    /// large size
    #[arg(long, value_name = "K", value_parser = whole::<u32>, allow_negative_numbers = true, default_value = "7")]
    repeats: u32,
    /// Measure the CPU builder on this many threads too, or on `all` [default: 1 thread only]
    #[arg(long, value_name = "N|all", value_parser = threads)]
    threads: Option<usize>,
    /// Leave out rows of table 1 that are predicted to take longer
    #[arg(long, value_name = "TIME", value_parser = seconds, allow_negative_numbers = true, default_value = "90s")]
    longest: f64,
    #[command(flatten)]
    device: DeviceArgs,
}

const LARGE_ON_GPU: u32 = 1 << 22;
const LARGE_ON_CPU: u32 = 1 << 16;

pub(super) fn run(args: &PaperArgs, cancelled: &AtomicBool) -> Result<End> {
    args.validate()?;
    let folder = Folder::open("--out", &args.out)?;
    let gpu = args.device.open(&args.device.steady())?;
    let is_cpu = gpu.as_ref().is_none_or(|gpu| gpu.facts().kind == "cpu");
    let request = Request {
        large: args.large.unwrap_or(if is_cpu { LARGE_ON_CPU } else { LARGE_ON_GPU }),
        repeats: args.repeats as usize,
        threads: args.threads.unwrap_or(1),
        longest_ms: 1e3 * args.longest,
    };
    let mut progress = |line: &str| complain(line);
    let found = paper::reproduce(&mut Bench::new(gpu.as_ref(), cancelled, &mut progress), request)?;
    paper::write(&folder, &found)?;
    if !found.complete {
        complain("incomplete: ended before the last experiment; what was finished is written");
    }
    say(&format!("wrote {}", folder.path().join("index.html").display()))?;
    Ok(if found.complete { End::Finished } else { End::Cancelled })
}

impl PaperArgs {
    fn validate(&self) -> Result<()> {
        let smallest = published::PHOTONS + 1;
        if !(smallest..=MAX_LARGE).contains(&self.large.unwrap_or(smallest)) {
            let allowed = format!("must be from {smallest} to {MAX_LARGE} (photons a round, more than the paper's)");
            return Err(Error::setting("--large", self.large.unwrap_or_default(), allowed));
        }
        if !(1..=MAX_REPEATS).contains(&self.repeats) {
            return Err(Error::setting("--repeats", self.repeats, format!("must be from 1 to {MAX_REPEATS}")));
        }
        if !(self.longest.is_finite() && self.longest > 0.0) {
            return Err(Error::setting("--longest", format!("{}s", self.longest), "must be a time above 0, as 90s"));
        }
        let threads = self.threads.unwrap_or(1);
        if !(1..=MAX_THREADS).contains(&threads) {
            return Err(Error::setting("--threads", threads, format!("must be from 1 to {MAX_THREADS}, or all")));
        }
        Ok(())
    }
}

const MAX_LARGE: u32 = 1 << 31;
const MAX_REPEATS: u32 = 1000;
const MAX_THREADS: usize = 1024;

#[cfg(test)]
mod tests {
    use clap::Parser;

    use crate::cli::Cli;
    use crate::output::command;
    use crate::rng::Rng;
    use crate::settings::{Gather, Preset, Settings, Variant};

    /// The page tells how to repeat each experiment, so the lines must mean what was run.
    #[test]
    fn printed_commands_give_the_settings_they_stand_for() {
        for preset in [Preset::Naive, Preset::Modified, Preset::Phong, Preset::Rounds] {
            let defaults = Settings::preset(preset);
            let full_light = defaults.full_light_for(65_536);
            for settings in [
                defaults.clone(),
                Settings { variant: Variant::Cpu, threads: 3, bounces: 7, gather: Gather::Brute, ..defaults.clone() },
                Settings { photons: 65_536, full_light, rng: Rng::Philox, rounds: 5, ..defaults.clone() },
                Settings { shininess: [Some(0.01); 5], ..defaults.clone() },
            ] {
                let line = command::main_job(preset, &settings);
                let Ok(cli) = Cli::try_parse_from(line.split_whitespace()) else { panic!("{line} cannot be parsed") };
                assert_eq!(cli.run.settings(), settings, "{line}");
            }
        }
    }
}
