//! A scene on the GPU.

use std::ops::Range;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use super::film::SceneFilm;
use super::identity::identity;
use super::losses::losses;
use super::map_cache::MapCache;
use super::map_file::MapFile;
use super::map_in_round::{FIRST_TIMED_CHUNK, MapInRound, StoredPhotons, one_cached_map, one_map, one_stored_map};
use super::resources::SceneResources;
use super::{Round, RunResult, Viewpoint, estimate, index, points, radius_class, trace};
use crate::constants::{PART_COUNT, TALLY_COPIES};
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::engine::run::saved::{SavedFilm, SavedRun, WorldFilm};
use crate::engine::run::watch::Lazy;
use crate::engine::run::{self, RunState, Task, World};
use crate::engine::{Control, tallies, totals};
use crate::error::Result;
use crate::gpu::kernels::*;
use crate::gpu::{Commands, Constants, DeviceFacts, Gpu, Interrupt, Kernel, Module};
use crate::ledger::Fates;
use crate::plan::buffers::PART_VALUES;
use crate::plan::film::{BiasPlan, FilmPlan};
use crate::plan::latest_blocks::kept_count;
use crate::plan::scene::ScenePlan;
use crate::plan::sensor::Sensor;
use crate::scene::Camera;
use crate::scene::geometry::Geometry;
use crate::timings::Span;

/// Kernels that the plan needs, and no others. `go_on` is not among them: few camera paths outlast a dispatch, so its pipeline is
/// made at its first use.
pub(crate) fn modules(plan: &ScenePlan, facts: &DeviceFacts) -> Vec<Module> {
    let traces = if plan.maps().next().is_some() { trace::modules(plan) } else { Vec::new() };
    [of_film(plan, facts), traces].concat()
}

/// The same without those that trace photons.
fn of_film(plan: &ScenePlan, facts: &DeviceFacts) -> Vec<Module> {
    let mut modules = vec![Resolve::MODULE];
    modules.push(match plan.sensor {
        Sensor::Picture { .. } => CameraPaths::MODULE,
        Sensor::Receivers { .. } => Receive::MODULE,
    });
    if plan.maps().next().is_some() {
        modules.extend([DensePointsSize::MODULE, FluxToRadiance::MODULE]);
        modules.extend(index::modules());
        modules.push(if facts.int64_atomics { GatherVisiblePointsU64::MODULE } else { GatherVisiblePointsTwoWords::MODULE });
        if plan.film.bias == BiasPlan::Blocks {
            modules.push(EndDifference::MODULE);
        }
        if plan.cuts_discs() {
            modules.push(DiscCuts::MODULE);
        }
        if plan.has_classes() {
            modules.extend(radius_class::modules());
        }
    }
    modules
}

/// Specialization constants of a plan.
pub(crate) fn constants(plan: &ScenePlan) -> Constants {
    plan.constants.iter().fold(Constants::new(plan.settings.group_size), |constants, (name, value)| constants.set(name, *value))
}

/// Timestamps that a round may need.
const TIMESTAMPS_PER_ROUND: u32 = 64;

pub(crate) struct SceneOnGpu<'a> {
    geometry: &'a Geometry,
    /// Of a picture.
    camera: Option<Camera>,
    plan: &'a ScenePlan,
    pub(super) resources: SceneResources,
    /// Grids that the points of the global and of the caustic map need, each by the classes of radii that it serves.
    /// `None` until they are known.
    grids: Option<[Vec<Range<u32>>; 2]>,
    /// Photons that are not traced but read; `None` where they are traced.
    stored: Option<StoredPhotons<'a>>,
    /// Maps of this run that are kept to be looked at again; `None` where nobody does.
    pub(super) cache: Option<MapCache>,
    /// Photons that a chunk of the global and of the caustic map may have where time may be up.
    timed_chunks: [u32; 2],
    /// A round was cut short, of which parts of light may have come to that of the block under way.
    is_cut: bool,
    cancelled: &'a AtomicBool,
}

/// Runs all rounds of a plan; progress is reported in rounds.
pub(crate) fn light(gpu: &Gpu, viewpoint: &Viewpoint, plan: ScenePlan, control: &mut Control) -> Result<RunResult> {
    light_from(gpu, viewpoint, plan, None, control)
}

/// The same with photons from a file, for which the plan must be made ([`MapFile::plan`]).
pub(crate) fn light_from(
    gpu: &Gpu,
    viewpoint: &Viewpoint,
    plan: ScenePlan,
    map: Option<&MapFile>,
    control: &mut Control,
) -> Result<RunResult> {
    let started = Instant::now();
    let modules = if map.is_some() { of_film(&plan, gpu.facts()) } else { modules(&plan, gpu.facts()) };
    let mut commands = run::commands(gpu, &modules, constants(&plan), plan.settings.math, started)?;
    let trial = plan.trial.as_ref().map(|trial| ("trial", Duration::from_secs_f64(trial.seconds)));
    for (name, duration) in [("plan", plan.planned_in)].into_iter().chain(trial) {
        commands.timings().count(name);
        commands.timings().add(Span::of_host(name, Duration::ZERO, duration));
    }
    let resources = commands.scope("set-up", |commands| SceneResources::new(commands, viewpoint.geometry, &plan, viewpoint.phases))?;
    commands.warm_up()?;
    commands.submit()?;
    let identity =
        control.checkpointing.identity(|name| identity(name, viewpoint, &plan, map.map(|map| map.hash.as_str()), gpu.facts()))?;
    let task = Task { identity, ..task(viewpoint.geometry, &plan) };
    control.checkpointing.check_resumed(|saved| can_go_on(saved, &plan, &task))?;
    let none = || [Fates::of_scene(plan.settings.bounces), Fates::of_scene(plan.settings.bounces)];
    let stored = map.map(|file| StoredPhotons { file, open: none(), open_of_blocks: none() });
    let mut world =
        SceneOnGpu { stored, ..SceneOnGpu::new(viewpoint.geometry, viewpoint.camera.cloned(), &plan, resources, control.cancelled) };
    if plan.has_classes() && control.checkpointing.begins_later() {
        world.find_radii(&mut commands)?;
    }
    if let Some((_, saved)) = &control.checkpointing.resume {
        world.resources.film.restore(&mut commands, SceneFilm::of(&saved.film))?;
    }
    run::run(world, commands, &plan, task, control)
}

/// Whether the buffers of a plan take what was saved.
fn can_go_on(saved: &SavedRun, plan: &ScenePlan, task: &Task<SceneFilm>) -> bool {
    let SavedFilm::Scene(film) = &saved.film else { return false };
    let read_alike = |film: &FilmPlan| (film.bias, film.sees_light, film.rounds_per_block);
    let pixels = plan.sensor.pixels() as usize;
    saved.has_lengths(&task.fates, 3 * pixels, PART_VALUES as usize * kept_count(pixels))
        && read_alike(&film.plan) == read_alike(&plan.film)
        && film.parts.is_some() == plan.keeps_parts()
        && film.part_totals.len() == PART_COUNT as usize
}

/// What a run of a plan is to do.
pub(crate) fn task<'a>(geometry: &'a Geometry, plan: &'a ScenePlan) -> Task<'a, SceneFilm> {
    let photons_per_round = plan.traced_maps().map(|map| u64::from(map.photons)).sum();
    Task {
        identity: None,
        sensor: Some(plan.sensor),
        stop: plan.settings.stop,
        alpha: plan.settings.alpha,
        rounds: plan.settings.rounds,
        rounds_per_block: plan.film.rounds_per_block,
        bounces: plan.settings.bounces,
        photons_per_round,
        parts_per_round: 1,
        photons_per_part: photons_per_round,
        counts_photons: false,
        // Of the global map and of the caustic map.
        fates: vec![Fates::of_scene(plan.settings.bounces); 2],
        can_go_on: true,
        error: Box::new(|film| film.error(plan.film.confidence)),
        losses: Box::new(|film, fates| losses(geometry, plan, fates, film)),
    }
}

impl<'a> World for SceneOnGpu<'a> {
    type Recorder = Commands<'a>;
    type Film = SceneFilm;

    /// There must be a first round: when the time is up in it, it ends with the photons that it has by then.
    fn trace(&mut self, commands: &mut Commands<'a>, state: &mut RunState<SceneFilm>, _: u32) -> Result<()> {
        let deadline = state.deadline();
        let is_first = state.rounds() == 0;
        commands.set_interrupt(Some(Interrupt { cancelled: self.cancelled, deadline: deadline.filter(|_| !is_first) }));
        let traced = self.one_round(commands, deadline.filter(|_| is_first), state);
        commands.set_interrupt(None);
        self.is_cut = traced.is_err();
        traced
    }

    fn is_full(&self, commands: &Commands<'a>) -> bool {
        commands.timestamps_left() < TIMESTAMPS_PER_ROUND || commands.is_full(self.plan.work_per_submission / 2)
    }

    fn end_block(&mut self, commands: &mut Commands<'a>, _: &RunState<SceneFilm>) -> Result<()> {
        if let Some(StoredPhotons { open, open_of_blocks, .. }) = &mut self.stored {
            open_of_blocks.clone_from(open);
        }
        let SceneResources { film, photons, .. } = &self.resources;
        film.end_block(commands);
        for which in self.plan.maps().map(|map| usize::from(map.caustic_only)) {
            let photons = photons.as_ref().expect("maps have photons");
            commands.copy(&photons.tallies[which], &photons.tallies_of_blocks[which], photons.tallies[which].count());
            commands.copy(&photons.totals[which], &photons.totals_of_blocks[which], photons.totals[which].count());
        }
        Ok(())
    }

    fn collect(&mut self, commands: &mut Commands<'a>, state: &mut RunState<SceneFilm>) -> Result<()> {
        let Some(photons) = &self.resources.photons else { return commands.submit() };
        if let Some(StoredPhotons { open, open_of_blocks, .. }) = &mut self.stored {
            commands.submit()?;
            let none = Fates::of_scene(self.plan.settings.bounces);
            for which in self.plan.maps().map(|map| usize::from(map.caustic_only)) {
                let all = std::mem::replace(&mut open[which], none.clone());
                state.count(which, all, std::mem::replace(&mut open_of_blocks[which], none.clone()));
            }
            return Ok(());
        }
        let copies = (self.plan.tally_rows() * TALLY_COPIES) as usize;
        let mut read_backs = Vec::new();
        for which in self.plan.maps().map(|map| usize::from(map.caustic_only)) {
            let (tallies, totals) = (&photons.tallies[which], &photons.totals[which]);
            for (tallies, totals) in [(tallies, totals), (&photons.tallies_of_blocks[which], &photons.totals_of_blocks[which])] {
                read_backs.push((commands.copy_out(tallies, copies)?, commands.copy_out(totals, totals::WORDS as usize)?));
            }
            commands.clear(tallies);
            commands.clear(totals);
        }
        commands.submit()?;
        let mut counted = read_backs
            .into_iter()
            .map(|(tallies, totals)| Fates::counted(&tallies::sums(&tallies.take()), Some(totals::sum(&totals.take()))));
        for which in self.plan.maps().map(|map| usize::from(map.caustic_only)) {
            let (all, of_blocks) = (counted.next().expect("each map is read"), counted.next().expect("each map is read twice"));
            let counted = [all, of_blocks];
            let [all, of_blocks] = match &mut self.cache {
                Some(cache) => cache.fates(which, counted),
                None => counted,
            };
            state.count(which, all, of_blocks);
        }
        Ok(())
    }

    fn film(&mut self, commands: &mut Commands<'a>, state: &RunState<SceneFilm>) -> Result<Lazy<SceneFilm>> {
        self.resources.film.read(commands, self.plan, state, self.is_cut)
    }

    fn nonfinite_values(&mut self, commands: &mut Commands<'a>) -> Result<Option<NonfiniteValues>> {
        NonfiniteValues::found(commands, &self.resources.nonfinite_values, self.plan.settings.paranoid)
    }
}

impl<'a> SceneOnGpu<'a> {
    /// That traces its photons and keeps none of them.
    pub(super) fn new(
        geometry: &'a Geometry,
        camera: Option<Camera>,
        plan: &'a ScenePlan,
        resources: SceneResources,
        cancelled: &'a AtomicBool,
    ) -> SceneOnGpu<'a> {
        let grids = (!plan.has_classes()).then(|| [radius_class::one_grid(), radius_class::one_grid()]);
        let timed_chunks = [FIRST_TIMED_CHUNK; 2];
        SceneOnGpu { geometry, camera, plan, resources, grids, stored: None, cache: None, timed_chunks, is_cut: false, cancelled }
    }

    /// Looks from somewhere else, at the light of round 0 first: the film is empty, and the photons that are kept stay.
    pub(super) fn look_from(&mut self, commands: &mut Commands, camera: Camera) {
        self.camera = Some(camera);
        self.grids = self.grids.take().filter(|_| !self.plan.has_classes());
        self.resources.film.clear(commands);
    }

    /// Finds the radii of visible points, which those of round 0 decide, where that round is not the first to be done.
    fn find_radii(&mut self, commands: &mut Commands) -> Result<()> {
        let SceneOnGpu { geometry, camera, plan, resources, grids, .. } = self;
        if resources.photons.is_none() {
            return Ok(());
        }
        let round = Round { resources, geometry, plan, number: 0 };
        *grids = Some(commands.scope("radii", |commands| {
            points::see(commands, round, camera.as_ref())?;
            radius_class::find(commands, round, camera.as_ref())
        })?);
        // Nothing of what was seen counts.
        resources.film.forget_seen(commands);
        Ok(())
    }

    /// One round. When its time is up, it takes no further chunk of photons.
    fn one_round(&mut self, commands: &mut Commands, deadline: Option<Instant>, state: &mut RunState<SceneFilm>) -> Result<()> {
        let SceneOnGpu { geometry, camera, plan, resources, grids, stored, cache, timed_chunks, .. } = self;
        let camera = camera.as_ref();
        let round = Round { resources, geometry, plan, number: state.round() };
        commands.scope("visible points", |commands| points::see(commands, round, camera))?;
        if resources.photons.is_some() {
            let sums = 3 * u64::from(plan.visible_points()) * u64::from(plan.arrival_sets);
            commands.fill(&resources.estimates, 0, sums, 0);
        }
        if plan.traced_maps().next().is_some() {
            if plan.film.bias == BiasPlan::Blocks {
                commands.fill(&resources.near_sums, 0, plan.near_sums(), 0);
            }
            let grids = match grids {
                Some(grids) => grids,
                None => grids.insert(commands.scope("radii", |commands| radius_class::find(commands, round, camera))?),
            };
            let mut traced = [0; 2];
            for map in plan.traced_maps() {
                let in_round = MapInRound { map, grids: &grids[usize::from(map.caustic_only)] };
                let is_cached = cache.as_mut().is_some_and(|cache| cache.begin(round.number, map));
                let of_map = commands.scope(map.name, |commands| {
                    if plan.cuts_discs() {
                        commands.scope("cuts", |commands| estimate::cut_discs(commands, round, map))?;
                    }
                    match (&mut *stored, &mut *cache) {
                        (Some(stored), _) => one_stored_map(commands, round, &in_round, stored, state),
                        (_, Some(cache)) if is_cached => one_cached_map(commands, round, &in_round, cache, state),
                        (_, cache) => {
                            let timed_chunk = &mut timed_chunks[usize::from(map.caustic_only)];
                            one_map(commands, round, &in_round, deadline, timed_chunk, cache.as_mut(), state)
                        }
                    }
                })?;
                traced[usize::from(map.caustic_only)] = of_map;
            }
            commands.scope("flux to radiance", |commands| estimate::flux_to_radiance(commands, round, traced))?;
        }
        // What is on the film counts, whatever ends the run from here on.
        commands.set_interrupt(None);
        commands.scope("resolve", |commands| {
            if plan.film.bias == BiasPlan::Blocks && state.ends_block() {
                estimate::end_difference(commands, round)?;
            }
            estimate::resolve(commands, round, state.ends_block())
        })
    }
}
