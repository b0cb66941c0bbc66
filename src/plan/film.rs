//! What a film is read by: its unit, and how it was made as far as its errors ask.

use serde::{Deserialize, Serialize};

use crate::settings::stop::{CONFIDENCES, Measure};

/// What gives the bias of a scene's radii.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum BiasPlan {
    /// There is none, as no light comes from a photon map.
    NoMap,
    /// Nothing: radii are as small as they may be, and still wider than what many points lie in.
    Nothing,
    /// The blocks of the run, which are also estimated within a smaller radius.
    Blocks,
    /// Extra runs, where they are asked for: relMSE weighs pixels by what they turn out to hold, which sums over pixels cannot.
    ExtraRuns,
}

/// Light that points which lie on no surface cannot get, as no photon is counted there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum LostOffSurfaces {
    /// There is none.
    Nothing,
    /// What lamps send over mirrors and glass.
    Caustics,
    /// All light of lamps but that of emissive meshes, as photons alone bring light.
    Lamps,
}

/// Of a scene's film, which holds it, so that a film can be read without the scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct FilmPlan {
    /// Film units in 1 W/m2/sr or W/m2, a power of two, and the most units that one round may add to a pixel.
    pub scale: f64,
    pub limit: f64,
    /// What each arrival at a visible point may add, so that all of a pixel's stay below the limit together.
    pub point_limit: f64,
    pub rounds_per_block: u32,
    /// Paths from the camera through a pixel, or from a receiver, in a round.
    pub samples: u32,
    /// How often at most a pixel's light is rounded to the film's unit in a round: each part of a path's direct light, and each
    /// map's at each visible point.
    pub roundings_per_round: f64,
    /// Whether camera rays may hit emitters (pictures only).
    pub sees_light: bool,
    /// Radiance of the brightest that a camera path may meet over mirrors and glass, W/m2/sr, all channels together; 0 where none
    /// can. Such hits are rare and bright: they are the tail of the noise.
    pub rare_radiance: f64,
    /// How fast radii shrink, and the widest ones of the global and of the caustic map in the first round, normalised; 0 where
    /// there is no such map.
    pub alpha: f64,
    pub widest_radii: [f64; 2],
    /// With which errors are stated, and what the relative one is of.
    pub confidence: f64,
    pub measure: Measure,
    pub bias: BiasPlan,
    pub lost_off_surfaces: LostOffSurfaces,
}

impl FilmPlan {
    /// Whether it is what a file may hold: numbers that a plan may have.
    pub(crate) fn is_sound(&self) -> bool {
        let FilmPlan { scale, limit, point_limit, rounds_per_block, samples, roundings_per_round, rare_radiance, .. } = *self;
        let is_positive = |value: f64| value.is_finite() && value > 0.0;
        [scale, limit, point_limit].into_iter().all(is_positive)
            && rounds_per_block.is_power_of_two()
            && samples.is_power_of_two()
            && [roundings_per_round, rare_radiance].into_iter().chain(self.widest_radii).all(|value| value.is_finite() && value >= 0.0)
            && self.alpha > 0.0
            && self.alpha <= 1.0
            && CONFIDENCES.contains(&self.confidence)
    }
}
