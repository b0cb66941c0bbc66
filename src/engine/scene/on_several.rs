//! A run of a scene on all devices that there are, whatever becomes of them.

use super::map_file::MapFile;
use super::on_gpu::task;
use super::{RunResult, Viewpoint, light_from, trial};
use crate::engine::run::retry::{Failed, run_on};
use crate::engine::{self, Control};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::plan::scene::ScenePlan;
use crate::scene::Scene;
use crate::settings::stop::Stop;

/// Runs on all devices, for the first of which the plan was made; `map` holds photons that need not be traced.
pub(crate) fn light_on(
    gpus: &mut Vec<Gpu>,
    (scene, viewpoint): (&Scene, &Viewpoint),
    plan: &ScenePlan,
    map: Option<&MapFile>,
    failed: Failed,
    control: &mut Control,
) -> Result<RunResult> {
    let geometry = viewpoint.geometry;
    let first = gpus[0].facts().clone();
    let run = |gpu: &Gpu, stop: Stop, control: &mut Control| {
        let facts = gpu.facts();
        let is_alike = (&facts.name, &facts.driver) == (&first.name, &first.driver);
        let replan = |new: Result<ScenePlan>| map.into_iter().try_fold(new?, |plan, map| map.plan(plan, geometry));
        let mut plan = if !is_alike {
            replan(trial::plan(gpu, scene, viewpoint, &plan.settings, plan.sensor))?
        } else if facts.usable_memory_bytes != first.usable_memory_bytes {
            let limits = engine::limits(facts);
            replan(ScenePlan::with_trial(scene, geometry, &plan.settings, plan.sensor, &limits, plan.trial.clone()))?
        } else {
            plan.clone()
        };
        plan.settings.stop = stop;
        light_from(gpu, viewpoint, plan, map, control)
    };
    let mut result = run_on(gpus, &task(geometry, plan), &run, failed, control)?;
    // With its goals, which no device had.
    result.plan.settings.stop = plan.settings.stop;
    Ok(result)
}
