//! The paper's four figures: films of its settings, as labelled pictures, and the same with other seeds.

use super::bench::Bench;
use super::experiments::command;
use super::published;
use crate::engine::room::film::{WallEstimate, estimate_walls};
use crate::error::Result;
use crate::measure::interval::Interval;
use crate::output::colour::Format;
use crate::output::image::{VIEWS, unfolded, view};
use crate::render::RenderRequest;
use crate::render::values::{Shininess, Variant};
use crate::scene::open_box::open_box;
use crate::settings::{Preset, RoomSettings};
use crate::text::counted;

pub(crate) const COUNT: usize = 4;
/// Every figure is computed with the seeds from 1 to this; those of seed 1 are shown.
pub(crate) const SEEDS: u64 = 5;

pub(crate) struct Figure {
    pub number: usize,
    pub title: &'static str,
    /// What the paper's figure shows.
    pub published: &'static str,
    /// What to look for.
    pub caption: &'static str,
    pub frames: Vec<Frame>,
    /// The same frames with other seeds.
    pub repeats: Vec<Vec<Frame>>,
    pub panels: Vec<Panel>,
}

/// The light of one run.
pub(crate) struct Frame {
    pub label: String,
    pub command: String,
    pub settings: RoomSettings,
    pub walls: Vec<WallEstimate>,
}

/// One picture of a figure.
pub(crate) struct Panel {
    pub label: String,
    /// Pixels along each side.
    pub side: usize,
    pub png: Vec<u8>,
}

/// What a figure shows, before it is made.
struct Exhibit {
    title: &'static str,
    published: &'static str,
    caption: &'static str,
    /// Label and request of each frame.
    frames: Vec<(String, RenderRequest)>,
}

pub(crate) fn make(bench: &mut Bench, figures: &mut Vec<Figure>) -> Result<()> {
    for (number, Exhibit { title, published, caption, frames }) in (1..).zip(exhibits()) {
        bench.begin(&format!("figure {number}: {title}"))?;
        let with_seed = |seed: u64| frames.iter().map(|exhibited| frame(bench, exhibited, seed)).collect::<Result<Vec<Frame>>>();
        let first = with_seed(1)?;
        let panels = panels(&first);
        figures.push(Figure { number, title, published, caption, frames: first, repeats: Vec::new(), panels });
        for seed in 2..=SEEDS {
            let repeat = with_seed(seed)?;
            figures.last_mut().expect("pushed above").repeats.push(repeat);
        }
    }
    Ok(())
}

impl Figure {
    /// A number that follows from the figure's frames, over all seeds; it is positive.
    pub(crate) fn over_seeds(&self, of: impl Fn(&[Frame]) -> f64) -> Interval {
        let seeds = std::iter::once(&self.frames).chain(&self.repeats);
        Interval::of_geometric_mean(&seeds.map(|frames| of(frames)).collect::<Vec<f64>>())
    }
}

impl Panel {
    /// `figure2b.png` is the second picture of figure 2.
    pub(crate) fn file_name(number: usize, place: usize) -> String {
        format!("figure{number}{}.png", letter(place))
    }
}

/// The letter of a panel.
pub(crate) fn letter(place: usize) -> char {
    ('a'..='z').nth(place).expect("a figure has at most six panels")
}

fn exhibits() -> [Exhibit; COUNT] {
    let of = |preset: Preset| RenderRequest { preset: Some(preset), ..RenderRequest::default() };
    let phong = |shininess: f32| RenderRequest { shininess: Some(Shininess([shininess; 5])), ..of(Preset::Phong) };
    let rounds = |rounds: u32| RenderRequest { rounds: Some(rounds), ..of(Preset::Rounds) };
    [
        Exhibit {
            title: "the naive implementation, 2 bounces",
            published: "The box from several angles. Places near the lights are much brighter than places that only reflected light reaches, \
                yet no place is black. The image is noisy, which the paper attributes to the small number of photons.",
            caption: "A light emits away from its own wall, so the adjacent walls are brightest near it: \
                low on the walls around the floor's light, and at the left of the walls around the left wall's light. \
                The blotches are noise: there are only 5000 photons, each spread over a disc of radius 0.05 m.",
            frames: vec![("2 bounces".to_owned(), of(Preset::Naive))],
        },
        Exhibit {
            title: "15 bounces and 2 bounces",
            published: "Two images that differ little. The one with 15 bounces is brighter where light arrives only after reflections.",
            caption: "Both images contain the same photons for the first two bounces. The next thirteen bounces brighten every wall, including its shaded places. \
                The paper's text and its caption disagree about the order of the two images; this page follows the text.",
            frames: vec![("15 bounces, modified".to_owned(), RenderRequest::default()), ("2 bounces, naive".to_owned(), of(Preset::Naive))],
        },
        Exhibit {
            title: "Phong walls, shininess 2.0, 0.5 and 0.01",
            published: "The box with Phong walls at three values of shininess. The text names the values and does not say how the images differ.",
            caption: "The weight of a photon is the cosine between its mirror direction and the direction to the eye, raised to the shininess. \
                At 2.0 the back wall, which faces the eye, is brightest, and the walls along the line of sight are dark. \
                As the shininess approaches 0, every photon reflected towards the eye's side has weight 1, and the image approaches figure 2 (a).",
            frames: published::FIGURE_3_SHININESS.map(|shininess| (format!("shininess {shininess}"), phong(shininess))).into(),
        },
        Exhibit {
            title: "1, 5, 10, 25, 50 and 100 rounds",
            published: "Six images of the same box. From 1 round of photons to 100 rounds the noise clearly decreases.",
            caption: "Every round adds 5000 photons. Noise decreases, but the radius (here 0.025 m) is fixed: \
                the dark rims along the edges, where part of each disc lies beyond the wall, remain after 100 rounds.",
            frames: published::FIGURE_4_ROUNDS.map(|count| (counted(count, "round"), rounds(count))).into(),
        },
    ]
}

fn frame(bench: &Bench, (label, request): &(String, RenderRequest), seed: u64) -> Result<Frame> {
    let builder = bench.available(request.room_settings().builder);
    let request = RenderRequest { variant: Some(Variant::Of(builder)), seed: Some(seed), ..request.clone() };
    let settings = request.room_settings();
    let result = bench.run(&settings)?;
    let walls = estimate_walls(&result.film, &open_box(&settings), &result.plan);
    Ok(Frame { label: label.clone(), command: command(&request), settings, walls })
}

/// Pixels along a picture, where a row has two and where it has more.
const LARGE_SIDE: usize = 480;
const SMALL_SIDE: usize = 384;
/// The view of figures that show the box from one point.
const VIEW: usize = 1;

/// A single frame unfolded and from every side, several each from the same point.
fn panels(frames: &[Frame]) -> Vec<Panel> {
    if let [only] = frames {
        let scene = open_box(&only.settings);
        let seen = VIEWS.iter().enumerate().map(|(number, (name, _))| ((*name).to_owned(), view(&scene, &only.walls, number, SMALL_SIDE)));
        let walls = std::iter::once(("walls unfolded around the back wall".to_owned(), unfolded(&scene, &only.walls)));
        return walls
            .chain(seen)
            .map(|(label, picture)| Panel { label, side: picture.width, png: picture.encode(Format::Png, None) })
            .collect();
    }
    let side = if frames.len() == 2 { LARGE_SIDE } else { SMALL_SIDE };
    let picture = |frame: &Frame| view(&open_box(&frame.settings), &frame.walls, VIEW, side).encode(Format::Png, None);
    frames.iter().map(|frame| Panel { label: frame.label.clone(), side, png: picture(frame) }).collect()
}
