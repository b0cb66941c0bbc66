//! How a picture divides its work between paths, shadow rays, photons and the radius, so that its error falls fastest.
//!
//! After n rounds of S paths per pixel with R shadow rays each, the squared error relative to the light is taken for
//!
//! ```text
//! noise of paths   (path + shadow ray / R^p) / (S^p n)
//! noise of maps    of a round / (photons in the disc x S^p of the map) x the mean of 1 / r^2 of the rounds / n
//! bias             (of a map's light x its share x the mean of r^2 to a power)^2
//! unseen           (of a path / (samples of those that have fewest x n))^2, and (of a photon / (photons x r^2 x n))^2 where none has arrived
//! ```
//!
//! with what is not known of the bias, which falls with the noise of the maps. Radii shrink as Knaus and Zwicker (2011) have them. Variances
//! are a pilot's ([`crate::engine::scene::pilot`]), costs those of a class of devices ([`super::work_cost`]).

mod rounds;
mod search;
mod variance;

use serde::{Deserialize, Serialize};

pub(crate) use rounds::Rounds;
pub(crate) use search::{MOST_PHOTONS, MOST_SAMPLES, best};
pub(crate) use variance::{FOUND_BIAS, MapVariance, USUAL_BIAS, USUAL_UNCERTAINTY, Variance, of_samples};

use super::radius::over_usual;
use crate::settings::scene::SceneSettings;

/// What each round does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Division {
    /// Paths through a pixel, and shadow rays from each visible point.
    pub samples: u32,
    pub shadow_rays: u32,
    /// Of the global and of the caustic map.
    pub photons: u32,
    pub caustic_photons: u32,
    /// Photons of a round within the first radius of each.
    pub neighbours: u32,
    pub caustic_neighbours: u32,
}

impl Division {
    pub(crate) fn of(settings: &SceneSettings) -> Division {
        let &SceneSettings { samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours, .. } = settings;
        Division { samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours }
    }

    pub(crate) fn set(self, settings: &SceneSettings) -> SceneSettings {
        let Division { samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours } = self;
        SceneSettings { samples, shadow_rays, photons, caustic_photons, neighbours, caustic_neighbours, ..settings.clone() }
    }

    pub(crate) fn global(self) -> PhotonsOfMap {
        PhotonsOfMap { photons: self.photons, neighbours: over_usual(self.neighbours, false) }
    }

    pub(crate) fn caustic(self) -> PhotonsOfMap {
        PhotonsOfMap { photons: self.caustic_photons, neighbours: over_usual(self.caustic_neighbours, true) }
    }
}

/// Photons of a round, and those of them within the first radius over the usual ones.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct PhotonsOfMap {
    pub photons: u32,
    pub neighbours: f64,
}

impl PhotonsOfMap {
    /// The square of the radius over the usual one.
    pub(crate) fn over_usual(self) -> f64 {
        self.neighbours * USUAL_PHOTONS / f64::from(self.photons)
    }
}

/// Photons of the usual radius, with the usual neighbours.
const USUAL_PHOTONS: f64 = 131_072.0;

/// What is to be chosen, as nobody has set it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct TunableSettings {
    pub samples: bool,
    pub shadow_rays: bool,
    pub photons: bool,
    pub caustic_photons: bool,
    pub neighbours: bool,
    pub caustic_neighbours: bool,
}

impl TunableSettings {
    #[cfg(test)]
    pub(crate) const ALL: TunableSettings = TunableSettings {
        samples: true,
        shadow_rays: true,
        photons: true,
        caustic_photons: true,
        neighbours: true,
        caustic_neighbours: true,
    };
}
