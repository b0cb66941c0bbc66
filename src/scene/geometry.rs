//! A scene as the kernels see it: triangles in the order of the BVH's leaves, materials, textures and
//! emitters, as plain records.
//!
//! Lengths are normalised: `local = (world - centre) / unit` with `unit` a power of two, so that scaling a
//! scene by a power of two changes no bit, and every coordinate lies within (-1, 1). Radiance and
//! irradiance keep their units; a flux in W is divided by `unit`^2.

use std::cell::LazyCell;
use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};
use std::ops::{Add, Mul};

use glam::{DVec2, DVec3, UVec2, Vec2, Vec3, Vec4};
use half::slice::HalfFloatSliceExt as _;
use rayon::prelude::*;

use super::bvh::Bvh;
use super::light::LightKind;
use super::overlap::{self, Planes, for_equals, hash_of};
use super::texture::Wrap;
use super::{Material, Mesh, Progress, Scene, Surface, Texture, work};
use crate::constants::*;
use crate::error::{Error, Result};
use crate::records::{BvhNode, Emitter, SurfaceMaterial, TextureInfo, Triangle, TriangleNormals, TriangleUvs};
use crate::settings::EmissionLaw;
use crate::text::counted;

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
    /// For each triangle (mesh, triangle of the mesh).
    pub sources: Vec<(u32, u32)>,
    pub normals: Vec<TriangleNormals>,
    pub uvs: Vec<TriangleUvs>,
    pub materials: Vec<SurfaceMaterial>,
    pub textures: Vec<TextureInfo>,
    pub texels: Vec<UVec2>,
    /// What shines, the environment last.
    pub emitters: Vec<Emitter>,
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
}

/// Most triangles: their numbers and those of the BVH's nodes are 32-bit, and a photon's choice of
/// emitter has 24 bits.
const MAX_TRIANGLES: usize = 1 << 28;
const MAX_EMITTERS: usize = 1 << 22;
/// Values that a random choice of emitter can take.
const CHOICES: u32 = 1 << 24;

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
        let mut corners: Vec<[Vec3; 3]> =
            sources.par_iter().map(|&(mesh, triangle)| scene.meshes[mesh as usize].corners(triangle as usize).map(local)).collect();
        // What f32 makes a line of cannot be hit, and its normal would be no number; on a device that takes numbers
        // without a leading 1 for nothing, neither would that of a square below the least normal one.
        let is_solid = |[a, b, c]: &[Vec3; 3]| (*b - *a).cross(*c - *a).length_squared() >= f32::MIN_POSITIVE;
        // Of triangles that are the same, facing alike, only one can be met; the others would shine, and count as surface,
        // where none is seen.
        let ranks = LazyCell::new(|| overlap::ranks(scene));
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
        let mut of_source = is_kept.iter();
        sources.retain(|_| *of_source.next().expect("one for each"));
        let mut of_corners = is_kept.iter();
        corners.retain(|_| *of_corners.next().expect("one for each"));
        let left_out = count - corners.len();
        if corners.is_empty() {
            return Err(refuse(scene, "the scene", "holds no triangle with an area".into()));
        }
        progress("looking for overlaps", 0.0);
        let mut planes = Planes::of(&corners);
        // Parts of triangles, behind the whole ones: weights of the corners.
        let whole_count = corners.len();
        let mut weights: Vec<[DVec3; 3]> = Vec::new();
        for covered in overlap::find(scene, || &ranks, &sources, &corners, |done| progress("looking for overlaps", done)) {
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
            corner_uvs(mesh, &scene.materials[mesh.material], triangle as usize, part_of(place))
        };
        let uvs = order.par_iter().zip(&sources).map(uvs_of).collect();
        progress("packing textures", 0.0);
        let (textures, texels) = pack_textures(scene);

        let mut geometry = Geometry {
            centre,
            unit,
            bounds: (local(min), local(max)),
            radius: (0.5 * (max - min).length() / unit) * 1.001,
            area: triangles.iter().filter(|triangle| triangle.plane < HIDDEN).map(area).sum(),
            nodes,
            triangles,
            planes: planes.planes,
            sources,
            normals,
            uvs,
            materials: scene.materials.iter().map(material_record).collect(),
            textures,
            texels,
            emitters: Vec::new(),
            flux_unit: 1.0,
            power: 0.0,
            left_out,
            overlaps: overlaps.into_iter().collect(),
            crowded,
        };
        progress("collecting lights", 0.0);
        geometry.add_emitters(scene)?;
        Ok(geometry)
    }

    /// A normalised position in metres of the scene.
    pub fn to_world(&self, position: Vec3) -> DVec3 {
        position.as_dvec3() * self.unit + self.centre
    }

    pub fn to_local(&self, position: DVec3) -> Vec3 {
        ((position - self.centre) / self.unit).as_vec3()
    }

    /// A line for each pair of meshes that overlap in one plane.
    pub fn overlap_warnings(&self, scene: &Scene) -> Vec<String> {
        const MOST: usize = 5;
        let name = |mesh: u32| &scene.meshes[mesh as usize].name;
        let line = |&(hidden, seen): &(u32, u32)| {
            if hidden == seen {
                return format!("mesh {:?} overlaps itself in one plane; what overlaps counts once", name(hidden));
            }
            format!("meshes {:?} and {:?} overlap in one plane; only {:?} counts there", name(hidden), name(seen), name(seen))
        };
        let mut lines: Vec<String> = self.overlaps.iter().take(MOST).map(line).collect();
        if self.crowded > 0 {
            lines.push(format!(
                "{} among more than 64 others that overlap each other in one plane; light there may count more than once",
                counted(self.crowded, "triangle")
            ));
        }
        if self.overlaps.len() > MOST {
            lines.push(format!("{} more pairs of meshes overlap in one plane; one of each counts there", self.overlaps.len() - MOST));
        }
        lines
    }

    fn add_emitters(&mut self, scene: &Scene) -> Result<()> {
        let summaries = summaries_of_emission(scene);
        let found_in = |(index, triangle): (usize, &Triangle)| {
            if triangle.plane >= HIDDEN {
                return None;
            }
            let material = &scene.materials[triangle.material as usize];
            if !material.is_emissive() {
                return None;
            }
            let sides = if material.two_sided { 2.0 } else { 1.0 };
            let flux = PI * sides * area(triangle) * material.emission.as_dvec3();
            let (mean, brightest) = match material.emission_texture.and_then(|of| Some((of.texture, summaries[of.texture]?))) {
                Some((texture, summary)) => (mean_over(&scene.textures[texture], summary.mean, &self.uvs[index]), summary.brightest),
                None => (DVec3::ONE, 1.0),
            };
            let emitter = Emitter { kind: EMITTER_TRIANGLE, triangle: index as u32, strength: material.emission, ..Emitter::default() };
            Some(Found { emitter, flux, weight: (flux * mean).element_sum(), brightest })
        };
        let mut found: Vec<Found> = self.triangles.par_iter().enumerate().filter_map(found_in).collect();
        let mut sky = Vec3::ZERO;
        for light in &scene.lights {
            if let LightKind::Environment { radiance } = light.kind {
                sky += radiance;
                continue;
            }
            let emitter = self.emitter_of(&light.kind);
            if !(emitter.emitter.strength.is_finite() && emitter.weight.is_finite() && emitter.emitter.position.is_finite()) {
                let wide = self.unit;
                let reason =
                    format!("leaves the range of numbers: the scene is {wide} metres wide, which its strength or place does not fit");
                return Err(refuse(scene, &light.name, reason));
            }
            found.push(emitter);
        }
        // One environment, the sum of all, comes last, where the kernels look for it.
        found.push(self.emitter_of(&LightKind::Environment { radiance: sky }));
        found.retain(|found| found.weight > 0.0);
        if found.len() > MAX_EMITTERS {
            let reason = format!("has {} triangles and lights that shine, at most {MAX_EMITTERS} can be chosen from", found.len());
            return Err(refuse(scene, "the scene", reason));
        }
        self.power = found.iter().map(|found| found.weight).sum();
        let choices = choices(&found.iter().map(|found| found.weight / self.power).collect::<Vec<_>>());
        let mut before = 0;
        for (found, choices) in found.iter_mut().zip(&choices) {
            found.emitter.probability = *choices as f32 / CHOICES as f32;
            found.flux /= f64::from(found.emitter.probability);
            before += choices;
            found.emitter.cumulative = before as f32 / CHOICES as f32;
        }
        self.flux_unit = found.iter().map(|found| found.flux.max_element() * found.brightest).fold(0.0, f64::max);
        if self.flux_unit == 0.0 {
            self.flux_unit = 1.0;
        }
        self.emitters = found.into_iter().map(|found| Emitter { flux: (found.flux / self.flux_unit).as_vec3(), ..found.emitter }).collect();
        Ok(())
    }

    fn emitter_of(&self, kind: &LightKind) -> Found {
        let area_unit = self.unit * self.unit;
        let (own, flux) = match *kind {
            LightKind::Point { position, intensity } => {
                let strength = intensity.as_dvec3() / area_unit;
                let own = Emitter { position: self.to_local(position), strength: strength.as_vec3(), ..Emitter::default() };
                (own, 2.0 * TAU * strength)
            }
            LightKind::Spot { position, direction, intensity, inner_angle, outer_angle } => {
                let strength = intensity.as_dvec3() / area_unit;
                // f32 holds a solid angle of so much, and its inverse.
                let (inner, outer) = (versine(inner_angle), versine(outer_angle).max(1e-36));
                let own = Emitter {
                    position: self.to_local(position),
                    direction: direction.as_vec3(),
                    strength: strength.as_vec3(),
                    size: inner as f32,
                    outer_versine: outer as f32,
                    ..Emitter::default()
                };
                // The square of a falloff that is linear in the cosine has a third of the ring's light.
                (own, TAU * (inner + (outer - inner) / 3.0) * strength)
            }
            LightKind::Directional { direction, irradiance } => {
                let own = Emitter { direction: direction.as_vec3(), strength: irradiance, ..Emitter::default() };
                (own, PI * self.radius * self.radius * irradiance.as_dvec3())
            }
            LightKind::Disc { centre, normal, radius, power, law } => {
                let flux = power.as_dvec3() / area_unit;
                let radius = radius / self.unit;
                let disc = PI * radius * radius;
                let strength = match law {
                    EmissionLaw::Cosine => flux / (PI * disc),
                    EmissionLaw::Uniform => flux / (TAU * disc),
                };
                let own = Emitter {
                    position: self.to_local(centre),
                    direction: normal.as_vec3(),
                    strength: strength.as_vec3(),
                    size: radius as f32,
                    ..Emitter::default()
                };
                (own, flux)
            }
            LightKind::Environment { radiance } => {
                (Emitter { strength: radiance, ..Emitter::default() }, 2.0 * TAU * PI * self.radius * self.radius * radiance.as_dvec3())
            }
        };
        let emitter = Emitter { kind: kind.code(), ..own };
        Found { emitter, flux, weight: flux.element_sum(), brightest: 1.0 }
    }

    /// Radiance of the brightest thing that a camera can see, W/m2/sr, or the irradiance a sixteenth of the scene's
    /// unit from a point or spot light: what a narrow spot lights is far brighter than its power over the scene's area.
    pub fn brightest(&self) -> f64 {
        let shines = self.materials.iter().map(|material| material.emission);
        let environment = self.emitters.iter().filter(|emitter| emitter.kind == EMITTER_ENVIRONMENT).map(|emitter| emitter.strength);
        let small = self.emitters.iter().filter(|emitter| matches!(emitter.kind, EMITTER_POINT | EMITTER_SPOT));
        let irradiance = small.map(|emitter| 2f64.powi(8) * f64::from(emitter.strength.max_element()));
        shines.chain(environment).map(|radiance| f64::from(radiance.max_element())).chain(irradiance).fold(0.0, f64::max)
    }
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

/// 1 - cosine of an angle, with all digits of a small one.
fn versine(angle: f32) -> f64 {
    2.0 * (0.5 * f64::from(angle)).sin().powi(2)
}

/// An emitter before its probability is known.
struct Found {
    emitter: Emitter,
    /// Per channel, texture left out.
    flux: DVec3,
    weight: f64,
    /// Largest value of its texture.
    brightest: f64,
}

/// Deals the choices of a random number to emitters by their share, at least one to each, so that the
/// probability that a kernel divides by is the one with which it chose.
fn choices(shares: &[f64]) -> Vec<u32> {
    if shares.is_empty() {
        return Vec::new();
    }
    let free = f64::from(CHOICES - shares.len() as u32);
    let mut dealt = 0u32;
    let mut sum = 0.0;
    let mut choices: Vec<u32> = shares
        .iter()
        .map(|share| {
            sum += share;
            let until = (sum * free).round().min(free) as u32;
            let own = until.saturating_sub(dealt);
            dealt += own;
            own + 1
        })
        .collect();
    // What rounding of the shares' sum left over.
    *choices.last_mut().expect("there is a share") += free as u32 - dealt;
    choices
}

fn area(triangle: &Triangle) -> f64 {
    let (a, b, c) = (triangle.a.as_dvec3(), triangle.b.as_dvec3(), triangle.c.as_dvec3());
    0.5 * (b - a).cross(c - a).length()
}

/// A texture as a whole.
#[derive(Clone, Copy)]
struct TextureSummary {
    mean: DVec3,
    /// No sample is brighter.
    brightest: f64,
}

/// Of each texture of what shines.
fn summaries_of_emission(scene: &Scene) -> Vec<Option<TextureSummary>> {
    let mut summaries = vec![None; scene.textures.len()];
    for material in scene.materials.iter().filter(|material| material.is_emissive()) {
        if let Some(of) = material.emission_texture {
            summaries[of.texture].get_or_insert_with(|| TextureSummary::of(&scene.textures[of.texture]));
        }
    }
    summaries
}

impl TextureSummary {
    fn of(texture: &Texture) -> TextureSummary {
        work::add(|| texture.texels.len());
        // Sums of pieces of one length do not depend on the number of threads.
        let of_piece = |piece: &[Vec3]| {
            let sum: DVec3 = piece.iter().map(|texel| texel.as_dvec3()).sum();
            (sum, piece.iter().map(|texel| texel.max_element()).fold(0.0, f32::max))
        };
        let pieces: Vec<(DVec3, f32)> = texture.texels.par_chunks(1 << 16).map(of_piece).collect();
        let sum: DVec3 = pieces.iter().map(|(sum, _)| *sum).sum();
        let brightest = pieces.iter().map(|(_, brightest)| *brightest).fold(0.0, f32::max);
        // The kernels sample half floats.
        TextureSummary { mean: sum / texture.texels.len() as f64, brightest: half::f16::from_f32(brightest).to_f64() }
    }
}

/// Mean of a texture over a triangle, from about as many samples as it has texels there, 64 at most. It only steers
/// choices; a hundredth of the whole texture's is in it, so that what falls between the samples keeps its chance.
fn mean_over(texture: &Texture, mean_of_all: DVec3, uvs: &TriangleUvs) -> DVec3 {
    const MOST_STEPS: f64 = 8.0;
    let [a, b, c] = [uvs.emission_a, uvs.emission_b, uvs.emission_c].map(Vec2::as_dvec2);
    let size = DVec2::new(f64::from(texture.width), f64::from(texture.height));
    let texels = 0.5 * ((b - a) * size).perp_dot((c - a) * size).abs();
    let steps = texels.sqrt().ceil().clamp(1.0, MOST_STEPS) as u32;
    let mut sum = DVec3::ZERO;
    for i in 0..steps {
        for j in 0..steps {
            let root = ((f64::from(i) + 0.5) / f64::from(steps)).sqrt();
            let (u, v) = (root * (1.0 - (f64::from(j) + 0.5) / f64::from(steps)), root * (f64::from(j) + 0.5) / f64::from(steps));
            sum += texture.sample(a + u * (b - a) + v * (c - a)).as_dvec3();
        }
    }
    0.99 * sum / f64::from(steps * steps) + 0.01 * mean_of_all
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

fn corner_uvs(mesh: &Mesh, material: &Material, triangle: usize, part: Option<&[DVec3; 3]>) -> TriangleUvs {
    let of_set = |set: Option<usize>| -> [Vec2; 3] {
        match set {
            Some(set) if !mesh.uvs[set].is_empty() => {
                // Whole turns mean nothing and would cost digits.
                let uvs = mesh.triangles[triangle].map(|vertex| mesh.uvs[set][vertex as usize]);
                let is_far = uvs[0].abs().max_element() > 64.0;
                let base: DVec2 = if is_far { uvs[0].floor() - uvs[0].floor() % 2.0 } else { DVec2::ZERO };
                at_corners(uvs, part).map(|uv| (uv - if base.abs().max_element() > 64.0 { base } else { DVec2::ZERO }).as_vec2())
            }
            _ => [Vec2::ZERO; 3],
        }
    };
    let [base_a, base_b, base_c] = of_set(material.base_colour_texture.map(|texture| texture.uv_set));
    let [emission_a, emission_b, emission_c] = of_set(material.emission_texture.map(|texture| texture.uv_set));
    TriangleUvs { base_a, base_b, base_c, emission_a, emission_b, emission_c }
}

fn material_record(material: &Material) -> SurfaceMaterial {
    let (surface, parameter) = match material.surface {
        Surface::Lambert => (SURFACE_LAMBERT, 0.0),
        Surface::PaperPhong { exponent } => (SURFACE_PAPER_PHONG, exponent),
        Surface::Glossy { exponent } => (SURFACE_GLOSSY, exponent),
        Surface::Mirror => (SURFACE_MIRROR, 0.0),
        Surface::Dielectric { ior } => (SURFACE_DIELECTRIC, ior),
    };
    SurfaceMaterial {
        base_colour: material.base_colour,
        surface,
        emission: material.emission,
        parameter,
        base_texture: material.base_colour_texture.map_or(NONE, |texture| texture.texture as u32),
        emission_texture: material.emission_texture.map_or(NONE, |texture| texture.texture as u32),
        two_sided: u32::from(material.two_sided),
    }
}

/// Textures that a material uses, as half floats.
fn pack_textures(scene: &Scene) -> (Vec<TextureInfo>, Vec<UVec2>) {
    let mut is_used = vec![false; scene.textures.len()];
    for material in &scene.materials {
        for of in [material.base_colour_texture, material.emission_texture].into_iter().flatten() {
            is_used[of.texture] = true;
        }
    }
    let pack = |texel: &Vec3| {
        // Four at once, as CPUs convert them in one instruction.
        let mut halves = [half::f16::ZERO; 4];
        halves.convert_from_f32_slice(&texel.extend(0.0).to_array());
        let [x, y, z, _] = halves.map(|half| u32::from(half.to_bits()));
        UVec2::new(x | y << 16, z)
    };
    let code = |wrap: Wrap| match wrap {
        Wrap::Repeat => 0,
        Wrap::MirroredRepeat => 1,
        Wrap::Clamp => 2,
    };
    let mut texels = Vec::new();
    let mut infos = Vec::with_capacity(scene.textures.len());
    for (texture, is_used) in scene.textures.iter().zip(is_used) {
        infos.push(TextureInfo {
            width: texture.width,
            height: texture.height,
            first_texel: texels.len() as u32,
            wrap: code(texture.wrap[0]) | code(texture.wrap[1]) << 2,
        });
        if is_used {
            texels.par_extend(texture.texels.par_iter().map(pack));
        }
    }
    (infos, texels)
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

use glam::Vec2Swizzles as _;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::built_in;

    #[test]
    fn normals_survive_packing() {
        for code in 0..10_000u32 {
            let z = 1.0 - (code as f32 + 0.5) / 5000.0;
            let azimuth = code as f32 * 2.399_963;
            let flat = (1.0 - z * z).sqrt();
            let n = Vec3::new(flat * azimuth.cos(), flat * azimuth.sin(), z);
            let error = unpack_normal(pack_normal(n)).cross(n).length();
            assert!(error < 8e-5, "{n}: {error}");
        }
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert_eq!(unpack_normal(pack_normal(axis)), axis);
            assert_eq!(unpack_normal(pack_normal(-axis)), -axis);
        }
    }

    #[test]
    fn choices_follow_the_shares_and_leave_none_out() {
        let mut shares = vec![1e-12; 1000];
        shares.push(0.25);
        shares.push(0.75 - 1e-9);
        let dealt = choices(&shares);
        assert_eq!(dealt.iter().map(|choices| u64::from(*choices)).sum::<u64>(), u64::from(CHOICES));
        assert!(dealt.iter().all(|choices| *choices >= 1));
        assert!((f64::from(dealt[1000]) / f64::from(CHOICES) - 0.25).abs() < 1e-4);
        assert!(choices(&[]).is_empty());
        assert_eq!(choices(&[1.0]), [CHOICES]);
    }

    /// Moved and scaled by powers of two, a scene gives the same records.
    #[test]
    fn powers_of_two_change_no_bit() {
        let scene = built_in::by_name("cornell").unwrap();
        let reference = Geometry::new(&scene).unwrap();
        for k in [-20, -3, 1, 20] {
            let mut scaled = scene.clone();
            scaled.meshes.iter_mut().flat_map(|mesh| &mut mesh.positions).for_each(|position| *position *= 2f64.powi(k));
            let geometry = Geometry::new(&scaled).unwrap();
            assert_eq!(geometry.triangles, reference.triangles);
            assert_eq!(geometry.nodes, reference.nodes);
            assert_eq!(geometry.emitters, reference.emitters);
        }
    }

    /// A strip of so many triangles that shines by a texture.
    fn textured_lamp(triangles: u32, texture: Texture) -> Scene {
        let mut lamp = Mesh { name: "lamp".into(), ..Mesh::default() };
        for k in 0..triangles {
            let at = f64::from(k) / f64::from(triangles);
            lamp.positions.extend([DVec3::X * at, DVec3::new(at, 1.0, 0.0), DVec3::new(at + 1.0 / f64::from(triangles), 1.0, 0.0)]);
            lamp.uvs[0].extend([DVec2::new(at, 0.0), DVec2::new(at, 1.0), DVec2::new(at, 1.0)]);
            lamp.triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
        }
        let mut material = Material::lambert("lamp", Vec3::ONE);
        material.emission = Vec3::ONE;
        material.emission_texture = Some(crate::scene::material::TextureUse { texture: 0, uv_set: 0 });
        Scene { meshes: vec![lamp], materials: vec![material], textures: vec![texture], ..Scene::default() }
    }

    /// A texture is summed once and not for every triangle.
    #[test]
    fn many_triangles_shine_by_a_large_texture() {
        let texture =
            Texture { name: "t".into(), width: 2048, height: 2048, texels: vec![Vec3::splat(0.25); 1 << 22], wrap: [Wrap::Repeat; 2] };
        let scene = textured_lamp(6036, texture);
        let (geometry, summed) = work::of(|| Geometry::new(&scene).unwrap());
        assert_eq!(geometry.emitters.len(), 6036);
        let watts = geometry.power * geometry.unit * geometry.unit;
        assert!((watts / (3.0 * PI * 0.25 * 0.5) - 1.0).abs() < 1e-4, "{watts} W");
        assert!((1 << 22..2 << 22).contains(&summed), "{summed} texels summed");
    }

    /// No sample of a texture, whose half floats may be rounded up, exceeds what photons' fluxes are scaled by.
    #[test]
    fn no_sample_is_brighter_than_the_brightest() {
        let texels: Vec<Vec3> = (0..70_000u32).map(|k| Vec3::new(0.1, 0.2 + 0.7 * (k % 997) as f32 / 997.0, 0.3)).collect();
        let texture = Texture { name: "t".into(), width: 700, height: 100, texels, wrap: [Wrap::Repeat; 2] };
        let summary = TextureSummary::of(&texture);
        let packed = |texel: &Vec3| half::f16::from_f32(texel.y).to_f64();
        let brightest = texture.texels.iter().map(packed).fold(0.0, f64::max);
        assert_eq!(summary.brightest, brightest);
        let mean: DVec3 = texture.texels.iter().map(|texel| texel.as_dvec3()).sum::<DVec3>() / 70_000.0;
        assert!((summary.mean - mean).abs().max_element() < 1e-12, "{} {mean}", summary.mean);
        let geometry = Geometry::new(&textured_lamp(3, texture)).unwrap();
        assert!(geometry.emitters.iter().all(|emitter| f64::from(emitter.flux.max_element()) * brightest <= 1.0 + 1e-6));
    }

    #[test]
    fn emitters_hold_all_power() {
        let scene = built_in::by_name("cornell").unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let watts = geometry.power * geometry.unit * geometry.unit;
        let exact = PI * 0.09 * (17.0 + 12.0 + 4.0);
        assert!((watts / exact - 1.0).abs() < 1e-5, "{watts} W, {exact} W");
        // Every photon of these two equal triangles carries the same.
        assert_eq!(geometry.emitters.len(), 2);
        assert!(geometry.emitters.iter().all(|emitter| (emitter.flux.max_element() - 1.0).abs() < 1e-6));
        assert_eq!(geometry.emitters[1].cumulative, 1.0);
    }
}
