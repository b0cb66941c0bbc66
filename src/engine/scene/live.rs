//! A picture of a scene that is shown while it is made, from a camera that may move: rounds of the engine's run, one at a time.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use glam::DVec3;

use super::film_buffers::FilmBuffers;
use super::map_cache::MapCache;
use super::on_gpu::{SceneOnGpu, constants, modules, task};
use super::resources::SceneResources;
use crate::constants::{SHOW_ALL, SHOW_ERROR};
use crate::engine::Control;
use crate::engine::run::{self, Run};
use crate::error::Result;
use crate::gpu::kernels::{Display, ShowPhotons, ShowScene};
use crate::gpu::{Buffer, Extent, Gpu, Kernel};
use crate::plan::scene::ScenePlan;
use crate::plan::sensor::Sensor;
use crate::records::{ShowPhotonsPush, ShowScenePush};
use crate::scene::geometry::Geometry;
use crate::scene::{Camera, Projection};

/// Of the device's memory, for photons that need not be traced again when the camera moves.
const SHARE_FOR_KEPT_MAPS: u64 = 4;

/// Pixels of the window along each side of a photon's dot.
const DOT: u32 = 2;

pub(crate) struct LiveScene<'a> {
    pub run: Run<'a, SceneOnGpu<'a>>,
    geometry: &'a Geometry,
    plan: &'a ScenePlan,
    cancelled: &'a AtomicBool,
    camera: Camera,
}

/// Where dots of photons go.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DotPlace {
    pub window: [u32; 2],
    pub zoom: u32,
}

impl<'a> LiveScene<'a> {
    /// Makes pipelines and buffers.
    pub(crate) fn new(
        gpu: &'a Gpu,
        geometry: &'a Geometry,
        camera: &Camera,
        plan: &'a ScenePlan,
        cancelled: &'a AtomicBool,
    ) -> Result<LiveScene<'a>> {
        let shown = [ShowScene::MODULE, Display::MODULE, ShowPhotons::MODULE];
        let modules = [modules(plan, gpu.facts()), shown.into()].concat();
        let mut commands = run::commands(gpu, &modules, constants(plan), plan.settings.math, Instant::now())?;
        let resources = commands.scope("set-up", |commands| SceneResources::new(commands, geometry, plan, &[]))?;
        commands.submit()?;
        let most_bytes = gpu.facts().usable_memory_bytes.saturating_sub(plan.bytes) / SHARE_FOR_KEPT_MAPS;
        let mut world = SceneOnGpu::new(geometry, Some(camera.clone()), plan, resources, cancelled);
        world.cache = Some(MapCache::new(most_bytes));
        let run = Run::new(world, commands, task(geometry, plan), &mut Control::quiet(cancelled))?;
        Ok(LiveScene { run, geometry, plan, cancelled, camera: camera.clone() })
    }

    /// One more round, unless all have been.
    pub(crate) fn round(&mut self) -> Result<()> {
        self.run.round_to_look_at(self.cancelled)
    }

    /// Begins anew from another camera. Photons that are kept need not be traced again.
    pub(crate) fn look_from(&mut self, camera: &Camera) -> Result<()> {
        let Run { world, recorder, .. } = &mut self.run;
        world.look_from(recorder, camera.clone());
        self.camera = camera.clone();
        self.run.begin_anew(task(self.geometry, self.plan), &mut Control::quiet(self.cancelled))
    }

    /// Rounds whose photons are kept, and the bytes of these.
    pub(crate) fn cached(&self) -> (usize, u64) {
        self.run.world.cache.as_ref().map_or((0, 0), |cache| (cache.rounds(), cache.bytes()))
    }

    /// Records what is shown of the film: light or its error, of which `mean` is the mean of the picture.
    pub(crate) fn show(&mut self, shows: u32, mean: f64, shown: &Buffer<glam::Vec4>) -> Result<()> {
        let Run { world, recorder, state } = &mut self.run;
        let FilmBuffers { sums_of_block, film_sums, film_squares, part_sums, part_totals, .. } = &world.resources.film;
        let shows = if shows == SHOW_ERROR || self.plan.keeps_parts() { shows } else { SHOW_ALL };
        let push = ShowScenePush {
            pixel_count: self.plan.sensor.pixels(),
            shows,
            rounds: state.rounds(),
            blocks: state.blocks(),
            rounds_of_blocks: state.blocks() * self.plan.film.rounds_per_block,
            unit: (1.0 / self.plan.film.scale) as f32,
            mean: mean as f32,
        };
        let kernel = ShowScene { film_sums, film_squares, sums_of_block, part_sums, part_totals, shown };
        recorder.scope("show", |commands| commands.dispatch(kernel, &push, Extent::Items(u64::from(push.pixel_count))))
    }

    /// Records the photons of the latest round as dots on the pixels of a window, those of the global and of the caustic map in colours
    /// of their own.
    pub(crate) fn show_photons(&mut self, colours: [u32; 2], place: DotPlace, window_pixels: &Buffer<u32>) -> Result<()> {
        let Run { world, recorder, .. } = &mut self.run;
        let Sensor::Picture { width, height } = self.plan.sensor else { return Ok(()) };
        let Some(cache) = &world.cache else { return Ok(()) };
        let is_orthographic = matches!(self.camera.projection, Projection::Orthographic { .. });
        let half_height = self.camera.half_height() / if is_orthographic { self.geometry.unit } else { 1.0 };
        let across = |length: f64, direction: DVec3| (length * direction).as_vec3();
        for map in self.plan.maps() {
            for part in cache.parts(map) {
                let push = ShowPhotonsPush {
                    photon_count: part.count() as u32,
                    width: place.window[0],
                    height: place.window[1],
                    shown_width: width,
                    shown_height: height,
                    zoom: place.zoom,
                    eye: self.geometry.to_local(self.camera.eye),
                    forward: self.camera.forward.as_vec3(),
                    right: across(half_height * f64::from(width) / f64::from(height), self.camera.right),
                    up: across(half_height, self.camera.up),
                    is_orthographic: u32::from(is_orthographic),
                    colour: colours[usize::from(map.caustic_only)],
                    dot_size: DOT,
                };
                let kernel = ShowPhotons { map: part, visible_points: &world.resources.visible_points, window_pixels };
                recorder.dispatch(kernel, &push, Extent::Items(part.count()))?;
            }
        }
        Ok(())
    }
}
