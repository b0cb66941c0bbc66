//! `photonmill merge`: adds the parts of a run, to the bits of one that did all of it.

use std::path::PathBuf;

use clap::Args;

use super::request::{MERGE, RequestArgs};
use super::{JsonArg, complain, optional_file, say_beside};
use crate::engine::run::blocks::Share;
use crate::engine::run::saved::{NotMerged, SavedFilm, SavedRun};
use crate::engine::scene::SceneFilm;
use crate::error::{Error, Result, require};
use crate::output::colour::Format;
use crate::output::destination::{Destination, check_distinct, check_not_read, write_all, write_synced};
use crate::output::merge_report;
use crate::output::metadata::{Metadata, Repeat, errors};
use crate::output::show::units;
use crate::plan::sensor::Sensor;
use crate::render::checkpoints::read;
use crate::render::image::{check_format, name_in_text, show};
use crate::text::quoted;
use serde_json::Value;

#[derive(Args)]
pub(super) struct MergeArgs {
    /// Files of --checkpoint, all of one run, in any order
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Picture: an .exr holds linear radiance in W/m2/sr, a .png is sRGB, for the eye
    #[arg(short, long, alias = "out", value_name = "FILE", help_heading = "Output")]
    output: Option<PathBuf>,
    /// Write the standard error of each pixel as an .exr, W/m2/sr; infinite where unknown
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    error_image: Option<PathBuf>,
    #[command(flatten)]
    request: RequestArgs<MERGE>,
    #[command(flatten)]
    json: JsonArg,
    /// Write the sums of all parts, with which `--resume` of the same command goes on
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    checkpoint: Option<PathBuf>,
    /// Take what is there, although shards are missing or not finished
    #[arg(long, help_heading = "Output")]
    partial: bool,
}

pub(super) fn run(args: &MergeArgs) -> Result<()> {
    let format = args.output.as_ref().map(|path| Format::of("-o", path)).transpose()?;
    if let Some(path) = &args.error_image {
        require(Format::of("--error-image", path)? == Format::Exr, "--error-image", path.display(), "must end in .exr")?;
    }
    check_format(&args.request.0, args.output.as_deref())?;
    let picture = optional_file("-o", args.output.as_ref())?;
    let errors = optional_file("--error-image", args.error_image.as_ref())?;
    let json = optional_file("--json", args.json.json.as_ref())?;
    let checkpoint = args.checkpoint.as_ref().map(|path| Destination::open_file("--checkpoint", path)).transpose()?;
    let all: Vec<Destination> = [&picture, &errors, &json, &checkpoint].into_iter().flatten().cloned().collect();
    check_distinct(&all)?;
    check_not_read(&all, args.files.iter().map(PathBuf::as_path))?;

    let Merged { run, parts } = merge(&args.files)?;
    let missing = missing(&run, &parts);
    if !missing.is_empty() {
        let line = missing.join(", ");
        if !args.partial {
            let remedy = "run them again, or take what is there with --partial";
            return Err(Error::setting("merge", format!("of {} files", args.files.len()), format!("{line}; {remedy}")));
        }
        complain(&format!("{line}; the result is of what is there"));
    }
    let film = film_of(&run, args)?;
    let mut files = Vec::new();
    if let (Some(film), Some(Sensor::Picture { width, height })) = (film, run.sensor) {
        let show = show(&args.request.0, (width, height));
        files.extend(picture.zip(format).map(|(picture, format)| {
            let metadata = |stops| metadata(args.command(format), &run, film, units(format, stops, &show));
            let content = if format == Format::Exr { show.exr(film, &[], Some(&metadata(0.0))) } else { show.png(film, metadata).0 };
            (picture, content)
        }));
        files.extend(errors.map(|errors| (errors, show.errors(film))));
        files.extend(json.map(|json| (json, merge_report::json(&run, film, &missing))));
    }
    write_all(files)?;
    checkpoint.iter().try_for_each(|file| write_synced(file, &run.to_bytes()))?;
    let wrote: String = all.iter().map(|file| format!("\nwrote {}", file.path().display())).collect();
    say_beside(&all, &format!("{}{wrote}", merge_report::text(&run, args.files.len(), film).trim_end()))
}

impl MergeArgs {
    /// What makes the same picture.
    fn command(&self, format: Format) -> String {
        let files = self.files.iter().map(|path| path.to_string_lossy().into_owned());
        let output = ["-o".to_owned(), name_in_text(format).to_owned()];
        let words = ["photonmill", "merge"].map(str::to_owned).into_iter().chain(files).chain(self.request.0.words()).chain(output);
        words.map(quoted).collect::<Vec<_>>().join(" ")
    }
}

/// A picture's film; of what else there is neither a picture nor a report can be made without the scene.
fn film_of<'a>(run: &'a SavedRun, args: &MergeArgs) -> Result<Option<&'a SceneFilm>> {
    match (&run.film, run.sensor) {
        (SavedFilm::Scene(film), Some(Sensor::Picture { .. })) => Ok(Some(film)),
        _ => {
            let asked = [("-o", &args.output), ("--error-image", &args.error_image), ("--json", &args.json.json)];
            let asked = asked.into_iter().find_map(|(option, path)| Some((option, path.as_ref()?)));
            let allowed = "is for pictures, and these files are of none; write --checkpoint, and give it to the same command with --resume";
            asked.map_or(Ok(None), |(option, path)| Err(Error::setting(option, path.display(), allowed)))
        }
    }
}

/// All parts together, and which they were.
struct Merged {
    run: SavedRun,
    parts: Vec<Share>,
}

/// One file after the other, as all of them may be too large for memory.
fn merge(files: &[PathBuf]) -> Result<Merged> {
    let mut merged: Option<Merged> = None;
    let mut read_before = Vec::new();
    for path in files {
        let part = read("FILE", path)?;
        let refused = |reason: String| Error::setting("FILE", path.display(), reason);
        let Some(Merged { run, parts }) = &mut merged else {
            read_before.push((path, part.done.clone()));
            merged = Some(Merged { parts: vec![part.share], run: part });
            continue;
        };
        if let Some(difference) = run.identity.differs_from(&part.identity) {
            return Err(refused(format!("{difference} (as {} is)", files[0].display())));
        }
        run.merge(&part).map_err(|reason| {
            let damaged = "one of them is damaged; use an older copy, or compute that part anew";
            refused(match reason {
                NotMerged::Twice(block) => {
                    let (other, _) = read_before.iter().find(|(_, done)| done.contains(block)).expect("some file has the block");
                    format!("holds block {block}, which {} holds too; give each part once", other.display())
                }
                NotMerged::OtherShape => format!("holds other sums than {} holds, so {damaged}", files[0].display()),
                NotMerged::TooLarge => format!("and the files before it hold more light than a run can, so {damaged}"),
            })
        })?;
        parts.push(part.share);
        read_before.push((path, part.done));
    }
    Ok(merged.expect("clap asks for a file"))
}

/// Each shard of which blocks are missing, in words.
fn missing(run: &SavedRun, parts: &[Share]) -> Vec<String> {
    let of = parts.iter().map(|share| share.of).max().unwrap_or(1);
    let shares = (0..of).map(|number| Share { number, of });
    let word = |share: Share| {
        let (missing, all) = (share.missing(&run.done, run.wanted), share.count(run.wanted));
        let name = if of == 1 { "the run".to_owned() } else { format!("shard {} of {of}", share.number + 1) };
        match missing {
            0 => None,
            _ if missing == all => Some(format!("missing: {name}")),
            _ => Some(format!("unfinished: {name} ({} of {all} blocks)", all - missing)),
        }
    };
    shares.filter_map(word).collect()
}

/// A picture that was put together from parts of a run.
fn metadata(command: String, run: &SavedRun, film: &SceneFilm, units: String) -> Metadata {
    let confidence = film.plan.confidence;
    let [error, error_bound] = errors(&film.error(confidence).stated(), confidence);
    Metadata {
        photonmill: env!("CARGO_PKG_VERSION").to_owned(),
        devices: run.identity.device.iter().cloned().collect(),
        scene: run.identity.scene.clone(),
        scene_hash: None,
        seed: run.identity.settings.get("seed").and_then(Value::as_u64).unwrap_or_default(),
        rounds: film.rounds,
        degrees_of_freedom: film.error_freedom(),
        error,
        error_bound,
        confidence,
        denoiser: None,
        units,
        command,
        settings: run.identity.settings.clone(),
        repeat: Repeat::Not("was put together by merge; repeat the picture of one run that does all of it".to_owned()),
    }
}
