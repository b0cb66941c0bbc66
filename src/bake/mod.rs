//! Lightmaps: a scene goes in, and where on its surfaces irradiance is wanted comes out ([`Layout`]);
//! the irradiance found there goes in, and maps ([`Map`]) and files ([`write()`]) come out. Between the
//! two stands whoever finds the light.
//!
//! # Texels
//!
//! Every mesh has a map of its own. Where the mesh brings a second set of texture coordinates that is
//! fit for a lightmap, that is taken; else the mesh is unwrapped ([`unwrap`]). Texel (x, y) covers
//! u from x / width to (x + 1) / width and v from y / height to (y + 1) / height; y = 0 is the
//! picture's uppermost row, as in glTF. A texel is looked at in up to [`PHASE_COUNT`] points of the
//! surface; the mean over the phases is the mean over the texel. What no triangle covers is filled
//! from the nearest texel that is covered, so that bilinear filtering finds nothing black at a seam.
//!
//! - Surfaces that only reflect sharply or let light through get no map: irradiance says nothing about what they send to the eye.
//! - Of a two-sided surface the front is baked. Both sides show it, so a thin sheet looks lit from
//!   behind as it is from the front.
//!
//! # Files
//!
//! For each mesh, in the folder named:
//!
//! | file | holds |
//! |---|---|
//! | `NAME_irradiance.exr` | irradiance, W/m2, 32-bit floats, linear |
//! | `NAME_error.exr` | its standard error, W/m2, 32-bit floats; infinite where unknown: after a single round, or where no light has reached a texel though some may |
//! | `NAME.png` | irradiance / pi times the exposure, sRGB: a white surface as it would look |
//! | `NAME_radiance.png` | the radiance that leaves the mesh, times the exposure, sRGB |
//! | `NAME_lightmap.png` | irradiance over the mesh's own brightest, linear: for engines |
//!
//! and the scene written again, twice, because glTF has no place for a lightmap:
//!
//! - `scene.gltf` shows the baked light in every viewer and in Blender. The materials that
//!   have a map are black and shine with `NAME_radiance.png`, so that lamps and environments of the
//!   viewer add nothing to them. A texture finer than the lightmap is as coarse as the lightmap there.
//! - `scene_lightmap.gltf` is for engines. Its materials are the scene's, with `NAME_lightmap.png` as
//!   MOZ_lightmap, read as three.js reads it: texel times intensity is irradiance (times the
//!   exposure), to be multiplied with base colour / pi. It has no punctual lights: the lightmap holds
//!   their light already, and an engine would add it again.
//!
//! Both use `scene.bin` and the textures `texture_N.png`. TEXCOORD_0 holds the coordinates of the
//! scene's textures, TEXCOORD_1 those of the lightmap. Where a material's textures use both sets of a
//! mesh that had to be unwrapped, its second set moves to TEXCOORD_2.

mod document;
mod files;
mod gutters;
mod names;
mod raster;
mod texels;
pub mod unwrap;

use std::collections::BTreeMap;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

pub use files::write;
pub use texels::{CoveredTexel, SurfacePoint};

use crate::error::{Error, Result};
use crate::scene::light::LightKind;
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
    /// What the user should know, each once.
    pub warnings: Vec<String>,
}

/// The lightmap of one mesh, without its light.
#[derive(Debug, Clone)]
pub struct MeshLightmap {
    /// The scene's mesh: the same triangles in the same order, vertices doubled along seams.
    pub mesh: Mesh,
    /// Lightmap coordinates from 0 to 1, one a vertex of `mesh`.
    pub uvs: Vec<DVec2>,
    /// Whether the coordinates are the mesh's own second set.
    pub is_second_set: bool,
    /// Texels.
    pub width: u32,
    pub height: u32,
    /// What triangles cover, row by row.
    pub texels: Vec<CoveredTexel>,
    /// For every texel of the map, row by row, the index in `texels` of the nearest covered one.
    nearest: Vec<u32>,
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

/// The lightmap of one mesh, row by row, gutters filled.
#[derive(Debug, Clone, PartialEq)]
pub struct Map {
    /// Index of the mesh in the scene.
    pub mesh: usize,
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
        const OPTION: &str = "--texels-per-metre";
        if !(texels_per_metre.is_finite() && texels_per_metre > 0.0) {
            return Err(Error::setting(OPTION, texels_per_metre, "must be above 0"));
        }
        let kinds = scene.lobe_kinds();
        let unwrapped: Vec<Option<unwrap::Unwrapped>> = scene
            .meshes
            .par_iter()
            .map(|mesh| match kinds[mesh.material].matt {
                false => Ok(None),
                true => unwrap::unwrap(mesh, texels_per_metre).map(Some),
            })
            .zip(&scene.meshes)
            .map(|(unwrapped, mesh)| {
                unwrapped.map_err(|reason| Error::Scene {
                    path: scene.name.clone().into(),
                    object: format!("mesh '{}'", mesh.name),
                    reason,
                })
            })
            .collect::<Result<_>>()?;
        let texel_count: u64 = unwrapped.iter().flatten().map(|mesh| u64::from(mesh.width) * u64::from(mesh.height)).sum();
        if texel_count > MAX_TEXELS {
            let allowed = format!("needs {texel_count} texels in all, but at most {MAX_TEXELS} can be baked; choose a smaller value");
            return Err(Error::setting(OPTION, texels_per_metre, allowed));
        }
        let warnings = warnings(scene, &unwrapped);
        let meshes = unwrapped.into_iter().map(|mesh| mesh.map(MeshLightmap::new)).collect();
        Ok(Layout { meshes, warnings })
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
        let mut rest = results;
        let mut maps = Vec::new();
        for (mesh, lightmap) in self.lightmaps() {
            let (own, after) = rest.split_at(lightmap.texels.len());
            rest = after;
            let spread = |value: fn(&TexelEstimate) -> Vec3| lightmap.spread(&own.iter().map(value).collect::<Vec<_>>());
            maps.push(Map {
                mesh,
                width: lightmap.width,
                height: lightmap.height,
                irradiance: spread(|texel| texel.irradiance),
                error: spread(|texel| texel.standard_error),
            });
        }
        maps
    }
}

impl MeshLightmap {
    fn new(unwrapped: unwrap::Unwrapped) -> MeshLightmap {
        let unwrap::Unwrapped { mesh, uvs, width, height, is_second_set, .. } = unwrapped;
        let texels = texels::covered(&mesh, &uvs, width, height);
        let nearest = gutters::nearest(width, height, &texels);
        MeshLightmap { mesh, uvs, is_second_set, width, height, texels, nearest }
    }

    /// Values of the covered texels laid out as a picture, each uncovered texel as the nearest
    /// covered one.
    fn spread(&self, values: &[Vec3]) -> Vec<Vec3> {
        self.nearest.iter().map(|texel| values[*texel as usize]).collect()
    }
}

/// One line a subject, however many meshes it concerns.
fn warnings(scene: &Scene, unwrapped: &[Option<unwrap::Unwrapped>]) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut refused: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    let mut coarse = Vec::new();
    for mesh in unwrapped.iter().flatten() {
        let name = format!("'{}'", mesh.mesh.name);
        if let Some(reason) = mesh.refused {
            refused.entry(reason).or_default().push(name.clone());
        }
        if mesh.is_coarse {
            coarse.push(name);
        }
    }
    for (reason, names) in refused {
        warnings.push(format!("new lightmap UVs for {}: the second UV set {reason}", some_of(names.iter())));
    }
    if !coarse.is_empty() {
        warnings.push(format!(
            "lightmaps are limited to {MAX_SIDE} texels per side: fewer texels per metre than requested on {}",
            some_of(coarse.iter())
        ));
    }
    if unwrapped.iter().all(Option::is_none) {
        warnings.push("every surface is a mirror or a dielectric: there is nothing to bake".into());
    }
    if scene.lights.iter().any(|light| matches!(light.kind, LightKind::Disc { .. } | LightKind::Environment { .. })) {
        warnings.push("glTF has no disc or environment lights: the lightmaps contain their light, but scene.gltf omits them".into());
    }
    warnings
}
