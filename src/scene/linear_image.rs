//! A picture of linear radiance: the content of a Radiance (.hdr) or OpenEXR (.exr) file in, its pixels out.

use std::io::Cursor;

use exr::meta::MetaData;
use glam::Vec3;
use image::codecs::hdr::HdrDecoder;
use image::codecs::openexr::OpenExrDecoder;
use image::{ColorType, ExtendedColorType, ImageDecoder};

use crate::text::echo;

/// First bytes of a Radiance file, and of an OpenEXR file.
const RADIANCE_MAGIC: &[u8] = b"#?";
const EXR_MAGIC: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

/// Of one picture: half of what all textures together may have.
pub(crate) const MAX_TEXELS: u64 = 65_000_000;

/// Row by row from the top.
pub(crate) struct LinearImage {
    pub width: u32,
    pub height: u32,
    pub colours: Vec<Vec3>,
    /// What the colours were multiplied by.
    pub exposure: f32,
    /// Whether there was an alpha channel, which is not read.
    pub has_alpha: bool,
}

/// Whether this is the content of such a file.
pub(crate) fn is_one(content: &[u8]) -> bool {
    [RADIANCE_MAGIC, EXR_MAGIC].iter().any(|magic| content.starts_with(magic))
}

impl LinearImage {
    /// An error says what is wrong with the file, and what to do.
    pub(crate) fn decode(mut content: Vec<u8>) -> Result<LinearImage, String> {
        if !content.starts_with(RADIANCE_MAGIC) {
            check_layers(&content, MAX_TEXELS)?;
            let decoder = OpenExrDecoder::with_alpha_preference(Cursor::new(&content), Some(false)).map_err(undecodable)?;
            let has_alpha = decoder.original_color_type() == ExtendedColorType::Rgba32F;
            let (width, height, colours) = decoded(decoder)?;
            return Ok(LinearImage { width, height, colours, exposure: 1.0, has_alpha });
        }
        let header = RadianceHeader::parse(&content)?;
        // As the library has it.
        content.splice(..header.length, format!("#?RADIANCE\n\n-Y {} +X {}\n", header.height, header.width).into_bytes());
        let (width, height, mut colours) = decoded(HdrDecoder::new(content.as_slice()).map_err(undecodable)?)?;
        if header.is_upside_down {
            let rows: Vec<Vec3> = colours.chunks(width as usize).rev().flatten().copied().collect();
            colours = rows;
        }
        if header.is_mirrored {
            colours.chunks_mut(width as usize).for_each(<[Vec3]>::reverse);
        }
        Ok(LinearImage { width, height, colours, exposure: header.exposure, has_alpha: false })
    }
}

/// The lines before a Radiance file's pixels.
struct RadianceHeader {
    width: u32,
    height: u32,
    is_upside_down: bool,
    is_mirrored: bool,
    /// What its values were multiplied by.
    exposure: f32,
    /// Bytes.
    length: usize,
}

impl RadianceHeader {
    fn parse(content: &[u8]) -> Result<RadianceHeader, String> {
        let mut rest = content;
        let mut next_line = || -> Result<String, String> {
            let end = rest.iter().position(|byte| *byte == b'\n').ok_or(CUT_OFF)?;
            let line = String::from_utf8_lossy(&rest[..end]).trim().to_owned();
            rest = &rest[end + 1..];
            Ok(line)
        };
        let mut exposure = 1.0f32;
        loop {
            let line = next_line()?;
            if line.is_empty() {
                break;
            }
            match line.split_once('=').map(|(name, value)| (name.trim(), value.trim())) {
                Some(("FORMAT", format)) if format != "32-bit_rle_rgbe" => {
                    return Err(format!("has pixels of the format {}; only 32-bit_rle_rgbe is read: convert it to RGB", echo(format)));
                }
                Some(("EXPOSURE", value)) => {
                    exposure *= value.parse::<f32>().unwrap_or(f32::NAN);
                    if !(exposure.is_normal() && exposure > 0.0) {
                        return Err(format!("has the line EXPOSURE={}; the product of all must be above 0 and finite", echo(value)));
                    }
                }
                _ => {}
            }
        }
        let size = next_line()?;
        let words: Vec<&str> = size.split_whitespace().collect();
        let (height, width) = match words[..] {
            ["-Y" | "+Y", height, "-X" | "+X", width] => (height.parse().ok(), width.parse().ok()),
            _ => (None, None),
        };
        let (Some(height), Some(width)) = (height, width) else {
            return Err(format!("has the size '{}'; it must be as -Y 512 +X 1024: save it again, row by row", echo(&size)));
        };
        let length = content.len() - rest.len();
        Ok(RadianceHeader { width, height, is_upside_down: words[0] == "+Y", is_mirrored: words[2] == "-X", exposure, length })
    }
}

const CUT_OFF: &str = "is cut off; export it again";

/// In plain words, or the library's.
pub(crate) fn undecodable(error: image::ImageError) -> String {
    let text = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    if text.contains("whole buffer") || text.contains("missing bytes") || text.contains("EOF") {
        return CUT_OFF.into();
    }
    if text.contains("rgb channels") {
        return "has no layer of plain names R, G and B; export it as an OpenEXR picture of a single layer".into();
    }
    format!("cannot be decoded ({text}); convert it, or export it again")
}

/// Refuses what would not fit.
pub(crate) fn check_size(width: u32, height: u32) -> Result<(), String> {
    let is_allowed = width > 0 && height > 0 && u64::from(width) * u64::from(height) <= MAX_TEXELS;
    if is_allowed { Ok(()) } else { Err(format!("is {width} x {height}; allowed are 1 to {MAX_TEXELS} pixels")) }
}

/// Refuses an OpenEXR of which some layer has more pixels, whatever size the picture claims: memory is taken for what a layer claims.
pub(crate) fn check_layers(content: &[u8], most: u64) -> Result<(), String> {
    // What is wrong with another file, its decoder says.
    let Ok(metadata) = MetaData::read_from_buffered(content, false) else { return Ok(()) };
    let sizes = metadata.headers.iter().map(|header| (header.layer_size.0 as u64, header.layer_size.1 as u64));
    match sizes.into_iter().find(|(width, height)| width.saturating_mul(*height) > most) {
        Some((width, height)) => Err(format!("has a layer of {width} x {height}; allowed are 1 to {most} pixels")),
        None => Ok(()),
    }
}

/// Width, height and pixels.
fn decoded(mut decoder: impl ImageDecoder) -> Result<(u32, u32, Vec<Vec3>), String> {
    let (width, height) = decoder.dimensions();
    check_size(width, height)?;
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(16 * MAX_TEXELS + (64 << 20));
    decoder.set_limits(limits).map_err(undecodable)?;
    if decoder.color_type() != ColorType::Rgb32F {
        return Err("has no colours; convert it to RGB".into());
    }
    let mut colours = vec![Vec3::ZERO; width as usize * height as usize];
    decoder.read_image(bytemuck::cast_slice_mut(&mut colours)).map_err(undecodable)?;
    Ok((width, height, colours))
}
