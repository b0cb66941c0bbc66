//! `photonmill study`: what accuracy costs in time, in a folder.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Args;

use super::run::whole;
use super::stop::seconds;
use super::{DeviceArgs, End, complain, say};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::output::destination::Folder;
use crate::scene::Scene;
use crate::study::{self, Request};

#[derive(Args)]
pub(super) struct StudyArgs {
    /// A built-in scene by name, or a .gltf or .glb file; `open-box` is held against radiosity, scenes of one
    /// floor against their closed form, others against path tracing
    #[arg(value_name = "SCENE")]
    scene: String,
    /// Folder for index.html, points.csv, study.json and SVG; a study that was cut off goes on from what is there
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Wall time of all measurements together, not of the reference: 90s, 10m
    #[arg(long, value_name = "TIME", value_parser = seconds, allow_negative_numbers = true, default_value = "2m")]
    budget: f64,
    /// Rounds of the longest point, whatever time is left
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, default_value_t = study::MOST_ROUNDS)]
    rounds: u32,
    /// Pixels along each side of the picture, or texels along each wall of the open box [default: 48; 12 on a CPU]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true)]
    size: Option<u32>,
    /// Photons of a round [default: 262144; 8192 on a CPU]
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true)]
    photons: Option<u32>,
    /// Runs of every point, whose spread is the error of what is found
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, default_value = "5")]
    repeats: u32,
    /// Seed of the first run of every point
    #[arg(long, value_parser = whole::<u64>, allow_negative_numbers = true, default_value = "1")]
    seed: u64,
    /// Samples a pixel of the path-traced reference, which is kept in the user's cache
    #[arg(long, value_parser = whole::<u32>, allow_negative_numbers = true, default_value = "4096")]
    reference_samples: u32,
    #[command(flatten)]
    device: DeviceArgs,
}

pub(super) fn run(args: &StudyArgs, cancelled: &AtomicBool) -> Result<End> {
    let folder = Folder::open("--out", &args.out)?;
    args.validate()?;
    let scene = Scene::open(&args.scene, false)?;
    for warning in &scene.warnings {
        complain(&format!("warning: {warning}"));
    }
    let gpu = Gpu::open(&args.device.steady())?;
    let is_cpu = gpu.facts().kind == "cpu";
    let request = Request {
        scene: args.scene.clone(),
        size: args.size.unwrap_or(if is_cpu { 12 } else { 48 }),
        photons: args.photons.unwrap_or(if is_cpu { 8192 } else { 1 << 18 }),
        repeats: args.repeats,
        seed: args.seed,
        reference_samples: args.reference_samples,
        budget: Duration::from_secs_f64(args.budget),
        most_rounds: args.rounds,
    };
    let study = study::run(&gpu, &scene, request, &folder, cancelled, &mut |line| complain(line))?;
    study::write(&folder, &study)?;
    for part in &study.parts {
        say(&format!("\n{}", part.quantity))?;
        for sentence in part.sentences() {
            say(&format!("  {sentence}"))?;
        }
    }
    if !study.complete {
        complain("incomplete: ended before the last point; the same command goes on from there");
    }
    say(&format!("wrote {}", folder.path().join("index.html").display()))?;
    Ok(if study.complete { End::Finished } else { End::Cancelled })
}

/// Of all runs of a choice, a gigabyte in all.
const MAX_HELD: u64 = 1 << 27;

impl StudyArgs {
    fn validate(&self) -> Result<()> {
        let within = |option, value: u64, allowed: std::ops::RangeInclusive<u64>, what: &str| {
            if allowed.contains(&value) {
                return Ok(());
            }
            Err(Error::setting(option, value, format!("must be from {} to {} ({what})", allowed.start(), allowed.end())))
        };
        within("--size", u64::from(self.size.unwrap_or(48)), 2..=1024, "pixels or texels along a side")?;
        within("--photons", u64::from(self.photons.unwrap_or(8192)), 64..=1 << 28, "photons a round")?;
        within("--rounds", u64::from(self.rounds), 1..=u64::from(study::MOST_ROUNDS), "rounds of the longest point")?;
        within("--repeats", u64::from(self.repeats), 2..=1000, "runs of a point, whose spread is its error")?;
        within("--seed", self.seed, 0..=u64::from(u32::MAX) - 1000, "as srand48 takes 32 bits")?;
        within("--reference-samples", u64::from(self.reference_samples), 16..=1 << 24, "samples a pixel")?;
        let held = 3 * u64::from(self.size.unwrap_or(48)).pow(2) * u64::from(self.repeats);
        if held > MAX_HELD {
            let allowed =
                format!("3 * size^2 * repeats is {held} numbers to be held for each choice, and {MAX_HELD} are allowed; ask for fewer");
            return Err(Error::setting("--repeats", self.repeats, allowed));
        }
        if !(1.0..=1e6).contains(&self.budget) {
            return Err(Error::setting("--budget", self.budget, "must be from 1s to 1000000s"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::super::{Cli, Command};
    use crate::output::command;
    use crate::settings::Preset;
    use crate::settings::transport::Effect;
    use crate::study::axes::{self, Group, Line};

    fn parse(line: &str) -> Cli {
        Cli::try_parse_from(line.split(' ')).unwrap_or_else(|error| panic!("{line}: {error}"))
    }

    #[test]
    fn printed_commands_give_the_settings_they_stand_for() {
        let groups: Vec<Group> =
            [axes::of_paper(12, 8192), axes::of_the_papers_rounds(12), axes::of_scene(8192, &Effect::ALL, Some(0.1), true, true)].concat();
        let configurations: Vec<_> = groups.iter().flat_map(|group| &group.configurations).collect();
        assert!(configurations.len() > 50);
        for configuration in configurations {
            match &configuration.line {
                Line::Paper(settings) => {
                    let line = command::main_job(Preset::Modified, settings);
                    let parsed = parse(&line).run.settings();
                    // Full light is of the paper's picture, which no study looks at.
                    assert_eq!(crate::settings::Settings { full_light: settings.full_light, ..parsed }, *settings, "{line}");
                }
                Line::Scene(settings) => {
                    let line = command::on_scene("render open-box -o picture.exr", settings);
                    let Some(Command::Render(render)) = parse(&line).command else { panic!("{line}") };
                    assert_eq!(render.settings(), *settings, "{line}");
                }
            }
        }
    }
}
