//! Findings about running times, memory and slots.

use super::{Evidence, MARGIN, Quantity, Standing, Verdict};
use crate::measure::interval::Interval;
use crate::measure::line_fit::LineFit;
use crate::measure::paper::experiments::{Implementation, Pass, TotalTime, series};
use crate::measure::paper::{Reproduction, published};
use crate::output::svg::extremes;
use crate::output::words::{count, duration, list, times};
use crate::settings::{Builder, Gather};

/// Exponents of time against photons within this of 1 count as linear.
const LINEAR_WITHIN: f64 = 0.1;
pub(super) const BRUTE: Pass = Pass::Rendering(Gather::Brute);

/// The time of one builder over another's, and where both were measured.
struct Ratio {
    photons: u32,
    bounces: u32,
    interval: Interval,
}

fn ratios(found: &Reproduction, over: Builder, under: Builder, pass: Pass) -> Vec<Ratio> {
    let ratio = |(photons, bounces)| {
        let runs = |builder| Some(&found.running_time(photons, bounces, Implementation::of(builder), pass)?.runs_ms);
        Some(Ratio { photons, bounces, interval: Interval::of_ratio(runs(over)?, runs(under)?) })
    };
    found.sizes().into_iter().filter_map(ratio).collect()
}

impl Ratio {
    fn is_at_papers_size(&self) -> bool {
        (self.photons, self.bounces) == (published::PHOTONS, published::BOUNCES)
    }

    fn size(&self) -> String {
        format!("{} photons, {} bounces", count(u64::from(self.photons)), self.bounces)
    }
}

/// At the paper's size, else where it was measured first.
fn glance(ratios: &[Ratio]) -> String {
    let shown = |ratio: &Ratio| {
        let place = if ratio.is_at_papers_size() { String::new() } else { format!(" with {}", ratio.size()) };
        Quantity::Factor.shown(&ratio.interval) + &place
    };
    ratios.first().map_or_else(|| "not measured".to_owned(), shown)
}

/// The range of all sizes but the first.
fn elsewhere<'a>(ratios: impl Iterator<Item = &'a Ratio>) -> String {
    let others: Vec<f64> = ratios.filter(|ratio| !ratio.is_at_papers_size()).map(|ratio| ratio.interval.value).collect();
    let (low, high) = extremes(others.iter().copied());
    match others.as_slice() {
        [] => String::new(),
        _ if times(low) == times(high) => format!("{} at other sizes", times(low)),
        _ => format!("{} to {} at other sizes", times(low), times(high)),
    }
}

/// That the one takes longer at each size.
fn takes_longer(name: &str, ratios: &[Ratio]) -> Vec<Evidence> {
    ratios.iter().map(|ratio| Evidence::above_margin(format!("{name}: {}", ratio.size()), ratio.interval)).collect()
}

/// The same where the paper claims nothing.
fn undecided(name: &str, ratios: &[Ratio]) -> impl Iterator<Item = Evidence> {
    takes_longer(name, ratios).into_iter().map(|one| Evidence { decision: None, ..one })
}

/// What one builder took longer than another in 2008, and here.
fn slower(topic: &'static str, then: f64, ratios: &[Ratio], name: &str, text: &str) -> Option<Verdict> {
    Verdict {
        topic,
        then: format!("{} as long", times(then)),
        here: glance(ratios),
        elsewhere: elsewhere(ratios.iter()),
        text: text.to_owned(),
        evidence: takes_longer(name, ratios),
        ..Verdict::default()
    }
    .decided()
}

pub(super) fn append(found: &Reproduction) -> Option<Verdict> {
    slower(
        "Atomics slow the map pass down",
        published::MAP_MS.modified / published::MAP_MS.naive,
        &ratios(found, Builder::Atomic, Builder::Naive, Pass::Map),
        "modified / naive",
        "The modified version appends each photon with an atomic addition; the naive one writes it to its own slot. \
         The factor is the time of the modified map pass over that of the naive one.",
    )
}

pub(super) fn packed(found: &Reproduction) -> Option<Verdict> {
    slower(
        "A compact list renders faster",
        published::RENDERING_MS.naive / published::RENDERING_MS.modified,
        &ratios(found, Builder::Naive, Builder::Atomic, BRUTE),
        "naive / modified",
        "The naive version searches all slots, including empty ones; the modified version searches a compact list. \
         The factor is the time of the naive rendering pass over that of the modified one, both by brute force.",
    )
}

/// A pass of the CPU, relative to both of the paper's builders on the GPU.
pub(super) fn on_gpu(found: &Reproduction, pass: Pass) -> Option<Verdict> {
    let device = found.device.as_ref()?;
    let (topic, published, how) = match pass {
        Pass::Map => ("The GPU builds the map faster than the CPU", published::MAP_MS, ""),
        Pass::Rendering(_) => ("The GPU renders faster than the CPU", published::RENDERING_MS, ", by brute force"),
    };
    let [naive, modified] = [Builder::Naive, Builder::Atomic].map(|builder| ratios(found, Builder::Cpu, builder, pass));
    let mut evidence = [takes_longer("CPU / naive", &naive), takes_longer("CPU / modified", &modified)].concat();
    if pass == BRUTE {
        let grid = ratios(found, Builder::Cpu, Builder::Atomic, Pass::Rendering(Gather::Grid));
        evidence.extend(undecided("CPU / modified, grid on both", &grid));
    }
    let mut text = format!("The factors are the times of the {} pass on one CPU thread{how}, over those on the GPU.", pass.name());
    if device.is_cpu {
        text += " Here the 'GPU' is a software device on the same CPU.";
    }
    Verdict {
        topic,
        then: format!(
            "CPU takes {} as long as naive, {} as modified",
            times(published.cpu / published.naive),
            times(published.cpu / published.modified)
        ),
        here: format!("{} as long as naive, {} as modified", glance(&naive), glance(&modified)),
        elsewhere: elsewhere(naive.iter().chain(&modified)),
        text,
        evidence,
        ..Verdict::default()
    }
    .decided()
}

pub(super) fn ballot(found: &Reproduction) -> Option<Verdict> {
    let ratios = ratios(found, Builder::Ballot, Builder::Atomic, Pass::Map);
    let speeds_up = ratios.iter().map(|ratio| ratio.interval.below(1.0 / MARGIN));
    let slows_down = ratios.iter().map(|ratio| ratio.interval.above(MARGIN));
    let end = match (Standing::of(speeds_up)?, Standing::of(slows_down)?) {
        (Standing::Holds, _) => "It is faster at every size.",
        (_, Standing::Holds) => "It is slower at every size.",
        (Standing::HoldsInPart, Standing::HoldsInPart) => "It is faster at some sizes and slower at others.",
        (Standing::HoldsInPart, _) => "It is faster at some sizes.",
        (_, Standing::HoldsInPart) => "It is slower at some sizes.",
        (Standing::NoLonger, Standing::NoLonger) => "It makes no difference.",
        _ => "This run does not decide whether it makes a difference at every size.",
    };
    Some(Verdict {
        topic: "One atomic per subgroup instead of one per thread",
        then: "not possible".to_owned(),
        here: glance(&ratios),
        elsewhere: elsewhere(ratios.iter()),
        text: format!(
            "With a ballot, a whole subgroup needs one atomic addition. The factor is the time of this map pass over that with one atomic per thread. {end}"
        ),
        evidence: undecided("ballot / modified", &ratios).collect(),
        ..Verdict::default()
    })
}

pub(super) fn empty_slots(found: &Reproduction) -> Option<Verdict> {
    let at_size = |(photons, bounces): (u32, u32)| {
        let time = found.running_times.iter().find(|time| (time.photons, time.bounces) == (photons, bounces))?;
        let share = time.stored as f64 / (f64::from(photons) * f64::from(bounces));
        // Photons are independent, and each fills a share of its own slots.
        let interval = Interval::of_share(share, f64::from(photons));
        let what = format!("filled slots: {} photons, {bounces} bounces", count(u64::from(photons)));
        Some(Evidence { what, interval, quantity: Quantity::Share, decision: Some(interval.below(0.5)) })
    };
    let evidence: Vec<Evidence> = found.sizes()[..2].iter().filter_map(|size| at_size(*size)).collect();
    let (first, others) = evidence.split_first()?;
    Verdict {
        topic: "Most slots of the naive map stay empty",
        then: "most photons are absorbed early".to_owned(),
        here: format!("{} filled", first.shown()),
        elsewhere: others.first().map(|other| format!("{} with 15 bounces", other.shown())).unwrap_or_default(),
        text: "The naive map reserves a slot for every photon and every bounce. The claim holds where less than half of them are filled."
            .to_owned(),
        evidence,
        ..Verdict::default()
    }
    .decided()
}

pub(super) fn memory(found: &Reproduction) -> Option<Verdict> {
    let on_device = found.running_times.iter().filter(|time| time.implementation.builder != Builder::Cpu);
    let most = on_device.max_by_key(|time| time.photons)?;
    if f64::from(most.photons) < MARGIN * f64::from(published::PHOTONS) {
        return None;
    }
    Some(Verdict {
        topic: "Memory limits a round to about 5000 photons",
        then: "about 5000".to_owned(),
        here: format!("{} photons", count(u64::from(most.photons))),
        text: format!(
            "A round of {} photons and {} bounces was run on the device. A round that exceeds a buffer is split automatically. This is a count and has no interval.",
            count(u64::from(most.photons)),
            most.bounces
        ),
        standing: Some(Standing::NoLonger),
        ..Verdict::default()
    })
}

/// The exponent of time against photons.
fn exponent(points: &[(f64, f64)]) -> Option<Interval> {
    LineFit::of_logarithms(points).map(|line| Interval::of_slope(&line, points.len()))
}

pub(super) fn linear(found: &Reproduction) -> Option<Verdict> {
    let paper = published::TABLE_1.map(|(rounds, ms)| (f64::from(rounds * published::PHOTONS), ms));
    let names = ["by brute force", "with a grid", "with a grid and large rounds"];
    let fits = series(&found.request).into_iter().zip(names).filter_map(|((photons, gather), name)| {
        let points: Vec<(f64, f64)> = found.totals_of(photons, gather).map(TotalTime::point).collect();
        let interval = exponent(&points)?;
        let decision = Some(interval.within(1.0 - LINEAR_WITHIN, 1.0 + LINEAR_WITHIN));
        let what = format!("exponent {name}: {} photons per round", count(u64::from(photons)));
        Some((name, Evidence { what, interval, quantity: Quantity::Exponent, decision }))
    });
    let (names, evidence): (Vec<&str>, Vec<Evidence>) = fits.unzip();
    let values = evidence.iter().zip(&names).map(|(fit, name)| format!("{:.2} {name}", fit.interval.value));
    let elsewhere = list(&values.skip(1).collect::<Vec<_>>());
    let here = format!("exponent {} {}", evidence.first()?.shown(), names[0]);
    Verdict {
        topic: "Time grows in proportion to photons",
        then: format!("exponent {}", Quantity::Exponent.shown(&exponent(&paper)?)),
        here,
        elsewhere,
        text: format!(
            "The exponent is the slope of a straight line through the rows of table 1 on logarithmic scales; \
             exponents from {:.1} to {:.1} count as proportional.",
            1.0 - LINEAR_WITHIN,
            1.0 + LINEAR_WITHIN
        ),
        evidence,
        ..Verdict::default()
    }
    .decided()
}

pub(super) fn table_1(found: &Reproduction) -> Option<Verdict> {
    let (rounds, then_ms) = published::TABLE_1[published::TABLE_1.len() - 1];
    let described: Vec<String> = [("brute force", Gather::Brute), ("grid", Gather::Grid)]
        .into_iter()
        .filter_map(|(name, gather)| {
            let total = found.totals_of(published::PHOTONS, gather).find(|total| total.rounds == rounds)?;
            Some(format!("{} by {name} ({} as fast)", duration(total.best_ms()), times(then_ms / total.best_ms())))
        })
        .collect();
    let photons = count(u64::from(rounds) * u64::from(published::PHOTONS));
    (!described.is_empty()).then(|| Verdict {
        topic: "The longest run of table 1",
        then: duration(then_ms),
        here: list(&described),
        text: format!(
            "{photons} photons in {rounds} rounds. A sorted grid gives a bit-identical image. Each time is one run and has no interval."
        ),
        ..Verdict::default()
    })
}

#[cfg(test)]
mod tests {
    use super::super::all;
    use super::*;
    use crate::measure::paper::sample;

    /// Seven runs that differ by a few percent.
    fn runs(ms: f64, noise: f64) -> Vec<f64> {
        (0..7).map(|run| ms * (noise * (f64::from(run * 3 % 7) - 3.0)).exp()).collect()
    }

    fn with_map_ms(naive: f64, atomic: f64, ballot: f64, noise: f64) -> Reproduction {
        let mut found = sample::reproduction();
        for time in found.running_times.iter_mut().filter(|time| time.pass == Pass::Map) {
            let ms = match time.implementation.builder {
                Builder::Naive => naive,
                Builder::Atomic => atomic,
                Builder::Ballot => ballot,
                Builder::Cpu => 15.0,
                _ => unreachable!("not the paper's"),
            };
            time.runs_ms = runs(ms, noise);
        }
        found
    }

    /// The first size's map pass of one builder takes so long.
    fn with_another_size(mut found: Reproduction, builder: Builder, runs_ms: Vec<f64>) -> Reproduction {
        let mut times = found.running_times.iter_mut();
        times.find(|time| time.pass == Pass::Map && time.implementation.builder == builder).unwrap().runs_ms = runs_ms;
        found
    }

    #[test]
    fn the_append_is_judged_by_the_interval_of_its_ratio() {
        use Standing::{Holds, HoldsInPart, NoLonger, Undecided};
        // The same ratios are not decided by runs that differ more.
        let cases = [(2.0, 0.01, Holds), (1.2, 0.01, Holds), (1.05, 0.01, NoLonger), (0.5, 0.01, NoLonger)];
        for (atomic, noise, standing) in cases.into_iter().chain([(1.2, 0.1, Undecided), (1.05, 0.1, Undecided), (2.0, 0.4, Undecided)]) {
            let verdict = append(&with_map_ms(1.0, atomic, 1.0, noise)).unwrap();
            assert_eq!(verdict.standing, Some(standing), "{verdict:?}");
            let Evidence { interval, .. } = &verdict.evidence[0];
            assert!((interval.value / atomic - 1.0).abs() < 1e-9 && interval.low < atomic && interval.high > atomic, "{interval:?}");
            assert!(verdict.here.contains(" to ") && verdict.then.contains(&times(11.0 / 1.7)), "{verdict:?}");
        }
        // One size of four is as fast, or noisy.
        for (runs, standing) in [(runs(1.0, 0.01), HoldsInPart), (runs(2.0, 0.4), Undecided)] {
            let other = with_another_size(with_map_ms(1.0, 2.0, 1.0, 0.01), Builder::Atomic, runs);
            assert_eq!(append(&other).unwrap().standing, Some(standing));
        }
        let mut two_runs = with_map_ms(1.0, 5.0, 1.0, 0.01);
        two_runs.running_times.iter_mut().for_each(|time| time.runs_ms.truncate(2));
        assert_eq!(append(&two_runs).unwrap().standing, Some(Undecided));
    }

    #[test]
    fn the_ballot_pays_or_not() {
        let text = |ballot_ms: f64, noise: f64| ballot(&with_map_ms(1.0, 1.0, ballot_ms, noise)).unwrap().text;
        assert!(text(0.5, 0.01).ends_with("faster at every size."));
        assert!(text(1.0, 0.01).ends_with("It makes no difference."));
        assert!(text(2.0, 0.01).ends_with("slower at every size."));
        assert!(text(1.0, 0.2).contains("does not decide"));
        let mixed = with_another_size(with_map_ms(1.0, 1.0, 0.5, 0.01), Builder::Ballot, runs(2.0, 0.01));
        assert!(ballot(&mixed).unwrap().text.ends_with("faster at some sizes and slower at others."));
    }

    #[test]
    fn builders_that_were_not_measured_have_no_verdict() {
        let mut found = sample::reproduction();
        found.running_times.retain(|time| time.implementation.builder == Builder::Cpu);
        let topics: Vec<&str> = all(&found).iter().map(|verdict| verdict.topic).collect();
        assert!(
            append(&found).is_none() && packed(&found).is_none() && on_gpu(&found, Pass::Map).is_none() && ballot(&found).is_none(),
            "{topics:?}"
        );
    }

    #[test]
    fn exponents_are_judged_by_their_intervals() {
        let standing = |ms: &dyn Fn(u32) -> f64| {
            let mut found = sample::reproduction();
            for total in &mut found.totals {
                total.gpu_ms = Some(ms(total.rounds));
            }
            linear(&found).unwrap().standing.unwrap()
        };
        assert_eq!(standing(&|rounds| 2130.0 * f64::from(rounds)), Standing::Holds);
        assert_eq!(standing(&|_| 100.0), Standing::NoLonger);
        // Rows that scatter around the line by a factor of 2.
        assert_eq!(standing(&|rounds| f64::from(rounds) * if rounds % 2 == 0 { 2.0 } else { 1.0 }), Standing::Undecided);
        let mut found = sample::reproduction();
        found.totals.retain(|total| total.rounds <= 5);
        assert_eq!(linear(&found).unwrap().standing, Some(Standing::Undecided), "two rows fit every line");
    }

    #[test]
    fn slots_are_judged_by_their_interval() {
        let standing = |share: f64| {
            let mut found = sample::reproduction();
            for time in &mut found.running_times {
                time.stored = (share * f64::from(time.photons) * f64::from(time.bounces)) as u64;
            }
            empty_slots(&found).unwrap().standing.unwrap()
        };
        assert_eq!([0.3, 0.49, 0.7].map(standing), [Standing::Holds, Standing::Undecided, Standing::NoLonger]);
    }

    #[test]
    fn memory_is_judged_by_a_round_that_is_clearly_larger() {
        let mut found = sample::reproduction();
        assert_eq!(memory(&found).unwrap().standing, Some(Standing::NoLonger));
        for time in &mut found.running_times {
            time.photons = published::PHOTONS + 1;
        }
        assert_eq!(memory(&found), None);
    }

    #[test]
    fn a_software_device_is_called_one() {
        let mut found = sample::reproduction();
        assert!(on_gpu(&found, Pass::Map).unwrap().text.contains("software device"));
        found.device.as_mut().unwrap().is_cpu = false;
        assert!(!on_gpu(&found, Pass::Map).unwrap().text.contains("software device"));
    }
}
