//! Directional albedos of GGX reflection and of sheen by quadrature, in tables that are made once.

use std::array;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::LazyLock;

use glam::DVec4;

use super::microfacets::{ggx_visibility, is_delta, schlick, sheen_distribution, sheen_masking};
use crate::constants::DELTA_ALPHA_INVERSE;

/// Albedos at a cosine: A and B of the guide's page on materials.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GgxAlbedo {
    /// Of D V (1 - (1 - v.h)^5).
    pub a: f64,
    /// Of D V (1 - v.h)^5.
    pub b: f64,
}

/// Places and weights of Gauss-Legendre quadrature over [0, 1].
pub(crate) fn gauss_legendre(count: usize) -> Vec<(f64, f64)> {
    let n = count as f64;
    let node = |k: usize| {
        let mut x = (PI * (k as f64 + 0.75) / (n + 0.5)).cos();
        // Newton's method gains digits fourfold to a hundredfold a step from so near a place.
        let mut slope = 0.0;
        for _ in 0..8 {
            let (mut value, mut before) = (1.0, 0.0);
            for degree in 0..count {
                let j = degree as f64;
                (value, before) = (((2.0 * j + 1.0) * x * value - j * before) / (j + 1.0), value);
            }
            slope = n * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
        }
        (0.5 - 0.5 * x, 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..count).map(node).collect()
}

/// Sums `of`(v.h, l.n, half vector's polar angle) over the half vectors whose mirror directions l lie above the surface. `polar`
/// makes places in [0, 1] and the largest angle into angles with their weights.
fn over_half_vectors(cosine: f64, azimuths: &[(f64, f64)], polar: impl Fn(f64) -> Vec<(f64, f64)>, mut of: impl FnMut(f64, f64, f64, f64)) {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    // Either half of the half circle for itself, graded towards the middle: for an eye at the horizon all light comes from one.
    let scale = cosine.clamp(LEAST_COSINE, 1.0);
    for (side, (place, weight)) in [1.0, -1.0].into_iter().flat_map(|side| azimuths.iter().map(move |node| (side, *node))) {
        let off = of_graded(place, scale);
        let along = side * (FRAC_PI_2 * off).sin() * sine;
        // The derivative, both halves of the circle, and a quarter of it.
        let weight = weight * (scale + off) * scale.recip().ln_1p() * 2.0 * FRAC_PI_2;
        // l.n = 2 (v.h)(n.h) - v.n vanishes there.
        let most = 0.25 * PI + 0.5 * along.atan2(cosine);
        for (angle, share) in polar(most) {
            let (sin, cos) = angle.sin_cos();
            let v_h = along * sin + cosine * cos;
            of(v_h, 2.0 * v_h * cos - cosine, angle, weight * share);
        }
    }
}

/// Albedos at this cosine and alpha, by quadrature.
fn ggx_quadrature(cosine: f64, alpha: f64, azimuths: &[(f64, f64)], polar: &[(f64, f64)]) -> GgxAlbedo {
    // tan(angle) = alpha tan(psi) makes D cos(angle) into 2 sin(psi) cos(psi) / 2 pi. Of psi's range light near the horizon has a
    // share of this size.
    let scale = alpha * cosine.max(0.01);
    let angles = |most: f64| {
        let most = (most.tan() / alpha).atan();
        let angle = |(place, weight): &(f64, f64)| {
            let short = of_graded(*place, scale);
            let (sin, cos) = ((1.0 - short) * most).sin_cos();
            ((alpha * sin / cos).atan(), weight * (scale + short) * scale.recip().ln_1p() * most * sin * cos / PI)
        };
        polar.iter().map(angle).collect()
    };
    let mut sums = GgxAlbedo { a: 0.0, b: 0.0 };
    over_half_vectors(cosine, azimuths, angles, |v_h, l_n, angle, weight| {
        if l_n > 0.0 {
            let term = weight * 4.0 * ggx_visibility(alpha, cosine, l_n) * v_h * l_n / angle.cos();
            sums.a += term * (1.0 - schlick(v_h));
            sums.b += term * schlick(v_h);
        }
    });
    sums
}

/// Albedo of sheen of colour 1 at this cosine.
fn sheen_quadrature(cosine: f64, s: f64, azimuths: &[(f64, f64)], polar: &[(f64, f64)]) -> f64 {
    let angles = |most: f64| polar.iter().map(|(place, weight)| (most * place, most * weight)).collect();
    let masked_eye = sheen_masking(s, cosine);
    let mut sum = 0.0;
    over_half_vectors(cosine, azimuths, angles, |v_h, l_n, angle, weight| {
        if l_n > 0.0 {
            let sin = angle.sin();
            sum += weight * sheen_distribution(s, sin * sin) * v_h * sin / ((1.0 + masked_eye + sheen_masking(s, l_n)) * cosine);
        }
    });
    sum
}

/// Values at equal distances over a square, in rows, of `N` functions.
struct Table<const N: usize> {
    values: [Vec<f64>; N],
    columns: usize,
    rows: usize,
}

impl<const N: usize> Table<N> {
    /// Of functions of two coordinates in [0, 1].
    fn new(columns: usize, rows: usize, of: impl Fn(f64, f64) -> [f64; N]) -> Table<N> {
        let place = |index: usize, count: usize| index as f64 / (count - 1) as f64;
        let of_all: Vec<[f64; N]> =
            (0..columns * rows).map(|index| of(place(index % columns, columns), place(index / columns, rows))).collect();
        Table { values: array::from_fn(|k| of_all.iter().map(|values| values[k]).collect()), columns, rows }
    }

    /// The cubic polynomial through the four nearest values along each axis.
    fn at(&self, x: f64, y: f64) -> [f64; N] {
        let ((column, across), (row, down)) = (cubic(x, self.columns), cubic(y, self.rows));
        self.values.each_ref().map(|values| {
            let along = |j: usize| DVec4::from_slice(&values[(row + j) * self.columns + column..]).dot(across);
            DVec4::new(along(0), along(1), along(2), along(3)).dot(down)
        })
    }
}

/// The first of four places next to a coordinate in [0, 1], and Lagrange's weights.
fn cubic(coordinate: f64, count: usize) -> (usize, DVec4) {
    let at = coordinate.clamp(0.0, 1.0) * (count - 1) as f64;
    let first = (at.floor() as usize).saturating_sub(1).min(count - 4);
    let t = at - first as f64;
    let [a, b, c, d] = [t, t - 1.0, t - 2.0, t - 3.0];
    (first, DVec4::new(-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0))
}

/// A coordinate that has steps of `scale` near 0 and even ratios above.
fn graded(value: f64, scale: f64) -> f64 {
    (value / scale).ln_1p() / scale.recip().ln_1p()
}

fn of_graded(coordinate: f64, scale: f64) -> f64 {
    scale * (coordinate * scale.recip().ln_1p()).exp_m1()
}

/// Rows lie at even distances of the eighth root, denser near 1 than by ratios.
fn row(value: f64, least: f64) -> f64 {
    let [value, least] = [value, least].map(|value| value.powf(0.125));
    (value - least) / (1.0 - least)
}

fn of_row(coordinate: f64, least: f64) -> f64 {
    let least = least.powf(0.125);
    (least + coordinate * (1.0 - least)).powi(8)
}

const LEAST_ALPHA: f64 = 1.0 / DELTA_ALPHA_INVERSE as f64;
/// Near the horizon albedos change over this share of alpha.
const LAYER: f64 = 0.05;

/// By cosine and alpha: what is lost of 1, and what roughness adds to (1 - cosine)^5.
static GGX: LazyLock<Table<2>> = LazyLock::new(|| {
    let (azimuths, polar) = (gauss_legendre(8), gauss_legendre(18));
    Table::new(80, 32, |x, y| {
        let alpha = of_row(y, LEAST_ALPHA);
        let cosine = of_graded(x, LAYER * alpha);
        let GgxAlbedo { a, b } = ggx_quadrature(cosine, alpha, &azimuths, &polar);
        [1.0 - a - b, b - schlick(cosine)]
    })
});

const LEAST_SHEEN: f64 = 0.01;
/// No cosine is below this one: the formula has no bound there.
const LEAST_COSINE: f64 = 1e-4;
const SHEEN_LAYER: f64 = 3e-4;

static SHEEN: LazyLock<Table<1>> = LazyLock::new(|| {
    let (azimuths, polar) = (gauss_legendre(11), gauss_legendre(34));
    Table::new(64, 24, |x, y| {
        let cosine = of_graded(x, SHEEN_LAYER).max(LEAST_COSINE);
        [sheen_quadrature(cosine, of_row(y, LEAST_SHEEN), &azimuths, &polar)]
    })
});

/// A and B at this cosine and alpha.
pub(crate) fn ggx(cosine: f64, alpha: f64) -> GgxAlbedo {
    let cosine = cosine.clamp(0.0, 1.0);
    if is_delta(alpha) {
        return GgxAlbedo { a: 1.0 - schlick(cosine), b: schlick(cosine) };
    }
    let [loss, added] = GGX.at(graded(cosine, LAYER * alpha), row(alpha, LEAST_ALPHA));
    let b = schlick(cosine) + added;
    GgxAlbedo { a: 1.0 - loss - b, b }
}

/// Albedo of sheen of colour 1, from s = roughness^2.
pub(crate) fn sheen(cosine: f64, s: f64) -> f64 {
    let [albedo] = SHEEN.at(graded(cosine.max(LEAST_COSINE), SHEEN_LAYER), row(s, LEAST_SHEEN));
    albedo
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::judge::{random, uniform};

    #[test]
    fn tables_have_what_quadrature_says() {
        let fine = (gauss_legendre(60), gauss_legendre(80));
        let mut rng = random(1, 1);
        let (mut ggx_off, mut sheen_off) = (0.0f64, 0.0f64);
        for _ in 0..600 {
            let [u, v] = [(); 2].map(|()| uniform(&mut rng));
            // No eye sees less than 0.01, half of them at the horizon.
            let cosine = if v < 0.5 { 0.01 + 1.98 * v } else { 0.01f64.powf(2.0 * v - 1.0) };
            let alpha = LEAST_ALPHA.powf(u);
            let (exact, table) = (ggx_quadrature(cosine, alpha, &fine.0, &fine.1), ggx(cosine, alpha));
            ggx_off = ggx_off.max((exact.a - table.a).abs()).max((exact.b - table.b).abs());
            let s = LEAST_SHEEN.powf(u);
            sheen_off = sheen_off.max((sheen_quadrature(cosine, s, &fine.0, &fine.1) - sheen(cosine, s)).abs());
        }
        println!("largest differences: reflection {ggx_off:.1e}, sheen {sheen_off:.1e}");
        assert!(ggx_off < 1e-4 && sheen_off < 1e-4, "{ggx_off} {sheen_off}");
    }

    #[test]
    fn quadrature_is_exact_for_polynomials() {
        for count in [4, 15, 80] {
            let sum = |power: i32| gauss_legendre(count).iter().map(|(place, weight)| weight * place.powi(power)).sum::<f64>();
            for power in 0..8 {
                assert!((sum(power) - 1.0 / f64::from(power + 1)).abs() < 1e-14, "{count} {power}");
            }
        }
    }
}
