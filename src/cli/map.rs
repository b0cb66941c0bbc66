//! `photonmill map`: the photons of a scene as a file, what such a file holds, and its photons for other programs.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::{ArgMatches, Args, Command, FromArgMatches, Subcommand};

use super::options::TimedDeviceArgs;
use super::progress::{ProgressArgs, ProgressReporter};
use super::request::{MAP, RequestArgs};
use super::values::{parse_integer, value_enum};
use super::{End, JsonOrStdoutArg, optional_file, say};
use crate::engine::scene::map_file::MapFile;
use crate::error::{Error, Result, require};
use crate::output::destination::{Destination, check_not_read, write_all};
use crate::output::photon_map;
use crate::render::map::{WrittenMap, by_blocks};
use crate::render::{Event, Inputs, Observer, RenderRequest, RequestedReceivers, prepare};
use crate::text::counted;

/// A file is made of a scene, or another command given.
pub(super) enum MapArgs {
    Make(Box<MakeArgs>),
    Of(MapCommand),
}

// Not derived: clap knows no struct whose arguments are all needed, unless there is a command.
impl Args for MapArgs {
    fn augment_args(command: Command) -> Command {
        let command = MapCommand::augment_subcommands(MakeArgs::augment_args(command));
        command.subcommand_required(false).arg_required_else_help(false).args_conflicts_with_subcommands(true).subcommand_negates_reqs(true)
    }

    fn augment_args_for_update(command: Command) -> Command {
        MapArgs::augment_args(command)
    }
}

impl FromArgMatches for MapArgs {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<MapArgs, clap::Error> {
        match matches.subcommand() {
            Some(_) => MapCommand::from_arg_matches(matches).map(MapArgs::Of),
            None => MakeArgs::from_arg_matches(matches).map(|args| MapArgs::Make(Box::new(args))),
        }
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        *self = MapArgs::from_arg_matches(matches)?;
        Ok(())
    }
}

#[derive(Subcommand)]
pub(super) enum MapCommand {
    /// Print what a file of photons holds
    Info(MapInfoArgs),
    /// Write the photons of a file as a point cloud (PLY, binary) for other programs
    Export(ExportArgs),
}

#[derive(Args)]
pub(super) struct MakeArgs {
    /// File of photons, for `--map` of render, bake and probe
    #[arg(short, long, alias = "out", value_name = "FILE", required = true, help_heading = "Output")]
    output: PathBuf,
    /// Camera for whose picture photons choose among lamps and openings; pictures of other cameras are right too, with more noise
    /// [default: the first one; one that sees the whole scene if it has none]
    #[arg(long, value_name = "NAME", help_heading = "Scene")]
    camera: Option<String>,
    #[command(flatten)]
    request: RequestArgs<MAP>,
    /// Number of independent rounds; pictures have as many, or fewer [default: 16]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    rounds: Option<u32>,
    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: TimedDeviceArgs,
}

#[derive(Args)]
pub(super) struct MapInfoArgs {
    /// File of `photonmill map`
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    json: JsonOrStdoutArg,
}

#[derive(Args)]
pub(super) struct ExportArgs {
    /// File of `photonmill map`
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Point cloud, which must end in .ply
    #[arg(short, long, alias = "out", value_name = "FILE", help_heading = "Output")]
    output: PathBuf,
    /// Only so many of the rounds, the first ones [default: all]
    #[arg(long, value_name = "N", value_parser = parse_integer::<u32>, allow_hyphen_values = true, help_heading = "Photons")]
    rounds: Option<u32>,
    /// Only one of the two maps [default: both]
    #[arg(long, value_enum, value_name = "MAP", help_heading = "Photons")]
    only: Option<OnlyArg>,
}

#[derive(Debug, Clone, Copy)]
enum Only {
    Global,
    Caustic,
}

value_enum!(OnlyArg => Only { Global, Caustic });

pub(super) fn run(args: &MapArgs, cancelled: &AtomicBool) -> Result<End> {
    match args {
        MapArgs::Make(args) => make(args, cancelled),
        MapArgs::Of(MapCommand::Info(args)) => info(args).map(|()| End::Finished),
        MapArgs::Of(MapCommand::Export(args)) => export(args).map(|()| End::Finished),
    }
}

fn make(args: &MakeArgs, cancelled: &AtomicBool) -> Result<End> {
    let request = by_blocks(RenderRequest { camera: args.camera.clone(), rounds: args.rounds, ..args.request.0.clone() });
    let inputs = Inputs::open(&request)?;
    let output = Destination::open_file("-o", &args.output)?;
    check_not_read(std::slice::from_ref(&output), request.inputs())?;
    let reporter = ProgressReporter::new(&args.progress);
    let report = |event: Event| reporter.event(event);
    let observer = Observer { cancelled, report: &report };
    let prepared = prepare(inputs, RequestedReceivers::Image(None), &observer)?;
    let mut gpu = args.device.open(&reporter)?;
    let WrittenMap { header, filled, failed } = prepared.write_map(&mut gpu, &output, &observer)?;
    reporter.finish();
    let found = filled.nonfinite_values.map_or_else(String::new, |values| values.text() + "\n");
    say(&format!("{found}{}\nwrote {}", photon_map::text(&header).trim_end(), args.output.display()))?;
    failed.map_or(Ok(if filled.is_cancelled { End::Cancelled } else { End::Finished }), Err)
}

fn info(args: &MapInfoArgs) -> Result<()> {
    let json = optional_file("--json", args.json.json.as_ref())?;
    check_not_read(json.as_slice(), [args.file.as_path()])?;
    let map = MapFile::open("FILE", &args.file)?;
    match json {
        Some(json) => write_all([(json, photon_map::json(&map.header))]),
        None => say(photon_map::text(&map.header).trim_end()),
    }
}

fn export(args: &ExportArgs) -> Result<()> {
    let is_ply = args.output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ply"));
    require(is_ply, "-o", args.output.display(), "must end in .ply")?;
    let output = Destination::open_file("-o", &args.output)?;
    check_not_read(std::slice::from_ref(&output), [args.file.as_path()])?;
    let map = MapFile::open("FILE", &args.file)?;
    let rounds = args.rounds.unwrap_or(map.rounds());
    require(
        (1..=map.rounds()).contains(&rounds),
        "--rounds",
        rounds,
        format!("must be from 1 to {}, the rounds of the file", map.rounds()),
    )?;
    let only = args.only.map(|only| match Only::from(only) {
        Only::Global => "global",
        Only::Caustic => "caustic",
    });
    let names: Vec<&str> =
        map.header.maps.iter().map(|map| map.name.as_str()).filter(|name| only.is_none_or(|only| only == *name)).collect();
    if let Some(only) = only.filter(|_| names.is_empty()) {
        return Err(Error::setting("--only", only, "is a map that the file does not hold"));
    }
    let mut file = output.stage()?;
    let count = photon_map::write_ply(&map, rounds, &names, file.file(), &|error| output.failed(&error))?;
    file.finish()?;
    say(&format!("wrote {}: {}", args.output.display(), counted(count, "photon")))
}
