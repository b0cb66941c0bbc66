//! Surfaces that lie in one plane, or next to it: their light is that of one, and of each.

use crate::common::known::kept;
use crate::common::prelude::*;
use photonmill::constants::HIDDEN;
use photonmill::scene::material::{Coverage, Layers, Medium};

/// A room of 4 x 3 x 4 m around the y axis with a lamp of a square metre below its ceiling.
fn room() -> Scene {
    let (corner, x, y, z) = (DVec3::new(-2.0, 0.0, -2.0), DVec3::X * 4.0, DVec3::Y * 3.0, DVec3::Z * 4.0);
    let wall = |name: &str, origin: DVec3, u: DVec3, v: DVec3| Mesh::parallelogram(name, origin, u, v, 0);
    let mut meshes = vec![
        wall("floor", corner, z, x),
        wall("ceiling", corner + y, x, z),
        wall("back", corner, x, y),
        wall("front", corner + z, y, x),
        wall("left", corner, y, z),
        wall("right", corner + x, z, y),
    ];
    meshes.push(Mesh { name: "lamp".into(), ..level(2.5, [1.0; 2], false, 1) });
    scene_of(meshes, vec![matt(0.6), shining(0.6)], vec![])
}

/// Turned and moved, so that no coordinate is a round number.
fn tilted(at: DVec3) -> DVec3 {
    DQuat::from_axis_angle(DVec3::new(0.3, 0.5, -0.8).normalize(), 1.1) * at + DVec3::new(0.1, -0.7, 0.2)
}

/// A scene and points of it as they are, or turned.
fn turned(is_turned: bool, scene: Scene, points: &[(DVec3, DVec3)]) -> (Scene, Vec<(DVec3, DVec3)>) {
    if !is_turned {
        return (scene, points.to_vec());
    }
    let points = points.iter().map(|(at, normal)| (tilted(*at), tilted(*normal) - tilted(DVec3::ZERO))).collect();
    (moved(scene, tilted), points)
}

/// A rug of `cells` x `cells` x 2 triangles around a point of the floor, `height` above it.
fn rug(middle: DVec3, size: f64, height: f64, cells: u32) -> Mesh {
    let corner = middle + DVec3::new(-0.5 * size, height, -0.5 * size);
    tessellated("rug", corner, DVec3::Z * size, DVec3::X * size, cells)
}

/// Points of the rug and beside it; the floor below a rug that is a surface of its own is dark, and a radius off its edge
/// that does not count.
fn points(height: f64) -> Vec<(DVec3, DVec3)> {
    let on_rug = [(0.0, 0.0), (0.31, 0.2), (-0.44, 0.57), (0.7, -0.7), (0.95, 0.1)].map(|(x, z)| DVec3::new(x, height, z));
    let beside = [(1.4, 0.3), (1.5, -1.2), (-0.2, -1.35)].map(|(x, z)| DVec3::new(x, 0.0, z));
    on_rug.into_iter().chain(beside).map(|at| (at, DVec3::Y)).collect()
}

/// Red irradiance at each point, with its standard error.
fn irradiance(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, points: &[(DVec3, DVec3)]) -> Vec<(f64, f64)> {
    let lit = received(gpu, scene, settings, points);
    (0..points.len()).map(|point| red(&lit, point)).collect()
}

fn settings() -> SceneSettings {
    kept(mapped(10_000, 16, by_rounds().bounces, 0.3))
}

/// Complains where a scene is not lit as another at some points.
fn compare(gpu: &Gpu, what: &str, scene: &Scene, points: &[(DVec3, DVec3)], expected: &[(f64, f64)]) -> Vec<String> {
    let found = irradiance(gpu, scene, &SceneSettings { seed: 99, ..settings() }, points);
    let pairs = points.iter().zip(found.iter().zip(expected));
    pairs
        .filter_map(|((at, _), ((found, error), (expected, other)))| {
            assert!(*error < 0.05 * expected && *expected > 0.1, "{what}: {found} +- {error} at {at}, {expected} expected");
            z_check(&format!("{what}, {at}"), *found, *expected, error.hypot(*other)).err()
        })
        .collect()
}

/// A rug is lit as the floor is, however high it lies, however it is cut, and so is the floor beside it.
#[test]
fn a_rug_on_the_floor_is_lit_like_the_floor() {
    let Some(gpu) = device() else { return };
    let expected = irradiance(&gpu, &room(), &settings(), &points(0.0));
    let mut complaints = Vec::new();
    let heights = [(0.0, 1), (0.0, 7), (1e-7, 1), (1e-6, 1), (1e-5, 7), (3e-5, 1), (1e-4, 1), (1e-3, 1)];
    for (k, (height, cells)) in heights.into_iter().enumerate() {
        let is_turned = k % 2 == 1;
        let mut scene = room();
        scene.meshes.push(rug(DVec3::ZERO, 2.0, height, cells));
        let (scene, points) = turned(is_turned, scene, &points(height));
        let what = format!("{height} m above, {cells} x {cells} cells, turned {is_turned}");
        complaints.extend(compare(&gpu, &what, &scene, &points, &expected));
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

/// The same square as `level`, cut along the other diagonal.
fn other_diagonal(mut mesh: Mesh) -> Mesh {
    mesh.triangles = vec![[0, 1, 3], [1, 2, 3]];
    mesh
}

/// A lamp that was exported twice shines once, by photons and by shadow rays, and the warning names both.
#[test]
fn a_lamp_that_is_given_twice_shines_once() {
    let Some(gpu) = device() else { return };
    let power = Geometry::new(&room()).unwrap().power;
    for illumination in BOTH {
        let settings = SceneSettings { illumination, shadow_rays: 8, ..settings() };
        let points = &points(0.0)[..3];
        let expected = irradiance(&gpu, &room(), &settings, points);
        for is_turned in [false, true] {
            let mut scene = room();
            scene.meshes.push(Mesh { name: "lamp.001".into(), ..other_diagonal(scene.meshes[6].clone()) });
            let (scene, points) = turned(is_turned, scene, points);
            let geometry = Geometry::new(&scene).unwrap();
            // A turned room is another size.
            let size = Geometry::new(&turned(is_turned, room(), &[]).0).unwrap().power / power;
            assert!((geometry.power / power / size - 1.0).abs() < 1e-5, "{} instead of {power}", geometry.power);
            let [warning] = &geometry.warnings(&scene)[..] else { panic!("{:?}", geometry.warnings(&scene)) };
            assert!(warning.contains("\"lamp\"") && warning.contains("\"lamp.001\""), "{warning}");
            let found = irradiance(&gpu, &scene, &SceneSettings { seed: 99, ..settings.clone() }, &points);
            for ((found, error), (expected, other)) in found.iter().zip(&expected) {
                assert_holds("twice", z_check("a lamp that is given twice", *found, *expected, error.hypot(*other)));
            }
        }
    }
}

/// A lamp that is a part of the ceiling's plane is seen in full from wherever, and lights the room as one a hair below.
#[test]
fn a_lamp_in_the_plane_of_the_ceiling_shines() {
    let Some(gpu) = device() else { return };
    let with_lamp = |height: f64| {
        let mut scene = room();
        scene.meshes[6] = Mesh { name: "lamp".into(), ..level(height, [1.0; 2], false, 1) };
        scene
    };
    let points = &points(0.0)[..3];
    let settings = settings();
    let expected = irradiance(&gpu, &with_lamp(2.9999), &settings, points);
    for is_turned in [false, true] {
        let (scene, points) = turned(is_turned, with_lamp(3.0), points);
        let found = irradiance(&gpu, &scene, &SceneSettings { seed: 99, ..settings.clone() }, &points);
        for ((found, error), (expected, other)) in found.iter().zip(&expected) {
            assert_holds("in the ceiling", z_check("in the ceiling", *found, *expected, error.hypot(*other)));
        }
        let place = |at: DVec3| if is_turned { tilted(at) } else { at };
        let direct = kept(SceneSettings { rounds: 1, part: Part::Direct, shadow_rays: 1, ..by_rounds() });
        for eye in [DVec3::new(0.1, 0.3, 0.2), DVec3::new(1.9, 0.4, -1.7), DVec3::new(-1.9, 2.8, 0.3)] {
            let angle = 0.05 / eye.distance(DVec3::Y * 3.0);
            let camera = Camera::looking_at("eye", place(eye), place(DVec3::Y * 3.0), DVec3::X, angle);
            let bright = means(&seen(&gpu, &scene, &direct, &camera, [16, 16])).iter().filter(|pixel| pixel.x > 0.99).count();
            assert_eq!(bright, 256, "turned {is_turned}, from {eye}");
        }
    }
}

/// Of sheets that overlap in one plane, in part or whole and over each other's edges, the union counts as surface, and no
/// photon gets through between what is left of them.
#[test]
fn sheets_in_one_plane_cover_their_union() {
    let carpet = |x: f64, z: f64, size: f64, cells: u32| rug(DVec3::new(x, 0.0, z), size, 0.0, cells);
    let cases = [
        ("inside", vec![carpet(0.0, 0.0, 2.0, 5)], 16.0),
        ("across the edge", vec![carpet(2.0, 0.3, 1.0, 3)], 16.5),
        ("across a corner", vec![carpet(2.0, 2.0, 1.0, 1)], 16.75),
        ("three layers", vec![carpet(0.0, 0.0, 2.0, 3), carpet(0.9, 0.0, 1.5, 2), carpet(1.1, 0.2, 0.5, 1)], 16.0),
        ("two apart", vec![carpet(-1.0, -1.0, 0.7, 4), carpet(1.0, 1.0, 0.7, 3)], 16.0),
        ("many", (0..64).map(|k| carpet(f64::from(k % 8) * 0.4 - 1.4, f64::from(k / 8) * 0.4 - 1.4, 0.3, 2)).collect(), 16.0),
    ];
    for (what, rugs, area) in cases {
        for is_turned in [false, true] {
            let mut scene = scene_of(vec![level(0.0, [4.0; 2], true, 0)], vec![matt(0.6)], vec![]);
            scene.meshes.extend(rugs.clone());
            let (scene, up) = turned(is_turned, scene, &[(DVec3::ZERO, DVec3::Y)]);
            let geometry = Geometry::new(&scene).unwrap();
            let found = geometry.area * geometry.unit * geometry.unit;
            assert!((found / area - 1.0).abs() < 1e-5, "{what}, turned {is_turned}: {found} m2 instead of {area}");
            assert!(!geometry.overlaps.is_empty());
            let up = up[0].1.as_vec3();
            assert!(geometry.triangles.iter().all(|of| (of.b - of.a).cross(of.c - of.a).dot(up) > 0.0), "{what}: a piece faces down");
        }
    }
    let Some(gpu) = device() else { return };
    let mut closed = room();
    closed.materials[0] = matt(0.9);
    closed.meshes.extend([carpet(0.1, 0.2, 2.0, 7), carpet(0.9, 0.0, 1.5, 3)]);
    let (closed, points) = turned(true, closed, &points(0.0)[..1]);
    let lit = received(&gpu, &closed, &kept(flights(50_000, 8)), &points);
    let fates = lit.fates[0].ledger();
    assert!(fates.escaped == 0, "{} photons of {} left the room", fates.escaped, lit.fates[0].emitted);
}

/// What touches, stands on, crosses, rises from or lies back to back is no overlap, and neither is what lies a hair above.
#[test]
fn neighbours_are_no_overlaps() {
    for name in built_in::names() {
        let geometry = Geometry::new(&built_in::by_name(name).unwrap()).unwrap();
        assert!(geometry.overlaps.is_empty() && geometry.triangles.iter().all(|triangle| triangle.plane < HIDDEN), "{name}");
    }
    let stands = |y: f64| Mesh::parallelogram("base", DVec3::new(-0.5, y, -0.5), DVec3::X, DVec3::Z, 0);
    let beside = Mesh::parallelogram("beside", DVec3::new(2.0, 0.0, -2.0), DVec3::Z, DVec3::X, 0);
    let across = Mesh::parallelogram("across", DVec3::new(0.3, -1.0, -1.0), DVec3::Y * 2.0, DVec3::Z * 2.0, 0);
    let floor = level(0.0, [4.0; 2], true, 0);
    // Flat enough that its normal is all but the floor's.
    let ramp = Mesh::parallelogram("ramp", DVec3::new(-0.5, 0.0, -0.5), DVec3::Z, DVec3::new(1.0, 1e-4, 0.0), 0);
    for other in [stands(0.0), beside, across, ramp, rug(DVec3::ZERO, 1.0, 1e-5, 1), rug(DVec3::ZERO, 1.0, -1e-5, 1)] {
        for is_turned in [false, true] {
            let scene = scene_of(vec![floor.clone(), other.clone()], vec![matt(0.6)], vec![]);
            let geometry = Geometry::new(&turned(is_turned, scene, &[]).0).unwrap();
            assert!(geometry.overlaps.is_empty() && geometry.triangles.iter().all(|triangle| triangle.plane < HIDDEN), "{}", other.name);
        }
    }
}

/// The path tracer that judges pictures sees the same surfaces.
#[test]
fn the_judge_counts_an_overlap_once() {
    let mut scene = room();
    scene.materials.push(matt(0.2));
    scene.meshes.push(Mesh { material: 2, ..rug(DVec3::ZERO, 2.0, 0.0, 3) });
    scene.meshes.push(Mesh { name: "lamp.001".into(), ..other_diagonal(scene.meshes[6].clone()) });
    // The lamp once, and the floor without the rug's part of it.
    let mut expected = room();
    expected.materials = scene.materials.clone();
    let strip = |x: f64, z: f64, size: [f64; 2]| {
        let corner = DVec3::new(x, 0.0, z);
        Mesh::parallelogram("strip", corner, DVec3::Z * size[1], DVec3::X * size[0], 0)
    };
    expected.meshes[0] = Mesh { material: 2, ..rug(DVec3::ZERO, 2.0, 0.0, 3) };
    expected.meshes.extend([
        strip(-2.0, -2.0, [1.0, 4.0]),
        strip(1.0, -2.0, [1.0, 4.0]),
        strip(-1.0, -2.0, [2.0, 1.0]),
        strip(-1.0, 1.0, [2.0, 1.0]),
    ]);
    let points = [(DVec3::new(0.5, 0.0, 0.4), DVec3::Y), (DVec3::new(0.2, 3.0, 0.9), DVec3::NEG_Y)];
    let [found, expected] = [(&scene, 1), (&expected, 2)].map(|(scene, seed)| Judge::new(scene, 8).irradiance_at(&points, 8000, seed));
    for ((found, expected), (at, _)) in found.iter().zip(&expected).zip(points) {
        let error = found.total_standard_error.x.hypot(expected.total_standard_error.x);
        let [found, expected] = [found.mean.total().x, expected.mean.total().x];
        assert!(error < 0.05 * expected, "{at}: {error} of {expected}");
        assert_holds("judge", z_check(&format!("{at}"), found, expected, error));
    }
}

/// Rays that start close above a rug see the rug, however little rounding leaves of their way, and where the rug ends the floor.
#[test]
fn short_rays_see_what_counts() {
    let Some(gpu) = device() else { return };
    let lamp = point(DVec3::Y * 2.0);
    let settings = kept(SceneSettings { photons: 1, rounds: 1, shadow_rays: 1, ..by_rounds() });
    for (what, lift) in [("on the floor", 0.0), ("above the floor", 3e-6), ("below the floor", -3e-6)] {
        let floor = level(0.0, [10.0; 2], true, 0);
        let mut rug = level(0.0, [2.0; 2], true, 1);
        rug.positions.iter_mut().for_each(|at| at.y += lift);
        let scene = scene_of(vec![floor, rug], vec![matt(0.2), matt(0.8)], vec![lamp.clone()]);
        for height in [0.02, 0.001] {
            let down = |albedo: f64, middle: DVec3| {
                let at = |k: u32| middle + DVec3::new(f64::from(k % 20) * 0.01 - 0.1, height, f64::from(k / 20) * 0.01 - 0.1);
                let points: Vec<(DVec3, DVec3)> = (0..400).map(|k| (at(k), DVec3::NEG_Y)).collect();
                let seen = means(&received(&gpu, &scene, &settings, &points));
                // A few rays run so flat that they reach another place.
                let exact = albedo * middle.with_y(2.0).length_squared().recip() * 2.0 / middle.with_y(2.0).length();
                let others = seen.iter().filter(|mean| (mean.x / exact - 1.0).abs() > 0.25).count();
                assert!(others <= 4, "rug {what}, probes {height} m above albedo {albedo}: {others} of 400 see something else");
            };
            down(0.8, DVec3::ZERO);
            down(0.2, DVec3::X * 3.0);
        }
    }
}

/// Also of a glTF file's glass: the table's top shows through the block.
#[test]
fn a_block_of_glass_on_a_table_hides_no_top() {
    let solid = Layers { transmission: 1.0, medium: Some(Medium::CLEAR), metallic: 0.0, ..Layers::default() };
    let pane = Layers { medium: None, ..solid };
    let leaves = Material { coverage: Coverage::Blend { alpha: 0.5 }, ..matt(0.5) };
    let layered = |layers: Layers| Material::layered("glass", Vec3::ONE, layers);
    let top_beside = |block: Material, faces_up: bool| {
        let meshes = vec![level(0.0, [2.0; 2], true, 0), level(0.0, [1.0; 2], faces_up, 1)];
        let table = Material { two_sided: true, ..matt(0.5) };
        let lights = vec![LightKind::Environment { radiance: Vec3::ONE }];
        let geometry = Geometry::new(&scene_of(meshes, vec![table, block], lights)).unwrap();
        geometry.triangles.iter().filter(|triangle| triangle.material == 0 && triangle.plane < HIDDEN).count()
    };
    // The block's lower side.
    assert_eq!(top_beside(layered(solid), false), 2);
    // What lets light through lies under what does not, and cuts nothing out of it.
    for (material, name) in
        [(layered(solid), "solid"), (layered(pane), "pane"), (Material { surface: Surface::Layered, ..leaves }, "leaves")]
    {
        assert_eq!(top_beside(material, true), 2, "{name}");
    }
    assert!(top_beside(matt(0.5), true) > 2);
}
