//! The paper's times, measured again: both passes by builder (section 4.3), and the whole run by
//! photon count (table 1).

use super::bench::Bench;
use super::{PaperRequest, Reproduction, published};
use crate::engine::room::RunResult;
use crate::error::Result;
use crate::output::words::{self, lower_case};
use crate::render::RenderRequest;
use crate::render::image::command_line;
use crate::render::values::{Threads, Variant};
use crate::settings::{Builder, Gather, Preset, RoomSettings};
use crate::text::counted;
use crate::timings::{Clock, Spread};

/// Who builds the photon map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Implementation {
    pub builder: Builder,
    /// Threads of the CPU builder.
    pub threads: usize,
}

impl Implementation {
    pub(crate) fn of(builder: Builder) -> Implementation {
        Implementation { builder, threads: 1 }
    }

    pub(crate) fn name(self) -> String {
        match self.threads {
            1 => self.builder.name().to_owned(),
            threads => format!("{} x{threads}", self.builder.name()),
        }
    }

    /// The same in the paper's words.
    pub(crate) fn described(self) -> String {
        match self.builder {
            Builder::Naive => "naive (slots)".to_owned(),
            Builder::Atomic => "modified (atomic)".to_owned(),
            Builder::Cpu => format!("CPU, {}", counted(self.threads, "thread")),
            builder => builder.name().to_owned(),
        }
    }
}

/// One combination of section 4.3's comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Case {
    pub photons: u32,
    pub bounces: u32,
    pub implementation: Implementation,
    pub gather: Gather,
}

/// The paper's two passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pass {
    /// Emission and bounces: the photon map.
    Map,
    /// Density estimation at every point of the mesh, building the grid included where there is one.
    Rendering(Gather),
}

impl Pass {
    pub(crate) const ALL: [Pass; 3] = [Pass::Map, Pass::Rendering(Gather::Brute), Pass::Rendering(Gather::Grid)];

    pub(crate) fn name(self) -> &'static str {
        if self == Pass::Map { "map" } else { "rendering" }
    }

    /// `None` for the map pass, which comes before any gathering.
    pub(crate) fn gather(self) -> Option<Gather> {
        match self {
            Pass::Map => None,
            Pass::Rendering(gather) => Some(gather),
        }
    }
}

/// One pass of one case, measured.
#[derive(Debug, Clone)]
pub(crate) struct RunningTime {
    pub photons: u32,
    pub bounces: u32,
    pub implementation: Implementation,
    pub pass: Pass,
    pub clock: Clock,
    pub ms: Spread,
    /// Every run that counts.
    pub runs_ms: Vec<f64>,
    /// Photons that the map holds.
    pub stored: u64,
    pub command: String,
}

/// A whole run, for table 1.
#[derive(Debug, Clone)]
pub(crate) struct TotalTime {
    pub photons_per_round: u32,
    pub rounds: u32,
    pub gather: Gather,
    /// Rounds on the device; `None` on the CPU builder and on devices without timestamps.
    pub gpu_ms: Option<f64>,
    /// The run from its first buffer to its film.
    pub wall_ms: f64,
    pub command: String,
}

/// An experiment that was not run because it would take too long, and its predicted time.
#[derive(Debug, Clone)]
pub(crate) struct LeftOut {
    pub what: String,
    pub predicted_ms: f64,
}

/// A rendering pass that is predicted to take longer is left out.
pub(crate) const LONGEST_PASS_MS: f64 = 20_000.0;
/// A row that is shorter is run once before it counts, as it makes pipelines.
const SHORT_TOTAL_MS: f64 = 1_000.0;
/// Runs that count at the large size, at most.
pub(crate) const LARGE_REPEATS: usize = 3;
const BOUNCES: [u32; 2] = [published::BOUNCES, 15];

/// Experiments that [`running_times`] and [`totals`] will announce, unless some are left out.
pub(crate) fn count(bench: &Bench, request: &PaperRequest) -> usize {
    cases(bench, request).len() + series(request).len() * published::TABLE_1.len()
}

impl Case {
    fn request(&self) -> RenderRequest {
        let Implementation { builder, threads } = self.implementation;
        let (variant, threads) = (Some(Variant::Of(builder)), Some(Threads(threads)));
        let (photons, bounces, gather) = (Some(self.photons), Some(self.bounces), Some(self.gather));
        RenderRequest { variant, threads, photons, bounces, gather, ..RenderRequest::default() }
    }

    fn title(&self) -> String {
        let Case { photons, bounces, implementation, gather } = self;
        format!(
            "{} photons, {bounces} bounces, {}, {} gather",
            words::count(u64::from(*photons)),
            implementation.name(),
            lower_case(*gather)
        )
    }
}

/// What repeats an experiment.
pub(crate) fn command(request: &RenderRequest) -> String {
    command_line("", &request.brief(), &[])
}

/// Small before large, as the small ones predict the large.
fn cases(bench: &Bench, request: &PaperRequest) -> Vec<Case> {
    // The paper's two, and its second with one atomic per subgroup.
    let on_gpu = [Builder::Naive, Builder::Atomic, Builder::Ballot].map(Implementation::of);
    let mut implementations = if bench.has_gpu() { on_gpu.to_vec() } else { Vec::new() };
    implementations.push(Implementation::of(Builder::Cpu));
    if request.threads > 1 {
        implementations.push(Implementation { builder: Builder::Cpu, threads: request.threads });
    }
    let mut cases = Vec::new();
    for (photons, bounces) in sizes(request) {
        for gather in [Gather::Grid, Gather::Brute] {
            let too_much = photons == request.large && gather == Gather::Brute && bounces != published::BOUNCES;
            if !too_much {
                cases.extend(implementations.iter().map(|&implementation| Case { photons, bounces, implementation, gather }));
            }
        }
    }
    cases
}

/// (photons, bounces) of all cases, in order.
fn sizes(request: &PaperRequest) -> [(u32, u32); 4] {
    let [few, many] = BOUNCES;
    let (small, large) = (published::PHOTONS, request.large);
    [(small, few), (small, many), (large, few), (large, many)]
}

/// Both passes of every case. Builders are measured in turn, the GPU's apart from the CPU's, during which a card idles.
pub(crate) fn running_times(bench: &mut Bench, found: &mut Reproduction) -> Result<()> {
    let all = cases(bench, &found.request);
    let alike = |a: &Case, b: &Case| {
        (a.photons, a.bounces, a.gather, a.implementation.builder == Builder::Cpu)
            == (b.photons, b.bounces, b.gather, b.implementation.builder == Builder::Cpu)
    };
    for group in all.chunk_by(alike) {
        let mut measured = Vec::new();
        for case in group {
            bench.begin(&case.title())?;
            match predicted(case, found).filter(|ms| *ms > LONGEST_PASS_MS) {
                Some(predicted_ms) => found.passes_left_out.push(LeftOut { what: case.title(), predicted_ms }),
                None => measured.push(case),
            }
        }
        let is_large = group[0].photons == found.request.large;
        let repeats = if is_large { found.request.repeats.min(LARGE_REPEATS) } else { found.request.repeats };
        let settings: Vec<RoomSettings> = measured.iter().map(|case| case.request().room_settings()).collect();
        let results = bench.repeat_interleaved(&settings, repeats)?;
        for (case, results) in measured.iter().zip(&results) {
            let command = command(&case.request());
            // The map does not depend on the gather, and is timed where the gather disturbs least.
            let map = (case.gather == Gather::Grid).then_some(Pass::Map);
            let passes = map.into_iter().chain([Pass::Rendering(case.gather)]);
            found.running_times.extend(passes.filter_map(|pass| running_time(case, pass, results, &command)));
        }
    }
    Ok(())
}

/// `None` on a device without timestamps: passes inside a submission are not seen by the host.
fn running_time(case: &Case, pass: Pass, results: &[RunResult], command: &str) -> Option<RunningTime> {
    // Brute force has no index, nor has the CPU builder's splatting.
    let scopes: &[&str] = if pass == Pass::Map { &["round/build"] } else { &["round/index", "round/gather"] };
    let sum = |result: &RunResult| {
        let has_run = |scope: &&&str| result.timings.row(scope).is_some();
        scopes.iter().filter(has_run).map(|scope| result.timings.best_ms(scope)).sum::<Option<f64>>()
    };
    let first = results.first()?;
    let runs_ms = results.iter().map(sum).collect::<Option<Vec<f64>>>()?;
    Some(RunningTime {
        photons: case.photons,
        bounces: case.bounces,
        implementation: case.implementation,
        pass,
        clock: if first.device.is_some() { Clock::Gpu } else { Clock::Wall },
        ms: Spread::of(runs_ms.clone())?,
        runs_ms,
        stored: first.ledger().stored,
        command: command.to_owned(),
    })
}

/// Length of the rendering pass at another size: pair tests grow with the photon list, and those a
/// second are known from the paper's size.
fn predicted(case: &Case, found: &Reproduction) -> Option<f64> {
    let known = found.running_time(published::PHOTONS, case.bounces, case.implementation, Pass::Rendering(case.gather))?;
    Some(known.ms.median * f64::from(case.photons) / f64::from(published::PHOTONS))
}

/// (photons of a round, gather) of the rows of table 1.
pub(crate) fn series(request: &PaperRequest) -> [(u32, Gather); 3] {
    [(published::PHOTONS, Gather::Brute), (published::PHOTONS, Gather::Grid), (request.large, Gather::Grid)]
}

pub(crate) fn row_of_table_1(builder: Builder, photons: u32, rounds: u32, gather: Gather) -> RenderRequest {
    let (preset, variant) = (Some(Preset::Rounds), Some(Variant::Of(builder)));
    RenderRequest { preset, variant, photons: Some(photons), rounds: Some(rounds), gather: Some(gather), ..RenderRequest::default() }
}

/// Whole runs of table 1's rounds.
pub(crate) fn totals(bench: &mut Bench, found: &mut Reproduction) -> Result<()> {
    for (photons, gather) in series(&found.request) {
        // Wall time of a round, by the latest row.
        let mut a_round = None;
        for (rounds, _) in published::TABLE_1 {
            let request = row_of_table_1(bench.available(Builder::Atomic), photons, rounds, gather);
            let settings = request.room_settings();
            let title = format!(
                "{} photons as {} of {}, {} gather",
                words::count(settings.total_photons()),
                counted(rounds, "round"),
                words::count(u64::from(photons)),
                lower_case(gather)
            );
            bench.begin(&title)?;
            if let Some(predicted_ms) = a_round.map(|ms| ms * f64::from(rounds)).filter(|ms| *ms > found.request.longest_ms) {
                found.totals_left_out.push(LeftOut { what: title, predicted_ms });
                continue;
            }
            if a_round.is_none_or(|ms| ms * f64::from(rounds) < SHORT_TOTAL_MS) {
                // It makes pipelines.
                bench.run(&settings)?;
            }
            let result = bench.run(&settings)?;
            let row = |name: &str| result.timings.row(name);
            let wall_ms = row("run").and_then(|row| row.wall_ms).expect("a run has its wall time");
            let gpu_ms = row("round").and_then(|row| row.gpu_ms);
            a_round = Some(wall_ms / f64::from(rounds));
            let command = command(&request);
            found.totals.push(TotalTime { photons_per_round: photons, rounds, gather, gpu_ms, wall_ms, command });
        }
    }
    Ok(())
}

impl Reproduction {
    pub(crate) fn running_time(&self, photons: u32, bounces: u32, implementation: Implementation, pass: Pass) -> Option<&RunningTime> {
        let wanted = (photons, bounces, implementation, pass);
        self.running_times.iter().find(|time| (time.photons, time.bounces, time.implementation, time.pass) == wanted)
    }

    /// (photons, bounces) that were measured, in order.
    pub(crate) fn sizes(&self) -> [(u32, u32); 4] {
        sizes(&self.request)
    }

    /// Builders that were measured, in order.
    pub(crate) fn implementations(&self) -> Vec<Implementation> {
        let mut implementations = Vec::new();
        for time in &self.running_times {
            if !implementations.contains(&time.implementation) {
                implementations.push(time.implementation);
            }
        }
        implementations
    }

    /// Rows of table 1 with one size of round and one gather.
    pub(crate) fn totals_of(&self, photons_per_round: u32, gather: Gather) -> impl Iterator<Item = &TotalTime> {
        self.totals.iter().filter(move |total| (total.photons_per_round, total.gather) == (photons_per_round, gather))
    }
}

impl RunningTime {
    /// What the paper measured for the same: two bounces, brute force.
    pub(crate) fn published_ms(&self) -> Option<f64> {
        let comparable = self.photons == published::PHOTONS
            && self.bounces == published::BOUNCES
            && self.implementation.threads == 1
            && self.pass != Pass::Rendering(Gather::Grid);
        let passes = if self.pass == Pass::Map { published::MAP_MS } else { published::RENDERING_MS };
        match self.implementation.builder {
            _ if !comparable => None,
            Builder::Naive => Some(passes.naive),
            Builder::Atomic => Some(passes.modified),
            Builder::Cpu => Some(passes.cpu),
            _ => None,
        }
    }
}

impl TotalTime {
    pub(crate) fn photons(&self) -> u64 {
        u64::from(self.photons_per_round) * u64::from(self.rounds)
    }

    /// Photons and milliseconds, for charts and fits.
    pub(crate) fn point(&self) -> (f64, f64) {
        (self.photons() as f64, self.best_ms())
    }

    /// The device's time, else the host's.
    pub(crate) fn best_ms(&self) -> f64 {
        self.gpu_ms.unwrap_or(self.wall_ms)
    }

    /// What the paper measured for the same rounds.
    pub(crate) fn published_ms(&self) -> Option<f64> {
        let is_same = |rounds: u32| (self.photons_per_round, self.rounds) == (published::PHOTONS, rounds);
        published::TABLE_1.into_iter().find_map(|(rounds, ms)| is_same(rounds).then_some(ms))
    }
}
