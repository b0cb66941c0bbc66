//! `--variant auto`: every builder traces the run's own first photons on the run's own device, and the fastest is taken.
//! All of them store the same photons, so that the choice changes the time alone.

use std::time::{Duration, Instant};

use serde::Serialize;

use super::on_gpu::{constants, limits, prepare};
use crate::error::{Error, Result};
use crate::gpu::check::strict_math;
use crate::gpu::{Commands, Gpu};
use crate::plan::{Plan, photons_of};
use crate::resources::Resources;
use crate::scene::room::RoomScene;
use crate::settings::{Math, Settings, Variant};
use crate::{index, trace};

/// What one builder took.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Candidate {
    pub variant: Variant,
    /// Milliseconds to trace and index the photons, median of its turns: of the device's clock, or of the host's where the
    /// device has none.
    pub ms: f64,
}

/// Photons that are enough to tell builders apart.
const MOST_PHOTONS: u32 = 1 << 20;
/// Turns of each builder that count, after one that makes its pipelines; fewer where they take long.
const TURNS: usize = 5;
const LONG: Duration = Duration::from_secs(1);

/// Every builder that can run these settings, the fastest first.
pub fn choose_variant(gpu: &Gpu, scene: &RoomScene, settings: &Settings) -> Result<Vec<Candidate>> {
    if settings.math == Math::Strict {
        strict_math(gpu)?;
    }
    let (mut plans, mut refusal) = (Vec::new(), None);
    for variant in Variant::ON_GPU {
        let settings = Settings { variant, photons: settings.photons.min(MOST_PHOTONS), rounds: 1, ..settings.clone() };
        match Plan::new(scene, &settings, &limits(gpu.facts())) {
            Ok(plan) => plans.push(plan),
            // Some builder has a limit of its own.
            Err(error @ Error::Setting { .. }) => refusal = Some(error),
            Err(error) => return Err(error),
        }
    }
    if let (true, Some(refusal)) = (plans.is_empty(), refusal) {
        return Err(refusal);
    }
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
    let mut candidates: Vec<Candidate> =
        plans.iter().zip(times).map(|(plan, times)| Candidate { variant: plan.settings.variant, ms: median(times) }).collect();
    candidates.sort_by(|a, b| a.ms.total_cmp(&b.ms));
    Ok(candidates)
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn first_chunk_ms(gpu: &Gpu, scene: &RoomScene, plan: &Plan) -> Result<f64> {
    prepare(gpu, plan)?;
    let mut commands = Commands::new(gpu, constants(plan), Instant::now())?;
    let resources = Resources::new(gpu, &mut commands, scene, plan)?;
    commands.submit()?;
    let ranges = plan.chunk(0);
    commands.scope("chunk", |commands| {
        trace::chunk(commands, &resources, plan, 0, &ranges)?;
        index::build(commands, &resources, plan, photons_of(&ranges))
    })?;
    commands.submit()?;
    gpu.check_validation()?;
    Ok(commands.finish("choice").best_ms("chunk").expect("the scope has run"))
}
