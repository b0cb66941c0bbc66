//! Pictures of a file as textures of the scene. One picture is several textures where materials read it in several ways.

use std::borrow::Cow;
use std::collections::BTreeMap;

use gltf::Document;
use gltf::texture::{MagFilter, WrappingMode};
use image::{DynamicImage, ImageDecoder, ImageFormat, RgbaImage};
use rayon::prelude::*;

use super::{Loader, MAX_TEXELS, accessor, called, ktx2};
use crate::error::{Error, Result};
use crate::scene::Progress;
use crate::scene::texture::{Filter, Texels, Texture, Wrap};

/// Of one picture as its file has it: a few bytes must not unfold into gigabytes.
const MAX_BYTES: u64 = 1 << 30;

/// The mark at the end of a JPEG.
const END: [u8; 2] = [0xff, 0xd9];

/// What the numbers of a picture mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Meaning {
    /// Colours by the sRGB curve.
    Colours,
    /// Linear numbers.
    Numbers,
    /// Glossiness in alpha, which becomes roughness in green. Holds the bits of the factor of glossiness: 1 - factor * alpha is no
    /// product, so the factor must be in the texels.
    Glossiness(u32),
}

/// A texture that materials use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Wanted {
    /// Its picture's number in the file.
    image: usize,
    wrap: [Wrap; 2],
    filter: Filter,
    meaning: Meaning,
}

/// The file of a picture.
struct Encoded<'a> {
    /// Its name in complaints.
    what: String,
    bytes: Cow<'a, [u8]>,
    /// Places of its textures in the scene.
    places: Vec<usize>,
}

impl Loader {
    /// Place in the scene of a texture of the file, read in one way; `None` if it has no picture. Uses that are the same share it.
    pub(super) fn texture_place(&mut self, texture: &gltf::Texture, meaning: Meaning) -> Option<usize> {
        let wrap = |mode: WrappingMode| match mode {
            WrappingMode::ClampToEdge => Wrap::Clamp,
            WrappingMode::MirroredRepeat => Wrap::MirroredRepeat,
            WrappingMode::Repeat => Wrap::Repeat,
        };
        let sampler = texture.sampler();
        let wanted = Wanted {
            image: texture.source()?.index(),
            wrap: [wrap(sampler.wrap_s()), wrap(sampler.wrap_t())],
            filter: if sampler.mag_filter() == Some(MagFilter::Nearest) { Filter::Nearest } else { Filter::Bilinear },
            meaning,
        };
        Some(*self.texture_places.entry(wanted).or_insert_with(|| {
            self.wanted_textures.push(wanted);
            self.wanted_textures.len() - 1
        }))
    }

    /// Decodes every picture that materials use.
    pub(super) fn read_textures(&mut self, document: &Document, progress: Progress) -> Result<()> {
        let mut places_of_images: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (place, wanted) in self.wanted_textures.iter().enumerate() {
            places_of_images.entry(wanted.image).or_default().push(place);
        }
        // Sizes are asked before anything is decoded: as numbers pictures take many times the memory.
        let mut texel_count = 0;
        let mut encoded = Vec::with_capacity(places_of_images.len());
        for image in document.images() {
            let Some(places) = places_of_images.remove(&image.index()) else { continue };
            let (what, bytes) = self.encoded_image(&image)?;
            let (width, height) = self.dimensions(&what, &bytes)?;
            texel_count += u64::from(width) * u64::from(height) * places.len() as u64;
            let reason = || format!("makes more than {MAX_TEXELS} texels, the most that are read; use smaller pictures");
            self.require(texel_count <= MAX_TEXELS, &what, reason)?;
            encoded.push(Encoded { what, bytes, places });
        }
        let mut textures: Vec<Option<Texture>> = vec![None; self.wanted_textures.len()];
        let mut done = 0;
        for batch in encoded.chunks(2 * rayon::current_num_threads()) {
            progress("decoding textures", done as f64 / encoded.len() as f64);
            let read: Vec<Result<Vec<Texture>>> = batch.par_iter().map(|encoded| self.textures_of(encoded)).collect();
            for (encoded, read) in batch.iter().zip(read) {
                for (place, texture) in encoded.places.iter().zip(read?) {
                    textures[*place] = Some(texture);
                }
            }
            done += batch.len();
        }
        drop(encoded);
        self.scene.textures = textures.into_iter().map(|texture| texture.expect("every texture has a picture")).collect();
        Ok(())
    }

    /// Its name in complaints, and the bytes of the picture's file.
    pub(super) fn encoded_image(&self, image: &gltf::Image) -> Result<(String, Cow<'_, [u8]>)> {
        let what = called("texture image", image.name(), image.index());
        let bytes = match image.source() {
            gltf::image::Source::View { view, .. } => Cow::Borrowed(accessor::view_bytes(self, &view, &what)?),
            gltf::image::Source::Uri { uri, .. } => Cow::Owned(self.read_uri(uri, &what)?),
        };
        Ok((what, bytes))
    }

    fn undecodable(&self, what: &str, error: &image::ImageError) -> Error {
        let reason = match error {
            image::ImageError::Limits(_) => format!("more than {} MiB as pixels; export it smaller", MAX_BYTES >> 20),
            image::ImageError::Unsupported(_) => "a kind of pixels that is not read; export it as 8-bit RGB or RGBA".into(),
            // What decoders say is for those who make them.
            _ => "its data is broken or cut off; export it again".into(),
        };
        self.refuse(what, format!("cannot be decoded: {reason}"))
    }

    fn broken_ktx2(&self, what: &str, reason: &str) -> Error {
        self.refuse(what, format!("cannot be decoded: {reason}"))
    }

    fn dimensions(&self, what: &str, bytes: &[u8]) -> Result<(u32, u32)> {
        match ktx2::is_one(bytes) {
            true => ktx2::dimensions(bytes).map_err(|reason| self.broken_ktx2(what, &reason)),
            false => Ok(self.decoder(what, bytes)?.dimensions()),
        }
    }

    /// Of a picture's file that is not KTX 2.
    fn decoder<'b>(&self, what: &str, bytes: &'b [u8]) -> Result<impl ImageDecoder + use<'b>> {
        let reader = image::ImageReader::new(std::io::Cursor::new(bytes)).with_guessed_format();
        let mut reader = reader.map_err(|error| self.refuse(what, error.to_string()))?;
        let is_read = matches!(reader.format(), Some(ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP));
        self.require(is_read, what, || {
            "cannot be decoded: it is neither PNG, JPEG, WebP nor KTX 2, the formats that are read; convert it".into()
        })?;
        reader.limits(image_limits());
        reader.into_decoder().map_err(|error| self.undecodable(what, &error))
    }

    pub(super) fn decoded(&self, what: &str, bytes: &[u8]) -> Result<RgbaImage> {
        if ktx2::is_one(bytes) {
            return ktx2::decoded(bytes).map_err(|reason| self.broken_ktx2(what, &reason));
        }
        if has_its_end(bytes) {
            return self.pixels(what, bytes);
        }
        // What follows the last pixel of a whole picture changes nothing; what follows a part of one becomes pixels.
        let ended = |by: &[u8]| self.pixels(what, &[bytes.strip_suffix(&[0xff]).unwrap_or(bytes), by, &END].concat());
        let (found, other) = (ended(&[])?, ended(&[0x55; 64])?);
        self.require(found == other, what, || "is cut off: a JPEG without its end; export it again".into())?;
        Ok(found)
    }

    fn pixels(&self, what: &str, bytes: &[u8]) -> Result<RgbaImage> {
        let undecodable = |error: image::ImageError| self.undecodable(what, &error);
        let decoder = self.decoder(what, bytes)?;
        image_limits().reserve(decoder.total_bytes()).map_err(undecodable)?;
        Ok(DynamicImage::from_decoder(decoder).map_err(undecodable)?.into_rgba8())
    }

    /// All textures of one picture, one a place.
    fn textures_of(&self, encoded: &Encoded) -> Result<Vec<Texture>> {
        let picture = self.decoded(&encoded.what, &encoded.bytes)?;
        let (width, height) = picture.dimensions();
        let mut codes: Vec<[u8; 4]> = bytemuck::allocation::cast_vec(picture.into_raw());
        let texture = |(use_number, place): (usize, &usize)| {
            let Wanted { wrap, filter, meaning, .. } = self.wanted_textures[*place];
            // The last one takes the codes, the others copy them.
            let mut own = || if use_number + 1 == encoded.places.len() { std::mem::take(&mut codes) } else { codes.clone() };
            let texels = match meaning {
                Meaning::Colours => Texels::Srgb(own()),
                Meaning::Numbers => Texels::Linear(own()),
                Meaning::Glossiness(factor) => {
                    let mut own = own();
                    own.par_iter_mut().for_each(|code| *code = [255, roughness_code(f32::from_bits(factor), code[3]), 255, 255]);
                    Texels::Linear(own)
                }
            };
            Texture { name: encoded.what.clone(), width, height, texels, wrap, filter }
        };
        Ok(encoded.places.iter().enumerate().map(texture).collect())
    }
}

/// 1 - factor * glossiness.
fn roughness_code(factor: f32, glossiness: u8) -> u8 {
    (255.0 - factor * f32::from(glossiness)).round() as u8
}

fn image_limits() -> image::Limits {
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(MAX_BYTES);
    limits
}

/// Whether no end of a JPEG is missing: decoders make grey of what is not there. The mark of the end stands behind the last scan.
fn has_its_end(bytes: &[u8]) -> bool {
    const START: [u8; 2] = [0xff, 0xd8];
    const SCAN: [u8; 2] = [0xff, 0xda];
    let last = |mark: [u8; 2]| bytes.windows(2).rposition(|pair| pair == mark);
    !bytes.starts_with(&START) || last(END) > last(SCAN)
}
