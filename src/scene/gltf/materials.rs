//! Materials: each becomes a layered one, with every factor and texture that the scene simulates.

use glam::{DVec2, Vec3};
use gltf::Document;
use gltf::json::extensions::material::{Material as Extensions, Volume};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::{AlphaMode, NormalTexture};
use gltf::json::texture::Info;
use gltf::json::validation::Checked;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::textures::Meaning;
use super::{Loader, named};
use crate::error::Result;
use crate::scene::Surface;
use crate::scene::material::{Coverage, Layers, Material, Medium, NormalMap, TextureUse, UvTransform};

/// Texture coordinates that are scaled by more have no digits left, nor has a normal that is.
const MAX_TRANSFORM: f32 = 1e6;
/// Of factors without an upper limit of their own.
const ANY: f32 = f32::MAX;
/// Larger indices of refraction are as good as this one: all but 4 millionths of the light is reflected.
const MAX_IOR: f32 = 1e6;
/// What is meant for 1 and rounded below counts as 1.
const LEAST_IOR: f32 = 0.9999;
/// Largest that is spread over colours.
const MAX_DISPERSED_IOR: f32 = 100.0;

/// KHR_materials_anisotropy.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Anisotropy {
    anisotropy_strength: f32,
    anisotropy_rotation: f32,
    anisotropy_texture: Option<Info>,
}

/// KHR_materials_clearcoat, which the `gltf` crate leaves as it stands in the file, as it does the others here.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct ClearCoat {
    clearcoat_factor: f32,
    clearcoat_texture: Option<Info>,
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<Info>,
    clearcoat_normal_texture: Option<NormalTexture>,
}

/// KHR_materials_diffuse_transmission.
#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct DiffuseTransmission {
    diffuse_transmission_factor: f32,
    diffuse_transmission_texture: Option<Info>,
    diffuse_transmission_color_factor: [f32; 3],
    diffuse_transmission_color_texture: Option<Info>,
}

impl Default for DiffuseTransmission {
    fn default() -> DiffuseTransmission {
        DiffuseTransmission {
            diffuse_transmission_factor: 0.0,
            diffuse_transmission_texture: None,
            diffuse_transmission_color_factor: [1.0; 3],
            diffuse_transmission_color_texture: None,
        }
    }
}

/// KHR_materials_dispersion.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Dispersion {
    dispersion: f32,
}

/// KHR_materials_iridescence.
#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Iridescence {
    iridescence_factor: f32,
    iridescence_texture: Option<Info>,
    iridescence_ior: f32,
    iridescence_thickness_minimum: f32,
    iridescence_thickness_maximum: f32,
    iridescence_thickness_texture: Option<Info>,
}

impl Default for Iridescence {
    fn default() -> Iridescence {
        Iridescence {
            iridescence_factor: 0.0,
            iridescence_texture: None,
            iridescence_ior: 1.3,
            iridescence_thickness_minimum: 100.0,
            iridescence_thickness_maximum: 400.0,
            iridescence_thickness_texture: None,
        }
    }
}

/// KHR_materials_sheen.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Sheen {
    sheen_color_factor: [f32; 3],
    sheen_color_texture: Option<Info>,
    sheen_roughness_factor: f32,
    sheen_roughness_texture: Option<Info>,
}

impl Loader {
    /// A material by its number in the file; `None`: that of primitives that name none.
    pub(super) fn read_material(&mut self, document: &Document, number: Option<usize>) -> Result<Material> {
        let Some((number, material)) = number.and_then(|number| Some((number, document.as_json().materials.get(number)?))) else {
            return Ok(Material::layered("default", Vec3::ONE, Layers::default()));
        };
        let name = named("material", material.name.as_deref(), number);
        let object = format!("material '{name}'");
        Reader { loader: self, document, object }.material(&name, material)
    }
}

/// Of one material.
struct Reader<'a> {
    loader: &'a mut Loader,
    document: &'a Document,
    /// Its name in complaints.
    object: String,
}

impl Reader<'_> {
    fn material(mut self, name: &str, json: &gltf::json::Material) -> Result<Material> {
        let no_extensions = Extensions::default();
        let extensions = json.extensions.as_ref().unwrap_or(&no_extensions);
        let is_unlit = extensions.unlit.is_some();
        let pbr = &json.pbr_metallic_roughness;
        // Where a file has both models, it prefers this one.
        let glossy = extensions.pbr_specular_glossiness.as_ref().filter(|_| !is_unlit);
        let ([red, green, blue, alpha], texture) = match glossy {
            Some(glossy) => (glossy.diffuse_factor.0, &glossy.diffuse_texture),
            None => (pbr.base_color_factor.0, &pbr.base_color_texture),
        };
        let base_colour = self.colour("base colour", [red, green, blue], 1.0)?;
        let alpha = self.factor("alpha", alpha, 1.0)?;
        let read = Material {
            surface: Surface::Layered,
            base_colour_texture: self.texture(texture.as_ref(), Meaning::Colours)?,
            two_sided: json.double_sided,
            coverage: match json.alpha_mode {
                Checked::Valid(AlphaMode::Mask) => {
                    Coverage::Mask { alpha, cutoff: self.factor("alpha cutoff", json.alpha_cutoff.unwrap_or_default().0, ANY)? }
                }
                Checked::Valid(AlphaMode::Blend) => Coverage::Blend { alpha },
                _ => Coverage::Whole,
            },
            ..Material::lambert(name, base_colour)
        };
        let is_gone = match read.coverage {
            Coverage::Whole => false,
            Coverage::Mask { alpha, cutoff } => alpha < cutoff,
            Coverage::Blend { alpha } => alpha == 0.0,
        };
        if is_gone {
            self.loader.leave_out("surfaces that are nowhere seen (their alpha is 0, or below the cutoff)", &self.object);
        }
        if is_unlit {
            return Ok(Material { layers: Layers { is_unlit, ..Layers::default() }, ..read });
        }

        let strength = extensions.emissive_strength.as_ref().map_or(1.0, |extension| extension.emissive_strength.0);
        let emission = Vec3::from(json.emissive_factor.0) * strength;
        let reason = || format!("emits {emission}; each channel must be 0 or more and finite");
        self.loader.require(emission.is_finite() && emission.min_element() >= 0.0, &self.object, reason)?;
        let ior = extensions.ior.as_ref().map_or(1.5, |extension| extension.ior.0);
        let reason = || format!("has the index of refraction {ior}; it must be 0, or from 1");
        self.loader.require(ior == 0.0 || ior >= LEAST_IOR, &self.object, reason)?;
        let mut layers = Layers { ior: if ior == 0.0 { ior } else { ior.clamp(1.0, MAX_IOR) }, ..Layers::default() };
        match glossy {
            Some(glossy) => {
                let glossiness = self.factor("glossiness", glossy.glossiness_factor.0, 1.0)?;
                let texture = glossy.specular_glossiness_texture.as_ref();
                layers.metallic = 0.0;
                layers.ior = 0.0;
                layers.specular_colour = self.colour("specular colour", glossy.specular_factor.0, 1.0)?;
                layers.specular_colour_texture = self.texture(texture, Meaning::Colours)?;
                layers.metallic_roughness_texture = self.texture(texture, Meaning::Glossiness(glossiness.to_bits()))?;
                layers.roughness = if texture.is_some() { 1.0 } else { 1.0 - glossiness };
            }
            None => {
                layers.metallic = self.factor("metallic factor", pbr.metallic_factor.0, 1.0)?;
                layers.roughness = self.factor("roughness factor", pbr.roughness_factor.0, 1.0)?;
                layers.metallic_roughness_texture = self.texture(pbr.metallic_roughness_texture.as_ref(), Meaning::Numbers)?;
            }
        }
        if let Some(stretch) = self.extension::<Anisotropy>(extensions, "KHR_materials_anisotropy")? {
            layers.anisotropy = self.factor("anisotropy strength", stretch.anisotropy_strength, 1.0)?;
            layers.anisotropy_rotation = stretch.anisotropy_rotation;
            let reason = || format!("has the anisotropy rotation {:e}; it must be within {MAX_TRANSFORM:e}", stretch.anisotropy_rotation);
            self.loader.require(stretch.anisotropy_rotation.abs() <= MAX_TRANSFORM, &self.object, reason)?;
            layers.anisotropy_texture = self.texture(stretch.anisotropy_texture.as_ref(), Meaning::Numbers)?;
        }
        if let Some(specular) = &extensions.specular {
            layers.specular = self.factor("specular factor", specular.specular_factor.0, 1.0)?;
            layers.specular_texture = self.texture(specular.specular_texture.as_ref(), Meaning::Numbers)?;
            layers.specular_colour = self.colour("specular colour", specular.specular_color_factor.0, ANY)?;
            layers.specular_colour_texture = self.texture(specular.specular_color_texture.as_ref(), Meaning::Colours)?;
        }
        if let Some(transmission) = &extensions.transmission {
            layers.transmission = self.factor("transmission factor", transmission.transmission_factor.0, 1.0)?;
            layers.transmission_texture = self.texture(transmission.transmission_texture.as_ref(), Meaning::Numbers)?;
        }
        if let Some(beyond) = self.extension::<DiffuseTransmission>(extensions, "KHR_materials_diffuse_transmission")? {
            layers.diffuse_transmission = self.factor("diffuse transmission factor", beyond.diffuse_transmission_factor, 1.0)?;
            layers.diffuse_transmission_texture = self.texture(beyond.diffuse_transmission_texture.as_ref(), Meaning::Numbers)?;
            layers.diffuse_transmission_colour =
                self.colour("diffuse transmission colour", beyond.diffuse_transmission_color_factor, 1.0)?;
            layers.diffuse_transmission_colour_texture =
                self.texture(beyond.diffuse_transmission_color_texture.as_ref(), Meaning::Colours)?;
        }
        if let Some(volume) = &extensions.volume {
            let medium = self.medium(volume)?;
            // No light goes into an opaque surface.
            layers.medium = medium.filter(|_| layers.transmission > 0.0 || layers.diffuse_transmission > 0.0);
            // The index 0 stands for one without end: there is no angle of refraction, and but for a specular factor or colour no light.
            if ior == 0.0 && layers.medium.take().is_some() {
                self.loader.leave_out("volumes behind the ior 0 (nothing is refracted there; such a surface is a thin wall)", &self.object);
            }
        }
        if let Some(Dispersion { dispersion }) = self.extension(extensions, "KHR_materials_dispersion")? {
            let dispersion = self.factor("dispersion", dispersion, ANY)?;
            if ior > MAX_DISPERSED_IOR && dispersion > 0.0 {
                self.loader.leave_out(format!("dispersion of indices of refraction above {MAX_DISPERSED_IOR}"), &self.object);
            } else if layers.medium.is_some() && layers.transmission > 0.0 {
                layers.dispersion = dispersion;
            } else if dispersion > 0.0 {
                self.loader
                    .leave_out("dispersion of what light does not enter (a thin wall, or a surface without transmission)", &self.object);
            }
        }
        if let Some(film) = self.extension::<Iridescence>(extensions, "KHR_materials_iridescence")? {
            layers.iridescence = self.factor("iridescence factor", film.iridescence_factor, 1.0)?;
            layers.iridescence_texture = self.texture(film.iridescence_texture.as_ref(), Meaning::Numbers)?;
            layers.film_ior = film.iridescence_ior.clamp(1.0, MAX_IOR);
            let reason = || format!("has a film of the index of refraction {}; it must be from 1", film.iridescence_ior);
            self.loader.require(film.iridescence_ior >= LEAST_IOR, &self.object, reason)?;
            let thickness = [film.iridescence_thickness_minimum, film.iridescence_thickness_maximum];
            for nanometres in thickness {
                self.factor("thickness of its film", nanometres, ANY)?;
            }
            layers.film_thickness = thickness;
            layers.film_thickness_texture = self.texture(film.iridescence_thickness_texture.as_ref(), Meaning::Numbers)?;
        }
        if let Some(coat) = self.extension::<ClearCoat>(extensions, "KHR_materials_clearcoat")? {
            layers.coat = self.factor("clear coat factor", coat.clearcoat_factor, 1.0)?;
            layers.coat_texture = self.texture(coat.clearcoat_texture.as_ref(), Meaning::Numbers)?;
            layers.coat_roughness = self.factor("clear coat roughness", coat.clearcoat_roughness_factor, 1.0)?;
            layers.coat_roughness_texture = self.texture(coat.clearcoat_roughness_texture.as_ref(), Meaning::Numbers)?;
            layers.coat_normal_map = self.normal_map(coat.clearcoat_normal_texture.as_ref())?;
        }
        if let Some(sheen) = self.extension::<Sheen>(extensions, "KHR_materials_sheen")? {
            layers.sheen_colour = self.colour("sheen colour", sheen.sheen_color_factor, 1.0)?;
            layers.sheen_colour_texture = self.texture(sheen.sheen_color_texture.as_ref(), Meaning::Colours)?;
            layers.sheen_roughness = self.factor("sheen roughness", sheen.sheen_roughness_factor, 1.0)?;
            layers.sheen_roughness_texture = self.texture(sheen.sheen_roughness_texture.as_ref(), Meaning::Numbers)?;
        }
        Ok(Material {
            emission,
            emission_texture: self.texture(json.emissive_texture.as_ref(), Meaning::Colours)?,
            normal_map: self.normal_map(json.normal_texture.as_ref())?,
            layers,
            ..read
        })
    }

    /// A factor from 0 to `high`.
    fn factor(&self, what: &str, value: f32, high: f32) -> Result<f32> {
        let reason = || format!("has the {what} {value}; it must be {}", range(high));
        within(value, high).ok_or_else(|| self.loader.refuse(&self.object, reason()))
    }

    /// A colour with each channel from 0 to `high`.
    fn colour(&self, what: &str, value: [f32; 3], high: f32) -> Result<Vec3> {
        let [red, green, blue] = value;
        let reason = || format!("has the {what} {red} {green} {blue}; each must be {}", range(high));
        match value.map(|channel| within(channel, high)) {
            [Some(red), Some(green), Some(blue)] => Ok(Vec3::new(red, green, blue)),
            _ => Err(self.loader.refuse(&self.object, reason())),
        }
    }

    /// `None`: a thin wall.
    fn medium(&mut self, volume: &Volume) -> Result<Option<Medium>> {
        let thickness = self.factor("thickness", volume.thickness_factor.0, ANY)?;
        let distance = volume.attenuation_distance.0;
        let reason = || format!("has the attenuation distance {distance}; it must be above 0");
        self.loader.require(distance > 0.0, &self.object, reason)?;
        let colour = self.colour("attenuation colour", volume.attenuation_color.0, 1.0)?;
        if thickness == 0.0 {
            return Ok(None);
        }
        // Without a distance nothing is absorbed.
        let is_clear = distance.is_infinite() || colour == Vec3::ONE;
        Ok(Some(if is_clear { Medium::CLEAR } else { Medium { transmittance: colour, metres: distance } }))
    }

    fn texture(&mut self, info: Option<&Info>, meaning: Meaning) -> Result<Option<TextureUse>> {
        let Some(info) = info else { return Ok(None) };
        let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.as_ref());
        self.texture_use(info.index.value(), info.tex_coord, transform, meaning).map(Some)
    }

    fn normal_map(&mut self, info: Option<&NormalTexture>) -> Result<Option<NormalMap>> {
        let Some(info) = info else { return Ok(None) };
        let transform = info.extensions.as_ref().and_then(|extensions| extensions.others.get("KHR_texture_transform"));
        let transform: Option<TextureTransform> = transform.map(|value| self.parsed("KHR_texture_transform", value)).transpose()?;
        let texture = self.texture_use(info.index.value(), info.tex_coord, transform.as_ref(), Meaning::Numbers)?;
        let scale = info.scale;
        let reason = || format!("has the normal scale {scale:e}; it must be within {MAX_TRANSFORM:e}");
        self.loader.require(scale.abs() <= MAX_TRANSFORM, &self.object, reason)?;
        Ok(Some(NormalMap { texture, scale }))
    }

    fn texture_use(&mut self, number: usize, set: u32, transform: Option<&TextureTransform>, meaning: Meaning) -> Result<TextureUse> {
        let Some(texture) = self.document.textures().nth(number) else {
            let count = self.document.textures().len();
            return Err(self.loader.refuse(&self.object, format!("uses texture {number} of {count}")));
        };
        let Some(place) = self.loader.texture_place(&texture, meaning) else {
            let extensions: Vec<&str> =
                texture.extensions().into_iter().flat_map(|extensions| extensions.keys()).map(String::as_str).collect();
            let only = if extensions.is_empty() { String::new() } else { format!(" but by {}", extensions.join(", ")) };
            let reason = format!("uses texture {number}, which has no picture{only}; export it as PNG, JPEG, WebP or KTX 2");
            return Err(self.loader.refuse(&self.object, reason));
        };
        let set = transform.and_then(|transform| transform.tex_coord).unwrap_or(set);
        if set > 1 {
            self.loader.leave_out("texture coordinates beyond the second set (the first is used)", &self.object);
        }
        Ok(TextureUse {
            texture: place,
            uv_set: if set == 1 { 1 } else { 0 },
            transform: transform.map_or(Ok(UvTransform::NONE), |transform| self.uv_transform(transform))?,
        })
    }

    fn uv_transform(&self, transform: &TextureTransform) -> Result<UvTransform> {
        let ([ox, oy], [sx, sy], turn) = (transform.offset.0, transform.scale.0, transform.rotation.0);
        // Of offsets whole turns are taken away.
        let is_ok = [ox, oy].iter().all(|number| number.is_finite()) && [sx, sy, turn].iter().all(|number| number.abs() <= MAX_TRANSFORM);
        let reason = || {
            format!(
                "has a texture transform of offset {ox:e} {oy:e}, scale {sx:e} {sy:e} and rotation {turn:e}; the offset must be finite, the others within {MAX_TRANSFORM:e}"
            )
        };
        self.loader.require(is_ok, &self.object, reason)?;
        let vector = |x: f32, y: f32| DVec2::new(x.into(), y.into());
        Ok(UvTransform { scale: vector(sx, sy), rotation: turn.into(), offset: vector(ox, oy) })
    }

    /// An extension that the `gltf` crate leaves as it stands in the file.
    fn extension<T: DeserializeOwned>(&self, extensions: &Extensions, name: &str) -> Result<Option<T>> {
        extensions.others.get(name).map(|value| self.parsed(name, value)).transpose()
    }

    fn parsed<T: DeserializeOwned>(&self, name: &str, value: &Value) -> Result<T> {
        T::deserialize(value).map_err(|error| self.loader.refuse(&self.object, format!("has a {name} that cannot be read ({error})")))
    }
}

/// A number from 0 to `high`, or what is off that by no more than rounding makes of it.
fn within(value: f32, high: f32) -> Option<f32> {
    const ROUNDING: f32 = 1e-5;
    let near = value.clamp(0.0, high);
    (value == near || (value - near).abs() <= ROUNDING).then_some(near)
}

/// From 0.
fn range(high: f32) -> String {
    if high == ANY { "0 or more and finite".to_owned() } else { format!("from 0 to {high}") }
}
