//! How surfaces scatter light.

use std::f64::consts::{FRAC_1_PI, TAU};

use glam::DVec3;

use super::geometry::Vertex;
use super::{Random, uniform};
use crate::constants::SMOOTH_TOTAL_REFLECTIONS;
use crate::scene::Surface;

/// `w` reflected about a unit normal; both point away from the surface.
pub(crate) fn mirrored(w: DVec3, normal: DVec3) -> DVec3 {
    2.0 * w.dot(normal) * normal - w
}

/// `local` in a frame whose z is `axis`, a unit vector.
pub(crate) fn around(axis: DVec3, local: DVec3) -> DVec3 {
    let (x, y) = axis.any_orthonormal_pair();
    local.x * x + local.y * y + local.z * axis
}

/// A direction with a density in proportion to cos^exponent around a unit axis.
pub(crate) fn sample_lobe(axis: DVec3, exponent: f64, rng: &mut Random) -> DVec3 {
    // 1 - u is never 0: then no direction lies on the horizon, where a cosine's density is 0.
    let cosine = (1.0 - uniform(rng)).powf(1.0 / (exponent + 1.0));
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let azimuth = TAU * uniform(rng);
    around(axis, DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), cosine))
}

/// cos^exponent; nothing, for every exponent, on the far side.
fn lobe(cosine: f64, exponent: f32) -> f64 {
    if cosine > 0.0 { cosine.powf(f64::from(exponent)) } else { 0.0 }
}

/// Reflectance for unpolarised light of a smooth boundary between media of these indices of refraction,
/// from the cosine on the side where light arrives; 1 in total internal reflection.
pub(crate) fn fresnel(cos_i: f64, n_i: f64, n_t: f64) -> f64 {
    let sin_t = n_i / n_t * (1.0 - cos_i * cos_i).max(0.0).sqrt();
    if sin_t >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin_t * sin_t).sqrt();
    let parallel = (n_t * cos_i - n_i * cos_t) / (n_t * cos_i + n_i * cos_t);
    let perpendicular = (n_i * cos_i - n_t * cos_t) / (n_i * cos_i + n_t * cos_t);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

impl Vertex {
    /// The BRDF of a surface that is not specular, 1/sr. `towards_eye`: no surface that is not specular
    /// lies between it and the eye; there alone the paper's Phong has its lobe.
    pub(super) fn brdf(&self, wi: DVec3, towards_eye: bool) -> DVec3 {
        let cosine = mirrored(wi, self.ns).dot(self.wo);
        let share = match self.surface {
            Surface::Lambert => FRAC_1_PI,
            Surface::PaperPhong { exponent } if towards_eye => FRAC_1_PI * lobe(cosine, exponent),
            Surface::PaperPhong { .. } => FRAC_1_PI,
            Surface::Glossy { exponent } => (f64::from(exponent) + 2.0) / TAU * lobe(cosine, exponent),
            Surface::Mirror | Surface::Dielectric { .. } | Surface::Layered => 0.0,
        };
        share * self.base_colour
    }

    /// Where a path goes on that has met `depth` surfaces before, and its weight: BRDF times cosine over the density of the
    /// direction. `None`: the direction lies on the wrong side, and the path ends.
    pub(super) fn scatter(&self, depth: u32, towards_eye: bool, rng: &mut Random) -> Option<(DVec3, DVec3)> {
        let (wi, weight, is_transmitted) = match self.surface {
            Surface::Lambert => (sample_lobe(self.ns, 1.0, rng), 1.0, false),
            Surface::PaperPhong { exponent } => {
                let wi = sample_lobe(self.ns, 1.0, rng);
                (wi, if towards_eye { lobe(mirrored(wi, self.ns).dot(self.wo), exponent) } else { 1.0 }, false)
            }
            Surface::Glossy { exponent } => {
                let n = f64::from(exponent);
                let wi = sample_lobe(mirrored(self.wo, self.ns), n, rng);
                (wi, (n + 2.0) / (n + 1.0) * wi.dot(self.ns).max(0.0), false)
            }
            Surface::Mirror => (mirrored(self.wo, self.ns), 1.0, false),
            Surface::Dielectric { ior } => {
                let (n_i, n_t) = if self.is_front { (1.0, f64::from(ior)) } else { (f64::from(ior), 1.0) };
                // Total reflection by a shading normal alone has an end: glass would keep light that its triangles let out.
                let is_total = fresnel(self.wo.dot(self.ns), n_i, n_t) == 1.0;
                let normal = if is_total && depth >= SMOOTH_TOTAL_REFLECTIONS { self.ng } else { self.ns };
                let cos_i = self.wo.dot(normal);
                if uniform(rng) < fresnel(cos_i, n_i, n_t) {
                    (mirrored(self.wo, normal), 1.0, false)
                } else {
                    let eta = n_i / n_t;
                    let cos_t = (1.0 - eta * eta * (1.0 - cos_i * cos_i)).max(0.0).sqrt();
                    // Radiance over n^2 is what refraction leaves as it is.
                    ((eta * cos_i - cos_t) * normal - eta * self.wo, eta * eta, true)
                }
            }
            // It has lobes of its own.
            Surface::Layered => return None,
        };
        // A specular ray that its shading normal sends to the wrong side is mirrored in the triangle's plane.
        let height = wi.dot(self.ng);
        let wi = if self.surface.is_specular() && (height < 0.0) != is_transmitted { wi - 2.0 * height * self.ng } else { wi };
        let is_below = wi.dot(self.ng) < 0.0;
        (weight > 0.0 && is_below == is_transmitted).then_some((wi, weight * self.base_colour))
    }
}
