//! Density estimation on the CPU. Twin of `glsl/gather/estimate.glsl`.

use glam::Vec3;
use rayon::prelude::*;

use super::tree::Tree;
use crate::photon::Photon;
use crate::plan::RoomPlan;
use crate::records::Point;
use crate::settings::Sums;

/// Adds to `sums` what each point receives from a list of photons, stepping through all of it.
pub(crate) fn gather_brute(plan: &RoomPlan, photons: &[Photon], sums: &mut [u64]) {
    gather(plan, sums, |_| std::iter::once(photons));
}

/// The same from the leaves of a kd-tree in reach of each point.
pub(crate) fn gather_tree(plan: &RoomPlan, tree: &Tree, sums: &mut [u64]) {
    let radius_squared = (plan.settings.radius * plan.settings.radius) as f32;
    gather(plan, sums, |point| {
        let mut walk = tree.walk(point);
        std::iter::from_fn(move || walk.next_leaf(radius_squared)).map(|places| &tree.sorted_photons[places])
    });
}

fn gather<'a, Runs>(plan: &RoomPlan, sums: &mut [u64], runs_near: impl Fn(&Point) -> Runs + Sync)
where
    Runs: Iterator<Item = &'a [Photon]>,
{
    let channels = plan.channel_count as usize;
    let radius_squared = (plan.settings.radius * plan.settings.radius) as f32;
    let scale = plan.film_scale() as f32;
    let kind = plan.settings.sums;
    let one_point = |(point, sums): (&Point, &mut [u64])| {
        for photon in runs_near(point).flatten() {
            if photon.wall == point.wall && within_radius(point, photon, radius_squared) {
                add_value(kind, &mut sums[0], photon.flux, scale);
                if channels == 2 {
                    add_value(kind, &mut sums[1], photon.weight, scale);
                }
            }
        }
    };
    at_points(plan, sums, one_point);
}

/// Calls `add` with each point and its sums, on the threads of the current pool.
pub(super) fn at_points(plan: &RoomPlan, sums: &mut [u64], add: impl Fn((&Point, &mut [u64])) + Send + Sync) {
    let channels = plan.channel_count as usize;
    if rayon::current_num_threads() == 1 {
        plan.points.iter().zip(sums.chunks_mut(channels)).for_each(add);
    } else {
        plan.points.par_iter().zip(sums.par_chunks_mut(channels)).with_min_len(64).for_each(add);
    }
}

fn within_radius(point: &Point, photon: &Photon, radius_squared: f32) -> bool {
    squared_distance(point, photon.position) <= radius_squared
}

/// Adds to one film sum. `scale` is a power of two, so that the product is exact.
fn add_value(kind: Sums, sum: &mut u64, value: f32, scale: f32) {
    let float = |word: u64| f32::from_bits(word as u32);
    match kind {
        Sums::Integer => *sum += to_fixed_point(value, scale),
        Sums::F32 => *sum = u64::from((float(*sum) + value * scale).to_bits()),
        Sums::Compensated => {
            let [total, lost] = add_compensated([float(*sum), float(*sum >> 32)], value * scale);
            *sum = u64::from(total.to_bits()) | (u64::from(lost.to_bits()) << 32);
        }
    }
}

/// (sum, what its rounding lost) and one number more: Knuth's exact sum of two, and what is lost goes
/// back into the sum each time (Kahan 1965), as it would itself stop growing otherwise.
fn add_compensated([sum, lost]: [f32; 2], value: f32) -> [f32; 2] {
    let rounded = sum + value;
    let part = rounded - sum;
    let rest = lost + ((sum - (rounded - part)) + (value - part));
    let total = rounded + rest;
    [total, rest - (total - rounded)]
}

#[inline(always)]
pub(super) fn squared_distance(point: &Point, position: Vec3) -> f32 {
    let offset = position - point.position;
    offset.x * offset.x + offset.y * offset.y + offset.z * offset.z
}

#[inline(always)]
pub(super) fn to_fixed_point(value: f32, scale: f32) -> u64 {
    (value * scale).round_ties_even() as u64
}
