//! Shadow rays choose lights by what these do at the place that asks.

use crate::common::prelude::*;
use crate::unknown::room_without_floor;
use glam::dvec3;
use photonmill::engine::scene::{self, RunResult, Target};

/// A closed room of 4 x 4 x 3 m around a place, whose lamp is a material of its own.
fn room(at: DVec3, lamp: usize) -> Vec<Mesh> {
    let mut meshes = room_without_floor(0.0);
    meshes.extend([level(0.0, [4.0, 4.0], true, 0), level(2.9, [1.0, 1.0], false, lamp)]);
    meshes.iter_mut().flat_map(|mesh| &mut mesh.positions).for_each(|position| *position += at);
    meshes
}

/// A room whose lamp has 1 W/m2/sr, and where asked one behind its right wall that has `ratio` times as much.
fn rooms(ratio: Option<f32>) -> Scene {
    let lamp = |radiance: f32| Material { emission: Vec3::splat(radiance), ..matt(0.0) };
    let mut scene = scene_of(room(DVec3::ZERO, 1), vec![matt(0.5), lamp(1.0)], vec![]);
    if let Some(ratio) = ratio {
        scene.meshes.extend(room(6.0 * DVec3::X, 2));
        scene.materials.push(lamp(ratio));
    }
    scene
}

/// Points on floor and walls of the first room, up to a hand's breadth from its edges.
fn points() -> Vec<(DVec3, DVec3)> {
    let places = [-1.9, -1.0, 0.1, 1.2, 1.9];
    let floor = places.iter().flat_map(|x| places.map(|z| (dvec3(*x, 0.0, z), DVec3::Y)));
    let right = places.iter().flat_map(|y| places.map(|z| (dvec3(2.0, 1.4 + 0.7 * y, z), DVec3::NEG_X)));
    let back = places.iter().flat_map(|x| [0.2, 1.6].map(|y| (dvec3(*x, y, -2.0), DVec3::Z)));
    floor.chain(right).chain(back).collect()
}

/// Points of the dim room, then the same of the bright one.
fn both() -> Vec<(DVec3, DVec3)> {
    let there = points().into_iter().map(|(at, normal)| (at + 6.0 * DVec3::X, normal));
    points().into_iter().chain(there).collect()
}

fn lit(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, points: &[(DVec3, DVec3)]) -> RunResult {
    scene::render(gpu, scene, settings, Target::Points(points)).unwrap()
}

#[test]
fn explore() {
    let Some(gpu) = device() else { return };
    let n = points().len();
    for part in [Part::Direct, Part::All] {
        let rounds = if part == Part::All { 16 } else { 256 };
        let settings = SceneSettings { rounds, part, ..SceneSettings::default() };
        let began = std::time::Instant::now();
        let alone = lit(&gpu, &rooms(None), &settings, &points());
        println!("alone {:?} trial {:?}", began.elapsed(), alone.plan.trial.as_ref().map(|t| t.seconds));
        for ratio in [1.0, 1e2, 1e3, 1e6] {
            let began = std::time::Instant::now();
            let two = lit(&gpu, &rooms(Some(ratio)), &settings, &both());
            println!(
                "  {:?} trial {:?}; {:?}",
                began.elapsed(),
                two.plan.trial.as_ref().map(|t| t.seconds),
                two.plan.decisions[0].evidence
            );
            let sum = |lit: &RunResult, of: &dyn Fn(&RunResult, usize) -> f64| (0..n).map(|k| of(lit, k)).sum::<f64>();
            let var = |lit: &RunResult, k: usize| (red(lit, k).1 / red(&alone, k).0).powi(2);
            let black = (0..n).filter(|k| red(&two, *k).0 == 0.0).count();
            let z: Vec<f64> =
                (0..n).map(|k| (red(&two, k).0 - red(&alone, k).0) / (red(&two, k).1.powi(2) + red(&alone, k).1.powi(2)).sqrt()).collect();
            let worst = z.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            println!(
                "{part:?} 1:{ratio}: variance ratio {:.3}, black {black}, mean {:.5} vs {:.5}, worst z {worst:.2}, rel err {:.4}",
                sum(&two, &var) / sum(&alone, &var),
                sum(&two, &|l, k| red(l, k).0),
                sum(&alone, &|l, k| red(l, k).0),
                (sum(&alone, &var) / n as f64).sqrt()
            );
        }
    }
}
