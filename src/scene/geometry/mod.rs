//! A scene as the kernels see it: triangles in the order of the BVH's leaves, materials, textures and
//! emitters, as plain records.
//!
//! Lengths are normalised: `local = (world - centre) / unit` with `unit` a power of two, so that scaling a
//! scene by a power of two changes no bit, and every coordinate lies within (-1, 1). Radiance and
//! irradiance keep their units; a flux in W is divided by `unit`^2.

mod emitters;
mod lamp_pieces;
mod layered;
mod media;
mod parts;
mod turns;
mod warnings;

use glam::{DVec3, Vec2, Vec2Swizzles as _, Vec3, Vec4};
use rayon::prelude::*;

use self::media::Media;
use self::parts::{Leaves, Part, Parts};
use super::bvh::Bvh;
use super::contact_offsets::Offsets;
use super::frame::Frame;
use super::texture::{Filter, LINEAR_OF_SRGB, Texels, Wrap};
use super::{Material, Progress, Scene, Surface, Texture, contact};
use crate::constants::*;
use crate::error::{Error, Result};
use crate::records::{
    BvhNode, Emitter, LayeredMaterial, SurfaceMaterial, TextureInfo, Triangle, TriangleColours, TriangleLayers, TriangleNormals,
    TriangleUvs,
};

#[derive(Debug, Clone)]
pub(crate) struct Geometry {
    pub centre: DVec3,
    /// Metres in a normalised length of 1.
    pub unit: f64,
    /// Lowest and highest corner, normalised.
    pub bounds: (Vec3, Vec3),
    /// Radius of a sphere around the middle that holds everything, normalised.
    pub radius: f64,
    /// Area of all surfaces, normalised; where some lie on one another, of one.
    pub area: f64,
    pub nodes: Vec<BvhNode>,
    pub triangles: Vec<Triangle>,
    /// Of triangles: unit normal n of the front, then what makes n . p + offset = 0.
    pub planes: Vec<Vec4>,
    /// The number of the first plane that only sheets of points in the air lie in ([`super::sensors`]); such planes are the last ones.
    pub first_sensor_plane: u32,
    pub normals: Vec<TriangleNormals>,
    pub uvs: Vec<TriangleUvs>,
    /// One for all triangles where no mesh has any.
    pub colours: Vec<TriangleColours>,
    pub materials: Vec<SurfaceMaterial>,
    /// One a material.
    pub layered_materials: Vec<LayeredMaterial>,
    /// One for all triangles where no layered material has a texture of its own, or a normal map.
    pub triangle_layers: Vec<TriangleLayers>,
    pub textures: Vec<TextureInfo>,
    /// Those that the kernels look 8-bit codes up in, then those of all textures.
    pub texels: Vec<u32>,
    /// What emits light, the environment last.
    pub emitters: Vec<Emitter>,
    /// Largest value of the picture of a sky, in its texels' units.
    pub sky_most: f32,
    /// W of a photon of relative flux 1 that stands for all light, over `unit`^2.
    pub flux_unit: f64,
    /// W of all emitters, all channels together, over `unit`^2.
    pub power: f64,
    /// Triangles that f32 makes a line of, or that lie on others.
    pub left_out: usize,
    /// Meshes that overlap in one plane, facing alike: (hidden there, seen there), each pair once.
    pub overlaps: Vec<(u32, u32)>,
    /// Triangles that more others overlap than are cut out of one.
    pub uncut: usize,
    /// Bits that a path keeps the number of a medium in, in a word for all solids that it is in.
    pub medium_bits: u32,
    /// Solids of different media lie partly in one another: media are numbered by size, and the smallest solid counts.
    pub has_media_by_size: bool,
    /// Some do, and by size this mesh would not count where it lies within another.
    pub hidden_solid: Option<u32>,
    /// Pieces of textured lamps that have spots much smaller and brighter than they are.
    pub coarse_pieces: usize,
}

/// Most triangles: their numbers and those of the BVH's nodes are 32-bit, and a photon's choice of
/// emitter has 24 bits.
const MAX_TRIANGLES: usize = 1 << 28;
/// With the 256 linear values of 8-bit codes before them.
pub(crate) const MAX_TEXELS: usize = TEXEL_BUFFERS * TEXELS_PER_BUFFER as usize;
/// As many as `glsl/material/textures.glsl` looks into, so that none is larger than 128 MiB, the least that devices promise.
pub(crate) const TEXEL_BUFFERS: usize = 4;
/// Metres: a place that is rounded by more than that is said.
pub(crate) const PLACE_ERROR: f64 = 1e-4;

fn refuse(scene: &Scene, object: &str, reason: String) -> Error {
    Error::Scene { path: (&scene.name).into(), object: object.into(), reason }
}

impl Geometry {
    pub(crate) fn new(scene: &Scene) -> Result<Geometry> {
        Geometry::new_with(scene, &mut |_, _| {})
    }

    /// The same, with reports of how far it has come.
    pub(crate) fn new_with(scene: &Scene, progress: Progress) -> Result<Geometry> {
        let refuse = |reason: String| refuse(scene, "the scene", reason);
        let count = scene.triangle_count();
        if count == 0 {
            return Err(refuse("holds no triangle".into()));
        }
        if count > MAX_TRIANGLES {
            return Err(refuse(format!("holds {count} triangles, at most {MAX_TRIANGLES} can be numbered")));
        }
        let frame = Frame::of(scene).map_err(refuse)?;
        progress("preparing triangles", 0.0);
        let kinds = contact::kinds(scene);
        let offsets = Offsets::of(scene, &kinds);
        let parts = Parts::of(scene, &kinds, &offsets, frame, progress);
        if parts.corners.is_empty() {
            return Err(refuse("holds no triangle with an area".into()));
        }
        progress("building the hierarchy", 0.0);
        let Bvh { nodes, order } = Bvh::build(&parts.corners);
        progress("preparing triangles", 0.5);
        let leaves = Leaves { scene, parts: &parts, order: &order };
        let triangles = leaves.each(|part| part.record());
        let has_colours = scene.meshes.iter().any(|mesh| !mesh.colours.is_empty() || !mesh.alphas.is_empty());
        let turns: Vec<_> = scene.materials.iter().map(|material| layered::turns(material, &scene.textures)).collect();
        let media = Media::of(scene, &offsets)?;
        progress("packing textures", 0.0);
        let (mut textures, texels) = pack_textures(scene);
        let layered_materials = layered::records(scene, &media, frame.unit, &mut textures);
        if texels.len() > MAX_TEXELS {
            return Err(refuse(format!("has textures of {} texels in all; at most {MAX_TEXELS} can be kept", texels.len())));
        }
        let (min, max) = frame.bounds;
        let mut geometry = Geometry {
            centre: frame.centre,
            unit: frame.unit,
            bounds: (frame.local(min), frame.local(max)),
            radius: (0.5 * (max - min).length() / frame.unit) * 1.001,
            area: triangles.iter().filter(|triangle| triangle.plane < HIDDEN).map(area).sum(),
            nodes,
            triangles,
            first_sensor_plane: parts.first_sensor_plane(scene),
            normals: leaves.each(|part| part.normals()),
            uvs: leaves.each(|part| part.uvs(scene)),
            colours: if has_colours { leaves.each(|part| part.colours()) } else { vec![Part::WHITE] },
            materials: scene.materials.iter().map(material_record).collect(),
            layered_materials,
            triangle_layers: match layered::is_needed(scene) {
                false => vec![TriangleLayers::default()],
                true => leaves.each(|part| layered::of_part(part, &turns[part.mesh.material])),
            },
            textures,
            texels,
            left_out: parts.left_out,
            overlaps: parts.overlaps.into_iter().collect(),
            uncut: parts.uncut,
            planes: parts.planes.planes,
            medium_bits: media.bits,
            has_media_by_size: media.are_by_size,
            hidden_solid: media.hidden_solid,
            emitters: Vec::new(),
            sky_most: 0.0,
            flux_unit: 1.0,
            power: 0.0,
            coarse_pieces: 0,
        };
        progress("collecting lights", 0.0);
        geometry.add_emitters(scene)?;
        Ok(geometry)
    }

    /// The texels in the buffers that hold them.
    pub(crate) fn texel_parts(&self) -> [&[u32]; TEXEL_BUFFERS] {
        let mut parts = self.texels.chunks(TEXELS_PER_BUFFER as usize);
        std::array::from_fn(|_| parts.next().unwrap_or(&[]))
    }

    /// The planes as kernels have them: behind them, as bits, the number of the first one of points in the air.
    pub(crate) fn plane_words(&self) -> Vec<Vec4> {
        let last = Vec4::new(f32::from_bits(self.first_sensor_plane), 0.0, 0.0, 0.0);
        [self.planes.as_slice(), &[last]].concat()
    }

    /// A normalised position in metres of the scene.
    pub(crate) fn to_world(&self, position: Vec3) -> DVec3 {
        position.as_dvec3() * self.unit + self.centre
    }

    pub(crate) fn to_local(&self, position: DVec3) -> Vec3 {
        ((position - self.centre) / self.unit).as_vec3()
    }
}

fn area(triangle: &Triangle) -> f64 {
    let (a, b, c) = (triangle.a.as_dvec3(), triangle.b.as_dvec3(), triangle.c.as_dvec3());
    0.5 * (b - a).cross(c - a).length()
}

fn material_record(material: &Material) -> SurfaceMaterial {
    let (surface, parameter) = match material.surface {
        Surface::Lambert => (SURFACE_LAMBERT, 0.0),
        Surface::PaperPhong { exponent } => (SURFACE_PAPER_PHONG, exponent),
        Surface::Glossy { exponent } => (SURFACE_GLOSSY, exponent),
        Surface::Mirror => (SURFACE_MIRROR, 0.0),
        Surface::Dielectric { ior } => (SURFACE_DIELECTRIC, ior),
        Surface::Layered => (SURFACE_LAYERED, 0.0),
    };
    SurfaceMaterial {
        base_colour: material.base_colour,
        surface,
        emission: material.emission,
        parameter,
        base_texture: material.base_colour_texture.map_or(NONE, |texture| texture.texture as u32),
        emission_texture: material.emission_texture.map_or(NONE, |texture| texture.texture as u32),
        two_sided: u32::from(material.has_two_sides()),
    }
}

/// Textures that a material uses, behind the linear values of 8-bit codes.
fn pack_textures(scene: &Scene) -> (Vec<TextureInfo>, Vec<u32>) {
    let mut is_used = vec![false; scene.textures.len()];
    for material in &scene.materials {
        material.textures().for_each(|of| is_used[of.texture] = true);
    }
    let codes = if scene.textures.is_empty() { &[][..] } else { &LINEAR_OF_SRGB[..] };
    let mut texels: Vec<u32> = codes.iter().map(|value| value.to_bits()).collect();
    let mut infos = Vec::with_capacity(scene.textures.len());
    for (texture, is_used) in scene.textures.iter().zip(is_used) {
        infos.push(TextureInfo { first_texel: texels.len() as u32, ..texture_record(texture) });
        if is_used {
            texels.par_extend(texture.texels.words());
        }
    }
    (infos, texels)
}

/// But for where its texels begin.
fn texture_record(texture: &Texture) -> TextureInfo {
    let code = |wrap: Wrap| match wrap {
        Wrap::Repeat => 0,
        Wrap::MirroredRepeat => 1,
        Wrap::Clamp => 2,
    };
    TextureInfo {
        width: texture.width,
        height: texture.height,
        wrap: code(texture.wrap[0]) | code(texture.wrap[1]) << 2 | u32::from(texture.filter == Filter::Nearest) << 4,
        encoding: match texture.texels {
            Texels::Srgb(_) => TEXELS_SRGB,
            Texels::Float(_) => TEXELS_FLOAT,
            Texels::Linear(_) => TEXELS_LINEAR,
        },
        ..TextureInfo::default()
    }
}

/// A unit vector in 2 x 16 bits (Cigolle et al. 2014). Twin of `glsl/math/directions.glsl`.
pub(crate) fn pack_normal(n: Vec3) -> u32 {
    let sign = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
    let flat = Vec2::new(n.x, n.y) / (n.x.abs() + n.y.abs() + n.z.abs());
    let folded = if n.z >= 0.0 { flat } else { (1.0 - flat.yx().abs()) * Vec2::new(sign(flat.x), sign(flat.y)) };
    // So large a number leaves no room for a fraction: this rounds to the nearest, ties to even, without a call.
    const NO_FRACTION: f32 = 12_582_912.0;
    let code = |x: f32| ((x.clamp(-1.0, 1.0) * 32767.0 + NO_FRACTION) - NO_FRACTION + 32767.0) as u32;
    code(folded.x) | code(folded.y) << 16
}

/// What [`pack_normal`] packed.
#[cfg(test)]
pub(crate) fn unpack_normal(code: u32) -> Vec3 {
    let o = Vec2::new((code & 0xffff) as f32 - 32767.0, (code >> 16) as f32 - 32767.0) / 32767.0;
    let sign = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
    let z = 1.0 - o.x.abs() - o.y.abs();
    let flat = if z >= 0.0 { o } else { (1.0 - o.yx().abs()) * Vec2::new(sign(o.x), sign(o.y)) };
    flat.extend(z).normalize()
}
