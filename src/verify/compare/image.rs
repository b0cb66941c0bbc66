//! A picture that is compared: a file in, its pixels out.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use glam::Vec3;
use image::codecs::png::PngDecoder;
use image::{DynamicImage, ImageDecoder, Limits};
use serde::Serialize;

use crate::scene::file;
use crate::scene::linear_image::{self, LinearImage, MAX_TEXELS};

const PNG_MAGIC: &[u8] = b"\x89PNG";

/// What the numbers of a picture mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Values {
    /// Radiance, or what else is proportional to light: .exr, .hdr.
    Linear,
    /// sRGB codes as a display takes them, from 0 to 1: .png.
    Display,
}

/// Row by row from the top.
#[derive(Debug, Clone)]
pub(crate) struct Image {
    /// As the user named it.
    pub path: PathBuf,
    pub width: u32,
    pub height: u32,
    pub values: Values,
    pub pixels: Vec<Vec3>,
    /// What of the file is not compared, or not as it is.
    pub warnings: Vec<&'static str>,
}

impl Image {
    /// Reads a file; an error says what is wrong with it, and what to do.
    pub(crate) fn read(path: &Path) -> Result<Image, String> {
        let content = file::read(path)?;
        let path = path.to_owned();
        if linear_image::is_one(&content) {
            let LinearImage { width, height, mut colours, exposure, has_alpha } = LinearImage::decode(content)?;
            colours.iter_mut().for_each(|colour| *colour /= exposure);
            return Ok(Image { path, width, height, values: Values::Linear, pixels: colours, warnings: warnings(has_alpha, false) });
        }
        if content.starts_with(PNG_MAGIC) {
            let mut limits = Limits::default();
            limits.max_alloc = Some(16 * MAX_TEXELS);
            let decoder = PngDecoder::with_limits(Cursor::new(&content), limits).map_err(linear_image::undecodable)?;
            let (width, height) = decoder.dimensions();
            linear_image::check_size(width, height)?;
            let colour = decoder.color_type();
            let decoded = DynamicImage::from_decoder(decoder).map_err(linear_image::undecodable)?;
            // Codes of 8 bits become multiples of 257, so that equal colours are equal whatever holds them.
            let pixels = decoded.into_rgb16().pixels().map(|pixel| Vec3::from(pixel.0.map(f32::from)) / 65535.0).collect();
            let warnings = warnings(colour.has_alpha(), !colour.has_color());
            return Ok(Image { path, width, height, values: Values::Display, pixels, warnings });
        }
        if content.is_empty() {
            return Err("is empty; write it again".into());
        }
        Err("is no OpenEXR (.exr), Radiance (.hdr) or PNG picture; convert it to one of them".into())
    }

    /// Where a pixel is: its column and row, from 0 at the upper left.
    pub(crate) fn place(&self, pixel: usize) -> [u32; 2] {
        [pixel as u32 % self.width, pixel as u32 / self.width]
    }

    pub(crate) fn size(&self) -> String {
        format!("{} x {}", self.width, self.height)
    }
}

fn warnings(has_alpha: bool, is_grey: bool) -> Vec<&'static str> {
    let alpha = has_alpha.then_some("its alpha channel is ignored");
    let grey = is_grey.then_some("it is grey, and compared as three equal channels");
    alpha.into_iter().chain(grey).collect()
}
