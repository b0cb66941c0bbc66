//! A scene as the kernels see it: triangles in the order of the BVH's leaves, materials, textures and
//! emitters, as plain records.
//!
//! Lengths are normalised: `local = (world - centre) / unit` with `unit` a power of two, so that scaling a
//! scene by a power of two changes no bit, and every coordinate lies within (-1, 1). Radiance and
//! irradiance keep their units; a flux in W is divided by `unit`^2.

mod emitters;
mod lamp_pieces;
mod layered;
mod turns;

use std::cell::LazyCell;
use std::collections::BTreeSet;
use std::ops::{Add, Mul};

use glam::{DVec2, DVec3, Vec2, Vec2Swizzles as _, Vec3, Vec4};
use rayon::prelude::*;

use super::bvh::Bvh;
use super::contact_offsets::Offsets;
use super::material::TextureUse;
use super::planes::{Planes, for_equals, hash_of};
use super::texture::{Filter, LINEAR_OF_SRGB, Texels, Wrap};
use super::{Light, LightKind, Material, Mesh, Progress, Scene, Surface, Texture, contact, overlap, solids};
use crate::constants::*;
use crate::error::{Error, Result};
use crate::records::{
    BvhNode, Emitter, LayeredMaterial, SurfaceMaterial, TextureInfo, Triangle, TriangleColours, TriangleLayers, TriangleNormals,
    TriangleUvs,
};
use crate::text::{counted, in_metres, some_of};

#[derive(Debug, Clone)]
pub struct Geometry {
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
    /// For each triangle (mesh, triangle of the mesh).
    pub sources: Vec<(u32, u32)>,
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
    /// What shines, the environment last.
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
    pub crowded: usize,
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
pub const MAX_TEXELS: usize = TEXEL_BUFFERS * TEXELS_PER_BUFFER as usize;
/// As many as `glsl/material/textures.glsl` looks into, so that none is larger than 128 MiB, the least that devices promise.
pub const TEXEL_BUFFERS: usize = 4;
/// Metres: a place that is rounded by more than that is said.
pub const PLACE_ERROR: f64 = 1e-4;

fn refuse(scene: &Scene, object: &str, reason: String) -> Error {
    Error::Scene { path: (&scene.name).into(), object: object.into(), reason }
}

impl Geometry {
    pub fn new(scene: &Scene) -> Result<Geometry> {
        Geometry::new_with(scene, &mut |_, _| {})
    }

    /// The same, with reports of how far it has come.
    pub fn new_with(scene: &Scene, progress: Progress) -> Result<Geometry> {
        let count = scene.triangle_count();
        if count == 0 {
            return Err(refuse(scene, "the scene", "holds no triangle".into()));
        }
        if count > MAX_TRIANGLES {
            return Err(refuse(scene, "the scene", format!("holds {count} triangles, at most {MAX_TRIANGLES} can be numbered")));
        }
        let (min, max) = scene.bounds();
        let extent = (max - min).max_element();
        if !(extent.is_normal() && extent < 1e30) {
            return Err(refuse(scene, "the scene", format!("is {extent} metres wide; allowed is anything above 0 and below 1e30")));
        }
        let centre = 0.5 * (min + max);
        let unit = 2f64.powi(extent.log2().ceil() as i32);
        // As a power of two it has an exact inverse.
        let per_unit = 1.0 / unit;
        let local = |position: DVec3| ((position - centre) * per_unit).as_vec3();

        let mut sources: Vec<(u32, u32)> = Vec::with_capacity(count);
        for (mesh, of) in (0..).zip(&scene.meshes) {
            sources.extend((0..of.triangles.len() as u32).map(|triangle| (mesh, triangle)));
        }
        progress("preparing triangles", 0.0);
        let kinds = contact::kinds(scene);
        let offsets = Offsets::of(scene, &kinds);
        let mut corners: Vec<[Vec3; 3]> =
            sources.par_iter().map(|&(mesh, triangle)| offsets.corners(scene, mesh, triangle).map(local)).collect();
        // What f32 makes a line of cannot be hit, and its normal would be no number; on a device that takes numbers
        // without a leading 1 for nothing, neither would that of a square below the least normal one.
        let is_solid = |[a, b, c]: &[Vec3; 3]| (*b - *a).cross(*c - *a).length_squared() >= f32::MIN_POSITIVE;
        // Of triangles that are the same, facing alike, only one can be met; the others would shine, and count as surface,
        // where none is seen.
        let ranks = LazyCell::new(|| overlap::ranks(scene, &kinds));
        let mut overlaps = BTreeSet::new();
        let mut crowded = 0;
        let mut is_kept: Vec<bool> = corners.par_iter().map(is_solid).collect();
        let words = |place: u32| in_fixed_order(&corners[place as usize]);
        for_equals(
            corners.len(),
            |place| hash_of_corners(&corners[place as usize]),
            words,
            |alike| {
                let solid: Vec<usize> = alike.iter().map(|place| *place as usize).filter(|place| is_kept[*place]).collect();
                let Some((first, others)) = solid.split_first() else { return };
                let mut seen = *first;
                for &place in others {
                    let (mesh, other) = (sources[place].0, sources[seen].0);
                    let wins = ranks[mesh as usize] < ranks[other as usize];
                    overlaps.insert(if wins { (other, mesh) } else { (mesh, other) });
                    let hidden = if wins { std::mem::replace(&mut seen, place) } else { place };
                    is_kept[hidden] = false;
                }
            },
        );
        let mut kept = is_kept.iter().copied().cycle();
        sources.retain(|_| kept.next().expect("one for each"));
        corners.retain(|_| kept.next().expect("one for each"));
        let left_out = count - corners.len();
        if corners.is_empty() {
            return Err(refuse(scene, "the scene", "holds no triangle with an area".into()));
        }
        progress("looking for overlaps", 0.0);
        let mut planes = Planes::of(&corners);
        // Parts of triangles, behind the whole ones: weights of the corners.
        let whole_count = corners.len();
        let mut weights: Vec<[DVec3; 3]> = Vec::new();
        for covered in overlap::find(scene, &kinds, || &ranks, &sources, &corners, |done| progress("looking for overlaps", done)) {
            let (source, [a, b, c], plane) =
                (sources[covered.triangle], corners[covered.triangle].map(Vec3::as_dvec3), planes.of_triangles[covered.triangle]);
            crowded += usize::from(covered.crowded);
            overlaps.extend(covered.by.iter().map(|other| (source.0, sources[*other].0)));
            for piece in covered.pieces {
                let at = piece.map(|of| (a * of.x + b * of.y + c * of.z).as_vec3());
                if is_solid(&at) {
                    sources.push(source);
                    corners.push(at);
                    planes.of_triangles.push(plane);
                    weights.push(piece);
                }
            }
            planes.of_triangles[covered.triangle] |= HIDDEN;
        }
        let is_seen = |(_, (mesh, _)): &(&u32, &(u32, u32))| !scene.materials[scene.meshes[*mesh as usize].material].is_not_there();
        let of_surfaces = planes.of_triangles.iter().zip(&sources).filter(is_seen).map(|(plane, _)| plane & !HIDDEN);
        let first_sensor_plane = of_surfaces.max().map_or(0, |last| last + 1);
        progress("building the hierarchy", 0.0);
        let Bvh { nodes, order } = Bvh::build(&corners);
        progress("preparing triangles", 0.5);
        let sources: Vec<(u32, u32)> = order.par_iter().map(|&place| sources[place as usize]).collect();
        let triangle_of = |(&place, &(mesh, _)): (&u32, &(u32, u32))| {
            let [a, b, c] = corners[place as usize];
            Triangle { a, b, c, material: scene.meshes[mesh as usize].material as u32, plane: planes.of_triangles[place as usize] }
        };
        let triangles: Vec<Triangle> = order.par_iter().zip(&sources).map(triangle_of).collect();
        let part_of = |place: u32| (place as usize).checked_sub(whole_count).map(|part| &weights[part]);
        let normals_of = |(&place, &(mesh, triangle)): (&u32, &(u32, u32))| {
            corner_normals(&scene.meshes[mesh as usize], triangle as usize, part_of(place))
        };
        let normals = order.par_iter().zip(&sources).map(normals_of).collect();
        let uvs_of = |(&place, &(mesh, triangle)): (&u32, &(u32, u32))| {
            let mesh = &scene.meshes[mesh as usize];
            corner_uvs(mesh, &scene.materials[mesh.material], &scene.textures, triangle as usize, part_of(place))
        };
        let uvs = order.par_iter().zip(&sources).map(uvs_of).collect();
        let colours_of = |(&place, &(mesh, triangle)): (&u32, &(u32, u32))| {
            corner_colours(&scene.meshes[mesh as usize], triangle as usize, part_of(place))
        };
        let colours = match scene.meshes.iter().all(|mesh| mesh.colours.is_empty() && mesh.alphas.is_empty()) {
            true => vec![TriangleColours { a: Vec3::ONE, b: Vec3::ONE, c: Vec3::ONE, alphas: Vec3::ONE }],
            false => order.par_iter().zip(&sources).map(colours_of).collect(),
        };
        let (by_size, hidden_solid) = match solids::order(scene) {
            solids::Order::Entry => (None, None),
            solids::Order::Size(order) => (Some(order), None),
            solids::Order::Unclear(mesh) => (None, Some(mesh)),
        };
        let mut layered_materials = layered::records(scene, unit, by_size.as_deref())
            .map_err(|count| refuse(scene, "the scene", format!("has solids of {count} different media; at most 255 can be told apart")))?;
        let layer_turns: Vec<_> = scene.materials.iter().map(|material| layered::turns(material, &scene.textures)).collect();
        let medium_bits = medium_bits(scene, &layered_materials, &offsets)?;
        let layers_of = |(&place, &(mesh, triangle)): (&u32, &(u32, u32))| {
            let mesh = &scene.meshes[mesh as usize];
            layered::of_triangle(mesh, triangle as usize, part_of(place), &layer_turns[mesh.material])
        };
        let triangle_layers = match layered::is_needed(scene) {
            false => vec![TriangleLayers::default()],
            true => order.par_iter().zip(&sources).map(layers_of).collect(),
        };
        progress("packing textures", 0.0);
        let (mut textures, texels) = pack_textures(scene);
        layered::add_lookups(scene, &mut layered_materials, &mut textures);
        if texels.len() > MAX_TEXELS {
            let reason = format!("has textures of {} texels in all; at most {MAX_TEXELS} can be kept", texels.len());
            return Err(refuse(scene, "the scene", reason));
        }

        let mut geometry = Geometry {
            centre,
            unit,
            bounds: (local(min), local(max)),
            radius: (0.5 * (max - min).length() / unit) * 1.001,
            area: triangles.iter().filter(|triangle| triangle.plane < HIDDEN).map(area).sum(),
            nodes,
            triangles,
            planes: planes.planes,
            first_sensor_plane,
            sources,
            normals,
            uvs,
            colours,
            materials: scene.materials.iter().map(material_record).collect(),
            layered_materials,
            triangle_layers,
            textures,
            texels,
            emitters: Vec::new(),
            sky_most: 0.0,
            flux_unit: 1.0,
            power: 0.0,
            left_out,
            overlaps: overlaps.into_iter().collect(),
            crowded,
            medium_bits,
            has_media_by_size: by_size.is_some(),
            hidden_solid,
            coarse_pieces: 0,
        };
        progress("collecting lights", 0.0);
        geometry.add_emitters(scene)?;
        Ok(geometry)
    }

    /// The texels in the buffers that hold them.
    pub fn texel_parts(&self) -> [&[u32]; TEXEL_BUFFERS] {
        let mut parts = self.texels.chunks(TEXELS_PER_BUFFER as usize);
        std::array::from_fn(|_| parts.next().unwrap_or(&[]))
    }

    /// The planes as kernels have them: behind them, as bits, the number of the first one of points in the air.
    pub fn plane_words(&self) -> Vec<Vec4> {
        let last = Vec4::new(f32::from_bits(self.first_sensor_plane), 0.0, 0.0, 0.0);
        [self.planes.as_slice(), &[last]].concat()
    }

    /// A normalised position in metres of the scene.
    pub fn to_world(&self, position: Vec3) -> DVec3 {
        position.as_dvec3() * self.unit + self.centre
    }

    pub fn to_local(&self, position: DVec3) -> Vec3 {
        ((position - self.centre) / self.unit).as_vec3()
    }

    /// How far single precision moves a place, metres.
    pub fn place_error(&self, position: DVec3) -> f64 {
        (self.to_world(self.to_local(position)) - position).abs().max_element()
    }

    /// That some places, of points or of a camera, are moved so far that it shows.
    pub fn place_warning(&self, what: &str, positions: impl IntoIterator<Item = DVec3>) -> Option<String> {
        let most = positions.into_iter().map(|position| self.place_error(position)).fold(0.0, f64::max);
        (most > PLACE_ERROR).then(|| {
            format!("{what}: off by up to {} in single precision, so far from the middle of the scene; go nearer to it", in_metres(most))
        })
    }

    /// Meshes whose vertices single precision moves so far that it shows, and how far at most; nothing of scenes that are not kilometres
    /// wide.
    fn rounded_meshes(&self, scene: &Scene) -> (Vec<u32>, f64) {
        // Half the step of the largest numbers.
        if self.unit * 0.5 * f64::from(f32::EPSILON) * 0.25 <= PLACE_ERROR {
            return (Vec::new(), 0.0);
        }
        let of_mesh = |mesh: &Mesh| mesh.positions.iter().map(|position| self.place_error(*position)).fold(0.0, f64::max);
        let errors: Vec<f64> = scene.meshes.par_iter().map(of_mesh).collect();
        let rounded = (0..).zip(&errors).filter(|(_, error)| **error > PLACE_ERROR).map(|(mesh, _)| mesh).collect();
        (rounded, errors.into_iter().fold(0.0, f64::max))
    }

    /// A line for triangles that are left out, for each pair of meshes that overlap in one plane, and for what is too many to be treated as it should.
    pub fn warnings(&self, scene: &Scene) -> Vec<String> {
        const MOST: usize = 5;
        let names = LazyCell::new(|| scene.mesh_names());
        let name = |mesh: u32| &names[mesh as usize];
        let line = |&(hidden, seen): &(u32, u32)| {
            if hidden == seen {
                return format!("mesh {:?} overlaps itself in one plane; what overlaps counts once", name(hidden));
            }
            format!("meshes {:?} and {:?} overlap in one plane; only {:?} counts there", name(hidden), name(seen), name(seen))
        };
        let mut lines: Vec<String> = Vec::new();
        if self.left_out > 0 {
            let count = counted(self.left_out, "triangle");
            lines.push(format!("{count} without area in single precision, or on others, left out"));
        }
        if let Some(mesh) = self.hidden_solid {
            lines.push(format!(
                "solids lie partly in one another, and light may be lost there: what is around mesh {} shares its material with smaller solids; \
                 give these a material of their own whose index of refraction differs by 0.001",
                name(mesh)
            ));
        }
        let (rounded, most) = self.rounded_meshes(scene);
        if !rounded.is_empty() {
            lines.push(format!(
                "the scene is {:.0} m wide, and single precision moves places in it by up to {} (mesh {}); leave out \
                 what stands far from the rest, or render parts on their own",
                2.0 * self.radius * self.unit / 1.001,
                in_metres(most),
                some_of(rounded.iter().map(|mesh| name(*mesh)))
            ));
        }
        let place_of = |light: &Light| match light.kind {
            LightKind::Point { position, .. } | LightKind::Spot { position, .. } | LightKind::Disc { centre: position, .. } => {
                Some(position)
            }
            LightKind::Directional { .. } | LightKind::Environment { .. } | LightKind::Sky(_) => None,
        };
        lines.extend(scene.lights.iter().filter_map(|light| self.place_warning(&light.name, place_of(light))));
        if let Some(warning) = turns::warning(scene) {
            lines.push(warning);
        }
        lines.extend(self.overlaps.iter().take(MOST).map(line));
        if self.crowded > 0 {
            lines.push(format!(
                "{} among more than 64 others that overlap each other in one plane; light there may count more than once",
                counted(self.crowded, "triangle")
            ));
        }
        if self.coarse_pieces > 0 {
            lines.push(format!(
                "{} of textured lamps have spots much brighter than their mean, more than can be told apart; their light is noisy, and may be missed in few rounds",
                counted(self.coarse_pieces, "part")
            ));
        }
        if self.overlaps.len() > MOST {
            lines.push(format!("{} more pairs of meshes overlap in one plane; one of each counts there", self.overlaps.len() - MOST));
        }
        // Names may be the same where they are not from a file.
        let mut said = BTreeSet::new();
        lines.retain(|line| said.insert(line.clone()));
        lines
    }
}

/// How many bits each medium gets: so many that all solids that lie in one another have room in a word.
fn medium_bits(scene: &Scene, materials: &[LayeredMaterial], offsets: &Offsets) -> Result<u32> {
    const USUAL: u32 = 8;
    let few = 32 / USUAL;
    let Some((depth, mesh)) = solids::most_nested(scene, few as usize, |mesh, triangle| offsets.corners(scene, mesh, triangle)) else {
        return Ok(USUAL);
    };
    let media = materials.iter().map(|material| material.medium).max().unwrap_or(0);
    let bits = 32 - media.leading_zeros();
    let most = 32 / bits.max(1);
    if depth > most as usize {
        let name = &scene.meshes[mesh as usize].name;
        let reason = format!(
            "is one of {depth} solids that lie in one another; of {media} different media in the scene, at most {most} may: give some of them \
             equal indices of refraction and attenuation, or take some out"
        );
        return Err(refuse(scene, &format!("mesh '{name}'"), reason));
    }
    Ok(bits)
}

/// The bits of a triangle's corners, the same from whichever corner it is read.
fn in_fixed_order(corners: &[Vec3; 3]) -> [u32; 9] {
    // The sum turns -0 into 0.
    let bits = corners.map(|corner| (corner + Vec3::ZERO).to_array().map(f32::to_bits));
    let first = (0..3).min_by_key(|corner| bits[*corner]).expect("a triangle has corners");
    let word = |k: usize| bits[(first + k / 3) % 3][k % 3];
    std::array::from_fn(word)
}

/// Of a triangle's corners, the same from whichever corner it is read.
fn hash_of_corners(corners: &[Vec3; 3]) -> u64 {
    corners.iter().map(|corner| hash_of(&(corner + Vec3::ZERO).to_array().map(f32::to_bits))).fold(0, u64::wrapping_add)
}

fn area(triangle: &Triangle) -> f64 {
    let (a, b, c) = (triangle.a.as_dvec3(), triangle.b.as_dvec3(), triangle.c.as_dvec3());
    0.5 * (b - a).cross(c - a).length()
}

/// Values of a triangle's corners, or of those of a part of it.
fn at_corners<T: Copy + Add<Output = T> + Mul<f64, Output = T>>(values: [T; 3], part: Option<&[DVec3; 3]>) -> [T; 3] {
    let [a, b, c] = values;
    part.map_or(values, |weights| weights.map(|of| a * of.x + b * of.y + c * of.z))
}

fn corner_normals(mesh: &Mesh, triangle: usize, part: Option<&[DVec3; 3]>) -> TriangleNormals {
    let flat = TriangleNormals { a: NONE, b: NONE, c: NONE };
    if mesh.normals.is_empty() {
        return flat;
    }
    let normals = mesh.triangles[triangle].map(|vertex| mesh.normals[vertex as usize]);
    // Normals that are all the triangle's own are no smooth shading.
    let own = mesh.normal(triangle);
    if normals.iter().any(|normal| normal.length_squared() < 0.25) || normals.iter().all(|normal| normal.dot(own) > 1.0 - 1e-9) {
        return flat;
    }
    let [a, b, c] = at_corners(normals, part).map(|normal| pack_normal(normal.as_vec3()));
    TriangleNormals { a, b, c }
}

fn corner_colours(mesh: &Mesh, triangle: usize, part: Option<&[DVec3; 3]>) -> TriangleColours {
    let colour = |vertex: u32| mesh.colours.get(vertex as usize).copied().unwrap_or(DVec3::ONE);
    let [a, b, c] = at_corners(mesh.triangles[triangle].map(colour), part).map(DVec3::as_vec3);
    let alpha = |vertex: u32| mesh.alphas.get(vertex as usize).copied().unwrap_or(1.0);
    let alphas = DVec3::from(at_corners(mesh.triangles[triangle].map(alpha), part)).as_vec3();
    TriangleColours { a, b, c, alphas }
}

fn corner_uvs(mesh: &Mesh, material: &Material, textures: &[Texture], triangle: usize, part: Option<&[DVec3; 3]>) -> TriangleUvs {
    let of = |used: Option<TextureUse>| -> [Vec2; 3] {
        match used {
            Some(TextureUse { uv_set, transform, texture }) => {
                let own = |vertex: u32| mesh.uvs[uv_set].get(vertex as usize).copied().unwrap_or_default();
                let uvs = mesh.triangles[triangle].map(|vertex| transform.apply(own(vertex)));
                at_corners(turns::near(uvs, textures[texture].wrap), part).map(DVec2::as_vec2)
            }
            _ => [Vec2::ZERO; 3],
        }
    };
    let [base_a, base_b, base_c] = of(material.base_colour_texture);
    let [emission_a, emission_b, emission_c] = of(material.emission_texture);
    TriangleUvs { base_a, base_b, base_c, emission_a, emission_b, emission_c }
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
pub fn pack_normal(n: Vec3) -> u32 {
    let sign = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
    let flat = Vec2::new(n.x, n.y) / (n.x.abs() + n.y.abs() + n.z.abs());
    let folded = if n.z >= 0.0 { flat } else { (1.0 - flat.yx().abs()) * Vec2::new(sign(flat.x), sign(flat.y)) };
    // So large a number leaves no room for a fraction: this rounds to the nearest, ties to even, without a call.
    const NO_FRACTION: f32 = 12_582_912.0;
    let code = |x: f32| ((x.clamp(-1.0, 1.0) * 32767.0 + NO_FRACTION) - NO_FRACTION + 32767.0) as u32;
    code(folded.x) | code(folded.y) << 16
}

/// What [`pack_normal`] packed.
pub fn unpack_normal(code: u32) -> Vec3 {
    let o = Vec2::new((code & 0xffff) as f32 - 32767.0, (code >> 16) as f32 - 32767.0) / 32767.0;
    let sign = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
    let z = 1.0 - o.x.abs() - o.y.abs();
    let flat = if z >= 0.0 { o } else { (1.0 - o.yx().abs()) * Vec2::new(sign(o.x), sign(o.y)) };
    flat.extend(z).normalize()
}
