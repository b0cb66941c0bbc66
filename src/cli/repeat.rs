//! `photonmill repeat`: runs a picture again, from what its file says of how it was made.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::{Args, CommandFactory, FromArgMatches};

use super::chosen::Chosen;
use super::options::DevicesOfRunArgs;
use super::progress::ProgressArgs;
use super::render::{Again, Repeated};
use super::typed::Typed;
use super::{Cli, Command, End, optional_file, say, usage};
use crate::error::{Error, Result};
use crate::output::colour::Format;
use crate::output::destination::{check_not_read, write_all};
use crate::output::metadata::{Metadata, Repeat};
use crate::output::{colour, exr_file};
use crate::scene::file;

#[derive(Args)]
pub(super) struct RepeatArgs {
    /// Picture of `render` or of the paper's box, a .png or .exr
    #[arg(value_name = "FILE")]
    pub(super) file: PathBuf,
    /// Write the picture that comes out, in the format of FILE
    #[arg(short, long, alias = "out", value_name = "FILE", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Where the scene is now [default: where it was, as it was typed]
    #[arg(long, value_name = "FILE", help_heading = "Scene")]
    scene: Option<String>,
    #[command(flatten)]
    progress: ProgressArgs,
    #[command(flatten)]
    device: DevicesOfRunArgs,
}

pub(super) fn run(args: RepeatArgs, cancelled: &AtomicBool) -> Result<End> {
    let path = args.file.clone();
    let refuse = |reason: String| Error::Picture { path: path.clone(), reason };
    let format = Format::of("FILE", &path)?;
    let content = file::read(&path).map_err(refuse)?;
    let made = Metadata::read(&content).map_err(refuse)?;
    let output = optional_file("-o", args.output.as_ref())?;
    if let Some(output) = &args.output
        && Format::of("-o", output)? != format
    {
        let allowed = format!("must be in the format of {}", path.display());
        return Err(Error::setting("-o", output.display(), allowed));
    }
    check_not_read(output.as_slice(), [path.as_path()])?;
    let (command, arguments, division, tiles) = match &made.repeat {
        Repeat::With { command, arguments, division, tiles } => (command, arguments, *division, tiles.clone()),
        Repeat::Not(reason) => return Err(refuse(reason.clone())),
    };
    let damaged = |reason: &dyn std::fmt::Display| refuse(format!("says otherwise than photonmill does how it was made ({reason})"));
    let chosen = Chosen::of_picture(&made, division, tiles).map_err(|error| damaged(&error))?;
    let (mut cli, typed) = parsed(command, arguments, &chosen).map_err(|reason| damaged(&reason))?;
    let repeated = match cli.command {
        Some(Command::Render(mut render)) => {
            let has_moved = args.scene.is_some();
            render.set(args.scene, args.progress, args.device);
            let again = Again { chosen: &chosen, made: &made, path: &path, has_moved, typed: &typed, format };
            super::render::again(&render, &again, cancelled)?
        }
        None => {
            let elsewhere = "is for pictures of a scene's file, and this one is of the paper's box; leave it out";
            args.scene.map_or(Ok(()), |scene| Err(Error::setting("--scene", scene, elsewhere)))?;
            let folder = tempfile::tempdir().map_err(|error| refuse(format!("cannot be repeated: {}", error.kind())))?;
            let place = folder.path().join(if format == Format::Png { "repeated.png" } else { "repeated.exr" });
            cli.run.set(place.clone(), args.progress, args.device);
            if matches!(super::run::run(&cli.run, &typed, cancelled)?, End::Cancelled) {
                return Ok(End::Cancelled);
            }
            let content = file::read(&place).map_err(refuse)?;
            let devices = Metadata::read(&content).map_err(refuse)?.devices;
            Repeated { content, devices }
        }
        Some(_) => return Err(damaged(&"it is of no picture")),
    };
    let differing = differing(&content, &repeated.content, format).map_err(refuse)?;
    if let Some(output) = output {
        write_all([(output, repeated.content)])?;
    }
    if differing.count > 0 {
        let others: Vec<&String> = repeated.devices.iter().filter(|device| !made.devices.contains(device)).collect();
        let why = match others.first() {
            Some(device) => format!("it was made on {}, and repeated on {device}", made.devices.join("; ")),
            None => "its pixels were changed, or the device or its driver does not compute alike each time".to_owned(),
        };
        return Err(Error::NotRepeated { path, differing: differing.count, of: differing.of, why });
    }
    let wrote = args.output.map_or_else(String::new, |output| format!("\nwrote {}", output.display()));
    say(&format!("{}: repeated, all {} values are identical{wrote}", path.display(), differing.of))?;
    Ok(End::Finished)
}

/// The command line of a picture, of which nothing may be but what decides pixels.
fn parsed(command: &str, arguments: &[String], chosen: &Chosen) -> std::result::Result<(Cli, Typed), String> {
    let words = ["photonmill", command].into_iter().filter(|word| !word.is_empty()).map(str::to_owned).chain(arguments.iter().cloned());
    let rounds = format!("--rounds={}", chosen.rounds);
    // It asks for some output.
    let words: Vec<String> = words.chain([rounds, "-o=repeated.exr".to_owned()]).collect();
    let known = Cli::command();
    let matches = known
        .clone()
        .try_get_matches_from(&words)
        .map_err(|error| usage::one_line(&error, &known, &words.iter().map(Into::into).collect::<Vec<_>>()))?;
    let typed = Typed::of(&matches, &known);
    if typed.words() != arguments {
        return Err("it has options that decide no pixel".to_owned());
    }
    let cli = Cli::from_arg_matches(&matches).map_err(|error| error.to_string())?;
    Ok((cli, typed))
}

/// Values that differ, of how many.
struct Differing {
    count: usize,
    of: usize,
}

/// Compares the values of a picture with those of another one, to the bit. What the other one has beside them is not compared: layers
/// that a run could not keep, which went on with a checkpoint without them.
fn differing(before: &[u8], after: &[u8], format: Format) -> std::result::Result<Differing, String> {
    let [before, after] = [values(before, format)?, values(after, format)?];
    let mut differing = Differing { count: 0, of: 0 };
    for (name, values) in &before {
        let others = after.get(name).map_or(&[][..], Vec::as_slice);
        let same = values.iter().zip(others).filter(|(value, other)| value == other).count();
        differing.of += values.len();
        differing.count += values.len() - same;
    }
    Ok(differing)
}

/// Values of each channel as bits, by its name; a PNG's codes have none.
fn values(content: &[u8], format: Format) -> std::result::Result<BTreeMap<String, Vec<u32>>, String> {
    match format {
        Format::Png => Ok([(String::new(), colour::png_codes(content)?.into_iter().map(u32::from).collect())].into()),
        Format::Exr => {
            let (_, channels) = exr_file::decode(content)?;
            let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect();
            Ok(channels.into_iter().map(|channel| (channel.name, bits(channel.values))).collect())
        }
    }
}
