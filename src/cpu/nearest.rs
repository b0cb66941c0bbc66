//! Density estimation by the nearest photons on the CPU. Twin of `glsl/gather/nearest.glsl`, which explains the
//! estimate, and of `glsl/gather/covered_disc.glsl`.

use std::collections::BinaryHeap;

use super::estimate::{at_points, squared_distance, to_fixed_point};
use super::math::angle_of;
use super::tree::Tree;
use crate::constants::{NEAREST_BITS, NEAREST_GAIN_BITS};
use crate::plan::RoomPlan;
use crate::records::{Point, Room};
use crate::scene::room::RoomScene;

/// (1 / 1024)^2: the least disc, relative to that of the radius.
const LEAST_DISC: f32 = 1.0 / 1_048_576.0;

/// Adds to `sums` what the `count` photons nearest to each point say that the disc of the full radius holds.
pub(crate) fn gather(plan: &RoomPlan, scene: &RoomScene, tree: &Tree, count: u32, sums: &mut [u64]) {
    let room = scene.room_record();
    let one_point = |(point, sums): (&Point, &mut [u64])| {
        sums.iter_mut().zip(of_point(plan, &room, tree, count as usize, point)).for_each(|(sum, amount)| *sum += amount);
    };
    at_points(plan, sums, one_point);
}

/// What one point adds to its two channels.
fn of_point(plan: &RoomPlan, room: &Room, tree: &Tree, count: usize, point: &Point) -> [u64; 2] {
    let radius_squared = (plan.settings.radius * plan.settings.radius) as f32;
    // (bits of the squared distance, photon, bounce), which are in the order of nearness, and the place in the tree.
    let mut nearest: BinaryHeap<(u32, (u32, u32), usize)> = BinaryHeap::with_capacity(count + 1);
    let mut limit = radius_squared;
    let mut walk = tree.walk(point);
    while let Some(places) = walk.next_leaf(limit) {
        for place in places {
            let photon = &tree.sorted_photons[place];
            let distance_squared = squared_distance(point, photon.position);
            if distance_squared <= limit {
                nearest.push((distance_squared.to_bits(), (photon.photon, photon.bounce), place));
                if nearest.len() > count {
                    nearest.pop();
                }
            }
        }
        if nearest.len() == count {
            limit = nearest.peek().map_or(limit, |farthest| f32::from_bits(farthest.0));
        }
    }
    let mut factor = 1.0;
    if nearest.len() == count
        && let Some((farthest, ..)) = nearest.pop()
    {
        let farthest = f32::from_bits(farthest).max(radius_squared * LEAST_DISC);
        let whole = radius_squared * covered_disc(point, radius_squared.sqrt(), room);
        let covered = farthest * covered_disc(point, farthest.sqrt(), room);
        factor = (whole / covered).clamp(1.0, (1u32 << NEAREST_GAIN_BITS) as f32);
    }
    let unit = (1u32 << NEAREST_BITS) as f32;
    let photons = || nearest.iter().map(|(.., place)| &tree.sorted_photons[*place]);
    let flux = photons().map(|photon| to_fixed_point(photon.flux, unit)).sum();
    let weight = photons().map(|photon| to_fixed_point(photon.weight, unit)).sum();
    [flux, weight].map(|sum| scaled(sum, factor, plan.film_shift))
}

/// sum * factor in the film's units, rounded once; sum in units of 2^-`NEAREST_BITS`.
fn scaled(sum: u64, factor: f32, film_shift: u32) -> u64 {
    let mantissa = u64::from((factor.to_bits() & 0x007f_ffff) | 0x0080_0000);
    let exponent = (factor.to_bits() >> 23) - 127;
    let shift = NEAREST_BITS + 23 - film_shift - exponent;
    (sum * mantissa + (1 << (shift - 1))) >> shift
}

/// Area of the unit disc within 0 <= x <= a, 0 <= y <= b, for a and b up to 1.
fn quadrant_area(a: f32, b: f32) -> f32 {
    if a * a + b * b <= 1.0 {
        return a * b;
    }
    let x = (1.0 - b * b).max(0.0).sqrt();
    let y = (1.0 - a * a).max(0.0).sqrt();
    0.5 * (a * y + b * x + angle_of(b, x) - angle_of(y, a))
}

/// Area on its wall of the disc around a point, in squares of the radius: pi where all of it is.
pub(crate) fn covered_disc(point: &Point, radius: f32, room: &Room) -> f32 {
    let wall = point.wall as usize;
    let (s, t) = ((wall / 2 + 1) % 3, (wall / 2 + 2) % 3);
    let scale = 1.0 / radius;
    let left = ((point.position[s] - room.min_corner[s]) * scale).min(1.0);
    let right = ((room.max_corner[s] - point.position[s]) * scale).min(1.0);
    let below = ((point.position[t] - room.min_corner[t]) * scale).min(1.0);
    let above = ((room.max_corner[t] - point.position[t]) * scale).min(1.0);
    quadrant_area(left, below) + quadrant_area(left, above) + quadrant_area(right, below) + quadrant_area(right, above)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::open_box::open_box;
    use crate::settings::RoomSettings;
    use glam::Vec3;

    #[test]
    fn covered_discs_are_those_of_f64() {
        let scene = open_box(&RoomSettings::default());
        let rectangle = scene.rectangle(4);
        for (s, t) in [(0.5, 0.5), (0.001, 0.5), (0.01, 0.01), (0.99, 0.3), (0.2, 0.999)] {
            for radius in [1e-6, 0.002, 0.05, 0.25, 0.5] {
                let position = rectangle.at(s, t).as_vec3();
                let found = covered_disc(&Point { position, wall: 4 }, radius as f32, &scene.room_record());
                // Of the point that f32 has, as close to the edge as it really is.
                let [s, t] = [position.x, position.y].map(|along| (f64::from(along) + 0.25) / 0.5);
                let expected = rectangle.covered_area(s, t, radius) / (radius * radius);
                assert!((f64::from(found) / expected - 1.0).abs() < 3e-6, "({s}, {t}), radius {radius}: {found} instead of {expected}");
            }
        }
        let outside = Point { position: Vec3::ZERO, wall: 0 };
        assert!(covered_disc(&outside, 0.1, &scene.room_record()).is_finite());
    }

    #[test]
    fn sums_are_scaled_and_rounded_once() {
        let half_unit = 0.5f64 + 1e-9;
        for (sum, factor) in
            [(0, 1.0f32), (1, 1.0), (1 << 28, 1.0), ((1 << 38) - 1, 4_194_304.0), (12_345_678_901, 1234.567), (3 << 27, 1.5)]
        {
            for film_shift in [10, 17, 28] {
                let exact = sum as f64 * f64::from(factor) * 2f64.powi(film_shift as i32 - 28);
                let found = scaled(sum, factor, film_shift) as f64;
                assert!((found - exact).abs() <= half_unit.max(exact * 1e-15), "{sum} * {factor}, {film_shift} bits: {found} of {exact}");
            }
        }
    }
}
