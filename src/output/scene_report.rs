//! What lighting a scene says of itself: the plan as a table, timings, ledgers and error; JSON for
//! programs.

use std::fmt::Write;

use serde::Serialize;

use super::report::{Common, common, ended, ending, goals, ledger, losses, shares, up_to};
use crate::constants::MAX_BOUNCES;
use crate::engine::End;
use crate::engine::scene::RunResult;
use crate::engine::scene::pilot::Pilot;
use crate::ledger::Ledger;
use crate::plan::effects;
use crate::plan::evidence::EffectDecision;
use crate::plan::radius::{RadiusFrom, Trial};
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::plan::sensor::Sensor;
use crate::plan::work_division::MapVariance;
use crate::scene::geometry::Geometry;
use crate::settings::scene::SceneSettings;
use crate::settings::stop::Stop;
use crate::text::{counted, percent};
use crate::timings::Timings;

/// A row of the plan: what was decided, and after a run what it cost and gave.
#[derive(Serialize)]
pub(crate) struct EffectRow<'a> {
    #[serde(flatten)]
    decision: &'a EffectDecision,
    /// GPU time of the passes that exist for this effect, ms; `None` where it shares its passes with
    /// others, or nothing ran.
    gpu_ms: Option<f64>,
    /// Share of all light in the result; `None` where an effect is no part of its own.
    share: Option<f64>,
}

/// The rows of a plan, with what a run measured.
pub(crate) fn rows<'a>(plan: &'a ScenePlan, run: Option<(&Timings, &[u64])>) -> Vec<EffectRow<'a>> {
    let pass = |name: &str| run.and_then(|(timings, _)| timings.row(name)).and_then(|row| row.gpu_ms);
    let share = |part: usize| {
        run.and_then(|(_, totals)| {
            let all: f64 = totals.iter().map(|total| *total as f64).sum();
            (all > 0.0).then(|| totals[part] as f64 / all)
        })
    };
    plan.decisions
        .iter()
        .map(|decision| {
            let measured = effects::measured(decision.effect).filter(|_| decision.kept);
            let gpu_ms = measured.and_then(|measured| pass(measured.pass?));
            let share = measured.and_then(|measured| share(measured.part));
            EffectRow { decision, gpu_ms, share }
        })
        .collect()
}

/// What a pilot has chosen and why, and what errors will take, in a line.
pub(crate) fn pilot(pilot: &Pilot, stop: &Stop, point: &str) -> String {
    let Pilot { before, chosen, rounds, .. } = pilot;
    let maps = [
        (rounds.variance.global, chosen.photons, "global", chosen.neighbours),
        (rounds.variance.caustic, chosen.caustic_photons, "caustic", chosen.caustic_neighbours),
    ];
    let of_map = |(map, photons, name, neighbours): (MapVariance, u32, &str, u32)| {
        (map.at.photons > 0).then(|| format!(", {} ({neighbours} within the first radius)", counted(photons, &format!("{name} photon"))))
    };
    let maps: String = maps.into_iter().filter_map(of_map).collect();
    let paths = format!("{} per {point} and {}", counted(chosen.samples, "path"), counted(chosen.shadow_rays, "shadow ray"));
    let against = match chosen == before {
        true => " as usual, as nothing else is much better".to_owned(),
        false => format!(", {:.1} times as fast as the usual settings", pilot.gain(stop)),
    };
    let why = shares(pilot.of_parts);
    let spent = if pilot.spent > 0.0 { format!("; {:.2} s of the device for the pilot", 1e-3 * pilot.spent) } else { String::new() };
    format!("pilot: {paths}{maps} a round{against}, as the noise sits in {why}; {}{spent}", expected(pilot, stop))
}

/// What each kind of work is expected to take and to leave in the picture, as a table.
pub(crate) fn pilot_table(pilot: &Pilot, stop: &Stop, point: &str) -> String {
    let Pilot { chosen, rounds, tiles, .. } = pilot;
    let expected = rounds.expected(*chosen, stop);
    let parts = rounds.parts(*chosen, f64::from(expected));
    let (costs, cost) = (rounds.costs(*chosen), rounds.cost(*chosen));
    let noise: f64 = parts.noise.iter().sum();
    let share = |of: f64, all: f64| if all > 0.0 { format!("{:.0} %", 100.0 * of / all) } else { "-".to_owned() };
    let paths = format!("{} and {} each", counted(chosen.samples, "path"), counted(chosen.shadow_rays, "shadow ray"));
    let rows = [
        (format!("per {point}: {paths}"), true),
        (
            format!("global photons: {}, {} within the first radius", chosen.photons, chosen.neighbours),
            rounds.variance.global.at.photons > 0,
        ),
        (
            format!("caustic photons: {}, {} within the first radius", chosen.caustic_photons, chosen.caustic_neighbours),
            rounds.variance.caustic.at.photons > 0,
        ),
    ];
    let mut text = format!("what the pilot has chosen, of about {}:\n", counted(expected, "round"));
    writeln!(text, "{:<64} {:>8} {:>8}", "", "time", "noise").unwrap();
    for (number, (row, _)) in rows.into_iter().enumerate().filter(|(_, (_, exists))| *exists) {
        writeln!(text, "{row:<64} {:>8} {:>8}", share(costs[number], cost), share(parts.noise[number], noise)).unwrap();
    }
    writeln!(text, "{:<64} {:>8}", "what each round takes in any case", share(rounds.cost.round, cost)).unwrap();
    if let Some((_, tiles)) = tiles {
        let counts = tiles.counts();
        let more: u32 = counts[1..].iter().sum();
        let tile = counted(more, "tile");
        writeln!(text, "{tile} of 4 x 4 pixels have more paths than the others, up to {} times as many", 1 << tiles.most()).unwrap();
    }
    let bias = if rounds.counts_bias { format!(", and a bias of the radius of {}", percent(parts.bias)) } else { String::new() };
    text + &format!(
        "expected: noise of {}{bias}, with their bounds {}",
        percent(noise.sqrt()),
        percent(rounds.error(*chosen, expected.into()))
    )
}

/// Seconds until the error that is wanted, and until half of it; or the error after the time that there is.
fn expected(pilot: &Pilot, stop: &Stop) -> String {
    let Pilot { chosen, rounds, .. } = pilot;
    let until = |error: f64| 1e-9 * rounds.until(*chosen, error).1;
    match (stop.error, stop.seconds) {
        (Some(error), most) if most.is_none_or(|most| until(error) <= most) => {
            let half = 0.5 * error;
            format!("{} takes about {}, {} {}", percent(error), seconds(until(error)), percent(half), seconds(until(half)))
        }
        (_, Some(most)) => format!("about {} after {}", percent(rounds.after(*chosen, most)), seconds(most)),
        _ => String::new(),
    }
}

fn seconds(seconds: f64) -> String {
    match seconds {
        ..10.0 => format!("{seconds:.1} s"),
        ..120.0 => format!("{seconds:.0} s"),
        ..7200.0 => format!("{:.0} min", seconds / 60.0),
        _ => format!("{:.0} h", seconds / 3600.0),
    }
}

/// The plan as a table.
pub(crate) fn plan_table(plan: &ScenePlan, run: Option<(&Timings, &[u64])>) -> String {
    let mut text = String::new();
    let rows = rows(plan, run);
    write!(text, "{:<20} {:<8} {:>10} {:>12}", "effect", "", "photons", "bytes").unwrap();
    if run.is_some() {
        write!(text, " {:>9} {:>7}", "GPU ms", "light").unwrap();
    }
    text.push_str("  evidence\n");
    let dash = || "-".to_owned();
    let count = |value: u64| if value == 0 { dash() } else { value.to_string() };
    for row in &rows {
        let verb = if row.decision.kept { "kept" } else { "dropped" };
        let decision = row.decision;
        write!(text, "{:<20} {verb:<8} {:>10} {:>12}", decision.effect.name(), count(decision.photons), count(decision.bytes)).unwrap();
        if run.is_some() {
            let milliseconds = row.gpu_ms.map_or_else(dash, |value| format!("{value:.3}"));
            let share = row.share.map_or_else(dash, |value| format!("{:.1} %", 100.0 * value));
            write!(text, " {milliseconds:>9} {share:>7}").unwrap();
        }
        writeln!(text, "  {}", decision.evidence).unwrap();
    }
    let shared: Vec<&str> =
        rows.iter().filter(|row| row.decision.kept && row.decision.effect.is_caustic()).map(|row| row.decision.effect.name()).collect();
    if shared.len() > 1 {
        writeln!(text, "{} share one caustic map: its photons, bytes, time and light stand in both rows.", shared.join(" and ")).unwrap();
    }
    text
}

/// One line on effects that the scene needs and the user left out.
pub(crate) fn missing(plan: &ScenePlan) -> Option<String> {
    let names: Vec<&str> = plan.missing().iter().map(|effect| effect.name()).collect();
    (!names.is_empty()).then(|| format!("left out, though the scene has it: {}; the result lacks that light", names.join(", ")))
}

/// What will be traced, before it is; `unit` is the geometry's in metres.
pub(crate) fn plan_line(plan: &ScenePlan, scene: &str, unit: f64, point: &str, is_of_file: bool) -> String {
    let what = match plan.sensor {
        Sensor::Picture { width, height } => format!("{width} x {height} pixels"),
        Sensor::Receivers { count } => counted(count, point),
    };
    let radii: Vec<String> = plan.maps().map(|map| format!("{:.4} m ({})", map.radius * unit, map.name)).collect();
    let radius = if radii.is_empty() { String::new() } else { format!("; first radius {}", radii.join(", ")) };
    format!(
        "plan: {scene}, {what}; {} of {}{}{radius}; {:.1} MiB on the device{}",
        up_to(&plan.settings.stop, plan.settings.rounds),
        photons_of(plan),
        if is_of_file { " from the file" } else { "" },
        plan.bytes as f64 / f64::from(1 << 20),
        goals(&plan.settings.stop)
    )
}

/// How many photons each map has.
fn photons_of(plan: &ScenePlan) -> String {
    let maps: Vec<String> = plan.maps().map(|map| counted(map.photons, &format!("{} photon", map.name))).collect();
    if maps.is_empty() { "no photons".to_owned() } else { maps.join(" and ") }
}

/// One line on a radius by a trial round that is wider than what many points lie in.
pub(crate) fn radius_warning(plan: &ScenePlan, geometry: &Geometry, point: &str) -> Option<String> {
    let trial = plan.trial.as_ref().filter(|_| plan.radius_is_too_wide())?;
    let widest = plan.maps().filter(|map| map.radius_from == RadiusFrom::Trial).max_by(|a, b| a.radius.total_cmp(&b.radius))?;
    let remedy = match widest.caustic_only {
        _ if plan.bias_is_unknown() => "the scene is too wide for a smaller radius: use `final_gather`, or leave out what makes it so wide",
        true => "for a sharper result use more `photons` or a smaller `caustic_radius`",
        false => "for a sharper result use more `photons` or a smaller `radius`",
    };
    Some(format!(
        "at {:.0} % of the {point}s the next wall or edge is nearer than the search radius of the {} map, {:.3} m, so the light there will be blurred; {remedy}",
        100.0 * trial.too_wide,
        widest.name,
        widest.radius * geometry.unit
    ))
}

/// One line on radii that differ from point to point.
fn radii(result: &RunResult) -> Option<String> {
    let in_words = |map: &MapPlan| {
        let (classes, (first, last)) = (map.classes?, result.film.classes(map)?);
        let times = |class: u32| match class.checked_sub(classes.usual) {
            None | Some(0) => (1u32 << (classes.usual - class)).to_string(),
            Some(halvings) => format!("1/{}", 1u32 << halvings),
        };
        (first != last).then(|| format!("{} to {} times the first radius ({})", times(last), times(first), map.name))
    };
    let maps: Vec<String> = result.plan.maps().filter_map(in_words).collect();
    (!maps.is_empty()).then(|| format!("radii by the density of photons: {}", maps.join(", ")))
}

/// The JSON report of a run.
#[derive(Serialize)]
struct Report<'a> {
    scene: &'a str,
    #[serde(flatten)]
    common: Common<'a, SceneSettings>,
    plan: PlanReport<'a>,
    ledgers: Ledgers,
    film: FilmReport<'a>,
}

/// Of the photons of each map.
#[derive(Serialize)]
struct Ledgers {
    global: Ledger,
    caustic: Ledger,
}

/// What the film could not add as it was, but for `losses`.
#[derive(Serialize)]
struct FilmReport<'a> {
    /// Counted as 0.
    nonfinite_values: u32,
    /// Estimates that cover too many triangles for an edge correction.
    uncorrected_estimates: u32,
    /// Visible points of each class of radii, of which class 0 has the largest and each has half of the one before: of the global
    /// map, then of the caustic map. Of the maps' `classes` the usual one has the map's `radius`.
    radius_classes: [&'a [u32]; 2],
}

#[derive(Serialize)]
struct PlanReport<'a> {
    effects: Vec<EffectRow<'a>>,
    maps: Vec<&'a MapPlan>,
    /// What found the radii that nobody has given.
    trial: Option<&'a Trial>,
    points_per_pixel: u32,
    bytes: u64,
}

fn plan_report<'a>(plan: &'a ScenePlan, run: Option<(&Timings, &[u64])>) -> PlanReport<'a> {
    PlanReport {
        effects: rows(plan, run),
        maps: plan.maps().collect(),
        trial: plan.trial.as_ref(),
        points_per_pixel: plan.samples() * plan.points_per_path,
        bytes: plan.bytes,
    }
}

/// A plan as JSON.
pub(crate) fn plan_json(plan: &ScenePlan) -> Vec<u8> {
    serde_json::to_vec_pretty(&plan_report(plan, None)).expect("a plan is plain data")
}

/// A run as JSON.
pub fn json(scene: &str, result: &RunResult) -> Vec<u8> {
    let RunResult { plan, film, fates, timings, .. } = result;
    let confidence = plan.settings.stop.confidence;
    let error = result.error();
    let report = Report {
        scene,
        common: common(result, &plan.settings, &error, confidence, ""),
        plan: plan_report(plan, Some((timings, &film.part_totals))),
        ledgers: Ledgers { global: fates[0].ledger(), caustic: fates[1].ledger() },
        film: FilmReport {
            nonfinite_values: film.anomalies[0],
            uncorrected_estimates: film.anomalies[2],
            radius_classes: film.class_counts.split_at(film.class_counts.len() / 2).into(),
        },
    };
    serde_json::to_vec_pretty(&report).expect("a report is plain data")
}

/// A run in words; `point` is what its results are of: pixel, texel or point.
pub fn text(scene: &str, result: &RunResult, point: &str, explain: bool) -> String {
    let mut text = String::new();
    let settings = &result.plan.settings;
    result.device.iter().chain(&result.more_devices).for_each(|facts| writeln!(text, "{}", facts.label()).unwrap());
    let maps = photons_of(&result.plan);
    let capped = if settings.bounces < MAX_BOUNCES { format!(", at most {}", counted(settings.bounces, "bounce")) } else { String::new() };
    writeln!(text, "{scene}: {} of {maps}{capped}, seed {}", counted(result.film.rounds, "round"), settings.seed).unwrap();
    if result.film.rounds == 1 && result.end == End::Time {
        let traced = result.ledger().emitted;
        let planned: u64 = result.plan.maps().map(|map| u64::from(map.photons)).sum();
        if traced < planned {
            text += &format!(
                "time was up in the first round, after {traced} of {planned} photons, so the result is noisy and its error unknown; use fewer `photons`, so that several rounds fit into `time`\n"
            );
        }
    }
    text += &ended(result.end, &settings.stop, result.film.rounds, settings.rounds);
    if explain {
        writeln!(text, "\n{}", plan_table(&result.plan, Some((&result.timings, &result.film.part_totals)))).unwrap();
    }
    if let Some(line) = missing(&result.plan) {
        writeln!(text, "{line}").unwrap();
    }
    for map in result.plan.maps() {
        let fates = &result.fates[usize::from(map.caustic_only)];
        write!(text, "{} {}", map.name, ledger(&fates.ledger())).unwrap();
        if let Some(open) = fates.totals.map(|totals| totals.interrupted).filter(|open| *open > 0) {
            writeln!(text, "        {open} of those cut off were under way when the run ended, in a round that does not count").unwrap();
        }
    }
    if let Some(line) = radii(result) {
        writeln!(text, "{line}").unwrap();
    }
    text.push_str(&losses(&result.losses, settings.bounces));
    if result.film.anomalies[0] > 0 {
        writeln!(text, "warning: {} (NaN or infinity), added as 0", counted(result.film.anomalies[0], "nonfinite value")).unwrap();
    }
    if result.film.anomalies[2] > 0 {
        let count = counted(result.film.anomalies[2], "estimate");
        writeln!(text, "warning: no edge correction for {count} over too many triangles; a smaller `radius` mends it").unwrap();
    }
    let unit = match result.plan.sensor {
        Sensor::Picture { .. } => "W/m2/sr",
        Sensor::Receivers { .. } => "W/m2",
    };
    text.push_str(&ending(result, &result.error(), &settings.stop, (point, unit)));
    text
}
