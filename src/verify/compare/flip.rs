//! Two pictures in, out how visible their difference is to the eye when one flips to the other: FLIP, from 0 to 1 (Andersson et al.,
//! FLIP: A Difference Evaluator for Alternating Images, 2020), by a port of NVIDIA's code, version 1.7.
//!
//! Linear pictures are shown at several exposures, of which the worst counts by pixel (Andersson et al., Visualizing Errors in Rendered
//! High Dynamic Range Images, 2021, HDR-FLIP).

use flip_rs::{DEFAULT_PPD, RgbImage, ldr_flip};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::Serialize;

use super::image::Values;
use super::pair::Pair;
use crate::output::colour::{luminance, srgb_code};

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Flip {
    /// Over the pixels that are compared.
    pub mean: f64,
    /// Of the display that the eye is thought to see: 0.7 m from one that has 3840 pixels in 0.7 m.
    pub pixels_per_degree: f32,
    /// Stops at which linear pictures were shown; none of display values.
    pub exposures: Vec<f64>,
    /// By pixel; 0 where pixels are not compared.
    #[serde(skip)]
    pub map: Vec<f32>,
}

/// Rows that are computed as one.
const BAND: usize = 64;
/// How far the filters of this display reach, pixels: three standard deviations of the widest.
const REACH: usize = 10;
/// The tone curve of exposed light x, (a x^2 + b x) / (c x^2 + d x + e): the fit to ACES by Narkowicz (2015) without its exposure of
/// 0.6, as NVIDIA's tool has it.
const ACES: [f64; 5] = [0.36 * 2.51, 0.6 * 0.03, 0.36 * 2.43, 0.6 * 0.59, 0.14];
/// What the tone curve makes of the brightest pixel at the first exposure, and of the median pixel at the last one.
const SHOWN_AS: f64 = 0.85;

impl Flip {
    /// None of a linear reference that is black.
    pub(crate) fn of(pair: &Pair) -> Option<Flip> {
        let exposures = match pair.b.values {
            Values::Display => Vec::new(),
            Values::Linear => exposures(pair)?,
        };
        let (width, height) = (pair.a.width as usize, pair.a.height as usize);
        let shown = |stops: Option<f64>, pixel: usize| {
            // What is not compared is black in both.
            let colour = |pixel: usize, of: &[Vec3]| if pair.is_compared[pixel] { of[pixel] } else { Vec3::ZERO };
            [&pair.b.pixels, &pair.a.pixels].map(|of| codes(colour(pixel, of), stops))
        };
        let band = |first: usize| {
            let rows = first..(first + BAND).min(height);
            let around = first.saturating_sub(REACH)..(rows.end + REACH).min(height);
            let of = |stops: Option<f64>| {
                let both = (around.start * width..around.end * width).map(|pixel| shown(stops, pixel));
                let (reference, test): (Vec<[u8; 3]>, Vec<[u8; 3]>) = both.map(|[reference, test]| (reference, test)).unzip();
                let map = flip([&reference, &test], width, around.len());
                map[(rows.start - around.start) * width..(rows.end - around.start) * width].to_vec()
            };
            if exposures.is_empty() {
                return of(None);
            }
            let worst = |worst: Vec<f32>, next: Vec<f32>| worst.iter().zip(next).map(|(worst, next)| worst.max(next)).collect();
            exposures.iter().map(|stops| of(Some(*stops))).reduce(worst).unwrap_or_default()
        };
        let starts: Vec<usize> = (0..height).step_by(BAND).collect();
        let map: Vec<f32> = starts.into_par_iter().flat_map_iter(band).collect();
        let compared = map.iter().zip(&pair.is_compared).filter(|(_, is_compared)| **is_compared);
        let count = pair.is_compared.len() - pair.left_out.pixels;
        let mean = compared.map(|(value, _)| f64::from(*value)).sum::<f64>() / count as f64;
        Some(Flip { mean, pixels_per_degree: DEFAULT_PPD, exposures, map })
    }
}

/// FLIP of codes by pixel, the reference first.
fn flip(both: [&[[u8; 3]]; 2], width: usize, height: usize) -> Vec<f32> {
    let [reference, test] =
        both.map(|codes| RgbImage::new(width, height, codes.as_flattened().to_vec()).expect("there is a code for each pixel"));
    ldr_flip(&reference, &test, DEFAULT_PPD).expect("pictures of one size are compared").into_pixels()
}

/// What a display shows of a pixel; stops are those of linear values.
fn codes(colour: Vec3, stops: Option<f64>) -> [u8; 3] {
    let code = |value: f32| match stops {
        None => (255.0 * value).round() as u8,
        Some(stops) => {
            let x = f64::from(value).max(0.0) * stops.exp2();
            let [a, b, c, d, e] = ACES;
            srgb_code(((a * x * x + b * x) / (c * x * x + d * x + e)) as f32)
        }
    };
    colour.to_array().map(code)
}

/// Stops from where the reference's brightest pixel is shown as [`SHOWN_AS`] to where its median is, one stop apart or less. Where most
/// of it is black, the median is of what is not.
fn exposures(pair: &Pair) -> Option<Vec<f64>> {
    let compared = pair.b.pixels.iter().zip(&pair.is_compared).filter(|(_, is_compared)| **is_compared);
    let mut luminances: Vec<f32> = compared.map(|(colour, _)| luminance(colour.max(Vec3::ZERO))).collect();
    luminances.sort_by(f32::total_cmp);
    let brightest = *luminances.last().filter(|most| **most > 0.0)?;
    let is_black = |luminance: &f32| *luminance <= 0.0;
    let median = match luminances[luminances.len() / 2] {
        median if !is_black(&median) => median,
        _ => {
            let colours = &luminances[luminances.partition_point(is_black)..];
            colours[colours.len() / 2]
        }
    };
    // The light that the tone curve shows so: the positive root of a quadratic equation.
    let [a, b, c, d, e] = ACES;
    let equation = DVec3::new(a - SHOWN_AS * c, b - SHOWN_AS * d, -SHOWN_AS * e);
    let half = -0.5 * equation.y / equation.x;
    let light = half + (half * half - equation.z / equation.x).sqrt();
    let stops = |luminance: f32| (light / f64::from(luminance)).log2();
    let (first, last) = (stops(brightest), stops(median));
    let count = (last - first).ceil().max(2.0) as usize;
    let step = (last - first) / (count - 1) as f64;
    Some((0..count).map(|k| first + step * k as f64).collect())
}
