//! How a picture divides its work between samples, shadow rays and photons, so that its error falls fastest.
//!
//! The light of a round has a variance of (per path + per shadow ray / shadow rays) / samples + of maps, and a round costs a fixed part +
//! samples (per path + shadow rays x per ray). Rounds are independent, so that after the same work the squared error of one division over
//! that of another is the ratio of the products of the two (Glynn and Whitt 1992: efficiency is one over variance times cost).
//!
//! Costs are those of a class of devices and no run's own times, so that the same seed chooses the same on each device of its class.

use crate::plan::scene::ScenePlan;

/// How many paths go through a pixel in each round, and how many shadow rays leave each visible point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Division {
    pub samples: u32,
    pub shadow_rays: u32,
}

/// A quantity of a round, by what it grows or falls with.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Terms {
    /// Of the round, whatever its samples.
    pub fixed: f64,
    /// Of a path through each pixel, and of a shadow ray of each path.
    pub path: f64,
    pub shadow_ray: f64,
}

impl Terms {
    /// Of a round of so many samples and shadow rays, each of which costs.
    pub fn cost(&self, division: Division) -> f64 {
        self.fixed + f64::from(division.samples) * (self.path + f64::from(division.shadow_rays) * self.shadow_ray)
    }

    /// The same of a variance, which they share.
    pub fn variance(&self, division: Division) -> f64 {
        self.fixed + (self.path + self.shadow_ray / f64::from(division.shadow_rays)) / f64::from(division.samples)
    }

    /// A variance from what rounds of one sample had with 1 shadow ray and with `many`.
    pub fn of_variances(with_one: f64, with_many: f64, many: u32) -> Terms {
        let shadow_ray = ((with_one - with_many) / (1.0 - 1.0 / f64::from(many))).clamp(0.0, with_one);
        Terms { fixed: 0.0, path: with_one - shadow_ray, shadow_ray }
    }
}

/// What work costs on a class of devices, nanoseconds: of scenes of some ten thousand triangles.
struct Costs {
    /// A path from the camera to what it sees, with its lookups in the maps.
    path: f64,
    shadow_ray: f64,
    /// A photon from its lamp to its end, sorted into its map.
    photon: f64,
    /// What a round and each of its maps take in any case.
    round: f64,
    map: f64,
}

/// Of a GPU measured in `cornell-spheres`, 512 x 512, 1 to 16 samples and shadow rays, on an NVIDIA H100; of a CPU only the photons, on lavapipe
/// with two cores (November 2026). The rest is estimated.
fn costs(kind: &str) -> Costs {
    match kind {
        "cpu" => Costs { path: 2000.0, shadow_ray: 700.0, photon: 2200.0, round: 1e6, map: 2e6 },
        "discrete" => Costs { path: 2.4, shadow_ray: 0.15, photon: 5.0, round: 5e5, map: 8e5 },
        _ => Costs { path: 60.0, shadow_ray: 12.0, photon: 60.0, round: 3e5, map: 6e5 },
    }
}

/// Nanoseconds of a round, of the plan's pixels and photons, on a class of devices.
pub fn cost(plan: &ScenePlan, kind: &str) -> Terms {
    let Costs { path, shadow_ray, photon, round, map } = costs(kind);
    let pixels = f64::from(plan.sensor.pixels());
    let maps: f64 = plan.maps().map(|of| map + photon * f64::from(of.photons)).sum();
    let rays = if plan.shadow_rays() == 0 { 0.0 } else { shadow_ray };
    Terms { fixed: round + maps, path: pixels * path, shadow_ray: pixels * rays }
}

/// More shadow rays of one path tell little that other paths do not.
const MOST_SHADOW_RAYS: u32 = 16;
const MOST_SAMPLES: u32 = 256;

/// The division whose error falls fastest, among those that are `allowed`; the least one of those that do.
pub fn best(variance: &Terms, cost: &Terms, allowed: impl Fn(Division) -> bool) -> Option<Division> {
    let powers = |most: u32| (0..).map(|k| 1u32 << k).take_while(move |power| *power <= most);
    let all = powers(MOST_SAMPLES).flat_map(|samples| powers(MOST_SHADOW_RAYS).map(move |shadow_rays| Division { samples, shadow_rays }));
    let product = |division: &Division| variance.variance(*division) * cost.cost(*division);
    all.filter(|division| allowed(*division)).min_by(|a, b| product(a).total_cmp(&product(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variances_are_told_apart_by_the_shadow_rays() {
        let found = Terms::of_variances(5.0, 2.0, 4);
        assert_eq!(found, Terms { fixed: 0.0, path: 1.0, shadow_ray: 4.0 });
        let once = Division { samples: 1, shadow_rays: 1 };
        assert_eq!((found.variance(once), found.variance(Division { samples: 2, shadow_rays: 4 })), (5.0, 1.0));
        // Chance may turn them round: then all of it is the paths'.
        assert_eq!(Terms::of_variances(2.0, 5.0, 4), Terms { fixed: 0.0, path: 2.0, shadow_ray: 0.0 });
    }

    /// As many samples as make what a round costs in any case and the samples alike, and as many shadow rays as one path's do.
    #[test]
    fn the_best_division_balances_costs() {
        let all = |_: Division| true;
        let cost = Terms { fixed: 64.0, path: 1.0, shadow_ray: 0.0 };
        let of_paths = Terms { fixed: 1.0, path: 64.0, shadow_ray: 0.0 };
        assert_eq!(best(&of_paths, &cost, all), Some(Division { samples: 64, shadow_rays: 1 }));
        // sqrt(16 / 1 x 1 / 1) shadow rays.
        let cost = Terms { fixed: 0.0, path: 1.0, shadow_ray: 1.0 };
        let of_rays = Terms { fixed: 0.0, path: 1.0, shadow_ray: 16.0 };
        assert_eq!(best(&of_rays, &cost, all), Some(Division { samples: 1, shadow_rays: 4 }));
        assert_eq!(best(&of_paths, &cost, |division| division.samples == 3), None);
    }
}
