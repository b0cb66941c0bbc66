//! Pictures in KTX 2 containers that Basis Universal has compressed (KHR_texture_basisu).

use basisu::{DecodeFlags, TargetFormat, Transcoder};
use image::RgbaImage;

/// Whether a file begins as such pictures do.
pub(super) fn is_one(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xabKTX 20\xbb\r\n\x1a\n")
}

/// Width and height, or what is wrong with it.
pub(super) fn dimensions(bytes: &[u8]) -> Result<(u32, u32), String> {
    // Of the head: to open the container takes the time of unpacking it.
    let number = |at: usize| bytes.get(at..at + 4).map(|bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
    match (number(20), number(24)) {
        (Some(width), Some(height)) if width > 0 && height > 0 => Ok((width, height)),
        _ => Err("its size is missing".into()),
    }
}

/// Its largest level.
pub(super) fn decoded(bytes: &[u8]) -> Result<RgbaImage, String> {
    let transcoder = Transcoder::new(bytes).map_err(|error| format!("{error:?}"))?;
    let (width, height) = transcoder.base_dimensions();
    let texels = transcoder.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(|error| format!("{error:?}"))?;
    RgbaImage::from_raw(width, height, texels).ok_or_else(|| "it has not as many texels as it says".into())
}
