//! Surfaces that scatter light evenly to their other side: sheets and solids.

use crate::common::estimate_check;
use crate::common::prelude::*;
use photonmill::engine::scene::{self, Target};
use photonmill::scene::material::{Layers, Medium};
use photonmill::verify::judge::Verdict;

fn paper(share: f32, colour: Vec3, specular: f32, medium: Option<Medium>) -> Material {
    let layers = Layers {
        metallic: 0.0,
        roughness: 0.7,
        specular,
        diffuse_transmission: share,
        diffuse_transmission_colour: colour,
        medium,
        ..Layers::default()
    };
    Material::layered("paper", Vec3::splat(0.6), layers)
}

/// What a square of radiosity 1 sends to a point below its middle: four times a corner's form factor (Howell, B-4).
fn form_factor(side: f64, height: f64) -> f64 {
    let a = 0.5 * side / height;
    let root = (1.0 + a * a).sqrt();
    4.0 / PI * (a / root) * (a / root).atan()
}

/// Sunlight on a sheet above a black floor, which photons alone bring there.
pub fn sheet_over_a_floor(gpu: &Gpu) -> Check<Complaint> {
    let (side, height) = (1.0, 0.5);
    let colour = Vec3::new(0.3, 0.9, 0.6);
    let way = DVec3::new(0.5, -0.8, 0.2).normalize();
    let meshes = vec![level(height, [side; 2], true, 0), level(0.0, [0.4; 2], true, 1)];
    let scene = scene_of(meshes, vec![paper(0.7, colour, 0.0, None), matt(0.0)], vec![sun(way)]);
    let settings =
        SceneSettings { part: Part::Caustic, caustic_photons: 100_000, caustic_radius: Some(0.05), alpha: 1.0, rounds: 16, ..by_rounds() };
    let lit = received(gpu, &scene, &settings, &[(DVec3::ZERO, DVec3::Y)]);
    let (found, error) = (means(&lit)[0], standard_errors(&lit)[0]);
    for channel in 0..3 {
        let expected = f64::from(0.7f32 * colour[channel]) * -way.y * form_factor(side, height);
        println!("below a sheet, channel {channel}: {} +- {}, {expected} expected", found[channel], error[channel]);
        // The mean over the disc differs by less than a thousandth.
        estimate_check(&format!("below a sheet, channel {channel}"), found[channel], expected, error[channel])?;
    }
    Ok(())
}

#[test]
fn photons_pass_a_sheet_of_paper() {
    let Some(gpu) = device() else { return };
    assert_holds("a sheet", sheet_over_a_floor(&gpu));
}

/// A white sheet that reflects half and lets half through, and a ball of the same around clear air, are not to be seen in a furnace.
#[test]
fn white_paper_is_not_seen_in_a_furnace() {
    let Some(gpu) = device() else { return };
    let white = |medium| Material { base_colour: Vec3::ONE, ..paper(0.5, Vec3::ONE, 1.0, medium) };
    for medium in [None, Some(Medium::CLEAR)] {
        let meshes = vec![Mesh::sphere("ball", DVec3::ZERO, 0.5, 32, 0), level(-0.6, [2.0; 2], true, 0)];
        let scene = scene_of(meshes, vec![white(medium)], vec![LightKind::Environment { radiance: Vec3::ONE }]);
        let camera = Camera::looking_at("eye", DVec3::new(0.0, 1.5, 4.0), DVec3::Y * -0.1, DVec3::Y, 0.2);
        let settings = SceneSettings { photons: 100_000, caustic_photons: 100_000, samples: 4, rounds: 16, ..by_rounds() };
        let lit = seen(&gpu, &scene, &settings, &camera, [12, 12]);
        let (mean, error) = mean_and_error(&means(&lit).iter().map(|mean| mean.x).collect::<Vec<_>>());
        println!("white paper, {medium:?}: {mean} +- {error}");
        // Rough reflection of a single scattering leaves 0.1 % of what the dielectric mirrors, and density estimates blur.
        assert!((mean - 1.0).abs() < 0.01 + 4.0 * error, "{mean} +- {error}");
    }
}

/// A lamp behind a screen, a leaf that shines, and a block of wax that absorbs.
#[test]
fn translucent_things_agree_with_the_judge() {
    const SIZE: u32 = 24;
    let Some(gpu) = device() else { return };
    let lamp = Material { emission: Vec3::splat(12.0), two_sided: true, ..matt(0.0) };
    let wax = Medium { transmittance: Vec3::new(0.9, 0.4, 0.1), metres: 0.3 };
    let leaf = paper(0.6, Vec3::new(0.5, 0.9, 0.2), 1.0, None);
    let materials = vec![matt(0.6), lamp, leaf, paper(0.8, Vec3::ONE, 1.0, Some(wax))];
    let mut sheet = level(0.75, [0.9, 0.9], false, 2);
    sheet.positions.iter_mut().for_each(|at| at.y += 0.3 * at.x);
    let meshes = vec![
        level(0.0, [2.4, 2.4], true, 0),
        level(1.2, [0.5, 0.5], false, 1),
        sheet,
        Mesh::sphere("wax", DVec3::new(0.3, 0.2, 0.2), 0.2, 24, 3),
    ];
    let mut scene = scene_of(meshes, materials, vec![LightKind::Environment { radiance: Vec3::splat(0.3) }]);
    scene.cameras.push(Camera::looking_at("camera", DVec3::new(0.1, 0.5, 1.7), DVec3::new(0.0, 0.4, 0.0), DVec3::Y, 0.8));
    let settings = SceneSettings { photons: 20_000, caustic_photons: 20_000, samples: 4, rounds: 32, ..by_rounds() };
    let camera = scene.first_camera();
    let lit = scene::render(&gpu, &scene, &settings, Target::Picture(&camera, [SIZE; 2])).unwrap();
    let judged = Judge::new(&scene, 64).image(&camera, SIZE, SIZE, 512, 77);
    let verdict = Verdict::new(&means(&lit), &standard_errors(&lit), 32, &judged, None);
    println!("{verdict}");
    assert!(verdict.agrees(), "{verdict}");
}
