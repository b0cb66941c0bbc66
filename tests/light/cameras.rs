//! Cameras: parallel rays and lenses, against closed forms and the path tracer.

use crate::common::gltf_file::square;
use crate::common::prelude::*;
use crate::tests::files::gltf::load;
use glam::dvec3;
use photonmill::scene::{Lens, Projection};
use serde_json::json;

/// Squares of half a metre that emit, two metres and eight metres before the eye, left and right of the middle.
fn near_and_far() -> Scene {
    let square = |x: f64, z: f64| Mesh::parallelogram("square", dvec3(x - 0.25, -0.25, z), DVec3::X * 0.5, DVec3::Y * 0.5, 0);
    scene_of(vec![square(-0.5, -2.0), square(0.5, -8.0)], vec![emissive(0.0)], vec![])
}

fn eye(projection: Projection, lens: Option<Lens>) -> Camera {
    Camera { projection, lens, ..Camera::looking_at("eye", DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.0) }
}

fn red_of(gpu: &Gpu, scene: &Scene, camera: &Camera, side: u32, rounds: u32) -> Vec<f64> {
    let settings = SceneSettings { rounds, photons: 1000, samples: 4, ..by_rounds() };
    means(&seen(gpu, scene, &settings, camera, [side, side])).iter().map(|mean| mean.x).collect()
}

/// Parallel rays show both squares in the same size: 0.25 m2 each of a picture of 4 m2.
#[test]
fn parallel_rays_show_no_distance() {
    let Some(gpu) = device() else { return };
    let picture = red_of(&gpu, &near_and_far(), &eye(Projection::Orthographic { half_height: 1.0 }, None), 32, 4);
    for (number, value) in picture.iter().enumerate() {
        let (x, y) = (f64::from(number as u32 % 32) / 16.0 - 1.0, 1.0 - f64::from(number as u32 / 32) / 16.0);
        let inside = |from: f64| x >= from && x < from + 0.5 && y <= 0.25 && y > -0.25;
        let expected = if inside(-0.75) || inside(0.25) { 1.0 } else { 0.0 };
        assert!((value - expected).abs() < 1e-6, "({x}, {y}): {value}, not {expected}");
    }
}

/// A square at a distance d seen through a lens of radius R in focus at f is spread over R |d - f| / f about its edges, and its light
/// on the picture remains.
#[test]
fn a_lens_spreads_what_is_not_in_focus() {
    let Some(gpu) = device() else { return };
    let scene = near_and_far();
    let projection = Projection::Perspective { vertical_view: 2.0 * 0.5f64.atan() };
    let sharp = red_of(&gpu, &scene, &eye(projection, None), 64, 32);
    let lens = Lens { radius: 0.1, focus: 8.0 };
    let blurred = red_of(&gpu, &scene, &eye(projection, Some(lens)), 64, 32);
    let half = |picture: &[f64], is_right: bool| {
        picture.iter().enumerate().filter(|(number, _)| (number % 64 >= 32) == is_right).map(|(_, value)| value).sum::<f64>()
    };
    for is_right in [false, true] {
        let (found, expected) = (half(&blurred, is_right), half(&sharp, is_right));
        assert!((found / expected - 1.0).abs() < 0.03, "{is_right}: {found}, {expected}");
    }
    // The far square is in focus: the same picture but for what the grain of its edges leaves.
    let off = sharp.iter().zip(&blurred).enumerate().filter(|(number, _)| number % 64 >= 32).map(|(_, (a, b))| (a - b).abs()).sum::<f64>();
    assert!(off / half(&sharp, true) < 0.05, "{off}");
    // At 2 m the picture's half height is 1 m, and the circle of confusion there has a radius of 0.1 * 6 / 8 = 0.075 m.
    let share = |x: f64, y: f64| -> f64 {
        const STEPS: i32 = 200;
        let (mut inside, mut all) = (0.0, 0.0);
        for (i, j) in (-STEPS..=STEPS).flat_map(|i| (-STEPS..=STEPS).map(move |j| (i, j))) {
            let (u, v) = (f64::from(i) / f64::from(STEPS), f64::from(j) / f64::from(STEPS));
            if u * u + v * v <= 1.0 {
                all += 1.0;
                let (x, y) = (x + 0.075 * u, y + 0.075 * v);
                inside += f64::from(u8::from((-0.75..=-0.25).contains(&x) && y.abs() <= 0.25));
            }
        }
        inside / all
    };
    for (column, row) in [(16, 32), (7, 32), (8, 32), (9, 32), (6, 32), (24, 32), (8, 24), (10, 26), (2, 32)] {
        let (x, y) = ((f64::from(column) + 0.5) / 32.0 - 1.0, 1.0 - (f64::from(row) + 0.5) / 32.0);
        let (found, expected) = (blurred[(row * 64 + column) as usize], share(x, y));
        assert!((found - expected).abs() < 0.08, "({column}, {row}): {found}, not {expected}");
    }
}

/// Photons, glass and a mirror through a lens, and by parallel rays: the path tracer's picture.
#[test]
fn both_see_what_the_path_tracer_sees() {
    let Some(gpu) = device() else { return };
    let scene = scene("cornell-spheres");
    let camera = scene.first_camera();
    let focus = camera.eye.length();
    let lens = Camera { lens: Some(Lens { radius: 0.1, focus }), ..camera.clone() };
    let parallel = Camera { projection: Projection::Orthographic { half_height: 0.7 }, ..camera };
    for camera in [lens, parallel] {
        let judged = Judge::new(&scene, 32).image(&camera, 8, 8, 600, 1);
        let settings = SceneSettings { photons: 5_000, caustic_photons: 5_000, rounds: 32, samples: 4, ..by_rounds() };
        let result = seen(&gpu, &scene, &settings, &camera, [8, 8]);
        let (mut found, mut expected, mut squares) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for (pixel, judged) in judged.pixels.iter().enumerate() {
            found += result.film.mean(pixel);
            expected += judged.mean.total();
            squares += result.film.standard_error(pixel).powf(2.0) + judged.total_standard_error.powf(2.0);
        }
        for channel in 0..3 {
            let what = format!("{:?}, channel {channel}", camera.projection);
            let error = squares[channel].sqrt().hypot(0.01 * expected[channel]);
            assert_holds(&what, z_check(&what, found[channel], expected[channel], error));
        }
    }
}

/// A file's orthographic camera sees 2 xmag by 2 ymag, scaled by its node.
#[test]
fn a_file_has_orthographic_cameras() {
    let mut value = square();
    value["cameras"][0] = json!({"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0.1, "zfar": 10}});
    value["nodes"][1]["scale"] = json!([2, 2, 2]);
    let scene = load(&value).unwrap();
    let camera = scene.first_camera();
    assert_eq!((camera.name.as_str(), camera.projection), ("eye", Projection::Orthographic { half_height: 4.0 }));
    assert_eq!((camera.aspect, camera.eye, camera.forward), (Some(1.5), dvec3(0.0, 0.0, 5.0), DVec3::NEG_Z));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}
