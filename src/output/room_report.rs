//! The report of a run of the paper's box: settings, ledger, errors and timing table as text, and everything as JSON.

use std::fmt::Write;

use serde::Serialize;

use super::report::{Common, common, ended, ending, ledger, losses};
use super::words::lower_case;
use crate::engine::error::bound::FilmError;
use crate::engine::room::RunResult;
use crate::engine::room::film::{WallEstimate, irradiance_weights};
use crate::gpu::DeviceFacts;
use crate::ledger::{BounceFates, Ledger};
use crate::plan::Decision;
use crate::scene::room::RoomScene;
use crate::settings::RoomSettings;
use crate::text::counted;

/// The JSON report.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    common: Common<'a, RoomSettings>,
    device_facts: Option<&'a DeviceFacts>,
    seed: u64,
    plan: PlanReport<'a>,
    /// The run was ended before its last photon; all numbers are of the photons emitted.
    cancelled: bool,
    ledger: Ledger,
    /// Fates of the paths that entered each bounce.
    bounces: &'a [BounceFates],
    walls: Vec<WallReport>,
}

#[derive(Serialize)]
struct PlanReport<'a> {
    decisions: &'a [Decision],
    light_photons: &'a [u32],
    /// Counters that the atomic builder's work groups use round-robin.
    counters: u32,
    chunks_per_round: u32,
    photon_map_entries: u32,
    photon_map_bytes: u64,
    /// Of all buffers on the device.
    bytes: u64,
    grid: Option<crate::plan::Grid>,
    film_channels: u32,
    film_fixed_point_bits: u32,
}

/// Means over a wall's texels.
#[derive(Serialize)]
struct WallReport {
    name: &'static str,
    illumination: f64,
    irradiance: f64,
    radiosity: f64,
}

/// The run as JSON.
pub(crate) fn json(result: &RunResult, walls: &[WallEstimate], error: &FilmError) -> Vec<u8> {
    let plan = &result.plan;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let driver = host_driver(result);
    let report = Report {
        common: common(result, &plan.settings, error, plan.settings.stop.confidence, &driver),
        device_facts: result.device.as_ref(),
        seed: plan.settings.seed,
        plan: PlanReport {
            decisions: &plan.decisions,
            light_photons: &plan.light_photons,
            counters: plan.counters,
            chunks_per_round: plan.chunks_per_round,
            photon_map_entries: plan.photon_capacity,
            photon_map_bytes: plan.photon_map_bytes(),
            bytes: plan.bytes(),
            grid: plan.gathers_by_grid().then_some(plan.grid),
            film_channels: plan.channel_count,
            film_fixed_point_bits: plan.film_shift,
        },
        cancelled: result.is_cancelled(),
        ledger: result.ledger(),
        bounces: &result.fates[0].bounces,
        walls: walls
            .iter()
            .map(|wall| WallReport {
                name: wall.name,
                illumination: mean(&wall.illumination),
                irradiance: mean(&wall.irradiance),
                radiosity: mean(&wall.radiosity),
            })
            .collect(),
    };
    serde_json::to_vec_pretty(&report).expect("a report is plain data")
}

/// What takes the place of a driver where the CPU runs alone.
fn host_driver(result: &RunResult) -> String {
    format!("photonmill on {}", counted(result.plan.settings.threads, "thread"))
}

/// What the film says of its error. Of a box without light nothing is known.
pub(crate) fn error(result: &RunResult, scene: &RoomScene) -> FilmError {
    let RunResult { plan, film, .. } = result;
    // W of a photon of relative flux 1.
    let watts = plan.flux_unit / film.emitted.max(1) as f64;
    let error = film.error(&irradiance_weights(scene, plan), watts, &plan.settings.stop);
    let is_lit = (0..film.point_count()).any(|point| !film.is_unreached(point));
    FilmError { noise: if is_lit { error.noise } else { f64::INFINITY }, bias: result.bias, ..error }.stated()
}

/// The run in words: device, settings, ledger, errors and timing table.
pub(crate) fn text(result: &RunResult, error: &FilmError) -> String {
    let settings = &result.plan.settings;
    let mut text = result.device.as_ref().map_or_else(|| format!("CPU, {}", host_driver(result)), DeviceFacts::label) + "\n";
    result.more_devices.iter().for_each(|facts| writeln!(text, "{}", facts.label()).unwrap());
    text += &format!(
        "open-box, {}: {} of {} photons, {}, radius {} m, {} gather{}, {} sums, {} seed {}\n",
        settings.builder.name(),
        counted(result.film.rounds.max(1), "round"),
        settings.photons,
        counted(settings.bounces, "bounce"),
        settings.radius,
        lower_case(settings.gather),
        settings.nearest.map_or_else(String::new, |nearest| format!(" of the {nearest} nearest")),
        lower_case(settings.sums),
        lower_case(settings.rng),
        settings.seed
    );
    text += &ended(result.end, &settings.stop, result.film.rounds, settings.rounds);
    for decision in &result.plan.decisions {
        let verb = if decision.kept { "with" } else { "without" };
        writeln!(text, "  {verb} {}: {}", decision.effect, decision.reason).unwrap();
    }
    text.push('\n');
    text.push_str(&ledger(&result.ledger()));
    text.push_str(&losses(&result.losses, settings.bounces));
    text.push_str(&ending(result, error, &settings.stop, ("texel", "W/m2")));
    text
}
