//! Parameters of layered materials: what glTF's metallic-roughness model and its extensions have. Each stands in one place, in `layers!`.

use glam::{DVec2, Vec3};

use crate::constants::*;

/// A texture, the set of coordinates that it is looked up with, and where these lead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextureUse {
    pub texture: usize,
    pub uv_set: usize,
    pub transform: UvTransform,
}

/// What becomes of texture coordinates before a texture is looked up: they are scaled, then turned, then moved
/// (KHR_texture_transform).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UvTransform {
    pub scale: DVec2,
    /// Radians, from u = 1 towards v = -1.
    pub rotation: f64,
    pub offset: DVec2,
}

impl UvTransform {
    pub const NONE: UvTransform = UvTransform { scale: DVec2::ONE, rotation: 0.0, offset: DVec2::ZERO };

    pub fn apply(&self, uv: DVec2) -> DVec2 {
        if *self == UvTransform::NONE {
            return uv;
        }
        let (sine, cosine) = self.rotation.sin_cos();
        let DVec2 { x: u, y: v } = self.scale * uv;
        self.offset + DVec2::new(cosine * u + sine * v, cosine * v - sine * u)
    }
}

impl TextureUse {
    /// As coordinates have it.
    pub fn of(texture: usize, uv_set: usize) -> TextureUse {
        TextureUse { texture, uv_set, transform: UvTransform::NONE }
    }
}

/// Normals in the frame of tangent, bitangent and normal, as codes from -1 to 1; `scale` multiplies the first two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalMap {
    pub texture: TextureUse,
    pub scale: f32,
}

/// What a transmissive surface encloses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Medium {
    /// Share of the light that is left after so many metres, per channel; 1: all of it.
    pub transmittance: Vec3,
    pub metres: f32,
}

impl Medium {
    pub const CLEAR: Medium = Medium { transmittance: Vec3::ONE, metres: 1.0 };
}

/// What a number of a file may be.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Range {
    /// From 0.
    UpTo(f32),
    /// An angle, radians.
    Angle,
    /// An index of refraction.
    Index,
    /// One, or 0 for one without end.
    IndexOrZero,
}

/// Of numbers without an upper limit of their own.
pub(crate) const ANY: f32 = f32::MAX;

/// What a member of a glTF material is: its name in complaints and what it may be, or the number that kernels know its texture by; and the
/// field that has it.
pub(crate) enum Parameter {
    Number(&'static str, Range, fn(&mut Layers) -> &mut f32),
    /// Each channel from 0 to the limit.
    Colour(&'static str, f32, fn(&mut Layers) -> &mut Vec3),
    NumberTexture(u32, fn(&mut Layers) -> &mut Option<TextureUse>),
    /// By the sRGB curve.
    ColourTexture(u32, fn(&mut Layers) -> &mut Option<TextureUse>),
    NormalMap(u32, fn(&mut Layers) -> &mut Option<NormalMap>),
}

/// The object that every glTF material has.
pub(crate) const METALLIC_ROUGHNESS: &str = "pbrMetallicRoughness";

/// Declares [`Layers`] and [`PARAMETERS`]: by the extension that has them fields with their defaults, and members of the file with the kind of
/// parameter that each is.
macro_rules! layers {
    ($($group:literal { $(
        $(#[$doc:meta])* $field:ident: $type:ty = $default:expr $(, $member:literal $kind:ident($($argument:expr),*) $([$index:literal])?)*;
    )* })*) => {
        /// glTF's metallic-roughness model and what its extensions add. Factors multiply textures; the guide's page
        /// [materials](crate::guide::materials) has the formulas.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Layers {
            $($($(#[$doc])* pub $field: $type,)*)*
        }

        impl Default for Layers {
            /// What a glTF material is that says nothing.
            fn default() -> Layers {
                Layers { $($($field: $default,)*)* }
            }
        }

        /// Members of glTF's materials, by the extension that has them. Files are read and written by it; what is missing has the value of
        /// [`Layers::default`]. Textures of the scene are numbered in this order.
        pub(crate) const PARAMETERS: &[(&str, &[(&str, Parameter)])] = {
            use Range::*;
            &[$(($group, &[$($(($member, Parameter::$kind($($argument,)* |of| &mut of.$field$([$index])?)),)*)*])),*]
        };
    };
}

layers! {
    "pbrMetallicRoughness" {
        metallic: f32 = 1.0, "metallicFactor" Number("the metallic factor", UpTo(1.0));
        roughness: f32 = 1.0, "roughnessFactor" Number("the roughness factor", UpTo(1.0));
        /// Roughness in green, metalness in blue.
        metallic_roughness_texture: Option<TextureUse> = None, "metallicRoughnessTexture" NumberTexture(LAYER_METALLIC_ROUGHNESS);
    }
    "KHR_materials_ior" {
        /// Of the dielectric; 0: it reflects as if the index were infinite.
        ior: f32 = 1.5, "ior" Number("the index of refraction", IndexOrZero);
    }
    "KHR_materials_anisotropy" {
        /// How much rougher the base is along one direction than across it, 0 to 1; the texture has it in blue.
        anisotropy: f32 = 0.0, "anisotropyStrength" Number("the anisotropy strength", UpTo(1.0));
        /// Radians that turn the direction counter-clockwise from the tangent; the texture has a direction in red and green, from -1 to 1.
        anisotropy_rotation: f32 = 0.0, "anisotropyRotation" Number("the anisotropy rotation", Angle);
        anisotropy_texture: Option<TextureUse> = None, "anisotropyTexture" NumberTexture(LAYER_ANISOTROPY);
    }
    "KHR_materials_specular" {
        /// Scales what the dielectric reflects; the texture has it in alpha.
        specular: f32 = 1.0, "specularFactor" Number("the specular factor", UpTo(1.0));
        specular_texture: Option<TextureUse> = None, "specularTexture" NumberTexture(LAYER_SPECULAR);
        /// Tints what the dielectric reflects along the normal.
        specular_colour: Vec3 = Vec3::ONE, "specularColorFactor" Colour("the specular colour", ANY);
        specular_colour_texture: Option<TextureUse> = None, "specularColorTexture" ColourTexture(LAYER_SPECULAR_COLOUR);
    }
    "KHR_materials_transmission" {
        /// Share of what enters the dielectric that it lets through; the texture has it in red.
        transmission: f32 = 0.0, "transmissionFactor" Number("the transmission factor", UpTo(1.0));
        transmission_texture: Option<TextureUse> = None, "transmissionTexture" NumberTexture(LAYER_TRANSMISSION);
    }
    "KHR_materials_diffuse_transmission" {
        /// Share of the diffuse lobe that scatters to the other side; the texture has it in alpha.
        diffuse_transmission: f32 = 0.0, "diffuseTransmissionFactor" Number("the diffuse transmission factor", UpTo(1.0));
        diffuse_transmission_texture: Option<TextureUse> = None, "diffuseTransmissionTexture" NumberTexture(LAYER_DIFFUSE_TRANSMISSION);
        diffuse_transmission_colour: Vec3 = Vec3::ONE, "diffuseTransmissionColorFactor" Colour("the diffuse transmission colour", 1.0);
        diffuse_transmission_colour_texture: Option<TextureUse> = None,
            "diffuseTransmissionColorTexture" ColourTexture(LAYER_DIFFUSE_TRANSMISSION_COLOUR);
    }
    "KHR_materials_volume" {
        /// `None`: a thin wall.
        medium: Option<Medium> = None;
    }
    "KHR_materials_dispersion" {
        /// 20 over the Abbe number of what it encloses; 0: all colours have the same index.
        dispersion: f32 = 0.0, "dispersion" Number("the dispersion", UpTo(ANY));
    }
    "KHR_materials_iridescence" {
        /// Share of the surface under a thin film; the texture has it in red.
        iridescence: f32 = 0.0, "iridescenceFactor" Number("the iridescence factor", UpTo(1.0));
        iridescence_texture: Option<TextureUse> = None, "iridescenceTexture" NumberTexture(LAYER_IRIDESCENCE);
        film_ior: f32 = 1.3, "iridescenceIor" Number("a film of the index of refraction", Index);
        /// Nanometres, where the texture is 0 and where it is 1, or missing; it has them in green.
        film_thickness: [f32; 2] = [100.0, 400.0],
            "iridescenceThicknessMinimum" Number("the thickness of its film", UpTo(ANY)) [0],
            "iridescenceThicknessMaximum" Number("the thickness of its film", UpTo(ANY)) [1];
        film_thickness_texture: Option<TextureUse> = None, "iridescenceThicknessTexture" NumberTexture(LAYER_IRIDESCENCE_THICKNESS);
    }
    "KHR_materials_clearcoat" {
        /// Share of the surface under a clear coat; the texture has it in red.
        coat: f32 = 0.0, "clearcoatFactor" Number("the clear coat factor", UpTo(1.0));
        coat_texture: Option<TextureUse> = None, "clearcoatTexture" NumberTexture(LAYER_COAT);
        coat_roughness: f32 = 0.0, "clearcoatRoughnessFactor" Number("the clear coat roughness", UpTo(1.0));
        /// In green.
        coat_roughness_texture: Option<TextureUse> = None, "clearcoatRoughnessTexture" NumberTexture(LAYER_COAT_ROUGHNESS);
        /// The coat's own; without one it has the normals of the mesh.
        coat_normal_map: Option<NormalMap> = None, "clearcoatNormalTexture" NormalMap(LAYER_COAT_NORMAL);
    }
    "KHR_materials_sheen" {
        sheen_colour: Vec3 = Vec3::ZERO, "sheenColorFactor" Colour("the sheen colour", 1.0);
        sheen_colour_texture: Option<TextureUse> = None, "sheenColorTexture" ColourTexture(LAYER_SHEEN_COLOUR);
        sheen_roughness: f32 = 0.0, "sheenRoughnessFactor" Number("the sheen roughness", UpTo(1.0));
        /// In alpha.
        sheen_roughness_texture: Option<TextureUse> = None, "sheenRoughnessTexture" NumberTexture(LAYER_SHEEN_ROUGHNESS);
    }
    "KHR_materials_unlit" {
        /// The base colour is shown to the eye as radiance, W/m2/sr; no lobe is left.
        is_unlit: bool = false;
    }
}

impl Layers {
    /// Half of what lies between its indices of refraction for red and for blue (KHR_materials_dispersion).
    pub fn ior_spread(&self) -> f32 {
        // Of more than the range of indices nothing is left to see.
        (0.5 * (self.ior - 1.0).max(0.0) * (self.dispersion / 20.0)).min(100.0)
    }

    /// The factors alone.
    pub fn without_textures(mut self) -> Layers {
        for (_, parameter) in PARAMETERS.iter().flat_map(|(_, members)| *members) {
            match parameter {
                Parameter::NumberTexture(_, of) | Parameter::ColourTexture(_, of) => *of(&mut self) = None,
                Parameter::NormalMap(_, of) => *of(&mut self) = None,
                Parameter::Number(..) | Parameter::Colour(..) => {}
            }
        }
        self
    }

    /// Every use of a texture, with the number that kernels know it by, in the order of [`PARAMETERS`].
    pub fn textures(mut self) -> impl Iterator<Item = (u32, TextureUse)> {
        PARAMETERS.iter().flat_map(|(_, members)| *members).filter_map(move |(_, parameter)| match parameter {
            Parameter::NumberTexture(layer, of) | Parameter::ColourTexture(layer, of) => Some((*layer, (*of(&mut self))?)),
            Parameter::NormalMap(layer, of) => Some((*layer, (*of(&mut self))?.texture)),
            Parameter::Number(..) | Parameter::Colour(..) => None,
        })
    }
}
