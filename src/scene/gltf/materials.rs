//! Materials and their textures.

use std::borrow::Cow;
use std::collections::hash_map::Entry;
use std::collections::{BTreeSet, HashMap};

use glam::{DVec2, Vec3, Vec4};
use gltf::Document;
use image::{DynamicImage, ImageDecoder, RgbaImage};
use rayon::prelude::*;

use super::{Loader, accessor, called, one_line, printable};
use crate::error::{Error, Result};
use crate::scene::material::{Layers, Material, Medium, TextureUse, UvTransform};
use crate::scene::texture::{Filter, Texels, Texture, Wrap};
use crate::scene::{Progress, Surface, geometry};

/// Texture coordinates that are moved or scaled by more have no digits left.
const MAX_TRANSFORM: f32 = 1e6;
/// Of all textures together: half a GiB.
const MAX_TEXELS: u64 = geometry::MAX_TEXELS as u64 - 256;

impl Loader {
    pub(super) fn read_textures(&mut self, document: &Document, progress: Progress) -> Result<()> {
        // Pictures that only other maps use are no textures of the scene.
        let mut used = BTreeSet::new();
        for material in document.materials() {
            used.extend(material.pbr_metallic_roughness().base_color_texture().map(|info| info.texture().index()));
            used.extend(material.emissive_texture().map(|info| info.texture().index()));
        }
        // Materials that use the same picture in the same way share it.
        let mut places: HashMap<(usize, Option<usize>), usize> = HashMap::new();
        let mut wanted = Vec::new();
        for texture in document.textures().filter(|texture| used.contains(&texture.index())) {
            let place = match places.entry((texture.source().index(), texture.sampler().index())) {
                Entry::Occupied(place) => *place.get(),
                Entry::Vacant(free) => {
                    wanted.push(texture.clone());
                    *free.insert(wanted.len() - 1)
                }
            };
            self.texture_places.insert(texture.index(), place);
        }
        // Asked before they are decoded: as numbers they take many times the memory.
        let mut texel_count = 0;
        let mut encoded = Vec::with_capacity(wanted.len());
        for texture in &wanted {
            let (what, bytes) = self.encoded_image(texture)?;
            let (width, height) = self.decoder(&what, &bytes)?.dimensions();
            texel_count += u64::from(width) * u64::from(height);
            let reason = || format!("makes more than {MAX_TEXELS} texels, the most that are read; use smaller pictures");
            self.require(texel_count <= MAX_TEXELS, &what, reason)?;
            encoded.push((texture, what, bytes));
        }
        let mut textures = Vec::with_capacity(encoded.len());
        for batch in encoded.chunks(2 * rayon::current_num_threads()) {
            progress("decoding textures", textures.len() as f64 / encoded.len() as f64);
            let read: Vec<Result<Texture>> =
                batch.par_iter().map(|(texture, what, bytes)| self.read_texture(texture, what, bytes)).collect();
            for texture in read {
                textures.push(texture?);
            }
        }
        drop(encoded);
        self.scene.textures = textures;
        Ok(())
    }

    /// Its name in complaints, and the bytes of the picture's file.
    fn encoded_image(&self, texture: &gltf::Texture) -> Result<(String, Cow<'_, [u8]>)> {
        let source = texture.source();
        let what = called("texture image", source.name(), source.index());
        let bytes = match source.source() {
            gltf::image::Source::View { view, .. } => Cow::Borrowed(accessor::view_bytes(self, &view, &what)?),
            gltf::image::Source::Uri { uri, .. } => Cow::Owned(self.read_uri(uri, &what)?),
        };
        Ok((what, bytes))
    }

    fn undecodable(&self, what: &str, error: &image::ImageError) -> Error {
        self.refuse(what, format!("cannot be decoded ({})", one_line(&error.to_string())))
    }

    /// Of a picture's file.
    fn decoder<'b>(&self, what: &str, bytes: &'b [u8]) -> Result<impl ImageDecoder + use<'b>> {
        let reader = image::ImageReader::new(std::io::Cursor::new(bytes)).with_guessed_format();
        let mut reader = reader.map_err(|error| self.refuse(what, error.to_string()))?;
        reader.limits(image_limits());
        reader.into_decoder().map_err(|error| self.undecodable(what, &error))
    }

    fn decoded(&self, what: &str, bytes: &[u8]) -> Result<RgbaImage> {
        let undecodable = |error: image::ImageError| self.undecodable(what, &error);
        let decoder = self.decoder(what, bytes)?;
        image_limits().reserve(decoder.total_bytes()).map_err(undecodable)?;
        Ok(DynamicImage::from_decoder(decoder).map_err(undecodable)?.into_rgba8())
    }

    /// Means of roughness and metalness over a whole picture; `None` where it cannot be read.
    fn mean_roughness_and_metalness(&mut self, texture: &gltf::Texture) -> Option<[f32; 2]> {
        let source = texture.source().index();
        if let Some(means) = self.mean_roughness_and_metalness.get(&source) {
            return *means;
        }
        let picture = self.encoded_image(texture).and_then(|(what, bytes)| self.decoded(&what, &bytes)).ok();
        let means = picture.map(|picture| {
            // Sums of whole numbers depend on no order.
            let codes = picture.as_raw().par_chunks_exact(4).map(|texel| [u64::from(texel[1]), u64::from(texel[2])]);
            let sums = codes.reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
            sums.map(|sum| (sum as f64 / (255.0 * f64::from(picture.width()) * f64::from(picture.height()))) as f32)
        });
        self.mean_roughness_and_metalness.insert(source, means);
        means
    }

    fn read_texture(&self, texture: &gltf::Texture, what: &str, bytes: &[u8]) -> Result<Texture> {
        let picture = self.decoded(what, bytes)?;
        let wrap = |mode: gltf::texture::WrappingMode| match mode {
            gltf::texture::WrappingMode::ClampToEdge => Wrap::Clamp,
            gltf::texture::WrappingMode::MirroredRepeat => Wrap::MirroredRepeat,
            gltf::texture::WrappingMode::Repeat => Wrap::Repeat,
        };
        let (width, height) = picture.dimensions();
        Ok(Texture {
            name: what.to_owned(),
            width,
            height,
            texels: Texels::Srgb(bytemuck::allocation::cast_vec(picture.into_raw())),
            wrap: [wrap(texture.sampler().wrap_s()), wrap(texture.sampler().wrap_t())],
            filter: Filter::Bilinear,
        })
    }

    pub(super) fn read_materials(&mut self, document: &Document) -> Result<()> {
        for material in document.materials() {
            let read = self.read_material(&material)?;
            self.scene.materials.push(read);
        }
        // The material of primitives that name none.
        self.scene.materials.push(Material::lambert("default", Vec3::ONE));
        Ok(())
    }

    fn read_material(&mut self, material: &gltf::Material) -> Result<Material> {
        let pbr = material.pbr_metallic_roughness();
        let name = material.name().map_or_else(|| format!("material {}", material.index().unwrap_or(0)), printable);
        let transmission = material.transmission();
        let factor = transmission.as_ref().map_or(0.0, gltf::material::Transmission::transmission_factor);
        let ior = material.ior().unwrap_or(1.5);
        let object = format!("material '{name}'");
        let means = pbr.metallic_roughness_texture().map(|info| self.mean_roughness_and_metalness(&info.texture()));
        let [roughness, metallic] = means.flatten().unwrap_or([1.0; 2]);
        let (roughness, metallic) = (roughness * pbr.roughness_factor(), metallic * pbr.metallic_factor());
        for (what, present) in [
            ("normal textures", material.normal_texture().is_some()),
            ("occlusion textures", material.occlusion_texture().is_some()),
            ("metallic-roughness textures (taken as their mean)", matches!(means, Some(Some(_)))),
            ("metallic-roughness textures that cannot be read (the factors alone count)", matches!(means, Some(None))),
            ("transmission textures", transmission.as_ref().is_some_and(|t| t.transmission_texture().is_some())),
            ("transparency by alpha", material.alpha_mode() != gltf::material::AlphaMode::Opaque),
            ("rough transmission (taken as smooth)", factor >= 0.5 && roughness > 0.05),
        ] {
            if present {
                self.leave_out(what, &object);
            }
        }
        for (what, share) in [("metallic", metallic), ("transmission", factor)] {
            if share > 0.0 && share < 1.0 {
                self.leave_out(format!("partly {what} surfaces (taken as the nearer of both)"), &object);
            }
        }
        let in_range = |value: f32, low: f32, high: f32| value.is_finite() && value >= low && value <= high;
        let are_in_range = |colour: Vec3, high: f32| colour.to_array().iter().all(|channel| in_range(*channel, 0.0, high));
        let base_colour = Vec4::from(pbr.base_color_factor()).truncate();
        let emission = Vec3::from(material.emissive_factor()) * material.emissive_strength().unwrap_or(1.0);
        let Vec3 { x: red, y: green, z: blue } = base_colour;
        let reason = || format!("has the base colour {red} {green} {blue}; each must be from 0 to 1");
        self.require(are_in_range(base_colour, 1.0), &object, reason)?;
        self.require(are_in_range(emission, f32::MAX), &object, || format!("emits {emission}; each channel must be 0 or more and finite"))?;
        let reason = || format!("has the index of refraction {ior}; it must be from 1 to 100");
        self.require(in_range(ior, 1.0, 100.0), &object, reason)?;
        for info in [pbr.base_color_texture(), material.emissive_texture()].into_iter().flatten() {
            if let Some(transform) = info.texture_transform() {
                let ([ox, oy], [sx, sy], turn) = (transform.offset(), transform.scale(), transform.rotation());
                let is_ok = [ox, oy, sx, sy, turn].iter().all(|number| number.abs() <= MAX_TRANSFORM);
                let reason = || {
                    format!(
                        "has a texture transform of offset {ox:e} {oy:e}, scale {sx:e} {sy:e} and rotation {turn:e}; each must be within {MAX_TRANSFORM:e}"
                    )
                };
                self.require(is_ok, &object, reason)?;
            }
        }
        let factors = Vec3::new(pbr.metallic_factor(), pbr.roughness_factor(), factor);
        self.require(are_in_range(factors, 1.0), &object, || "has a metallic, roughness or transmission factor outside 0 to 1".into())?;
        let vector = |[x, y]: [f32; 2]| DVec2::new(f64::from(x), f64::from(y));
        let mut texture_use = |info: Option<gltf::texture::Info>| {
            info.map(|info| {
                let transform = info.texture_transform();
                let set = transform.as_ref().and_then(gltf::texture::TextureTransform::tex_coord).unwrap_or(info.tex_coord());
                if set > 1 {
                    self.leave_out("texture coordinates beyond the second set (the first is used)", &object);
                }
                TextureUse {
                    texture: self.texture_places[&info.texture().index()],
                    uv_set: if set == 1 { 1 } else { 0 },
                    transform: transform.map_or(UvTransform::NONE, |transform| UvTransform {
                        scale: vector(transform.scale()),
                        rotation: f64::from(transform.rotation()),
                        offset: vector(transform.offset()),
                    }),
                }
            })
        };
        Ok(Material {
            surface: Surface::Layered,
            base_colour,
            base_colour_texture: texture_use(pbr.base_color_texture()),
            emission,
            emission_texture: texture_use(material.emissive_texture()),
            two_sided: material.double_sided(),
            layers: Layers {
                metallic,
                roughness,
                ior,
                transmission: factor,
                medium: (factor > 0.0).then_some(Medium { transmittance: Vec3::ONE }),
                ..Layers::default()
            },
            ..Material::lambert(&name, base_colour)
        })
    }
}

fn image_limits() -> image::Limits {
    let mut limits = image::Limits::default();
    // A picture of a few bytes must not unfold into gigabytes.
    limits.max_alloc = Some(1 << 30);
    limits
}
