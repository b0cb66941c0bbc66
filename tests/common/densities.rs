//! Directions and points, from whichever function or photon, against the densities that they should have.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DMat3, DVec2, DVec3, Vec3};

use super::chi_square::{Grid, ONE, density_check, even};
use super::{Check, require};

/// An axis of no special place, near where frames are hard to make.
pub const AXIS: DVec3 = DVec3::new(0.3, -0.5, -0.8);
/// Units of f32's rounding.
pub const ULP: f64 = 1.0 / 16_777_216.0;

/// A frame whose z is this way, and whose x lies towards `side`.
pub fn frame(z: DVec3, side: DVec3) -> DMat3 {
    let z = z.normalize();
    let across = side - side.dot(z) * z;
    let x = if across.length() > 1e-6 { across.normalize() } else { z.any_orthonormal_vector() };
    DMat3::from_cols(x, z.cross(x), z)
}

/// Polar angle and azimuth in a frame.
pub fn polar(frame: DMat3, direction: Vec3) -> (f64, f64) {
    let local = frame.transpose() * direction.as_dvec3();
    (local.truncate().length().atan2(local.z), local.y.atan2(local.x))
}

/// A density per solid angle as one per polar angle and azimuth.
pub fn on_sphere(frame: DMat3, density: impl Fn(DVec3) -> f64) -> impl Fn(f64, f64) -> f64 {
    move |angle, azimuth| {
        let local = DVec3::new(angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin(), angle.cos());
        density(frame * local) * angle.sin()
    }
}

/// Cells between polar angles, of equal width in azimuth.
pub fn angles(polar: Vec<f64>) -> Grid {
    Grid { x: polar, y: even(-PI, PI, 12) }
}

/// Cells of about equal probability under cos^exponent, the last of them small ones in which the lobe ends.
pub fn lobe_angles(exponent: f64) -> Grid {
    let left = (0..20).map(|k| 1.0 - f64::from(k) / 20.0).chain([1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-11, 1e-15]);
    // 1 - cosine by its own series: next to 1 a cosine has few digits.
    let mut polar: Vec<f64> = left.map(|left: f64| 2.0 * (-0.5 * (left.ln() / (exponent + 1.0)).exp_m1()).sqrt().asin()).collect();
    polar.push(FRAC_PI_2);
    angles(polar)
}

/// max(cosine, 0)^exponent.
pub fn lobe(cosine: f64, exponent: f64) -> f64 {
    if cosine > 0.0 { cosine.powf(exponent) } else { 0.0 }
}

/// Off unit length by no more than `bound`.
pub fn is_unit(what: &str, direction: Vec3, bound: f64) -> Check {
    let off = (direction.as_dvec3().length() - 1.0).abs();
    require(off <= bound, || format!("{what}: {direction:?} is {off:e} longer or shorter than 1"))
}

/// Directions against their density per solid angle, by cells of polar angles in a frame.
pub fn directions_check(what: &str, directions: &[Vec3], frame: DMat3, grid: &Grid, density: impl Fn(DVec3) -> f64) -> Check {
    let places: Vec<(f64, f64)> = directions.iter().map(|direction| polar(frame, *direction)).collect();
    density_check(what, &places, places.len(), grid, ONE, &on_sphere(frame, density))
}

/// The same over a hemisphere.
pub fn hemisphere_check(what: &str, directions: &[Vec3], frame: DMat3, density: impl Fn(DVec3) -> f64) -> Check {
    directions_check(what, directions, frame, &angles(even(0.0, FRAC_PI_2, 20)), density)
}

/// Directions that should be even over the sphere.
pub fn sphere_check(what: &str, directions: &[Vec3]) -> Check {
    directions_check(what, directions, DMat3::IDENTITY, &angles(even(0.0, PI, 20)), |_| 0.25 / PI)
}

/// Directions of a lobe around the z axis.
pub fn lobe_check(what: &str, directions: &[Vec3], exponent: f64) -> Check {
    let density = |wi: DVec3| (exponent + 1.0) / TAU * lobe(wi.z, exponent);
    directions_check(what, directions, DMat3::IDENTITY, &lobe_angles(exponent), density)
}

/// Points of a disc around the origin.
pub fn disc_check(what: &str, points: &[DVec3], axis: DVec3, radius: f64) -> Check {
    let frame = frame(axis, DVec3::X);
    let mut places = Vec::new();
    for point in points {
        let local = frame.transpose() * *point;
        require(local.z.abs() <= 8.0 * ULP, || format!("{what}: {point} lies {} above the disc", local.z))?;
        places.push((local.truncate().length(), local.y.atan2(local.x)));
    }
    let grid = Grid { x: even(0.0, radius, 20), y: even(-PI, PI, 12) };
    density_check(what, &places, places.len(), &grid, ONE, &|distance, _| distance / (PI * radius * radius))
}

/// Weights of a triangle's second and third corner.
pub fn triangle_check(what: &str, weights: &[DVec2]) -> Check {
    // From the first corner on, and across: there the triangle is a square.
    let places: Vec<(f64, f64)> = weights.iter().map(|at| (at.x + at.y, at.y / (at.x + at.y).max(1e-30))).collect();
    density_check(what, &places, places.len(), &Grid { x: even(0.0, 1.0, 20), y: even(0.0, 1.0, 20) }, ONE, &|along, _| 2.0 * along)
}

/// Two numbers that must have nothing to do with each other, each even over [0, 1].
pub fn independence_check(what: &str, places: &[(f64, f64)]) -> Check {
    density_check(what, places, places.len(), &Grid { x: even(0.0, 1.0, 12), y: even(0.0, 1.0, 12) }, ONE, &|_, _| 1.0)
}
