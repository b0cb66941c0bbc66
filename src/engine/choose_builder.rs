//! `--variant auto`: every builder traces the same first photons of the run on the run's own device, and the fastest is
//! taken. All of them store the same photons, so that the choice changes the time alone.

use std::time::{Duration, Instant};

use super::limits;
use super::room::constants;
use super::room::on_gpu::modules;
use super::run::check_math;
use crate::engine::room::resources::RoomResources;
use crate::engine::room::{Chunk, estimate, index, trace};
use crate::error::{Error, Result};
use crate::gpu::{Commands, Gpu};
use crate::plan::{RoomPlan, photons_of};
use crate::scene::room::RoomScene;
use crate::settings::{Builder, Gather, RoomSettings};
use crate::timings::Spread;

/// What the builders took.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Choice {
    /// Photons that each of them traced.
    pub photons: u32,
    /// Every builder that can run the settings, the fastest first.
    pub candidates: Vec<Candidate>,
}

/// What one builder took.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Candidate {
    pub builder: Builder,
    /// Milliseconds to trace and index the photons, and to gather them by brute force where that steps through the
    /// builder's list; of the device's clock, or of the host's where the device has none.
    pub ms: Spread,
}

/// Photons that are enough to distinguish builders: a card's change places up to there.
fn most_photons(gpu: &Gpu) -> u32 {
    if gpu.facts().kind == "cpu" { 1 << 20 } else { 1 << 22 }
}

/// Turns of each builder that count, after one that makes its pipelines; fewer where they take long.
const TURNS: usize = 5;
const LONG: Duration = Duration::from_secs(1);

pub(crate) fn choose_builder(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings) -> Result<Choice> {
    check_math(gpu, settings.math)?;
    let plans = plans(gpu, scene, settings)?;
    let mut times = vec![Vec::new(); plans.len()];
    let began = Instant::now();
    for turn in 0..=TURNS {
        if turn > 1 && began.elapsed() > LONG {
            break;
        }
        for (plan, times) in plans.iter().zip(&mut times) {
            let ms = first_chunk_ms(gpu, scene, plan)?;
            if turn > 0 {
                times.push(ms);
            }
        }
    }
    let mut candidates: Vec<Candidate> = plans
        .iter()
        .zip(times)
        .map(|(plan, times)| Candidate { builder: plan.settings.builder, ms: Spread::of(times).expect("there is a turn that counts") })
        .collect();
    candidates.sort_by(|a, b| a.ms.median.total_cmp(&b.ms.median));
    Ok(Choice { photons: photons_of(&plans[0].chunk(0)), candidates })
}

/// Plans of every builder that can run the settings, one at least, with first chunks of the same photons.
fn plans(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings) -> Result<Vec<RoomPlan>> {
    let with = |chunk: Option<u32>| -> Result<Vec<RoomPlan>> {
        let (mut plans, mut refusal) = (Vec::new(), None);
        for builder in Builder::ON_GPU {
            let settings = RoomSettings { builder, chunk, rounds: 1, ..settings.clone() };
            match RoomPlan::new(scene, &settings, &limits(gpu.facts())) {
                Ok(plan) => plans.push(plan),
                // Some builder has a limit of its own.
                Err(error @ Error::Setting { .. }) => refusal = Some(error),
                Err(error) => return Err(error),
            }
        }
        match refusal {
            Some(refusal) if plans.is_empty() => Err(refusal),
            _ => Ok(plans),
        }
    };
    let plans = with(settings.chunk)?;
    if settings.nearest.is_some() {
        // These look at a round's photons together, whoever builds the map.
        return Ok(plans);
    }
    let first_chunks = plans.iter().map(|plan| photons_of(&plan.chunk(0)));
    let fewest = first_chunks.min().map_or(2, |photons| photons.clamp(2, most_photons(gpu)));
    with(Some(fewest))
}

fn first_chunk_ms(gpu: &Gpu, scene: &RoomScene, plan: &RoomPlan) -> Result<f64> {
    gpu.prepare(&modules(plan, gpu), &constants(plan))?;
    let mut commands = Commands::new(gpu, constants(plan), Instant::now())?;
    let resources = RoomResources::new(&mut commands, scene, plan)?;
    commands.warm_up()?;
    commands.submit()?;
    let ranges = plan.chunk(0);
    commands.scope("chunk", |commands| {
        trace::chunk(commands, &resources, plan, 0, &ranges)?;
        let traced = Chunk { resources: &resources, plan, photon_count: photons_of(&ranges) };
        index::build(commands, traced)?;
        if plan.settings.gather == Gather::Brute {
            estimate::gather(commands, traced)?;
        }
        Ok(())
    })?;
    commands.submit()?;
    gpu.check_validation()?;
    Ok(commands.finish("choice").best_ms("chunk").expect("the scope has run"))
}
