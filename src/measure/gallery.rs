//! Pictures that show what the program does best, each with the command that made it, its time and its error, on one page.
//!
//! Each exhibit is a command of this program, run as a user would. So what the page shows is what the command gives.

use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::codecs::jpeg::JpegEncoder;
use image::{DynamicImage, GenericImage, RgbImage};
use maud::{Markup, html};
use serde_json::Value;

use super::study::findings::percent;
use crate::error::{Error, Result};
use crate::output::destination::{Folder, write_all};
use crate::output::page::page;
use crate::output::words::duration;

/// What each picture may take.
#[derive(Debug, Clone)]
pub struct Request {
    /// Pixels along the width.
    pub width: u32,
    /// In percent.
    pub error: f64,
    pub seconds: f64,
    /// Options that name the device and what it may take.
    pub device: Vec<String>,
}

/// A picture of the gallery, before it is made.
struct Exhibit {
    name: &'static str,
    title: &'static str,
    text: &'static str,
    kind: Kind,
}

enum Kind {
    /// Arguments of `render`, besides size and end.
    Render(&'static str),
    /// The same; the picture is that of its error in false colours.
    Errors(&'static str),
    /// Arguments of `bake`; the lightmaps of these objects side by side.
    Lightmaps(&'static str, &'static [&'static str]),
}

/// In the order of the page; pictures of `cornell-spheres` share an exposure, so that they can be compared.
const EXHIBITS: [Exhibit; 11] = [
    Exhibit {
        name: "caustic",
        title: "A caustic",
        text: "The glass sphere focuses the lamp's light on the floor. The caustic map finds it; a path tracer meets it by chance.",
        kind: Kind::Render("cornell-spheres --exposure 0.3"),
    },
    Exhibit {
        name: "error",
        title: "Where its error is",
        text: "Standard error of each pixel of the picture before, from dark blue (none) to yellow (most, on a logarithmic scale over a factor of 1000).",
        kind: Kind::Errors("cornell-spheres --exposure 0.3"),
    },
    Exhibit {
        name: "without-caustics",
        title: "Without refractive caustics",
        text: "One effect left out: the shadow of the glass stays dark.",
        kind: Kind::Render("cornell-spheres --exposure 0.3 --without refractive-caustics"),
    },
    Exhibit {
        name: "without-indirect",
        title: "Without indirect light",
        text: "Lamp, mirror and caustic alone: what walls send to each other is missing.",
        kind: Kind::Render("cornell-spheres --exposure 0.3 --without indirect"),
    },
    Exhibit {
        name: "only-caustics",
        title: "Caustics alone",
        text: "One part of the light by itself. The four parts add up to the picture to the last bit.",
        kind: Kind::Render("cornell-spheres --exposure 0.3 --part caustic"),
    },
    Exhibit {
        name: "sunlit-room",
        title: "A sunlit room",
        text: "The only light comes through a window of 1 % of the walls. Photons and shadow rays are aimed at it.",
        kind: Kind::Render("sunlit-room"),
    },
    Exhibit {
        name: "dispersion",
        title: "Dispersion",
        text: "A beam through a slit and a prism. The index of refraction differs by colour (KHR_materials_dispersion); each photon keeps one.",
        kind: Kind::Render("prism"),
    },
    Exhibit {
        name: "lamp-in-glass",
        title: "A lamp seen through glass",
        text: "Reflection and refraction are both followed, so that the lamp's images in the sphere are no rare hits.",
        kind: Kind::Render("caustic-sphere"),
    },
    Exhibit { name: "cornell", title: "Indirect light", text: "Red and green walls tint the blocks.", kind: Kind::Render("cornell") },
    Exhibit {
        name: "paper-box",
        title: "The paper's box",
        text: "The open box of 2008 as triangles, with its two lamps and Phong walls.",
        kind: Kind::Render("open-box-phong"),
    },
    Exhibit {
        name: "lightmaps",
        title: "Lightmaps",
        text: "Irradiance of the Cornell box's floor, back wall, left wall and a side of the tall block, baked for a game engine.",
        kind: Kind::Lightmaps("cornell", &["floor", "back", "left", "tall_block"]),
    },
];

/// What a command left.
struct Shown {
    exhibit: &'static Exhibit,
    command: String,
    picture: RgbImage,
    ms: f64,
    /// Bound of noise and bias.
    error: Option<f64>,
    device: String,
}

/// Runs every command, and writes the page. False if it was interrupted; the page has what was done by then.
pub fn make(folder: &Folder, request: &Request, cancelled: &AtomicBool, tell: &mut dyn FnMut(&str)) -> Result<bool> {
    let path = folder.path();
    std::fs::create_dir_all(path).map_err(|error| Error::Output {
        option: "-o",
        path: path.to_owned(),
        reason: error.kind().to_string(),
    })?;
    let mut shown = Vec::new();
    for (number, exhibit) in (1..).zip(&EXHIBITS) {
        tell(&format!("[{number}/{}] {}", EXHIBITS.len(), exhibit.title));
        let made = show(path, request, exhibit);
        if cancelled.load(Ordering::Relaxed) {
            break;
        }
        shown.push(made?);
    }
    let complete = shown.len() == EXHIBITS.len();
    if !shown.is_empty() {
        write_all([(folder.file("index.html"), page_of(&shown, complete).into_bytes())])?;
    }
    Ok(complete)
}

fn show(folder: &Path, request: &Request, exhibit: &'static Exhibit) -> Result<Shown> {
    let Request { width, error, seconds, .. } = request;
    let place = |name: &str| folder.join(name).display().to_string();
    let picture = format!("{}.png", exhibit.name);
    let report = place(&format!("{}.json", exhibit.name));
    let end = format!("--error {error}% --time {seconds}s");
    // As the page shows it, and with the places of files; no folder's name is cut at its spaces.
    let run = |words: &str, outputs: &[(&str, String)]| {
        let mut arguments: Vec<String> = words.split(' ').map(str::to_owned).collect();
        arguments.extend(outputs.iter().flat_map(|(option, value)| [(*option).to_owned(), value.clone()]));
        arguments.extend(["--json".to_owned(), report.clone(), "--quiet".to_owned()]);
        program(exhibit.name, &[arguments, request.device.clone()].concat())
    };
    let (command, made) = match exhibit.kind {
        Kind::Render(scene) => {
            let words = format!("render {scene} --size {width} {end}");
            run(&words, &[("-o", place(&picture))])?;
            (format!("photonmill {words} -o {picture}"), open(&place(&picture))?)
        }
        Kind::Errors(scene) => {
            let words = format!("render {scene} --size {width} {end}");
            let errors = format!("{}.exr", exhibit.name);
            run(&words, &[("-o", place("error-picture.png")), ("--error-image", place(&errors))])?;
            let made = false_colours(&open_any(&place(&errors))?);
            save(&made, &place(&picture))?;
            (format!("photonmill {words} -o picture.png --error-image {errors}"), made)
        }
        Kind::Lightmaps(scene, objects) => {
            // Half of the objects are small, so the page shows the large ones.
            let words = format!("bake {scene} {end}");
            let maps = "lightmaps";
            run(&words, &[("-o", place(maps))])?;
            let objects = objects.iter().map(|object| open(&place(&format!("{maps}/{object}.png"))));
            let made = side_by_side(&objects.collect::<Result<Vec<_>>>()?);
            save(&made, &place(&picture))?;
            (format!("photonmill {words} -o {maps}"), made)
        }
    };
    let told: Value = std::fs::read(&report).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default();
    let time = |name: &str| {
        let row = told["timings"].as_array()?.iter().find(|row| row["name"] == name)?;
        row["gpu_ms"].as_f64().or(row["wall_ms"].as_f64())
    };
    Ok(Shown {
        exhibit,
        command,
        picture: made,
        ms: time("round").unwrap_or(0.0),
        error: told["total_bound"].as_f64(),
        device: told["device"].as_str().unwrap_or("").to_owned(),
    })
}

/// Runs this program; its last line on stderr says what failed.
fn program(name: &str, arguments: &[String]) -> Result<()> {
    let fail = |why: &str| Error::setting("gallery", name, format!("was not made: {}", why.trim_start_matches("photonmill: ")));
    let own = std::env::current_exe().map_err(|error| fail(&error.to_string()))?;
    let output = Command::new(own).args(arguments).output().map_err(|error| fail(&error.to_string()))?;
    if output.status.success() {
        return Ok(());
    }
    Err(fail(String::from_utf8_lossy(&output.stderr).trim().lines().last().unwrap_or("no reason was given")))
}

fn open(path: &str) -> Result<RgbImage> {
    Ok(open_any(path)?.into_rgb8())
}

fn open_any(path: &str) -> Result<DynamicImage> {
    image::open(path).map_err(|error| Error::Picture { path: path.into(), reason: error.to_string() })
}

fn save(picture: &RgbImage, path: &str) -> Result<()> {
    picture.save(path).map_err(|error| Error::Output { option: "-o", path: path.into(), reason: error.to_string() })
}

/// Values of the channels' mean on a logarithmic scale, from a thousandth of what 1 % of the pixels exceed up to that.
fn false_colours(errors: &DynamicImage) -> RgbImage {
    let errors = errors.to_rgb32f();
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

/// Two in a row, each as large as the largest.
fn side_by_side(pictures: &[RgbImage]) -> RgbImage {
    const GAP: u32 = 8;
    let side = pictures.iter().map(|picture| picture.width().max(picture.height())).max().unwrap_or(1);
    let rows = pictures.len().div_ceil(2) as u32;
    let mut all = RgbImage::from_pixel(2 * side + GAP, rows * side + (rows - 1) * GAP, image::Rgb([255; 3]));
    for (number, picture) in (0..).zip(pictures) {
        let larger = image::imageops::resize(picture, side, side, image::imageops::FilterType::Nearest);
        all.copy_from(&larger, number % 2 * (side + GAP), number / 2 * (side + GAP)).expect("it lies within");
    }
    all
}

fn page_of(shown: &[Shown], complete: bool) -> String {
    let device = shown.first().map_or("", |shown| &shown.device);
    let content = html! {
        header {
            h1 { "photonmill: a gallery" }
            p.soft { "photonmill " (env!("CARGO_PKG_VERSION")) " on " (device) ". Under each picture: the time of its rounds, and the bound of its error (noise and bias, 95 % confidence), relative to the mean." }
            @if !complete { p.notice { strong { "Incomplete." } " The gallery was interrupted." } }
        }
        div.gallery { @for one in shown { (figure(one)) } }
    };
    page("photonmill: a gallery", &content)
}

fn figure(shown: &Shown) -> Markup {
    let Shown { exhibit, command, picture, ms, error, .. } = shown;
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, 88).encode_image(picture).expect("a picture in memory can be encoded");
    html! {
        figure {
            img src={ "data:image/jpeg;base64," (STANDARD.encode(&jpeg)) } width=(picture.width()) height=(picture.height()) alt=(exhibit.title);
            figcaption {
                p { strong { (exhibit.title) } " " (exhibit.text) }
                p { strong { (duration(*ms)) } ", error at most " strong { (error.map_or_else(|| "unknown".to_owned(), percent)) } }
                details { summary { "Command" } p { code { (command) } } }
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
        let shown = false_colours(&DynamicImage::ImageRgb32F(errors));
        let colours: Vec<[u8; 3]> = shown.pixels().map(|pixel| pixel.0).collect();
        assert_eq!(colours[0], [68, 1, 84]);
        assert_eq!((colours[2], colours[3]), ([253, 231, 37], [253, 231, 37]));
    }

    #[test]
    fn pictures_stand_two_in_a_row() {
        let picture = |side: u32, grey: u8| RgbImage::from_pixel(side, side, image::Rgb([grey; 3]));
        let all = side_by_side(&[picture(4, 10), picture(2, 20), picture(4, 30)]);
        assert_eq!(all.dimensions(), (16, 16));
        assert_eq!([all.get_pixel(0, 0).0[0], all.get_pixel(12, 3).0[0], all.get_pixel(0, 12).0[0]], [10, 20, 30]);
    }
}
