//! Directions from uniform numbers. Twin of `glsl/rng/sampling.glsl`.

use glam::{Vec2, Vec3};

/// (sin, cos) of `turns` full turns, turns in [0, 1).
#[inline(always)]
pub(crate) fn sin_cos_turns(turns: f32) -> Vec2 {
    let quarter = (4.0 * turns).round_ties_even();
    let z = std::f32::consts::TAU * (turns - 0.25 * quarter);
    let z2 = z * z;
    let s = z + z * z2 * (-1.0 / 6.0 + z2 * (1.0 / 120.0 + z2 * (-1.0 / 5040.0 + z2 * (1.0 / 362_880.0))));
    let c = 1.0 - 0.5 * z2 + z2 * z2 * (1.0 / 24.0 + z2 * (-1.0 / 720.0 + z2 * (1.0 / 40_320.0)));
    let quadrant = quarter as u32 & 3;
    let rotated = if quadrant & 1 == 0 { Vec2::new(s, c) } else { Vec2::new(c, -s) };
    if quadrant & 2 == 0 { rotated } else { -rotated }
}

#[inline(always)]
fn direction_at(cosine: f32, sine_squared: f32, azimuth: f32) -> Vec3 {
    let sin_cos = sin_cos_turns(azimuth);
    let sine = sine_squared.max(0.0).sqrt();
    Vec3::new(sine * sin_cos.y, sine * sin_cos.x, cosine)
}

/// A number that is 0 stands for what lies below a generator's last bit: no direction lies in the surface.
const LEAST: f32 = 1.0 / 33_554_432.0;

/// pdf = cosine / pi.
#[inline(always)]
pub(crate) fn sample_cosine_hemisphere(u: f32, azimuth: f32) -> Vec3 {
    let u = u.max(LEAST);
    direction_at(u.sqrt(), 1.0 - u, azimuth)
}

/// pdf = 1 / (2 pi).
#[inline(always)]
pub(crate) fn sample_uniform_hemisphere(u: f32, azimuth: f32) -> Vec3 {
    let u = u.max(LEAST);
    direction_at(u, (1.0 - u) * (1.0 + u), azimuth)
}

/// From the frame of a wall (tangent, bitangent, normal) to world axes.
#[inline(always)]
pub(crate) fn to_world(local: Vec3, [tangent, bitangent, normal]: [Vec3; 3]) -> Vec3 {
    local.x * tangent + local.y * bitangent + local.z * normal
}
