//! The straight line: scene, plan, resources, then rounds of photons traced, indexed and estimated.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::cpu;
use crate::error::{Error, Result};
use crate::film::Film;
use crate::gpu::{Commands, Constants, DeviceFacts, Gpu};
use crate::ledger::Fates;
use crate::plan::{Limits, Plan, photons_of};
use crate::records::{Photon, Tally};
use crate::resources::Resources;
use crate::scene::Scene;
use crate::settings::{Gather, Settings, Variant};
use crate::timings::{Clock, Span, Timings};
use crate::{estimate, index, trace};

/// How a caller watches a run and ends it early.
pub struct Control<'a> {
    /// Set from outside to end the run after the photons that are under way.
    pub cancelled: &'a AtomicBool,
    /// Told the photons emitted so far, of how many.
    pub progress: &'a mut dyn FnMut(u64, u64),
}

/// What a run leaves behind.
#[derive(Debug, Clone)]
pub struct Outcome {
    pub plan: Plan,
    pub film: Film,
    pub fates: Fates,
    pub timings: Timings,
    /// `None` for the CPU builder.
    pub device: Option<DeviceFacts>,
    /// The run was ended before its last photon.
    pub cancelled: bool,
    pub dispatches: u64,
    pub submissions: u64,
}

/// Runs on the GPU.
pub fn on_gpu(gpu: &Gpu, scene: &Scene, settings: &Settings, control: &mut Control) -> Result<Outcome> {
    let started = Instant::now();
    let plan = Plan::new(scene, settings, &limits(gpu.facts()))?;
    let mut commands = Commands::new(gpu, constants(&plan), started)?;
    commands.timings().count("run");
    let resources = commands.scope("set-up", |commands| Resources::new(gpu, commands, scene, &plan))?;
    prepare(gpu, &plan)?;
    commands.submit()?;

    let mut run = Run::new(&plan, control);
    for (round, chunk) in units(&plan) {
        let ranges = plan.chunk(chunk);
        let photon_count = photons_of(&ranges);
        commands.scope("round", |commands| {
            trace::chunk(commands, &resources, &plan, round, &ranges)?;
            estimate_chunk(commands, &resources, &plan, photon_count, gpu.facts().int64_atomics)
        })?;
        commands.add_work(plan.pair_tests(scene, photon_count));
        run.emitted += u64::from(photon_count);
        if run.is_due(&commands, &plan) && run.settle(&mut commands, &resources)? {
            break;
        }
    }
    run.settle(&mut commands, &resources)?;
    let (fates, cancelled) = (run.fates, run.cancelled);
    let sums = commands.read::<u64>(&resources.film, plan.points.len() * plan.channel_count as usize)?;
    gpu.check_validation()?;

    let film = Film::new(&plan, sums, fates.emitted);
    let (dispatches, submissions) = (commands.dispatch_count(), commands.submission_count());
    let mut timings = std::mem::take(commands.timings());
    timings.add(Span { name: "run".into(), clock: Clock::Wall, start: Duration::ZERO, duration: started.elapsed() });
    Ok(Outcome { plan, film, fates, timings, device: Some(gpu.facts().clone()), cancelled, dispatches, submissions })
}

/// Density estimation of one chunk, brute or over the grid.
fn estimate_chunk(commands: &mut Commands, resources: &Resources, plan: &Plan, photon_count: u32, int64_atomics: bool) -> Result<()> {
    match &resources.index {
        Some(index) => {
            index::build(commands, resources, index, plan, photon_count)?;
            estimate::gather_grid(commands, resources, index, plan, photon_count, int64_atomics)
        }
        None => estimate::gather_brute(commands, resources, plan, photon_count, int64_atomics),
    }
}

/// Makes the pipelines of the plan, and only those.
fn prepare(gpu: &Gpu, plan: &Plan) -> Result<()> {
    let modules = [trace::modules(plan), index::modules(plan), estimate::modules(plan, gpu)].concat();
    gpu.prepare(&modules, &constants(plan))
}

/// Specialization constants of a plan.
fn constants(plan: &Plan) -> Constants {
    let settings = &plan.settings;
    Constants::new(settings.group_size)
        .set("RNG", settings.rng.code())
        .set("EMISSION_LAW", settings.emission.code())
        .set("HAS_PHONG", u32::from(settings.has_phong()))
        .set("PHONG_DIRECTION", settings.phong_direction.code())
        .set("HAS_SLOTS", u32::from(plan.has_slots()))
        .set("CHANNEL_COUNT", plan.channel_count)
}

/// What the plan may use of a device.
pub fn limits(facts: &DeviceFacts) -> Limits {
    Limits {
        buffer_bytes: facts.storage_buffer_range_bytes.min(facts.allocation_bytes),
        // Half, as the device is not ours alone.
        memory_bytes: facts.device_memory_bytes / 2,
        pair_tests_per_submission: Limits::pair_tests_of(facts.kind),
        group_size: facts.work_group_size,
    }
}

/// (round, chunk) of the whole run, in order.
fn units(plan: &Plan) -> impl Iterator<Item = (u32, u32)> {
    let chunks = plan.chunks_per_round;
    (0..plan.settings.rounds).flat_map(move |round| (0..chunks).map(move |chunk| (round, chunk)))
}

/// Book-keeping of a run between submissions.
struct Run<'a, 'c> {
    control: &'a mut Control<'c>,
    total: u64,
    emitted: u64,
    fates: Fates,
    cancelled: bool,
}

impl<'a, 'c> Run<'a, 'c> {
    fn new(plan: &Plan, control: &'a mut Control<'c>) -> Run<'a, 'c> {
        Run { control, total: plan.settings.total_photons(), emitted: 0, fates: Fates::new(plan.settings.bounces), cancelled: false }
    }

    /// Whether the recorded commands should go to the device now.
    fn is_due(&self, commands: &Commands, plan: &Plan) -> bool {
        // Tallies are 32-bit on the device.
        let untold = self.emitted - self.fates.emitted + u64::from(plan.path_capacity);
        commands.work() >= plan.pair_tests_per_submission
            || commands.timestamps_left() < trace::timestamps_per_chunk(plan)
            || untold > u64::from(u32::MAX)
    }

    /// Runs what is recorded, books the fates of its photons, and says whether to stop.
    fn settle(&mut self, commands: &mut Commands, resources: &Resources) -> Result<bool> {
        if self.emitted == self.fates.emitted {
            return Ok(self.cancelled);
        }
        let bounces = self.fates.bounces.len();
        let tallies: Vec<Tally> = commands.read(&resources.tallies, bounces)?;
        commands.fill(&resources.tallies, 0, 4 * bounces as u64, 0);
        self.book(&tallies)
    }

    fn book(&mut self, tallies: &[Tally]) -> Result<bool> {
        self.fates.add(self.emitted - self.fates.emitted, tallies);
        let ledger = self.fates.ledger();
        if !ledger.closes() || ledger.dropped != 0 {
            return Err(Error::LedgerOpen { ledger });
        }
        (self.control.progress)(self.emitted, self.total);
        self.cancelled = self.emitted < self.total && self.control.cancelled.load(Ordering::Relaxed);
        Ok(self.cancelled)
    }
}

/// Runs on the CPU, on `settings.threads` threads.
pub fn on_cpu(scene: &Scene, settings: &Settings, control: &mut Control) -> Result<Outcome> {
    let settings = Settings { variant: Variant::Cpu, ..settings.clone() };
    let plan = Plan::new(scene, &settings, &Limits::of_host())?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads)
        .build()
        .map_err(|error| Error::setting("--threads", settings.threads, format!("cannot be started ({error}); ask for fewer")))?;
    let started = Instant::now();
    let mut clock = WallClock { started, timings: Timings::default() };
    clock.timings.count("run");
    let mut sums = vec![0u64; plan.points.len() * plan.channel_count as usize];
    let mut run = Run::new(&plan, control);
    for (round, chunk) in units(&plan) {
        let (emitted, tallies) = clock.time("round", |clock| {
            let (photons, tallies) = clock.time("round/build", |clock| trace_on_cpu(&pool, scene, &plan, round, chunk, clock));
            match settings.gather {
                Gather::Brute => clock.time("round/gather", |_| pool.install(|| cpu::estimate::gather_brute(&plan, &photons, &mut sums))),
                Gather::Grid => {
                    let index = clock.time("round/index", |_| cpu::index::Index::build(plan.grid, &photons));
                    clock.time("round/gather", |_| pool.install(|| cpu::estimate::gather_grid(&plan, &index, &mut sums)));
                }
            }
            (photons_of(&plan.chunk(chunk)), tallies)
        });
        run.emitted += u64::from(emitted);
        if run.book(&tallies)? {
            break;
        }
    }
    let (fates, cancelled) = (run.fates, run.cancelled);
    let film = Film::new(&plan, sums, fates.emitted);
    let mut timings = clock.timings;
    timings.add(Span { name: "run".into(), clock: Clock::Wall, start: Duration::ZERO, duration: started.elapsed() });
    Ok(Outcome { plan, film, fates, timings, device: None, cancelled, dispatches: 0, submissions: 0 })
}

/// Photons of a chunk and the fates of its paths, bounce by bounce.
fn trace_on_cpu(pool: &rayon::ThreadPool, scene: &Scene, plan: &Plan, round: u32, chunk: u32, clock: &mut WallClock) -> (Vec<Photon>, Vec<Tally>) {
    let tracer = cpu::trace::Tracer::new(scene, plan);
    let mut paths = clock.time("round/build/emit", |_| tracer.emit(round, &plan.chunk(chunk)));
    let mut photons = Vec::new();
    let mut tallies = Vec::new();
    for bounce in 0..plan.settings.bounces {
        let name = format!("round/build/bounce {}", bounce + 1);
        let bounced = clock.time(&name, |_| pool.install(|| tracer.bounce(&paths, round, bounce)));
        photons.extend(bounced.photons);
        tallies.push(bounced.tally);
        paths = bounced.paths;
    }
    (photons, tallies)
}

/// Timings on the host's clock.
struct WallClock {
    started: Instant,
    timings: Timings,
}

impl WallClock {
    fn time<T>(&mut self, name: &str, body: impl FnOnce(&mut Self) -> T) -> T {
        self.timings.count(name);
        let begin = Instant::now();
        let result = body(self);
        let start = begin.duration_since(self.started);
        self.timings.add(Span { name: name.to_owned(), clock: Clock::Wall, start, duration: begin.elapsed() });
        result
    }
}

/// Photons of one chunk of round 0, as a builder stores them; for comparing builders.
pub fn photons_on_gpu(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Vec<Photon>> {
    let plan = Plan::new(scene, settings, &limits(gpu.facts()))?;
    let mut commands = Commands::new(gpu, constants(&plan), Instant::now())?;
    let resources = Resources::new(gpu, &mut commands, scene, &plan)?;
    let mut photons = Vec::new();
    for chunk in 0..plan.chunks_per_round {
        let ranges = plan.chunk(chunk);
        trace::chunk(&mut commands, &resources, &plan, 0, &ranges)?;
        let capacity = trace::photon_list_capacity(&plan, photons_of(&ranges));
        let length = if plan.has_slots() { capacity } else { commands.read::<u32>(&resources.counters, 1)?[0].min(capacity) };
        let stored = commands.read::<Photon>(&resources.photons, length as usize)?;
        photons.extend(stored.into_iter().filter(|photon| photon.wall != crate::constants::NO_WALL));
    }
    gpu.check_validation()?;
    Ok(photons)
}

/// The same from the CPU builder.
pub fn photons_on_cpu(scene: &Scene, settings: &Settings) -> Result<Vec<Photon>> {
    let plan = Plan::new(scene, settings, &Limits::of_host())?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads)
        .build()
        .map_err(|error| Error::setting("--threads", settings.threads, format!("cannot be started ({error}); ask for fewer")))?;
    let mut clock = WallClock { started: Instant::now(), timings: Timings::default() };
    Ok((0..plan.chunks_per_round).flat_map(|chunk| trace_on_cpu(&pool, scene, &plan, 0, chunk, &mut clock).0).collect())
}
