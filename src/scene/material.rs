//! What surfaces are made of.

use glam::{DVec2, Vec3};

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
}

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
    /// The back scatters (and shines) as the front does.
    pub two_sided: bool,
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
        }
    }

    pub fn is_emissive(&self) -> bool {
        self.emission.max_element() > 0.0
    }
}

/// Roughness up to which a metal counts as a mirror: its lobe is narrower than half a degree.
const MIRROR_ROUGHNESS: f32 = 0.08;

/// glTF's metallic-roughness model as one of the surfaces above.
///
/// - transmission of one half or more: a smooth dielectric of the material's index of refraction;
/// - metallic of one half or more: a mirror, or from roughness 0.08 up a modified Phong lobe with the
///   exponent 2 / alpha^2 - 2, alpha = roughness^2, the usual match of Phong and microfacet widths
///   (Walter et al. 2007);
/// - else Lambertian: the faint specular coat of glTF's non-metals is left out.
pub fn surface_of(metallic: f32, roughness: f32, transmission: f32, ior: f32) -> Surface {
    if transmission >= 0.5 {
        return Surface::Dielectric { ior };
    }
    if metallic < 0.5 {
        return Surface::Lambert;
    }
    if roughness < MIRROR_ROUGHNESS {
        return Surface::Mirror;
    }
    let alpha = roughness * roughness;
    Surface::Glossy { exponent: (2.0 / (alpha * alpha) - 2.0).max(0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metallic_roughness_becomes_one_surface() {
        assert_eq!(surface_of(0.0, 0.0, 1.0, 1.33), Surface::Dielectric { ior: 1.33 });
        assert_eq!(surface_of(0.0, 0.3, 0.0, 1.5), Surface::Lambert);
        assert_eq!(surface_of(1.0, 0.0, 0.0, 1.5), Surface::Mirror);
        assert_eq!(surface_of(1.0, 1.0, 0.0, 1.5), Surface::Glossy { exponent: 0.0 });
        let Surface::Glossy { exponent } = surface_of(1.0, 0.5, 0.0, 1.5) else { panic!("rough metal is glossy") };
        assert!((exponent - 30.0).abs() < 1e-4, "{exponent}");
    }
}
