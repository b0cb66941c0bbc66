//! Directional albedos of GGX and of sheen, as tables that the kernels interpolate (`glsl/material/albedo.glsl`): a surface's
//! diffuse lobe gets what reflection leaves (Kelemen and Szirmay-Kalos 2001).

use std::f64::consts::PI;
use std::iter::Sum;
use std::ops::Div;
use std::sync::LazyLock;

use glam::{DVec2, DVec3, Vec2};
use rayon::prelude::*;

use crate::constants::{ALBEDO_COSINES, ALBEDO_ROUGHNESSES, DELTA_ALPHA_INVERSE};

const ROUGHNESSES: usize = ALBEDO_ROUGHNESSES as usize;
const COSINES: usize = ALBEDO_COSINES as usize;
/// Of the square of uniform numbers that a direction is sampled by: (towards the normal, about it). With them the albedos of GGX are
/// right to 2e-4.
const STEPS: (usize, usize) = (128, 32);
/// Least alpha of sheen.
const LEAST_SHEEN: f64 = 0.01;

/// Row by row of equal roughness: (A, B) of GGX at the squares of evenly spaced roots of cosines, A with the weight 1 - (1 - v.h)^5 and
/// B with (1 - v.h)^5; then of each roughness the means of both over the hemisphere; then of each pair of roughnesses the means of
/// (A A', A B') and (B A', B B'); then rows of sheen, each twice.
pub(crate) static TABLE: LazyLock<Vec<Vec2>> = LazyLock::new(table);

fn roughness(row: usize) -> f64 {
    row as f64 / (ROUGHNESSES - 1) as f64
}

fn cosine(column: usize) -> f64 {
    let root = column as f64 / (COSINES - 1) as f64;
    root * root
}

fn table() -> Vec<Vec2> {
    let places: Vec<(usize, usize)> = (0..ROUGHNESSES * COSINES).map(|place| (place / COSINES, place % COSINES)).collect();
    let ggx: Vec<DVec2> = places.par_iter().map(|&(row, column)| ggx(roughness(row).powi(2), cosine(column))).collect();
    let sheen: Vec<DVec2> =
        places.par_iter().map(|&(row, column)| DVec2::splat(sheen(roughness(row).powi(2).max(LEAST_SHEEN), cosine(column)))).collect();
    let row = |row: usize| &ggx[row * COSINES..(row + 1) * COSINES];
    let means = (0..ROUGHNESSES).map(|of| mean(|k| row(of)[k]));
    let pairs = (0..ROUGHNESSES * ROUGHNESSES).flat_map(|pair| {
        let (first, second) = (row(pair / ROUGHNESSES), row(pair % ROUGHNESSES));
        [mean(|k| first[k].x * second[k]), mean(|k| first[k].y * second[k])]
    });
    ggx.iter().copied().chain(means).chain(pairs).chain(sheen.iter().copied()).map(DVec2::as_vec2).collect()
}

/// Over the hemisphere, weighted by the cosine, of what is linear in the cosine's root between the columns, as the kernels have it.
fn mean(of_column: impl Fn(usize) -> DVec2) -> DVec2 {
    // 2 c dc = 4 s^3 ds, with s the root; Simpson's rule is exact for that times a line.
    let last = COSINES - 1;
    (0..last)
        .map(|k| {
            let [low, high] = [k, k + 1].map(|column| (column as f64 / last as f64, of_column(column)));
            let middle = (0.5 * (low.0 + high.0), 0.5 * (low.1 + high.1));
            let term = |(root, value): (f64, DVec2)| 4.0 * root.powi(3) * value;
            (term(low) + 4.0 * term(middle) + term(high)) / (6.0 * last as f64)
        })
        .sum()
}

/// Over the unit square, at the middles of its cells.
fn average<T: Sum + Div<f64, Output = T>>(of: impl Fn(f64, f64) -> T) -> T {
    let middle = |step: usize, steps: usize| (step as f64 + 0.5) / steps as f64;
    let cells = STEPS.0 * STEPS.1;
    (0..cells).map(|cell| of(middle(cell / STEPS.1, STEPS.0), middle(cell % STEPS.1, STEPS.1))).sum::<T>() / cells as f64
}

/// By visible normals (Dupuy and Benyoub 2023) on a grid: what is left is the ratio of both maskings to that of the eye's.
fn ggx(alpha: f64, cosine: f64) -> DVec2 {
    let grazing = |cosine: f64| (1.0 - cosine).powi(5);
    if alpha < 1.0 / f64::from(DELTA_ALPHA_INVERSE) {
        return DVec2::new(1.0 - grazing(cosine), grazing(cosine));
    }
    // At the horizon itself the visible normals are those of a direction next to it.
    let cosine = cosine.max(1e-5);
    let v = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
    let stretched = DVec3::new(alpha * v.x, 0.0, v.z).normalize();
    let lambda = |c: f64| (alpha * alpha + (1.0 - alpha * alpha) * c * c).sqrt();
    average(|up, turn| {
        // Squared, as what is lost is lost at the few normals near the horizon: the weight is 2 up.
        let z = up * up * (1.0 + stretched.z) - stretched.z;
        // Both halves of the circle are alike.
        let (sine, azimuth) = ((1.0 - z * z).max(0.0).sqrt(), PI * turn);
        let h = DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), z) + stretched;
        let h = DVec3::new(alpha * h.x, alpha * h.y, h.z.max(0.0)).normalize();
        let along = v.dot(h).max(0.0);
        let l = 2.0 * along * h.z - v.z;
        if l <= 0.0 {
            return DVec2::ZERO;
        }
        // G2 / G1.
        let ratio = l * (cosine + lambda(cosine)) / (l * lambda(cosine) + cosine * lambda(l));
        2.0 * up * ratio * DVec2::new(1.0 - grazing(along), grazing(along))
    })
}

/// The logarithm of sheen's masking, fitted by Estevez and Kulla (2017).
fn sheen_lambda(alpha: f64, cosine: f64) -> f64 {
    let share = 1.0 - (1.0 - alpha).powi(2);
    let fitted = |rough: f64, smooth: f64| smooth + (rough - smooth) * share;
    let [a, b, c] = [fitted(21.5473, 25.3245), fitted(3.82987, 3.32435), fitted(0.19823, 0.16801)];
    let [d, e] = [fitted(-1.97760, -1.27393), fitted(-4.32054, -4.85967)];
    let fit = |x: f64| a / (1.0 + b * x.powf(c)) + d * x + e;
    (if cosine < 0.5 { fit(cosine) } else { 2.0 * fit(0.5) - fit(1.0 - cosine) }).exp()
}

fn sheen(alpha: f64, cosine: f64) -> f64 {
    let cosine = cosine.max(1e-4);
    let v = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
    average(|u, turn| {
        // Cosines are squares, as much happens at the horizon.
        let (z, azimuth) = (u * u, PI * turn);
        let sine = (1.0 - z * z).sqrt();
        let l = DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), z);
        let h = (v + l).normalize();
        let d = (2.0 + 1.0 / alpha) * (1.0 - h.z * h.z).max(0.0).powf(0.5 / alpha) / (2.0 * PI);
        let masking = 1.0 / ((1.0 + sheen_lambda(alpha, cosine) + sheen_lambda(alpha, z)) * 4.0 * z * cosine);
        // Times the cosine, over the density 1 / (2 pi * 2 u).
        d * masking * z * 4.0 * PI * u
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::layered::METALS;
    use crate::common::plates;

    /// (A, B) of GGX as the kernels interpolate them.
    fn looked_up(alpha: f64, cosine: f64) -> DVec2 {
        let (row, column) = (alpha.sqrt() * (ROUGHNESSES - 1) as f64, cosine.sqrt() * (COSINES - 1) as f64);
        let (i, j) = ((row as usize).min(ROUGHNESSES - 2), (column as usize).min(COSINES - 2));
        let at = |i: usize, j: usize| TABLE[i * COSINES + j].as_dvec2();
        let line = |i: usize| at(i, j).lerp(at(i, j + 1), column - j as f64);
        line(i).lerp(line(i + 1), row - i as f64)
    }

    #[test]
    fn albedos_agree_with_quadrature() {
        for (alpha, known) in METALS.into_iter().filter(|(alpha, _)| *alpha > 0.0) {
            for (cosine, known) in plates::COSINES.into_iter().zip(known) {
                let (table, direct) = (looked_up(alpha, cosine).element_sum(), ggx(alpha, cosine).element_sum());
                assert!((direct - known).abs() <= 1e-3 * known, "alpha {alpha}, cosine {cosine}: {direct} instead of {known}");
                assert!((table - known).abs() <= 1e-3 * known, "alpha {alpha}, cosine {cosine}: {table} in the table, not {known}");
            }
        }
        let means = |alpha: f64| {
            let row = alpha.sqrt() * (ROUGHNESSES - 1) as f64;
            let at = |row: usize| TABLE[ROUGHNESSES * COSINES + row].as_dvec2().element_sum();
            at(row as usize) + (at((row as usize + 1).min(ROUGHNESSES - 1)) - at(row as usize)) * row.fract()
        };
        for (alpha, known) in [(0.1, 0.9721), (0.25, 0.8823), (0.5, 0.7002), (1.0, 0.4091)] {
            assert!((means(alpha) - known).abs() <= 1e-3 * known, "alpha {alpha}: {} instead of {known}", means(alpha));
        }
    }

    /// The worst place of the table between its rows and columns: next to the horizon, where a pixel in a thousand of a ball is, the albedo of
    /// smooth surfaces bends most.
    #[test]
    fn the_table_is_fine_enough() {
        let mut worst = [(0.0, 0.0, 0.0); 2];
        for (row, column) in (0..62).flat_map(|row| (0..40).map(move |column| (row, column))) {
            let [alpha, cosine] = [(row, 62.0), (column, 40.0)].map(|(step, steps)| ((f64::from(step) + 0.5) / steps).powi(2));
            if alpha >= 1.0 / f64::from(DELTA_ALPHA_INVERSE) {
                let off = (looked_up(alpha, cosine) - ggx(alpha, cosine)).abs().max_element();
                let worst = &mut worst[usize::from(cosine < 0.03)];
                *worst = if off > worst.0 { (off, alpha, cosine) } else { *worst };
            }
        }
        assert!(worst[0].0 < 5e-3 && worst[1].0 < 0.02, "{worst:?}");
    }

    /// The kernels divide by what the table has above 1.
    #[test]
    fn only_smooth_sheen_returns_more_than_it_receives() {
        for place in 0..ROUGHNESSES * COSINES {
            let albedo = TABLE[TABLE.len() - ROUGHNESSES * COSINES + place].x;
            let is_smooth = roughness(place / COSINES) < 0.3;
            assert!(albedo >= 0.0 && (is_smooth || albedo <= 1.0), "{place}: {albedo}");
        }
    }
}
