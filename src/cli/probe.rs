//! `photonmill probe`: irradiance at given points, as Radiance's `rtrace -I` gives it.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clap::Args;
use glam::DVec3;

use super::options::{DevicesOfRunArgs, ReportArgs};
use super::progress::{MessageArgs, ProgressReporter};
use super::request::{PROBE, RequestArgs};
use super::{End, say_written};
use crate::engine::scene::RunResult;
use crate::error::{Error, Result};
use crate::output::destination::{Destination, check_distinct, write_all};
use crate::output::scene_report;
use crate::render::checkpoints::Checkpoints;
use crate::render::points::{MAX_POINTS, point_of};
use crate::render::{Event, Inputs, Observer, RequestedReceivers, prepare};
use crate::text::{counted, echo, refusal};

#[derive(Args)]
pub(super) struct ProbeArgs {
    /// CSV with one line per point, W/m2: irradiance, standard errors (`inf` before eight blocks of rounds are whole, or where no
    /// light has reached the point though some may), their degrees of freedom, intervals, and what may be unseen; `-` is standard output
    #[arg(short, long, alias = "out", value_name = "FILE", help_heading = "Output")]
    output: PathBuf,
    #[command(flatten)]
    report: ReportArgs,
    /// Points and normals, one `x y z nx ny nz` per line, in metres; `-` is standard input
    #[arg(long, value_name = "FILE", help_heading = "Scene")]
    points: PathBuf,
    #[command(flatten)]
    request: RequestArgs<PROBE>,
    #[command(flatten)]
    messages: MessageArgs,
    #[command(flatten)]
    device: DevicesOfRunArgs,
}

pub(super) fn run(args: &ProbeArgs, cancelled: &AtomicBool) -> Result<End> {
    let request = &args.request.0;
    let inputs = Inputs::open(request)?;
    let reporter = ProgressReporter::explaining(&args.messages);
    let report = |event: Event| reporter.event(event);
    let observer = Observer { cancelled, report: &report };
    let output = Destination::open("-o", &args.output)?;
    let reports = args.report.open()?;
    let mut checkpoints = Checkpoints::open(request, &observer)?;
    let all = [vec![output.clone()], reports.destinations(), checkpoints.destinations()].concat();
    check_distinct(&all)?;
    checkpoints.check_not_read(&all, request.inputs().chain([args.points.as_path()]))?;
    let points = read_points(&args.points)?;

    let prepared = prepare(inputs, RequestedReceivers::Points(&points), &observer)?;
    let mut gpus = args.device.open(&reporter)?;
    let run = prepared.run(&mut gpus, &mut checkpoints, &observer)?.result;
    reporter.finish();

    let scene = &prepared.scene.name;
    let text = scene_report::text(scene, &run, prepared.point, args.messages.explains());
    let wrote = if output.is_standard_output() { String::new() } else { format!("\nwrote {}", args.output.display()) };
    let mut files = vec![(output, table(&run))];
    files.extend(reports.files(&run, || scene_report::json(scene, &run)));
    say_written(&all, text.trim_end(), write_all(files).map(|()| wrote))?;
    checkpoints.finish()?;
    Ok(End::of(&run))
}

/// Irradiance, standard errors, their degrees of freedom, the intervals that follow with the run's confidence, and the most that light
/// which was not met may add to any channel; W/m2. An error that is not known is `inf`.
fn table(run: &RunResult) -> Vec<u8> {
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
    let film = &run.film;
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
