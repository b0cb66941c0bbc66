//! Openings that light from beyond the scene comes through, found from rays that leave it: the lines of those that left through one
//! opening pass close by each other there, and nowhere else.

use glam::DVec3;

use crate::constants::{EMITTER_DIRECTIONAL, EMITTER_ENVIRONMENT, MAX_OPENINGS};
use crate::records::{CausticTarget, TrialRay};
use crate::rng::mix32;
use crate::scene::geometry::Geometry;

/// Of photons from beyond the scene, and of shadow rays that the table of a sky leaves, those that are aimed at openings. Twin of `glsl/world/scene/openings.glsl`.
pub(crate) const OPENING_SHARE: f64 = 0.75;
/// Where more rays than this share leave, the scene is open: there is nothing to aim at.
const OPEN: f64 = 0.125;
/// Fewer lines show nothing.
const LEAST_LINES: usize = 24;
/// Lines that are looked at, and places between two of them.
const MOST_LINES: usize = 2048;
const PLACES: u32 = 512;
/// Lines that are left, of all, when no further opening is looked for.
const LEFT_OVER: f64 = 0.04;
/// How much further than where lines are densest an opening may reach: the corners of a square lie as far outside of the disc in it.
const RIM: f64 = 1.5;
/// How much more often aimed rays must leave than others do, to be worth it; and the share of those that leave that must be aimed at.
const LEAST_GAIN: f64 = 3.0;
const LEAST_AIMED: f64 = 0.5;
/// Centres and radii are multiples of this, so that rounding decides nothing.
const STEP: f64 = 1.0 / 4096.0;

/// Whether any light comes from beyond the scene.
pub(crate) fn light_from_beyond(geometry: &Geometry) -> bool {
    geometry.emitters.iter().any(|emitter| matches!(emitter.kind, EMITTER_ENVIRONMENT | EMITTER_DIRECTIONAL))
}

/// The half of a line along which a ray left.
#[derive(Debug, Clone, Copy)]
struct Line {
    origin: DVec3,
    direction: DVec3,
}

impl Line {
    fn of(ray: &TrialRay) -> Line {
        Line { origin: ray.origin.as_dvec3(), direction: ray.direction.as_dvec3().normalize() }
    }

    /// The place on it that is nearest to a point.
    fn nearest_to(&self, point: DVec3) -> DVec3 {
        self.origin + self.direction * self.direction.dot(point - self.origin).max(0.0)
    }

    fn squared_distance(&self, point: DVec3) -> f64 {
        self.nearest_to(point).distance_squared(point)
    }

    /// Halfway between the nearest places of two lines, unless they are almost parallel or part from each other.
    fn between(&self, other: &Line) -> Option<DVec3> {
        let way = other.origin - self.origin;
        let cosine = self.direction.dot(other.direction);
        let sine_squared = 1.0 - cosine * cosine;
        let along = |a: f64, b: f64| (a - cosine * b) / sine_squared;
        let (own, others) = (self.direction.dot(way), -other.direction.dot(way));
        let (t, s) = (along(own, -others), along(others, -own));
        let is_ahead = sine_squared > 0.01 && t > 0.0 && s > 0.0;
        is_ahead.then(|| 0.5 * (self.origin + self.direction * t + other.origin + other.direction * s))
    }
}

/// The radius around a place within which most lines pass in relation to its area, and how dense they are there.
fn densest(lines: &[Line], place: DVec3) -> (f64, f64) {
    let mut squares: Vec<f64> = lines.iter().map(|line| line.squared_distance(place)).collect();
    squares.sort_unstable_by(f64::total_cmp);
    let fewest = LEAST_LINES.max(lines.len() / 50) / 3;
    let density = |count: usize| (count as f64).powi(2) / squares[count - 1].max(STEP * STEP);
    let best = (fewest..=squares.len()).max_by(|a, b| density(*a).total_cmp(&density(*b))).expect("there are more lines than that");
    (squares[best - 1].sqrt(), density(best))
}

/// The sphere where lines are densest.
fn opening(lines: &[Line]) -> Option<(DVec3, f64)> {
    let pick = |word: u32| &lines[(mix32(word) as usize) % lines.len()];
    let places = (0..PLACES).filter_map(|number| pick(2 * number).between(pick(2 * number + 1)));
    let mut centre = places.map(|place| (densest(lines, place).1, place)).max_by(|a, b| a.0.total_cmp(&b.0))?.1;
    for _ in 0..4 {
        let reach = (RIM * densest(lines, centre).0).powi(2);
        let near: Vec<DVec3> =
            lines.iter().filter(|line| line.squared_distance(centre) <= reach).map(|line| line.nearest_to(centre)).collect();
        centre = near.iter().sum::<DVec3>() / near.len() as f64;
    }
    let reach = (RIM * densest(lines, centre).0).powi(2);
    let farthest = lines.iter().map(|line| line.squared_distance(centre)).filter(|squared| *squared <= reach).fold(0.0, f64::max);
    Some((centre, farthest.sqrt()))
}

/// At most [`MAX_OPENINGS`] spheres, normalised, that most of the rays that escape pass through; none where that is no narrower than all
/// directions.
pub(crate) fn openings(rays: &[TrialRay]) -> Vec<CausticTarget> {
    let all: Vec<Line> = rays.iter().filter(|ray| ray.escapes != 0).map(Line::of).collect();
    if all.len() < LEAST_LINES || all.len() as f64 > OPEN * rays.len() as f64 {
        return Vec::new();
    }
    let step = all.len().div_ceil(MOST_LINES);
    let some: Vec<Line> = all.iter().copied().step_by(step).collect();
    let mut lines = some.clone();
    let mut found: Vec<CausticTarget> = Vec::new();
    while found.len() < MAX_OPENINGS as usize && lines.len() >= LEAST_LINES.max((LEFT_OVER * some.len() as f64) as usize) {
        let Some((centre, radius)) = opening(&lines) else { break };
        let centre = (centre / STEP).round() * STEP;
        let before = lines.len();
        // The corners of an opening that no line has met: what comes in there unaimed is rare and bright.
        let radius = (((1.0 + 2.5 / (before as f64).sqrt()) * radius / STEP).ceil() + 1.0) * STEP;
        lines.retain(|line| line.squared_distance(centre) > radius * radius);
        if lines.len() == before {
            break;
        }
        found.push(CausticTarget { centre: centre.as_vec3(), radius: radius as f32 });
    }
    let is_aimed = |line: &Line| {
        found.iter().any(|opening| {
            let (centre, radius) = (opening.centre.as_dvec3(), f64::from(opening.radius));
            line.origin.distance(centre) > radius && line.squared_distance(centre) <= radius * radius
        })
    };
    let aimed = rays.iter().filter(|ray| is_aimed(&Line::of(ray))).count() as f64;
    let aimed_out = all.iter().filter(|line| is_aimed(line)).count() as f64;
    let out = all.len() as f64;
    let pays = aimed_out >= LEAST_AIMED * out && aimed_out / aimed >= LEAST_GAIN * out / rays.len() as f64;
    if pays { found } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::rng::words;

    fn unit(seed: u32, number: u32) -> f64 {
        f64::from(mix32(number.wrapping_mul(0x9e37).wrapping_add(seed)) >> 8) / f64::from(1 << 24)
    }

    /// Rays from the walls of a cube of half an edge of 0.25, in all directions, of which those escape that `leaves` says of where they
    /// meet the plane x = 0.25.
    fn rays(leaves: impl Fn(DVec3) -> bool) -> Vec<TrialRay> {
        let ray = |number: u32| {
            let u = |which: u32| unit(words(7).x + which, number);
            let (height, turn) = (2.0 * u(0) - 1.0, std::f64::consts::TAU * u(1));
            let flat = (1.0 - height * height).sqrt();
            let direction = DVec3::new(flat * turn.cos(), height, flat * turn.sin());
            let origin = DVec3::new(0.4 * u(2) - 0.24, 0.5 * u(3) - 0.25, 0.5 * u(4) - 0.25);
            let meets = origin + direction * ((0.25 - origin.x) / direction.x);
            let escapes = direction.x > 0.0 && meets.abs().max_element() <= 0.25 + 1e-9 && leaves(meets);
            TrialRay { origin: origin.as_vec3(), direction: direction.as_vec3(), escapes: u32::from(escapes), ..Zeroable::zeroed() }
        };
        (0..60_000).map(ray).collect()
    }

    fn square(meets: DVec3, y: f64, half: f64) -> bool {
        (meets.y - y).abs() <= half && meets.z.abs() <= half
    }

    #[test]
    fn a_window_is_found_where_it_is() {
        let found = openings(&rays(|meets| square(meets, 0.1, 0.03)));
        let opening = found[0];
        assert!(opening.centre.as_dvec3().distance(DVec3::new(0.25, 0.1, 0.0)) < 0.015, "{found:?}");
        // Half of the diagonal is 0.042.
        assert!((0.03..0.07).contains(&opening.radius), "{found:?}");
    }

    #[test]
    fn two_windows_are_two_openings() {
        let found = openings(&rays(|meets| square(meets, 0.15, 0.02) || square(meets, -0.15, 0.02)));
        for y in [-0.15, 0.15] {
            let near = |opening: &&CausticTarget| opening.centre.as_dvec3().distance(DVec3::new(0.25, y, 0.0)) < 0.02;
            assert!(found.iter().filter(near).any(|opening| opening.radius < 0.06), "{y}: {found:?}");
        }
    }

    #[test]
    fn what_is_open_or_closed_has_no_openings() {
        assert!(openings(&rays(|_| true)).is_empty());
        assert!(openings(&rays(|_| false)).is_empty());
        assert!(openings(&[]).is_empty());
    }
}
