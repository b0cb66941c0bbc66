//! Materials: each becomes a layered one, with every factor and texture that is simulated; plain diffuse ones become Lambertian.

use std::borrow::Borrow;

use glam::{DVec2, Vec3};
use gltf::Document;
use gltf::json::extensions::material::{Material as Extensions, PbrSpecularGlossiness, Volume};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::{AlphaMode, NormalTexture};
use gltf::json::texture::Info;
use gltf::json::validation::Checked;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use super::textures::Meaning;
use super::{Loader, named};
use crate::error::Result;
use crate::scene::Surface;
use crate::scene::layers::{ANY, Layers, METALLIC_ROUGHNESS, Medium, NormalMap, PARAMETERS, Parameter, Range, TextureUse, UvTransform};
use crate::scene::material::{Coverage, Material};

/// Texture coordinates that are scaled by more have no digits left, nor has a normal that is.
const MAX_TRANSFORM: f32 = 1e6;
/// Larger indices of refraction are as good as this one: all but 4 millionths of the light is reflected.
const MAX_IOR: f32 = 1e6;
/// What is meant for 1 and rounded below counts as 1.
const LEAST_IOR: f32 = 0.9999;
/// Largest that is spread over colours.
const MAX_DISPERSED_IOR: f32 = 100.0;

impl Loader {
    /// A material by its number in the file; `None`: that of primitives that name none.
    pub(super) fn read_material(&mut self, document: &Document, number: Option<usize>) -> Result<Material> {
        let Some((number, material)) = number.and_then(|number| Some((number, document.as_json().materials.get(number)?))) else {
            return Ok(Material::layered("default", Vec3::ONE, Layers::default()));
        };
        let name = named("material", material.name.as_deref(), number);
        let object = format!("material '{name}'");
        let value = std::mem::take(&mut self.material_values[number]);
        Reader { loader: self, document, object }.material(&name, material, &value)
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
    fn material(mut self, name: &str, json: &gltf::json::Material, value: &Value) -> Result<Material> {
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
        let base_colour = self.colour("the base colour", [red, green, blue], 1.0)?;
        let alpha = self.factor("the alpha", alpha, 1.0)?;
        let read = Material {
            surface: Surface::Layered,
            base_colour_texture: self.texture(texture.as_ref(), Meaning::Colours)?,
            two_sided: json.double_sided,
            coverage: match json.alpha_mode {
                Checked::Valid(AlphaMode::Mask) => {
                    Coverage::Mask { alpha, cutoff: self.factor("the alpha cutoff", json.alpha_cutoff.unwrap_or_default().0, ANY)? }
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
        let mut layers = Layers::default();
        if let Some(glossy) = glossy {
            self.glossiness(glossy, &mut layers)?;
        }
        self.parameters(value, &mut layers)?;
        if let Some(volume) = &extensions.volume {
            layers.medium = self.medium(volume)?;
        }
        self.leave_out_of_inside(&mut layers);
        let normal_map = self.normal_map(json.normal_texture.as_ref())?;
        let emission_texture = self.texture(json.emissive_texture.as_ref(), Meaning::Colours)?;
        let material = Material { emission, emission_texture, normal_map, layers, ..read };
        if material.is_lambertian() {
            // Nothing asks for what no lobe uses.
            let layers = Layers { anisotropy: 0.0, ..layers.without_textures() };
            return Ok(Material { surface: Surface::Lambert, layers, ..material });
        }
        Ok(material)
    }

    /// What KHR_materials_pbrSpecularGlossiness has in place of [`METALLIC_ROUGHNESS`].
    fn glossiness(&mut self, glossy: &PbrSpecularGlossiness, layers: &mut Layers) -> Result<()> {
        let glossiness = self.factor("the glossiness", glossy.glossiness_factor.0, 1.0)?;
        let texture = glossy.specular_glossiness_texture.as_ref();
        layers.metallic = 0.0;
        layers.ior = 0.0;
        layers.specular_colour = self.colour("the specular colour", glossy.specular_factor.0, 1.0)?;
        layers.specular_colour_texture = self.texture(texture, Meaning::Colours)?;
        layers.metallic_roughness_texture = self.texture(texture, Meaning::Glossiness(glossiness.to_bits()))?;
        layers.roughness = if texture.is_some() { 1.0 } else { 1.0 - glossiness };
        Ok(())
    }

    /// Takes away what counts only where light enters, if it does not.
    fn leave_out_of_inside(&mut self, layers: &mut Layers) {
        // No light goes into an opaque surface.
        layers.medium = layers.medium.filter(|_| layers.transmission > 0.0 || layers.diffuse_transmission > 0.0);
        // The index 0 stands for one without end: there is no angle of refraction, and but for a specular factor or colour no light.
        if layers.ior == 0.0 && layers.medium.take().is_some() {
            self.loader.leave_out("volumes behind the ior 0 (nothing is refracted there; such a surface is a thin wall)", &self.object);
        }
        let reason = match layers.dispersion > 0.0 {
            true if layers.ior > MAX_DISPERSED_IOR => format!("dispersion of indices of refraction above {MAX_DISPERSED_IOR}"),
            true if layers.medium.is_none() || layers.transmission == 0.0 => {
                "dispersion of what light does not enter (a thin wall, or a surface without transmission)".into()
            }
            _ => return,
        };
        self.loader.leave_out(reason, &self.object);
        layers.dispersion = 0.0;
    }

    /// Reads what [`PARAMETERS`] lists.
    fn parameters(&mut self, material: &Value, layers: &mut Layers) -> Result<()> {
        for (group, parameters) in PARAMETERS {
            let members = if *group == METALLIC_ROUGHNESS { &material[group] } else { &material["extensions"][group] };
            let members: Map<String, Value> = self.parsed::<Option<_>>(group, members)?.unwrap_or_default();
            for (member, parameter) in *parameters {
                let Some(value) = members.get(*member) else { continue };
                match *parameter {
                    Parameter::Number(what, range, of) => *of(layers) = self.number(what, range, self.parsed(group, value)?)?,
                    Parameter::Colour(what, most, of) => *of(layers) = self.colour(what, self.parsed(group, value)?, most)?,
                    Parameter::NumberTexture(_, of) => {
                        *of(layers) = self.texture(self.parsed::<Option<Info>>(group, value)?, Meaning::Numbers)?;
                    }
                    Parameter::ColourTexture(_, of) => {
                        *of(layers) = self.texture(self.parsed::<Option<Info>>(group, value)?, Meaning::Colours)?;
                    }
                    Parameter::NormalMap(_, of) => *of(layers) = self.normal_map(self.parsed::<Option<NormalTexture>>(group, value)?)?,
                }
            }
        }
        Ok(())
    }

    fn number(&self, what: &str, range: Range, value: f32) -> Result<f32> {
        let index = || (value >= LEAST_IOR).then(|| value.clamp(1.0, MAX_IOR));
        let (read, allowed) = match range {
            Range::UpTo(most) => return self.factor(what, value, most),
            Range::Angle => {
                let reason = || format!("has {what} {value:e}; it must be within {MAX_TRANSFORM:e}");
                return self.loader.require(value.abs() <= MAX_TRANSFORM, &self.object, reason).map(|()| value);
            }
            Range::Index => (index(), "from 1"),
            Range::IndexOrZero => (if value == 0.0 { Some(value) } else { index() }, "0, or from 1"),
        };
        read.ok_or_else(|| self.loader.refuse(&self.object, format!("has {what} {value}; it must be {allowed}")))
    }

    /// A factor from 0 to `high`.
    fn factor(&self, what: &str, value: f32, high: f32) -> Result<f32> {
        let reason = || format!("has {what} {value}; it must be {}", range(high));
        within(value, high).ok_or_else(|| self.loader.refuse(&self.object, reason()))
    }

    /// A colour with each channel from 0 to `high`.
    fn colour(&self, what: &str, value: [f32; 3], high: f32) -> Result<Vec3> {
        let [red, green, blue] = value;
        let reason = || format!("has {what} {red} {green} {blue}; each must be {}", range(high));
        match value.map(|channel| within(channel, high)) {
            [Some(red), Some(green), Some(blue)] => Ok(Vec3::new(red, green, blue)),
            _ => Err(self.loader.refuse(&self.object, reason())),
        }
    }

    /// `None`: a thin wall.
    fn medium(&mut self, volume: &Volume) -> Result<Option<Medium>> {
        let thickness = self.factor("the thickness", volume.thickness_factor.0, ANY)?;
        let distance = volume.attenuation_distance.0;
        let reason = || format!("has the attenuation distance {distance}; it must be above 0");
        self.loader.require(distance > 0.0, &self.object, reason)?;
        let colour = self.colour("the attenuation colour", volume.attenuation_color.0, 1.0)?;
        if thickness == 0.0 {
            return Ok(None);
        }
        // Without a distance nothing is absorbed.
        let is_clear = distance.is_infinite() || colour == Vec3::ONE;
        Ok(Some(if is_clear { Medium::CLEAR } else { Medium { transmittance: colour, metres: distance } }))
    }

    fn texture(&mut self, info: Option<impl Borrow<Info>>, meaning: Meaning) -> Result<Option<TextureUse>> {
        let Some(info) = info.as_ref().map(Borrow::borrow) else { return Ok(None) };
        let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.as_ref());
        self.texture_use(info.index.value(), info.tex_coord, transform, meaning).map(Some)
    }

    fn normal_map(&mut self, info: Option<impl Borrow<NormalTexture>>) -> Result<Option<NormalMap>> {
        let Some(info) = info.as_ref().map(Borrow::borrow) else { return Ok(None) };
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

    /// A value of an extension that the `gltf` crate leaves as it stands in the file.
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
