//! The report of a run: timing table, ledger and errors as text, and everything as JSON.

use std::fmt::Write;

use serde::Serialize;

use crate::constants::MAX_BOUNCES;
use crate::engine::bias::Bias;
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::engine::room::RunResult;
use crate::engine::room::film::WallEstimate;
use crate::engine::unknown::Unknown;
use crate::engine::watch::{End, error_bound};
use crate::gpu::DeviceFacts;
use crate::ledger::{BounceFates, Ledger, Losses};
use crate::plan::Decision;
use crate::settings::RoomSettings;
use crate::settings::stop::Stop;
use crate::text::counted;
use crate::timings::{Row, Timings};

/// The JSON report.
#[derive(Serialize)]
struct Report<'a> {
    photonmill: &'static str,
    /// Device name; `cpu` for the CPU builder.
    device: &'a str,
    driver: String,
    device_facts: Option<&'a DeviceFacts>,
    seed: u64,
    settings: &'a RoomSettings,
    plan: PlanReport<'a>,
    /// The run was ended before its last photon; all numbers are of the photons emitted.
    cancelled: bool,
    /// Why it ended, and rounds that are whole.
    end: End,
    rounds: u32,
    /// Root mean square over all texels of the standard error of irradiance, over that of irradiance; null where fewer
    /// than two rounds leave it unknown.
    relative_error: Option<f64>,
    /// What it is not above, with the confidence of the settings.
    error_bound: Option<f64>,
    /// What nothing has reached.
    unknown: &'a Unknown,
    /// Of the radius, relative to the irradiance; null without `--bias`.
    bias: Option<Bias>,
    ledger: Ledger,
    /// Light that the cap on bounces kept from the result.
    losses: Losses,
    /// Fates of the paths that entered each bounce.
    bounces: &'a [BounceFates],
    timings: &'a [Row],
    dispatches: u64,
    submissions: u64,
    walls: Vec<WallReport>,
    /// Nonfinite values that `--paranoid` found; null without it.
    nonfinite_values: Option<&'a NonfiniteValues>,
}

#[derive(Serialize)]
struct PlanReport<'a> {
    decisions: &'a [Decision],
    light_photons: &'a [u32],
    /// That the atomic builder's work groups take turns at.
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
pub fn json(outcome: &RunResult, walls: &[WallEstimate], unknown: &Unknown) -> Vec<u8> {
    let plan = &outcome.plan;
    let noise = relative_error(walls);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let report = Report {
        photonmill: env!("CARGO_PKG_VERSION"),
        device: outcome.device.as_ref().map_or("cpu", |facts| &facts.name),
        driver: driver(outcome),
        device_facts: outcome.device.as_ref(),
        seed: plan.settings.seed,
        settings: &plan.settings,
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
        cancelled: outcome.cancelled,
        end: outcome.end,
        rounds: outcome.film.rounds,
        relative_error: noise,
        error_bound: noise
            .map(|noise| error_bound(outcome.film.rounds, noise, plan.settings.stop.confidence).hypot(unknown.relative))
            .filter(|bound| bound.is_finite()),
        unknown,
        bias: outcome.bias,
        ledger: outcome.fates.ledger(),
        losses: outcome.losses,
        bounces: &outcome.fates.bounces,
        timings: outcome.timings.rows(),
        dispatches: outcome.dispatches,
        submissions: outcome.submissions,
        walls: walls
            .iter()
            .map(|wall| WallReport {
                name: wall.name,
                illumination: mean(&wall.illumination),
                irradiance: mean(&wall.irradiance),
                radiosity: mean(&wall.radiosity),
            })
            .collect(),
        nonfinite_values: outcome.nonfinite_values.as_ref(),
    };
    serde_json::to_vec_pretty(&report).expect("a report is plain data")
}

fn driver(outcome: &RunResult) -> String {
    match &outcome.device {
        Some(facts) => facts.driver.clone(),
        None => format!("photonmill on {}", counted(outcome.plan.settings.threads, "thread")),
    }
}

/// Root mean square over all texels of the standard error of irradiance, over that of irradiance.
fn relative_error(walls: &[WallEstimate]) -> Option<f64> {
    // A wall that reflects nothing stores nothing, and its irradiance is no number.
    // Where no photon was found the error is not known, and stands apart.
    let texels = || walls.iter().flat_map(|wall| wall.irradiance.iter().zip(&wall.irradiance_error)).filter(|(mean, _)| !mean.is_nan());
    let means: f64 = texels().map(|(mean, _)| mean * mean).sum();
    let errors: f64 = texels().filter(|(mean, _)| **mean > 0.0).map(|(_, error)| error * error).sum();
    if means > 0.0 { Some((errors / means).sqrt()).filter(|error| error.is_finite()) } else { None }
}

/// Noise, bias, and both together, a line each, in per cent of the result's RMS. What nothing has reached counts in the bounds,
/// and so does light that limits kept.
pub(super) fn errors(rounds: u32, noise: Option<f64>, unknown: &Unknown, bias: Option<&Bias>, lost: f64, confidence: f64) -> String {
    let mut text = String::new();
    let (percent, sure) = (|share: f64| 100.0 * share, 100.0 * confidence);
    let noise = noise.filter(|_| unknown.relative.is_finite());
    let bound = noise.map(|noise| error_bound(rounds, noise, confidence).hypot(unknown.relative));
    match noise.zip(bound) {
        Some((noise, bound)) => {
            writeln!(text, "noise: {:.2} % relative RMS error, at most {:.2} % ({sure} % confidence)", percent(noise), percent(bound))
                .unwrap();
        }
        None if rounds == 1 => text.push_str("noise: unknown after a single round\n"),
        None => text.push_str("noise: unknown\n"),
    }
    if bias.is_some_and(|bias| !bias.is_known()) {
        writeln!(text, "bias of the radius: unknown, because {}", Bias::UNKNOWN).unwrap();
        return text;
    }
    if bias.is_some_and(|bias| bias.batches == 0) {
        text.push_str("bias of the radius: none, because no light comes from a photon map\n");
    } else if let Some(Bias { relative, lower, upper, batches, rounds_per_batch, seconds, .. }) = bias {
        writeln!(
            text,
            "bias of the radius: {:.2} %, from {:.2} % to {:.2} % ({sure} % confidence; measured in {seconds:.2} s from {batches} batches of {} at two radii)",
            percent(*relative),
            percent(*lower),
            percent(*upper),
            counted(rounds_per_batch, "round")
        )
        .unwrap();
    }
    let (relative, upper) = bias.map_or((0.0, 0.0), |bias| (bias.relative, bias.upper));
    // Below what the per cents show, light cut off is stated by itself only.
    let what = match (bias.is_some(), lost >= 5e-5) {
        (true, true) => "noise, bias and light cut off",
        (true, false) => "noise and bias",
        (false, true) => "noise and light cut off",
        (false, false) => return text,
    };
    if let Some((noise, bound)) = noise.zip(bound) {
        let (error, most) = (noise.hypot(relative + lost / Losses::SAFETY), bound.hypot(upper + lost));
        writeln!(text, "{what}: {:.2} %, at most {:.2} %", percent(error), percent(most)).unwrap();
    }
    text
}

/// Light that limits kept from the result; `bounces` is the cap.
pub(super) fn losses(losses: &Losses, bounces: u32) -> String {
    let emitted = losses.emitted.abs();
    let mut text = if losses.cut_off > 0.0 {
        format!("light cut off after {}: {:.3e} of {emitted:.3e} W", counted(bounces, "bounce"), losses.cut_off)
    } else {
        format!("light cut off: none of {emitted:.3e} W")
    };
    if losses.clamped > 0.0 {
        write!(text, "; clamped at shading normals: {:.3e} W", losses.clamped).unwrap();
    }
    if losses.clamped_values > 0 {
        write!(text, "; {} clamped to the largest that the film holds", counted(losses.clamped_values, "value")).unwrap();
    }
    if losses.camera_paths > 0 {
        write!(text, "; {} cut off after {MAX_BOUNCES} mirrors and panes", counted(losses.camera_paths, "camera path")).unwrap();
    }
    if losses.relative > 0.0 {
        write!(text, "; together at most {:.2} % of the result", 100.0 * losses.relative).unwrap();
    }
    text + "\n"
}

/// Why a run ended before its last round, unless the user interrupted it.
pub(super) fn end_in_words(end: End, stop: &Stop) -> Option<String> {
    match end {
        End::Cancelled => None,
        End::Rounds => stop.error.map(|error| format!("before the requested error of {} % was reached", 100.0 * error)),
        End::Error => Some("at the requested error".to_owned()),
        End::Time => Some(format!("after the requested {} s{}", stop.seconds.unwrap_or_default(), unreached(stop))),
        End::Photons => Some(format!("at the requested {}{}", counted(stop.photons.unwrap_or_default(), "photon"), unreached(stop))),
    }
}

fn unreached(stop: &Stop) -> String {
    stop.error.map_or_else(String::new, |error| format!(" before the requested error of {} % was reached", 100.0 * error))
}

/// The run in words: device, settings, ledger, errors and timing table.
pub fn text(outcome: &RunResult, walls: &[WallEstimate], unknown: &Unknown) -> String {
    let mut text = String::new();
    let settings = &outcome.plan.settings;
    let device = outcome.device.as_ref().map_or_else(|| format!("CPU, {}", driver(outcome)), DeviceFacts::label);
    writeln!(text, "{device}").unwrap();
    writeln!(
        text,
        "open-box, {}: {} of {} photons, {}, radius {} m, {} gather{}, {} sums, {} seed {}",
        settings.builder.name(),
        counted(outcome.film.rounds.max(1), "round"),
        settings.photons,
        counted(settings.bounces, "bounce"),
        settings.radius,
        format!("{:?}", settings.gather).to_lowercase(),
        settings.nearest.map_or_else(String::new, |nearest| format!(" of the {nearest} nearest")),
        format!("{:?}", settings.sums).to_lowercase(),
        format!("{:?}", settings.rng).to_lowercase(),
        settings.seed
    )
    .unwrap();
    if let Some(why) = end_in_words(outcome.end, &settings.stop) {
        let unfinished = if outcome.film.unfinished.is_empty() { "" } else { " and part of another" };
        writeln!(text, "ended {why}: {}{unfinished} of at most {}", counted(outcome.film.rounds, "round"), settings.rounds).unwrap();
    }
    for decision in &outcome.plan.decisions {
        let verb = if decision.kept { "with" } else { "without" };
        writeln!(text, "  {verb} {}: {}", decision.effect, decision.reason).unwrap();
    }
    text.push('\n');
    text.push_str(&ledger(&outcome.fates.ledger()));
    text.push_str(&losses(&outcome.losses, settings.bounces));
    if let Some(nonfinite_values) = &outcome.nonfinite_values {
        writeln!(text, "{}", nonfinite_values.text()).unwrap();
    }
    text.push_str(&errors(
        outcome.film.rounds,
        relative_error(walls),
        unknown,
        outcome.bias.as_ref(),
        outcome.losses.relative,
        settings.stop.confidence,
    ));
    text.push_str(&unknown.text("texel", "W/m2", settings.stop.confidence, outcome.film.rounds));
    text.push('\n');
    text.push_str(&timing_table(&outcome.timings, outcome.device.as_ref()));
    text
}

/// The ledger as one equation.
pub(super) fn ledger(ledger: &Ledger) -> String {
    let Ledger { emitted, absorbed, escaped, cut_off, dropped, stored } = ledger;
    format!(
        "ledger: {emitted} emitted = {absorbed} absorbed + {escaped} escaped + {cut_off} cut off + {dropped} dropped\n        {stored} photons stored\n"
    )
}

/// Scopes indented by depth, time on the device and on the host's clock.
pub(super) fn timing_table(timings: &Timings, device: Option<&DeviceFacts>) -> String {
    let mut text = String::new();
    let cell = |milliseconds: Option<f64>| milliseconds.map_or("-".to_owned(), |value| format!("{value:.3}"));
    writeln!(text, "{:<28} {:>9} {:>12} {:>12}", "pass", "count", "GPU ms", "wall ms").unwrap();
    for row in timings.rows() {
        let depth = row.name.matches('/').count();
        let name = row.name.rsplit('/').next().unwrap_or(&row.name);
        let indented = format!("{}{name}", "  ".repeat(depth));
        writeln!(text, "{indented:<28} {:>9} {:>12} {:>12}", row.count, cell(row.gpu_ms), cell(row.wall_ms)).unwrap();
    }
    if device.is_some_and(|facts| facts.timestamp_bits == 0) {
        text.push_str("This device has no timestamps: GPU times are unknown.\n");
    }
    text
}
