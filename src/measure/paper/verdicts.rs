//! Which of the paper's findings still hold: sentences computed from this run's measurements.

use super::experiments::{Implementation, Pass, TotalTime, series};
use super::figures::Frame;
use super::{Reproduction, published};
use crate::engine::room::film::WallEstimate;
use crate::measure::line_fit::LineFit;
use crate::output::svg::extremes;
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
    fn of(trials: impl IntoIterator<Item = bool>) -> Option<Standing> {
        let (held, failed): (Vec<bool>, Vec<bool>) = trials.into_iter().partition(|holds| *holds);
        match (held.is_empty(), failed.is_empty()) {
            (true, true) => None,
            (false, true) => Some(Standing::Holds),
            (true, false) => Some(Standing::NoLonger),
            (false, false) => Some(Standing::HoldsInPart),
        }
    }

    pub fn words(self) -> &'static str {
        self.words_and_class().0
    }

    /// Its class in the style sheet.
    pub fn class(self) -> &'static str {
        self.words_and_class().1
    }

    fn words_and_class(self) -> (&'static str, &'static str) {
        match self {
            Standing::Holds => ("still holds", "holds"),
            Standing::HoldsInPart => ("holds in part", "in-part"),
            Standing::NoLonger => ("no longer holds", "no-longer"),
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
        on_gpu(found, Pass::Map),
        on_gpu(found, BRUTE),
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

const BRUTE: Pass = Pass::Rendering(Gather::Brute);

fn ratios(found: &Reproduction, over: Builder, under: Builder, pass: Pass) -> Vec<Ratio> {
    let ratio = |(photons, bounces)| {
        let ms = |builder| Some(found.running_time(photons, bounces, Implementation::of(builder), pass)?.ms.median);
        Some(Ratio { value: ms(over)? / ms(under)?, photons, bounces })
    };
    found.sizes().into_iter().filter_map(ratio).collect()
}

/// '1.1 × at the paper's size and 0.5 × to 0.9 × at the other sizes'; the page has them all in a table.
fn listed(ratios: &[Ratio]) -> String {
    let (paper, others): (Vec<&Ratio>, Vec<&Ratio>) =
        ratios.iter().partition(|ratio| (ratio.photons, ratio.bounces) == (published::PHOTONS, published::BOUNCES));
    let (low, high) = extremes(others.iter().map(|ratio| ratio.value));
    let at_paper = paper.first().map(|ratio| format!("{} at the paper's size", times(ratio.value)));
    let at_others = match others.as_slice() {
        [] => None,
        [only] => Some(format!("{} with {} photons and {} bounces", times(only.value), count(u64::from(only.photons)), only.bounces)),
        _ if times(low) == times(high) => Some(format!("{} at the other sizes", times(low))),
        _ => Some(format!("{} to {} at the other sizes", times(low), times(high))),
    };
    at_paper.into_iter().chain(at_others).collect::<Vec<_>>().join(" and ")
}

/// What one builder took longer than another in 2008, and here.
fn slower(topic: &'static str, then: String, ratios: &[Ratio]) -> Option<Verdict> {
    let standing = Standing::of(ratios.iter().map(|ratio| ratio.value > MARGIN))?;
    Some(Verdict::new(topic, format!("In 2008 the {then}. Here the factor is {}", listed(ratios)), standing))
}

fn append(found: &Reproduction) -> Option<Verdict> {
    let factor = times(published::MAP_MS.modified / published::MAP_MS.naive);
    let then = format!("map pass took {factor} as long with atomics as with naive slots");
    slower("Atomics slow the map pass down", then, &ratios(found, Builder::Atomic, Builder::Naive, Pass::Map))
}

fn packed(found: &Reproduction) -> Option<Verdict> {
    let factor = times(published::RENDERING_MS.naive / published::RENDERING_MS.modified);
    let then = format!("rendering pass took {factor} as long over all slots, including empty ones, as over a compact list");
    slower("A compact list renders faster", then, &ratios(found, Builder::Naive, Builder::Atomic, BRUTE))
}

fn ballot(found: &Reproduction) -> Option<Verdict> {
    let ratios = ratios(found, Builder::Ballot, Builder::Atomic, Pass::Map);
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
    let standing = Standing::of(filled.iter().map(|(_, share)| *share < 0.5))?;
    let shares: Vec<String> =
        filled.iter().map(|(bounces, share)| format!("{} % of them with {bounces} bounces", number(share * 100.0))).collect();
    let text = format!("The paper found that most slots of the naive map stay empty. Here photons fill {}", list(&shares));
    Some(Verdict::new("Slots waste memory", text, standing))
}

/// A pass of the CPU, relative to both of the paper's builders on the GPU.
fn on_gpu(found: &Reproduction, pass: Pass) -> Option<Verdict> {
    let device = found.machine.device.as_ref()?;
    let (topic, published, how) = match pass {
        Pass::Map => ("The GPU builds the map faster than the CPU", published::MAP_MS, ""),
        Pass::Rendering(_) => ("The GPU renders faster than the CPU", published::RENDERING_MS, " and the same brute force"),
    };
    let [naive, modified] = [Builder::Naive, Builder::Atomic].map(|builder| ratios(found, Builder::Cpu, builder, pass));
    let mut text = format!(
        "In 2008 the CPU's {} pass took {} as long as the naive one on the GPU and {} as long as the modified one. \
         Here the CPU uses one thread{how}. Relative to the naive GPU version it takes {}. Relative to the modified version it takes {}",
        pass.name(),
        times(published.cpu / published.naive),
        times(published.cpu / published.modified),
        listed(&naive),
        listed(&modified)
    );
    let grid = ratios(found, Builder::Cpu, Builder::Atomic, Pass::Rendering(Gather::Grid));
    if pass == BRUTE && !grid.is_empty() {
        text += &format!(". With a grid on both CPU and GPU it takes {}", listed(&grid));
    }
    if device.is_cpu {
        text += ". The 'GPU' is a software device on the same CPU";
    }
    let faster = naive.iter().chain(&modified).map(|ratio| ratio.value > MARGIN);
    Some(Verdict::new(topic, text, Standing::of(faster)?))
}

fn linear(found: &Reproduction) -> Option<Verdict> {
    let exponent = |points: &[(f64, f64)]| LineFit::of_logarithms(points).map(|line| line.slope);
    let paper = published::TABLE_1.map(|(rounds, ms)| (f64::from(rounds * published::PHOTONS), ms));
    let large = format!("with the grid and {} photons per round", count(u64::from(found.request.large)));
    let names = ["with brute force".to_owned(), "with the grid".to_owned(), large];
    let fits: Vec<(f64, String)> = series(&found.request)
        .into_iter()
        .zip(names)
        .filter_map(|((photons, gather), name)| {
            let points: Vec<(f64, f64)> = found.totals_of(photons, gather).map(TotalTime::point).collect();
            Some((exponent(&points)?, name))
        })
        .collect();
    let standing = Standing::of(fits.iter().map(|(exponent, _)| (exponent - 1.0).abs() <= LINEAR_WITHIN))?;
    let described: Vec<String> = fits.iter().map(|(exponent, name)| format!("{exponent:.2} {name}")).collect();
    let text = format!(
        "In 2008 the run time was proportional to the number of photons (fitted exponent {:.2}). Here the fitted exponent is {}",
        exponent(&paper)?,
        list(&described)
    );
    Some(Verdict::new("Time grows in proportion to photons", text, standing))
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
    let standing = Standing::of([gain(false) > MARGIN, gain(true) > MARGIN])?;
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
    Some(Verdict::new("Rounds lower the noise", text, Standing::of([measured > MARGIN])?))
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

    /// The first size's map pass of one builder takes so long.
    fn with_another_size(mut found: Reproduction, builder: Builder, ms: f64) -> Reproduction {
        let mut times = found.running_times.iter_mut();
        times.find(|time| time.pass == Pass::Map && time.implementation.builder == builder).unwrap().ms.median = ms;
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
        assert_eq!(
            append(&with_another_size(with_map_ms(1.0, 2.0, 1.0), Builder::Atomic, 1.0)).unwrap().standing,
            Some(Standing::HoldsInPart)
        );
    }

    #[test]
    fn the_ballot_pays_or_not() {
        let text = |ballot_ms: f64| ballot(&with_map_ms(1.0, 1.0, ballot_ms)).unwrap().text;
        assert!(text(0.5).ends_with("this is faster."));
        assert!(text(1.0).contains("no significant difference"));
        assert!(text(2.0).contains("not faster, and slower"));
        let mixed = with_another_size(with_map_ms(1.0, 1.0, 0.5), Builder::Ballot, 2.0);
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
        assert!(append(&found).is_none() && packed(&found).is_none() && on_gpu(&found, Pass::Map).is_none());
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
        assert!(on_gpu(&found, Pass::Map).unwrap().text.contains("software device"));
        found.machine.device.as_mut().unwrap().is_cpu = false;
        assert!(!on_gpu(&found, Pass::Map).unwrap().text.contains("software device"));
    }
}
