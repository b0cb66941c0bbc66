//! The paper's four figures: films of its settings, as pictures side by side.

use super::bench::Bench;
use super::published;
use crate::engine::room::film::{WallEstimate, estimate_walls};
use crate::error::Result;
use crate::output::colour::Format;
use crate::output::command;
use crate::output::image::{Picture, overview, view};
use crate::scene::open_box::open_box;
use crate::settings::{Preset, RoomSettings};
use crate::text::counted;

pub const COUNT: usize = 4;

pub struct Figure {
    pub number: usize,
    pub title: &'static str,
    /// What to look for.
    pub caption: &'static str,
    pub frames: Vec<Frame>,
    pub width: usize,
    pub height: usize,
    pub png: Vec<u8>,
}

/// One picture of a figure.
pub struct Frame {
    pub label: String,
    pub command: String,
    pub settings: RoomSettings,
    pub walls: Vec<WallEstimate>,
}

/// What a figure shows, before it is made.
struct Exhibit {
    title: &'static str,
    caption: &'static str,
    /// Label, preset and settings of each frame.
    frames: Vec<(String, Preset, RoomSettings)>,
    columns: usize,
}

pub fn make(bench: &mut Bench, figures: &mut Vec<Figure>) -> Result<()> {
    for (number, Exhibit { title, caption, frames, columns }) in (1..).zip(exhibits()) {
        bench.begin(&format!("figure {number}: {title}"))?;
        let frames = frames.into_iter().map(|(label, preset, settings)| frame(bench, label, preset, settings));
        let frames = frames.collect::<Result<Vec<Frame>>>()?;
        let picture = compose(&frames, columns);
        let (width, height, png) = (picture.width, picture.height, picture.encode(Format::Png, None));
        figures.push(Figure { number, title, caption, frames, width, height, png });
    }
    Ok(())
}

fn exhibits() -> [Exhibit; COUNT] {
    let naive = RoomSettings::preset(Preset::Naive);
    let modified = RoomSettings::preset(Preset::Modified);
    let phong = |shininess: f32| RoomSettings { shininess: [Some(shininess); 5], ..RoomSettings::preset(Preset::Phong) };
    let rounds = |rounds: u32| RoomSettings { rounds, ..RoomSettings::preset(Preset::Rounds) };
    [
        Exhibit {
            title: "the naive implementation, 2 bounces",
            caption: "Left: the box unfolded around its back wall. Right: four views from in front of its opening. \
                A light emits away from its own wall, so the adjacent walls are brightest near it: \
                low on the walls around the floor's light, and at the left of the walls around the left wall's light. \
                Shaded places are dim but not black. \
                The blotches are noise: there are only 5000 photons, each spread over a disc of radius 0.05 m.",
            frames: vec![("2 bounces".to_owned(), Preset::Naive, naive.clone())],
            columns: 1,
        },
        Exhibit {
            title: "15 bounces (left) and 2 bounces (right)",
            caption: "Both images contain the same photons for the first two bounces. The next thirteen bounces brighten every wall, including its shaded places. \
                The paper's text and its caption disagree about the order of the two images; this page follows the text.",
            frames: vec![
                ("15 bounces, modified".to_owned(), Preset::Modified, modified),
                ("2 bounces, naive".to_owned(), Preset::Naive, naive),
            ],
            columns: 2,
        },
        Exhibit {
            title: "Phong walls, shininess 2.0, 0.5 and 0.01",
            caption: "The weight of a photon is the cosine between its mirror direction and the direction to the eye, raised to the shininess. \
                At 2.0 the back wall, which faces the eye, is brightest, and the walls along the line of sight are dark. \
                As the shininess approaches 0, every photon reflected towards the eye's side has weight 1, and the image approaches the left image of figure 2.",
            frames: published::FIGURE_3_SHININESS
                .map(|shininess| (format!("shininess {shininess}"), Preset::Phong, phong(shininess)))
                .into(),
            columns: 3,
        },
        Exhibit {
            title: "1, 5, 10, 25, 50 and 100 rounds",
            caption: "From top left to bottom right. Every round adds 5000 photons. Noise decreases, but the radius (here 0.025 m) is fixed: \
                the dark rims along the edges, where part of each disc lies beyond the wall, remain after 100 rounds.",
            frames: published::FIGURE_4_ROUNDS.map(|count| (counted(count, "round"), Preset::Rounds, rounds(count))).into(),
            columns: 3,
        },
    ]
}

fn frame(bench: &Bench, label: String, preset: Preset, settings: RoomSettings) -> Result<Frame> {
    let settings = RoomSettings { builder: bench.available(settings.builder), ..settings };
    let outcome = bench.run(&settings)?;
    let walls = estimate_walls(&outcome.film, &open_box(&settings), &outcome.plan);
    Ok(Frame { label, command: command::main_job(preset, &settings), settings, walls })
}

/// Pixels between pictures.
const GAP: usize = 6;
/// Pixels along a picture, for two and for three in a row.
const HALF_ROW: usize = 480;
const THIRD_ROW: usize = 384;

/// One frame as an overview, several as a mesh of views.
fn compose(frames: &[Frame], columns: usize) -> Picture {
    let scene = |frame: &Frame| open_box(&frame.settings);
    if let [only] = frames {
        return overview(&scene(only), &only.walls);
    }
    let side = if columns == 2 { HALF_ROW } else { THIRD_ROW };
    let along = |count: usize| count * side + (count - 1) * GAP;
    let mut picture = Picture::black(along(columns), along(frames.len().div_ceil(columns)));
    picture.values.fill(1.0);
    for (place, frame) in frames.iter().enumerate() {
        let (column, row) = (place % columns, place / columns);
        picture.paste(&view(&scene(frame), &frame.walls, side), column * (side + GAP), row * (side + GAP));
    }
    picture
}
