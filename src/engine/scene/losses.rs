//! Light that limits keep from the result: photons cut off after their last bounce, flux beyond what a shading normal may
//! change, values beyond what the film holds, camera paths cut off among mirrors. Every watt of it is counted, and bounds a bias.

use glam::DVec3;

use super::SceneFilm;
use crate::constants::{ARRIVED_DIRECT, PART_COUNT, TOTAL_FLUX_BITS};
use crate::ledger::{Fates, FluxUnits, Losses};
use crate::plan::scene::ScenePlan;
use crate::scene::geometry::Geometry;

/// Where none of many was seen, the mean is at most so many with 95 % confidence (the rule of three).
const UNSEEN: f64 = 3.0;

fn share_of(missed: f64, light: f64) -> f64 {
    missed / (light + missed).max(f64::MIN_POSITIVE)
}

/// Of a run so far, from what its kernels counted.
pub(crate) fn losses(geometry: &Geometry, plan: &ScenePlan, fates: &[Fates], film: &SceneFilm) -> Losses {
    let SceneFilm { anomalies, part_totals, .. } = film;
    let area_unit = geometry.unit * geometry.unit;
    let emitted = geometry.power * area_unit;
    let mut losses = Losses { emitted, clamped_values: anomalies[1], camera_paths: anomalies[3], ..Losses::default() };
    let all: f64 = part_totals.iter().map(|total| *total as f64).sum();
    for map in plan.maps() {
        let of_map = &fates[usize::from(map.caustic_only)];
        let Some(totals) = of_map.totals.filter(|_| of_map.emitted > 0) else { continue };
        // Sums over all photons traced, each of which stands for that share of a round.
        let watts = |flux: FluxUnits| {
            let unit = geometry.flux_unit * map.flux_scale / (of_map.emitted as f64 * map.flux_gain) * area_unit;
            flux.iter().map(|units| *units as f64).sum::<f64>() / f64::from(1u32 << TOTAL_FLUX_BITS) * unit
        };
        let (cut_off, clamped) = (watts(totals.cut_flux), watts(totals.clamped_flux));
        losses.cut_off += cut_off;
        losses.clamped += clamped;
        let missed = (cut_off + clamped) * if map.caustic_only { 1.0 } else { of_map.further_landings() };
        if missed == 0.0 {
            continue;
        }
        let per_photon = emitted / map.flux_gain / of_map.emitted as f64;
        if totals.stored == 0 && cut_off == 0.0 {
            // No photon that was clamped has reached a place where the map keeps it, so that at most a small share of what is missed would have.
            let first = of_map.bounces[0];
            let light = per_photon * (first.stored + first.absorbed) as f64;
            losses.relative += Losses::SAFETY * share_of(missed * (UNSEEN / totals.clamped.max(1) as f64).min(1.0), light);
            continue;
        }
        // Landings so far that the map holds: what is missed belongs to the same part of the result.
        let landed = per_photon * totals.stored as f64;
        let share = share_of(missed, landed);
        let part = if map.stored & ARRIVED_DIRECT != 0 {
            all
        } else {
            part_totals[if map.caustic_only { 2 } else { PART_COUNT as usize - 1 }] as f64 + part_totals[1] as f64
        };
        // Of a part that is missed altogether nothing is known but its watts.
        let of_part = if share < 1.0 && all > 0.0 { part / (1.0 - share) / (all + part * share / (1.0 - share)) } else { 1.0 };
        losses.relative += Losses::SAFETY * share * of_part;
    }
    let paths = f64::from(plan.paths()) * f64::from(film.rounds.max(1));
    // Of what surfaces scatter, over all pixels.
    let mean = film.surface_means().map(DVec3::element_sum).sum::<f64>() / (3 * film.pixels()).max(1) as f64;
    if mean > 0.0 {
        let wide = |word: usize| (u64::from(anomalies[word]) | u64::from(anomalies[word + 1]) << 32) as f64;
        losses.relative += wide(6) / 1_048_576.0 / paths * geometry.brightest() / mean;
        losses.relative += wide(4) / 1024.0 * plan.film.limit / plan.film.scale / paths / mean;
    }
    losses
}
