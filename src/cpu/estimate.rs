//! Density estimation on the CPU. Twin of `glsl/stages/estimate.glsl`.

use rayon::prelude::*;

use super::index::Index;
use crate::plan::Plan;
use crate::records::{Photon, Point, SortedPhoton};

/// Adds to `sums` what each point receives from a list of photons, stepping through all of it.
pub fn gather_brute(plan: &Plan, photons: &[Photon], sums: &mut [u64]) {
    let list: Vec<SortedPhoton> = photons
        .iter()
        .map(|photon| SortedPhoton { position: photon.position, wall: photon.wall, flux: photon.flux, weight: photon.weight })
        .collect();
    gather(plan, sums, |_| std::iter::once(list.as_slice()));
}

/// The same from the grid cells in reach of each point.
pub fn gather_grid(plan: &Plan, index: &Index, sums: &mut [u64]) {
    gather(plan, sums, |point| index.runs(point.position));
}

fn gather<'a, Runs>(plan: &Plan, sums: &mut [u64], runs_near: impl Fn(&Point) -> Runs + Sync)
where
    Runs: Iterator<Item = &'a [SortedPhoton]>,
{
    let channels = plan.channel_count as usize;
    let radius_squared = (plan.settings.radius * plan.settings.radius) as f32;
    let scale = plan.film_scale() as f32;
    let one_point = |(point, sums): (&Point, &mut [u64])| {
        for photon in runs_near(point).flatten() {
            if photon.wall == point.wall && within_radius(point, photon, radius_squared) {
                sums[0] += to_fixed_point(photon.flux, scale);
                if channels == 2 {
                    sums[1] += to_fixed_point(photon.weight, scale);
                }
            }
        }
    };
    if rayon::current_num_threads() == 1 {
        plan.points.iter().zip(sums.chunks_mut(channels)).for_each(one_point);
    } else {
        plan.points.par_iter().zip(sums.par_chunks_mut(channels)).with_min_len(64).for_each(one_point);
    }
}

fn within_radius(point: &Point, photon: &SortedPhoton, radius_squared: f32) -> bool {
    let offset = photon.position - point.position;
    let distance_squared = offset.x * offset.x + offset.y * offset.y + offset.z * offset.z;
    distance_squared <= radius_squared
}

fn to_fixed_point(value: f32, scale: f32) -> u64 {
    (value * scale).round_ties_even() as u64
}
