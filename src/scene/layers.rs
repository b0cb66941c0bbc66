//! Parameters of layered materials: what glTF's metallic-roughness model and its extensions have, a field and a row of [`PARAMETERS`] each.

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

/// glTF's metallic-roughness model and what its extensions add. Factors multiply textures; the guide's page
/// [materials](crate::guide::materials) has the formulas.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layers {
    pub metallic: f32,
    pub roughness: f32,
    /// Roughness in green, metalness in blue.
    pub metallic_roughness_texture: Option<TextureUse>,
    /// How much rougher the base is along one direction than across it, 0 to 1; the texture has it in blue.
    pub anisotropy: f32,
    /// Radians that turn the direction counter-clockwise from the tangent; the texture has a direction in red and green, from -1 to 1.
    pub anisotropy_rotation: f32,
    pub anisotropy_texture: Option<TextureUse>,
    /// Of the dielectric; 0: it reflects as if the index were infinite.
    pub ior: f32,
    /// Scales what the dielectric reflects; the texture has it in alpha.
    pub specular: f32,
    pub specular_texture: Option<TextureUse>,
    /// Tints what the dielectric reflects along the normal.
    pub specular_colour: Vec3,
    pub specular_colour_texture: Option<TextureUse>,
    /// Share of what enters the dielectric that it lets through; the texture has it in red.
    pub transmission: f32,
    pub transmission_texture: Option<TextureUse>,
    /// Share of the diffuse lobe that scatters to the other side; the texture has it in alpha.
    pub diffuse_transmission: f32,
    pub diffuse_transmission_texture: Option<TextureUse>,
    pub diffuse_transmission_colour: Vec3,
    pub diffuse_transmission_colour_texture: Option<TextureUse>,
    /// `None`: a thin wall.
    pub medium: Option<Medium>,
    /// 20 over the Abbe number of what it encloses; 0: all colours have the same index.
    pub dispersion: f32,
    /// Share of the surface under a thin film; the texture has it in red.
    pub iridescence: f32,
    pub iridescence_texture: Option<TextureUse>,
    pub film_ior: f32,
    /// Nanometres, where the texture is 0 and where it is 1, or missing; it has them in green.
    pub film_thickness: [f32; 2],
    pub film_thickness_texture: Option<TextureUse>,
    /// Share of the surface under a clear coat; the texture has it in red.
    pub coat: f32,
    pub coat_texture: Option<TextureUse>,
    pub coat_roughness: f32,
    /// In green.
    pub coat_roughness_texture: Option<TextureUse>,
    /// The coat's own; without one it has the normals of the mesh.
    pub coat_normal_map: Option<NormalMap>,
    pub sheen_colour: Vec3,
    pub sheen_colour_texture: Option<TextureUse>,
    pub sheen_roughness: f32,
    /// In alpha.
    pub sheen_roughness_texture: Option<TextureUse>,
    /// The base colour is shown to the eye as radiance, W/m2/sr; no lobe is left.
    pub is_unlit: bool,
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

impl Default for Layers {
    /// What a glTF material is that says nothing.
    fn default() -> Layers {
        Layers {
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            anisotropy: 0.0,
            anisotropy_rotation: 0.0,
            anisotropy_texture: None,
            ior: 1.5,
            specular: 1.0,
            specular_texture: None,
            specular_colour: Vec3::ONE,
            specular_colour_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            diffuse_transmission: 0.0,
            diffuse_transmission_texture: None,
            diffuse_transmission_colour: Vec3::ONE,
            diffuse_transmission_colour_texture: None,
            medium: None,
            dispersion: 0.0,
            iridescence: 0.0,
            iridescence_texture: None,
            film_ior: 1.3,
            film_thickness: [100.0, 400.0],
            film_thickness_texture: None,
            coat: 0.0,
            coat_texture: None,
            coat_roughness: 0.0,
            coat_roughness_texture: None,
            coat_normal_map: None,
            sheen_colour: Vec3::ZERO,
            sheen_colour_texture: None,
            sheen_roughness: 0.0,
            sheen_roughness_texture: None,
            is_unlit: false,
        }
    }
}

/// What a number of a file may be.
#[derive(Debug, Clone, Copy)]
pub enum Range {
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
pub const ANY: f32 = f32::MAX;

/// What a member of a glTF material is: its name in complaints and what it may be, or the number that kernels know its texture by; and the
/// field that has it.
pub enum Parameter {
    Number(&'static str, Range, fn(&mut Layers) -> &mut f32),
    /// Each channel from 0 to the limit.
    Colour(&'static str, f32, fn(&mut Layers) -> &mut Vec3),
    NumberTexture(u32, fn(&mut Layers) -> &mut Option<TextureUse>),
    /// By the sRGB curve.
    ColourTexture(u32, fn(&mut Layers) -> &mut Option<TextureUse>),
    NormalMap(u32, fn(&mut Layers) -> &mut Option<NormalMap>),
}

/// The object that every glTF material has.
pub const METALLIC_ROUGHNESS: &str = "pbrMetallicRoughness";

/// Members of glTF's materials, by the extension that has them. Files are read and written by it; what is missing has the value of
/// [`Layers::default`]. Textures of the scene are numbered in this order.
pub const PARAMETERS: &[(&str, &[(&str, Parameter)])] = {
    use Parameter::*;
    use Range::*;
    &[
        (
            METALLIC_ROUGHNESS,
            &[
                ("metallicFactor", Number("the metallic factor", UpTo(1.0), |of| &mut of.metallic)),
                ("roughnessFactor", Number("the roughness factor", UpTo(1.0), |of| &mut of.roughness)),
                ("metallicRoughnessTexture", NumberTexture(LAYER_METALLIC_ROUGHNESS, |of| &mut of.metallic_roughness_texture)),
            ],
        ),
        ("KHR_materials_ior", &[("ior", Number("the index of refraction", IndexOrZero, |of| &mut of.ior))]),
        (
            "KHR_materials_anisotropy",
            &[
                ("anisotropyStrength", Number("the anisotropy strength", UpTo(1.0), |of| &mut of.anisotropy)),
                ("anisotropyRotation", Number("the anisotropy rotation", Angle, |of| &mut of.anisotropy_rotation)),
                ("anisotropyTexture", NumberTexture(LAYER_ANISOTROPY, |of| &mut of.anisotropy_texture)),
            ],
        ),
        (
            "KHR_materials_specular",
            &[
                ("specularFactor", Number("the specular factor", UpTo(1.0), |of| &mut of.specular)),
                ("specularTexture", NumberTexture(LAYER_SPECULAR, |of| &mut of.specular_texture)),
                ("specularColorFactor", Colour("the specular colour", ANY, |of| &mut of.specular_colour)),
                ("specularColorTexture", ColourTexture(LAYER_SPECULAR_COLOUR, |of| &mut of.specular_colour_texture)),
            ],
        ),
        (
            "KHR_materials_transmission",
            &[
                ("transmissionFactor", Number("the transmission factor", UpTo(1.0), |of| &mut of.transmission)),
                ("transmissionTexture", NumberTexture(LAYER_TRANSMISSION, |of| &mut of.transmission_texture)),
            ],
        ),
        (
            "KHR_materials_diffuse_transmission",
            &[
                ("diffuseTransmissionFactor", Number("the diffuse transmission factor", UpTo(1.0), |of| &mut of.diffuse_transmission)),
                ("diffuseTransmissionTexture", NumberTexture(LAYER_DIFFUSE_TRANSMISSION, |of| &mut of.diffuse_transmission_texture)),
                (
                    "diffuseTransmissionColorFactor",
                    Colour("the diffuse transmission colour", 1.0, |of| &mut of.diffuse_transmission_colour),
                ),
                (
                    "diffuseTransmissionColorTexture",
                    ColourTexture(LAYER_DIFFUSE_TRANSMISSION_COLOUR, |of| &mut of.diffuse_transmission_colour_texture),
                ),
            ],
        ),
        ("KHR_materials_dispersion", &[("dispersion", Number("the dispersion", UpTo(ANY), |of| &mut of.dispersion))]),
        (
            "KHR_materials_iridescence",
            &[
                ("iridescenceFactor", Number("the iridescence factor", UpTo(1.0), |of| &mut of.iridescence)),
                ("iridescenceTexture", NumberTexture(LAYER_IRIDESCENCE, |of| &mut of.iridescence_texture)),
                ("iridescenceIor", Number("a film of the index of refraction", Index, |of| &mut of.film_ior)),
                ("iridescenceThicknessMinimum", Number("the thickness of its film", UpTo(ANY), |of| &mut of.film_thickness[0])),
                ("iridescenceThicknessMaximum", Number("the thickness of its film", UpTo(ANY), |of| &mut of.film_thickness[1])),
                ("iridescenceThicknessTexture", NumberTexture(LAYER_IRIDESCENCE_THICKNESS, |of| &mut of.film_thickness_texture)),
            ],
        ),
        (
            "KHR_materials_clearcoat",
            &[
                ("clearcoatFactor", Number("the clear coat factor", UpTo(1.0), |of| &mut of.coat)),
                ("clearcoatTexture", NumberTexture(LAYER_COAT, |of| &mut of.coat_texture)),
                ("clearcoatRoughnessFactor", Number("the clear coat roughness", UpTo(1.0), |of| &mut of.coat_roughness)),
                ("clearcoatRoughnessTexture", NumberTexture(LAYER_COAT_ROUGHNESS, |of| &mut of.coat_roughness_texture)),
                ("clearcoatNormalTexture", NormalMap(LAYER_COAT_NORMAL, |of| &mut of.coat_normal_map)),
            ],
        ),
        (
            "KHR_materials_sheen",
            &[
                ("sheenColorFactor", Colour("the sheen colour", 1.0, |of| &mut of.sheen_colour)),
                ("sheenColorTexture", ColourTexture(LAYER_SHEEN_COLOUR, |of| &mut of.sheen_colour_texture)),
                ("sheenRoughnessFactor", Number("the sheen roughness", UpTo(1.0), |of| &mut of.sheen_roughness)),
                ("sheenRoughnessTexture", NumberTexture(LAYER_SHEEN_ROUGHNESS, |of| &mut of.sheen_roughness_texture)),
            ],
        ),
    ]
};
