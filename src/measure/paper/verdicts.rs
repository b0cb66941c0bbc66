//! Which of the paper's findings still hold: sentences computed from this run's measurements.

use super::experiments::{Implementation, Pass, TotalTime};
use super::figures::Frame;
use super::{Reproduction, published};
use crate::engine::room::film::WallEstimate;
use crate::output::words::{count, duration, list, number, times};
use crate::scene::open_box::open_box;
use crate::settings::{Builder, Gather};

/// What became of something that the paper found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    Holds,
    HoldsInPart,
    NoLonger,
}

impl Standing {
    /// Of a claim that was tried several times; `None` if never.
    fn of(trials: &[bool]) -> Option<Standing> {
        match trials {
            [] => None,
            all if all.iter().all(|held| *held) => Some(Standing::Holds),
            none if none.iter().all(|held| !held) => Some(Standing::NoLonger),
            _ => Some(Standing::HoldsInPart),
        }
    }

    pub fn words(self) -> &'static str {
        match self {
            Standing::Holds => "still holds",
            Standing::HoldsInPart => "holds in part",
            Standing::NoLonger => "no longer holds",
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    pub topic: &'static str,
    pub text: String,
    /// `None` where the paper claims nothing.
    pub standing: Option<Standing>,
}

impl Verdict {
    /// Ends `text` with the standing.
    fn new(topic: &'static str, text: String, standing: Standing) -> Verdict {
        Verdict { topic, text: format!("{text}. This {}.", standing.words()), standing: Some(standing) }
    }
}

/// Times closer than this count as equal.
pub const MARGIN: f64 = 1.1;
/// Exponents of time against photons within this of 1 count as linear.
const LINEAR_WITHIN: f64 = 0.1;
/// Noise that falls within this factor of the square root of the rounds' counts as independent.
const NOISE_WITHIN: f64 = 1.15;
/// A bias that changes by less than this factor between 1 round and 100 has stayed.
const BIAS_WITHIN: f64 = 1.1;

pub fn all(found: &Reproduction) -> Vec<Verdict> {
    let verdicts = [
        append(found),
        ballot(found),
        empty_slots(found),
        packed(found),
        map_on_gpu(found),
        rendering_on_gpu(found),
        linear(found),
        table_1(found),
        memory(found),
        indirect_light(found),
        noise(found),
        bias(found),
    ];
    verdicts.into_iter().flatten().collect()
}

/// The time of one builder over another's, and where both were measured.
struct Ratio {
    value: f64,
    photons: u32,
    bounces: u32,
}

fn ratios(found: &Reproduction, over: Builder, under: Builder, pass: Pass, gather: Option<Gather>) -> Vec<Ratio> {
    let sizes = found.sizes().into_iter();
    sizes
        .filter_map(|(photons, bounces)| {
            let ms = |builder| found.median_ms(photons, bounces, Implementation::of(builder), pass, gather);
            Some(Ratio { value: ms(over)? / ms(under)?, photons, bounces })
        })
        .collect()
}

/// '1.1 × at the paper's size and 0.5 × to 0.9 × at the other sizes'; the page has them all in a table.
fn listed(ratios: &[Ratio]) -> String {
    let (paper, others): (Vec<&Ratio>, Vec<&Ratio>) =
        ratios.iter().partition(|ratio| (ratio.photons, ratio.bounces) == (published::PHOTONS, published::BOUNCES));
    let (low, high) = others.iter().fold((f64::INFINITY, 0.0f64), |(low, high), ratio| (low.min(ratio.value), high.max(ratio.value)));
    let at_paper = paper.first().map(|ratio| format!("{} at the paper's size", times(ratio.value)));
    let at_others = match others.as_slice() {
        [] => None,
        [only] => Some(format!("{} with {} photons and {} bounces", times(only.value), count(u64::from(only.photons)), only.bounces)),
        _ if times(low) == times(high) => Some(format!("{} at the other sizes", times(low))),
        _ => Some(format!("{} to {} at the other sizes", times(low), times(high))),
    };
    at_paper.into_iter().chain(at_others).collect::<Vec<_>>().join(" and ")
}

fn held(ratios: &[Ratio], holds: impl Fn(f64) -> bool) -> Option<Standing> {
    Standing::of(&ratios.iter().map(|ratio| holds(ratio.value)).collect::<Vec<_>>())
}

fn append(found: &Reproduction) -> Option<Verdict> {
    let ratios = ratios(found, Builder::Atomic, Builder::Naive, Pass::Map, None);
    let standing = held(&ratios, |ratio| ratio > MARGIN)?;
    let text = format!(
        "In 2008 the map pass took {} as long with atomics as with naive slots. Here the factor is {}",
        times(published::MAP_MS.modified / published::MAP_MS.naive),
        listed(&ratios)
    );
    Some(Verdict::new("Atomics slow the map pass down", text, standing))
}

fn ballot(found: &Reproduction) -> Option<Verdict> {
    let ratios = ratios(found, Builder::Ballot, Builder::Atomic, Pass::Map, None);
    if ratios.is_empty() {
        return None;
    }
    let pays = |ratio: &Ratio| ratio.value < 1.0 / MARGIN;
    let costs = |ratio: &Ratio| ratio.value > MARGIN;
    let end = match (ratios.iter().any(pays), ratios.iter().any(costs)) {
        _ if ratios.iter().all(pays) => "this is faster",
        (true, true) => "this is faster at some sizes and slower at others",
        (true, false) => "this is faster at some sizes",
        (false, true) => "this is not faster, and slower at some sizes",
        (false, false) => "there is no significant difference",
    };
    let text = format!(
        "The paper's device had no subgroup operations. With a ballot, a whole subgroup needs one atomic. Relative to one atomic per thread, the map pass takes {}: {end}.",
        listed(&ratios)
    );
    Some(Verdict { topic: "One atomic per subgroup", text, standing: None })
}

fn empty_slots(found: &Reproduction) -> Option<Verdict> {
    let filled: Vec<(u32, f64)> = found.sizes()[..2]
        .iter()
        .filter_map(|&(photons, bounces)| {
            let time = found.running_times.iter().find(|time| (time.photons, time.bounces) == (photons, bounces))?;
            Some((bounces, time.stored as f64 / (f64::from(photons) * f64::from(bounces))))
        })
        .collect();
    let standing = Standing::of(&filled.iter().map(|(_, share)| *share < 0.5).collect::<Vec<_>>())?;
    let shares: Vec<String> =
        filled.iter().map(|(bounces, share)| format!("{} % of them with {bounces} bounces", number(share * 100.0))).collect();
    let text = format!("The paper found that most slots of the naive map stay empty. Here photons fill {}", list(&shares));
    Some(Verdict::new("Slots waste memory", text, standing))
}

fn packed(found: &Reproduction) -> Option<Verdict> {
    let ratios = ratios(found, Builder::Naive, Builder::Atomic, Pass::Rendering, Some(Gather::Brute));
    let standing = held(&ratios, |ratio| ratio > MARGIN)?;
    let text = format!(
        "In 2008 the rendering pass took {} as long over all slots, including empty ones, as over a compact list. Here the factor is {}",
        times(published::RENDERING_MS.naive / published::RENDERING_MS.modified),
        listed(&ratios)
    );
    Some(Verdict::new("A compact list renders faster", text, standing))
}

fn map_on_gpu(found: &Reproduction) -> Option<Verdict> {
    let [naive, modified] = [Builder::Naive, Builder::Atomic].map(|builder| ratios(found, Builder::Cpu, builder, Pass::Map, None));
    let published = published::MAP_MS;
    let text = format!(
        "In 2008 the CPU's map pass took {} as long as the naive one on the GPU and {} as long as the modified one. \
         Here the CPU uses one thread. Relative to the naive GPU version it takes {}. Relative to the modified version it takes {}",
        times(published.cpu / published.naive),
        times(published.cpu / published.modified),
        listed(&naive),
        listed(&modified)
    );
    on_gpu(found, "The GPU builds the map faster than the CPU", text, &naive, &modified)
}

fn rendering_on_gpu(found: &Reproduction) -> Option<Verdict> {
    let against = |builder, gather| ratios(found, Builder::Cpu, builder, Pass::Rendering, Some(gather));
    let [naive, modified] = [Builder::Naive, Builder::Atomic].map(|builder| against(builder, Gather::Brute));
    let published = published::RENDERING_MS;
    let grid = against(Builder::Atomic, Gather::Grid);
    let with_grid = if grid.is_empty() { String::new() } else { format!(". With a grid on both CPU and GPU it takes {}", listed(&grid)) };
    let text = format!(
        "In 2008 the CPU's rendering pass took {} as long as the naive one on the GPU and {} as long as the modified one. \
         Here the CPU uses one thread and the same brute force. Relative to the naive GPU version it takes {}. Relative to the modified version it takes {}{with_grid}",
        times(published.cpu / published.naive),
        times(published.cpu / published.modified),
        listed(&naive),
        listed(&modified)
    );
    on_gpu(found, "The GPU renders faster than the CPU", text, &naive, &modified)
}

fn on_gpu(found: &Reproduction, topic: &'static str, text: String, naive: &[Ratio], modified: &[Ratio]) -> Option<Verdict> {
    let faster: Vec<bool> = naive.iter().chain(modified).map(|ratio| ratio.value > MARGIN).collect();
    let device = found.machine.device.as_ref()?;
    let text = if device.is_cpu { format!("{text}. The 'GPU' is a software device on the same CPU") } else { text };
    Some(Verdict::new(topic, text, Standing::of(&faster)?))
}

fn linear(found: &Reproduction) -> Option<Verdict> {
    let paper: Vec<(f64, f64)> = published::TABLE_1.iter().map(|(rounds, ms)| (f64::from(rounds * published::PHOTONS), *ms)).collect();
    let fits: Vec<(f64, String)> = series(found)
        .into_iter()
        .filter_map(|(name, totals)| {
            let points: Vec<(f64, f64)> = totals.iter().map(|total| (total.photons() as f64, total.best_ms())).collect();
            Some((exponent(&points)?, name))
        })
        .collect();
    let standing = Standing::of(&fits.iter().map(|(exponent, _)| (exponent - 1.0).abs() <= LINEAR_WITHIN).collect::<Vec<_>>())?;
    let described: Vec<String> = fits.iter().map(|(exponent, name)| format!("{exponent:.2} {name}")).collect();
    let text = format!(
        "In 2008 the run time was proportional to the number of photons (fitted exponent {:.2}). Here the fitted exponent is {}",
        exponent(&paper)?,
        list(&described)
    );
    Some(Verdict::new("Time grows in proportion to photons", text, standing))
}

/// Measured series of table 1, named.
fn series(found: &Reproduction) -> Vec<(String, Vec<&TotalTime>)> {
    let (small, large) = (published::PHOTONS, found.request.large);
    [
        ("with brute force".to_owned(), small, Gather::Brute),
        ("with the grid".to_owned(), small, Gather::Grid),
        (format!("with the grid and {} photons per round", count(u64::from(large))), large, Gather::Grid),
    ]
    .into_iter()
    .map(|(name, photons, gather)| (name, found.totals_of(photons, gather).collect()))
    .collect()
}

/// Slope of the least-squares line through the logarithms; `None` for fewer than two points.
fn exponent(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let mean = |value: fn(&(f64, f64)) -> f64| logs.iter().map(value).sum::<f64>() / logs.len() as f64;
    let (x, y) = (mean(|log| log.0), mean(|log| log.1));
    let variance: f64 = logs.iter().map(|log| (log.0 - x).powi(2)).sum();
    let covariance: f64 = logs.iter().map(|log| (log.0 - x) * (log.1 - y)).sum();
    (variance > 0.0).then(|| covariance / variance)
}

fn table_1(found: &Reproduction) -> Option<Verdict> {
    let (rounds, then_ms) = published::TABLE_1[published::TABLE_1.len() - 1];
    let row = |gather| found.totals_of(published::PHOTONS, gather).find(|total| total.rounds == rounds);
    let described: Vec<String> =
        [("the paper's scan of the whole list", Gather::Brute), ("a sorted grid, with a bit-identical image,", Gather::Grid)]
            .into_iter()
            .filter_map(|(name, gather)| {
                let total = row(gather)?;
                Some(format!("{name} takes {} ({} as fast as in 2008)", duration(total.best_ms()), times(then_ms / total.best_ms())))
            })
            .collect();
    if described.is_empty() {
        return None;
    }
    let photons = u64::from(rounds) * u64::from(published::PHOTONS);
    let text = format!("{} photons took {} in 2008. Here {}.", count(photons), duration(then_ms), list(&described));
    Some(Verdict { topic: "The longest run of table 1", text, standing: None })
}

fn memory(found: &Reproduction) -> Option<Verdict> {
    let most = found.running_times.iter().filter(|time| time.implementation.builder != Builder::Cpu).max_by_key(|time| time.photons)?;
    let standing = if most.photons > published::PHOTONS { Standing::NoLonger } else { return None };
    let text = format!(
        "In 2008 memory limited a round to about {} photons. Here a round of {} photons and {} bounces was run, and a round that exceeds a buffer is split automatically",
        count(u64::from(published::PHOTONS)),
        count(u64::from(most.photons)),
        most.bounces
    );
    Some(Verdict::new("Memory limits the photons", text, standing))
}

fn frames(found: &Reproduction, figure: usize) -> &[Frame] {
    found.figures.iter().find(|made| made.number == figure).map_or(&[], |made| &made.frames)
}

/// Mean illumination of the walls without a light, 15 bounces against 2 (figure 2).
fn indirect_light(found: &Reproduction) -> Option<Verdict> {
    let [many, few] = frames(found, 2) else { return None };
    let unlit = |frame: &Frame, lit: bool| {
        let scene = open_box(&frame.settings);
        let chosen = frame.walls.iter().filter(|wall| scene.lights.iter().any(|light| light.face == wall.face) == lit);
        mean(chosen.flat_map(|wall| wall.illumination.iter().copied()))
    };
    let gain = |lit: bool| unlit(many, lit) / unlit(few, lit);
    let standing = Standing::of(&[gain(false) > MARGIN, gain(true) > MARGIN])?;
    let text = format!(
        "The paper found areas of indirect light brighter with 15 bounces than with 2. Here the mean illumination of the three walls without a light is {} as high, and that of the two walls with a light {}",
        times(gain(false)),
        times(gain(true))
    );
    Some(Verdict::new("More bounces light the indirect areas", text, standing))
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, number) = values.fold((0.0, 0u64), |(sum, number), value| (sum + value, number + 1));
    sum / number.max(1) as f64
}

/// Figure 4's grain: the distance of each picture from the one with the most rounds.
///
/// The first k of n rounds are part of all n, so the difference of the two means has the variance
/// 1/k - 1/n times that of one round.
fn noise(found: &Reproduction) -> Option<Verdict> {
    let frames = frames(found, 4);
    let [first, .., next_to_last, last] = frames else { return None };
    let distance = |frame: &Frame| {
        let squares = illumination(&frame.walls).zip(illumination(&last.walls)).map(|(a, b)| (a - b).powi(2));
        mean(squares).sqrt()
    };
    let expected = |frame: &Frame| (1.0 / f64::from(frame.settings.rounds) - 1.0 / f64::from(last.settings.rounds)).sqrt();
    let measured = distance(first) / distance(next_to_last);
    let independent = expected(first) / expected(next_to_last);
    let within = (1.0 / NOISE_WITHIN..=NOISE_WITHIN).contains(&(measured / independent));
    let falls = if within { "consistent with independent rounds" } else { "not consistent with independent rounds" };
    let text = format!(
        "The paper found that noise decreases with rounds. Here, from {} to {} rounds, the RMS difference from the image of {} rounds becomes {} smaller. Independent rounds predict {}, so this is {falls}",
        first.settings.rounds,
        next_to_last.settings.rounds,
        last.settings.rounds,
        times(measured),
        times(independent)
    );
    Some(Verdict::new("Rounds lower the noise", text, Standing::of(&[measured > MARGIN])?))
}

fn illumination(walls: &[WallEstimate]) -> impl Iterator<Item = f64> {
    walls.iter().flat_map(|wall| wall.illumination.iter().copied())
}

/// What rounds do not mend: the rim of each wall, where part of the fixed disc lies beyond the wall.
fn bias(found: &Reproduction) -> Option<Verdict> {
    let [first, .., last] = frames(found, 4) else { return None };
    let [before, after] = [first, last].map(rim_share);
    let stays = (1.0 / BIAS_WITHIN..=BIAS_WITHIN).contains(&(after / before));
    let end = if stays { "more photons do not reduce it; a shrinking radius or edge correction would" } else { "it changes" };
    let text = format!(
        "The fixed radius causes a bias that the paper does not mention. At the outermost texels of each wall, part of the disc lies beyond the wall. Their illumination is {} % of the value corrected for this after {}, and {} % after {}: {end}.",
        number(before * 100.0),
        first.label,
        number(after * 100.0),
        last.label
    );
    Some(Verdict { topic: "Rounds do not lower the bias", text, standing: None })
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
    use super::super::sample;
    use super::*;

    fn with_map_ms(naive: f64, atomic: f64, ballot: f64) -> Reproduction {
        let mut found = sample::reproduction();
        for time in found.running_times.iter_mut().filter(|time| time.pass == Pass::Map) {
            time.ms.median = match time.implementation.builder {
                Builder::Naive => naive,
                Builder::Atomic => atomic,
                Builder::Ballot => ballot,
                Builder::Cpu => 15.0,
                _ => unreachable!("not the paper's"),
            };
        }
        found
    }

    #[test]
    fn the_append_is_judged_by_its_ratio() {
        for (atomic, standing) in [(2.0, Standing::Holds), (1.05, Standing::NoLonger), (0.5, Standing::NoLonger)] {
            let verdict = append(&with_map_ms(1.0, atomic, 1.0)).unwrap();
            assert_eq!(verdict.standing, Some(standing), "{}", verdict.text);
            assert!(verdict.text.ends_with(&format!(". This {}.", standing.words())), "{}", verdict.text);
            assert!(verdict.text.contains(&times(atomic)) && verdict.text.contains(&times(11.0 / 1.7)), "{}", verdict.text);
        }
        let mut mixed = with_map_ms(1.0, 2.0, 1.0);
        let slow = mixed.running_times.iter_mut().find(|time| time.pass == Pass::Map && time.implementation.builder == Builder::Atomic);
        slow.unwrap().ms.median = 1.0;
        assert_eq!(append(&mixed).unwrap().standing, Some(Standing::HoldsInPart));
    }

    #[test]
    fn the_ballot_pays_or_not() {
        let text = |ballot_ms: f64| ballot(&with_map_ms(1.0, 1.0, ballot_ms)).unwrap().text;
        assert!(text(0.5).ends_with("this is faster."));
        assert!(text(1.0).contains("no significant difference"));
        assert!(text(2.0).contains("not faster, and slower"));
        let mut mixed = with_map_ms(1.0, 1.0, 0.5);
        let slow = mixed.running_times.iter_mut().find(|time| time.pass == Pass::Map && time.implementation.builder == Builder::Ballot);
        slow.unwrap().ms.median = 2.0;
        assert!(ballot(&mixed).unwrap().text.ends_with("faster at some sizes and slower at others."));
    }

    #[test]
    fn nothing_is_said_of_what_was_not_measured() {
        let mut found = sample::reproduction();
        found.running_times.clear();
        found.totals.clear();
        found.figures.clear();
        assert_eq!(all(&found), []);
        let mut found = sample::reproduction();
        found.running_times.retain(|time| time.implementation.builder == Builder::Cpu);
        assert!(append(&found).is_none() && packed(&found).is_none() && map_on_gpu(&found).is_none());
    }

    #[test]
    fn a_power_law_gives_its_exponent() {
        let points: Vec<(f64, f64)> = (1..6).map(|x| (f64::from(x), 3.0 * f64::from(x).powf(1.5))).collect();
        assert!((exponent(&points).unwrap() - 1.5).abs() < 1e-12);
        assert_eq!(exponent(&points[..1]), None);
    }

    #[test]
    fn the_papers_own_times_are_linear() {
        let mut found = sample::reproduction();
        for total in &mut found.totals {
            total.gpu_ms = Some(2130.0 * f64::from(total.rounds));
        }
        assert_eq!(linear(&found).unwrap().standing, Some(Standing::Holds));
        for total in &mut found.totals {
            total.gpu_ms = Some(100.0);
        }
        assert_eq!(linear(&found).unwrap().standing, Some(Standing::NoLonger));
    }

    #[test]
    fn a_software_device_is_called_one() {
        let mut found = sample::reproduction();
        assert!(map_on_gpu(&found).unwrap().text.contains("software device"));
        found.machine.device.as_mut().unwrap().is_cpu = false;
        assert!(!map_on_gpu(&found).unwrap().text.contains("software device"));
    }
}
