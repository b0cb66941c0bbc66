//! Surfaces that scatter light evenly to their other side.

use crate::common::colour_check;
use crate::common::layered::{layered, plastic};
use crate::common::prelude::*;
use photonmill::scene::material::Layers;

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
    let layers = Layers { specular: 0.0, diffuse_transmission: 0.7, diffuse_transmission_colour: colour, ..plastic(0.7) };
    let scene = scene_of(meshes, vec![layered(Vec3::splat(0.6), &layers), matt(0.0)], vec![sun(way)]);
    let settings = SceneSettings { part: Part::Caustic, caustic_photons: 100_000, caustic_radius: Some(0.05), alpha: 1.0, ..by_rounds() };
    let result = received(gpu, &scene, &settings, &[(DVec3::ZERO, DVec3::Y)]);
    let (found, error) = (means(&result)[0], standard_errors(&result)[0]);
    let expected = (0.7f32 * colour).as_dvec3() * -way.y * form_factor(side, height);
    println!("below a sheet: {found} +- {error}, {expected} expected");
    // The mean over the disc differs by less than a thousandth.
    colour_check("below a sheet", found, expected, error)
}
