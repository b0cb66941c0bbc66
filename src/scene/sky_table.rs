//! How light is sampled from the picture of a sky: by a table of cells, each chosen by what it sends, as in Pharr, Jakob and Humphreys
//! (2016), section 14.2.4.

use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;

use glam::DVec3;
use rayon::prelude::*;

use super::choices::{CHOICES, deal};
use super::sky::Sky;

/// Cells of the table in a row, and rows: parts of a small picture's texels, several texels of a large one's. What differs within a
/// cell is noise, and no bias.
const COLUMNS: RangeInclusive<u32> = 512..=2048;
const ROWS: RangeInclusive<u32> = 256..=1024;
/// Of the brightest cell, what others have at least that belong to the brightest part.
const BRIGHT: f64 = 0.25;
/// Most of the light samples that leave the cosine's directions for the table's, however small the sun.
const MOST_BY_TABLE: f64 = 0.75;

/// Rows of equal angle and cells of equal azimuth.
pub(crate) struct Table {
    pub columns: u32,
    pub rows: u32,
    /// For the kernels: the rows' cumulative shares; then each row's edges as 1 - |cosine| of the angle to the vertical; then for each
    /// row the cumulative shares of its cells.
    pub words: Vec<u32>,
    /// Integral of the picture over all directions, per channel, in texels' units.
    pub integral: DVec3,
    /// The most that a channel of a texel exceeds 4 pi times the density with which its cell is chosen.
    pub most_over_density: f64,
    /// The largest value of a texel.
    pub most: f32,
    /// Share of light samples that the table should choose.
    pub share: f64,
    /// A cone around the brightest part, in the picture's axes: its axis, and 1 - cosine of its half angle.
    pub sun: (DVec3, f64),
}

impl Sky {
    /// What samples it.
    pub(crate) fn table(&self) -> Table {
        let (width, height) = (self.texture.width, self.texture.height);
        // An even number of rows: each lies above or below the horizon.
        let cells = |size: u32, allowed: RangeInclusive<u32>| (size * allowed.start().div_ceil(size)).min(*allowed.end());
        let (columns, rows) = (cells(width, COLUMNS), cells(height, ROWS).next_multiple_of(2));
        let texel = |i: i64, j: usize| {
            let place = j * width as usize + i.rem_euclid(i64::from(width)) as usize;
            self.texture.texels.at(place).truncate().as_dvec3()
        };
        let near_columns: Vec<Vec<(i64, f64)>> = (0..columns).map(|column| near(column, columns, width)).collect();
        let edge_cosine = |edge: u32| (PI * f64::from(edge) / f64::from(rows)).cos();
        let cells_of = |row: u32| {
            let near_rows = near(row, rows, height);
            // The mean of the rows, then of the texels whose tents reach into a cell; and the largest of them.
            let column = |i: i64| {
                mean_and_most(&near_rows, |j| {
                    let value = texel(i, j.clamp(0, i64::from(height) - 1) as usize);
                    (value, value.max_element())
                })
            };
            let columns: Vec<(DVec3, f64)> = (0..i64::from(width)).map(column).collect();
            let cell = |near_columns: &Vec<(i64, f64)>| mean_and_most(near_columns, |i| columns[i.rem_euclid(i64::from(width)) as usize]);
            near_columns.iter().map(cell).collect::<Vec<(DVec3, f64)>>()
        };
        // By row, so that the cells of all at once need no memory.
        struct Row {
            sum: DVec3,
            squares: f64,
            words: Vec<u32>,
            most_over_share: f64,
            most: f64,
            weights: Vec<f64>,
        }
        let of_row = |row: u32| {
            let cells = cells_of(row);
            let weights: Vec<f64> = cells.iter().map(|(mean, _)| mean.element_sum()).collect();
            let shares = shares(&weights);
            let over_share = cells.iter().zip(&shares).map(|((_, most), share)| most / share).fold(0.0, f64::max);
            Row {
                sum: cells.iter().map(|(mean, _)| mean).sum(),
                squares: weights.iter().map(|weight| weight * weight).sum(),
                words: cumulative(&shares),
                most_over_share: over_share,
                most: cells.iter().map(|(_, most)| *most).fold(0.0, f64::max),
                weights,
            }
        };
        let found: Vec<Row> = (0..rows).into_par_iter().map(of_row).collect();
        let solid_angle = |row: u32| TAU / f64::from(columns) * (edge_cosine(row) - edge_cosine(row + 1));
        let row_shares = shares(&found.iter().zip(0..).map(|(of, row)| of.sum.element_sum() * solid_angle(row)).collect::<Vec<_>>());
        let integral: DVec3 = found.iter().zip(0..).map(|(of, row)| of.sum * solid_angle(row)).sum();
        let squares: f64 = found.iter().zip(0..).map(|(of, row)| of.squares * solid_angle(row)).sum();
        let over_density = |((of, share), row): ((&Row, &f64), u32)| of.most_over_share / share * solid_angle(row) / (2.0 * TAU);
        let most_over_density = found.iter().zip(&row_shares).zip(0..).map(over_density).fold(0.0, f64::max);
        let edges = (0..=rows).map(|edge| {
            let half = 0.5 * PI * f64::from(edge.min(rows - edge)) / f64::from(rows);
            (2.0 * half.sin().powi(2)) as f32
        });
        let mut words = cumulative(&row_shares);
        words.extend(edges.map(f32::to_bits));
        found.iter().for_each(|of| words.extend(&of.words));
        // The second moment over the square of the mean: 1 of an even sky, large where a sun stands.
        let peak = 2.0 * TAU * squares / integral.element_sum().powi(2);
        Table {
            columns,
            rows,
            words,
            integral,
            most_over_density,
            most: found.iter().map(|of| of.most).fold(0.0, f64::max) as f32,
            sun: sun(&found.iter().map(|of| of.weights.as_slice()).collect::<Vec<_>>()),
            share: if peak.is_finite() { (MOST_BY_TABLE * (1.0 - 1.0 / peak)).max(0.0) } else { 0.0 },
        }
    }
}

/// The axis of a cone around the cells that are nearly as bright as the brightest, and 1 - cosine of its half angle.
fn sun(rows: &[&[f64]]) -> (DVec3, f64) {
    let direction = |row: usize, column: f64| {
        let angle = PI * (row as f64 + 0.5) / rows.len() as f64;
        let turn = TAU * ((column + 0.5) / rows[row].len() as f64 - 0.5);
        DVec3::new(angle.sin() * turn.cos(), angle.cos(), angle.sin() * turn.sin())
    };
    let brightest = |row: &[f64]| row.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).expect("rows have cells");
    let of_rows = rows.iter().map(|row| brightest(row)).enumerate();
    let (row, (column, most)) = of_rows.max_by(|a, b| a.1.1.total_cmp(&b.1.1)).expect("a table has rows");
    let axis = direction(row, column as f64);
    let least_cosine = |(row, cells): (usize, &&[f64])| {
        let bright = cells.iter().enumerate().filter(|(_, weight)| **weight >= BRIGHT * most);
        bright.map(|(column, _)| axis.dot(direction(row, column as f64))).fold(1.0, f64::min)
    };
    let cosine = rows.par_iter().enumerate().map(least_cosine).reduce(|| 1.0, f64::min);
    // And to the corners of their cells.
    let half = cosine.clamp(-1.0, 1.0).acos() + PI / rows.len() as f64 + PI / rows[0].len() as f64;
    (axis, 1.0 - half.min(PI).cos())
}

/// Texels whose tents reach into cell `of` out of `cells` along a picture of `size`, and how much of them lies there.
fn near(of: u32, cells: u32, size: u32) -> Vec<(i64, f64)> {
    let width = f64::from(size) / f64::from(cells);
    let (from, to) = (f64::from(of) * width, f64::from(of + 1) * width);
    // Of a tent of area 1 about 0, what lies below a place.
    let below = |place: f64| {
        let place = place.clamp(-1.0, 1.0);
        0.5 + place - 0.5 * place * place.abs()
    };
    let share = |texel: i64| {
        let middle = texel as f64 + 0.5;
        below(to - middle) - below(from - middle)
    };
    let texels = from.floor() as i64 - 1..=to.ceil() as i64;
    texels.map(|texel| (texel, share(texel))).filter(|(_, share)| *share > 0.0).collect()
}

/// Of what some places have by their shares, and the largest of all.
fn mean_and_most(near: &[(i64, f64)], of: impl Fn(i64) -> (DVec3, f64)) -> (DVec3, f64) {
    let total: f64 = near.iter().map(|(_, share)| share).sum();
    near.iter().fold((DVec3::ZERO, 0.0), |(sum, most), (place, share)| {
        let (value, own) = of(*place);
        (sum + share / total * value, most.max(own))
    })
}

/// Of choices, at least one each, by weight; even where nothing weighs.
fn shares(weights: &[f64]) -> Vec<f64> {
    let sum: f64 = weights.iter().sum();
    let share = |weight: &f64| if sum > 0.0 { weight / sum } else { 1.0 / weights.len() as f64 };
    let dealt = deal(&weights.iter().map(share).collect::<Vec<_>>());
    dealt.into_iter().map(|choices| f64::from(choices) / f64::from(CHOICES)).collect()
}

fn cumulative(shares: &[f64]) -> Vec<u32> {
    let mut before = 0.0;
    let mut add = |share: &f64| {
        before += share;
        (before as f32).to_bits()
    };
    shares.iter().map(&mut add).collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::scene::sky::tests::sky;

    /// Every cell that can emit is chosen, shares sum to 1, and the integral is that of the picture.
    #[test]
    fn tables_hold_all_light() {
        for (width, height, bright) in [(1u32, 1u32, 0u32), (2, 1, 1), (7, 5, 17), (64, 32, 1000), (4096, 2048, 5_000_000)] {
            let sky = sky(width, height, |i, j| if j * width + i == bright { Vec3::new(3.0, 2.0, 1.0) } else { Vec3::ZERO });
            let table = sky.table();
            let value = |place: usize| f32::from_bits(table.words[place]);
            let (rows, columns) = (table.rows as usize, table.columns as usize);
            assert_eq!(table.words.len(), 2 * rows + 1 + rows * columns);
            assert_eq!(value(rows - 1), 1.0);
            assert_eq!(value(2 * rows + columns), 1.0);
            let row = bright / width;
            let angle = |row: u32| (PI * f64::from(row) / f64::from(height)).cos();
            let exact = TAU / f64::from(width) * (angle(row) - angle(row + 1));
            let found = table.integral.x / 3.0 * f64::from(sky.strength.x);
            assert!((found / exact - 1.0).abs() < 0.05 || height < 8, "{width} x {height}: {found}, {exact}");
            assert!(table.most_over_density.is_finite() && table.most_over_density > 0.0);
        }
        let dark = sky(16, 8, |_, _| Vec3::ZERO).table();
        assert_eq!((dark.integral, dark.most_over_density, dark.share), (DVec3::ZERO, 0.0, 0.0));
        let even = sky(16, 8, |_, _| Vec3::ONE).table();
        // A texel of 1 is stored as 2^14.
        assert!(even.share.abs() < 1e-6 && (even.integral.x / 16384.0 / (2.0 * TAU) - 1.0).abs() < 1e-6, "{}", even.integral);
    }

    /// A sun has a narrow cone, and a sky of several bright parts a wide one.
    #[test]
    fn the_brightest_part_has_a_cone() {
        let with = |bright: &[(u32, u32)]| {
            sky(64, 32, |i, j| Vec3::splat(if bright.contains(&(i, j)) { 1000.0 } else { 1.0 })).turned(90.0).table().sun
        };
        let (axis, versine) = with(&[(40, 8)]);
        let (angle, turn) = (PI * 8.5 / 32.0, TAU * (40.5 / 64.0 - 0.5));
        let exact = DVec3::new(angle.sin() * turn.cos(), angle.cos(), angle.sin() * turn.sin());
        assert!(axis.dot(exact) > 0.99 && versine < 0.03, "{axis}, {versine}");
        let (_, wide) = with(&[(40, 8), (8, 8)]);
        assert!(wide > 0.9, "{wide}");
        assert_eq!(with(&[]).1, 2.0);
    }

    #[test]
    fn shares_are_whole_choices_that_leave_none_out() {
        let found = shares(&[0.0, 1.0, 1e-30, 3.0]);
        assert!(found.iter().all(|share| *share >= 1.0 / f64::from(CHOICES)));
        assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-12 && (found[3] - 0.75).abs() < 1e-6);
    }
}
