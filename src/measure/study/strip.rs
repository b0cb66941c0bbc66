//! Runs with nothing set but the error that ends them, and the strip of pictures at the head of the page: what each error looks like, and
//! how it differs from the reference.

use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use glam::Vec3;

use super::axes::Axis;
use super::case::StudyCase;
use super::point::{Curve, Point};
use super::store::Store;
use super::{Part, StudyRequest};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::output::colour::{ColourImage, Format, Tone};

/// Errors that runs are ended by, the largest first.
pub(crate) const ASKED: [f64; 5] = [0.2, 0.1, 0.05, 0.02, 0.01];

/// A picture of the strip.
#[derive(Debug)]
pub(crate) struct Frame {
    /// What was asked for; of pictures without a pilot, the first of [`ASKED`] that they are no worse than.
    pub asked: f64,
    pub rounds: u32,
    pub ms: f64,
    /// Against the reference.
    pub error: f64,
    pub picture: Vec<u8>,
    /// Relative to the mean of the reference, in false colours.
    pub difference: Vec<u8>,
    pub size: (u32, u32),
}

#[derive(Debug)]
pub(crate) struct Strip {
    pub frames: Vec<Frame>,
    pub reference: Vec<u8>,
    /// The difference that has the full colour, over the mean.
    pub scale: f64,
}

/// Curve of the runs that each error ends, as far as the time goes.
pub(crate) fn measure_defaults(
    gpu: &Gpu,
    case: &StudyCase,
    request: &StudyRequest,
    share: Duration,
    cancelled: &AtomicBool,
    store: &mut Store,
) -> Result<Curve> {
    let mut curve = Curve::new("default settings");
    let began = Instant::now();
    for &asked in &request.asked {
        let command = case.command_to(asked, request.seed);
        if let Some(point) = store.find(Axis::Default, &command) {
            curve.points.push(point);
            continue;
        }
        let left = share.saturating_sub(began.elapsed());
        let chosen = case.choose(gpu, asked, cancelled)?;
        if !curve.points.is_empty() && chosen.expected * request.repeats > left {
            break;
        }
        let most = 2 * (left / request.repeats).max(LEAST_TIME);
        // The first makes pipelines, and is dropped.
        if curve.points.is_empty() {
            case.run_to_error(gpu, &chosen, request.seed, most, cancelled)?;
        }
        let mut shots = Vec::new();
        let mut rounds = 0;
        for seed in request.seed..request.seed + u64::from(request.repeats) {
            let start = Instant::now();
            let Some((shot, taken)) = case.run_to_error(gpu, &chosen, seed, most, cancelled)? else { break };
            rounds = if shots.is_empty() { taken } else { rounds };
            shots.push((shot, start.elapsed()));
        }
        if shots.len() < request.repeats as usize {
            break;
        }
        let point = Point::of(&shots, &case.reference, command, rounds);
        store.add(Axis::Default, &point)?;
        curve.points.push(point);
    }
    Ok(curve)
}

/// A run that its error ends may take so long, however little time is left.
const LEAST_TIME: Duration = Duration::from_secs(2);

/// The pictures of a part: of its runs with default settings, else of its base. Their runs are repeated, as no point holds its picture.
pub(crate) fn strip(gpu: &Gpu, case: &StudyCase, part: &Part, request: &StudyRequest, cancelled: &AtomicBool) -> Result<Option<Strip>> {
    let reference = &case.reference;
    let right = case.picture(&reference.values);
    let stops = right.usual_exposure();
    let mean = reference.mean_over(|place| reference.values[place]).abs();
    let mut found: Vec<(f64, &Point, Vec<f64>)> = Vec::new();
    if let Some(curve) = &part.default {
        for (point, asked) in curve.points.iter().zip(request.asked.iter().copied()) {
            let chosen = case.choose(gpu, asked, cancelled)?;
            let Some((shot, _)) = case.run_to_error(gpu, &chosen, request.seed, LONGEST, cancelled)? else { continue };
            // Few rounds may do for several errors.
            if found.last().is_some_and(|(.., values)| *values == shot.values) {
                found.pop();
            }
            found.push((asked, point, shot.values));
        }
    } else if let Some((configuration, curve)) = case.groups.first().map(|group| &group.configurations[0]).zip(part.base()) {
        for &asked in &request.asked {
            let Some(point) = curve.points.iter().find(|point| point.error().value <= asked) else { break };
            if found.last().is_some_and(|(_, last, _)| last.rounds == point.rounds) {
                found.pop();
            }
            found.push((asked, point, case.run(gpu, configuration, point.rounds, request.seed, cancelled)?.values));
        }
    }
    let Some((_, loosest, _)) = found.first() else { return Ok(None) };
    let scale = round_up(2.0 * loosest.error().value);
    let png = |picture: &ColourImage| picture.encode(Format::Png, stops, Tone::default(), None);
    let frame = |(asked, point, values): (f64, &Point, Vec<f64>)| {
        let of = |place: usize| if reference.counts[place] { (values[place] - reference.values[place]) / mean } else { f64::NAN };
        let differences: Vec<f64> = (0..values.len()).map(of).collect();
        let shown = case.picture(&differences);
        let colours = shown.pixels.iter().map(|pixel| false_colour(pixel.element_sum() / 3.0 / scale as f32)).collect();
        Frame {
            asked,
            rounds: point.rounds,
            ms: point.ms().value,
            error: point.error().value,
            picture: png(&case.picture(&values)),
            difference: ColourImage { pixels: colours, ..shown }.encode(Format::Png, 0.0, Tone::Linear, None),
            size: (right.width, right.height),
        }
    };
    Ok(Some(Strip { frames: found.into_iter().map(frame).collect(), reference: png(&right), scale }))
}

/// A run of the strip is one that was measured before.
const LONGEST: Duration = Duration::from_secs(3600);

/// The next of 1, 2 and 5 times a power of ten.
fn round_up(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|digit| digit * power).into_iter().find(|round| *round >= value * (1.0 - 1e-9)).unwrap_or(value)
}

/// Blue where it is darker than the reference, white where it is the same, orange where it is brighter; grey where nothing is compared. As
/// linear light.
fn false_colour(difference: f32) -> Vec3 {
    const DARKER: Vec3 = Vec3::new(0.0, 0.168, 0.445);
    const BRIGHTER: Vec3 = Vec3::new(0.665, 0.112, 0.0);
    if difference.is_nan() {
        return Vec3::splat(0.2);
    }
    let end = if difference < 0.0 { DARKER } else { BRIGHTER };
    Vec3::ONE.lerp(end, difference.abs().min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_end_on_round_numbers() {
        assert_eq!([0.13, 0.2, 0.21, 0.021, 0.9].map(round_up), [0.2, 0.2, 0.5, 0.05, 1.0]);
    }

    #[test]
    fn false_colours_distinguish_darker_from_brighter() {
        assert_eq!(false_colour(0.0), Vec3::ONE);
        let (darker, brighter) = (false_colour(-0.5), false_colour(0.5));
        assert!(darker.z > darker.x && brighter.x > brighter.z);
        assert_eq!(false_colour(7.0), false_colour(1.0));
        assert!(false_colour(f32::NAN).x < 0.5);
    }
}
