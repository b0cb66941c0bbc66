//! Pictures that show what the program does best, each with the command that made it, its time and its error, on one page.
//!
//! `gallery.txt` has a paragraph for each: title, caption, command, and the files that it shows. Commands are run as a user would,
//! so what the page shows is what they give.

use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use maud::{Markup, html};
use serde_json::Value;

use crate::error::{Error, Result};
use crate::output::destination::{Folder, write_all};
use crate::output::page::{self, page};
use crate::output::words::duration;
use crate::text::percent;

/// What each picture may take.
#[derive(Debug, Clone)]
pub(crate) struct GalleryRequest {
    /// Pixels along the width.
    pub width: u32,
    /// In percent.
    pub error: f64,
    pub seconds: f64,
    /// Options that name the device and what it may take.
    pub device: Vec<String>,
}

/// Pictures of `cornell-spheres` share an exposure, so that they can be compared.
const EXHIBITS: &str = include_str!("gallery.txt");

/// Runs every command, and writes the page. False if it was interrupted; the page has what was done by then.
pub(crate) fn make(
    folder: &Folder,
    request: &GalleryRequest,
    cancelled: &AtomicBool,
    report_progress: &mut dyn FnMut(&str),
) -> Result<bool> {
    let path = folder.path();
    std::fs::create_dir_all(path).map_err(|error| Error::Output {
        option: "-o",
        path: path.to_owned(),
        reason: error.kind().to_string(),
    })?;
    let GalleryRequest { width, error, seconds, .. } = request;
    let in_full = EXHIBITS.replace("SIZE", &format!("--size {width}")).replace("END", &format!("--error {error}% --time {seconds}s"));
    let exhibits: Vec<Vec<&str>> = in_full.split("\n\n").map(|paragraph| paragraph.lines().collect()).collect();
    let (mut figures, mut device) = (Vec::new(), String::new());
    for (number, exhibit) in (1..).zip(&exhibits) {
        let [title, caption, command, files] = exhibit[..] else { unreachable!("four lines each") };
        report_progress(&format!("[{number}/{}] {title}", exhibits.len()));
        let made = run(path, command, &request.device);
        if cancelled.load(Ordering::Relaxed) {
            break;
        }
        let report = made?;
        let pictures: Vec<RgbImage> = files.split(' ').map(|file| open(&path.join(file))).collect::<Result<_>>()?;
        figures.push(figure([title, caption, command], &pictures, &report));
        device = report["device"].as_str().unwrap_or("").to_owned();
    }
    let complete = figures.len() == exhibits.len();
    if !figures.is_empty() {
        write_all([(folder.file("index.html"), page_of(&figures, &device, complete).into_bytes())])?;
    }
    Ok(complete)
}

/// Runs this program in the folder. Its report, named as what the command writes last; or what its last line says of a failure.
fn run(folder: &Path, command: &str, device: &[String]) -> Result<Value> {
    let name = Path::new(command.rsplit(' ').next().unwrap_or(command)).with_extension("");
    let fail = |why: &str| Error::setting("gallery", name.display(), format!("was not made: {}", why.trim_start_matches("photonmill: ")));
    let report = name.with_extension("json");
    let own = std::env::current_exe().map_err(|error| fail(&error.to_string()))?;
    let mut program = Command::new(own);
    program.args(command.split(' ')).args(device).arg("--quiet").arg("--json").arg(&report).current_dir(folder);
    let output = program.output().map_err(|error| fail(&error.to_string()))?;
    if !output.status.success() {
        return Err(fail(String::from_utf8_lossy(&output.stderr).trim().lines().last().unwrap_or("no reason was given")));
    }
    Ok(std::fs::read(folder.join(report)).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default())
}

/// A picture; one of errors in false colours, which is kept as a PNG beside it.
fn open(path: &Path) -> Result<RgbImage> {
    let picture = image::open(path).map_err(|error| Error::Image { path: path.to_owned(), reason: error.to_string() })?;
    if path.extension().is_none_or(|extension| extension != "exr") {
        return Ok(picture.into_rgb8());
    }
    let (path, made) = (path.with_extension("png"), false_colours(&picture.into_rgb32f()));
    made.save(&path).map_err(|error| Error::Output { option: "-o", path, reason: error.to_string() })?;
    Ok(made)
}

/// Values of the channels' mean on a logarithmic scale, from a thousandth of what 1 % of the pixels exceed up to that.
fn false_colours(errors: &image::Rgb32FImage) -> RgbImage {
    let mean = |pixel: &image::Rgb<f32>| pixel.0.iter().sum::<f32>() / 3.0;
    let mut known: Vec<f32> = errors.pixels().map(mean).filter(|value| value.is_finite()).collect();
    known.sort_by(f32::total_cmp);
    let most = known.get(known.len() * 99 / 100).copied().unwrap_or(1.0).max(f32::MIN_POSITIVE);
    RgbImage::from_fn(errors.width(), errors.height(), |x, y| {
        let share = 1.0 + (mean(errors.get_pixel(x, y)) / most).max(1e-3).log10() / 3.0;
        image::Rgb(scale(share.clamp(0.0, 1.0)))
    })
}

/// From dark blue over green to yellow, evenly bright steps, after matplotlib's viridis (Smith and van der Walt 2015).
fn scale(share: f32) -> [u8; 3] {
    const STEPS: [[f32; 3]; 5] = [[68.0, 1.0, 84.0], [59.0, 82.0, 139.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [253.0, 231.0, 37.0]];
    let place = share * (STEPS.len() - 1) as f32;
    let from = (place as usize).min(STEPS.len() - 2);
    let part = place - from as f32;
    std::array::from_fn(|channel| (STEPS[from][channel] + part * (STEPS[from + 1][channel] - STEPS[from][channel])).round() as u8)
}

fn page_of(figures: &[Markup], device: &str, complete: bool) -> String {
    let content = html! {
        header {
            h1 { "photonmill: a gallery" }
            p.soft { "photonmill " (env!("CARGO_PKG_VERSION")) " on " (device) ". Under each picture: the time of its rounds, and the bound of its error (noise and bias, 95 % confidence), relative to the mean." }
            @if !complete { p.notice { strong { "Incomplete." } " The gallery was interrupted." } }
        }
        div.gallery { @for figure in figures { (figure) } }
    };
    page("photonmill: a gallery", &content)
}

fn figure([title, caption, command]: [&str; 3], pictures: &[RgbImage], report: &Value) -> Markup {
    let shown = |picture: &RgbImage| {
        let mut jpeg = Vec::new();
        JpegEncoder::new_with_quality(&mut jpeg, 88).encode_image(picture).expect("a picture in memory can be encoded");
        page::picture("jpeg", &jpeg, picture.dimensions(), title)
    };
    let rows = report["timings"].as_array().into_iter().flatten();
    let round = rows.into_iter().find(|row| row["name"] == "round");
    let ms = round.and_then(|row| row["gpu_ms"].as_f64().or(row["wall_ms"].as_f64())).unwrap_or(0.0);
    let error = report["total_bound"].as_f64().map_or_else(|| "unknown".to_owned(), percent);
    html! {
        figure {
            div.pictures[pictures.len() > 1] {
                @for picture in pictures { (shown(picture)) }
            }
            figcaption {
                p { strong { (title) } " " (caption) }
                p { strong { (duration(ms)) } ", error at most " strong { (error) } }
                details { summary { "Command" } p { code { "photonmill " (command) } } }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_colours_from_least_to_most() {
        let values = [0.0, 1e-3, 1.0, f32::INFINITY].map(|value| image::Rgb([value; 3]));
        let errors = image::Rgb32FImage::from_fn(4, 1, |x, _| values[x as usize]);
        let colours: Vec<[u8; 3]> = false_colours(&errors).pixels().map(|pixel| pixel.0).collect();
        assert_eq!(colours[0], [68, 1, 84]);
        assert_eq!((colours[2], colours[3]), ([253, 231, 37], [253, 231, 37]));
    }
}
