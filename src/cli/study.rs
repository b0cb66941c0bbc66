//! `photonmill study`: what accuracy costs in time, in a folder.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::progress::{ProgressArgs, ProgressReporter};
use super::request::{RequestArgs, STUDY};
use super::values::{parse_integer, parse_within};
use super::{DeviceArgs, End, complain, help, say};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::measure::study::{self, StudyRequest, peers};
use crate::output::destination::Folder;
use crate::render::options::row;
use crate::render::{Event, Observer, PreparedScene, Seconds};
use crate::scene::Scene;

#[derive(Args)]
pub(super) struct StudyArgs {
    /// Folder for index.html, points.csv, study.json and charts; a study that was interrupted resumes from what is there
    #[arg(short, long, alias = "out", value_name = "DIR", help_heading = "Output")]
    output: PathBuf,
    #[command(flatten)]
    request: RequestArgs<STUDY>,
    /// Time of all measurements together, without a path-traced reference: 90s, 10m
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, default_value = "4m", help_heading = "When to stop")]
    budget: Seconds,
    /// Runs of every setting and number of rounds; their spread gives the confidence intervals
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, default_value = "5", help_heading = "Measurements")]
    repeats: u32,
    /// Pixels along the longer side of the picture, or texels along each side of a wall of the open box [default: 128 and 64; 64 and 24 on a CPU]
    #[arg(long, alias = "size", value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Measurements")]
    side: Option<u32>,
    /// Samples per pixel of the path-traced reference, which is kept in the user's cache
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, default_value = "4096", help_heading = "Measurements")]
    reference_samples: u32,
    /// Photons per round [default: 262144; 8192 on a CPU]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    photons: Option<u32>,
    /// Most rounds of a run, even if time is left
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, default_value_t = study::MOST_ROUNDS, help_heading = "Photons")]
    rounds: u32,
    /// Seed of the first run of every setting; the next runs take the next seeds
    #[arg(long, value_name = "N", value_parser = parse_within(0..=study::MAX_SEED), allow_hyphen_values = true, default_value = "1", help_heading = "Photons")]
    seed: u64,
    /// Draw other programs' curves too, from a file that tools/bench_peers --json wrote for this scene
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    peers: Option<PathBuf>,
    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

/// Fields that say which camera looks, and how.
const CAMERA: [&str; 8] = ["camera", "eye", "look_at", "up", "fov", "orthographic", "aperture", "focus"];

pub(super) fn scene_help() -> String {
    let reference = "The reference is radiosity for open-box, the closed form for scenes of one floor, and path tracing for others";
    format!("{}. {reference}", help::scene())
}

pub(super) fn run(args: &StudyArgs, cancelled: &AtomicBool) -> Result<End> {
    let render_request = &args.request.0;
    render_request.check_camera()?;
    let folder = Folder::open("-o", &args.output)?;
    let budget = study::budget(args.budget.0)?;
    let request = |is_cpu: bool| {
        let usual = StudyRequest::usual(&render_request.scene, is_cpu);
        StudyRequest {
            size: args.side.unwrap_or(usual.size),
            photons: args.photons.unwrap_or(usual.photons),
            repeats: args.repeats,
            seed: args.seed,
            reference_samples: args.reference_samples,
            budget,
            scene_options: render_request.words().split_off(1),
            most_rounds: args.rounds,
            ..usual
        }
    };
    request(true).validate()?;
    let reporter = ProgressReporter::new(&args.progress);
    let report = |event: Event| reporter.event(event);
    let observer = Observer { cancelled, report: &report };
    let mut scene = Scene::clone(&PreparedScene::read(render_request, &observer)?.scene);
    if CAMERA.iter().any(|field| row(field).is_some_and(|row| row.text(render_request).is_some())) {
        // The first camera is the one that is studied.
        let (camera, _) = render_request.viewpoint(&scene, None, &observer)?;
        scene.cameras.insert(0, camera);
    }
    let gpu = Gpu::open(&args.device.steady())?;
    reporter.device(Some(&gpu));
    let peers = args.peers.as_ref().map_or(Ok(Vec::new()), |path| peers::read(path, &render_request.scene))?;
    let request = StudyRequest { peers, ..request(gpu.facts().kind == "cpu") };
    reporter.note(&format!(
        "plan: {}, {side} along a side; {} photons per round, {} runs of each point; stops measuring after {} s",
        scene.name,
        request.photons,
        request.repeats,
        args.budget.0,
        side = request.size
    ));
    let study = study::run(&gpu, &scene, request, &folder, cancelled, &mut |line| reporter.step(line))?;
    reporter.finish();
    let written = study::write(&folder, &study);
    for part in &study.parts {
        say(&format!("\n{}", part.quantity))?;
        for sentence in part.sentences() {
            say(&format!("  {sentence}"))?;
        }
    }
    written?;
    if !study.complete {
        complain("incomplete: ended before the last point; the same command resumes from there");
    }
    say(&format!("wrote {}", folder.path().join("index.html").display()))?;
    Ok(if study.complete { End::Finished } else { End::Cancelled })
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::super::{Cli, Command};
    use crate::measure::study::axes::{self, Group};
    use crate::render::RenderRequest;
    use crate::render::image::command_line;
    use crate::render::values::{Shininess, Threads, Variant};
    use crate::rng::Rng;
    use crate::settings::scene::Effect;
    use crate::settings::{Builder, Gather, Preset};

    fn parse(line: &str) -> Cli {
        Cli::try_parse_from(line.split(' ')).unwrap_or_else(|error| panic!("{line}: {error}"))
    }

    /// Pages print the command that repeats each experiment, so it must mean what was run.
    #[test]
    fn printed_commands_give_the_settings_they_stand_for() {
        let check = |request: &RenderRequest| {
            let is_box = request.scene.is_empty();
            let line = command_line(if is_box { "" } else { "render" }, &request.brief(), &["-o", "picture.exr"]);
            let cli = parse(&line);
            match cli.command {
                Some(Command::Render(render)) => assert_eq!(render.request.0.settings(None), request.settings(None), "{line}"),
                _ => assert_eq!((is_box, cli.run.request.0.room_settings()), (true, request.room_settings()), "{line}"),
            }
            line
        };
        for preset in [Preset::Naive, Preset::Modified, Preset::Phong, Preset::Rounds] {
            let usual = RenderRequest { preset: Some(preset), ..RenderRequest::default() };
            let (variant, gather) = (Some(Variant::Of(Builder::Cpu)), Some(Gather::Brute));
            check(&RenderRequest { variant, threads: Some(Threads(3)), bounces: Some(7), gather, ..usual.clone() });
            check(&RenderRequest { photons: Some(65_536), rng: Some(Rng::Philox), rounds: Some(5), ..usual.clone() });
            check(&RenderRequest { shininess: Some(Shininess([0.01; 5])), ..usual.clone() });
            check(&usual);
        }
        // What is as usual is not printed.
        let usual = RenderRequest { photons: Some(5000), seed: Some(1), rounds: Some(2), mesh: Some(64), ..RenderRequest::default() };
        assert_eq!(check(&usual), "photonmill --rounds 2 -o picture.exr");
        let (preset, shininess) = (Some(Preset::Phong), Some(Shininess([0.5; 5])));
        let phong = RenderRequest { preset, shininess, ..usual };
        assert_eq!(check(&phong), "photonmill --shininess 0.5,0.5,0.5,0.5,0.5 --preset phong --rounds 2 -o picture.exr");
        let base = RenderRequest { photons: Some(8192), ..RenderRequest::of("cornell") };
        let of_scene = axes::of_scene(base, &Effect::ALL, Some(0.1), true, true);
        let groups: Vec<Group> = [axes::of_paper(12, 8192), axes::of_the_papers_rounds(12), of_scene].concat();
        let configurations: Vec<_> = groups.iter().flat_map(|group| &group.configurations).collect();
        assert!(configurations.len() > 50);
        for configuration in configurations {
            check(&configuration.request);
        }
    }
}
