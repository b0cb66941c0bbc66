//! Hard cases as strangers' scenes hold them, each a few lines: too near, too far, too thin, too bright, too dim, too many,
//! touching, overlapping, nested, degenerate, extreme options. Each has a closed form, a symmetry or an invariance, and runs
//! with everything at its default but the number of photons, and kernels that all share. Judged is (found - true) / stated.
//!
//! A case that is known to be wrong says why, and has to be wrong: what mends it takes the mark away.
//!
//! The short run leaves out cases that need kernels of their own or take seconds ([`long`]).

use std::fmt::Write;

use crate::common::known::kept;
use crate::common::prelude::*;
use crate::common::rectangles::{self, Rectangle};
use crate::common::rendered::{around_hole, sides};
use crate::common::sources::read;
use glam::dvec3;
use photonmill::engine::scene::{Receivers, RunResult};
use photonmill::settings::stop::LEAST_BLOCKS;

struct Case {
    family: &'static str,
    name: &'static str,
    setup: fn() -> Setup,
}

/// A scene, and what is right at points or at every pixel.
struct Setup {
    scene: Scene,
    asked: Asked,
    settings: SceneSettings,
    /// The largest stated error over what is right; infinite where the answer may be that nothing is known.
    sure: f64,
    /// Of the long run alone.
    is_long: bool,
}

enum Asked {
    /// Position, normal, irradiance of each channel.
    Points(Vec<(DVec3, DVec3, f64)>),
    /// Radiance at every pixel.
    Picture(Camera, [u32; 2], f64),
}

const UP: DVec3 = DVec3::Y;
const DOWN: DVec3 = DVec3::NEG_Y;
const SKY: LightKind = LightKind::Environment { radiance: Vec3::ONE };

fn usual() -> SceneSettings {
    kept(SceneSettings { photons: 1 << 13, ..by_rounds() })
}

fn points(scene: Scene, asked: Vec<(DVec3, DVec3, f64)>) -> Setup {
    Setup { scene, asked: Asked::Points(asked), settings: usual(), sure: 0.3, is_long: false }
}

/// The same where it may be that no light is found.
fn perhaps(setup: Setup) -> Setup {
    Setup { sure: f64::INFINITY, ..setup }
}

/// What costs seconds, and others of its family or another test show the like.
fn long(setup: Setup) -> Setup {
    Setup { is_long: true, ..setup }
}

fn with(settings: SceneSettings, setup: Setup) -> Setup {
    Setup { settings, ..setup }
}

/// Radiance `radiance` in a cavity of such walls, whatever their shapes, as each wall emits what it does not scatter.
fn grey(albedo: f32, radiance: f32) -> Material {
    Material { emission: Vec3::splat(radiance * (1.0 - albedo)), ..matt(albedo) }
}

fn room(corner: DVec3, size: f64, material: usize) -> Vec<Mesh> {
    sides(corner, DVec3::splat(size), true, [material; 6])
}

fn block(corner: DVec3, size: DVec3, material: usize) -> Vec<Mesh> {
    sides(corner, size, false, [material; 6])
}

/// A black rectangle that emits.
fn plate(origin: DVec3, u: DVec3, v: DVec3, radiance: f64) -> Rectangle {
    Rectangle { origin, u, v, albedo: DVec3::ZERO, emission: DVec3::splat(radiance), blocks: true }
}

/// Black rectangles, with the irradiance of points straight from those that emit.
fn plates(rectangles: &[Rectangle], asked: &[(DVec3, DVec3)]) -> Setup {
    let exact = |(at, normal): &(DVec3, DVec3)| (*at, *normal, rectangles::direct(rectangles, *at, *normal).x);
    let material = |of: &Rectangle| Material { emission: of.emission.as_vec3(), ..Material::lambert("plate", of.albedo.as_vec3()) };
    let mesh = |(k, of): (usize, &Rectangle)| Mesh::parallelogram("plate", of.origin, of.u, of.v, k);
    let scene = scene_of(rectangles.iter().enumerate().map(mesh).collect(), rectangles.iter().map(material).collect(), vec![]);
    points(scene, asked.iter().map(exact).collect())
}

/// A level lamp that faces down, with its middle here.
fn level_lamp(middle: DVec3, width: f64, depth: f64, radiance: f64) -> Rectangle {
    plate(middle - 0.5 * dvec3(width, 0.0, depth), DVec3::X * width, DVec3::Z * depth, radiance)
}

/// A black floor of this width around the origin.
fn floor(width: f64) -> Rectangle {
    plate(-0.5 * dvec3(width, 0.0, width), DVec3::Z * width, DVec3::X * width, 0.0)
}

/// A square floor with a light that is no mesh.
fn over_floor(width: f64, albedo: f32, light: LightKind, asked: Vec<(DVec3, DVec3, f64)>) -> Setup {
    points(scene_of(vec![level(0.0, [width; 2], true, 0)], vec![matt(albedo)], vec![light]), asked)
}

/// The floor's irradiance under a point light of 1 W/sr.
fn under_point(height: f64, distance: f64) -> f64 {
    height / (height * height + distance * distance).powf(1.5)
}

/// A cavity of radiance 1 and albedo 1/2.
fn furnace_with(meshes: Vec<Mesh>, asked: &[(DVec3, DVec3)]) -> Setup {
    let meshes = [room(DVec3::ZERO, 1.0, 0), meshes].concat();
    points(scene_of(meshes, vec![grey(0.5, 1.0)], vec![]), asked.iter().map(|(at, normal)| (*at, *normal, PI)).collect())
}

/// A cube of 1 m in which all points inside see this radiance wherever they look.
fn even(meshes: Vec<Mesh>, materials: Vec<Material>, radiance: f64) -> Setup {
    points(scene_of(meshes, materials, vec![]), INSIDE.map(|(at, normal)| (at, normal, PI * radiance)).into())
}

/// A cavity that emits with radiance 1 and scatters this share, at points inside, where light has met its walls so many times.
fn after_bounces(albedo: f32, bounces: u32) -> Setup {
    let radiance = (0..bounces).map(|bounce| f64::from(albedo).powi(bounce as i32)).sum();
    let setup = even(room(DVec3::ZERO, 1.0, 0), vec![emissive(albedo)], radiance);
    let settings = SceneSettings { bounces, illumination: Illumination::Photons, radius: Some(0.3), alpha: 1.0, ..usual() };
    Setup { sure: 0.05, ..with(settings, setup) }
}

const INSIDE: [(DVec3, DVec3); 3] = [(dvec3(0.31, 0.0, 0.42), UP), (dvec3(0.0, 0.37, 0.83), DVec3::X), (dvec3(0.77, 1.0, 0.21), DOWN)];

#[rustfmt::skip]
const CASES: &[Case] = &[
    Case { family: "too near", name: "a lamp 1e-4 m above a floor", setup: || {
        perhaps(plates(&[floor(4.0), level_lamp(UP * 1e-4, 1.0, 1.0, 1.0)], &[(DVec3::ZERO, UP), (dvec3(0.3, 0.0, -0.4), UP), (dvec3(0.5001, 0.0, 0.0), UP), (dvec3(0.6, 0.0, 0.0), UP)]))
    } },
    Case { family: "too near", name: "a point light 1 mm above a floor", setup: || {
        over_floor(4.0, 0.0, point(UP * 1e-3), [0.0, 1e-3, 1e-2, 1.0].map(|x| (DVec3::X * x, UP, under_point(1e-3, x))).into())
    } },
    Case { family: "too near", name: "a point light 0.1 mm above a floor", setup: || {
        perhaps(over_floor(4.0, 0.0, point(UP * 1e-4), [0.0, 1e-4, 1e-2, 1.0].map(|x| (DVec3::X * x, UP, under_point(1e-4, x))).into()))
    } },
    Case { family: "too near", name: "points in corners, on edges and 1e-6 m off them", setup: || {
        let near = [0.0, 1e-6, 1e-3].iter().flat_map(|d| [(dvec3(*d, 0.0, *d), UP), (dvec3(*d, 0.0, 0.4), UP), (dvec3(0.0, *d, *d), DVec3::X)]);
        furnace_with(vec![], &near.collect::<Vec<_>>())
    } },
    Case { family: "too near", name: "points 1e-6 and 1e-4 m above the surface that they are of", setup: || {
        furnace_with(vec![], &[1e-6, 1e-4].map(|d| (dvec3(0.3, d, 0.4), UP)))
    } },
    Case { family: "too near", name: "two lamps face to face 1e-3 m apart", setup: || {
        let lamp = level_lamp(UP * 1e-3, 1.0, 1.0, 1.0);
        let other = Rectangle { origin: lamp.origin - UP * 1e-3, u: lamp.v, v: lamp.u, ..lamp };
        long(plates(&[lamp, other], &[(dvec3(0.1, 0.0, 0.2), UP), (dvec3(0.1, 1e-3, 0.2), DOWN), (dvec3(0.6, 5e-4, 0.1), DVec3::NEG_X)]))
    } },
    Case { family: "too near", name: "indirect light at the foot of a block on an uncut floor", setup: || {
        let feet = [1e-4, 1e-3, 4e-3, 2e-2].map(|d| (dvec3(0.3 - d, 0.0, 0.5), UP, FRAC_PI_2));
        let setup = furnace_with(block(dvec3(0.3, 0.0, 0.3), DVec3::splat(0.4), 0), &[]);
        long(with(SceneSettings { part: Part::Indirect, ..usual() }, Setup { asked: Asked::Points(feet.into()), ..setup }))
    } },
    Case { family: "too near", name: "the dark foot of a wall without thickness", setup: || {
        let mut meshes = room(DVec3::ZERO, 1.0, 0);
        meshes.push(Mesh::parallelogram("wall", dvec3(0.5, 0.0, 0.0), DVec3::Y, DVec3::Z, 1));
        meshes.push(Mesh::parallelogram("lamp", dvec3(0.65, 0.99, 0.4), DVec3::X * 0.2, DVec3::Z * 0.2, 2));
        let scene = scene_of(meshes, vec![matt(0.5), Material { two_sided: true, ..matt(0.5) }, emissive(0.0)], vec![]);
        perhaps(points(scene, [1e-4, 1e-3, 1e-2].map(|d| (dvec3(0.5 - d, 0.0, 0.5), UP, 0.0)).into()))
    } },
    Case { family: "too near", name: "the dark floor behind walls of 1 mm, 1 cm, leaning, of 3200 triangles", setup: || {
        let (y, z) = (DVec3::Y, DVec3::Z);
        let upright = |x: f64| Mesh::parallelogram("wall", DVec3::X * x, z, y, 1);
        // From x = 1/2 at the floor to x = 0.4 or 0.6 at the ceiling.
        let leaning = |lean: f64| Mesh::parallelogram("wall", DVec3::X * 0.5, z, dvec3(lean, 1.0, 0.0), 1);
        let fine = Mesh { material: 1, ..tessellated("wall", DVec3::X * 0.5, z, y, 40) };
        let from_below_the_floor = Mesh::parallelogram("wall", dvec3(0.5, -0.3, 0.0), z, 1.3 * y, 1);
        let walls = [vec![upright(0.499), upright(0.5)], vec![upright(0.49), upright(0.5)], vec![leaning(0.1)], vec![leaning(-0.1)], vec![fine], vec![from_below_the_floor]];
        let lamp = Mesh::parallelogram("lamp", dvec3(0.1, 0.9, 0.3), DVec3::X * 0.2, DVec3::Z * 0.2, 2);
        let (mut meshes, mut asked) = (Vec::new(), Vec::new());
        for (k, walls) in walls.into_iter().enumerate() {
            let way = DVec3::X * 2.0 * k as f64;
            meshes.extend(moved(scene_of([room(DVec3::ZERO, 1.0, 0), walls, vec![lamp.clone()]].concat(), vec![], vec![]), |at| at + way).meshes);
            asked.extend([1e-5, 1e-4, 1e-3, 1e-2, 0.05].iter().flat_map(|behind| [0.01, 0.3, 0.6, 0.999].map(|z| (way + dvec3(0.5 + behind, 0.0, z), UP, 0.0))));
        }
        perhaps(points(scene_of(meshes, vec![matt(0.7), Material { two_sided: true, ..matt(0.7) }, emissive(0.5)], vec![]), asked))
    } },
    Case { family: "too far", name: "a lamp of 1 km at 100 km", setup: || {
        plates(&[floor(2.0), level_lamp(UP * 1e5, 1e3, 1e3, 1.0)], &[(DVec3::ZERO, UP), (DVec3::X * 0.9, UP)])
    } },
    Case { family: "too far", name: "a floor lamp of 1 m under a ceiling 10 km up", setup: || {
        let lamp = floor(1.0);
        plates(&[Rectangle { emission: DVec3::ONE, ..lamp }, level_lamp(UP * 1e4, 1e4, 1e4, 0.0)], &[(UP * 1e4, DOWN), (dvec3(3e3, 1e4, 0.0), DOWN)])
    } },
    Case { family: "too far", name: "a block of 1 m on a ground of 1000 km under a sky", setup: || {
        let meshes = [block(dvec3(-0.5, 0.0, -0.5), DVec3::ONE, 0), vec![level(0.0, [1e6; 2], true, 0)]].concat();
        let asked = vec![(dvec3(0.1, 1.0, 0.2), UP, PI), (dvec3(0.5, 0.6, 0.1), DVec3::X, FRAC_PI_2), (dvec3(3e5, 0.0, 1e5), UP, PI)];
        points(scene_of(meshes, vec![matt(0.0)], vec![SKY]), asked)
    } },
    Case { family: "too far", name: "a block of 2 cm in a cavity of 1 km", setup: || {
        let corner = dvec3(500.0, 300.0, 700.0);
        let meshes = [room(DVec3::ZERO, 1e3, 0), block(corner, DVec3::splat(0.02), 0)].concat();
        let asked = vec![(dvec3(200.0, 0.0, 100.0), UP, PI), (corner + dvec3(0.0, 0.01, 0.01), DVec3::NEG_X, PI), (corner + dvec3(0.01, 0.02, 0.01), UP, PI)];
        perhaps(points(scene_of(meshes, vec![grey(0.5, 1.0)], vec![]), asked))
    } },
    Case { family: "too thin", name: "a slit of 1 mm under the sky", setup: || {
        let mut meshes = sides(DVec3::ZERO, DVec3::ONE, true, [0; 6]);
        let ceiling = |x: f64, width: f64| Mesh::parallelogram("half", dvec3(x, 1.0, 0.0), DVec3::X * width, DVec3::Z, 0);
        meshes.splice(1..2, [ceiling(0.0, 0.4995), ceiling(0.5005, 0.4995)]);
        let slit = [plate(dvec3(0.4995, 1.0, 0.0), DVec3::X * 1e-3, DVec3::Z, 1.0)];
        let asked = [dvec3(0.5, 0.0, 0.5), dvec3(0.1, 0.0, 0.3)].map(|at| (at, UP, rectangles::direct(&slit, at, UP).x));
        perhaps(points(scene_of(meshes, vec![matt(0.0)], vec![SKY]), asked.into()))
    } },
    Case { family: "too thin", name: "a window of 2 cm under the sky", setup: || {
        let window = [plate(dvec3(0.49, 1.0, 0.49), DVec3::X * 0.02, DVec3::Z * 0.02, 1.0)];
        let mut meshes = room(DVec3::ZERO, 1.0, 0);
        meshes.splice(1..2, around_hole(DVec3::Y, DVec3::X, DVec3::Z, [0.49, 0.51].map(DVec2::splat), 0));
        let asked = [dvec3(0.5, 0.0, 0.5), dvec3(0.1, 0.0, 0.3)].map(|at| (at, UP, rectangles::direct(&window, at, UP).x));
        perhaps(points(scene_of(meshes, vec![matt(0.0)], vec![SKY]), asked.into()))
    } },
    Case { family: "too thin", name: "a corridor of 1 x 1 x 1000 m with a lamp at its end", setup: || {
        let mut corridor: Vec<Rectangle> = vec![plate(DVec3::ZERO, DVec3::Z * 1e3, DVec3::X, 0.0), plate(DVec3::ZERO, DVec3::Y, DVec3::Z * 1e3, 0.0)];
        corridor.push(plate(DVec3::ZERO, DVec3::X, DVec3::Y, 1.0));
        plates(&corridor, &[1.0, 30.0, 999.0].map(|z| (dvec3(0.4, 0.0, z), UP)))
    } },
    Case { family: "too thin", name: "a lamp of 1 m x 0.1 mm", setup: || {
        plates(&[floor(4.0), level_lamp(UP, 1.0, 1e-4, 1e3)], &[(DVec3::ZERO, UP), (dvec3(0.7, 0.0, 0.4), UP)])
    } },
    Case { family: "too thin", name: "a floor of 4000 strips", setup: || {
        let mut setup = furnace_with(vec![], &INSIDE);
        setup.scene.meshes.remove(0);
        let strip = |k: u32| Mesh::parallelogram("strip", DVec3::X * f64::from(k) / 4000.0, DVec3::Z, DVec3::X / 4000.0, 0);
        setup.scene.meshes.extend((0..4000).map(strip));
        setup
    } },
    Case { family: "too thin", name: "a floor of 2000 needles about one corner", setup: || {
        let mut setup = furnace_with(vec![], &INSIDE);
        let place = |k: u32| if k <= 1000 { dvec3(f64::from(k) / 1000.0, 0.0, 1.0) } else { dvec3(1.0, 0.0, f64::from(2000 - k) / 1000.0) };
        let positions = [vec![DVec3::ZERO], (0..=2000).map(place).collect()].concat();
        setup.scene.meshes[0] = Mesh { name: "fan".into(), positions, triangles: (1..=2000).map(|k| [0, k, k + 1]).collect(), ..Mesh::default() };
        long(setup)
    } },
    Case { family: "too bright or too dim", name: "a room of 1e-6 W/m2/sr beside one of 1", setup: || {
        let meshes = [room(DVec3::ZERO, 1.0, 0), room(DVec3::X * 2.0, 1.0, 1)].concat();
        let dim = DVec3::X * 2.0 + dvec3(0.3, 0.0, 0.4);
        points(scene_of(meshes, vec![grey(0.5, 1.0), grey(0.5, 1e-6)], vec![]), vec![(INSIDE[0].0, UP, PI), (dim, UP, PI * 1e-6)])
    } },
    Case { family: "too bright or too dim", name: "walls of albedo 0 to 1 that all look alike", setup: || {
        let materials = [0.0, 0.2, 0.5, 0.9, 0.99, 1.0].map(|albedo| grey(albedo, 1.0));
        long(even(sides(DVec3::ZERO, DVec3::ONE, true, [0, 1, 2, 3, 4, 5]), materials.into(), 1.0))
    } },
    Case { family: "too bright or too dim", name: "walls of another albedo for each channel", setup: || {
        let albedo = Vec3::new(0.9, 0.1, 0.5);
        let wall = Material { emission: Vec3::ONE - albedo, ..Material::lambert("wall", albedo) };
        let settings = SceneSettings { radius: Some(0.5), alpha: 1.0, ..usual() };
        Setup { sure: 0.1, ..with(settings, even(room(DVec3::ZERO, 1.0, 0), vec![wall], 1.0)) }
    } },
    Case { family: "too bright or too dim", name: "walls of albedo 0.99", setup: || {
        let scene = scene_of(room(DVec3::ZERO, 1.0, 0), vec![matt(0.99)], vec![point(DVec3::splat(0.5))]);
        // 4 pi W over what 6 m2 absorb; how uneven the first bounces are is less than a hundredth of it.
        let asked = INSIDE.map(|(at, normal)| (at, normal, 4.0 * PI / 6.0 / 0.01));
        long(with(SceneSettings { photons: 1 << 10, ..usual() }, points(scene, asked.into())))
    } },
    Case { family: "too bright or too dim", name: "radiance of 1e15", setup: || {
        even(room(DVec3::ZERO, 1.0, 0), vec![grey(0.5, 1e15)], 1e15)
    } },
    Case { family: "too bright or too dim", name: "radiance of 1e-15", setup: || {
        even(room(DVec3::ZERO, 1.0, 0), vec![grey(0.5, 1e-15)], 1e-15)
    } },
    Case { family: "too bright or too dim", name: "a lamp of 1e9 above the lid of a black box", setup: || {
        let mut meshes = [room(DVec3::ZERO, 1.0, 0), block(DVec3::splat(-0.01), DVec3::splat(1.02), 0)].concat();
        meshes.push(level(1.5, [1.0; 2], false, 1));
        perhaps(even(meshes, vec![matt(0.0), Material { emission: Vec3::splat(1e9), ..matt(0.0) }], 0.0))
    } },
    Case { family: "too bright or too dim", name: "200 lamps over four decades that one floor sees", setup: || {
        let lamp = |k: u32| level_lamp(dvec3(f64::from(k % 20) * 0.1 - 0.95, 1.0, f64::from(k / 20) * 0.2 - 0.9), 0.05, 0.1, 10f64.powf(-f64::from(k) / 50.0));
        let lamps: Vec<Rectangle> = (0..200).map(lamp).chain([floor(2.0)]).collect();
        long(plates(&lamps, &[(dvec3(-0.9, 0.0, -0.9), UP), (DVec3::ZERO, UP), (dvec3(0.9, 0.0, 0.9), UP)]))
    } },
    Case { family: "too many", name: "a ceiling of 10 000 lamps", setup: || {
        let mut setup = furnace_with(vec![], &INSIDE[..2]);
        setup.scene.meshes.remove(1);
        let tile = |k: u32| Mesh::parallelogram("tile", dvec3(f64::from(k % 100), 100.0, f64::from(k / 100)) / 100.0, DVec3::X / 100.0, DVec3::Z / 100.0, 0);
        setup.scene.meshes.extend((0..10_000).map(tile));
        long(setup)
    } },
    Case { family: "too many", name: "one lamp of 5000 triangles beside the same lamp of two", setup: || {
        let [left, right] = [-1.0, 1.0].map(|x| level_lamp(dvec3(x, 1.0, 0.0), 1.0, 1.0, 1.0));
        let mut setup = plates(&[floor(4.0), left, right], &[(dvec3(-1.0, 0.0, 0.1), UP), (dvec3(1.0, 0.0, 0.1), UP)]);
        setup.scene.meshes[1] = Mesh { material: 1, ..tessellated("many", left.origin, left.u, left.v, 50) };
        setup
    } },
    Case { family: "too many", name: "1000 small blocks that float in a cavity", setup: || {
        let at = |k: u32| DVec3::from_array([k % 10, k / 10 % 10, k / 100].map(|i| 0.05 + 0.1 * f64::from(i)));
        furnace_with((0..1000).flat_map(|k| block(at(k), DVec3::splat(0.02), 0)).collect(), &INSIDE)
    } },
    Case { family: "touching or overlapping", name: "a lamp behind a lamp", setup: || {
        plates(&[floor(4.0), level_lamp(UP, 1.0, 1.0, 1.0), level_lamp(UP * 1.001, 1.0, 1.0, 100.0)], &[(DVec3::ZERO, UP), (dvec3(0.4, 0.0, 0.3), UP)])
    } },
    Case { family: "touching or overlapping", name: "a lamp half of which is inside a wall", setup: || {
        let wall = plate(dvec3(0.0, 0.0, -1.0), DVec3::Y * 2.0, DVec3::Z * 2.0, 0.0);
        plates(&[plate(dvec3(0.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X * 2.0, 0.0), wall, level_lamp(UP, 1.0, 1.0, 1.0)], &[(dvec3(0.3, 0.0, 0.0), UP), (dvec3(1.0, 0.0, 0.5), UP), (dvec3(0.0, 0.3, 0.1), DVec3::X)])
    } },
    Case { family: "touching or overlapping", name: "a block sunk into the floor", setup: || {
        furnace_with(block(dvec3(0.3, -0.2, 0.3), DVec3::splat(0.4), 0), &[(dvec3(0.5, 0.2, 0.4), UP), (dvec3(0.3, 0.1, 0.5), DVec3::NEG_X), (dvec3(0.05, 0.0, 0.05), UP)])
    } },
    Case { family: "touching or overlapping", name: "blocks that touch by a side, an edge and a corner", setup: || {
        let size = DVec3::splat(0.2);
        let blocks = [DVec3::ZERO, dvec3(0.2, 0.0, 0.0), dvec3(0.4, 0.2, 0.0), dvec3(0.6, 0.4, 0.2)].map(|at| block(at + dvec3(0.1, 0.2, 0.3), size, 0));
        furnace_with(blocks.concat(), &[(dvec3(0.2, 0.4, 0.4), UP), (dvec3(0.6, 0.6, 0.4), UP), (dvec3(0.8, 0.8, 0.6), UP)])
    } },
    Case { family: "touching or overlapping", name: "a lamp that lies on the floor", setup: || {
        let up = plate(dvec3(-0.5, 0.0, -0.5), DVec3::Z, DVec3::X, 1.0);
        long(plates(&[floor(4.0), up, level_lamp(UP, 4.0, 4.0, 0.0)], &[(UP, DOWN), (dvec3(1.2, 1.0, 0.3), DOWN), (dvec3(0.6, 0.0, 0.0), UP), (dvec3(0.5 + 1e-6, 0.0, 0.0), UP)]))
    } },
    Case { family: "nested", name: "a room within a room within a room, each ten times as bright", setup: || {
        let (corner, inner) = (DVec3::splat(0.3), DVec3::splat(0.45));
        let meshes = [room(DVec3::ZERO, 1.0, 0), block(corner, DVec3::splat(0.4), 0), room(corner + 0.01, 0.38, 1), block(inner, DVec3::splat(0.1), 1), room(inner + 0.01, 0.08, 2)];
        let asked = vec![(INSIDE[0].0, UP, PI), (corner + dvec3(0.1, 0.01, 0.08), UP, 10.0 * PI), (inner + dvec3(0.03, 0.01, 0.06), UP, 100.0 * PI)];
        points(scene_of(meshes.concat(), vec![grey(0.5, 1.0), grey(0.5, 10.0), grey(0.5, 100.0)], vec![]), asked)
    } },
    Case { family: "nested", name: "a room turned inside out", setup: || {
        perhaps(even(block(DVec3::ZERO, DVec3::ONE, 0), vec![grey(0.5, 1.0)], 0.0))
    } },
    Case { family: "nested", name: "a sheet lit and emitting on both sides in a cavity", setup: || {
        let mut setup = furnace_with(vec![Mesh::parallelogram("sheet", dvec3(0.2, 0.5, 0.2), DVec3::X * 0.6, DVec3::Z * 0.6, 1)], &[(dvec3(0.4, 0.5, 0.5), UP), (dvec3(0.4, 0.5, 0.5), DOWN), (dvec3(0.4, 0.0, 0.5), UP)]);
        setup.scene.materials.push(Material { two_sided: true, ..grey(0.8, 1.0) });
        long(setup)
    } },
    Case { family: "degenerate", name: "a single emissive triangle", setup: || {
        let corners = [dvec3(0.0, 1.0, 0.0), dvec3(1.0, 1.0, 0.0), dvec3(0.0, 1.0, 1.0)];
        points(scene_of(vec![triangle(corners)], vec![emissive(0.0)], vec![]), vec![(DVec3::ZERO, UP, triangle_irradiance(corners))])
    } },
    Case { family: "degenerate", name: "a single triangle under a point light", setup: || {
        let floor = triangle([DVec3::ZERO, DVec3::Z, DVec3::X]);
        long(points(scene_of(vec![floor], vec![matt(0.9)], vec![point(UP)]), vec![(dvec3(0.2, 0.0, 0.3), UP, under_point(1.0, 0.2f64.hypot(0.3))), (DVec3::ZERO, UP, 1.0)]))
    } },
    Case { family: "degenerate", name: "points that face away from all light, and that lie in its plane", setup: || {
        perhaps(plates(&[floor(4.0), level_lamp(UP, 1.0, 1.0, 1.0)], &[(DVec3::ZERO, DOWN), (dvec3(0.0, 1.5, 0.0), UP), (dvec3(0.8, 1.0, 0.0), DOWN), (UP * 0.5, DVec3::X)]))
    } },
    Case { family: "degenerate", name: "the sun straight along a wall", setup: || {
        let meshes = vec![level(0.0, [4.0; 2], true, 0), Mesh::parallelogram("wall", dvec3(-1.0, 0.0, -2.0), DVec3::Y, DVec3::Z * 4.0, 0)];
        let asked = vec![(dvec3(0.5, 0.0, 0.3), UP, 1.0), (dvec3(-1.0 + 1e-5, 0.0, 0.3), UP, 1.0), (dvec3(-1.0, 0.5, 0.3), DVec3::X, 0.0)];
        perhaps(points(scene_of(meshes, vec![matt(0.0)], vec![sun(DOWN)]), asked))
    } },
    Case { family: "degenerate", name: "the sun a thousandth of a degree above the horizon", setup: || {
        let angle = 1e-3f64.to_radians();
        long(over_floor(4.0, 0.5, sun(dvec3(angle.cos(), -angle.sin(), 0.0)), vec![(DVec3::ZERO, UP, angle.sin()), (dvec3(1.9, 0.0, 1.9), UP, angle.sin())]))
    } },
    Case { family: "degenerate", name: "a point light in the plane of a wall", setup: || {
        let wall = Mesh::parallelogram("wall", dvec3(0.0, 0.0, -2.0), DVec3::Y * 2.0, DVec3::Z * 4.0, 0);
        let facing = Mesh::parallelogram("facing", dvec3(1.0, 0.0, -2.0), DVec3::Z * 4.0, DVec3::Y * 2.0, 0);
        let scene = scene_of(vec![wall, facing], vec![matt(0.0)], vec![point(dvec3(0.0, 3.0, 0.0))]);
        let exact = 1.0 / (1.0f64 + 1.5 * 1.5).powf(1.5);
        perhaps(points(scene, vec![(dvec3(0.0, 1.0, 0.5), DVec3::X, 0.0), (dvec3(1.0, 1.5, 0.0), DVec3::NEG_X, exact)]))
    } },
    Case { family: "degenerate", name: "a sky above and below a single floor", setup: || {
        long(over_floor(2.0, 0.5, SKY, vec![(DVec3::ZERO, UP, PI), (DVec3::ZERO, DOWN, PI)]))
    } },
    Case { family: "degenerate", name: "points in mid-air", setup: || {
        furnace_with(vec![], &[UP, DOWN, DVec3::X].map(|normal| (dvec3(0.4, 0.6, 0.3), normal)))
    } },
    Case { family: "degenerate", name: "a cavity squeezed to 10 m x 10 cm x 1 m and mirrored", setup: || {
        let mut scene = moved(scene_of(room(DVec3::ZERO, 1.0, 0), vec![grey(0.5, 1.0)], vec![]), |at| at * dvec3(-10.0, 0.1, 1.0));
        scene.meshes.iter_mut().flat_map(|mesh| &mut mesh.triangles).for_each(|triangle| triangle.swap(1, 2));
        let asked = [(dvec3(-3.1, 0.0, 0.4), UP), (dvec3(-9.99, 0.1, 0.2), DOWN), (dvec3(-7.7, 0.04, 0.0), DVec3::Z), (dvec3(0.0, 0.02, 0.9), DVec3::NEG_X)];
        let setup = points(scene, asked.map(|(at, normal)| (at, normal, PI)).into());
        Setup { sure: 0.5, ..with(SceneSettings { photons: 20_000, ..usual() }, setup) }
    } },
    Case { family: "degenerate", name: "four furnaces whose floors look almost along -z", setup: || {
        let (mut meshes, mut asked) = (Vec::new(), Vec::new());
        // Away from the middle of the ceiling and on a wall: skewed directions would miss one and meet the other.
        let of_each = [(dvec3(0.2, 1.0, 0.3), DOWN), (dvec3(0.0, 0.2, 0.5), DVec3::X), (dvec3(0.5, 0.0, 0.5), UP)];
        for (k, e) in [1e-2, 1e-4, 1e-6, 0.0].into_iter().enumerate() {
            let turn = DQuat::from_rotation_arc(UP, dvec3(e, 0.0, -1.0).normalize());
            let place = |at: DVec3| turn * at + DVec3::X * 3.0 * k as f64;
            meshes.extend(moved(scene_of(room(DVec3::ZERO, 1.0, 0), vec![], vec![]), place).meshes);
            asked.extend(of_each.map(|(at, normal)| (place(at), turn * normal, PI)));
        }
        let settings = SceneSettings { photons: 1 << 15, illumination: Illumination::Photons, radius: Some(0.3), alpha: 1.0, ..usual() };
        Setup { sure: 0.04, ..with(settings, points(scene_of(meshes, vec![grey(0.5, 1.0)], vec![]), asked)) }
    } },
    Case { family: "extreme options", name: "a single bounce", setup: || long(after_bounces(1.0, 1)) },
    Case { family: "extreme options", name: "two bounces off grey walls", setup: || long(after_bounces(0.5, 2)) },
    Case { family: "extreme options", name: "seven bounces off white walls", setup: || long(after_bounces(1.0, 7)) },
    Case { family: "extreme options", name: "one photon a round", setup: || {
        let settings = SceneSettings { photons: 1, ..usual() };
        with(settings, perhaps(furnace_with(vec![], &INSIDE)))
    } },
    Case { family: "extreme options", name: "two rounds", setup: || {
        // One degree of freedom: an error of 15 times the stated one comes once in 24.
        with(SceneSettings { rounds: 2, photons: 1 << 16, ..usual() }, perhaps(furnace_with(vec![], &INSIDE)))
    } },
    Case { family: "extreme options", name: "200 rounds of 100 photons", setup: || {
        long(with(SceneSettings { rounds: 200, photons: 100, ..usual() }, furnace_with(vec![], &INSIDE)))
    } },
    Case { family: "extreme options", name: "the largest seed", setup: || {
        long(with(SceneSettings { seed: u64::MAX, ..usual() }, furnace_with(vec![], &INSIDE)))
    } },
    Case { family: "extreme options", name: "a picture of one pixel", setup: || long(picture(usual(), [1.0, 1.0], [1, 1])) },
    Case { family: "extreme options", name: "a picture of 4096 x 1 pixels", setup: || {
        long(picture(SceneSettings { rounds: 4, ..usual() }, [1e-3, 4096.0], [4096, 1]))
    } },
    Case { family: "extreme options", name: "1024 paths in each of four pixels", setup: || {
        long(picture(SceneSettings { samples: 1024, rounds: 4, ..usual() }, [1.0, 1.0], [2, 2]))
    } },
    Case { family: "extreme options", name: "a view of a millionth of a degree", setup: || long(picture(usual(), [1e-6f64.to_radians(), 1.0], [4, 4])) },
];

/// A furnace as an eye in its middle sees it.
fn picture(settings: SceneSettings, [view, aspect]: [f64; 2], size: [u32; 2]) -> Setup {
    let eye = Camera::looking_at("eye", DVec3::splat(0.5), dvec3(0.1, 0.3, 0.0), UP, view).with_aspect(aspect);
    Setup { asked: Asked::Picture(eye, size, 1.0), ..with(settings, furnace_with(vec![], &[])) }
}

fn triangle(corners: [DVec3; 3]) -> Mesh {
    Mesh { name: "triangle".into(), positions: corners.into(), triangles: vec![[0, 1, 2]], ..Mesh::default() }
}

/// Irradiance of the origin's horizontal surface from a triangle above it of radiance 1, by the sum over its edges.
fn triangle_irradiance(corners: [DVec3; 3]) -> f64 {
    let edge = |k: usize| {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        a.angle_between(b) * a.cross(b).normalize().y
    };
    (0..3).map(edge).sum::<f64>().abs() / 2.0
}

/// What a case comes to: what is right, found and stated, and how much may be unseen.
fn found(gpu: &Gpu, setup: &Setup) -> Vec<[f64; 4]> {
    match &setup.asked {
        Asked::Points(asked) => {
            let points: Vec<(DVec3, DVec3)> = asked.iter().map(|(at, normal, _)| (*at, *normal)).collect();
            let result = render(gpu, &setup.scene, &setup.settings, Receivers::Points(&points)).unwrap();
            let found = |k: usize| {
                [0, 1, 2].map(|channel| [asked[k].2, result.film.mean(k)[channel], error(&result, k)[channel], unseen(&result, k)])
            };
            (0..asked.len()).flat_map(found).collect()
        }
        Asked::Picture(camera, size, expected) => {
            let result = render(gpu, &setup.scene, &setup.settings, Receivers::Image(camera, *size)).unwrap();
            // Pixels share their photons: as if their errors were one.
            let errors = (0..result.film.pixels()).map(|pixel| error(&result, pixel).x);
            let unseen = (0..result.film.pixels()).map(|pixel| unseen(&result, pixel)).fold(0.0, f64::max);
            vec![[*expected, mean_red(&result), errors.sum::<f64>() / result.film.pixels() as f64, unseen]]
        }
    }
}

/// What is stated, or where too few rounds are asked for that, their spread.
fn error(result: &RunResult, place: usize) -> DVec3 {
    if result.film.blocks < LEAST_BLOCKS { result.film.standard_error(place) } else { result.film.stated_error(place) }
}

/// The bound of what nothing has met there, which is stated beside the error.
fn unseen(result: &RunResult, place: usize) -> f64 {
    result.film.unseen_bounds()(place)
}

/// Relative error of what is not random.
const ROUNDING: f64 = 2e-5;
/// Stated errors that a value may be off: with 15 degrees of freedom once in 6000.
const MOST: f64 = 5.0;

/// Complains of what is off by more than it says, of any light where there is none, and of what says nothing.
fn judge(values: &[[f64; 4]], sure: f64, rounds: u32) -> Check {
    for [expected, found, stated, unseen] in values {
        let error = stated.max(ROUNDING * expected.abs());
        // What errors of one degree of freedom leave is judged as widely.
        let most = if rounds > 2 { MOST } else { 100.0 };
        let is_off = (found - expected).abs() > most * error.hypot(*unseen) || (*expected == 0.0 && *found != 0.0);
        if is_off || found.is_nan() || error > sure * expected.abs() && sure.is_finite() {
            return Err(format!("{found:e} +- {stated:e} where {expected:e} is right"));
        }
    }
    Ok(())
}

/// Cases of a family in the short run.
fn hold(family: &str) {
    let Some(gpu) = device() else { return };
    hold_all(&gpu, |case, setup| case.family == family && !setup.is_long);
}

/// All of these cases. Prints the rows of the guide's table.
fn hold_all(gpu: &Gpu, is_asked: impl Fn(&Case, &Setup) -> bool) {
    let (mut faults, mut count) = (String::new(), 0);
    for (case, setup) in CASES.iter().map(|case| (case, (case.setup)())).filter(|(case, setup)| is_asked(case, setup)) {
        count += 1;
        let began = Instant::now();
        let values = found(gpu, &setup);
        let verdict = judge(&values, setup.sure, setup.settings.rounds);
        let off = |[expected, found, stated, _]: &[f64; 4]| match stated.is_infinite() {
            true => f64::INFINITY,
            false => ((found - expected) / stated.max(f64::MIN_POSITIVE)).abs(),
        };
        let [expected, found, stated, _] = values.iter().max_by(|a, b| off(a).total_cmp(&off(b))).unwrap().map(digits);
        println!("{} {expected} | {found} | {stated} |  {:.1} s", case.row(), began.elapsed().as_secs_f64());
        if let Err(complaint) = verdict {
            writeln!(faults, "{}: {complaint}", case.name).unwrap();
        }
    }
    assert!(count > 1 && faults.is_empty(), "{count} cases\n{faults}");
}

/// Four digits.
fn digits(value: f64) -> String {
    let plain = (1e-3..1e4).contains(&value.abs()) || value == 0.0 || value.is_infinite();
    if plain { format!("{}", (value * 1e4).round() / 1e4) } else { format!("{value:.3e}") }
}

impl Case {
    /// The first cells of its row in the guide.
    fn row(&self) -> String {
        format!("| {} | {} |", self.family, self.name)
    }
}

#[test]
fn what_is_too_near_is_right_within_what_is_stated() {
    hold("too near");
}

#[test]
fn what_is_too_far_is_right_within_what_is_stated() {
    hold("too far");
}

#[test]
fn what_is_too_thin_is_right_within_what_is_stated() {
    hold("too thin");
}

#[test]
fn what_is_too_bright_or_too_dim_is_right_within_what_is_stated() {
    hold("too bright or too dim");
}

#[test]
fn what_is_too_many_is_right_within_what_is_stated() {
    hold("too many");
}

#[test]
fn what_touches_or_overlaps_is_right_within_what_is_stated() {
    hold("touching or overlapping");
}

#[test]
fn what_is_nested_is_right_within_what_is_stated() {
    hold("nested");
}

#[test]
fn what_is_degenerate_is_right_within_what_is_stated() {
    hold("degenerate");
}

#[test]
fn extreme_options_are_right_within_what_is_stated() {
    hold("extreme options");
}

#[test]
#[ignore = "long: a minute on a software device"]
fn every_case_is_right_within_what_is_stated() {
    let Some(gpu) = device() else { return };
    hold_all(&gpu, |_, _| true);
}

/// Another lamp, an error that is too small, and an answer that says nothing.
#[test]
fn the_judgement_of_a_case_complains() {
    let right = [[1.0, 1.01, 0.01, 0.0], [0.0, 0.0, f64::INFINITY, 0.0]];
    assert_holds("right values", judge(&right, f64::INFINITY, 16));
    assert_complains("a tenth more light", judge(&right.map(|[a, b, c, d]| [a, 1.1 * b, c, d]), f64::INFINITY, 16));
    assert_complains("a tenth of the error", judge(&right.map(|[a, b, c, d]| [a, b, 0.1 * c, d]), f64::INFINITY, 16));
    assert_complains("light in the dark", judge(&[[0.0, 1e-9, 1e-9, 0.0]], f64::INFINITY, 16));
    assert_complains("no number", judge(&[[1.0, f64::NAN, 1.0, 0.0]], f64::INFINITY, 16));
    assert_complains("nothing said", judge(&right, 0.5, 16));
    let Some(gpu) = device() else { return };
    let case = CASES.iter().find(|case| case.name == "a lamp of 1 m x 0.1 mm").expect("there is such a case");
    let mut setup = (case.setup)();
    setup.scene.materials.iter_mut().for_each(|material| material.emission *= 1.2);
    assert_complains("a lamp a fifth too bright", judge(&found(&gpu, &setup), setup.sure, setup.settings.rounds));
}

/// The guide has the names of all cases, in their order.
#[test]
fn the_guides_page_has_the_second_set() {
    let check = |page: &str| -> Check {
        let is_row = |line: &&str| CASES.iter().any(|case| line.starts_with(&format!("| {} |", case.family)));
        let rows: Vec<&str> = page.lines().filter(is_row).collect();
        require(rows.len() == CASES.len(), || format!("{} rows for {} cases", rows.len(), CASES.len()))?;
        let wrong = rows.iter().zip(CASES).find(|(row, case)| !row.starts_with(&case.row()));
        wrong.map_or(Ok(()), |(row, case)| Err(format!("{row} where {} is the case", case.row())))
    };
    let page = read("src/guide/hard_cases.md");
    assert_holds("src/guide/hard_cases.md", check(&page));
    assert_complains("a row less", check(&page.replacen("| too far |", "| far |", 1)));
    assert_complains("another name", check(&page.replacen("| too far | a ", "| too far | ", 1)));
}
