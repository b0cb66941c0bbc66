//! Records of layered materials: their factors, where their textures are looked up, and what triangles have for these.

use glam::{DMat2, DVec2, DVec3, DVec4, Vec2, Vec3};

use super::media::Media;
use super::pack_normal;
use super::parts::Part;
use super::turns::{self, Turns};
use crate::constants::*;
use crate::records::{LayeredMaterial, TextureInfo, TriangleLayers};
use crate::scene::material::{Coverage, LobeKinds, NormalMap, TextureUse};
use crate::scene::texture::Wrap;
use crate::scene::{Material, Scene, Texture};

/// A record for each material. What they look up is added behind the textures of the scene.
pub(super) fn records(scene: &Scene, media: &Media, unit: f64, textures: &mut Vec<TextureInfo>) -> Vec<LayeredMaterial> {
    let mut records: Vec<LayeredMaterial> = scene.materials.iter().zip(scene.lobe_kinds()).map(record).collect();
    for ((material, record), medium) in scene.materials.iter().zip(&mut records).zip(&media.numbers) {
        record.medium = *medium;
        record.first_lookup = textures.len() as u32;
        for (layer, used) in material.layer_textures() {
            textures.push(lookup(textures[used.texture], layer, used, scene.textures[used.texture].wrap));
        }
        record.end_lookup = textures.len() as u32;
    }
    // Black after some way is black after any: the limit keeps products finite.
    let absorption = |transmittance: f32, metres: f32| (-f64::from(transmittance).ln() / f64::from(metres) * unit).clamp(0.0, 1e30) as f32;
    // Looked up by the medium's number.
    for ((ior, spread, medium), record) in media.all.iter().zip(&mut records) {
        record.medium_ior = ior.max(1e-3);
        record.medium_spread = *spread;
        record.medium_absorption = Vec3::from(medium.transmittance.to_array().map(|share| absorption(share, medium.metres)));
    }
    records
}

fn record((material, kinds): (&Material, LobeKinds)) -> LayeredMaterial {
    let of = &material.layers;
    let scale = |map: Option<NormalMap>| map.map_or(1.0, |map| map.scale);
    let (coverage, alpha, cutoff) = match material.coverage {
        Coverage::Whole => (COVERAGE_WHOLE, 1.0, 0.0),
        Coverage::Mask { alpha, cutoff } => (COVERAGE_MASK, alpha, cutoff),
        Coverage::Blend { alpha } => (COVERAGE_BLEND, alpha, 0.0),
    };
    LayeredMaterial {
        metallic: of.metallic,
        roughness: of.roughness,
        ior: of.ior,
        specular: of.specular,
        specular_colour: of.specular_colour,
        transmission: of.transmission,
        anisotropy: of.anisotropy,
        anisotropy_turn: Vec2::from_angle(of.anisotropy_rotation),
        is_solid: u32::from(of.medium.is_some()),
        // Of all materials together.
        medium: 0,
        medium_absorption: Vec3::ZERO,
        medium_ior: 1.0,
        ior_spread: of.ior_spread(),
        medium_spread: 0.0,
        iridescence: of.iridescence,
        film_ior: of.film_ior,
        film_least: of.film_thickness[0],
        film_most: of.film_thickness[1],
        film_bound: of.film_bound() as f32,
        diffuse_transmission: of.diffuse_transmission,
        diffuse_transmission_colour: of.diffuse_transmission_colour,
        coat: of.coat,
        coat_roughness: of.coat_roughness,
        sheen_colour: of.sheen_colour,
        sheen_roughness: of.sheen_roughness,
        normal_scale: scale(material.normal_map),
        coat_normal_scale: scale(of.coat_normal_map),
        coverage,
        alpha,
        cutoff,
        is_unlit: u32::from(of.is_unlit),
        is_rough: u32::from(kinds.rough),
        // Of all materials together, too.
        first_lookup: 0,
        end_lookup: 0,
    }
}

fn lookup(texture: TextureInfo, layer: u32, used: TextureUse, wrap: [Wrap; 2]) -> TextureInfo {
    let offset = used.transform.apply(DVec2::ZERO);
    let turn = DMat2::from_cols(used.transform.apply(DVec2::X) - offset, used.transform.apply(DVec2::Y) - offset).transpose();
    TextureInfo {
        layer,
        uv_set: used.uv_set as u32,
        row_u: turn.x_axis.as_vec2(),
        row_v: turn.y_axis.as_vec2(),
        offset: turns::near_offset(offset, wrap).as_vec2(),
        ..texture
    }
}

/// Whether any triangle has something for them.
pub(super) fn is_needed(scene: &Scene) -> bool {
    scene.materials.iter().any(|material| material.has_layer_textures() || material.layers.anisotropy > 0.0)
}

/// How the textures of a material's layers, those of each set of coordinates, look up what lies far from 0; `None` where they do so in
/// several ways.
pub(super) fn turns(material: &Material, textures: &[Texture]) -> [Option<Turns>; 2] {
    [0, 1].map(|set| {
        let of_set = material.layer_textures().map(|(_, used)| used).filter(|used| used.uv_set == set);
        let mut all = of_set.map(|used| (used.transform, textures[used.texture].wrap));
        let first = all.next()?;
        all.all(|other| other == first).then(|| Turns::new(first.0, first.1)).flatten()
    })
}

pub(super) fn of_part(part: Part, turns: &[Option<Turns>; 2]) -> TriangleLayers {
    let Part { mesh, triangle, .. } = part;
    let corners = |set: usize| {
        let uvs = part.own_uvs(set);
        let uvs = turns[set].as_ref().map_or(uvs, |turns| turns.near(uvs));
        part.at_corners(uvs).map(DVec2::as_vec2)
    };
    let tangents = |tangents: &[[DVec4; 3]]| {
        let corners = tangents.get(triangle).copied().unwrap_or([DVec4::new(1.0, 0.0, 0.0, 1.0); 3]);
        let packed = part.at_corners(corners.map(DVec4::truncate)).map(|tangent| pack_normal(tangent.normalize_or(DVec3::X).as_vec3()));
        (packed, u32::from(corners[0].w < 0.0))
    };
    let ([first_a, first_b, first_c], [second_a, second_b, second_c]) = (corners(0), corners(1));
    let ([tangent_a, tangent_b, tangent_c], turned) = tangents(&mesh.tangents);
    let ([coat_tangent_a, coat_tangent_b, coat_tangent_c], coat_turned) = tangents(&mesh.coat_tangents);
    TriangleLayers {
        first_a,
        first_b,
        first_c,
        second_a,
        second_b,
        second_c,
        tangent_a,
        tangent_b,
        tangent_c,
        coat_tangent_a,
        coat_tangent_b,
        coat_tangent_c,
        turned: turned | coat_turned << 3,
    }
}
