//! Distribution and masking of microfacets: GGX, and sheen's.

use std::f64::consts::{FRAC_1_PI, PI};

use glam::DVec3;

use crate::constants::DELTA_ALPHA_INVERSE;

/// Whether a lobe of this alpha is a delta.
pub fn is_delta(alpha: f64) -> bool {
    alpha * f64::from(DELTA_ALPHA_INVERSE) < 1.0
}

/// (1 - cosine)^5.
pub fn schlick(cosine: f64) -> f64 {
    (1.0 - cosine).clamp(0.0, 1.0).powi(5)
}

/// V of GGX with correlated Smith masking, from the cosines of both directions.
pub fn ggx_visibility(alpha: f64, n_v: f64, n_l: f64) -> f64 {
    0.5 / (n_l * slant(alpha, n_v) + n_v * slant(alpha, n_l))
}

/// The root of alpha^2 + (1 - alpha^2) cosine^2.
pub fn slant(alpha: f64, cosine: f64) -> f64 {
    let squared = alpha * alpha;
    (squared + (1.0 - squared) * cosine * cosine).sqrt()
}

/// D of GGX. The sine comes from the cross product, which keeps the digits of small angles.
pub fn ggx_distribution(alpha: f64, n: DVec3, h: DVec3) -> f64 {
    let squared = alpha * alpha;
    let width = n.cross(h).length_squared() + squared * n.dot(h).powi(2);
    squared / (PI * width * width)
}

/// D of sheen, from the squared sine of the half vector.
pub fn sheen_distribution(s: f64, sine_squared: f64) -> f64 {
    (2.0 + 1.0 / s) * sine_squared.powf(0.5 / s) * 0.5 * FRAC_1_PI
}

/// L of sheen.
pub fn sheen_masking(s: f64, cosine: f64) -> f64 {
    const AT_0: [f64; 5] = [25.3245, 3.32435, 0.16801, -1.27393, -4.85967];
    const AT_1: [f64; 5] = [21.5473, 3.82987, 0.19823, -1.97760, -4.32054];
    let weight = 1.0 - (1.0 - s) * (1.0 - s);
    let p: [f64; 5] = std::array::from_fn(|k| AT_0[k] + (AT_1[k] - AT_0[k]) * weight);
    let l = |x: f64| p[0] / (1.0 + p[1] * x.powf(p[2])) + p[3] * x + p[4];
    if cosine < 0.5 { l(cosine).exp() } else { (2.0 * l(0.5) - l(1.0 - cosine)).exp() }
}
