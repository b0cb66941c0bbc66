//! Lighting a scene of triangles: rounds of photons, maps and visible points, on the GPU.
//!
//! Each round is independent: its own photons, its own paths from the camera, its own radius (Knaus and
//! Zwicker 2011). So the mean over rounds converges to the right answer, its variance gives the error, and
//! any round could run anywhere.
//!
//! ```text
//! visible points    paths from the camera over mirrors and glass: visible points, direct light by shadow rays
//! radii             in the first round: each point's, by the density of the trial's photons
//! global            where walls end what a visible point looks through; photons of the global map: traced, sorted, gathered there
//! caustic           the same with photons that took mirrors and glass only, and were aimed at these
//! flux to radiance  from flux over the area that lies on the surface, times reflectance; within a smaller radius too, for the bias
//! resolve           all light of a pixel: to the film
//! ```

pub(crate) mod bias;
pub(crate) mod estimate;
pub(crate) mod fill_map;
pub mod film;
pub(crate) mod film_buffers;
mod identity;
pub(crate) mod index;
mod light_trial;
pub(crate) mod live;
pub(crate) mod losses;
mod map_cache;
pub(crate) mod map_file;
mod map_in_round;
mod on_gpu;
mod on_several;
pub mod pilot;
mod pilot_rounds;
pub(crate) mod points;
pub(crate) mod radius_class;
pub(crate) mod replay;
pub(crate) mod resources;
pub(crate) mod trace;
pub(crate) mod trial;
mod trial_rays;

use glam::DVec3;

pub use film::SceneFilm;
pub(crate) use identity::scene_hash;
#[cfg(test)]
pub(crate) use on_gpu::task;
pub(crate) use on_gpu::{constants, light, light_from, modules};
pub(crate) use on_several::light_on;

use crate::engine::error::bound::FilmError;
use crate::engine::run;
use crate::plan::scene::ScenePlan;
use crate::plan::sensor::Sensor;
use crate::records::Receiver;
use crate::scene::Camera;
use crate::scene::geometry::Geometry;
use resources::{PhotonBuffers, SceneResources};

/// What a run leaves behind: the fates are those of the global map's photons and of the caustic map's.
pub type RunResult = run::RunResult<ScenePlan, SceneFilm>;

impl RunResult {
    /// What its film says of its error, unknown of few blocks, with the bias that extra runs found.
    pub fn error(&self) -> FilmError {
        let error = self.film.error(self.film.plan.confidence);
        FilmError { bias: self.bias.or(error.bias), ..error }.stated()
    }
}

/// What is lit and what looks at it.
pub(crate) struct Viewpoint<'a> {
    pub geometry: &'a Geometry,
    /// For a picture.
    pub camera: Option<&'a Camera>,
    /// Sets of receivers of equal length, one per round in turn; none for a picture.
    pub phases: &'a [Vec<Receiver>],
}

/// One round of a run: what its stages share.
#[derive(Clone, Copy)]
pub(crate) struct Round<'a> {
    pub resources: &'a SceneResources,
    pub geometry: &'a Geometry,
    pub plan: &'a ScenePlan,
    pub number: u32,
}

impl<'a> Round<'a> {
    /// Of a plan that has maps.
    pub(crate) fn photons(self) -> &'a PhotonBuffers {
        self.resources.photons.as_ref().expect("maps have photons")
    }
}

/// What light is asked of.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Receivers<'a> {
    /// A camera's picture, so many pixels wide and high: radiance, W/m2/sr.
    Image(&'a Camera, [u32; 2]),
    /// Points with the normals of their surfaces, in metres: irradiance, W/m2.
    Points(&'a [(DVec3, DVec3)]),
}

impl<'a> Receivers<'a> {
    pub(crate) fn sensor(self) -> Sensor {
        match self {
            Receivers::Image(_, [width, height]) => Sensor::Picture { width, height },
            Receivers::Points(points) => Sensor::Receivers { count: points.len() as u32 },
        }
    }

    #[cfg(test)]
    pub(crate) fn camera(self) -> Option<&'a Camera> {
        match self {
            Receivers::Image(camera, _) => Some(camera),
            Receivers::Points(_) => None,
        }
    }

    /// Its points, the same in all rounds; none for a picture.
    pub(crate) fn phases(self, geometry: &Geometry) -> Vec<Vec<Receiver>> {
        match self {
            Receivers::Image(..) => Vec::new(),
            Receivers::Points(points) => vec![points.iter().map(|point| receiver(geometry, *point)).collect()],
        }
    }
}

/// A point and the normal of its surface.
pub(crate) fn receiver(geometry: &Geometry, (position, normal): (DVec3, DVec3)) -> Receiver {
    let normal = normal.as_vec3();
    Receiver { position: geometry.to_local(position), normal, shading_normal: normal }
}
