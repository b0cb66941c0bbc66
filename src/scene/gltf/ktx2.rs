//! Pictures in KTX 2 containers that Basis Universal has compressed (KHR_texture_basisu).

use basisu::{DecodeFlags, TargetFormat, Transcoder};
use image::RgbaImage;

use super::MAX_TEXELS;

/// How to make one that is read.
const REMEDY: &str = "encode it as UASTC or ETC1S, as `toktx --encode uastc` does, or export it as PNG";
/// Bytes of the head before the list of levels, and of a level in it.
const HEAD_BYTES: usize = 80;
const LEVEL_BYTES: usize = 24;
/// Where keys and values lie, which say nothing of the texels.
const KEYS_AND_VALUES: std::ops::Range<usize> = 56..64;
const ZSTANDARD: u64 = 2;
/// ETC1S and UASTC.
const BASIS_MODELS: [u8; 2] = [163, 166];
/// Of the smallest blocks, 4 x 4 texels.
const BLOCK_BYTES: u64 = 16;

/// Whether a file begins as such pictures do.
pub(super) fn is_one(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xabKTX 20\xbb\r\n\x1a\n")
}

/// Width and height, or what is wrong with it.
pub(super) fn dimensions(bytes: &[u8]) -> Result<(u32, u32), String> {
    // Of the head: to open the container takes the time of unpacking it.
    match (number::<4>(bytes, 20), number::<4>(bytes, 24)) {
        (Some(width), Some(height)) if width > 0 && height > 0 => Ok((width as u32, height as u32)),
        _ => Err("its size is missing; export it again".into()),
    }
}

/// Its largest level.
pub(super) fn decoded(bytes: &[u8]) -> Result<RgbaImage, String> {
    check(bytes)?;
    let mut bytes = bytes.to_vec();
    // The library looks for a video's mark in them and may run past their end.
    bytes[KEYS_AND_VALUES].fill(0);
    let broken = |_| "its data is broken or of a kind that is not read; ".to_owned() + REMEDY;
    let transcoder = Transcoder::new(&bytes).map_err(broken)?;
    let (width, height) = transcoder.base_dimensions();
    let texels = transcoder.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(broken)?;
    RgbaImage::from_raw(width, height, texels).ok_or_else(|| "it has not as many texels as it says; export it again".into())
}

/// Looks at what the library takes the file's word for, and at kinds of containers that glTF does not have.
fn check(bytes: &[u8]) -> Result<(), String> {
    let (width, height) = dimensions(bytes).map(|(width, height)| (u64::from(width), u64::from(height)))?;
    if width * height > MAX_TEXELS {
        return Err(format!("it claims {width} x {height} texels; at most {MAX_TEXELS} are read"));
    }
    let cut_off = || "it is cut off; export it again".to_owned();
    let head = |at: usize| number::<4>(bytes, at).ok_or_else(cut_off);
    let (format, layers, faces, levels, scheme) = (head(12)?, head(32)?, head(36)?, head(40)?, head(44)?);
    if format != 0 {
        return Err(format!("its texels are of Vulkan's format {format}, and none but Basis Universal's are read; {REMEDY}"));
    }
    let model = usize::try_from(head(48)?).ok().and_then(|description| bytes.get(description + 12)).ok_or_else(cut_off)?;
    if !BASIS_MODELS.contains(model) {
        return Err(format!("its texels are of the colour model {model}, and none but ETC1S (163) and UASTC (166) are read; {REMEDY}"));
    }
    if layers > 1 || faces > 1 {
        return Err(format!("it holds {layers} layers and {faces} faces, and a texture is one picture; export it alone"));
    }
    let long = |at: usize| number::<8>(bytes, at).ok_or_else(cut_off);
    let is_within =
        |at: usize| -> Result<bool, String> { Ok(long(at)?.checked_add(long(at + 8)?).is_some_and(|end| end <= bytes.len() as u64)) };
    // Tables that all levels share.
    let mut are_within = is_within(64)?;
    for level in 0..levels.min(32) as usize {
        let entry = HEAD_BYTES + LEVEL_BYTES * level;
        are_within &= is_within(entry)?;
        let blocks = (width >> level).max(1).div_ceil(4) * (height >> level).max(1).div_ceil(4);
        let unpacked = long(entry + 16)?;
        if scheme == ZSTANDARD && unpacked > blocks * BLOCK_BYTES {
            return Err(format!("it claims to unpack to {unpacked} bytes where {} are needed; export it again", blocks * BLOCK_BYTES));
        }
    }
    if are_within { Ok(()) } else { Err("it names bytes that it does not have; export it again".into()) }
}

/// The little-endian unsigned integer in `N` bytes.
fn number<const N: usize>(bytes: &[u8], at: usize) -> Option<u64> {
    Some(bytes.get(at..at + N)?.iter().rev().fold(0, |value, byte| value << 8 | u64::from(*byte)))
}
