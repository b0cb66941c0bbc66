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
//! - Of a two-sided surface the front is baked. Both sides show it, so a thin sheet looks lit from
//!   behind as it is from the front.
//!
//! # Files of a scene from a file
//!
//! [`IntoFile`] writes the file again with lightmap coordinates and, beside it, lightmaps as EXR: a picture an object, or
//! pages that several share ([`pages`]). [`original`] says what is added to the file. The guide's page on lightmaps is the reference.
//!
//! # Files of a built-in scene
//!
//! [`write()`] writes for each mesh, in the folder named:
//!
//! | file | holds |
//! |---|---|
//! | `NAME_irradiance.exr` | irradiance, W/m2, 32-bit floats, linear |
//! | `NAME_error.exr` | its standard error, W/m2, 32-bit floats; infinite where unknown: before two blocks of rounds are whole, or where no light has reached a texel though some may |
//! | `NAME.png` | irradiance / pi times the exposure, sRGB: a white surface as it would look |
//! | `NAME_radiance.png` | the radiance that leaves the mesh, times the exposure, sRGB |
//! | `NAME_lightmap.png` | irradiance over the mesh's own brightest, linear: for engines |
//!
//! and the scene, twice, because glTF has no place for a lightmap:
//!
//! - `scene.gltf` shows the baked light in every viewer and in Blender. The materials that
//!   have a map are black and shine with `NAME_radiance.png`, so that lamps and environments of the
//!   viewer add nothing to them. A texture finer than the lightmap is as coarse as the lightmap there.
//!   [`preview`] is the same in one file.
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
mod lighting;
mod names;
mod objects;
pub mod original;
pub mod pages;
pub mod part;
mod raster;
mod texels;
pub mod unwrap;

use std::collections::BTreeMap;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

pub use files::{IntoFile, Written, names, preview, write};
pub use lighting::{estimates, usual_density, usual_exposure};
pub use texels::{CoveredTexel, SurfacePoint};

use crate::error::{Error, Result};
use crate::scene::gltf::source::File;
use crate::scene::light::{Light, LightKind};
use crate::scene::{Mesh, Scene};
use crate::text::some_of;

/// Points in which each texel is looked at.
pub const PHASE_COUNT: usize = 4;
/// Longest side of a map, texels.
pub const MAX_SIDE: u32 = 4096;
/// Shortest side of a map, texels.
pub const MIN_SIDE: u32 = 4;
/// Texels of all maps together; a covered one takes about 100 bytes here and as much again as a result.
const MAX_TEXELS: u64 = 1 << 26;

/// Where the lightmaps of a scene lie on its surfaces.
#[derive(Debug, Clone)]
pub struct Layout {
    /// One a mesh of the scene; none where it is a mirror or a dielectric.
    pub meshes: Vec<Option<MeshLightmap>>,
    /// What has a map.
    pub objects: Vec<Object>,
    /// What the user should know, each once.
    pub warnings: Vec<String>,
}

/// Meshes that share a map, without its light.
#[derive(Debug, Clone)]
pub struct Object {
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
pub struct MeshLightmap {
    /// The scene's mesh: the same triangles in the same order, vertices doubled along seams.
    pub mesh: Mesh,
    /// Lightmap coordinates from 0 to 1, one a vertex of `mesh`.
    pub uvs: Vec<DVec2>,
    /// Whether the coordinates are the mesh's own second set.
    pub is_second_set: bool,
    /// Texels of the object's map.
    pub width: u32,
    pub height: u32,
    /// What triangles cover, row by row.
    pub texels: Vec<CoveredTexel>,
}

/// A point of a surface whose irradiance is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TexelSample {
    /// Metres, world.
    pub position: DVec3,
    /// Unit normal of the triangle's front.
    pub geometric_normal: DVec3,
    /// Unit, interpolated; on the front's side.
    pub shading_normal: DVec3,
}

/// What was found for one texel, W/m2.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TexelEstimate {
    pub irradiance: Vec3,
    pub standard_error: Vec3,
}

/// The lightmap of one object, row by row, gutters filled.
#[derive(Debug, Clone, PartialEq)]
pub struct Map {
    /// Index of the object in the layout.
    pub object: usize,
    pub width: u32,
    pub height: u32,
    /// W/m2.
    pub irradiance: Vec<Vec3>,
    /// Standard error, W/m2.
    pub error: Vec<Vec3>,
}

impl Layout {
    /// Unwraps what needs it and finds the covered texels.
    pub fn new(scene: &Scene, texels_per_metre: f64) -> Result<Layout> {
        Layout::of_file(scene, None, texels_per_metre, MAX_SIDE)
    }

    /// The same for a scene from a file, which may have more sets of coordinates than a scene. No side of a map is longer than
    /// `max_side`.
    pub fn of_file(scene: &Scene, file: Option<&File>, texels_per_metre: f64, max_side: u32) -> Result<Layout> {
        const OPTION: &str = "--texels-per-metre";
        if !(texels_per_metre.is_finite() && texels_per_metre > 0.0) {
            return Err(Error::setting(OPTION, texels_per_metre, "must be above 0"));
        }
        let unwrapped = objects::unwrap(scene, file, texels_per_metre, max_side)?;
        let texel_count: u64 = unwrapped.iter().map(|object| u64::from(object.charts.width) * u64::from(object.charts.height)).sum();
        if texel_count > MAX_TEXELS {
            let allowed = format!("needs {texel_count} texels in all, but at most {MAX_TEXELS} can be baked; choose a smaller value");
            return Err(Error::setting(OPTION, texels_per_metre, allowed));
        }
        let warnings = warnings(scene, &unwrapped, max_side, file.is_none());
        let mut meshes: Vec<Option<MeshLightmap>> = vec![None; scene.meshes.len()];
        let mut layout_objects = Vec::new();
        let with_maps: Vec<(Object, Vec<MeshLightmap>)> = unwrapped.into_par_iter().map(|object| object.with_texels(scene)).collect();
        for (object, lightmaps) in with_maps {
            object.meshes.iter().zip(lightmaps).for_each(|(mesh, lightmap)| meshes[*mesh] = Some(lightmap));
            layout_objects.push(object);
        }
        Ok(Layout { meshes, objects: layout_objects, warnings })
    }

    /// The maps in the order of the scene's meshes, with the meshes' indices.
    pub fn lightmaps(&self) -> impl Iterator<Item = (usize, &MeshLightmap)> {
        self.meshes.iter().enumerate().filter_map(|(mesh, lightmap)| lightmap.as_ref().map(|lightmap| (mesh, lightmap)))
    }

    /// Covered texels of all maps: the length of every phase.
    pub fn texel_count(&self) -> usize {
        self.lightmaps().map(|(_, lightmap)| lightmap.texels.len()).sum()
    }

    /// One point of every covered texel: map after map, row by row. Phases are numbered from 0 to
    /// [`PHASE_COUNT`]; a texel with fewer points has some in several phases.
    pub fn phase(&self, phase: usize) -> Vec<TexelSample> {
        self.lightmaps()
            .flat_map(|(_, lightmap)| lightmap.texels.iter().map(move |texel| texel.points[phase].sample(&lightmap.mesh)))
            .collect()
    }

    pub fn phases(&self) -> Vec<Vec<TexelSample>> {
        (0..PHASE_COUNT).map(|phase| self.phase(phase)).collect()
    }

    /// Maps with filled gutters from what was found for the covered texels, in the order of
    /// [`Layout::phase`].
    pub fn maps(&self, results: &[TexelEstimate]) -> Vec<Map> {
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
            }
        };
        self.objects.iter().enumerate().map(map).collect()
    }

    /// The lightmap of a mesh that an object has.
    fn part(&self, mesh: usize) -> &MeshLightmap {
        self.meshes[mesh].as_ref().expect("the meshes of an object have a lightmap")
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
