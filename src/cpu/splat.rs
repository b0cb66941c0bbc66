//! Density estimation on the CPU by splatting (Lavignotte and Paulin 2003): each photon goes to the texels in its reach,
//! instead of each texel looking for photons in its own. The sums are those of the gather, to the bit.
//!
//! The texels of a row within the radius of a photon lie side by side. So a row costs a photon two additions whatever
//! the radius holds: its flux enters the running sum of the row at the first of them and leaves it behind the last.

use std::sync::atomic::{AtomicUsize, Ordering};

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::estimate::{squared_distance, to_fixed_point};
use super::trace::Block;
use crate::constants::FACE_COUNT;
use crate::photon::Photon;
use crate::plan::RoomPlan;
use crate::records::Point;
use crate::scene::room::face_axis;

/// What photons add to the texels of all walls.
pub(crate) struct Splats<'a> {
    plan: &'a RoomPlan,
    meshes: [Option<Mesh<'a>>; FACE_COUNT as usize],
    /// By how much the running sum of a row grows at each texel and behind the last: for each task that adds its own, so
    /// that none waits.
    steps: Vec<Vec<u64>>,
    vectors: Arch,
}

/// Most bytes of all tasks' steps.
const STEPS_BYTES: usize = 1 << 28;
/// Rows that a photon is checked against at once: as many as the widest vector has numbers.
const LANES: usize = 16;

/// The texels of a wall, row by row.
struct Mesh<'a> {
    points: &'a [Point],
    /// Of the rows of all walls, the number of the first.
    first_row: usize,
    /// Axis of the wall, of its columns, of its rows.
    axes: [usize; 3],
    plane: f32,
    columns: Lattice,
    rows: Lattice,
    /// Where the rows are; infinitely far behind the last one.
    row_positions: Vec<f32>,
    radius: f32,
    radius_squared: f32,
    /// How near to a texel's centre the end of a row's chord leaves open on which side it is, texels.
    margin: f32,
}

/// Evenly spaced coordinates.
struct Lattice {
    first: f32,
    per_metre: f32,
    count: usize,
}

impl<'a> Splats<'a> {
    /// For as many tasks as the current pool has threads.
    pub(crate) fn new(plan: &'a RoomPlan, vectors: Arch) -> Splats<'a> {
        let mesh = plan.settings.mesh as usize;
        let meshes = std::array::from_fn(|face| {
            let first = plan.points.iter().position(|point| point.wall as usize == face)?;
            Some(Mesh::new(&plan.points[first..first + mesh * mesh], first / mesh, face, plan.settings.radius))
        });
        let length = plan.points.len() / mesh * (mesh + 1) * plan.channel_count as usize;
        let tasks = (STEPS_BYTES / (length.max(1) * size_of::<u64>())).clamp(1, rayon::current_num_threads());
        Splats { plan, meshes, steps: vec![vec![0; length]; tasks], vectors }
    }

    /// Adds photons.
    pub(crate) fn add(&mut self, blocks: &[Block]) {
        let (plan, meshes, vectors, next_block) = (self.plan, &self.meshes, self.vectors, AtomicUsize::new(0));
        let add = |steps: &mut Vec<u64>| vectors.dispatch(AddPhotons { plan, meshes, blocks, next_block: &next_block, steps });
        if let [steps] = self.steps.as_mut_slice() {
            add(steps);
        } else {
            self.steps.par_iter_mut().for_each(add);
        }
    }

    /// Adds to the film's sums what has come together, and forgets it.
    pub(crate) fn flush(&mut self, sums: &mut [u64]) {
        let channels = self.plan.channel_count as usize;
        let columns = self.plan.settings.mesh as usize;
        let row_length = (columns + 1) * channels;
        let add_row = |(row, sums): (usize, &mut [u64])| {
            for channel in 0..channels {
                let mut running = 0u64;
                for column in 0..columns {
                    let place = row * row_length + column * channels + channel;
                    // What leaves a sum is added as its two's complement.
                    running = self.steps.iter().fold(running, |running, steps| running.wrapping_add(steps[place]));
                    sums[column * channels + channel] += running;
                }
            }
        };
        if self.steps.len() == 1 {
            sums.chunks_mut(columns * channels).enumerate().for_each(add_row);
        } else {
            sums.par_chunks_mut(columns * channels).enumerate().with_min_len(64).for_each(add_row);
        }
        self.steps.iter_mut().for_each(|steps| steps.fill(0));
    }
}

impl<'a> Mesh<'a> {
    fn new(points: &'a [Point], first_row: usize, face: usize, radius: f64) -> Mesh<'a> {
        let (own, _) = face_axis(face);
        let axes = [own, (own + 1) % 3, (own + 2) % 3];
        let count = points.len().isqrt();
        let lattice = |axis: usize, step: usize| {
            let [first, last] = [0, count - 1].map(|place| f64::from(points[place * step].position[axis]));
            // A texel alone has no neighbour that it could be mistaken for.
            let per_metre = if count > 1 { (count - 1) as f64 / (last - first) } else { 1.0 };
            Lattice { first: first as f32, per_metre: per_metre as f32, count }
        };
        let (columns, rows) = (lattice(axes[1], 1), lattice(axes[2], count));
        let row_positions = points.iter().step_by(count).map(|point| point.position[axes[2]]);
        let row_positions = row_positions.chain([f32::INFINITY; LANES]).collect();
        // What rounding adds up to: of coordinates and of the numbers of texels that they are turned into, a few units in
        // the last place of either; of squares, 2^-21 of the radius's, which moves the end of a chord that is no shorter
        // than 1/32 of the radius by 2^-17 of the radius at most. All that four times and more.
        let texels = [0, count - 1].map(|column| points[column].position[axes[1]].abs() * columns.per_metre);
        let margin = (count as f32 + texels[0].max(texels[1])) * 2f32.powi(-20) + 2f32.powi(-15) * radius as f32 * columns.per_metre;
        let plane = points[0].position[own];
        let radius_squared = (radius * radius) as f32;
        Mesh { points, first_row, axes, plane, columns, rows, row_positions, radius: radius as f32, radius_squared, margin }
    }

    /// Adds to the steps of the rows in reach of a photon what it brings to each channel. A row has so many steps.
    #[inline(always)]
    fn add<const CHANNELS: usize>(&self, amount: [u64; CHANNELS], photon: &Photon, steps: &mut [u64], row_length: usize) {
        let position = photon.position.to_array();
        let [off_plane, s, t] = [position[self.axes[0]] - self.plane, position[self.axes[1]], position[self.axes[2]]];
        let limit = self.radius_squared - off_plane * off_plane;
        let slack = self.radius_squared / 1024.0;
        let row_at = |t: f32| (t - self.rows.first) * self.rows.per_metre;
        // A little more than what is in reach: rows that are not come to nothing.
        let row_count = self.rows.count as f32;
        let (first_row, _) = round((row_at(t - self.radius) + (0.5 - 1.0 / 64.0)).max(0.0).min(row_count));
        let (end_row, _) = round((row_at(t + self.radius) + (0.5 + 1.0 / 64.0)).max(0.0).min(row_count));
        let column_count = self.columns.count as f32;
        for group in (first_row as usize..end_row as usize).step_by(LANES) {
            let rows: &[f32; LANES] = self.row_positions[group..group + LANES].try_into().expect("a whole vector");
            let (mut first, mut end, mut open) = ([0; LANES], [0; LANES], [0; LANES]);
            for lane in 0..LANES {
                let across = t - rows[lane];
                // Of half the chord.
                let squared = limit - across * across;
                let half = squared.max(0.0).sqrt();
                // Half a texel on, so that a number between two texels is rounded to that of the second.
                let place = |s: f32| ((s - self.columns.first) * self.columns.per_metre + 0.5).max(0.0).min(column_count);
                let ((from, from_rest), (to, to_rest)) = (round(place(s - half)), round(place(s + half)));
                let is_clear = |rest: f32| rest.abs() < 0.5 - self.margin;
                let is_empty = squared < -slack;
                first[lane] = if is_empty { 0 } else { from };
                end[lane] = if is_empty { 0 } else { to };
                open[lane] = u32::from(!(is_empty | (squared > slack) & is_clear(from_rest) & is_clear(to_rest)));
            }
            let rows = group..(end_row as usize).min(group + LANES);
            if open.iter().fold(0, |any, open| any | open) != 0 {
                for (lane, row) in rows.clone().enumerate().filter(|(lane, _)| open[*lane] != 0) {
                    (first[lane], end[lane]) = self.exact_span(photon, row);
                }
            }
            let steps = &mut steps[(self.first_row + rows.start) * row_length..(self.first_row + rows.end) * row_length];
            for (row, (first, end)) in steps.chunks_exact_mut(row_length).zip(first.iter().zip(&end)) {
                let (first, end) = (*first as usize * CHANNELS, *end as usize * CHANNELS);
                for channel in 0..CHANNELS {
                    row[first + channel] = row[first + channel].wrapping_add(amount[channel]);
                    row[end + channel] = row[end + channel].wrapping_sub(amount[channel]);
                }
            }
        }
    }

    /// The first texel of a row in reach and one behind the last, by the distance of each, as a gather has it.
    #[cold]
    fn exact_span(&self, photon: &Photon, row: usize) -> (u32, u32) {
        let count = self.columns.count;
        let row = &self.points[row * count..(row + 1) * count];
        let is_near = |column: &usize| squared_distance(&row[*column], photon.position) <= self.radius_squared;
        let place = (photon.position[self.axes[1]] - self.columns.first) * self.columns.per_metre;
        // The nearest texel is one of three, and if it is not in reach none is.
        let nearest = place.clamp(0.0, count as f32 - 1.0).round() as usize;
        let Some(inside) = (nearest.saturating_sub(1)..(nearest + 2).min(count)).find(is_near) else { return (0, 0) };
        let before = (0..inside).rev().take_while(is_near).count();
        let behind = (inside..count).take_while(is_near).count();
        ((inside - before) as u32, (inside + behind) as u32)
    }
}

/// The nearest whole number and what is left, for numbers from 0 to 2^22: behind 2^23 f32 has whole numbers only, so that
/// adding it rounds. The processor's own conversion would be checked for numbers that do not fit, one by one.
#[inline(always)]
fn round(x: f32) -> (u32, f32) {
    const UNIT: f32 = 8_388_608.0;
    let sum = x + UNIT;
    (sum.to_bits() & 0x007f_ffff, x - (sum - UNIT))
}

/// A task: takes one block after another until none is left.
struct AddPhotons<'a> {
    plan: &'a RoomPlan,
    meshes: &'a [Option<Mesh<'a>>; FACE_COUNT as usize],
    blocks: &'a [Block],
    next_block: &'a AtomicUsize,
    steps: &'a mut [u64],
}

impl WithSimd for AddPhotons<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let AddPhotons { plan, meshes, blocks, next_block, steps } = self;
        let channels = plan.channel_count as usize;
        let row_length = (plan.settings.mesh as usize + 1) * channels;
        let scale = plan.film_scale() as f32;
        while let Some(block) = blocks.get(next_block.fetch_add(1, Ordering::Relaxed)) {
            for photon in &block.photons {
                let Some(Some(mesh)) = meshes.get(photon.wall as usize) else { continue };
                let flux = to_fixed_point(photon.flux, scale);
                if channels == 1 {
                    mesh.add([flux], photon, steps, row_length);
                } else {
                    mesh.add([flux, to_fixed_point(photon.weight, scale)], photon, steps, row_length);
                }
            }
        }
    }
}
