//! The one loop over rounds, of every run: until something ends it, with the fate of every photon.

pub mod blocks;
pub(crate) mod identity;
mod recorder;
mod result;
pub(crate) mod retry;
pub(crate) mod saved;
pub(crate) mod several_devices;
mod state;
pub mod watch;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

pub(crate) use recorder::Recorder;
pub use result::RunResult;
pub(crate) use state::RunState;

use crate::engine::error::bound::FilmError;
use crate::engine::nonfinite_values::NonfiniteValues;
use crate::error::{Error, Result};
use crate::gpu::check::strict_math;
use crate::gpu::{Commands, Constants, Gpu, Module};
use crate::ledger::{Fates, Losses};
use crate::plan::sensor::Sensor;
use crate::settings::Math;
use crate::settings::stop::Stop;
use identity::Identity;
use saved::WorldFilm;
use watch::{Control, End, Lazy};

/// What a run of a world is to do, on one device or several, and what its film shows.
pub(crate) struct Task<'a, Film> {
    /// Of a run that is kept.
    pub identity: Option<Identity>,
    /// `None` for the paper's box.
    pub sensor: Option<Sensor>,
    pub stop: Stop,
    /// How fast the radius shrinks; 1 keeps it.
    pub alpha: f64,
    pub rounds: u32,
    pub rounds_per_block: u32,
    pub bounces: u32,
    /// Of all maps.
    pub photons_per_round: u64,
    /// Parts of a round after each of which a run may end.
    pub parts_per_round: u32,
    /// At most.
    pub photons_per_part: u64,
    /// Whether progress is counted in photons, not in rounds.
    pub counts_photons: bool,
    /// Of each map.
    pub fates: Vec<Fates>,
    /// Whether what is done can be gone on with: sums of floats cannot.
    pub can_go_on: bool,
    pub error: Box<dyn Fn(&Film) -> FilmError + 'a>,
    pub losses: LossesOf<'a, Film>,
}

/// Light that limits kept from a film.
type LossesOf<'a, Film> = Box<dyn Fn(&Film, &[Fates]) -> Losses + 'a>;

/// What is lit: the paper's box or a scene, on a device or on the CPU.
pub(crate) trait World {
    type Recorder: Recorder;
    type Film: WorldFilm;

    /// Records a part of the round under way, and reports its photons to `state`. Fails with [`Error::Interrupted`] where the round
    /// was cut short and nothing of it counts.
    fn trace(&mut self, recorder: &mut Self::Recorder, state: &mut RunState<Self::Film>, part: u32) -> Result<()>;
    /// The round that was recorded is the last of its block: notes what counts of it, as what follows may be cut short.
    fn end_block(&mut self, recorder: &mut Self::Recorder, state: &RunState<Self::Film>) -> Result<()>;
    /// Whether what is recorded must run now, as there is no room for another part, or it would take long.
    fn is_full(&self, recorder: &Self::Recorder) -> bool;
    /// Runs what is recorded and counts the fates of its photons.
    fn collect(&mut self, recorder: &mut Self::Recorder, state: &mut RunState<Self::Film>) -> Result<()>;
    /// What all whole blocks have left, or where there is none, all photons so far. It is copied from the device, and made of the copies
    /// when it is wanted, by whom it may be.
    fn film(&mut self, recorder: &mut Self::Recorder, state: &RunState<Self::Film>) -> Result<Lazy<Self::Film>>;
    /// What `--paranoid` found; `None` without it.
    fn nonfinite_values(&mut self, recorder: &mut Self::Recorder) -> Result<Option<NonfiniteValues>>;
}

/// A run under way: a world that is set up, what its rounds are recorded with, and how far it has come.
pub(crate) struct Run<'a, W: World> {
    pub world: W,
    pub recorder: W::Recorder,
    pub state: RunState<'a, W::Film>,
}

impl<'a, W: World> Run<'a, W> {
    /// Goes on with what was saved, if anything was.
    pub(crate) fn new(world: W, recorder: W::Recorder, task: Task<'a, W::Film>, control: &mut Control) -> Result<Run<'a, W>> {
        let state = RunState::new(task, &recorder, control)?;
        let mut run = Run { world, recorder, state };
        // What was saved may be enough, or have to be handed over.
        let state = &run.state;
        if state.end.is_none() && (state.hands_over || state.watch.may_end(state.blocks(), state.emitted)) {
            run.state.pause(&mut run.world, &mut run.recorder, control)?;
        }
        Ok(run)
    }

    pub(crate) fn has_ended(&self) -> bool {
        self.state.end.is_some()
    }

    /// One more round, of a run that has not ended.
    pub(crate) fn round(&mut self, control: &mut Control) -> Result<()> {
        let Run { world, recorder, state } = self;
        let mut is_cut = false;
        let round = recorder.round(|recorder| {
            for part in 0..state.task.parts_per_round {
                if part > 0 && state.pause(world, recorder, control)? {
                    is_cut = true;
                    return Ok(());
                }
                world.trace(recorder, state, part)?;
            }
            state.end_round(world, recorder)
        });
        match round {
            // A round cut short is no part of the film; without a first round there is none.
            Err(Error::Interrupted) if state.rounds() > 0 => {
                state.collect(world, recorder, true)?;
                state.end = Some(if control.cancelled.load(Ordering::Relaxed) { End::Cancelled } else { End::Time });
                (control.progress)(&state.progress());
            }
            Err(error) => return Err(error),
            Ok(()) if is_cut => {}
            Ok(()) => {
                state.pause(world, recorder, control)?;
            }
        }
        Ok(())
    }

    /// One more round, unless all have been, of a run that is looked at between two of its rounds: runs what is recorded and counts the
    /// fates of its photons.
    pub(crate) fn round_to_look_at(&mut self, cancelled: &AtomicBool) -> Result<()> {
        if !self.has_ended() {
            self.round(&mut Control::quiet(cancelled))?;
            self.state.collect(&mut self.world, &mut self.recorder, false)?;
        }
        Ok(())
    }

    /// What all whole blocks have left.
    pub(crate) fn film(&mut self) -> Result<W::Film> {
        Ok(self.world.film(&mut self.recorder, &self.state)?())
    }

    /// The same with its error as reported to users.
    pub(crate) fn look(&mut self) -> Result<(W::Film, FilmError)> {
        let film = self.film()?;
        let error = (self.state.task.error)(&film).stated();
        Ok((film, error))
    }

    /// Begins anew from round 0, with a world that knows nothing of the rounds before.
    pub(crate) fn begin_anew(&mut self, task: Task<'a, W::Film>, control: &mut Control) -> Result<()> {
        self.state = RunState::new(task, &self.recorder, control)?;
        Ok(())
    }

    /// What a run that has ended leaves behind.
    fn result<Plan: Clone>(self, plan: &Plan, control: &mut Control) -> Result<RunResult<Plan, W::Film>> {
        let Run { mut world, mut recorder, state } = self;
        let film = world.film(&mut recorder, &state)?();
        if let Some(save) = control.checkpointing.save.as_mut().filter(|_| !state.done.is_empty()) {
            save.save(&Arc::new(state.to_be_saved()(film.clone().into())), true)?;
        }
        let nonfinite_values = world.nonfinite_values(&mut recorder)?;
        let device = recorder.device();
        if let Some((gpu, _)) = device {
            gpu.check_validation()?;
        }
        let [dispatches, submissions] = recorder.counts();
        Ok(RunResult {
            losses: (state.task.losses)(&film, state.fates()),
            film,
            left_out: if state.blocks() > 0 { state.emitted - state.emitted_of_blocks } else { 0 },
            fates: state.fates().to_vec(),
            device: device.map(|(gpu, _)| gpu.facts().clone()),
            more_devices: Vec::new(),
            end: state.end.expect("the run has ended"),
            bias: None,
            dispatches,
            submissions,
            pipelines: device.map_or(0, |(_, pipelines)| pipelines),
            nonfinite_values,
            timings: recorder.finish(),
            plan: plan.clone(),
        })
    }
}

/// Runs a world that is set up to its end.
pub(crate) fn run<W: World, Plan: Clone>(
    world: W,
    recorder: W::Recorder,
    plan: &Plan,
    task: Task<W::Film>,
    control: &mut Control,
) -> Result<RunResult<Plan, W::Film>> {
    let mut run = Run::new(world, recorder, task, control)?;
    while !run.has_ended() {
        run.round(control)?;
    }
    run.result(plan, control)
}

/// Refuses arithmetic that the device does not do.
pub(crate) fn check_math(gpu: &Gpu, math: Math) -> Result<()> {
    if math == Math::Strict { strict_math(gpu) } else { Ok(()) }
}

/// The commands of a run on a device that makes these pipelines, and no others; `started` is the zero of its times.
pub(crate) fn commands<'gpu>(
    gpu: &'gpu Gpu,
    modules: &[Module],
    constants: Constants,
    math: Math,
    started: Instant,
) -> Result<Commands<'gpu>> {
    check_math(gpu, math)?;
    let mut commands = Commands::new(gpu, constants, started)?;
    commands.prepare(modules)?;
    commands.timings().count("run");
    Ok(commands)
}
