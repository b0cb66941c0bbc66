//! What the reports of both worlds say alike: losses, errors and timings, as text and as JSON. The reports themselves are in
//! `room_report` and `scene_report`.

use std::fmt::Write;

use serde::Serialize;

use crate::constants::MAX_BOUNCES;
use crate::constants::PART_COUNT;
use crate::engine::error::bias::{Bias, BiasFrom};
use crate::engine::error::bound::{ErrorPlaces, ErrorSource, FilmError};
use crate::engine::error::unknown::Unknown;
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::engine::run::RunResult;
use crate::engine::run::watch::End;
use crate::gpu::DeviceFacts;
use crate::ledger::{Ledger, Losses};
use crate::settings::stop::{LEAST_BLOCKS, Measure, Stop};
use crate::text::counted;
use crate::timings::{Row, Timings};

/// The part of the JSON report that both worlds have.
#[derive(Serialize)]
pub(super) struct Common<'a, Settings> {
    photonmill: &'static str,
    /// Device name; `cpu` for the CPU builder.
    device: &'a str,
    driver: &'a str,
    /// Those that shared the run with it.
    more_devices: Vec<&'a str>,
    settings: &'a Settings,
    /// Why it ended, and rounds that the result holds.
    end: End,
    rounds: u32,
    /// Whole blocks of rounds, of which the spread gives the errors; and photons of one that was cut short.
    blocks: u32,
    photons_left_out: u64,
    /// Light that limits kept from the result.
    losses: Losses,
    #[serde(flatten)]
    errors: Errors<'a>,
    /// Nonfinite values that `--paranoid` found; null without it.
    nonfinite_values: Option<&'a NonfiniteValues>,
    timings: &'a [Row],
    dispatches: u64,
    submissions: u64,
}

/// How far a result may be off.
#[derive(Serialize)]
pub(super) struct Errors<'a> {
    /// Of the noise, as the settings' `measure` says; null where fewer than eight blocks leave it unknown.
    relative_error: f64,
    /// What it is not above, with the confidence of the settings; null also while all is black and need not be.
    error_bound: Option<f64>,
    /// Of the standard errors of pixels, texels or points.
    intervals: Intervals,
    /// What noise, bias and light that limits kept from the result are together not above; null where that is not known.
    total_bound: Option<f64>,
    /// What nothing has reached.
    unknown: &'a Unknown,
    tail: Tail,
    /// Where the noise sits; null where that is not known.
    noise_sits: Option<ErrorPlaces>,
    /// Of the radius, relative to the result; null where it was not measured.
    bias: Option<Bias>,
}

impl Errors<'_> {
    /// `lost` is light that limits kept, relative to the result.
    pub(super) fn of(error: &FilmError, confidence: f64, lost: f64) -> Errors<'_> {
        let known = |bound: f64| Some(bound).filter(|bound| bound.is_finite());
        Errors {
            relative_error: error.noise,
            error_bound: known(error.bound(confidence)),
            intervals: Intervals::of(error.blocks, confidence),
            total_bound: known(error.bound_of_all(confidence, lost)),
            unknown: &error.unknown,
            tail: Tail { known: error.tail_is_known(confidence), unseen: error.unseen },
            noise_sits: error.places,
            bias: error.bias,
        }
    }
}

/// Of the noise: whether the rounds have shown how far it reaches, and what may be missing from them, relative to the result; null
/// while all is black.
#[derive(Serialize)]
struct Tail {
    known: bool,
    unseen: f64,
}

/// What follows from a standard error: light lies within so many of them to either side, with this confidence; null where fewer than
/// eight blocks leave errors unknown.
#[derive(Serialize)]
struct Intervals {
    #[serde(flatten)]
    source: ErrorSource,
    standard_errors: Option<f64>,
}

impl Intervals {
    fn of(blocks: u32, confidence: f64) -> Intervals {
        let source = ErrorSource { degrees_of_freedom: blocks.saturating_sub(1), confidence };
        Intervals { source, standard_errors: source.reach() }
    }
}

/// `driver` is that of a run without a device.
pub(super) fn common<'a, Plan, Film, Settings>(
    run: &'a RunResult<Plan, Film>,
    settings: &'a Settings,
    error: &'a FilmError,
    confidence: f64,
    driver: &'a str,
) -> Common<'a, Settings> {
    Common {
        photonmill: env!("CARGO_PKG_VERSION"),
        device: run.device_name(),
        driver: run.device.as_ref().map_or(driver, |facts| &facts.driver),
        more_devices: run.more_devices.iter().map(|facts| facts.name.as_str()).collect(),
        settings,
        end: run.end,
        rounds: error.rounds,
        blocks: error.blocks,
        photons_left_out: run.left_out,
        losses: run.losses,
        errors: Errors::of(error, confidence, run.losses.relative),
        nonfinite_values: run.nonfinite_values.as_ref(),
        timings: run.timings.rows(),
        dispatches: run.dispatches,
        submissions: run.submissions,
    }
}

/// Errors and timings, as the text reports of both worlds end. A point is what the result is of, and `unit` its unit.
pub(super) fn ending<Plan, Film>(run: &RunResult<Plan, Film>, error: &FilmError, stop: &Stop, (point, unit): (&str, &str)) -> String {
    let found = run.nonfinite_values.as_ref().map_or_else(String::new, |values| values.text() + "\n");
    let left_out = match run.left_out {
        0 => String::new(),
        photons => format!("left out: {} of a block of rounds that was cut short\n", counted(photons, "photon")),
    };
    let errors = errors(error, run.losses.relative, (stop.measure, stop.confidence), point);
    let unknown = error.unknown.text(point, unit, stop.confidence, error.rounds);
    format!("{found}{left_out}{errors}{unknown}\n{}", timing_table(&run.timings, run.device.as_ref()))
}

/// Noise, bias, and both together, a line each, in per cent. What nothing has reached counts in the bounds,
/// and so does light that limits kept.
pub(super) fn errors(error: &FilmError, lost: f64, (measure, confidence): (Measure, f64), point: &str) -> String {
    let mut text = String::new();
    let (percent, sure) = (|share: f64| 100.0 * share, 100.0 * confidence);
    let measure = match measure {
        Measure::Rmse => "RMSE over the mean",
        Measure::RelMse => "root of relMSE",
    };
    let known = Some((error.noise, error.bound(confidence))).filter(|(noise, bound)| noise.is_finite() && bound.is_finite());
    match known {
        Some((noise, bound)) => {
            writeln!(text, "noise: {:.2} % ({measure}), at most {:.2} % ({sure} % confidence)", percent(noise), percent(bound)).unwrap();
        }
        None if error.rounds == 1 => text.push_str("noise: unknown after a single round\n"),
        None if error.blocks < LEAST_BLOCKS => {
            text += &format!(
                "noise: unknown, as fewer than {LEAST_BLOCKS} blocks of rounds are whole; use more `rounds` or a smaller `block`\n"
            );
        }
        None => text.push_str("noise: unknown\n"),
    }
    if let Some(places) = &error.places {
        text.push_str(&sits(places, point));
    }
    if let Intervals { source: ErrorSource { degrees_of_freedom, .. }, standard_errors: Some(reach) } =
        Intervals::of(error.blocks, confidence)
    {
        text += &format!(
            "        each {point}'s standard error has {degrees_of_freedom} degrees of freedom; a {sure} % interval reaches {reach:.2} standard errors to either side\n"
        );
    }
    if !error.tail_is_known(confidence) {
        let most = if error.unseen.is_finite() { format!("{:.2} %", percent(error.unseen)) } else { "any share".to_owned() };
        text += &format!(
            "tail of the noise: not known yet. A lamp in mirrors or glass, too rare to have been seen, may add {most} ({sure} % confidence)\n"
        );
    }
    if let Some(Bias { relative, lower, upper, from, .. }) = &error.bias {
        let from = match from {
            BiasFrom::NoMap => None,
            BiasFrom::Nothing => {
                writeln!(text, "bias of the radius: unknown, because {}", Bias::UNKNOWN).unwrap();
                return text;
            }
            BiasFrom::Blocks(blocks) => Some(counted(blocks, "block")),
            BiasFrom::Batches { batches, rounds, seconds } => {
                Some(format!("{batches} extra batches of {} in {seconds:.2} s", counted(rounds, "round")))
            }
        };
        if let Some(from) = from {
            let [bias, lower, upper] = [*relative, *lower, *upper].map(percent);
            text += &format!(
                "bias of the radius: {bias:.2} %, from {lower:.2} % to {upper:.2} % ({sure} % confidence; from {from} at two radii, which do not show what is much narrower than both)\n"
            );
        }
    }
    let measured = error.bias.filter(|bias| bias.from != BiasFrom::NoMap);
    let relative = measured.map_or(0.0, |bias| bias.relative);
    // Below what the per cents show, light cut off is stated by itself only.
    let what = match (measured.is_some(), lost >= 5e-5) {
        (true, true) => "noise, bias and light cut off",
        (true, false) => "noise and bias",
        (false, true) => "noise and light cut off",
        (false, false) => return text,
    };
    if let Some((noise, _)) = known {
        let (error, most) = (noise.hypot(relative + lost / Losses::SAFETY), error.bound_of_all(confidence, lost));
        writeln!(text, "{what}: {:.2} %, at most {:.2} %", percent(error), percent(most)).unwrap();
    }
    text
}

/// Shares of the parts of the light, the largest first.
pub(crate) fn shares(of_parts: [f64; PART_COUNT as usize]) -> String {
    let names = ["direct light", "light over mirrors and glass", "caustics", "indirect light"];
    let mut parts: Vec<(f64, &str)> = of_parts.into_iter().zip(names).filter(|(share, _)| *share >= 0.005).collect();
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let parts: Vec<String> = parts.into_iter().map(|(share, name)| format!("{name} {:.0} %", 100.0 * share)).collect();
    parts.join(", ")
}

/// Where the noise sits, as shares of its square.
fn sits(places: &ErrorPlaces, point: &str) -> String {
    format!(
        "        its square sits in {}; {:.0} % of it in the worst {}\n",
        shares(places.of_parts),
        100.0 * places.of_worst_pixels,
        counted(places.worst_pixels, point)
    )
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
pub(super) fn ended(end: End, stop: &Stop, rounds: u32, most: u32) -> String {
    let why = match end {
        End::Cancelled => None,
        End::Rounds => stop.error.map(|error| format!("before the requested error of {} % was reached", 100.0 * error)),
        End::Error => Some("at the requested error".to_owned()),
        End::Time => Some(format!("after the requested {} s{}", stop.seconds.unwrap_or_default(), unreached(stop))),
        End::Photons => Some(format!("at the requested {}{}", counted(stop.photons.unwrap_or_default(), "photon"), unreached(stop))),
    };
    why.map_or_else(String::new, |why| format!("ended {why}: {} of at most {most}\n", counted(rounds, "round")))
}

fn unreached(stop: &Stop) -> String {
    stop.error.map_or_else(String::new, |error| format!(" before the requested error of {} % was reached", 100.0 * error))
}

/// The ledger as one equation.
pub(super) fn ledger(ledger: &Ledger) -> String {
    let Ledger { emitted, absorbed, escaped, cut_off, dropped, stored } = ledger;
    format!(
        "ledger: {emitted} emitted = {absorbed} absorbed + {escaped} escaped + {cut_off} cut off + {dropped} dropped\n        {stored} photons stored\n"
    )
}

/// Scopes indented by depth, time on the device and on the host's clock.
fn timing_table(timings: &Timings, device: Option<&DeviceFacts>) -> String {
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

/// What ends a run, as it was understood: for the line that announces the plan.
pub(crate) fn goals(stop: &Stop) -> String {
    let mut goals = Vec::new();
    // Rounded to twelve digits, as 0.05 / 100 * 100 is not quite 0.05.
    let percent = |share: f64| format!("{} %", (share * 1e14).round() / 1e12);
    goals.extend(stop.error.map(|error| format!("an error of {} ({} confidence)", percent(error), percent(stop.confidence))));
    goals.extend(stop.seconds.map(|seconds| format!("{seconds} s")));
    goals.extend(stop.photons.map(|photons| counted(photons, "photon")));
    if goals.is_empty() { String::new() } else { format!("; stops at {}", goals.join(" or ")) }
}

/// Rounds that a run does, or may do at most.
pub(crate) fn up_to(stop: &Stop, rounds: u32) -> String {
    format!("{}{}", if stop.is_set() { "up to " } else { "" }, counted(rounds, "round"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::error::degrees_of_freedom::DegreesOfFreedom;

    #[test]
    fn a_report_says_that_the_tail_is_not_known() {
        let text = |unseen| {
            let freedom = DegreesOfFreedom::least(16);
            let error =
                FilmError { rounds: 16, blocks: 16, noise: 0.1, freedom, unknown: Unknown::default(), unseen, bias: None, places: None };
            errors(&error, 0.0, (Measure::Rmse, 0.95), "pixel")
        };
        assert!(text(0.5).contains("not known yet") && text(0.5).contains("may add 50.00 % (95 % confidence)"), "{}", text(0.5));
        assert!(text(f64::INFINITY).contains("may add any share"), "{}", text(f64::INFINITY));
        assert!(!text(0.1).contains("tail"), "{}", text(0.1));
    }
}
