//! Where caustics begin: a few spheres that hold every surface which makes them. Photons of a caustic map are aimed at
//! these (projection maps, Jensen 1996, section 3); see `glsl/world/scene/aim.glsl`.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use super::bounds_of;
use super::connected::{bits, connected};
use super::geometry::Geometry;
use crate::constants::*;
use crate::records::{CausticTarget, Emitter};

/// Most spheres: each photon that is aimed looks at all of them.
const MAX_TARGETS: usize = 16;
/// Groups of triangles that are merged pair by pair: of more, neighbours are put together at first.
const MAX_GROUPS_MERGED: usize = 64;
/// By so much a sphere is larger than what it holds, normalised: some units in the last place of a coordinate.
const MARGIN: f64 = 1.0 / 262_144.0;
/// Steps towards the smallest sphere; its radius is then known to some per cent at worst.
const SPHERE_STEPS: u32 = 32;

#[derive(Debug, Clone, Copy)]
struct Sphere {
    centre: DVec3,
    radius: f64,
}

/// At most 16 spheres, normalised, that hold all triangles of the wanted materials.
///
/// Connected triangles stay together, and pairs are merged for as long as that leaves less to aim at: the sum of the
/// squared radii, as a cone's solid angle goes with that.
pub(crate) fn caustic_targets(geometry: &Geometry, is_wanted: &[bool]) -> Vec<CausticTarget> {
    let wanted = geometry.triangles.iter().filter(|triangle| triangle.plane < HIDDEN && is_wanted[triangle.material as usize]);
    let mut groups = Vec::new();
    gathered(groups_of(&wanted.map(|triangle| [triangle.a, triangle.b, triangle.c]).collect::<Vec<_>>()), MAX_GROUPS_MERGED, &mut groups);
    merged(groups).iter().map(|points| target(points)).collect()
}

/// Corners of the triangles, those that share corners together.
pub(super) fn groups_of(triangles: &[[Vec3; 3]]) -> Vec<Vec<DVec3>> {
    let corners = |triangle: &usize| triangles[*triangle].map(Vec3::as_dvec3);
    let groups = connected(triangles.iter().map(|corners| corners.map(|corner| bits(corner.as_dvec3()))));
    groups.iter().map(|group| group.iter().flat_map(corners).collect()).collect()
}

/// At most so many groups, a power of two: the two halves along the longest axis, and so on.
fn gathered(mut groups: Vec<Vec<DVec3>>, most: usize, all: &mut Vec<Vec<DVec3>>) {
    if groups.len() <= most {
        all.extend(groups);
    } else if most == 1 {
        all.push(groups.concat());
    } else {
        let middle = |group: &Vec<DVec3>| group.iter().sum::<DVec3>() / group.len() as f64;
        let (low, high) = bounds_of(groups.iter().map(middle));
        let axis = (high - low).max_position();
        groups.sort_by_cached_key(|group| (middle(group)[axis] * f64::from(1 << 30)) as i64);
        let second = groups.split_off(groups.len() / 2);
        gathered(groups, most / 2, all);
        gathered(second, most / 2, all);
    }
}

/// Merges the pair of which the sphere costs least more than its two, down to one group, and returns the groups of
/// the cheapest step.
fn merged(groups: Vec<Vec<DVec3>>) -> Vec<Vec<DVec3>> {
    // Which groups each sphere holds.
    let mut spheres: Vec<(Vec<usize>, Sphere)> =
        groups.iter().enumerate().map(|(group, points)| (vec![group], sphere_around(points))).collect();
    let cost = |sphere: Sphere| sphere.radius * sphere.radius;
    let mut cheapest: Option<(f64, Vec<Vec<usize>>)> = None;
    loop {
        let all: f64 = spheres.iter().map(|(_, sphere)| cost(*sphere)).sum();
        if spheres.len() <= MAX_TARGETS && cheapest.as_ref().is_none_or(|(least, _)| all <= *least) {
            cheapest = Some((all, spheres.iter().map(|(members, _)| members.clone()).collect()));
        }
        let pairs = (0..spheres.len()).flat_map(|second| (0..second).map(move |first| (first, second)));
        let more = |(first, second): (usize, usize)| {
            let (a, b) = (spheres[first].1, spheres[second].1);
            cost(around_both(a, b)) - cost(a) - cost(b)
        };
        let Some((first, second)) = pairs.min_by(|a, b| more(*a).total_cmp(&more(*b))) else {
            break;
        };
        let (members, sphere) = spheres.swap_remove(second);
        spheres[first].0.extend(members);
        spheres[first].1 = around_both(spheres[first].1, sphere);
    }
    let held = cheapest.map_or_else(Vec::new, |(_, held)| held);
    held.iter().map(|members| members.iter().flat_map(|group| groups[*group].iter().copied()).collect()).collect()
}

/// A small sphere around points: from the middle of their box the centre goes towards the farthest point, by ever
/// smaller steps (Badoiu and Clarkson 2003), and the best one is kept.
fn sphere_around(points: &[DVec3]) -> Sphere {
    let (low, high) = bounds_of(points.iter().copied());
    let mut centre = 0.5 * (low + high);
    let mut best = Sphere { centre, radius: f64::INFINITY };
    for step in 0..SPHERE_STEPS {
        let mut farthest = (0.0, centre);
        for point in points {
            let squared = point.distance_squared(centre);
            farthest = if squared > farthest.0 { (squared, *point) } else { farthest };
        }
        if farthest.0.sqrt() < best.radius {
            best = Sphere { centre, radius: farthest.0.sqrt() };
        }
        centre += (farthest.1 - centre) / f64::from(step + 2);
    }
    best
}

/// The smallest sphere that holds two.
fn around_both(a: Sphere, b: Sphere) -> Sphere {
    let (way, distance) = (b.centre - a.centre, b.centre.distance(a.centre));
    if distance + b.radius <= a.radius {
        return a;
    }
    if distance + a.radius <= b.radius {
        return b;
    }
    let radius = 0.5 * (distance + a.radius + b.radius);
    Sphere { centre: a.centre + way * ((radius - a.radius) / distance), radius }
}

fn target(points: &[DVec3]) -> CausticTarget {
    let centre = sphere_around(points).centre.as_vec3();
    let radius = points.iter().map(|point| point.distance(centre.as_dvec3())).fold(0.0, f64::max);
    CausticTarget { centre, radius: (radius * (1.0 + 1e-6) + MARGIN) as f32 }
}

/// Bounds of the share of an emitter's light that leaves towards each target, summed over targets and at most 1:
/// the least and the largest such sum of all emitters. Twin of the sums in `glsl/world/scene/aim.glsl`, which are of one place.
pub(crate) fn aimed_shares(geometry: &Geometry, targets: &[CausticTarget]) -> (f64, f64) {
    let shares = geometry.emitters.iter().map(|emitter| {
        let share = |target: &CausticTarget| share_towards(geometry, emitter, target);
        targets.iter().map(share).sum::<f64>().min(1.0)
    });
    shares.fold((1.0, 0.0), |(least, most), share| (share.min(least), share.max(most)))
}

fn share_towards(geometry: &Geometry, emitter: &Emitter, target: &CausticTarget) -> f64 {
    let size = f64::from(emitter.size);
    let cosine_density = 1.0 / PI;
    let point = emitter.position.as_dvec3();
    // Where it leaves from, and the largest density of its directions, 1/sr.
    let (centre, radius, density) = match emitter.kind {
        EMITTER_TRIANGLE => {
            let triangle = &geometry.triangles[emitter.triangle as usize];
            let corners = [triangle.a, triangle.b, triangle.c].map(Vec3::as_dvec3);
            let middle = corners.iter().sum::<DVec3>() / 3.0;
            (middle, corners.iter().map(|corner| corner.distance(middle)).fold(0.0, f64::max), cosine_density)
        }
        EMITTER_POINT => (point, 0.0, 0.5 / TAU),
        EMITTER_SPOT => (point, 0.0, 1.0 / (TAU * (size + (f64::from(emitter.outer_versine) - size) / 3.0))),
        EMITTER_DISC_COSINE => (point, size, cosine_density),
        EMITTER_DISC_UNIFORM => (point, size, 1.0 / TAU),
        // From beyond the scene: discs across the photons' way.
        _ => return (f64::from(target.radius) / geometry.radius).powi(2).min(1.0),
    };
    let distance = target.centre.as_dvec3().distance(centre) - radius;
    // A hair more, for what a photon's start is off its lamp.
    let sine = 1.001 * f64::from(target.radius) / distance;
    if !(distance > 0.0 && sine < 1.0) {
        return 1.0;
    }
    let versine = sine * sine / (1.0 + (1.0 - sine * sine).sqrt());
    (TAU * versine * density).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Material, Mesh, Scene, Surface, built_in};

    fn balls(balls: impl Iterator<Item = (DVec3, f64)>) -> Scene {
        let mirror = Material { surface: Surface::Mirror, ..Material::lambert("mirror", Vec3::ONE) };
        let meshes = balls.map(|(centre, radius)| Mesh::sphere("ball", centre, radius, 12, 0)).collect();
        Scene { meshes, materials: vec![mirror], ..Scene::default() }
    }

    /// The spheres around mirrors and glass of a scene. Fails unless every corner of what makes caustics lies in one, with room to spare.
    fn held(scene: &Scene) -> (Geometry, Vec<CausticTarget>) {
        let geometry = Geometry::new(scene).unwrap();
        let surfaces = geometry.materials.iter().map(|material| material.surface);
        let is_wanted: Vec<bool> = surfaces.map(|surface| matches!(surface, SURFACE_MIRROR | SURFACE_DIELECTRIC)).collect();
        let targets = caustic_targets(&geometry, &is_wanted);
        assert!(targets.len() <= MAX_TARGETS);
        for triangle in geometry.triangles.iter().filter(|triangle| is_wanted[triangle.material as usize]) {
            // A triangle may only lie in one sphere, or part of it could lie in none.
            let holds = |target: &CausticTarget| {
                let is_in = |corner: Vec3| corner.as_dvec3().distance(target.centre.as_dvec3()) < f64::from(target.radius) - 0.5 * MARGIN;
                [triangle.a, triangle.b, triangle.c].into_iter().all(is_in)
            };
            assert!(targets.iter().any(holds), "{triangle:?} is in none of {targets:?}");
        }
        (geometry, targets)
    }

    fn of_built_in(name: &str) -> (Geometry, Vec<CausticTarget>) {
        held(&built_in::by_name(name).unwrap())
    }

    #[test]
    fn each_ball_has_a_tight_sphere_of_its_own() {
        assert_eq!(["cornell-spheres", "caustic-sphere", "cornell"].map(|name| of_built_in(name).1.len()), [2, 1, 0]);
        let (spheres, targets) = of_built_in("cornell-spheres");
        for target in targets {
            let radius = f64::from(target.radius) * spheres.unit;
            assert!((0.18..0.1802).contains(&radius), "{radius}");
        }
        let mirrors: Vec<bool> = spheres.materials.iter().map(|material| material.surface == SURFACE_MIRROR).collect();
        assert_eq!(caustic_targets(&spheres, &mirrors).len(), 1);
        assert!(caustic_targets(&spheres, &vec![false; mirrors.len()]).is_empty());
    }

    /// Eight balls in the corners of a cube have one each; packed side by side they share; and many are held by few.
    #[test]
    fn distant_balls_are_kept_apart_and_close_ones_merged() {
        for (edge, count) in [(2.0, 8), (0.05, 1)] {
            let place = |k: u32| edge * DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2));
            assert_eq!(held(&balls((0..8).map(|k| (place(k), 0.1)))).1.len(), count, "{edge} m apart");
        }
        let place = |k: u32| DVec3::new(f64::from(k % 7), f64::from(k / 7 % 5), f64::from(k / 35));
        held(&balls((0..175).map(|k| (place(k), 0.05 + 0.002 * f64::from(k % 13)))));
    }

    #[test]
    fn a_lamp_far_off_sends_a_small_share_and_one_within_sends_all() {
        let (geometry, targets) = of_built_in("caustic-sphere");
        let (least, most) = aimed_shares(&geometry, &targets);
        // About the solid angle over pi of a ball of 0.25 m, 1.2 m off.
        assert!(0.035 < least && least <= most && most < 0.055, "{least}, {most}");
        let lamp = geometry.triangles[geometry.emitters[0].triangle as usize].a;
        assert_eq!(aimed_shares(&geometry, &[CausticTarget { centre: lamp, radius: 0.01 }]).1, 1.0);
        assert_eq!(aimed_shares(&geometry, &[]), (0.0, 0.0));
    }
}
