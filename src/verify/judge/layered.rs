//! Layered materials at a point of a scene: what their textures, coverage and normal maps come to.

use glam::{DVec2, DVec3, DVec4};

use super::geometry::{Geometry, Hit, Triangle, Vertex};
use super::lobes::{Film, Frame, Inputs, Lobes, Wall};
use super::material::fresnel;
use super::media::{Media, is_solid};
use super::microfacets::is_delta;
use crate::constants::{DELTA_ALPHA_INVERSE, SMOOTH_TOTAL_REFLECTIONS};
use crate::scene::Surface;
use crate::scene::material::{Coverage, NormalMap, TextureUse};

/// No eye sees a turned normal at less than this cosine.
const LEAST_COSINE: f64 = 0.01;
/// What sheen's squared roughness is at least.
const LEAST_SHEEN: f64 = 0.01;

/// From a tangent with the sign of the bitangent, and the front's normal.
fn tangent_and_bitangent(tangent: DVec4, front: DVec3) -> [DVec3; 2] {
    let along = tangent.truncate();
    [along, tangent.w.signum() * front.cross(along)]
}

/// A normal that the eye sees: moved towards it where it would face away.
fn towards_eye(n: DVec3, wo: DVec3) -> DVec3 {
    let cosine = n.dot(wo);
    if cosine < LEAST_COSINE { (n + (LEAST_COSINE - cosine) * wo).normalize() } else { n }
}

impl<'a> Geometry<'a> {
    /// The share of a surface that is there.
    pub(super) fn coverage(&self, triangle: &Triangle, weights: DVec3) -> f64 {
        let material = triangle.material;
        let alpha =
            |factor: f32| f64::from(factor) * self.texel(material.base_colour_texture, triangle, weights).w * triangle.alpha(weights);
        match material.coverage {
            _ if material.surface != Surface::Layered => 1.0,
            Coverage::Whole => 1.0,
            Coverage::Mask { alpha: factor, cutoff } => f64::from(u8::from(alpha(factor) >= f64::from(cutoff))),
            Coverage::Blend { alpha: factor } => alpha(factor).clamp(0.0, 1.0),
        }
    }

    /// The normal that a map makes of `normal`, which is on the side of `wo`. Seen from behind, a surface has the same shape.
    fn mapped(
        &self,
        map: Option<NormalMap>,
        tangents: &[[DVec4; 3]],
        (triangle, weights): (&Triangle, DVec3),
        normal: DVec3,
        (wo, is_front): (DVec3, bool),
    ) -> DVec3 {
        let (Some(map), false) = (map, tangents.is_empty()) else { return normal };
        let front = if is_front { normal } else { -normal };
        let [along, across] = tangent_and_bitangent(triangle.mixed(tangents[triangle.index], weights), front);
        let code = 2.0 * self.texel(Some(map.texture), triangle, weights).truncate() - 1.0;
        let scale = f64::from(map.scale);
        let turned = (scale * (code.x * along + code.y * across) + code.z * front).normalize_or(front);
        towards_eye(if is_front { turned } else { -turned }, wo)
    }

    /// The shading normal of a surface with its normal map.
    pub(super) fn mapped_normal(&self, hit: &Hit, vertex: &Vertex) -> DVec3 {
        let triangle = &self.triangles[hit.triangle];
        let seen = (vertex.wo, vertex.is_front);
        self.mapped(triangle.material.normal_map, &triangle.mesh.tangents, (triangle, hit.weights), vertex.ns, seen)
    }

    /// Where an anisotropic base is rougher, about the normal `n`, and how much; `front` is the front's normal by the mesh.
    fn stretch(&self, (triangle, weights): (&Triangle, DVec3), front: DVec3, n: DVec3, alpha: f64) -> (DVec3, f64) {
        let layers = &triangle.material.layers;
        // Without a picture: along the tangent, at full strength.
        let texel = layers.anisotropy_texture.map(|_| self.texel(layers.anisotropy_texture, triangle, weights).truncate());
        let DVec3 { x, y, z: strength } = texel.unwrap_or(DVec3::new(1.0, 0.5, 1.0));
        let code = DVec2::from_angle(layers.anisotropy_rotation.into()).rotate(2.0 * DVec2::new(x, y) - 1.0);
        let corners = triangle.mesh.tangents.get(triangle.index).copied().unwrap_or([DVec4::new(1.0, 0.0, 0.0, 1.0); 3]);
        let [along, across] = tangent_and_bitangent(triangle.mixed(corners, weights), front);
        let way = (code.x * along + code.y * across).reject_from_normalized(n);
        let tangent = if way.length() > 1e-6 { way.normalize() } else { n.any_orthonormal_vector() };
        (tangent, alpha + (f64::from(layers.anisotropy) * strength).powi(2) * (1.0 - alpha))
    }

    /// The lobes of a layered surface that is seen from within `media`, by a path that has met `depth` surfaces before.
    /// `channel`: the only one that it has light in.
    pub(super) fn lobes(&self, hit: &Hit, vertex: &Vertex, media: &Media<'a>, channel: Option<usize>, depth: u32) -> Lobes {
        let (triangle, wo) = (&self.triangles[hit.triangle], vertex.wo);
        let (material, layers) = (triangle.material, &triangle.material.layers);
        let texel = |texture: Option<TextureUse>| self.texel(texture, triangle, hit.weights);
        let metallic_roughness = texel(layers.metallic_roughness_texture);
        let squared = |roughness: f32, texel: f64| (f64::from(roughness) * texel).powi(2);
        let mut alpha = squared(layers.roughness, metallic_roughness.y);
        if layers.anisotropy > 0.0 {
            // A line of facets has a width, as it is no delta.
            alpha = alpha.max(1.0 / f64::from(DELTA_ALPHA_INVERSE));
        }
        let wall = if is_solid(material) {
            let before = media.clone().before(material, vertex.is_front);
            Wall::Solid { from: before.index(channel), to: before.beyond(material, vertex.is_front).index(channel) }
        } else {
            Wall::Thin
        };
        let place = (triangle, hit.weights);
        let mut n = self.mapped_normal(hit, vertex);
        let coat_n = self.mapped(layers.coat_normal_map, &triangle.mesh.coat_tangents, place, vertex.ns, (wo, vertex.is_front));
        // Total reflection by a shading normal alone has an end: glass would keep light that its triangles let out.
        if let Wall::Solid { from, to } = wall
            && depth >= SMOOTH_TOTAL_REFLECTIONS
            && is_delta(alpha)
            && fresnel(n.dot(wo), from, to) == 1.0
        {
            n = vertex.ng;
        }
        let front = if vertex.is_front { vertex.ns } else { -vertex.ns };
        let inputs = Inputs {
            stretch: (layers.anisotropy > 0.0).then(|| self.stretch(place, front, n, alpha)),
            base_colour: vertex.base_colour,
            metalness: f64::from(layers.metallic) * metallic_roughness.z,
            alpha,
            ior: f64::from(layers.ior),
            specular: f64::from(layers.specular) * texel(layers.specular_texture).w,
            specular_colour: layers.specular_colour.as_dvec3() * texel(layers.specular_colour_texture).truncate(),
            transmission: f64::from(layers.transmission) * texel(layers.transmission_texture).x,
            wall,
            diffuse_transmission: f64::from(layers.diffuse_transmission) * texel(layers.diffuse_transmission_texture).w,
            diffuse_transmission_colour: layers.diffuse_transmission_colour.as_dvec3()
                * texel(layers.diffuse_transmission_colour_texture).truncate(),
            film: Film {
                share: f64::from(layers.iridescence) * texel(layers.iridescence_texture).x,
                ior: f64::from(layers.film_ior),
                thickness: {
                    let [least, most] = layers.film_thickness.map(f64::from);
                    least + (most - least) * texel(layers.film_thickness_texture).y
                },
                bound: self.film_bounds[triangle.mesh.material],
            },
            coat: f64::from(layers.coat) * texel(layers.coat_texture).x,
            coat_alpha: squared(layers.coat_roughness, texel(layers.coat_roughness_texture).y),
            sheen_colour: layers.sheen_colour.as_dvec3() * texel(layers.sheen_colour_texture).truncate(),
            sheen_s: squared(layers.sheen_roughness, texel(layers.sheen_roughness_texture).w).max(LEAST_SHEEN),
        };
        Lobes::new(&inputs, Frame { wo, ng: vertex.ng, n, coat_n })
    }
}
