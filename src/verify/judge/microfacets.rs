//! Distribution and masking of microfacets: GGX, and sheen's.

use std::f64::consts::{FRAC_1_PI, PI, TAU};

use glam::DVec3;

use super::{Random, uniform};
use crate::constants::DELTA_ALPHA_INVERSE;

/// Whether a lobe of this alpha is a delta.
pub(crate) fn is_delta(alpha: f64) -> bool {
    alpha * f64::from(DELTA_ALPHA_INVERSE) < 1.0
}

/// (1 - cosine)^5.
pub(crate) fn schlick(cosine: f64) -> f64 {
    (1.0 - cosine).clamp(0.0, 1.0).powi(5)
}

/// V of GGX with correlated Smith masking, from the cosines of both directions.
pub(crate) fn ggx_visibility(alpha: f64, n_v: f64, n_l: f64) -> f64 {
    0.5 / (n_l * slant(alpha, n_v) + n_v * slant(alpha, n_l))
}

/// The root of alpha^2 + (1 - alpha^2) cosine^2.
pub(crate) fn slant(alpha: f64, cosine: f64) -> f64 {
    let squared = alpha * alpha;
    (squared + (1.0 - squared) * cosine * cosine).sqrt()
}

/// D of GGX. The sine comes from the cross product, which keeps the digits of small angles.
pub(crate) fn ggx_distribution(alpha: f64, n: DVec3, h: DVec3) -> f64 {
    let squared = alpha * alpha;
    let width = n.cross(h).length_squared() + squared * n.dot(h).powi(2);
    squared / (PI * width * width)
}

/// Microfacets of GGX about a normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Facets {
    pub n: DVec3,
    pub alpha: f64,
    /// A unit vector in the surface, and the alpha along it; `alpha` is that across it then.
    pub stretch: Option<(DVec3, f64)>,
}

impl Facets {
    /// A vector's components along the stretch, across it, and along the normal, the first two times their alphas to this power.
    fn scaled(&self, w: DVec3, (tangent, along): (DVec3, f64), power: i32) -> DVec3 {
        let across = self.n.cross(tangent);
        DVec3::new(along.powi(power) * w.dot(tangent), self.alpha.powi(power) * w.dot(across), w.dot(self.n))
    }

    /// D, 1/sr.
    pub(super) fn distribution(&self, h: DVec3) -> f64 {
        match self.stretch {
            None => ggx_distribution(self.alpha, self.n, h),
            Some(stretch) => FRAC_1_PI / (self.alpha * stretch.1 * self.scaled(h, stretch, -1).length_squared().powi(2)),
        }
    }

    /// The length of a direction whose components beside the normal are scaled by alpha.
    fn slant(&self, w: DVec3) -> f64 {
        match self.stretch {
            None => slant(self.alpha, self.n.dot(w)),
            Some(stretch) => self.scaled(w, stretch, 1).length(),
        }
    }

    /// V of two directions on either side.
    pub(super) fn visibility(&self, wo: DVec3, wi: DVec3) -> f64 {
        let (n_v, n_l) = (self.n.dot(wo).abs().max(1e-9), self.n.dot(wi).abs());
        0.5 / (n_l * self.slant(wo) + n_v * self.slant(wi))
    }

    /// Density of half vectors that are sampled as they are seen from the eye, over 4 v.h: that of their mirror directions.
    pub(super) fn mirrored_density(&self, wo: DVec3, h: DVec3) -> f64 {
        0.5 * self.distribution(h) / (self.n.dot(wo) + self.slant(wo))
    }

    /// A half vector as it is seen from the eye (Dupuy and Benyoub 2023).
    pub(super) fn visible_normal(&self, wo: DVec3, rng: &mut Random) -> DVec3 {
        let (x, along) = self.stretch.unwrap_or_else(|| (self.n.any_orthonormal_pair().0, self.alpha));
        let y = self.n.cross(x);
        let stretched = DVec3::new(along * wo.dot(x), self.alpha * wo.dot(y), wo.dot(self.n)).normalize();
        let azimuth = TAU * uniform(rng);
        let height = (1.0 - uniform(rng)) * (1.0 + stretched.z) - stretched.z;
        let sine = (1.0 - height * height).max(0.0).sqrt();
        let h = stretched + DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), height);
        (along * h.x * x + self.alpha * h.y * y + h.z * self.n).normalize()
    }
}

/// D of sheen, from the squared sine of the half vector.
pub(crate) fn sheen_distribution(s: f64, sine_squared: f64) -> f64 {
    (2.0 + 1.0 / s) * sine_squared.powf(0.5 / s) * 0.5 * FRAC_1_PI
}

/// L of sheen.
pub(crate) fn sheen_masking(s: f64, cosine: f64) -> f64 {
    const AT_0: [f64; 5] = [25.3245, 3.32435, 0.16801, -1.27393, -4.85967];
    const AT_1: [f64; 5] = [21.5473, 3.82987, 0.19823, -1.97760, -4.32054];
    let weight = 1.0 - (1.0 - s) * (1.0 - s);
    let p: [f64; 5] = std::array::from_fn(|k| AT_0[k] + (AT_1[k] - AT_0[k]) * weight);
    let l = |x: f64| p[0] / (1.0 + p[1] * x.powf(p[2])) + p[3] * x + p[4];
    if cosine < 0.5 { l(cosine).exp() } else { (2.0 * l(0.5) - l(1.0 - cosine)).exp() }
}
