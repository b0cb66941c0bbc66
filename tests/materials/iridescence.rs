//! Thin films against closed forms, and in a furnace.

use crate::common::prelude::*;
use photonmill::engine::scene::{self, Target};
use photonmill::scene::film;
use photonmill::scene::material::{Layers, Medium};
use photonmill::verify::judge::Verdict;

#[expect(clippy::large_types_passed_by_value, reason = "a new one is made of it")]
fn filmed(ior: f32, nanometres: f32, layers: Layers) -> Layers {
    Layers { iridescence: 1.0, film_ior: ior, film_thickness: [0.0, nanometres], ..layers }
}

fn dielectric(roughness: f32) -> Layers {
    Layers { metallic: 0.0, roughness, ..Layers::default() }
}

/// Without thickness, or of the index of air, a film is nothing; a thick one reflects what both of its boundaries do without
/// interference, R = R1 + T1^2 R2 / (1 - R1 R2); a quarter of a wave thick, of the root of the base's index, it reflects
/// little of green, and half a wave thick as much as the base alone.
#[test]
fn films_reflect_as_their_closed_forms_say() {
    let base = DVec3::splat(0.04);
    let at = |ior: f64, thickness: f64, cosine: f64| film::reflectance(base, ior, thickness, cosine);
    let schlick = |f0: f64, cosine: f64| f0 + (1.0 - f0) * (1.0 - cosine).powi(5);
    for cosine in [1.0, 0.7, 0.3, 0.1] {
        for nothing in [at(1.4, 0.0, cosine), at(1.0, 300.0, cosine)] {
            // The observer's white is not quite that of the channels, and beside the normal Schlick's formula reflects without a boundary, too.
            assert!(cosine < 1.0 || (nothing - schlick(0.04, cosine)).abs().max_element() < 0.01, "{nothing} at {cosine}");
        }
        let inside = (1.0 - (1.0 - cosine * cosine) / 1.96).sqrt();
        let (first, second) = (schlick((0.4f64 / 2.4).powi(2), cosine), schlick((0.1f64 / 2.9).powi(2), inside));
        let thick = first + (1.0 - first).powi(2) * second / (1.0 - first * second);
        assert!((at(1.4, 1e5, cosine) - thick).abs().max_element() < 1e-9, "{} for {thick}", at(1.4, 1e5, cosine));
    }
    let root = 1.5f64.sqrt();
    let (quarter, half) = (at(root, 550.0 / 4.0 / root, 1.0), at(root, 550.0 / 2.0 / root, 1.0));
    println!("quarter {quarter}, half {half}");
    assert!(quarter.y < 0.01 && half.y > 0.03, "{quarter} {half}");
}

/// No film reflects more than its bound, and none gains light.
#[test]
fn bounds_hold_for_every_angle() {
    for (ior, nanometres) in [(1.0, 0.0), (1.3, 400.0), (1.33, 1200.0), (2.0, 250.0), (2.4, 5000.0), (100.0, 30.0)] {
        let layers = filmed(ior, nanometres, dielectric(0.5));
        let bound = layers.film_bound();
        for k in 1..2000 {
            let cosine = f64::from(k) / 2000.0;
            let found = film::reflectance(DVec3::splat(0.04), ior.into(), nanometres.into(), cosine).max_element();
            let most = bound + (1.0 - bound) * (1.0 - cosine).powi(5);
            assert!(found <= most + 2e-3, "{ior} {nanometres} at {cosine}: {found}, at most {most}");
        }
    }
}

/// White balls and solids with films, under a sky of 1, are nowhere brighter than it; glass without loss is not to be seen.
#[test]
fn films_gain_no_light() {
    let Some(gpu) = device() else { return };
    let clear = |medium| Layers { transmission: 1.0, medium, ..dielectric(0.0) };
    let materials: Vec<(Layers, bool)> = vec![
        (filmed(1.4, 380.0, dielectric(0.2)), false),
        (filmed(2.0, 250.0, dielectric(0.8)), false),
        (filmed(1.8, 300.0, Layers { metallic: 0.5, ..dielectric(0.4) }), false),
        (filmed(1.33, 500.0, clear(None)), true),
        (filmed(1.38, 100.0, clear(Some(Medium::CLEAR))), true),
    ];
    for (layers, is_lossless) in materials {
        let ball = Mesh::sphere("ball", DVec3::ZERO, 0.5, 32, 0);
        let scene =
            scene_of(vec![ball], vec![Material::layered("ball", Vec3::ONE, layers)], vec![LightKind::Environment { radiance: Vec3::ONE }]);
        let camera = Camera::looking_at("eye", DVec3::Z * 20.0, DVec3::ZERO, DVec3::Y, 0.04);
        let settings = SceneSettings { photons: 20_000, caustic_photons: 20_000, samples: 16, rounds: 16, ..by_rounds() };
        let lit = seen(&gpu, &scene, &settings, &camera, [8, 8]);
        for channel in 0..3 {
            let (mean, error) = mean_and_error(&means(&lit).iter().map(|mean| mean[channel]).collect::<Vec<_>>());
            println!("{layers:?}, channel {channel}: {mean} +- {error}");
            assert!(mean < 1.0 + 5.0 * error + 1e-3, "{mean} +- {error}");
            assert!(!is_lossless || mean > 1.0 - 5.0 * error - 2e-3, "{mean} +- {error}");
            assert!(mean > 0.8, "{mean}");
        }
    }
}

/// A metal, a dielectric and a bubble with films.
#[test]
fn films_agree_with_the_judge() {
    const SIZE: u32 = 24;
    let Some(gpu) = device() else { return };
    let lamp = Material { emission: Vec3::splat(12.0), ..matt(0.0) };
    let of = |layers: Layers| Material::layered("film", Vec3::new(0.8, 0.7, 0.6), layers);
    let materials = vec![
        matt(0.6),
        lamp,
        of(filmed(1.8, 300.0, Layers { roughness: 0.6, ..Layers::default() })),
        of(filmed(1.4, 420.0, dielectric(0.4))),
        of(filmed(1.33, 350.0, Layers { transmission: 1.0, medium: Some(Medium::CLEAR), ..dielectric(0.0) })),
    ];
    let ball = |x: f64, material: usize| Mesh::sphere("ball", DVec3::new(x, 0.25, 0.1), 0.22, 32, material);
    let meshes = vec![level(0.0, [2.4, 2.4], true, 0), level(1.2, [0.6, 0.6], false, 1), ball(-0.5, 2), ball(0.0, 3), ball(0.5, 4)];
    let mut scene = scene_of(meshes, materials, vec![LightKind::Environment { radiance: Vec3::splat(0.4) }]);
    scene.cameras.push(Camera::looking_at("camera", DVec3::new(0.0, 0.5, 1.7), DVec3::new(0.0, 0.2, 0.0), DVec3::Y, 0.7));
    let settings = SceneSettings { photons: 20_000, caustic_photons: 20_000, samples: 4, rounds: 32, ..by_rounds() };
    let camera = scene.first_camera();
    let lit = scene::render(&gpu, &scene, &settings, Target::Picture(&camera, [SIZE; 2])).unwrap();
    let judged = Judge::new(&scene, 64).image(&camera, SIZE, SIZE, 512, 77);
    let verdict = Verdict::new(&means(&lit), &standard_errors(&lit), 32, &judged, None);
    println!("{verdict}");
    assert!(verdict.agrees(), "{verdict}");
}
