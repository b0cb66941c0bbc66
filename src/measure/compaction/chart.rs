//! The fastest builder by photon count and survival: a cell for each pair, in the builder's colour.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::Map;
use crate::output::svg::{Chart, SCALE, TEXT, svg};
use crate::output::words::times;
use crate::settings::Builder;

/// Colours on which black letters are read, on a white and on a black page.
fn colour(builder: Builder) -> RGBColor {
    match builder {
        Builder::Naive => RGBColor(0xb0, 0xb0, 0xb0),
        Builder::Atomic => RGBColor(0xf2, 0x9a, 0x4a),
        Builder::Ballot => RGBColor(0x62, 0xb8, 0xea),
        Builder::Group => RGBColor(0x74, 0xc9, 0x8d),
        Builder::Scan => RGBColor(0xcf, 0x92, 0xdf),
        Builder::Persistent => RGBColor(0xe6, 0xc8, 0x4f),
        Builder::Cpu => RGBColor(0xf0, 0x82, 0x96),
    }
}

const FIELD: (i32, i32) = (92, 64);
const LEFT: i32 = 110;
const TOP: i32 = 16;

/// Photons to the right, survival upwards, a scene on top; in each cell the fastest builder, its speed-up over one atomic per thread, and,
/// in small letters, the builders that are not significantly slower.
pub(crate) fn draw(map: &Map) -> Chart {
    let (sizes, rows) = (map.sizes(), map.rows());
    let width = LEFT + FIELD.0 * sizes.len() as i32 + 16;
    let height = TOP + FIELD.1 * rows.len() as i32 + 56;
    let drawn = svg((width as u32, height as u32), |area| {
        let bottom = TOP + FIELD.1 * rows.len() as i32;
        for (row, cells) in rows.iter().enumerate() {
            let top = bottom - FIELD.1 * (row as i32 + 1);
            let label = cells[0].scene.clone().unwrap_or_else(|| format!("{:.0} % survive", 100.0 * cells[0].survival));
            area.draw(&Text::new(label, (LEFT - 8, top + FIELD.1 / 2), text(TEXT - 3, HPos::Right, &SCALE)))?;
            for (column, cell) in cells.iter().enumerate() {
                let (left, middle) = (LEFT + FIELD.0 * column as i32, LEFT + FIELD.0 * column as i32 + FIELD.0 / 2);
                let winner = cell.builders[0].builder;
                let corners = [(left + 1, top + 1), (left + FIELD.0 - 1, top + FIELD.1 - 1)];
                area.draw(&Rectangle::new(corners, colour(winner).filled()))?;
                let level: Vec<&str> = cell.winners().skip(1).map(Builder::name).collect();
                let mut lines = vec![(TEXT - 2, 13, winner.name().to_owned()), (TEXT - 3, 30, times(cell.gain()))];
                // As many names as a cell is wide.
                lines.extend(level.chunks(2).zip([43, 52, 60]).map(|(names, y)| (TEXT - 7, y, names.join(" "))));
                for (size, y, words) in lines {
                    area.draw(&Text::new(words, (middle, top + y), text(size, HPos::Center, &BLACK)))?;
                }
            }
        }
        for (column, photons) in sizes.iter().enumerate() {
            let middle = LEFT + FIELD.0 * column as i32 + FIELD.0 / 2;
            area.draw(&Text::new(format!("2^{}", photons.ilog2()), (middle, bottom + 14), text(TEXT - 3, HPos::Center, &SCALE)))?;
        }
        let middle = LEFT + FIELD.0 * sizes.len() as i32 / 2;
        area.draw(&Text::new("photons", (middle, bottom + 38), text(TEXT - 3, HPos::Center, &SCALE)))
    });
    Chart::of_one_size(drawn)
}

fn text(size: u32, horizontal: HPos, colour: &RGBColor) -> TextStyle<'_> {
    TextStyle::from(("sans-serif", size).into_font()).pos(Pos::new(horizontal, VPos::Center)).color(colour)
}
