//! Colour pictures: linear floats as EXR, or for the eye as PNG.

use std::io::Cursor;
use std::path::Path;

use glam::Vec3;
use png::ColorType;

use super::exr_file::{self, channels};
use super::metadata::Metadata;
use crate::error::{Error, Result};
use crate::scene::Texture;
use crate::scene::texture::Texels;

/// File formats, by the name's extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// 8 bits, values from 0 to 1 as they are: the paper's illumination is a display value.
    Png,
    /// 32-bit floats, values not clamped.
    Exr,
}

impl Format {
    pub fn of(option: &'static str, path: &Path) -> Result<Format> {
        match path.extension().and_then(|extension| extension.to_str()).map(str::to_lowercase).as_deref() {
            Some("png") => Ok(Format::Png),
            Some("exr") => Ok(Format::Exr),
            _ => Err(Error::setting(option, path.display(), "must be a file name that ends in .png or .exr")),
        }
    }
}

/// What becomes of values from 0 to any size where a picture shows 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tone {
    /// Highlights are compressed and lose their colour, the rest keeps it: the Khronos PBR Neutral tone mapper (Khronos Group 2024).
    #[default]
    Neutral,
    /// What exceeds 1 is cut off.
    Linear,
}

impl Tone {
    fn of(self, colour: Vec3) -> Vec3 {
        if self == Tone::Linear {
            return colour;
        }
        /// Where compression begins, less a surface's reflection at normal incidence, which is taken off.
        const FRESNEL: f32 = 0.04;
        const START: f32 = 0.8 - FRESNEL;
        const DESATURATION: f32 = 0.15;
        let colour = if colour.is_finite() { colour.max(Vec3::ZERO) } else { return colour };
        let least = colour.min_element();
        let offset = if least < 2.0 * FRESNEL { least - least * least / (4.0 * FRESNEL) } else { FRESNEL };
        let colour = colour - offset;
        let peak = colour.max_element();
        if peak < START {
            return colour;
        }
        let rest = 1.0 - START;
        let new_peak = 1.0 - rest * rest / (peak + rest - START);
        let white = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
        (colour * (new_peak / peak)).lerp(Vec3::splat(new_peak), white)
    }
}

/// Row by row from the top, linear scene-referred values.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ColourImage {
    pub width: u32,
    pub height: u32,
    pub pixels: Vec<Vec3>,
}

impl ColourImage {
    /// `stops` doubles the brightness of a PNG so many times, before the tone curve; an EXR holds the values untouched.
    pub(crate) fn encode(&self, format: Format, stops: f32, tone: Tone, metadata: Option<&Metadata>) -> Vec<u8> {
        match format {
            Format::Exr => {
                exr_file::encode((self.width, self.height), channels("", ["R", "G", "B"], self.pixels.iter().copied()), metadata)
            }
            Format::Png => {
                let codes: Vec<u8> = srgb_codes(self.pixels.iter().map(|pixel| tone.of(*pixel * stops.exp2())));
                eight_bits(self.width, self.height, ColorType::Rgb, &codes, metadata)
            }
        }
    }

    /// Stops that bring the mean luminance of what is not brighter than ten times the median to a
    /// middle grey of 0.18.
    pub(crate) fn usual_exposure(&self) -> f32 {
        let mut luminances: Vec<f32> = self.pixels.iter().map(|pixel| luminance(*pixel)).filter(|luminance| *luminance > 0.0).collect();
        if luminances.is_empty() {
            return 0.0;
        }
        luminances.sort_by(f32::total_cmp);
        let median = luminances[luminances.len() / 2];
        let usual: Vec<f64> =
            luminances.iter().filter(|luminance| **luminance <= 10.0 * median).map(|luminance| f64::from(*luminance)).collect();
        let mean = usual.iter().sum::<f64>() / usual.len() as f64;
        (0.18 / mean).log2() as f32
    }
}

/// Three 32-bit float channels, values untouched, row by row.
pub(crate) fn exr(width: u32, height: u32, values: &[Vec3]) -> Vec<u8> {
    exr_file::encode((width, height), channels("", ["R", "G", "B"], values.iter().copied()), None)
}

/// A texture, with its own codes where it has some; without alpha where that is 1.
pub(crate) fn texture_png(texture: &Texture) -> Vec<u8> {
    let (width, height) = (texture.width, texture.height);
    match &texture.texels {
        Texels::Srgb(codes) | Texels::Linear(codes) if codes.iter().any(|code| code[3] < 255) => {
            eight_bits(width, height, ColorType::Rgba, codes.as_flattened(), None)
        }
        Texels::Srgb(codes) | Texels::Linear(codes) => {
            let codes: Vec<u8> = codes.iter().flat_map(|[red, green, blue, _]| [*red, *green, *blue]).collect();
            eight_bits(width, height, ColorType::Rgb, &codes, None)
        }
        texels => png(width, height, (0..texels.count()).map(|place| texels.at(place).truncate())),
    }
}

/// Linear values as 8-bit sRGB, clamped to 0 to 1.
pub(crate) fn png(width: u32, height: u32, values: impl Iterator<Item = Vec3>) -> Vec<u8> {
    let codes = srgb_codes(values);
    eight_bits(width, height, ColorType::Rgb, &codes, None)
}

/// Linear values as they are in 8 bits, clamped to 0 to 1.
pub(crate) fn linear_png(width: u32, height: u32, values: impl Iterator<Item = Vec3>) -> Vec<u8> {
    let codes: Vec<u8> = values.flat_map(|value| value.to_array().map(|channel| (channel.clamp(0.0, 1.0) * 255.0).round() as u8)).collect();
    eight_bits(width, height, ColorType::Rgb, &codes, None)
}

/// Codes as they are.
pub(crate) fn png_of_codes(width: u32, height: u32, codes: &[[u8; 3]]) -> Vec<u8> {
    eight_bits(width, height, ColorType::Rgb, codes.as_flattened(), None)
}

fn srgb_codes(values: impl Iterator<Item = Vec3>) -> Vec<u8> {
    values.flat_map(|value| value.to_array().map(srgb_code)).collect()
}

/// A PNG of codes of 8 bits, row by row.
pub(super) fn eight_bits(width: u32, height: u32, kind: ColorType, codes: &[u8], metadata: Option<&Metadata>) -> Vec<u8> {
    let mut file = Vec::new();
    write_png(&mut file, (width, height), kind, codes, metadata).expect("a picture in memory can be encoded");
    file
}

fn write_png(
    file: &mut Vec<u8>,
    (width, height): (u32, u32),
    kind: ColorType,
    codes: &[u8],
    metadata: Option<&Metadata>,
) -> std::result::Result<(), png::EncodingError> {
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(kind);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Balanced);
    encoder.set_filter(png::Filter::Adaptive);
    for (keyword, text) in metadata.into_iter().flat_map(Metadata::texts) {
        match text.is_ascii() {
            true => encoder.add_text_chunk(keyword.to_owned(), text)?,
            false => encoder.add_itxt_chunk(keyword.to_owned(), text)?,
        }
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(codes)?;
    writer.finish()
}

/// The codes of a PNG of 8 bits.
pub(crate) fn png_codes(content: &[u8]) -> std::result::Result<Vec<u8>, String> {
    let unreadable = |error: png::DecodingError| format!("cannot be read as PNG ({error})");
    let mut reader = png::Decoder::new(Cursor::new(content)).read_info().map_err(unreadable)?;
    let size = reader.output_buffer_size().ok_or("is too large to be read")?;
    let mut codes = vec![0; size];
    let size = reader.next_frame(&mut codes).map_err(unreadable)?.buffer_size();
    codes.truncate(size);
    Ok(codes)
}

/// Relative luminance of linear sRGB.
pub(crate) fn luminance(colour: Vec3) -> f32 {
    colour.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// The sRGB transfer function (IEC 61966-2-1), from linear to 8-bit code.
pub(crate) fn srgb_code(linear: f32) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_meet_the_standard() {
        assert_eq!([0.0, 1.0, 2.0, 0.5, 0.18].map(srgb_code), [0, 255, 255, 188, 118]);
        assert_eq!([f32::NAN, -1.0, f32::INFINITY].map(srgb_code), [0, 0, 255]);
        for code in 0..=255 {
            assert_eq!(srgb_code(crate::scene::texture::linear_of_srgb(code)), code);
        }
    }

    /// Values of the specification's formula, by hand.
    #[test]
    fn the_tone_curve_is_the_published_one() {
        let near = |colour: [f32; 3], expected: [f32; 3]| {
            let found = Tone::Neutral.of(Vec3::from(colour));
            assert!((found - Vec3::from(expected)).abs().max_element() < 1e-4, "{colour:?}: {found}");
        };
        near([0.0; 3], [0.0; 3]);
        near([0.04; 3], [0.01; 3]);
        near([0.5, 0.3, 0.18], [0.46, 0.26, 0.14]);
        near([0.8; 3], [0.76; 3]);
        // 1.96 less START leaves 1.2: 1 - 0.24^2 / (1.2 + 0.24).
        near([2.0; 3], [0.96; 3]);
        // Pure red of 100 loses its colour.
        near([100.0, 0.0, 0.0], [0.99942, 0.93637, 0.93637]);
        let values: Vec<f32> = (0..10_000).map(|k| Tone::Neutral.of(Vec3::splat(0.01 * k as f32)).x).collect();
        assert!(values.is_sorted() && values.iter().all(|value| *value < 1.0));
        assert_eq!(Tone::Linear.of(Vec3::splat(7.0)), Vec3::splat(7.0));
    }

    #[test]
    fn formats_follow_the_name() {
        assert_eq!(Format::of("-o", Path::new("a.PNG")).unwrap(), Format::Png);
        assert_eq!(Format::of("-o", Path::new("b/a.exr")).unwrap(), Format::Exr);
        assert!(Format::of("-o", Path::new("a.jpg")).is_err());
    }

    #[test]
    fn exr_values_come_back_untouched() {
        let pixels = vec![Vec3::new(0.0, 1e-6, 12345.678), Vec3::splat(3.0)];
        let picture = ColourImage { width: 2, height: 1, pixels: pixels.clone() };
        let read = image::load_from_memory(&picture.encode(Format::Exr, 5.0, Tone::Neutral, None)).unwrap().into_rgb32f();
        let values: Vec<f32> = pixels.iter().flat_map(Vec3::to_array).collect();
        assert_eq!(read.into_raw(), values);
    }

    #[test]
    fn usual_exposure_brings_a_grey_wall_to_the_middle() {
        let picture = ColourImage { width: 10, height: 1, pixels: [vec![Vec3::splat(4.0); 9], vec![Vec3::splat(1e6)]].concat() };
        assert!((4.0 * picture.usual_exposure().exp2() - 0.18).abs() < 1e-5);
        assert_eq!(ColourImage { width: 1, height: 1, pixels: vec![Vec3::ZERO] }.usual_exposure(), 0.0);
    }
}
