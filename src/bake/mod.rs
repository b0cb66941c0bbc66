//! Lightmaps: a scene goes in, and where on its surfaces irradiance is wanted comes out ([`Layout`]);
//! the irradiance found there goes in, and maps ([`Map`]) and files come out. Between the
//! two stands whoever finds the light.
//!
//! # Texels
//!
//! Every object has a map of its own: the primitives that one node of a file has, or one mesh of a built-in scene. Where the
//! object brings a second set of texture coordinates (or a third, ...) that is fit for a lightmap, that is taken; else it is
//! unwrapped ([`unwrap`]). Objects that are instances of one mesh, alike in shape, share their new coordinates. Texel (x, y) covers
//! u from x / width to (x + 1) / width and v from y / height to (y + 1) / height; y = 0 is the
//! picture's uppermost row, as in glTF. A texel is looked at in up to [`PHASE_COUNT`] points of the
//! surface; the mean over the phases is the mean over the texel. What no triangle covers is filled
//! from the nearest texel that is covered, so that bilinear filtering finds nothing black at a seam.
//!
//! - Surfaces that only reflect sharply or let light through get no map: irradiance says nothing about what they send to the eye.
//! - Of a two-sided surface the front is baked, or the back where no light reaches the front or all cameras look at the back. Both
//!   sides show it, so a thin sheet looks lit from behind as it is from the front.
//!
//! # Files of a scene from a file
//!
//! [`IntoFile`] writes the file again with lightmap coordinates and, beside it, lightmaps as EXR: a picture per object, or
//! pages that several share ([`pages`]). [`original`] says what is added to the file. The guide's page on lightmaps is the reference.
//!
//! # Files of a built-in scene
//!
//! [`write()`] writes for each mesh, in the folder named:
//!
//! | file | holds |
//! |---|---|
//! | `NAME_irradiance.exr` | irradiance, W/m2, 32-bit floats, linear |
//! | `NAME_error.exr` | its standard error, W/m2, 32-bit floats; infinite where unknown: before eight blocks of rounds are whole, or where no light has reached a texel though some may; in the layer `unseen` the most that light which was not met may add; `degreesOfFreedom` is of the errors |
//! | `NAME.png` | irradiance / pi times the exposure, sRGB: a white surface as it would look |
//! | `NAME_radiance.png` | the radiance that leaves the mesh, times the exposure, sRGB |
//! | `NAME_lightmap.png` | irradiance over the mesh's own brightest, linear: for engines |
//!
//! and the scene, twice, because glTF has no place for a lightmap:
//!
//! - `scene.gltf` shows the baked light in every viewer and in Blender. The materials that
//!   have a map are black and emit `NAME_radiance.png`, so that lamps and environments of the
//!   viewer add nothing to them. A texture finer than the lightmap is as coarse as the lightmap there.
//! - `scene_lightmap.gltf` is for engines. Its materials are the scene's, with `NAME_lightmap.png` as
//!   MOZ_lightmap, read as three.js reads it: texel times intensity is irradiance (times the
//!   exposure), to be multiplied with base colour / pi. It has no punctual lights: the lightmap holds
//!   their light already, and an engine would add it again.
//!
//! Both use `scene.bin` and the textures `texture_N.png`. TEXCOORD_0 holds the coordinates of the
//! scene's textures, TEXCOORD_1 those of the lightmap. Where a material's textures use both sets of a
//! mesh that had to be unwrapped, its second set moves to TEXCOORD_2.

mod bleeding;
mod document;
mod files;
mod gutters;
mod hidden_points;
mod lighting;
mod names;
mod objects;
pub(crate) mod original;
pub mod pages;
pub(crate) mod part;
mod raster;
mod sides;
mod texels;
pub(crate) mod unwrap;

use std::collections::BTreeMap;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

pub(crate) use files::{IntoFile, Written, names, write};
pub(crate) use lighting::{estimates, usual_density, usual_exposure};
pub(crate) use texels::{CoveredTexel, SurfacePoint};

use crate::engine::error::bound::ErrorSource;
use crate::error::{Error, Result};
use crate::scene::gltf::source::File;
use crate::scene::light::{Light, LightKind};
use crate::scene::{Mesh, Scene};
use crate::text::some_of;

/// Points in which each texel is looked at.
pub(crate) const PHASE_COUNT: usize = 4;
/// Longest side of a map, texels.
pub const MAX_SIDE: u32 = 4096;
/// Shortest side of a map, texels.
pub(crate) const MIN_SIDE: u32 = 1;
/// Texels of all maps together; a covered one takes about 100 bytes here and as much again as a result.
const MAX_TEXELS: u64 = 1 << 26;

/// Where the lightmaps of a scene lie on its surfaces.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    /// One a mesh of the scene; none where it is a mirror or a dielectric.
    pub meshes: Vec<Option<MeshLightmap>>,
    /// What has a map.
    pub objects: Vec<Object>,
    /// What the user should know, each once.
    pub warnings: Vec<String>,
}

/// Meshes that share a map, without its light.
#[derive(Debug, Clone)]
pub(crate) struct Object {
    pub name: String,
    /// Their indices in the scene.
    pub meshes: Vec<usize>,
    /// Texels.
    pub width: u32,
    pub height: u32,
    /// Which of the file's sets the coordinates are; `None` for new ones.
    pub set: Option<usize>,
    /// What takes coordinates of that set to those of the map: offset + scale * uv.
    pub offset: DVec2,
    pub scale: DVec2,
    /// The object that it shares new coordinates with: itself, or another instance of the same mesh.
    pub charts_of: usize,
    /// For every texel of the map, row by row, the index among the covered ones of all meshes of the nearest.
    nearest: Vec<u32>,
}

/// The part of a map that is of one mesh.
#[derive(Debug, Clone)]
pub(crate) struct MeshLightmap {
    /// The scene's mesh: the same triangles in the same order, vertices doubled along seams.
    pub mesh: Mesh,
    /// Lightmap coordinates from 0 to 1, one per vertex of `mesh`.
    pub uvs: Vec<DVec2>,
    /// Whether the coordinates are the mesh's own second set.
    pub is_second_set: bool,
    /// Texels of the object's map.
    #[cfg_attr(not(test), expect(dead_code, reason = "tests alone read it"))]
    pub width: u32,
    #[cfg_attr(not(test), expect(dead_code, reason = "tests alone read it"))]
    pub height: u32,
    /// What triangles cover, row by row.
    pub texels: Vec<CoveredTexel>,
    /// Triangles of which the back is baked; empty where none is.
    pub turned: Vec<bool>,
}

/// A point of a surface whose irradiance is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TexelSample {
    /// Metres, world.
    pub position: DVec3,
    /// Unit normal of the triangle's side that is baked.
    pub geometric_normal: DVec3,
    /// Unit, interpolated; on that side.
    pub shading_normal: DVec3,
}

/// What was found for one texel, W/m2.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct TexelEstimate {
    pub irradiance: Vec3,
    pub standard_error: Vec3,
    /// The most that light which was not met may add to any channel.
    pub unseen: f32,
}

/// The lightmap of one object, row by row, gutters filled.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Map {
    /// Index of the object in the layout.
    pub object: usize,
    pub width: u32,
    pub height: u32,
    /// W/m2.
    pub irradiance: Vec<Vec3>,
    /// Standard error, W/m2.
    pub error: Vec<Vec3>,
    /// The most that light which was not met may add to any channel, W/m2.
    pub unseen: Vec<Vec3>,
    /// Of the errors.
    pub source: ErrorSource,
}

impl Layout {
    /// Unwraps what needs it and finds the covered texels.
    #[cfg(test)]
    pub(crate) fn new(scene: &Scene, texels_per_metre: f64) -> Result<Layout> {
        Layout::of_file(scene, None, texels_per_metre, MAX_SIDE)
    }

    /// The same for a scene from a file, which may have more sets of coordinates than a scene. No side of a map is longer than
    /// `max_side`.
    pub(crate) fn of_file(scene: &Scene, file: Option<&File>, texels_per_metre: f64, max_side: u32) -> Result<Layout> {
        const OPTION: &str = "texels_per_metre";
        if !(texels_per_metre.is_finite() && texels_per_metre > 0.0) {
            return Err(Error::setting(OPTION, texels_per_metre, "must be above 0"));
        }
        let unwrapped = objects::unwrap(scene, file, texels_per_metre, max_side)?;
        let texel_count: u64 = unwrapped.iter().map(|object| u64::from(object.charts.width) * u64::from(object.charts.height)).sum();
        if texel_count > MAX_TEXELS {
            let allowed = format!("needs {texel_count} texels in all, but at most {MAX_TEXELS} can be baked; choose a smaller value");
            return Err(Error::setting(OPTION, texels_per_metre, allowed));
        }
        let mut warnings = warnings(scene, &unwrapped, max_side, file.is_none());
        let mut meshes: Vec<Option<MeshLightmap>> = vec![None; scene.meshes.len()];
        let mut layout_objects = Vec::new();
        let with_maps: Vec<(Object, Vec<MeshLightmap>)> = unwrapped.into_par_iter().map(|object| object.with_texels(scene)).collect();
        for (object, lightmaps) in with_maps {
            object.meshes.iter().zip(lightmaps).for_each(|(mesh, lightmap)| meshes[*mesh] = Some(lightmap));
            layout_objects.push(object);
        }
        warnings.extend(choose_sides(scene, &layout_objects, &mut meshes));
        leave_out_hidden_points(scene, &mut layout_objects, &mut meshes);
        Ok(Layout { meshes, objects: layout_objects, warnings })
    }

    /// The maps in the order of the scene's meshes, with the meshes' indices.
    pub(crate) fn lightmaps(&self) -> impl Iterator<Item = (usize, &MeshLightmap)> {
        self.meshes.iter().enumerate().filter_map(|(mesh, lightmap)| lightmap.as_ref().map(|lightmap| (mesh, lightmap)))
    }

    /// Covered texels of all maps: the length of every phase.
    pub(crate) fn texel_count(&self) -> usize {
        self.lightmaps().map(|(_, lightmap)| lightmap.texels.len()).sum()
    }

    /// One point of every covered texel: map after map, row by row. Phases are numbered from 0 to
    /// [`PHASE_COUNT`]; a texel with fewer points has some in several phases.
    pub(crate) fn phase(&self, phase: usize) -> Vec<TexelSample> {
        self.lightmaps().flat_map(|(_, lightmap)| lightmap.texels.iter().map(move |texel| lightmap.sample(&texel.points[phase]))).collect()
    }

    #[cfg(test)]
    pub(crate) fn phases(&self) -> Vec<Vec<TexelSample>> {
        (0..PHASE_COUNT).map(|phase| self.phase(phase)).collect()
    }

    /// Maps with filled gutters from what was found for the covered texels, in the order of
    /// [`Layout::phase`]; `source` is that of the errors.
    pub(crate) fn maps(&self, results: &[TexelEstimate], source: ErrorSource) -> Vec<Map> {
        assert_eq!(results.len(), self.texel_count(), "one result a covered texel");
        let mut first = vec![0; self.meshes.len()];
        let mut count = 0;
        for (mesh, lightmap) in self.lightmaps() {
            first[mesh] = count;
            count += lightmap.texels.len();
        }
        let map = |(index, object): (usize, &Object)| {
            let of_mesh = |mesh: &usize| &results[first[*mesh]..][..self.part(*mesh).texels.len()];
            let own: Vec<TexelEstimate> = object.meshes.iter().flat_map(of_mesh).copied().collect();
            let spread = |value: fn(&TexelEstimate) -> Vec3| object.spread(&own.iter().map(value).collect::<Vec<_>>());
            Map {
                object: index,
                width: object.width,
                height: object.height,
                irradiance: spread(|texel| texel.irradiance),
                error: spread(|texel| texel.standard_error),
                unseen: spread(|texel| Vec3::splat(texel.unseen)),
                source,
            }
        };
        self.objects.iter().enumerate().map(map).collect()
    }

    /// The lightmap of a mesh that an object has.
    fn part(&self, mesh: usize) -> &MeshLightmap {
        self.meshes[mesh].as_ref().expect("the meshes of an object have a lightmap")
    }
}

impl MeshLightmap {
    /// What is asked about at a point.
    fn sample(&self, point: &SurfacePoint) -> TexelSample {
        let TexelSample { position, geometric_normal, shading_normal } = point.sample(&self.mesh);
        match self.turned.get(point.triangle as usize) {
            Some(true) => TexelSample { position, geometric_normal: -geometric_normal, shading_normal: -shading_normal },
            _ => TexelSample { position, geometric_normal, shading_normal },
        }
    }
}

/// Bakes the backs that are seen, and says what the user should know of that.
fn choose_sides(scene: &Scene, objects: &[Object], meshes: &mut [Option<MeshLightmap>]) -> Vec<String> {
    let all: Vec<usize> = objects.iter().flat_map(|object| object.meshes.iter().copied()).collect();
    let mut sides = sides::of(scene, &all);
    let (mut turned, mut dark) = (Vec::new(), Vec::new());
    for object in objects {
        let of_object: Vec<(usize, sides::Sides)> = object.meshes.iter().filter_map(|mesh| Some((*mesh, sides.remove(mesh)?))).collect();
        let name = || format!("'{}'", object.name);
        turned.extend(of_object.iter().any(|(_, sides)| !sides.turned.is_empty()).then(name));
        dark.extend(of_object.iter().any(|(_, sides)| sides.is_inside_out).then(name));
        for (mesh, sides) in of_object {
            meshes[mesh].as_mut().expect("the meshes of an object have a lightmap").turned = sides.turned;
        }
    }
    let mut warnings = Vec::new();
    if !turned.is_empty() {
        let names = some_of(turned.iter());
        warnings
            .push(format!("the back is baked of {names}: no light reaches the front, or no camera sees it; turn the faces for the front"));
    }
    if !dark.is_empty() {
        let names = some_of(dark.iter());
        warnings.push(format!(
            "the lightmap is dark of {names}: its faces look inwards, where no light comes; turn them, or make its material double-sided"
        ));
    }
    warnings
}

/// What is never seen counts for nothing; an object of which nothing else is there stays as it is.
fn leave_out_hidden_points(scene: &Scene, objects: &mut [Object], meshes: &mut [Option<MeshLightmap>]) {
    let faces = hidden_points::Faces::new(scene, meshes);
    for object in objects {
        let part = |mesh: &usize| meshes[*mesh].as_ref().expect("the meshes of an object have a lightmap");
        let left: Vec<_> = object.meshes.iter().map(|mesh| faces.left(*mesh, part(mesh))).collect();
        let is_changed = left.iter().any(Option::is_some);
        let texels: Vec<Vec<CoveredTexel>> =
            object.meshes.iter().zip(left).map(|(mesh, left)| left.unwrap_or_else(|| part(mesh).texels.clone())).collect();
        if !is_changed || texels.iter().all(Vec::is_empty) {
            continue;
        }
        let covered = texels.iter().flatten().map(|texel| (texel.x, texel.y));
        object.nearest = gutters::nearest(object.width, object.height, covered);
        for (mesh, texels) in object.meshes.iter().zip(texels) {
            meshes[*mesh].as_mut().expect("the meshes of an object have a lightmap").texels = texels;
        }
    }
}

impl Object {
    /// Values of the covered texels, mesh after mesh, laid out as a picture, each uncovered texel as the nearest
    /// covered one.
    fn spread(&self, values: &[Vec3]) -> Vec<Vec3> {
        self.nearest.iter().map(|texel| values[*texel as usize]).collect()
    }
}

/// One line a subject, however many meshes it concerns. `is_written_anew`: the scene has no file that is kept.
fn warnings(scene: &Scene, unwrapped: &[objects::Unwrapped], max_side: u32, is_written_anew: bool) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut refused: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    let mut coarse = Vec::new();
    for object in unwrapped {
        let name = format!("'{}'", object.name);
        if let Some(reason) = object.charts.refused {
            refused.entry(reason).or_default().push(name.clone());
        }
        if object.charts.is_coarse {
            coarse.push(name);
        }
    }
    for (reason, names) in refused {
        warnings.push(format!("new lightmap UVs for {}: the second UV set {reason}", some_of(names.iter())));
    }
    if !coarse.is_empty() {
        warnings.push(format!(
            "lightmaps are limited to {max_side} texels per side: fewer texels per metre than requested on {}",
            some_of(coarse.iter())
        ));
    }
    let is_left_out = |light: &Light| matches!(light.kind, LightKind::Disc { .. } | LightKind::Environment { .. } | LightKind::Sky(_));
    if is_written_anew && scene.lights.iter().any(is_left_out) {
        warnings.push("glTF has no disc or environment lights: the lightmaps contain their light, but scene.gltf omits them".into());
    }
    warnings
}
