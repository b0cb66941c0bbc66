//! Surfaces that lie in one plane, or next to it: their light is that of one, and of each.

use crate::common::known::{kept, of_any_room};
use crate::common::layered::{CLEAR, dull, layered, metal, plastic, row_of_texels, without_maps};
use crate::common::prelude::*;
use crate::common::rendered::{around_hole, sides};
use photonmill::constants::HIDDEN;
use photonmill::scene::material::{Coverage, Layers};
use photonmill::scene::solids;
use photonmill::scene::texture::Filter;

/// A room of 4 x 3 x 4 m around the y axis with a lamp of a square metre below its ceiling.
fn room() -> Scene {
    let mut meshes = sides(DVec3::new(-2.0, 0.0, -2.0), DVec3::new(4.0, 3.0, 4.0), true, [0; 6]);
    meshes.push(Mesh { name: "lamp".into(), ..level(2.5, [1.0; 2], false, 1) });
    scene_of(meshes, vec![matt(0.6), emissive(0.6)], vec![])
}

/// Turned and moved, so that no coordinate is a round number.
fn tilted(at: DVec3) -> DVec3 {
    DQuat::from_axis_angle(DVec3::new(0.3, 0.5, -0.8).normalize(), 1.1) * at + DVec3::new(0.1, -0.7, 0.2)
}

/// A scene, and points of it with their normals.
type Asked = (Scene, Vec<(DVec3, DVec3)>);

/// As they are, or turned.
fn turned(is_turned: bool, scene: Scene, points: &[(DVec3, DVec3)]) -> Asked {
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
    let result = received(gpu, scene, settings, points);
    (0..points.len()).map(|point| red(&result, point)).collect()
}

fn settings() -> SceneSettings {
    kept(mapped(10_000, 16, by_rounds().bounces, 0.3))
}

/// Fails where a scene is not lit as another at some points.
fn assert_lit_like(gpu: &Gpu, what: &str, settings: &SceneSettings, (scene, points): &Asked, expected: &[(f64, f64)]) {
    let found = irradiance(gpu, scene, &SceneSettings { seed: 99, ..settings.clone() }, points);
    for ((at, _), ((found, error), (expected, other))) in pairs(points, pairs(found, expected)) {
        assert!(error < 0.05 * expected && *expected > 0.1, "{what}: {found} +- {error} at {at}, {expected} expected");
        assert_holds(what, z_check(&format!("{at}"), found, *expected, error.hypot(*other)));
    }
}

/// A rug is lit as the floor is, however high it lies, however it is cut, and so is the floor beside it. And a lamp in the plane of the
/// ceiling emits, by the same kernels.
#[test]
fn a_rug_on_the_floor_is_lit_like_the_floor() {
    let Some(gpu) = device() else { return };
    a_lamp_in_the_plane_of_the_ceiling_emits(&gpu);
    for room in [with_overlap_outside(room()), room()].into_iter().take(of_run(1, 2)) {
        let expected = irradiance(&gpu, &room, &settings(), &points(0.0));
        let heights = [(0.0, 1), (0.0, 7), (1e-7, 1), (1e-6, 1), (1e-5, 7), (3e-5, 1), (1e-4, 1), (1e-3, 1)];
        for (k, (height, cells)) in heights.into_iter().enumerate() {
            let is_turned = k % 2 == 1;
            let mut scene = room.clone();
            scene.meshes.push(rug(DVec3::ZERO, 2.0, height, cells));
            let what = format!("{height} m above, {cells} x {cells} cells, turned {is_turned}");
            assert_lit_like(&gpu, &what, &settings(), &turned(is_turned, scene, &points(height)), &expected);
        }
    }
}

/// With sheets that overlap outside of the room, so that it has the kernels of others that overlap.
fn with_overlap_outside(mut room: Scene) -> Scene {
    room.meshes.extend([rug(DVec3::X * 3.0, 0.5, 0.0, 1), rug(DVec3::X * 3.0, 0.5, 0.0, 1)]);
    room
}

/// The same square as `level`, cut along the other diagonal.
fn other_diagonal(mut mesh: Mesh) -> Mesh {
    mesh.triangles = vec![[0, 1, 3], [1, 2, 3]];
    mesh
}

/// A lamp that was exported twice emits once, by photons and by shadow rays, and the warning names both.
#[test]
fn a_lamp_that_is_given_twice_emits_once() {
    let Some(gpu) = device() else { return };
    let power = Geometry::new(&room()).unwrap().power;
    for illumination in BOTH {
        let settings = SceneSettings { illumination, shadow_rays: 8, ..settings() };
        let points = &points(0.0)[..3];
        let expected = irradiance(&gpu, &with_overlap_outside(room()), &settings, points);
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
            assert_lit_like(&gpu, "a lamp that is given twice", &settings, &(scene, points), &expected);
        }
    }
}

/// A lamp that is a part of the ceiling's plane is seen in full from wherever, and lights the room as one a hair below.
fn a_lamp_in_the_plane_of_the_ceiling_emits(gpu: &Gpu) {
    let with_lamp = |height: f64| {
        let mut scene = room();
        scene.meshes[6] = Mesh { name: "lamp".into(), ..level(height, [1.0; 2], false, 1) };
        scene
    };
    let points = &points(0.0)[..3];
    let settings = settings();
    let expected = irradiance(gpu, &with_overlap_outside(with_lamp(2.9999)), &settings, points);
    for is_turned in [false, true] {
        let lit_room = turned(is_turned, with_lamp(3.0), points);
        assert_lit_like(gpu, "in the ceiling", &settings, &lit_room, &expected);
        let place = |at: DVec3| if is_turned { tilted(at) } else { at };
        let direct = kept(SceneSettings { rounds: 1, part: Part::Direct, shadow_rays: 1, ..by_rounds() });
        for eye in [DVec3::new(0.1, 0.3, 0.2), DVec3::new(1.9, 0.4, -1.7), DVec3::new(-1.9, 2.8, 0.3)] {
            let angle = 0.05 / eye.distance(DVec3::Y * 3.0);
            let camera = Camera::looking_at("eye", place(eye), place(DVec3::Y * 3.0), DVec3::X, angle);
            let bright = means(&seen(gpu, &lit_room.0, &direct, &camera, [16, 16])).iter().filter(|pixel| pixel.x > 0.99).count();
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
    let result = received(&gpu, &closed, &kept(flights(50_000, 8)), &points);
    let fates = result.fates[0].ledger();
    assert!(fates.escaped == 0, "{} photons of {} left the room", fates.escaped, result.fates[0].emitted);
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
    expected.meshes[0] = Mesh { material: 2, ..rug(DVec3::ZERO, 2.0, 0.0, 3) };
    let floor = around_hole(DVec3::new(-2.0, 0.0, -2.0), DVec3::Z * 4.0, DVec3::X * 4.0, [0.25, 0.75].map(DVec2::splat), 0);
    expected.meshes.extend(floor);
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
        let meshes = vec![level(0.0, [10.0; 2], true, 0), level(lift, [2.0; 2], true, 1)];
        let scene = scene_of(meshes, vec![matt(0.2), matt(0.8)], vec![lamp.clone()]);
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
    let top_beside = |block: Material, faces_up: bool| {
        let meshes = vec![level(0.0, [2.0; 2], true, 0), level(0.0, [1.0; 2], faces_up, 1)];
        let table = Material { two_sided: true, ..matt(0.5) };
        let lights = vec![LightKind::Environment { radiance: Vec3::ONE }];
        let geometry = Geometry::new(&scene_of(meshes, vec![table, block], lights)).unwrap();
        geometry.triangles.iter().filter(|triangle| triangle.material == 0 && triangle.plane < HIDDEN).count()
    };
    // The block's lower side.
    assert_eq!(top_beside(clear_solid(1.5), false), 2);
    // What lets light through lies under what does not, and cuts nothing out of it.
    for made in [Made::SolidGlass, Made::ThinGlass, Made::HalfAlpha] {
        assert_eq!(top_beside(Material { two_sided: false, ..made.material(0.5) }, true), 2, "{made:?}");
    }
    assert!(top_beside(matt(0.5), true) > 2);
}

/// Clear glass of this index that bounds a solid.
fn clear_solid(ior: f32) -> Material {
    layered(Vec3::ONE, &Layers { transmission: 1.0, medium: CLEAR, ior, ..plastic(0.0) })
}

/// A box of one mesh, that faces outwards.
fn cuboid(name: &str, low: DVec3, high: DVec3, material: usize) -> Mesh {
    let corner = |k: u32| DVec3::from_array([0, 1, 2].map(|axis| if k >> axis & 1 == 1 { high[axis] } else { low[axis] }));
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let halves = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    Mesh {
        name: name.into(),
        positions: (0..8).map(corner).collect(),
        triangles: faces.into_iter().flat_map(halves).collect(),
        material,
        ..Mesh::default()
    }
}

fn faces_inwards(mesh: Mesh) -> Mesh {
    let triangles = mesh.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    Mesh { triangles, ..mesh }
}

/// A closed room of a cube of 1 m whose walls, which scatter a half, have a radiance of 1 wherever one looks.
fn furnace_with(meshes: Vec<Mesh>, materials: Vec<Material>) -> Scene {
    let walls = faces_inwards(cuboid("walls", DVec3::ZERO, DVec3::ONE, 0));
    let grey = Material { emission: Vec3::splat(0.5), ..matt(0.5) };
    scene_of([vec![walls], meshes].concat(), [vec![grey], materials].concat(), vec![])
}

/// The scenes of a test share kernels, and no others have these.
fn brief() -> SceneSettings {
    of_any_room(SceneSettings { photons: 8000, caustic_photons: 8000, rounds: 8, shadow_rays: 4, ..by_rounds() })
}

/// No photons: light of the sky, by shadow rays and through what is clear.
fn without_photons() -> SceneSettings {
    let without = vec![Effect::Indirect, Effect::ReflectiveCaustics, Effect::RefractiveCaustics];
    SceneSettings { without, aim: false, ..brief() }
}

/// What keeps no photons is no area that they are counted over: a floor is lit to its edge, whatever of these lies beside it.
pub fn floor_beside(gpu: &Gpu, what: &str, other: Material) -> Check<Complaint> {
    let half = |x: f64, material: usize| Mesh::parallelogram("half", DVec3::new(x, 0.0, 0.0), DVec3::Z, DVec3::X * 0.5, material);
    let points = [(DVec3::new(0.499, 0.0, 0.5), DVec3::Y), (DVec3::new(0.25, 0.0, 0.5), DVec3::Y)];
    let scene = scene_of(vec![half(0.0, 0), half(0.5, 1)], vec![matt(0.5), other], vec![LightKind::Environment { radiance: Vec3::ONE }]);
    let result = received(gpu, &scene, &mapped(20_000, 16, 2, 0.1), &points);
    (0..2).try_for_each(|place| red_check(&format!("a floor beside {what}"), &result, place, PI, [0.05, 0.0]))
}

#[test]
fn a_floor_beside_what_keeps_no_photons_is_lit_to_its_edge() {
    let Some(gpu) = device() else { return };
    let others = [("mirror", mirror(1.0)), ("metal", Made::Metal.material(1.0)), ("glass", clear_solid(1.5))];
    for (what, other) in others.into_iter().take(of_run(1, 3)) {
        assert_holds(what, floor_beside(&gpu, what, other));
    }
}

/// A floor below a block of glass that stands on it is lit as below one that is sunk into it by a millimetre. (What the floor emits
/// within the glass is less than a furnace's.)
#[test]
#[ignore = "long: two sets of kernels"]
fn a_floor_below_glass_that_stands_on_it_is_lit() {
    let Some(gpu) = device() else { return };
    let [(touching, error), (sunk, other)] = [0.0, 1e-3].map(|sunk| {
        let block = cuboid("block", DVec3::new(0.3, -sunk, 0.3), DVec3::new(0.7, 0.3, 0.7), 1);
        let scene = furnace_with(vec![block], vec![clear_solid(1.5)]);
        red(&received(&gpu, &scene, &kept(mapped(20_000, 16, 64, 0.1)), &[(DVec3::new(0.5, 0.0, 0.45), DVec3::Y)]), 0)
    });
    println!("below glass: {touching} +- {error} touching, {sunk} +- {other} sunk");
    assert!(error < 0.03 * touching, "{error}");
    assert_holds("below glass", z_check("below glass", touching, sunk, error.hypot(other)));
}

/// Water that exactly fills its vessel, under a sky of 1: white walls give back what they get, so that all is 1. In the long run in a thick one too,
/// and as what is sunk into its vessel.
#[test]
fn a_liquid_that_fills_its_vessel_neither_gains_nor_loses_light() {
    let all = is_long_run();
    let Some(gpu) = device() else { return };
    let vessel = |two_sided: bool, thick: bool, sunk: f64| {
        let [low, high] = [DVec3::new(-0.5, 0.0, -0.5), DVec3::new(0.5, 1.0, 0.5)];
        let open = |mut mesh: Mesh| {
            mesh.triangles.retain(|corners| corners.iter().any(|vertex| mesh.positions[*vertex as usize].y < 1.0));
            mesh
        };
        let grown = DVec3::new(sunk, 0.0, sunk);
        let water = cuboid("water", low - grown - DVec3::Y * sunk, DVec3::new(high.x, 0.8, high.z) + grown, 1);
        let mut meshes = vec![open(faces_inwards(cuboid("vessel", low, high, 0))), water];
        if thick {
            meshes.push(open(cuboid("outside", low - 0.1, high + DVec3::new(0.1, 0.0, 0.1), 0)));
        }
        scene_of(meshes, vec![Material { two_sided, ..matt(1.0) }, clear_solid(1.33)], vec![LightKind::Environment { radiance: Vec3::ONE }])
    };
    let camera = Camera::looking_at("eye", DVec3::new(0.0, 2.5, 1.8), DVec3::new(0.0, 0.5, 0.0), DVec3::Y, 0.7);
    let mean = |two_sided: bool, thick: bool, sunk: f64| {
        let scene = vessel(two_sided, thick, sunk);
        let result = seen(&gpu, &scene, &SceneSettings { samples: 4, bounces: 64, ..brief() }, &camera, [8, 8]);
        let error = standard_errors(&result).iter().map(|error| error.x.powi(2)).sum::<f64>().sqrt() / 64.0;
        (mean_red(&result), error)
    };
    // Of thick walls only the sides are there, so that some light is lost between them.
    for (two_sided, thick) in [(true, false), (false, true)].into_iter().filter(|(_, thick)| all || !thick) {
        let (touching, error) = mean(two_sided, thick, 0.0);
        let what = format!("two-sided {two_sided}, thick {thick}");
        println!("{what}: {touching} +- {error} touching");
        assert!(thick || (touching - 1.0).abs() < 0.04, "{what}: {touching}");
        if all {
            let (sunk, other) = mean(two_sided, thick, 1e-3);
            println!("{what}: {sunk} +- {other} sunk");
            assert!((touching - sunk).abs() < 0.03, "{what}: {touching} touching, {sunk} sunk");
        }
    }
}

/// A decal with gaps of alpha in a wall's plane is seen where it is, and the wall where it is not; light arrives at both.
/// A tank full of water around smaller things of the tank's glass: by size the water would not count within the tank.
#[test]
fn a_solid_that_would_be_hidden_by_size_is_named() {
    let block = |name: &str, half: f64, height: f64| {
        cuboid(name, DVec3::new(-half, height - half, -half), DVec3::new(half, height + half, half), usize::from(name == "water"))
    };
    let order_of = |meshes: Vec<Mesh>| {
        let scene = scene_of(meshes, vec![clear_solid(1.5), clear_solid(1.33)], vec![point(DVec3::Y * 9.0)]);
        let geometry = Geometry::new(&scene).unwrap();
        let named = geometry.hidden_solid.map(|mesh| scene.meshes[mesh as usize].name.clone());
        assert_eq!(named.is_some(), geometry.warnings(&scene).iter().any(|line| line.contains("partly in one another")), "{named:?}");
        (geometry.has_media_by_size, named)
    };
    let (tank, water, inside, across) =
        (block("tank", 2.0, 0.0), block("water", 1.0, 0.0), block("ball", 0.2, 0.0), block("stick", 0.2, 1.0));
    for (what, meshes, expected) in [
        ("nested", vec![tank.clone(), water.clone(), inside.clone()], (false, None)),
        ("standing out", vec![water.clone(), inside, across.clone()], (true, None)),
        ("flush", vec![water.clone(), block("stick", 0.2, 0.8)], (false, None)),
        ("on top", vec![water.clone(), block("stick", 0.2, 1.2)], (false, None)),
        ("hidden", vec![tank, water, across], (false, Some("water".to_owned()))),
    ] {
        assert_eq!(order_of(meshes), expected, "{what}");
    }
}

/// A block that stands out of the water in a closed white room: who comes to the water's face within the block has nothing to meet there,
/// whether light goes up or down, so that no light is caught in its dry end.
#[test]
#[ignore = "long: kernels of solids in one another"]
fn a_block_that_stands_out_of_water_catches_no_light() {
    let Some(gpu) = device() else { return };
    let walls = faces_inwards(cuboid("walls", DVec3::ZERO, DVec3::ONE, 0));
    let ceiling = Mesh::parallelogram("ceiling", DVec3::Y, DVec3::X, DVec3::Z, 3);
    let water = cuboid("water", DVec3::ZERO, DVec3::new(1.0, 0.25, 1.0), 1);
    let block = cuboid("block", DVec3::new(0.15, 0.025, 0.15), DVec3::new(0.45, 0.4, 0.45), 2);
    let emissive = Material { emission: Vec3::splat(0.5), ..matt(0.5) };
    let scene = scene_of(vec![walls, ceiling, water, block], vec![matt(1.0), clear_solid(1.33), clear_solid(1.6), emissive], vec![]);
    let camera = Camera::looking_at("eye", DVec3::new(0.9, 0.85, 0.9), DVec3::splat(0.3), DVec3::Y, 1.22);
    let result = seen(&gpu, &scene, &SceneSettings { samples: 16, rounds: 32, ..brief() }, &camera, [8, 8]);
    let found: Vec<(f64, f64)> = (0..64).map(|pixel| red(&result, pixel)).collect();
    let mean = found.iter().map(|(mean, _)| mean).sum::<f64>() / 64.0;
    println!("a block in water: {mean}, {found:?}");
    assert!((mean - 1.0).abs() < 0.02, "{mean}");
    for (mean, error) in found {
        assert!((mean - 1.0).abs() < f64::max(0.05, 5.0 * error), "{mean} +- {error}");
    }
}

#[test]
fn a_decal_in_the_plane_of_a_wall_is_seen_where_its_alpha_is() {
    let Some(gpu) = device() else { return };
    let wall = Material { two_sided: true, ..matt(0.5) };
    let halves = row_of_texels(&[[255, 255, 255, 0], [255; 4]], Filter::Nearest);
    let black = Material { base_colour: Vec3::ZERO, base_colour_texture: Some(TextureUse::of(0, 0)), ..dull(0.0) };
    let decal = Material { coverage: Coverage::Blend { alpha: 1.0 }, ..black };
    for faces_up in [true, false] {
        let decal = Material { two_sided: !faces_up, ..decal.clone() };
        let mut mesh = Mesh { name: "decal".into(), ..level(0.0, [1.0; 2], faces_up, 1) };
        mesh.uvs[0] = mesh.positions.iter().map(|at| DVec2::new(at.x + 0.5, 0.5)).collect();
        let materials = vec![Material { two_sided: false, ..wall.clone() }, decal];
        // A copy of the wall's own triangles is a decal, too.
        let copy = Mesh { name: "wall".into(), material: 0, ..mesh.clone() };
        let twice = Scene { textures: vec![halves.clone()], ..scene_of(vec![copy, mesh.clone()], materials.clone(), vec![]) };
        assert_eq!(Geometry::new(&twice).unwrap().left_out, 0);
        let meshes = vec![level(0.0, [4.0; 2], true, 0), mesh];
        let mut scene = scene_of(meshes, materials, vec![LightKind::Environment { radiance: Vec3::ONE }]);
        scene.textures = vec![halves.clone()];
        let camera = Camera::looking_at("above", DVec3::Y * 10.0, DVec3::ZERO, DVec3::NEG_Z, 0.08);
        let result = seen(&gpu, &scene, &without_photons(), &camera, [4, 4]);
        let means: Vec<f64> = means(&result).iter().map(|mean| mean.x).collect();
        // The left half has gaps, the right half none.
        for (place, mean) in means.iter().enumerate() {
            let expected = if place % 4 < 2 { 0.5 } else { 0.0 };
            assert!((mean - expected).abs() < 0.03, "facing up {faces_up}: {means:?}");
        }
    }
}

/// Red paper that scatters nothing back, on a wall of its very triangles: all that is seen has passed it, gone back from the wall, and
/// passed it again.
#[test]
fn paper_on_a_wall_shows_the_wall() {
    let Some(gpu) = device() else { return };
    let layers = Layers { diffuse_transmission: 1.0, diffuse_transmission_colour: Vec3::X, ..dull(0.0).layers };
    let meshes = vec![level(0.0, [2.0; 2], true, 0), level(0.0, [2.0; 2], true, 1)];
    let materials = vec![matt(0.8), layered(Vec3::X, &layers)];
    let scene = scene_of(meshes, materials, vec![LightKind::Environment { radiance: Vec3::ONE }]);
    let camera = Camera::looking_at("above", DVec3::Y * 2.0, DVec3::ZERO, DVec3::NEG_Z, 0.7);
    let settings = SceneSettings { photons: 8192, caustic_photons: 8192, rounds: 32, samples: 1, ..by_rounds() };
    let means = means(&seen(&gpu, &scene, &settings, &camera, [8; 2]));
    let mean = means.iter().sum::<DVec3>() / means.len() as f64;
    println!("paper on a wall: {mean}");
    assert!((mean.x / 0.8 - 1.0).abs() < 0.05 && mean.y.max(mean.z) < 0.01, "{mean}");
}

/// Glass whose faces look inwards is turned, but not what is hollow in it; where five solids and more lie in one another, each counts.
#[test]
fn solids_face_outwards() {
    let ball = |radius: f64| Mesh { normals: Vec::new(), ..Mesh::sphere("ball", DVec3::ZERO, radius, 16, 0) };
    let volume = |mesh: &Mesh| (0..mesh.triangles.len()).map(|k| mesh.corners(k)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum::<f64>();
    let cases = [
        ("outwards", vec![ball(1.0)], vec![1.0]),
        ("inwards", vec![faces_inwards(ball(1.0))], vec![1.0]),
        ("hollow", vec![ball(1.0), faces_inwards(ball(0.5))], vec![1.0, -1.0]),
        ("hollow and inside out", vec![faces_inwards(ball(1.0)), ball(0.5)], vec![1.0, -1.0]),
        ("of another glass", vec![ball(1.0), Mesh { material: 1, ..faces_inwards(ball(0.5)) }], vec![1.0, 1.0]),
    ];
    for (what, meshes, signs) in cases {
        let was_turned = meshes.iter().zip(&signs).any(|(mesh, sign)| volume(mesh) * sign < 0.0);
        let mut scene = scene_of(meshes, vec![clear_solid(1.5), clear_solid(1.33)], vec![]);
        let names = solids::turn_outwards(&mut scene);
        assert_eq!(!names.is_empty(), was_turned, "{what}");
        assert!(scene.meshes.iter().zip(&signs).all(|(mesh, sign)| volume(mesh) * sign > 0.0), "{what}");
    }
    // An open one has no inside.
    let mut open = faces_inwards(ball(1.0));
    open.triangles.pop();
    assert!(solids::turn_outwards(&mut scene_of(vec![open], vec![clear_solid(1.5)], vec![])).is_empty());
}

/// Balls in one another, each of its own glass.
fn nested_balls(count: usize) -> Scene {
    let ball = |k: usize| Mesh::sphere(&format!("ball {k}"), DVec3::ZERO, 1.0 - 0.5 * k as f64 / count as f64, 32, k);
    let materials = (0..count).map(|k| clear_solid(1.1 + 0.3 * (k % 3) as f32 + 0.01 * k as f32)).collect();
    scene_of((0..count).map(ball).collect(), materials, vec![LightKind::Environment { radiance: Vec3::ONE }])
}

#[test]
fn many_solids_in_one_another_each_count_or_are_refused() {
    let bits = |scene: &Scene| Geometry::new(scene).map(|geometry| geometry.medium_bits);
    assert_eq!(bits(&nested_balls(4)).unwrap(), 8);
    assert_eq!(bits(&nested_balls(7)).unwrap(), 3);
    let refused = bits(&nested_balls(9)).unwrap_err().to_string();
    assert!(refused.contains("is one of 9 solids that lie in one another") && refused.contains("at most 8 may"), "{refused}");
    // Of one glass there is more room.
    let mut alike = nested_balls(9);
    alike.meshes.iter_mut().for_each(|mesh| mesh.material = 0);
    alike.materials.truncate(1);
    assert_eq!(bits(&alike).unwrap(), 1);
    let Some(gpu) = device() else { return };
    let camera = Camera::looking_at("eye", DVec3::Z * 6.0, DVec3::ZERO, DVec3::Y, 0.3);
    let result = seen(&gpu, &nested_balls(6), &SceneSettings { samples: 4, rounds: 4, ..without_photons() }, &camera, [8, 8]);
    let means: Vec<f64> = means(&result).iter().map(|mean| mean.x).collect();
    // Few paths at rims end before they are out.
    assert!(means.iter().all(|mean| (mean - 1.0).abs() < 0.1), "{means:?}");
}

/// What a surface of the table is made of.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Made {
    Rough,
    Mirror,
    Metal,
    SolidGlass,
    ThinGlass,
    HalfAlpha,
    Mask,
    Unlit,
    Lamp,
}

const MADE: [Made; 9] =
    [Made::Rough, Made::Mirror, Made::Metal, Made::SolidGlass, Made::ThinGlass, Made::HalfAlpha, Made::Mask, Made::Unlit, Made::Lamp];

impl Made {
    /// `colour` multiplies what it gives back.
    fn material(self, colour: f32) -> Material {
        let grey = Vec3::splat(colour);
        let of = match self {
            Made::Rough => matt(colour),
            Made::Mirror => mirror(colour),
            Made::Metal => layered(grey, &metal(0.0)),
            Made::SolidGlass => clear_solid(1.5),
            Made::ThinGlass => layered(Vec3::ONE, &Layers { transmission: 1.0, ..plastic(0.0) }),
            Made::HalfAlpha => Material { coverage: Coverage::Blend { alpha: 0.5 }, ..dull(colour) },
            Made::Mask => Material { coverage: Coverage::Mask { alpha: 0.2, cutoff: 0.5 }, ..dull(colour) },
            Made::Unlit => layered(grey, &Layers { is_unlit: true, ..metal(1.0) }),
            Made::Lamp => Material { emission: Vec3::splat(0.5), ..matt(0.5) },
        };
        Material { two_sided: true, ..of }
    }

    fn is_sheet(self) -> bool {
        matches!(self, Made::ThinGlass | Made::HalfAlpha | Made::Mask)
    }

    /// Where the small one goes, of this, that lies on a large one, to show the same without contact: 1 up, -1 down. `faces_up`
    /// is as the large one faces.
    fn apart_from(self, large: Made, faces_up: bool) -> f64 {
        match (self, large) {
            // A solid goes on into what it touches, or lies inside of it.
            (Made::SolidGlass, _) => -1.0,
            // What is small lies on what is large, but a sheet on all else, and a lamp is seen.
            (small, large) if large.is_sheet() && !small.is_sheet() => -1.0,
            (small, Made::Lamp) if !small.is_sheet() && small != Made::Lamp => -1.0,
            // A sheet goes to its own front, where the other has two sides.
            (small, _) if small.is_sheet() && !faces_up => -1.0,
            _ => 1.0,
        }
    }
}

/// Pairs side by side: each of these kinds of surface, large and facing up, in one plane with each other, small and facing up or down.
fn table(kinds: &[Made], lift: f64, colours: [f32; 2]) -> Scene {
    let materials = colours.into_iter().flat_map(|colour| kinds.iter().map(move |made| made.material(colour))).collect();
    let mut scene = scene_of(vec![], materials, vec![LightKind::Environment { radiance: Vec3::ONE }]);
    let count = kinds.len();
    for (row, &large) in kinds.iter().enumerate() {
        for (column, (small, faces_up)) in kinds.iter().flat_map(|made| [(*made, true), (*made, false)]).enumerate() {
            let middle = DVec3::new(column as f64 - count as f64 + 0.5, 0.0, row as f64 - 0.5 * (count as f64 - 1.0));
            let mut put = |made: Made, width: f64, height: f64, faces_up: bool, material: usize| {
                let mut mesh = match made {
                    Made::SolidGlass => {
                        let (low, high) = if faces_up { (height - 0.3 * width, height) } else { (height, height + 0.3 * width) };
                        cuboid("solid", DVec3::new(-0.5 * width, low, -0.5 * width), DVec3::new(0.5 * width, high, 0.5 * width), material)
                    }
                    _ => level(height, [width; 2], faces_up, material),
                };
                mesh.positions.iter_mut().for_each(|at| *at += middle);
                scene.meshes.push(mesh);
            };
            put(large, 0.96, 0.0, true, row);
            put(small, 0.9, lift * small.apart_from(large, faces_up), faces_up, count + column / 2);
        }
    }
    scene
}

/// What a pair of the table is, for messages.
fn pair(kinds: &[Made], place: usize) -> (Made, Made, &'static str) {
    let (row, column) = (place / (2 * kinds.len()), place % (2 * kinds.len()));
    (kinds[row], kinds[column / 2], if column % 2 == 0 { "the same way" } else { "opposite ways" })
}

/// A pixel of each pair of so many rows, from above or below.
fn seen_of_table(gpu: &Gpu, scene: &Scene, rows: usize, from: f64) -> Vec<(f64, f64)> {
    let distance = 300.0;
    let angle = 2.0 * (0.5 * rows as f64 / distance).atan();
    let camera = Camera::looking_at("table", DVec3::Y * from * distance, DVec3::ZERO, DVec3::NEG_Z, angle);
    let settings = SceneSettings { samples: 64, rounds: 8, photons: 20_000, caustic_photons: 20_000, ..brief() };
    let columns = 2 * rows;
    let result = seen(gpu, scene, &settings, &camera, [columns as u32, rows as u32]);
    let place = |row: usize, column: usize| columns * row + if from > 0.0 { column } else { columns - 1 - column };
    (0..rows * columns).map(|k| red(&result, place(k / columns, k % columns))).collect()
}

/// Each of these kinds of surface against each other in one plane: none gains or loses light, from whichever side.
/// Glass has kernels of its own: short tests of it are those of a liquid in its vessel and of solids that touch.
#[test]
fn surfaces_in_one_plane_keep_the_light_of_a_furnace() {
    let kinds = of_run::<&[_]>(&[Made::Rough, Made::Mirror], &MADE);
    let Some(gpu) = device() else { return };
    let scene = table(kinds, 0.0, [1.0; 2]);
    let mut complaints = Vec::new();
    for from in [1.0, -1.0] {
        for (place, (mean, error)) in seen_of_table(&gpu, &scene, kinds.len(), from).iter().enumerate() {
            let (large, small, way) = pair(kinds, place);
            // What emits into glass has its radiance there, and less of it outside.
            let emits = |made: Made| matches!(made, Made::Lamp | Made::Unlit);
            let emits_into_glass = [(large, small), (small, large)].iter().any(|(a, b)| emits(*a) && *b == Made::SolidGlass);
            // Between two half sheets a tenth is lost at so few photons, where they face opposite ways.
            let bound = if large == small && large == Made::HalfAlpha { 0.15 } else { f64::max(0.06, 6.0 * error) };
            if !emits_into_glass && (mean - 1.0).abs() > bound {
                complaints.push(format!("from {from}: {large:?} and {small:?}, facing {way}: {mean} +- {error}"));
            }
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

/// And each shows what it does where they are a millimetre apart: under a sky, and before a lamp aside.
#[test]
#[ignore = "long: four pictures of 162 pairs"]
fn surfaces_in_one_plane_show_what_they_do_a_millimetre_apart() {
    let Some(gpu) = device() else { return };
    let mut complaints = Vec::new();
    for is_before_a_lamp in [false, true] {
        let [touching, apart] = [0.0, 1e-3].map(|lift| {
            let mut scene = table(&MADE, lift, [0.3, 0.8]);
            if is_before_a_lamp {
                let (towards, along) = (DVec3::new(-1.0, -1.0, 0.0), DVec3::new(-7.0, 7.0, 0.0));
                let lamp = Mesh::parallelogram("lamp", towards * -12.0, DVec3::Z * 10.0, along, scene.materials.len());
                scene.materials.push(Material { emission: Vec3::splat(15.0), two_sided: true, ..matt(0.0) });
                scene.meshes.push(lamp);
                scene.lights.clear();
            }
            seen_of_table(&gpu, &scene, MADE.len(), 1.0)
        });
        assert!(touching.iter().filter(|(mean, _)| *mean > 0.2).count() > touching.len() / 2, "{touching:?}");
        for (place, ((one, error), (other, other_error))) in touching.iter().zip(&apart).enumerate() {
            if (one - other).abs() > f64::max(0.05, 5.0 * error.hypot(*other_error)) {
                let pair = pair(&MADE, place);
                complaints.push(format!("{is_before_a_lamp}: {pair:?}: {one} +- {error} touching, {other} +- {other_error} apart"));
            }
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

/// Two solids of which one lies flush in the other, below a third that lies on both: whatever the order of their meshes, all is 1 in a
/// closed room whose walls glow.
#[test]
fn solids_that_meet_in_one_plane_keep_the_light_of_a_furnace() {
    let Some(gpu) = device() else { return };
    let block = |material: usize, low: [f64; 3], high: [f64; 3]| cuboid("block", low.into(), high.into(), material);
    let large = block(1, [0.05, 0.03, 0.05], [0.65, 0.2, 0.65]);
    let flush = block(2, [0.2, 0.06, 0.2], [0.45, 0.2, 0.45]);
    let above = block(3, [0.05, 0.2, 0.05], [0.65, 0.25, 0.65]);
    let camera = Camera::looking_at("eye", DVec3::new(0.9, 0.85, 0.9), DVec3::new(0.3, 0.15, 0.3), DVec3::Y, 0.7);
    for meshes in [[&large, &above, &flush], [&above, &flush, &large]] {
        let mut scene = furnace_with(meshes.map(Clone::clone).to_vec(), [1.33, 1.6, 1.47].map(clear_solid).to_vec());
        scene.materials[0] = Material { emission: Vec3::splat(0.1), ..matt(0.9) };
        let result = seen(&gpu, &scene, &SceneSettings { samples: 4, rounds: 16, bounces: 256, ..brief() }, &camera, [8, 8]);
        println!("three blocks: {}", mean_red(&result));
        assert!((mean_red(&result) - 1.0).abs() < 0.03, "{}", mean_red(&result));
    }
}

/// Light that gets through layers of these indices, outside air, straight down, however often it is reflected between them.
fn through_layers(indices: &[f64]) -> f64 {
    let around = |k: usize| if k == 0 || k > indices.len() { 1.0 } else { indices[k - 1] };
    let reflectance = |k: usize| ((around(k) - around(k + 1)) / (around(k) + around(k + 1))).powi(2);
    // Adding one boundary after the other: what passes, and what is reflected from beyond.
    let add = |(passes, reflects): (f64, f64), k: usize| {
        let own = reflectance(k);
        let between = 1.0 - reflects * own;
        (passes * (1.0 - own) / between, own + (1.0 - own).powi(2) * reflects / between)
    };
    (1..=indices.len()).fold((1.0 - reflectance(0), reflectance(0)), add).0
}

/// Solids that touch have no air between: water on glass, glass on glass of one material and of another, and one that lies flush in another.
#[test]
fn light_goes_from_solid_to_solid_without_air_between() {
    let Some(gpu) = device() else { return };
    let slab = |name: &str, bottom: f64, top: f64, width: f64, material: usize| {
        let half = DVec3::new(0.5 * width, 0.0, 0.5 * width);
        cuboid(name, DVec3::Y * bottom - half, DVec3::Y * top + half, material)
    };
    let cases = [
        ("water on glass", vec![slab("glass", 0.0, 0.2, 4.0, 1), slab("water", 0.2, 0.5, 4.0, 2)], vec![1.5, 1.33]),
        ("water on wider glass", vec![slab("glass", 0.0, 0.2, 5.0, 1), slab("water", 0.2, 0.5, 4.0, 2)], vec![1.5, 1.33]),
        ("two of one glass", vec![slab("one", 0.0, 0.2, 4.0, 1), slab("two", 0.2, 0.5, 4.0, 1)], vec![1.5]),
        ("flush", vec![slab("glass", 0.0, 0.5, 5.0, 1), slab("water", 0.2, 0.5, 4.0, 2)], vec![1.5, 1.33, 1.5]),
    ];
    for (what, meshes, indices) in cases {
        let lamp = level(-1.0, [3.0; 2], true, 0);
        let materials = vec![emissive(0.0), clear_solid(1.5), clear_solid(1.33)];
        let scene = scene_of([vec![lamp], meshes].concat(), materials, vec![]);
        let settings = without_maps(SceneSettings { rounds: 8, samples: 4, ..by_rounds() });
        let found = radiances(&gpu, &scene, &settings, DVec3::new(0.01, 3.0, 0.02), DVec3::new(0.01, 0.0, 0.02), 8);
        let (mean, error) = mean_and_error(&found);
        let expected = through_layers(&indices);
        assert!(error < 0.01, "{what}: {error}");
        assert_holds(what, z_check(what, mean, expected, error.max(1e-3)));
    }
}
