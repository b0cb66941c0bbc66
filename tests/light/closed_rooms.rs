//! Light that is scattered to and fro and cannot leave, against closed forms: an integrating sphere, a furnace, parallel
//! plates, the geometric series of bounces. `photonmill::verify::selfcheck` has the furnace that is a box.

use crate::common::known::kept;
use crate::common::prelude::*;

/// A sphere of 1 m of flat triangles, seen from inside.
fn hollow_sphere(segments: u32) -> Mesh {
    let mut sphere = Mesh::sphere("sphere", DVec3::ZERO, 1.0, segments, 0);
    sphere.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    sphere.normals.clear();
    sphere
}

/// Points on triangles' middles, so many to each piece of the surface as its area deserves.
fn evenly_over(mesh: &Mesh, count: usize) -> Vec<(DVec3, DVec3)> {
    let area = area_of(mesh);
    let (mut points, mut before) = (Vec::new(), 0.0);
    for triangle in 0..mesh.triangles.len() {
        before += mesh.area(triangle);
        while (points.len() as f64 + 0.5) / count as f64 * area < before {
            points.push((mesh.corners(triangle).iter().sum::<DVec3>() / 3.0, mesh.normal(triangle)));
        }
    }
    points
}

fn area_of(mesh: &Mesh) -> f64 {
    (0..mesh.triangles.len()).map(|triangle| mesh.area(triangle)).sum()
}

/// Mean over points of each run, one channel.
fn over_points(runs: &[Vec<DVec3>], channel: usize) -> Vec<f64> {
    runs.iter().map(|run| run.iter().map(|light| light[channel]).sum::<f64>() / run.len() as f64).collect()
}

/// Photons are stored on facets, and a point counts only what arrives from above its own horizon. Of even light on a
/// facet whose normal is turned by the angle a, (1 - cos a) / 2 comes from below it. This is what is left of it, over the
/// surface within the radius of the points: on a sphere of 1 m, where 1 - cos a is half the squared chord, 1 - r^2 / 8, and a
/// little less on its facets.
fn kept_by_horizon(mesh: &Mesh, points: &[(DVec3, DVec3)], radius: f64) -> f64 {
    const CUTS: u32 = 8;
    let (mut kept, mut all) = (0.0, 0.0);
    for triangle in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(triangle);
        let (normal, piece) = (mesh.normal(triangle), mesh.area(triangle) / f64::from(CUTS * CUTS));
        let reach = radius + (b - a).length().max((c - a).length());
        for (point, own) in points.iter().filter(|(point, _)| (*point - a).length() < reach) {
            // Middles of the triangle's pieces, those that stand as it does and those on their heads.
            for (i, j) in (0..CUTS).flat_map(|i| (0..2 * (CUTS - i) - 1).map(move |j| (i, j))) {
                let third = if j % 2 == 0 { 1.0 } else { 2.0 } / 3.0;
                let (u, v) = ((f64::from(i) + third) / f64::from(CUTS), (f64::from(j / 2) + third) / f64::from(CUTS));
                if (a + u * (b - a) + v * (c - a) - *point).length() <= radius {
                    all += piece;
                    kept += piece * 0.5 * (1.0 + normal.dot(*own));
                }
            }
        }
    }
    kept / all
}

/// Of a sphere of 1 m of flat triangles, in which light that cannot leave is the same everywhere.
///
/// A point light of 1 W in its middle: after b bounces (1 - rho^b) / (1 - rho) / A on average over the wall of area A. Albedos of 0.5,
/// 0.9 and 0.99 as colours beside a channel that reflects all: so no photon ends, and all that is random is where photons land.
///
/// Walls that emit 1 W/m2/sr and scatter half of what arrives: pi of direct and pi of scattered light, and so in any polyhedron.
#[test]
fn an_integrating_sphere_multiplies_light() {
    let Some(gpu) = device() else { return };
    let radius = 0.12;
    let sphere = hollow_sphere(96);
    let (points, area) = (evenly_over(&sphere, 400), area_of(&sphere));
    let kept_light = kept_by_horizon(&sphere, &points, radius);
    assert!((kept_light - (1.0 - radius * radius / 8.0)).abs() < 0.002, "{kept_light}");
    let lamp = LightKind::Point { position: DVec3::ZERO, intensity: Vec3::splat((0.25 / PI) as f32) };
    let walls = |colour| Material::lambert("wall", colour);
    let mut family = Family::default();
    for (material, lights, bounces, photons) in [
        (walls(Vec3::new(1.0, 0.99, 0.9)), vec![lamp.clone()], 60, 800),
        (walls(Vec3::new(0.9, 0.5, 1.0)), vec![lamp], 16, 2000),
        (emissive(0.5), vec![], 16, 10_000),
    ] {
        let is_furnace = lights.is_empty();
        let scene = scene_of(vec![sphere.clone()], vec![material.clone()], lights);
        let runs = irradiances(&gpu, &scene, &kept(mapped(photons, 1, bounces, radius)), &points, 1..17);
        for channel in 0..if is_furnace { 1 } else { 3 } {
            let rho = f64::from(material.base_colour[channel]);
            let series: f64 = (1..bounces).map(|bounce| rho.powi(bounce as i32)).sum();
            // What comes straight from the middle comes from above every horizon near.
            let expected = if is_furnace { TAU * kept_light } else { (1.0 + kept_light * series) / area };
            let what = format!("sphere, {}albedo {rho:.2}, {bounces} bounces", if is_furnace { "shining, " } else { "" });
            family.expect_mean(what, &over_points(&runs, channel), expected);
        }
    }
    family.assert_detects(0.015, |_| true);
}

/// Two infinite plates that face each other, the lower one emitting M = pi W/m2: M / (1 - rho rho') arrives above,
/// rho' times that below. A shaft of perfect mirrors makes a square of each infinite.
#[test]
fn parallel_plates_send_light_to_and_fro() {
    let illuminations = of_run::<&[_]>(&[Illumination::Photons], &BOTH);
    let Some(gpu) = device() else { return };
    let (below, above) = (0.75, 0.5);
    let mut meshes = shaft(-0.2, 0.2, 2);
    meshes.extend([level(-0.2, [1.0; 2], true, 0), level(0.2, [1.0; 2], false, 1)]);
    let scene = scene_of(meshes, vec![emissive(below as f32), matt(above as f32), mirror(1.0)], vec![]);
    let mut family = Family::default();
    for &illumination in illuminations {
        let shadow_rays = by_rounds().shadow_rays;
        let settings = kept(SceneSettings { shadow_rays, ..fixed_radius(illumination, 6000, 1, 48, 0.15) });
        let points = [grid(0.2, DVec3::NEG_Y, 6), grid(-0.2, DVec3::Y, 6)].concat();
        let runs = irradiances(&gpu, &scene, &settings, &points, 1..17);
        let (upper, lower): (Vec<_>, Vec<_>) = runs.iter().map(|run| (run[..36].to_vec(), run[36..].to_vec())).unzip();
        let exact = PI / (1.0 - below * above);
        family.expect_mean(format!("plates, {illumination:?}: above"), &over_points(&upper, 0), exact);
        family.expect_mean(format!("plates, {illumination:?}: below"), &over_points(&lower, 0), above * exact);
    }
    family.assert_detects(0.04, |_| true);
}

/// In a closed sphere albedo^k of the photons are stored at bounce k, and none escapes. Where fewer than half of the 131 072 photons are left, more than
/// 2 % goes unnoticed. `tests/light/extremes.rs` has the paper's box with a sixth wall.
#[test]
fn bounces_in_a_sphere_are_a_geometric_series() {
    let Some(gpu) = device() else { return };
    let lamp = LightKind::Point { position: DVec3::new(0.3, 0.2, 0.1), intensity: Vec3::ONE };
    let mut family = Family::default();
    for rho in [0.5f32, 0.9, 0.99] {
        let scene = scene_of(vec![hollow_sphere(12)], vec![matt(rho)], vec![lamp.clone()]);
        let result = received(&gpu, &scene, &kept(flights(1 << 17, 15)), &[(DVec3::ZERO, DVec3::Y)]);
        for (bounce, counts) in result.fates[0].bounces.iter().enumerate() {
            assert_eq!(counts.escaped, 0, "albedo {rho}");
            let chance = f64::from(rho).powi(bounce as i32 + 1);
            let error = (chance * (1.0 - chance) / result.fates[0].emitted as f64).sqrt();
            // Where few survive, few show: 2 % must be seven errors for a test to notice it beside its own.
            let bright = if 0.02 * chance > 7.0 * error { "bright: " } else { "" };
            let what = format!("{bright}sphere, albedo {rho:.2}, bounce {}", bounce + 1);
            family.expect_count(what, counts.stored, result.fates[0].emitted, chance);
        }
    }
    family.assert_detects(0.02, |what| what.starts_with("bright"));
}
