//! Light that is scattered to and fro and cannot leave, against closed forms: an integrating sphere, a furnace, parallel
//! plates, the geometric series of bounces. `photonmill::verify::selfcheck` has the furnace that is a box.

use crate::common::prelude::*;
use photonmill::ledger::Fates;

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

const SEGMENTS: u32 = 96;
const RADIUS: f64 = 0.12;

/// A point light of 1 W in a closed hollow of area A: after b bounces (1 - rho^b) / (1 - rho) / A on average over the
/// wall, whatever its shape, as no light is lost; of a sphere the same everywhere. Albedos of 0.5, 0.9
/// and 0.99 as colours beside a channel that reflects all: so no photon ends, and all that is random is where
/// photons land.
#[test]
fn an_integrating_sphere_multiplies_light() {
    let Some(gpu) = device() else { return };
    let intensity = Vec3::splat((0.25 / PI) as f32);
    let sphere = hollow_sphere(SEGMENTS);
    let (points, area) = (evenly_over(&sphere, 1500), area_of(&sphere));
    let kept = kept_by_horizon(&sphere, &points, RADIUS);
    assert!((kept - (1.0 - RADIUS * RADIUS / 8.0)).abs() < 0.002, "{kept}");
    let mut family = Family::default();
    for (albedo, bounces, photons) in [(Vec3::new(1.0, 0.99, 0.9), 60, 800), (Vec3::new(0.9, 0.5, 1.0), 16, 3000)] {
        let material = Material::lambert("wall", albedo);
        let scene = scene_of(vec![sphere.clone()], vec![material], vec![LightKind::Point { position: DVec3::ZERO, intensity }]);
        let settings = mapped(photons, 1, bounces, RADIUS);
        assert_builders_agree(&gpu, &scene, &settings, &points);
        let runs = irradiances(&gpu, &scene, &settings, &points, 1..17);
        for channel in 0..3 {
            let rho = f64::from(albedo[channel]);
            let series: f64 = (1..bounces).map(|bounce| rho.powi(bounce as i32)).sum();
            // What comes straight from the middle comes from above every horizon near.
            let expected = (1.0 + kept * series) / area;
            family.expect_mean(format!("sphere, albedo {rho:.2}, {bounces} bounces"), &over_points(&runs, channel), expected);
        }
    }
    family.assert_tells_one_per_cent();
}

/// A closed sphere that shines with 1 W/m2/sr and scatters half of what arrives: pi of direct and pi of scattered light at
/// every point of it, and so in any polyhedron.
#[test]
fn a_furnace_sphere_is_evenly_lit() {
    let Some(gpu) = device() else { return };
    let sphere = hollow_sphere(SEGMENTS);
    let points = evenly_over(&sphere, 1500);
    let scene = scene_of(vec![sphere], vec![shining(0.5)], vec![]);
    let mut family = Family::default();
    let settings = mapped(20_000, 1, 16, RADIUS);
    assert_builders_agree(&gpu, &scene, &settings, &points);
    let runs = irradiances(&gpu, &scene, &settings, &points, 1..17);
    let expected = 2.0 * PI * kept_by_horizon(&scene.meshes[0], &points, RADIUS);
    family.expect_mean("furnace sphere", &over_points(&runs, 0), expected);
    for point in (0..points.len()).step_by(150) {
        let of_point: Vec<f64> = runs.iter().map(|run| run[point].x).collect();
        family.expect_mean(format!("furnace sphere, point {point}"), &of_point, expected);
    }
    family.assert_tells(0.01, |what| !what.contains("point"));
}

/// Two infinite plates that face each other, the lower one shining with M = pi W/m2: M / (1 - rho rho') arrives above,
/// rho' times that below. A shaft of perfect mirrors makes a square of each infinite.
#[test]
fn parallel_plates_send_light_to_and_fro() {
    let Some(gpu) = device() else { return };
    let (below, above) = (0.75, 0.5);
    let mut meshes = shaft(-0.2, 0.2, 2);
    meshes.extend([level(-0.2, [1.0; 2], true, 0), level(0.2, [1.0; 2], false, 1)]);
    let scene = scene_of(meshes, vec![shining(below as f32), matt(above as f32), mirror(1.0)], vec![]);
    let mut family = Family::default();
    for illumination in BOTH {
        let shadow_rays = by_rounds().shadow_rays;
        let settings = SceneSettings { caustic_photons: 20_000, shadow_rays, ..fixed_radius(illumination, 30_000, 1, 48, 0.15) };
        let points = [grid(0.2, DVec3::NEG_Y, 6), grid(-0.2, DVec3::Y, 6)].concat();
        assert_builders_agree(&gpu, &scene, &settings, &points);
        let runs = irradiances(&gpu, &scene, &settings, &points, 1..25);
        let (upper, lower): (Vec<_>, Vec<_>) = runs.iter().map(|run| (run[..36].to_vec(), run[36..].to_vec())).unzip();
        let exact = PI / (1.0 - below * above);
        family.expect_mean(format!("plates, {illumination:?}: above"), &over_points(&upper, 0), exact);
        family.expect_mean(format!("plates, {illumination:?}: below"), &over_points(&lower, 0), above * exact);
    }
    family.assert_tells_one_per_cent();
}

/// Photons that survive bounce k of a closed room: rho^k of all, and none escapes.
fn expect_geometric(family: &mut Family, what: &str, fates: &Fates, rho: f64) {
    for (bounce, counts) in fates.bounces.iter().enumerate() {
        assert_eq!(counts.escaped, 0, "{what}");
        let chance = rho.powi(bounce as i32 + 1);
        let error = (chance * (1.0 - chance) / fates.emitted as f64).sqrt();
        // Where few survive, few tell: 1 % must be seven errors for a test to notice it beside its own.
        let bright = if 0.01 * chance > 7.0 * error { "bright: " } else { "" };
        family.expect_count(format!("{bright}{what}, albedo {rho:.2}, bounce {}", bounce + 1), counts.stored, fates.emitted, chance);
    }
}

/// With a sixth wall the paper's box is closed: albedo^k of the photons are stored at bounce k, by every builder. Where fewer
/// than half of the 524 288 photons are left, more than 1 % goes unnoticed.
#[test]
fn bounces_in_a_closed_room_are_a_geometric_series() {
    let gpu = device();
    let mut family = Family::default();
    for rho in [0.5f32, 0.9, 0.99] {
        let fates = |builder, photons| {
            // So few points need no index of so many photons.
            let usual = RoomSettings { rng: Rng::Philox, mesh: 1, gather: Gather::Brute, threads: 2, ..RoomSettings::default() };
            let settings = RoomSettings { builder, reflectance: rho, photons, ..usual };
            let room = closed_box(&settings, rho);
            match gpu.as_ref().filter(|_| builder != Builder::Cpu) {
                Some(gpu) => run_scene(gpu, &room, &settings),
                None => run_scene_on_cpu(&room, &settings),
            }
            .fates
        };
        for builder in JUDGED {
            expect_geometric(&mut family, &format!("room, {}", builder.name()), &fates(builder, 1 << 19)[0], f64::from(rho));
        }
        let few = fates(Builder::Atomic, 3001);
        for builder in Builder::ON_GPU.into_iter().filter(|_| gpu.is_some()) {
            assert_eq!(fates(builder, 3001), few, "{}", builder.name());
        }
    }
    family.assert_tells(0.01, |what| what.starts_with("bright"));
}

/// The same in a sphere of triangles.
#[test]
fn bounces_in_a_sphere_are_a_geometric_series() {
    let Some(gpu) = device() else { return };
    let lamp = LightKind::Point { position: DVec3::new(0.3, 0.2, 0.1), intensity: Vec3::ONE };
    let mut family = Family::default();
    for rho in [0.5f32, 0.9, 0.99] {
        let scene = scene_of(vec![hollow_sphere(12)], vec![matt(rho)], vec![lamp.clone()]);
        let settings = SceneSettings { photons: 1 << 17, bounces: 15, rounds: 1, radius: Some(0.05), ..by_rounds() };
        let floor = [(DVec3::NEG_Y * 0.95, DVec3::Y)];
        assert_builders_agree(&gpu, &scene, &SceneSettings { radius: Some(0.5), ..settings.clone() }, &floor);
        let lit = received(&gpu, &scene, &settings, &[(DVec3::ZERO, DVec3::Y)]);
        expect_geometric(&mut family, "sphere", &lit.fates[0], f64::from(rho));
    }
    family.assert_tells(0.01, |what| what.starts_with("bright"));
}
