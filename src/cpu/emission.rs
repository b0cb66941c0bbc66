//! Emission of a disc light flush with its wall. Twin of `glsl/world/room/disc.glsl`.

use glam::Vec3;

use super::sampling::{sample_cosine_hemisphere, sample_uniform_hemisphere, sin_cos_turns, to_world};
use crate::records::{DiscLight, Wall};
use crate::settings::EmissionLaw;

/// Position and direction of a photon; `u`: disc radius, disc angle, cosine, azimuth.
#[inline(always)]
pub(crate) fn emit_from_disc(light: &DiscLight, wall: &Wall, law: EmissionLaw, u: [f32; 4]) -> (Vec3, Vec3) {
    let sin_cos = sin_cos_turns(u[1]);
    let distance_from_centre = light.radius * u[0].sqrt();
    let offset = (distance_from_centre * sin_cos.y, distance_from_centre * sin_cos.x);
    let position = light.centre + (offset.0 * wall.tangent + offset.1 * wall.bitangent);
    let local = match law {
        EmissionLaw::Cosine => sample_cosine_hemisphere(u[2], u[3]),
        EmissionLaw::Uniform => sample_uniform_hemisphere(u[2], u[3]),
    };
    (position, to_world(local, [wall.tangent, wall.bitangent, wall.normal]))
}
