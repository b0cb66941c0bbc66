//! Two pictures that can be compared, in and out, with the pixels that are.

use glam::Vec3;
use serde::Serialize;

use super::image::{Image, Values};
use crate::error::{Error, Result};

/// Both pictures have the same size and the same kind of values, and at least one pixel is finite in both.
pub(crate) struct Pair<'a> {
    pub a: &'a Image,
    /// The reference.
    pub b: &'a Image,
    /// By pixel.
    pub is_compared: Vec<bool>,
    pub left_out: LeftOut,
}

/// Pixels of which a channel is NaN or infinite, and which are not compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(crate) struct LeftOut {
    /// Of the first picture, of the reference, and of one or the other.
    pub a: usize,
    pub b: usize,
    pub pixels: usize,
}

/// A channel of a pixel, in both pictures.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Value {
    pub pixel: usize,
    pub channel: usize,
    pub a: f64,
    pub b: f64,
}

impl<'a> Pair<'a> {
    pub(crate) fn new(a: &'a Image, b: &'a Image) -> Result<Pair<'a>> {
        let refuse = |reason: String| Error::Image { path: a.path.clone(), reason };
        let named = b.path.display();
        if a.values != b.values {
            let kind = |picture: &Image| match picture.values {
                Values::Linear => "linear values",
                Values::Display => "display values",
            };
            let (of_a, of_b) = (kind(a), kind(b));
            return Err(refuse(format!(
                "has {of_a} and {named} has {of_b}, which cannot be compared; compare two .exr (or .hdr) or two .png pictures"
            )));
        }
        if (a.width, a.height) != (b.width, b.height) {
            let (of_a, of_b) = (a.size(), b.size());
            return Err(refuse(format!("is {of_a} and {named} is {of_b} pixels; compare pictures of the same size")));
        }
        let is_finite = |picture: &Image| picture.pixels.iter().map(|pixel| pixel.is_finite()).collect::<Vec<bool>>();
        let (finite_a, finite_b) = (is_finite(a), is_finite(b));
        let is_compared: Vec<bool> = finite_a.iter().zip(&finite_b).map(|(a, b)| *a && *b).collect();
        let missing = |of: &[bool]| of.iter().filter(|is_there| !**is_there).count();
        let left_out = LeftOut { a: missing(&finite_a), b: missing(&finite_b), pixels: missing(&is_compared) };
        if left_out.pixels == is_compared.len() {
            return Err(refuse(format!("has no pixel that is finite in both it and {named}; write both pictures again")));
        }
        Ok(Pair { a, b, is_compared, left_out })
    }

    /// Every channel of every pixel that is compared.
    pub(crate) fn values(&self) -> impl Iterator<Item = Value> {
        let pixels = self.a.pixels.iter().zip(&self.b.pixels).enumerate().filter(|(pixel, _)| self.is_compared[*pixel]);
        pixels.flat_map(|(pixel, (a, b))| {
            let of = |colour: &Vec3, channel: usize| f64::from(colour[channel]);
            (0..3).map(move |channel| Value { pixel, channel, a: of(a, channel), b: of(b, channel) })
        })
    }
}
