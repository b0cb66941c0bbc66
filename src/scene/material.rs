//! What surfaces are made of.

use glam::Vec3;

pub use super::layers::{Layers, Medium, NormalMap, TextureUse, UvTransform};
use crate::constants::{DELTA_ALPHA_INVERSE, LAYER_NORMAL, MAP_ALPHA_PER_MILLE};

/// How a surface scatters light. Its base colour is the share it scatters, per channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Surface {
    /// Equal radiance in all directions of the front.
    Lambert,
    /// The paper's Phong (section 4.4): light is scattered as by [`Surface::Lambert`], and what leaves
    /// towards the eye is weighted by max(cos, 0)^exponent around the mirror direction.
    PaperPhong {
        exponent: f32,
    },
    /// Modified Phong lobe (Lafortune and Willems 1994), (n + 2) / 2 pi cos^n around the mirror
    /// direction.
    Glossy {
        exponent: f32,
    },
    Mirror,
    /// Smooth, with Fresnel reflection and refraction.
    Dielectric {
        ior: f32,
    },
    /// glTF's: a mixture of the lobes of [`Material::layers`].
    Layered,
}

/// How much of a surface is there: the share of light that it stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Coverage {
    Whole,
    /// All where alpha is at least `cutoff`, else nothing.
    Mask {
        alpha: f32,
        cutoff: f32,
    },
    /// Alpha itself.
    Blend {
        alpha: f32,
    },
}

#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    pub name: String,
    pub surface: Surface,
    /// Linear, each channel from 0 to 1.
    pub base_colour: Vec3,
    /// Multiplies the base colour.
    pub base_colour_texture: Option<TextureUse>,
    /// Radiance that leaves the front, W/m2/sr.
    pub emission: Vec3,
    /// Multiplies the emission.
    pub emission_texture: Option<TextureUse>,
    /// The back scatters (and emits) as the front does.
    pub two_sided: bool,
    /// Of [`Surface::Layered`], as all below. The texture of the base colour has alpha, too.
    pub coverage: Coverage,
    pub normal_map: Option<NormalMap>,
    pub layers: Layers,
}

/// Which kinds of lobes a material may have somewhere on its surface, whatever its textures have within their range; the guide's page
/// [materials](crate::guide::materials) says what each is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LobeKinds {
    /// Photon maps know these.
    pub rough: bool,
    /// Rays follow these.
    pub sharp_reflection: bool,
    pub sharp_transmission: bool,
    /// One of these is no delta: rays towards lights count for it.
    pub has_width: bool,
    /// Light goes straight on as if nothing were there: through gaps of alpha or a thin smooth wall.
    pub passing: bool,
    /// It is such a wall.
    pub pane: bool,
}

impl LobeKinds {
    pub fn is_sharp(self) -> bool {
        self.sharp_reflection || self.sharp_transmission
    }

    /// `range` gives the least and largest value of a texture's channel.
    pub fn of(material: &Material, range: &mut impl FnMut(usize, usize) -> (f32, f32)) -> LobeKinds {
        let none = LobeKinds::default();
        match material.surface {
            Surface::Lambert | Surface::PaperPhong { .. } | Surface::Glossy { .. } => LobeKinds { rough: true, ..none },
            Surface::Mirror => LobeKinds { sharp_reflection: true, ..none },
            Surface::Dielectric { .. } => LobeKinds { sharp_reflection: true, sharp_transmission: true, ..none },
            Surface::Layered => LobeKinds::of_layered(material, range),
        }
    }

    fn of_layered(material: &Material, range: &mut impl FnMut(usize, usize) -> (f32, f32)) -> LobeKinds {
        let of = &material.layers;
        let mut range = |factor: f32, used: Option<TextureUse>, channel: usize| match used {
            Some(used) if factor > 0.0 => {
                let (least, most) = range(used.texture, channel);
                (factor * least, factor * most)
            }
            _ => (factor, factor),
        };
        let squared = |(least, most): (f32, f32)| (least * least, most * most);
        let map_alpha = MAP_ALPHA_PER_MILLE as f32 / 1000.0;
        let delta_alpha = 1.0 / DELTA_ALPHA_INVERSE as f32;
        // Rays follow a stretched base, whose facets have a width.
        let is_stretched = of.anisotropy > 0.0;
        let mut alpha = squared(range(of.roughness, of.metallic_roughness_texture, 1));
        if is_stretched {
            alpha = (alpha.0.max(delta_alpha), alpha.1.max(delta_alpha));
        }
        let coat_alpha = squared(range(of.coat_roughness, of.coat_roughness_texture, 1));
        let metallic = range(of.metallic, of.metallic_roughness_texture, 2);
        let transmission = range(of.transmission, of.transmission_texture, 0);
        let reflects = metallic.1 > 0.0 || of.specular > 0.0 || of.iridescence > 0.0;
        let transmits = metallic.0 < 1.0 && transmission.1 > 0.0 && material.base_colour != Vec3::ZERO;
        let beyond = range(of.diffuse_transmission, of.diffuse_transmission_texture, 3);
        let has_diffuse = metallic.0 < 1.0 && transmission.0 < 1.0;
        let is_diffuse = has_diffuse && beyond.0 < 1.0 && material.base_colour != Vec3::ZERO;
        let is_beyond = has_diffuse && beyond.1 > 0.0 && of.diffuse_transmission_colour != Vec3::ZERO;
        let is_pane = of.medium.is_none();
        let is_covered = material.coverage == Coverage::Whole;
        if of.is_unlit {
            return LobeKinds { passing: !is_covered, ..LobeKinds::default() };
        }
        let rough = is_diffuse
            || of.sheen_colour != Vec3::ZERO
            || (reflects && alpha.1 >= map_alpha && !is_stretched && !(transmits && !is_pane && transmission.0 >= 1.0))
            || (of.coat > 0.0 && coat_alpha.1 >= map_alpha);
        // A surface without a lobe is black; light still arrives there.
        let is_black = !rough && !reflects && !transmits && !is_beyond && of.coat == 0.0;
        let has_width = |alpha: (f32, f32)| alpha.1 >= delta_alpha;
        LobeKinds {
            rough: rough || is_black,
            sharp_reflection: (reflects && (alpha.0 < map_alpha || is_stretched || (transmits && !is_pane)))
                || (of.coat > 0.0 && coat_alpha.0 < map_alpha),
            sharp_transmission: is_beyond || (transmits && !(is_pane && alpha.1 < delta_alpha)),
            has_width: is_beyond || ((reflects || transmits) && has_width(alpha)) || (of.coat > 0.0 && has_width(coat_alpha)),
            passing: !is_covered || (transmits && is_pane && alpha.0 < delta_alpha),
            pane: transmits && is_pane && alpha.0 < delta_alpha,
        }
    }
}

impl Surface {
    /// Whether light leaves in single directions, so that no density estimate can see it.
    pub fn is_specular(self) -> bool {
        matches!(self, Surface::Mirror | Surface::Dielectric { .. })
    }
}

impl Material {
    pub fn lambert(name: &str, base_colour: Vec3) -> Material {
        Material {
            name: name.to_owned(),
            surface: Surface::Lambert,
            base_colour,
            base_colour_texture: None,
            emission: Vec3::ZERO,
            emission_texture: None,
            two_sided: false,
            coverage: Coverage::Whole,
            normal_map: None,
            layers: Layers::default(),
        }
    }

    /// A layered one without textures.
    pub fn layered(name: &str, base_colour: Vec3, layers: Layers) -> Material {
        Material { surface: Surface::Layered, layers, ..Material::lambert(name, base_colour) }
    }

    /// Whether a layered one is the same as [`Surface::Lambert`], which costs less: it has the diffuse lobe alone, on both sides (the eye
    /// does not see the back of a layered surface that has one side).
    pub fn is_lambertian(&self) -> bool {
        let Layers { metallic, specular, transmission, diffuse_transmission, coat, sheen_colour, iridescence, is_unlit, .. } = self.layers;
        let is_diffuse =
            [metallic, specular, transmission, diffuse_transmission, coat, iridescence] == [0.0; 6] && sheen_colour == Vec3::ZERO;
        is_diffuse && !is_unlit && self.two_sided && self.coverage == Coverage::Whole && self.normal_map.is_none()
    }

    /// What lies behind the surface, of a solid that light enters.
    pub fn enclosed_medium(&self) -> Option<Medium> {
        self.layers.medium.filter(|_| self.transmits())
    }

    /// Whether the solid that it encloses parts colours.
    pub fn is_dispersive(&self) -> bool {
        self.enclosed_medium().is_some() && self.layers.transmission > 0.0 && self.layers.ior_spread() > 0.0
    }

    /// Whether its back scatters and emits as the front does: what transmits lets light out there.
    pub fn has_two_sides(&self) -> bool {
        self.two_sided || self.transmits()
    }

    /// Whether a layered one lets light through or scatters it to its other side.
    pub fn transmits(&self) -> bool {
        let Layers { transmission, diffuse_transmission, is_unlit, .. } = self.layers;
        self.surface == Surface::Layered && (transmission > 0.0 || diffuse_transmission > 0.0) && !is_unlit
    }

    /// Whether it bounds a solid that refracts.
    pub fn is_entered(&self) -> bool {
        matches!(self.surface, Surface::Dielectric { .. }) || self.enclosed_medium().is_some()
    }

    /// Into a solid, through a thin wall, or where alpha has gaps.
    pub fn lets_light_through(&self) -> bool {
        let has_gaps = self.surface == Surface::Layered && self.coverage != Coverage::Whole;
        self.is_entered() || self.transmits() || has_gaps
    }

    /// Whether all light passes it as if it were not there, whatever its textures have.
    pub fn is_not_there(&self) -> bool {
        self.surface == Surface::Layered && self.coverage == Coverage::Blend { alpha: 0.0 }
    }

    /// Every use of a texture.
    pub fn textures(&self) -> impl Iterator<Item = TextureUse> + use<> {
        let plain = [self.base_colour_texture, self.emission_texture];
        plain.into_iter().flatten().chain(self.layer_textures().map(|(_, used)| used))
    }

    /// Those beside the textures of base colour and emission, with the numbers that kernels know them by.
    pub fn layer_textures(&self) -> impl Iterator<Item = (u32, TextureUse)> + use<> {
        self.layers.textures().chain(self.normal_map.map(|map| (LAYER_NORMAL, map.texture)))
    }

    /// Which set of texture coordinates its tangents follow, and how they are transformed; `None`: it needs no tangents.
    pub fn tangent_coordinates(&self) -> Option<(usize, UvTransform)> {
        let of_texture = |used: TextureUse| (used.uv_set, used.transform);
        let stretched = || self.layers.anisotropy_texture.map_or((0, UvTransform::NONE), of_texture);
        self.normal_map.map(|map| of_texture(map.texture)).or_else(|| (self.layers.anisotropy > 0.0).then(stretched))
    }

    /// Whether it uses textures beside those of base colour and emission.
    pub fn has_layer_textures(&self) -> bool {
        self.surface == Surface::Layered && self.layer_textures().next().is_some()
    }

    pub fn is_emissive(&self) -> bool {
        self.emission.max_element() > 0.0
    }
}
