//! The radius of a density estimate: of the first round, from what is known before a photon is traced, and how it shrinks from
//! round to round.

use std::f64::consts::PI;
use std::sync::Arc;

use serde::Serialize;
use statrs::function::gamma::ln_gamma;

use super::light_choice::LightChoice;
use crate::constants::{LEAST_RADIUS_BITS, LOOP_LIMIT, RADIUS_CLASSES};
use crate::error::{Result, require};
use crate::photon::MapPhoton;
use crate::records::CausticTarget;
use crate::rng::mix32;
use crate::scene::geometry::Geometry;
use crate::settings::scene::{CAUSTIC_NEIGHBOURS, NEIGHBOURS};

/// Where the radius of a map's first round comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum RadiusFrom {
    /// `--radius`, `--caustic-radius`.
    User,
    /// Photons of a trial round around the points that are asked about (`engine::scene::trial`).
    Trial,
    /// The area of the whole scene.
    Area,
}

/// What a trial round found.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Trial {
    /// Radii of the first round at the median point, normalised; `None` where the map has none, or its radius is given.
    pub global_radius: Option<f64>,
    pub caustic_radius: Option<f64>,
    /// Of the global and of the caustic map, how these follow from photons.
    #[serde(skip)]
    pub reach: [TrialRadius; 2],
    /// Its photons, of the global and of the caustic map: their density around a point gives the radius there.
    #[serde(skip)]
    pub photons: [TrialPhotons; 2],
    /// How shadow rays choose lights; `None` where they choose one lamp, or none.
    #[serde(skip)]
    pub lights: Option<Arc<LightChoice>>,
    /// Where light from beyond the scene comes in.
    #[serde(skip)]
    pub openings: Vec<CausticTarget>,
    /// What the run multiplies all radii by.
    #[serde(skip)]
    pub factor: Option<f64>,
    /// Points that were asked, some of those that the run asks about.
    pub points: u32,
    /// Share of them that lie in something smaller than the radius: whose way along the surface to the next wall or edge
    /// is shorter. Of the map with the larger radius.
    pub too_wide: f64,
    pub seconds: f64,
}

/// The radius that leaves the wanted photons at the median point, and the widest that reaches round few corners, normalised.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct TrialRadius {
    pub wanted: f64,
    pub widest: f64,
}

impl TrialRadius {
    pub(crate) fn radius(self) -> f64 {
        self.wanted.min(self.widest).clamp(RADIUS_RANGE.0, MAX_DEFAULT_RADIUS)
    }

    /// The same of a round whose photons lie so many times as far apart.
    pub(crate) fn scaled(self, times: f64) -> TrialRadius {
        TrialRadius { wanted: self.wanted * times, ..self }
    }
}

impl Trial {
    /// The same for a run whose photons of each map lie so many times as far apart, and whose radii are not given.
    pub(crate) fn scaled(&self, times: [f64; 2]) -> Trial {
        let reach = [self.reach[0].scaled(times[0]), self.reach[1].scaled(times[1])];
        let radius = |of_run: Option<f64>, map: usize| of_run.map(|_| reach[map].radius());
        Trial { global_radius: radius(self.global_radius, 0), caustic_radius: radius(self.caustic_radius, 1), reach, ..self.clone() }
    }
}

/// Photons of a trial, no more than a loop of a kernel may take.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct TrialPhotons {
    pub kept: Arc<Vec<MapPhoton>>,
    /// How many of all were kept.
    pub share: f64,
}

impl TrialPhotons {
    /// Those whose positions have the least hashes: the same ones whatever order they come in.
    pub(crate) fn some_of(mut photons: Vec<MapPhoton>) -> TrialPhotons {
        let all = photons.len();
        let hash = |photon: &MapPhoton| {
            let [x, y, z] = photon.position.to_array().map(f32::to_bits);
            (mix32(x.wrapping_add(mix32(y.wrapping_add(mix32(z.wrapping_add(photon.plane)))))), x, y, z)
        };
        photons.sort_unstable_by_key(hash);
        photons.truncate(LOOP_LIMIT as usize);
        TrialPhotons { share: photons.len() as f64 / all.max(1) as f64, kept: Arc::new(photons) }
    }
}

/// Radii relative to the scene's normalised extent: from f32's resolution of positions up to all of it.
pub(crate) const RADIUS_RANGE: (f64, f64) = (1.0 / (1 << LEAST_RADIUS_BITS) as f64, 2.0);
/// How often the median point's radius may double where photons are rare, as long as it does not exceed that by the scene's area.
const MOST_DOUBLINGS: u32 = 3;
/// Largest radius that is taken by default, relative to the scene's normalised extent.
pub(crate) const MAX_DEFAULT_RADIUS: f64 = 0.125;
/// Photons within the first radius of the global map that goes by the area, on average, with so many neighbours.
const PHOTONS_PER_ESTIMATE: f64 = 60.0;
/// A caustic's photons lie closer: its radius over that of as many photons spread over everything.
const CAUSTIC_RADIUS_SHARE: f64 = 0.25;

/// The first round's radius of a map.
#[derive(Debug, Clone, Copy)]
pub(super) struct FirstRadius {
    /// Normalised.
    pub(super) radius: f64,
    pub(super) from: RadiusFrom,
    /// Photons of a round that it holds, on average.
    pub(super) expected: f64,
    pub(super) classes: Option<Classes>,
}

/// Radii that differ from point to point: each class has half the radius of the one before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(crate) struct Classes {
    pub count: u32,
    /// That of the median point.
    pub usual: u32,
}

impl Classes {
    /// From up to 8 times `radius` to the least that is allowed.
    fn around(radius: f64, by_area: f64) -> Classes {
        let usual = (by_area / radius).log2().floor().clamp(0.0, f64::from(MOST_DOUBLINGS)) as u32;
        let smaller = (radius / RADIUS_RANGE.0).log2().floor().max(0.0) as u32;
        Classes { count: (usual + 1 + smaller).min(RADIUS_CLASSES), usual }
    }

    /// How much larger the radius of class 0 is than the usual one.
    pub(crate) fn widest(self) -> f64 {
        f64::from(1 << self.usual)
    }
}

impl FirstRadius {
    /// What `option` asks for in metres, or a trial round found, or the scene's area gives.
    pub(super) fn new(
        geometry: &Geometry,
        (photons, neighbours): (u32, u32),
        caustic_only: bool,
        (option, asked): (&'static str, Option<f64>),
        trial: Option<&Trial>,
    ) -> Result<FirstRadius> {
        let tried = trial.and_then(|trial| if caustic_only { trial.caustic_radius } else { trial.global_radius });
        let by_area = |radius: f64| {
            let usual = usual_radius(geometry, f64::from(photons)) * share(caustic_only);
            PHOTONS_PER_ESTIMATE * (radius / usual).powi(2)
        };
        let Some(metres) = asked else {
            let of_area = area_radius(geometry, photons, neighbours, caustic_only);
            let expected = PHOTONS_PER_ESTIMATE * over_usual(neighbours, caustic_only);
            return Ok(match tried {
                Some(tried) => {
                    let radius = tried * trial.and_then(|trial| trial.factor).unwrap_or(1.0);
                    let classes = Some(Classes::around(tried, of_area));
                    FirstRadius { radius, from: RadiusFrom::Trial, expected, classes }
                }
                None => FirstRadius { radius: of_area, from: RadiusFrom::Area, expected: by_area(of_area), classes: None },
            });
        };
        let (least, most) = (RADIUS_RANGE.0 * geometry.unit, RADIUS_RANGE.1 * geometry.unit);
        require((least..=most).contains(&metres), option, metres, format!("must be from {least:e} to {most} metres in this scene"))?;
        let radius = metres / geometry.unit;
        Ok(FirstRadius { radius, from: RadiusFrom::User, expected: by_area(radius), classes: None })
    }
}

fn share(caustic_only: bool) -> f64 {
    if caustic_only { CAUSTIC_RADIUS_SHARE } else { 1.0 }
}

/// Neighbours over the usual ones.
pub(crate) fn over_usual(neighbours: u32, caustic_only: bool) -> f64 {
    f64::from(neighbours) / f64::from(if caustic_only { CAUSTIC_NEIGHBOURS } else { NEIGHBOURS })
}

/// Radius, normalised, in which so many photons from lamps leave `PHOTONS_PER_ESTIMATE` on average: each lands about twice.
pub(crate) fn usual_radius(geometry: &Geometry, photons: f64) -> f64 {
    (PHOTONS_PER_ESTIMATE * geometry.area / (PI * 2.0 * photons)).sqrt()
}

/// Radius of a map's first round, normalised, where nothing but the scene's area is known.
pub(crate) fn area_radius(geometry: &Geometry, photons: u32, neighbours: u32, caustic_only: bool) -> f64 {
    (usual_radius(geometry, f64::from(photons) / over_usual(neighbours, caustic_only)) * share(caustic_only))
        .clamp(RADIUS_RANGE.0, MAX_DEFAULT_RADIUS)
}

/// Rounds of which the radius is multiplied out.
const EXACT_ROUNDS: u32 = 32;

/// The squared radius of a round, relative to the first one's: r_(i+1)^2 = r_i^2 (i + alpha) / (i + 1) with i from 1 (Knaus and
/// Zwicker 2011, equation 15), whose product is Gamma(n + 1 + alpha) / (Gamma(1 + alpha) (n + 1)!).
pub(crate) fn squared_radius(alpha: f64, round: u32) -> f64 {
    if alpha == 1.0 || round == 0 {
        return 1.0;
    }
    let n = f64::from(round);
    // Exact where the digits of the logarithms would show, and short.
    if round <= EXACT_ROUNDS {
        return (1..=round).map(|i| (f64::from(i) + alpha) / (f64::from(i) + 1.0)).product();
    }
    (ln_gamma(n + 1.0 + alpha) - ln_gamma(1.0 + alpha) - ln_gamma(n + 2.0)).exp()
}

/// The radius of a round, where the first one's is `first`, normalised; never below what positions resolve.
pub(crate) fn of_round(first: f64, alpha: f64, round: u32) -> f64 {
    (first * squared_radius(alpha, round).sqrt()).max(RADIUS_RANGE.0)
}

/// Mean over rounds of the squared radius, relative to the first one's: r_(i+1)^2 = r_i^2 (i + alpha) / (i + 1)
/// (Knaus and Zwicker 2011).
pub(crate) fn mean_squared_radius(alpha: f64, rounds: u32) -> f64 {
    if alpha == 1.0 || rounds <= 1 {
        return 1.0;
    }
    // Terms Gamma(k + alpha) / Gamma(k + 1), k from 1, have the sum (Gamma(n + 1 + alpha) / n! - Gamma(1 + alpha)) / alpha.
    let rounds = rounds.max(1);
    let next = squared_radius(alpha, rounds) * (f64::from(rounds) + 1.0);
    (next - 1.0) / (alpha * f64::from(rounds))
}
