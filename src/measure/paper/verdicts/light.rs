//! Findings about the light: the figures over several seeds.

use super::{Evidence, Quantity, Verdict};
use crate::engine::room::film::WallEstimate;
use crate::measure::interval::{Decision, Interval};
use crate::measure::paper::Reproduction;
use crate::measure::paper::figures::{Figure, Frame, SEEDS};
use crate::output::words::times;
use crate::scene::open_box::open_box;
use crate::text::percent;

/// Noise that falls within this factor of the square root of the rounds' counts as independent.
const NOISE_WITHIN: f64 = 1.15;
/// A bias that changes by less than this factor between 1 round and 100 has stayed.
const BIAS_WITHIN: f64 = 1.1;

fn figure(found: &Reproduction, number: usize) -> Option<&Figure> {
    found.figures.iter().find(|made| made.number == number && !made.frames.is_empty())
}

fn illumination(walls: &[WallEstimate]) -> impl Iterator<Item = f64> {
    walls.iter().flat_map(|wall| wall.illumination.iter().copied())
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, number) = values.fold((0.0, 0u64), |(sum, number), value| (sum + value, number + 1));
    sum / number.max(1) as f64
}

/// Mean over a part of a frame's points, from the dimmest (0) to the brightest (1).
fn mean_between(frame: &Frame, from: f64, to: f64) -> f64 {
    let mut values: Vec<f64> = illumination(&frame.walls).collect();
    values.sort_by(f64::total_cmp);
    let place = |share: f64| (share * values.len() as f64) as usize;
    mean(values[place(from)..place(to)].iter().copied())
}

/// Directly lit places are brighter (figure 1).
pub(crate) fn figure_1(found: &Reproduction) -> Option<Verdict> {
    let figure = figure(found, 1)?;
    let contrast = figure.over_seeds(|frames| mean_between(&frames[0], 0.9, 1.0) / mean_between(&frames[0], 0.0, 0.1));
    let share = mean(illumination(&figure.frames[0].walls).map(|value| f64::from(u8::from(value > 0.0))));
    Verdict {
        topic: "Places near the lights are brighter, and no place is black",
        then: "seen".to_owned(),
        here: format!("{} of the points receive photons", percent(share)),
        text: format!(
            "The brightest tenth of all points is {} as bright as the dimmest tenth. {} of the points receive photons. {}",
            Quantity::Factor.shown(&contrast),
            percent(share),
            noise_of_seeds(figure).map_or_else(String::new, |noise| format!(
                "The standard deviation between {SEEDS} seeds is {} of the mean illumination: the image is noisy here too.",
                percent(noise)
            ))
        ),
        evidence: vec![Evidence::above_margin("brightest / dimmest tenth of the points".to_owned(), contrast)],
        ..Verdict::default()
    }
    .decided()
}

/// Standard deviation of a point between seeds, over the mean of all points; `None` with one seed.
fn noise_of_seeds(figure: &Figure) -> Option<f64> {
    let seeds: Vec<Vec<f64>> =
        std::iter::once(&figure.frames).chain(&figure.repeats).map(|frames| illumination(&frames[0].walls).collect()).collect();
    let points = seeds[0].len();
    let variance = |point: usize| {
        let centre = mean(seeds.iter().map(|values| values[point]));
        seeds.iter().map(|values| (values[point] - centre).powi(2)).sum::<f64>() / (seeds.len() - 1) as f64
    };
    let deviation = mean((0..points).map(variance)).sqrt();
    (seeds.len() > 1).then(|| deviation / mean(seeds.iter().flatten().copied()))
}

/// Mean illumination by shininess (figure 3), of which the paper says nothing.
pub(crate) fn figure_3(found: &Reproduction) -> Option<Verdict> {
    let figure = figure(found, 3)?;
    let brightness = |frame: &Frame| mean(illumination(&frame.walls));
    let ratio = figure.over_seeds(|frames| brightness(&frames[frames.len() - 1]) / brightness(&frames[0]));
    Some(Verdict {
        topic: "Lower shininess, more light",
        then: "not described".to_owned(),
        here: Quantity::Factor.shown(&ratio),
        text: format!(
            "The walls become brighter as the shininess decreases: the mean illumination at 0.01 is {} that at 2.0. The paper makes no statement to compare this with.",
            Quantity::Factor.shown(&ratio)
        ),
        ..Verdict::default()
    })
}

/// Mean illumination of the walls without a light, 15 bounces against 2 (figure 2).
pub(super) fn indirect_light(found: &Reproduction) -> Option<Verdict> {
    let figure = figure(found, 2)?;
    let wall_mean = |frame: &Frame, is_lit: bool| {
        let scene = open_box(&frame.settings);
        let chosen = frame.walls.iter().filter(|wall| scene.lights.iter().any(|light| light.face == wall.face) == is_lit);
        mean(chosen.flat_map(|wall| wall.illumination.iter().copied()))
    };
    let evidence: Vec<Evidence> = [("three walls without a light", false), ("two walls with a light", true)]
        .into_iter()
        .map(|(what, is_lit)| {
            let interval = figure.over_seeds(|frames| wall_mean(&frames[0], is_lit) / wall_mean(&frames[1], is_lit));
            Evidence::above_margin(format!("15 / 2 bounces, {what}"), interval)
        })
        .collect();
    Verdict {
        topic: "More bounces light the indirect areas",
        then: "seen in figure 2".to_owned(),
        here: format!("{} as bright on walls without a light", evidence[0].shown()),
        elsewhere: format!("{} on walls with a light", times(evidence[1].interval.value)),
        text: format!(
            "With 15 bounces instead of 2 the mean illumination is {} on the three walls without a light, and {} on the two walls with a light.",
            evidence[0].shown(),
            evidence[1].shown()
        ),
        evidence,
        ..Verdict::default()
    }
    .decided()
}

/// Figure 4's noise: the distance of each picture from the one with the most rounds.
///
/// The first k of n rounds are part of all n, so the difference of the two means has the variance
/// 1/k - 1/n times that of one round.
pub(super) fn noise(found: &Reproduction) -> Option<Verdict> {
    let figure = figure(found, 4)?;
    let [first, .., next_to_last, last] = figure.frames.as_slice() else { return None };
    let distance = |frame: &Frame, last: &Frame| {
        let squares = illumination(&frame.walls).zip(illumination(&last.walls)).map(|(a, b)| (a - b).powi(2));
        mean(squares).sqrt()
    };
    let expected = |frame: &Frame| (1.0 / f64::from(frame.settings.rounds) - 1.0 / f64::from(last.settings.rounds)).sqrt();
    let interval = figure.over_seeds(|frames| {
        let last = &frames[frames.len() - 1];
        distance(&frames[0], last) / distance(&frames[frames.len() - 2], last)
    });
    let independent = expected(first) / expected(next_to_last);
    let end = match interval.map(|ratio| ratio / independent).within(1.0 / NOISE_WITHIN, NOISE_WITHIN) {
        Decision::Yes => "this run agrees",
        Decision::No => "this run disagrees",
        Decision::Undecided => "this run does not decide whether that is so",
    };
    let [from, to, of] = [first, next_to_last, last].map(|frame| frame.settings.rounds);
    Verdict {
        topic: "More rounds lower the noise",
        then: "seen in figure 4".to_owned(),
        here: format!("{} less from {from} to {to} rounds", Quantity::Factor.shown(&interval)),
        text: format!(
            "From {from} to {to} rounds, the RMS difference from the image of {of} rounds falls by a factor of {}. Independent rounds predict {}; {end}.",
            Quantity::Factor.shown(&interval),
            times(independent)
        ),
        evidence: vec![Evidence::above_margin(format!("RMS difference, {from} / {to} rounds"), interval)],
        ..Verdict::default()
    }
    .decided()
}

/// What rounds do not mend: the rim of each wall, where part of the fixed disc lies beyond the wall.
pub(super) fn bias(found: &Reproduction) -> Option<Verdict> {
    let figure = figure(found, 4)?;
    let [first, .., last] = figure.frames.as_slice() else { return None };
    let [before, after] =
        [figure.over_seeds(|frames| rim_share(&frames[0])), figure.over_seeds(|frames| rim_share(&frames[frames.len() - 1]))];
    let change = figure.over_seeds(|frames| rim_share(&frames[frames.len() - 1]) / rim_share(&frames[0]));
    let end = match change.within(1.0 / BIAS_WITHIN, BIAS_WITHIN) {
        Decision::Yes => "More photons do not reduce it; a shrinking radius or edge correction would.",
        Decision::No => "It changes with the number of photons.",
        Decision::Undecided => "This run does not decide whether it changes with the number of photons.",
    };
    let rim = |name: &str, interval: Interval| Evidence {
        what: format!("rim after {name}, share of the corrected value"),
        interval,
        quantity: Quantity::Share,
        decision: None,
    };
    Some(Verdict {
        topic: "A fixed radius darkens the rims of walls",
        then: "not mentioned".to_owned(),
        here: format!("rims have {} of their light after {}", Quantity::Share.shown(&after), last.label),
        elsewhere: format!("{} after {}", Quantity::Share.shown(&before), first.label),
        text: format!(
            "At the outermost points of each wall, part of the disc lies beyond the wall. The shares are relative to a value that is corrected for this. {end}"
        ),
        evidence: vec![rim(&first.label, before), rim(&last.label, after)],
        ..Verdict::default()
    })
}

/// Illumination of the outermost texels, as a share of what it would be if each were divided by the
/// part of its disc that lies on the wall.
fn rim_share(frame: &Frame) -> f64 {
    let scene = open_box(&frame.settings);
    let mesh = frame.settings.mesh as usize;
    let disc = std::f64::consts::PI * frame.settings.radius.powi(2);
    let (mut shown, mut corrected) = (0.0, 0.0);
    for wall in &frame.walls {
        let rectangle = scene.rectangle(wall.face);
        for (texel, value) in wall.illumination.iter().enumerate() {
            let (column, row) = (texel % mesh, texel / mesh);
            if [column, row].iter().any(|place| *place == 0 || *place == mesh - 1) {
                let at = |place: usize| (place as f64 + 0.5) / mesh as f64;
                shown += value;
                corrected += value * disc / rectangle.covered_area(at(column), at(row), frame.settings.radius);
            }
        }
    }
    shown / corrected
}

#[cfg(test)]
mod tests {
    use super::super::Standing;
    use super::*;
    use crate::measure::paper::sample;
    use crate::output::image::tests::walls_of;
    use crate::settings::RoomSettings;

    /// Walls of this illumination, which differs between seeds by the share `noise`.
    fn frame(rounds: u32, seed: u64, noise: f64, illumination: impl Fn(usize, usize) -> f64) -> Frame {
        let settings = RoomSettings { rounds, mesh: 8, ..RoomSettings::default() };
        let scene = open_box(&settings);
        let factor = (noise * [0.0, 1.0, -1.0, 0.5, -0.5][seed as usize]).exp();
        let walls = walls_of(&scene, 64, |face, point| factor * illumination(face, point));
        Frame { label: format!("{rounds} rounds"), command: String::new(), settings, walls }
    }

    fn with_figure(number: usize, seeds: u64, frames: impl Fn(u64) -> Vec<Frame>) -> Reproduction {
        let mut found = sample::reproduction();
        let figure = Figure {
            number,
            title: "",
            published: "",
            caption: "",
            frames: frames(0),
            repeats: (1..seeds).map(frames).collect(),
            panels: Vec::new(),
        };
        found.figures = vec![figure];
        found
    }

    #[test]
    fn indirect_light_is_judged_by_its_interval() {
        let standing = |without_light: f64, with_light: f64, noise: f64, seeds: u64| {
            let found = with_figure(2, seeds, |seed| {
                let is_lit = |face: usize| open_box(&RoomSettings::default()).lights.iter().any(|light| light.face == face);
                vec![
                    frame(1, seed, noise, |face, _| if is_lit(face) { with_light } else { without_light }),
                    frame(1, seed, 0.0, |_, _| 1.0),
                ]
            });
            indirect_light(&found).unwrap().standing.unwrap()
        };
        assert_eq!(standing(1.5, 1.3, 0.01, SEEDS), Standing::Holds);
        assert_eq!(standing(1.0, 1.05, 0.01, SEEDS), Standing::NoLonger);
        assert_eq!(standing(1.5, 1.0, 0.01, SEEDS), Standing::HoldsInPart);
        assert_eq!(standing(1.5, 1.3, 0.5, SEEDS), Standing::Undecided);
        assert_eq!(standing(1.5, 1.3, 0.01, 2), Standing::Undecided, "two seeds bound nothing");
    }

    /// Frames of 1, 50 and 100 rounds whose error falls with this power of the rounds.
    fn rounds(power: f64, noise: f64) -> Reproduction {
        with_figure(4, SEEDS, |seed| {
            let at = |rounds: u32| {
                let error = if rounds == 100 { 0.0 } else { (f64::from(rounds).powf(-2.0 * power) - 100f64.powf(-2.0 * power)).sqrt() };
                let noise = if rounds == 1 { noise } else { 0.0 };
                frame(rounds, seed, noise, move |_, point| 1.0 + if point % 2 == 0 { error } else { -error })
            };
            vec![at(1), at(50), at(100)]
        })
    }

    #[test]
    fn noise_is_judged_by_its_interval() {
        let independent = noise(&rounds(0.5, 0.0)).unwrap();
        assert_eq!(independent.standing, Some(Standing::Holds));
        assert!(independent.text.ends_with("predict 9.9\u{a0}×; this run agrees."), "{}", independent.text);
        let slow = noise(&rounds(0.25, 0.0)).unwrap();
        assert!(slow.standing == Some(Standing::Holds) && slow.text.ends_with("this run disagrees."), "{}", slow.text);
        let noisy = noise(&rounds(0.5, 2.0)).unwrap();
        assert!(noisy.text.ends_with("does not decide whether that is so."), "{}", noisy.text);
    }

    #[test]
    fn a_bias_stays_or_changes() {
        // Discs around corners lose the most: what lights them alone changes the share of all rims.
        let text = |corners_after: f64| {
            let is_end = |place: usize| place == 0 || place == 7;
            let after = move |_, point: usize| if is_end(point / 8) && is_end(point % 8) { corners_after } else { 1.0 };
            let found = with_figure(4, SEEDS, |seed| vec![frame(1, seed, 0.01, |_, _| 1.0), frame(100, seed, 0.01, after)]);
            bias(&found).unwrap().text
        };
        assert!(text(1.0).contains("More photons do not reduce it"));
        assert!(text(100.0).contains("It changes with the number of photons"));
    }

    #[test]
    fn figures_1_and_3_are_described() {
        let bright_half = with_figure(1, SEEDS, |seed| vec![frame(1, seed, 0.1, |_, point| if point < 32 { 3.0 } else { 1.0 })]);
        let verdict = figure_1(&bright_half).unwrap();
        assert_eq!(verdict.standing, Some(Standing::Holds));
        assert!(verdict.text.contains("3.00\u{a0}×") && verdict.text.contains("standard deviation between 5 seeds"), "{}", verdict.text);
        let flat = with_figure(1, SEEDS, |seed| vec![frame(1, seed, 0.1, |_, _| 1.0)]);
        assert_eq!(figure_1(&flat).unwrap().standing, Some(Standing::NoLonger));
        let brighter = with_figure(3, SEEDS, |seed| vec![frame(1, seed, 0.1, |_, _| 1.0), frame(1, seed, 0.1, |_, _| 2.0)]);
        assert!(figure_3(&brighter).unwrap().here.starts_with("2.00\u{a0}×"));
    }
}
