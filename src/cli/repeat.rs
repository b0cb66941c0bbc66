//! `photonmill repeat`: runs a picture again, from what its file says of how it was made.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::options::DevicesOfRunArgs;
use super::progress::{ProgressArgs, ProgressReporter};
use super::{End, optional_file, say};
use crate::error::{Error, Result};
use crate::output::colour::Format;
use crate::output::destination::{check_not_read, write_all};
use crate::output::metadata::{Metadata, Repeat};
use crate::render::repeat::{RoundsOf, differing, repeat, repeat_room};
use crate::render::{Event, Observer, RenderRequest};
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
    let refuse = |reason: String| Error::Image { path: path.clone(), reason };
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
    let reporter = ProgressReporter::new(&args.progress);
    let report = |event: Event| reporter.event(event);
    let observer = Observer { cancelled, report: &report };
    let repeated = match command.as_str() {
        "render" => {
            let rounds = RoundsOf { division, tiles };
            let devices = || args.device.open(&reporter).map(Box::new);
            repeat(&path, (&made, arguments, &rounds), format, args.scene.as_deref(), devices, &observer)?
        }
        "" => {
            let elsewhere = "is for pictures of a scene's file, and this one is of the paper's box; leave it out";
            args.scene.map_or(Ok(()), |scene| Err(Error::setting("--scene", scene, elsewhere)))?;
            let request = RenderRequest { rounds: Some(made.rounds), ..RenderRequest::of_picture(&path, arguments)? };
            let devices = || args.device.open_or_none(&reporter).map(Box::new);
            repeat_room(&request, format, devices, &observer)?
        }
        _ => return Err(refuse("says otherwise than photonmill does how it was made (it is of no picture)".to_owned())),
    };
    reporter.finish();
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
