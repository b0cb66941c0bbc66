//! Thin films over a base (KHR_materials_iridescence): what they reflect, by interference of light that is reflected at both of their
//! boundaries (Belcour and Barla 2017), and a bound of it.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::material::Layers;

/// Of the observer's X, Y, Z and a second one of X in the frequency's Fourier space: weights, places and variances.
const GAUSSIANS: [(f64, f64, f64); 4] = [
    (5.4856e-13, 1.6810e6, 4.3278e9),
    (4.4201e-13, 1.7953e6, 9.3046e9),
    (5.2481e-13, 2.2084e6, 6.6121e9),
    (9.7470e-14, 2.2399e6, 4.5282e9),
];
const OF_WHITE: f64 = 1.0685e-7;

/// Linear red, green and blue of a wave that goes so many nanometres further, with these shifts of phase.
fn wave(path: f64, shift: DVec3) -> DVec3 {
    let phase = TAU * path * 1e-9;
    let of = |k: usize, shift: f64| {
        let (weight, place, variance) = GAUSSIANS[k];
        weight * (TAU * variance).sqrt() * (place * phase + shift).cos() * (-variance * phase * phase).exp()
    };
    let [x, y, z] = [of(0, shift.x) + of(3, shift.x), of(1, shift.y), of(2, shift.z)].map(|value| value / OF_WHITE);
    DVec3::new(
        3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
        -0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
        0.0556434 * x - 0.2040259 * y + 1.0572252 * z,
    )
}

fn along_normal(a: f64, b: f64) -> f64 {
    ((a - b) / (a + b)).powi(2)
}

fn schlick(f0: f64, cosine: f64) -> f64 {
    f0 + (1.0 - f0) * (1.0 - cosine).clamp(0.0, 1.0).powi(5)
}

/// What a film of this index and thickness (nanometres) in air reflects of light that meets it at a cosine, over a base that reflects
/// `f0` in air along the normal.
pub(crate) fn reflectance(f0: DVec3, ior: f64, thickness: f64, cosine: f64) -> DVec3 {
    // Where it ends it is air.
    let share = (thickness / 0.03).clamp(0.0, 1.0);
    let ior = 1.0 + (ior - 1.0) * share * share * (3.0 - 2.0 * share);
    let squared = 1.0 - (1.0 - cosine * cosine) / (ior * ior);
    if squared <= 0.0 {
        return DVec3::ONE;
    }
    let inside = squared.sqrt();
    let first = schlick(along_normal(ior, 1.0), cosine);
    let through = 1.0 - first;
    let base = f0.map(|f0| {
        let root = f0.clamp(0.0, 0.9999).sqrt();
        (1.0 + root) / (1.0 - root)
    });
    let second = base.map(|base| schlick(along_normal(base, ior), inside));
    let shift = base.map(|base| if base < ior { TAU } else { PI });
    let both = (first * second).clamp(DVec3::splat(1e-5), DVec3::splat(0.9999));
    let often = through * through * second / (1.0 - both);
    let mut sum = first + often;
    let mut amplitude = often - through;
    for m in [1.0, 2.0] {
        amplitude *= both.map(f64::sqrt);
        sum += 2.0 * amplitude * wave(m * 2.0 * ior * thickness * inside, m * shift);
    }
    sum.clamp(DVec3::ZERO, DVec3::ONE)
}

impl Layers {
    /// The least F0 with which Schlick's formula, with F90 = 1, is nowhere below what the film reflects over the dielectric, wherever
    /// textures say how thick it is, and what lies under it.
    pub fn film_bound(&self) -> f64 {
        const COSINES: u32 = 96;
        if self.iridescence == 0.0 {
            return 0.0;
        }
        let along = if self.ior == 0.0 { 1.0 } else { along_normal(f64::from(self.ior), 1.0) };
        let f0 = (along * self.specular_colour.as_dvec3()).min(DVec3::ONE) * f64::from(self.specular);
        let [least, most] = self.film_thickness.map(f64::from);
        let has_range = self.film_thickness_texture.is_some() && least != most;
        let thicknesses = if has_range { 48 } else { 0 };
        let has_shades = self.specular_texture.is_some() || self.specular_colour_texture.is_some();
        let shades = if has_shades { 4 } else { 0 };
        let share = |k: u32, of: u32| if of == 0 { 1.0 } else { f64::from(k) / f64::from(of) };
        let mut bound: f64 = 0.0;
        for (shade, thickness) in (0..=shades).flat_map(|shade| (0..=thicknesses).map(move |thickness| (shade, thickness))) {
            let thickness = least + (most - least) * share(thickness, thicknesses);
            for cosine in (1..=COSINES).map(|k| share(k, COSINES)) {
                let grazing = (1.0 - cosine).powi(5);
                let found = reflectance(share(shade, shades) * f0, f64::from(self.film_ior), thickness, cosine).max_element();
                bound = bound.max((found - grazing) / (1.0 - grazing));
            }
        }
        bound.clamp(0.0, 1.0)
    }
}
