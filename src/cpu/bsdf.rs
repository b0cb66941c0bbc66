//! The paper's Phong weight (section 4.4). Twin of `glsl/material/phong_weight.glsl`, which explains it.

use glam::Vec3;

use super::math::{exp2, log2};
use crate::records::Wall;
use crate::settings::PhongDirection;

/// max(cosine, 0)^shininess, with 1 for shininess 0 and nothing for a direction that points away.
pub(crate) fn phong_lobe(cosine: f32, shininess: f32) -> f32 {
    if cosine <= 0.0 {
        return 0.0;
    }
    let x = 1.0 - cosine;
    let logarithm =
        if x < 0.03125 { -x * (1.0 + x * (1.0 / 2.0 + x * (1.0 / 3.0 + x * (1.0 / 4.0)))) } else { std::f32::consts::LN_2 * log2(cosine) };
    if shininess == 0.0 { 1.0 } else { exp2(std::f32::consts::LOG2_E * shininess * logarithm).min(1.0) }
}

/// What a stored photon weighs at the eye: 1 on a Lambertian wall (shininess below 0).
pub(crate) fn view_weight(wall: &Wall, position: Vec3, arriving: Vec3, reflected: Vec3, eye: Vec3, direction: PhongDirection) -> f32 {
    if wall.shininess < 0.0 {
        return 1.0;
    }
    let to_eye = eye - position;
    let eye_distance_squared = to_eye.dot(to_eye);
    let lobe = match direction {
        PhongDirection::Sampled => reflected,
        PhongDirection::Mirror => arriving - 2.0 * arriving.dot(wall.normal) * wall.normal,
    };
    if eye_distance_squared > 0.0 { phong_lobe(to_eye.dot(lobe) * (1.0 / eye_distance_squared.sqrt()), wall.shininess) } else { 0.0 }
}
