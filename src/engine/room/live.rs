//! The paper's box, shown while rounds are added to it.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use glam::Vec4;

use super::film::estimate_walls;
use super::on_gpu::{RoomOnGpu, constants, modules};
use super::resources::{RoomResources, RoundBuffers};
use super::{estimate, task};
use crate::engine::run::{self, Run};
use crate::engine::{self, Control};
use crate::error::Result;
use crate::gpu::kernels::{Display, ShowRoom};
use crate::gpu::{Buffer, Extent, Gpu, Kernel};
use crate::plan::RoomPlan;
use crate::records::ShowRoomPush;
use crate::scene::Camera;
use crate::scene::room::RoomScene;
use crate::settings::RoomSettings;

pub(crate) struct LiveRoom<'a> {
    pub run: Run<'a, RoomOnGpu<'a>>,
    scene: &'a RoomScene,
    plan: &'a RoomPlan,
    cancelled: &'a AtomicBool,
}

impl<'a> LiveRoom<'a> {
    /// The plan of a run that is shown, which has several rounds.
    pub(crate) fn plan(gpu: &Gpu, scene: &RoomScene, settings: &RoomSettings) -> Result<RoomPlan> {
        let plan = RoomPlan { is_kept: true, ..RoomPlan::new(scene, settings, &engine::limits(gpu.facts()))? };
        estimate::check_sums(&plan, gpu.facts())?;
        Ok(plan)
    }

    pub(crate) fn new(gpu: &'a Gpu, scene: &'a RoomScene, plan: &'a RoomPlan, cancelled: &'a AtomicBool) -> Result<LiveRoom<'a>> {
        let modules = [modules(plan, gpu), vec![ShowRoom::MODULE, Display::MODULE]].concat();
        let mut commands = run::commands(gpu, &modules, constants(plan), plan.settings.math, Instant::now())?;
        let resources = commands.scope("set-up", |commands| RoomResources::new(commands, scene, plan))?;
        commands.submit()?;
        let world = RoomOnGpu { plan, resources };
        let run = Run::new(world, commands, task(scene, plan), &mut Control::quiet(cancelled))?;
        Ok(LiveRoom { run, scene, plan, cancelled })
    }

    /// One more round, unless all have been.
    pub(crate) fn round(&mut self) -> Result<()> {
        self.run.round_to_look_at(self.cancelled)
    }

    /// The error over the mean, as far as it is known, and the mean of the illumination.
    pub(crate) fn look(&mut self) -> Result<(f64, f64)> {
        let (film, error) = self.run.look()?;
        let walls = estimate_walls(&film, self.scene, self.plan);
        let values: Vec<f64> = walls.iter().flat_map(|wall| wall.illumination.iter().copied()).collect();
        Ok((error.noise, values.iter().sum::<f64>() / values.len().max(1) as f64))
    }

    /// Records what a camera sees of the walls.
    pub(crate) fn show(&mut self, shows: u32, mean: f64, camera: &Camera, [width, height]: [u32; 2], shown: &Buffer<Vec4>) -> Result<()> {
        let Run { world, recorder, state } = &mut self.run;
        let RoomResources { room, rounds, .. } = &world.resources;
        let RoundBuffers { film_totals, low_squares, high_squares, .. } = rounds.as_ref().expect("a plan that is kept has them");
        let half_height = camera.half_height();
        let push = ShowRoomPush {
            width,
            height,
            eye: camera.eye.as_vec3(),
            forward: camera.forward.as_vec3(),
            right: (half_height * f64::from(width) / f64::from(height) * camera.right).as_vec3(),
            up: (half_height * camera.up).as_vec3(),
            shows,
            channel_count: self.plan.channel_count,
            mesh: self.plan.settings.mesh,
            wall_count: self.scene.walls().count() as u32,
            middle: (0.5 * (self.scene.min_corner + self.scene.max_corner)).as_vec3(),
            rounds: state.rounds(),
            unit: (1.0 / (self.plan.film_scale() * self.plan.settings.full_light * f64::from(state.rounds().max(1)))) as f32,
            mean: mean as f32,
        };
        let kernel = ShowRoom { room, film_totals, low_squares, high_squares, shown };
        recorder.scope("show", |commands| commands.dispatch(kernel, &push, Extent::Items(u64::from(width) * u64::from(height))))
    }
}
