//! `photonmill probe`: irradiance at given points, as Radiance's `rtrace -I` gives it.

use std::borrow::Cow;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clap::Args;
use glam::DVec3;

use super::job::{Job, MessageArgs};
use super::options::{DevicesOfRunArgs, ReportArgs};
use super::progress::ProgressReporter;
use super::scene::{SceneArgs, TransportArgs, geometry, settings};
use super::{End, complain, say_beside};
use crate::engine::scene::{RunResult, Target};
use crate::error::{Error, Result};
use crate::output::destination::{Destination, check_distinct, write_all};
use crate::output::scene_report;
use crate::plan::sensor::Sensor;
use crate::plan::work_division::Free;
use crate::render::{MAX_POINTS, point_of};
use crate::scene::sensors::with_sensors;
use crate::text::{counted, echo, refusal};

#[derive(Args)]
pub(super) struct ProbeArgs {
    /// CSV with one line per point, W/m2: irradiance, standard errors (`inf` before eight blocks of rounds are whole, or where no
    /// light has reached the point though some may), their degrees of freedom, intervals, and what may be unseen; `-` is standard output
    #[arg(short, long, alias = "out", value_name = "FILE", help_heading = "Output")]
    output: PathBuf,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    scene: SceneArgs,
    /// Points and normals, one `x y z nx ny nz` per line, in metres; `-` is standard input
    #[arg(long, value_name = "FILE", help_heading = "Scene")]
    points: PathBuf,
    #[command(flatten)]
    transport: TransportArgs,
    #[command(flatten)]
    messages: MessageArgs,
    #[command(flatten)]
    device: DevicesOfRunArgs,
}

pub(super) fn run(args: &ProbeArgs, cancelled: &AtomicBool) -> Result<End> {
    let map = args.transport.map()?;
    let request = args.transport.request();
    let settings = settings(&request, map.as_ref(), args.transport.light.chosen.open()?.as_ref());
    settings.validate()?;
    let output = Destination::open("-o", &args.output)?;
    let reports = args.report.open()?;
    let mut keeper = args.transport.keep.open(&args.transport.stop)?;
    let all = [vec![output.clone()], reports.destinations(), keeper.destinations()].concat();
    check_distinct(&all)?;
    keeper.check_not_read(&all, args.transport.inputs().chain([args.points.as_path(), args.scene.path()]))?;
    let points = read_points(&args.points)?;

    let reporter = ProgressReporter::new(&args.messages.progress);
    let scene = args.scene.open(&reporter)?;
    // Photons of a file are those of the scene alone.
    let scene = if map.is_some() { Cow::Borrowed(&scene) } else { with_sensors(&scene, &points, &settings) };
    let geometry = geometry(&scene, &settings, &reporter)?;
    let far = geometry.place_warning("points", points.iter().map(|(position, _)| *position));
    far.iter().for_each(|line| complain(&format!("warning: {line}")));
    let phases = Target::Points(&points).phases(&geometry);
    let sensor = Sensor::Receivers { count: points.len() as u32 };
    let job = Job {
        scene: &scene,
        geometry: &geometry,
        settings: &settings,
        sensor,
        camera: None,
        phases: &phases,
        map: map.as_ref(),
        free: Free { samples: false, ..args.transport.free(&request) },
        chosen: None,
        save_settings: None,
        explain: args.messages.explains(),
        point: "point",
    };
    let mut gpus = args.device.open(&reporter)?;
    let lit = job.run(&mut gpus, &args.transport.stop, &mut keeper, &reporter, cancelled)?;
    reporter.finish();

    let text = scene_report::text(&scene.name, &lit, job.point, args.messages.explains());
    let wrote = if output.is_standard_output() { String::new() } else { format!("\nwrote {}", args.output.display()) };
    let mut files = vec![(output, table(&lit))];
    files.extend(reports.files(&lit, || scene_report::json(&scene.name, &lit)));
    if let Err(error) = write_all(files) {
        return say_beside(&all, &text).and(Err(error));
    }
    say_beside(&all, &format!("{}{wrote}", text.trim_end()))?;
    keeper.finish()?;
    Ok(End::of(&lit))
}

/// Irradiance, standard errors, their degrees of freedom, the intervals that follow with the run's confidence, and the most that light
/// which was not met may add to any channel; W/m2. An error that is not known is `inf`.
fn table(lit: &RunResult) -> Vec<u8> {
    const COLUMNS: [&str; 15] = [
        "red",
        "green",
        "blue",
        "red_error",
        "green_error",
        "blue_error",
        "degrees_of_freedom",
        "confidence",
        "red_low",
        "green_low",
        "blue_low",
        "red_high",
        "green_high",
        "blue_high",
        "unseen",
    ];
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(COLUMNS).expect("memory takes what is written");
    let film = &lit.film;
    let (errors, intervals, unseen) = (film.stated_errors(), film.intervals(), film.unseen_bounds());
    let of_all = [f64::from(film.error_freedom()), film.plan.confidence];
    for point in 0..film.pixels() {
        let [low, high] = intervals(point).map(|end| end.to_array());
        let [mean, error] = [film.mean(point), errors(point)].map(|value| value.to_array());
        let row = [&mean[..], &error, &of_all, &low, &high, &[unseen(point)]].concat();
        table.write_record(row.iter().map(f64::to_string)).expect("memory takes what is written");
    }
    table.into_inner().expect("memory takes what is written")
}

/// Positions and unit normals; empty lines and lines that begin with # are skipped.
fn read_points(path: &Path) -> Result<Vec<(DVec3, DVec3)>> {
    let refuse = |reason: String| Error::setting("--points", path.display(), reason);
    let mut text = String::new();
    let read = if path == Path::new("-") {
        std::io::stdin().read_to_string(&mut text)
    } else {
        std::fs::File::open(path).and_then(|mut file| file.read_to_string(&mut text))
    };
    read.map_err(|error| refuse(format!("cannot be read ({}); name a text file of points", refusal(&error))))?;
    let mut points = Vec::new();
    // The mark that some editors write in front of a text.
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let wrong = |what: &str| refuse(format!("line {}, '{}': {what}; a line is `x y z nx ny nz`", number + 1, echo(line)));
        let fields: Vec<f64> = line
            .split([' ', '\t', ',', ';'])
            .filter(|field| !field.is_empty())
            .map(|field| field.parse().map_err(|_| wrong(&format!("'{}' is no number", echo(field)))))
            .collect::<Result<_>>()?;
        let [x, y, z, nx, ny, nz] = fields[..] else { return Err(wrong(&format!("has {} instead of 6", counted(fields.len(), "number")))) };
        points.push(point_of([x, y, z], [nx, ny, nz]).map_err(|fault| wrong(&fault))?);
    }
    if points.is_empty() {
        return Err(refuse("holds no point; a line is `x y z nx ny nz`".into()));
    }
    if points.len() > MAX_POINTS {
        return Err(refuse(format!("holds {} points, at most {MAX_POINTS}", points.len())));
    }
    Ok(points)
}
