//! An image made again, from what its file says of how it was made.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::ops::DerefMut;
use std::path::Path;

use super::checkpoints::Checkpoints;
use super::denoise;
use super::events::Observer;
use super::image::show;
use super::options::row;
use super::prepare::{Inputs, RequestedReceivers, prepare};
use super::request::RenderRequest;
use super::room;
use super::tuned_settings::TunedSettings;
use crate::engine::scene::map_file::MapFile;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::output::colour::Format;
use crate::output::metadata::{Metadata, devices};
use crate::output::show::Layer;
use crate::output::{colour, exr_file};
use crate::plan::work_division::Division;
use crate::scene::built_in;
use crate::settings::Math;
use crate::settings::tile_samples::TileSamples;

/// The file that comes out, and the devices that made it.
pub struct Repeated {
    pub content: Vec<u8>,
    pub devices: Vec<String>,
}

/// What each round of an image did.
#[derive(Debug, Clone)]
pub struct RoundsOf {
    pub division: Division,
    pub tiles: Option<TileSamples>,
}

impl RenderRequest {
    /// The request of an image, from what its metadata keep.
    pub fn of_picture(path: &Path, words: &[String]) -> Result<RenderRequest> {
        let damaged = |reason| format!("says otherwise than photonmill does how it was made ({reason})");
        RenderRequest::of_words(words).map_err(|reason| Error::Image { path: path.to_owned(), reason: damaged(reason) })
    }

    /// The same; fails with what the words are not.
    pub fn of_words(words: &[String]) -> std::result::Result<RenderRequest, String> {
        let mut request = RenderRequest::default();
        for word in words {
            let Some(option) = word.strip_prefix("--") else {
                if !request.scene.is_empty() {
                    return Err(format!("{word} is a second scene"));
                }
                request.scene.clone_from(word);
                continue;
            };
            let (name, value) = option.split_once('=').unwrap_or((option, "on"));
            let known = row(name).filter(|row| row.option() == name && row.is_kept(&request));
            let known = known.ok_or_else(|| format!("it has options that decide no pixel: --{name}"))?;
            (known.of)(&mut request).read(value).map_err(|allowed| format!("--{name} {value}: {allowed}"))?;
        }
        Ok(request)
    }
}

/// Renders an image again on devices that are opened once its scene is known to be the same. `scene`: where that is now; `None`: where it was.
pub fn repeat<Devices: DerefMut<Target = Vec<Gpu>>>(
    path: &Path,
    (made, arguments, rounds): (&Metadata, &[String], &RoundsOf),
    format: Format,
    scene: Option<&str>,
    devices_of: impl FnOnce() -> Result<Devices>,
    observer: &Observer,
) -> Result<Repeated> {
    let refuse = |reason: String| Error::Image { path: path.to_owned(), reason };
    let damaged = |reason: &dyn Display| refuse(format!("says otherwise than photonmill does how it was made ({reason})"));
    let tuned = TunedSettings::of_picture(made, rounds.division, rounds.tiles.clone()).map_err(|error| damaged(&error))?;
    let mut request = RenderRequest::of_picture(path, arguments)?;
    request.check_camera().map_err(|error| damaged(&error))?;
    if let Some(scene) = scene {
        scene.clone_into(&mut request.scene);
    } else if !Path::new(&request.scene).exists() && !built_in::names().contains(&request.scene.as_str()) {
        let remedy = "run it from the same folder, or say with `scene` where the scene is now";
        return Err(refuse(format!("is of the scene {}, which is not there; {remedy}", request.scene)));
    }
    request.rounds = Some(made.rounds);
    let map = request.map.as_ref().map(|path| MapFile::open("map", path)).transpose()?;
    // They are the picture's own, whatever scene they were chosen for.
    let inputs = Inputs { tuned: None, ..Inputs::with(&request, map, Some(tuned))? };
    let inputs = inputs.for_image(format == Format::Exr && show(&request, (0, 0)).layers.into_iter().any(Layer::is_part), None)?;
    if let (Some(before), Some(now)) = (&made.denoiser, inputs.denoiser.as_ref().map(denoise::name))
        && *before != now
    {
        observer.warn(format!("was denoised by {before}, and now by {now}, which may leave other bits"));
    }
    let prepared = prepare(inputs, RequestedReceivers::Image(None), observer)?;
    let hash = prepared.scene_hash();
    if let Some(before) = made.scene_hash.as_ref().filter(|before| **before != hash) {
        let remedy = "restore the scene as it was, or name another file with `scene`";
        return Err(refuse(format!("is of another scene than {} is now (SHA-256 {before}, not {hash}); {remedy}", request.scene)));
    }
    let mut gpus = devices_of()?;
    let here = devices(gpus.iter().map(Gpu::facts));
    if prepared.inputs.settings.math != Math::Strict && here != made.devices {
        let (before, now) = (made.devices.join("; "), here.join("; "));
        observer.warn(format!("made on {before}, and repeated on {now}, which may round otherwise"));
    }
    let mut checkpoints = Checkpoints::open(&request, observer)?;
    let image = prepared.image(&mut gpus, &mut checkpoints, observer)?;
    if image.run.is_cancelled() {
        return Err(Error::Interrupted);
    }
    let (content, _) = image.file(&request, format, observer);
    Ok(Repeated { content, devices: image.devices() })
}

/// Lights the paper's box again.
pub fn repeat_room<Devices: DerefMut<Target = Vec<Gpu>>>(
    request: &RenderRequest,
    format: Format,
    devices_of: impl FnOnce() -> Result<Devices>,
    observer: &Observer,
) -> Result<Repeated> {
    let image = room::render(&mut *devices_of()?, request, observer)?;
    if image.result.is_cancelled() {
        return Err(Error::Interrupted);
    }
    Ok(Repeated { content: image.file(format), devices: image.devices() })
}

/// Values that differ, of how many.
pub struct Differing {
    pub count: usize,
    pub of: usize,
}

/// Compares the values of an image with those of another one, to the bit. What the other one has beside them is not compared: layers
/// that a run could not keep, which went on with a checkpoint without them.
pub fn differing(before: &[u8], after: &[u8], format: Format) -> std::result::Result<Differing, String> {
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
