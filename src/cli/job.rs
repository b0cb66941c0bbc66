//! The run of a command that lights a scene of triangles: planned, announced, interruptible, with its bias where asked.

use std::sync::atomic::AtomicBool;

use clap::Args;

use super::chosen::{Chosen, For};
use super::interrupt::interruptible;
use super::keep::Keeper;
use super::progress::{ProgressArgs, ProgressReporter};
use super::stop::{StopArgs, bias_before, goals, rounds_after, up_to};
use super::{complain, device_failed};
use crate::engine::Control;
use crate::engine::retry::until_done;
use crate::engine::saved::SavedRun;
use crate::engine::scene::map_file::MapFile;
use crate::engine::scene::{self, RunResult, View};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::output::destination::Destination;
use crate::output::scene_report;
use crate::plan::film::BiasPlan;
use crate::plan::radius::mean_squared_radius;
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::plan::sensor::Sensor;
use crate::plan::work_division::{Division, Free};
use crate::records::Receiver;
use crate::scene::geometry::Geometry;
use crate::scene::{Camera, Scene};
use crate::settings::scene::SceneSettings;
use crate::text::counted;

/// What a run prints.
#[derive(Args)]
pub(super) struct MessageArgs {
    /// Also print which effects were kept or dropped and why, with the time and the light of each, and what a pilot chose
    #[arg(long, help_heading = "Messages")]
    explain: bool,
    #[command(flatten)]
    pub(super) progress: ProgressArgs,
}

impl MessageArgs {
    pub(super) fn explains(&self) -> bool {
        self.explain || self.progress.verbose
    }
}

/// What a run is about.
pub(super) struct Job<'a> {
    pub(super) scene: &'a Scene,
    pub(super) settings: &'a SceneSettings,
    pub(super) geometry: &'a Geometry,
    pub(super) sensor: Sensor,
    pub(super) camera: Option<&'a Camera>,
    pub(super) phases: &'a [Vec<Receiver>],
    /// Photons that need not be traced.
    pub(super) map: Option<&'a MapFile>,
    /// What a pilot may choose.
    pub(super) free: Free,
    /// What one has chosen before, and where to write what this one does.
    pub(super) chosen: Option<&'a Chosen>,
    pub(super) save_settings: Option<&'a Destination>,
    /// Whether what it chooses is explained.
    pub(super) explain: bool,
    /// What results are of: pixel, texel or point.
    pub(super) point: &'static str,
}

impl Job<'_> {
    /// What will be traced, before it is.
    fn announce(&self, plan: &ScenePlan, reporter: &ProgressReporter) {
        let what = match plan.sensor {
            Sensor::Picture { width, height } => format!("{width} x {height} pixels"),
            Sensor::Receivers { count } => counted(count, self.point),
        };
        let maps: Vec<String> = plan.maps().map(|map| counted(map.photons, &format!("{} photon", map.name))).collect();
        let radius = |map: &MapPlan| format!("{:.4} m ({})", map.radius * self.geometry.unit, map.name);
        let radii: Vec<String> = plan.maps().map(radius).collect();
        let (maps, radius) = if maps.is_empty() {
            ("no photons".to_owned(), String::new())
        } else {
            (maps.join(" and "), format!("; first radius {}", radii.join(", ")))
        };
        reporter.note(&format!(
            "plan: {}, {what}; {} of {maps}{}{radius}; {:.1} MiB on the device{}",
            self.scene.name,
            up_to(&plan.settings.stop, plan.settings.rounds),
            if self.map.is_some() { " from the file" } else { "" },
            plan.bytes as f64 / f64::from(1 << 20),
            goals(&plan.settings.stop)
        ));
    }

    /// Plans the job, its default radii by a trial round, runs all rounds and reports progress; where asked, measures the bias
    /// too.
    pub(super) fn run(
        &self,
        gpus: &mut Vec<Gpu>,
        stop: &StopArgs,
        keeper: &mut Keeper,
        reporter: &ProgressReporter,
        cancelled: &AtomicBool,
    ) -> Result<RunResult> {
        let Job { scene, geometry, sensor, camera, phases, map, point, .. } = *self;
        let is_picture = matches!(sensor, Sensor::Picture { .. });
        let view = View { geometry, camera, phases };
        let wanted = self.divided(&mut gpus[0], &view, keeper.resumed(), reporter, cancelled)?;
        let mut settings = wanted.in_whole_blocks(is_picture);
        let block = settings.rounds_per_block(is_picture);
        let of_map = map.map(MapFile::rounds).filter(|most| settings.rounds > *most);
        if let Some(most) = of_map {
            settings.rounds = most - most % block;
        }
        let settings = &settings;
        if of_map.unwrap_or(wanted.rounds) != settings.rounds {
            let wanted = of_map.map_or(format!("--rounds {} is", wanted.rounds), |most| format!("the {most} rounds of --map are"));
            reporter.note(&format!("{wanted} taken as {}: whole blocks of {block}", settings.rounds));
        }
        let done = keeper.rounds_done(block);
        if done > settings.rounds {
            complain(&format!("warning: --rounds {} is less than the {done} rounds of --resume, all of which are kept", settings.rounds));
        }
        let plan = until_done(&mut gpus[0], &device_failed, |gpu| scene::trial::plan(gpu, scene, &view, settings, sensor))?;
        let mut plan = map.into_iter().try_fold(plan, |plan, map| map.plan(plan, geometry))?;
        if let Some(warning) = scene_report::radius_warning(&plan, geometry, point) {
            complain(&format!("warning: {warning}"));
        }
        self.announce(&plan, reporter);
        let measure = |gpu: &mut Gpu, plan: &ScenePlan, factor_and_rounds| {
            let once = |gpu: &Gpu| scene::bias::measure(gpu, scene, &view, plan, factor_and_rounds, cancelled);
            interruptible(|| until_done(gpu, &device_failed, once))
        };
        let alpha = settings.alpha;
        scene::bias::check(&settings.stop, plan.film.bias)?;
        // The error asked for is noise and bias together, so what blocks do not tell must be known beforehand.
        let takes_extra_runs = stop.bias && plan.film.bias == BiasPlan::ExtraRuns;
        let before =
            bias_before(&settings.stop, takes_extra_runs, alpha < 1.0, reporter, |rounds| measure(&mut gpus[0], &plan, (1.0, rounds)))?;
        plan.settings.stop.bias = before.map(|bias| bias.upper);

        reporter.status("making the pipelines");
        let keep = keeper.keep(&scene.name);
        let mut control = Control { cancelled, progress: &mut |progress| reporter.report(progress, "round"), keep };
        let mut lit = interruptible(|| scene::light_on(gpus, (scene, &view), &plan, map, &device_failed, &mut control))?;
        if lit.is_cancelled() {
            complain(&format!("ended early: the results are of {} of {}", counted(lit.film.rounds, "round"), settings.rounds));
            return Ok(lit);
        }
        let shrunk = mean_squared_radius(alpha, lit.film.rounds);
        lit.bias = match before {
            Some(bias) => Some(bias.scaled(shrunk)),
            // At the radius whose square is the mean of the rounds' squares.
            None if takes_extra_runs => {
                reporter.status("measuring the bias");
                measure(&mut gpus[0], &lit.plan, (shrunk.sqrt(), rounds_after(lit.film.rounds)))?
            }
            None => None,
        };
        reporter.status("writing the results");
        Ok(lit)
    }

    /// Settings whose work is divided where nobody has set how: as in the run that this one goes on with, or as a pilot finds best.
    fn divided(
        &self,
        gpu: &mut Gpu,
        view: &View,
        resumed: Option<&SavedRun>,
        reporter: &ProgressReporter,
        cancelled: &AtomicBool,
    ) -> Result<SceneSettings> {
        let Job { settings, free, .. } = *self;
        if let Some(run) = resumed {
            let of_run = |name: &str, own: u32, is_free: bool| {
                let value = run.identity.settings.get(name).and_then(|value| value.as_u64()?.try_into().ok());
                if is_free { value.unwrap_or(own) } else { own }
            };
            let division = Division {
                samples: of_run("samples", settings.samples, free.samples),
                shadow_rays: of_run("shadow_rays", settings.shadow_rays, free.shadow_rays),
                photons: of_run("photons", settings.photons, free.photons),
                caustic_photons: of_run("caustic_photons", settings.caustic_photons, free.caustic_photons),
                neighbours: of_run("neighbours", settings.neighbours, free.neighbours),
                caustic_neighbours: of_run("caustic_neighbours", settings.caustic_neighbours, free.caustic_neighbours),
            };
            let tiles = run.identity.settings.get("tiles").and_then(|tiles| serde_json::from_value(tiles.clone()).ok());
            let tiles = tiles.filter(|_| free.samples).or_else(|| settings.tiles.clone());
            return Ok(SceneSettings { tiles, ..division.set(settings) });
        }
        self.choose(gpu, view, reporter, cancelled)
    }

    /// The settings that a pilot finds best, saved where asked.
    pub(super) fn choose(&self, gpu: &mut Gpu, view: &View, reporter: &ProgressReporter, cancelled: &AtomicBool) -> Result<SceneSettings> {
        let Job { scene, settings, geometry, sensor, free, chosen, save_settings, .. } = *self;
        let mut found = settings.clone();
        let mut rounds = settings.rounds;
        if settings.stop.has_goal() && free != Free::default() {
            reporter.status("looking for the best settings");
            let pilot =
                until_done(gpu, &device_failed, |gpu| scene::pilot::choose_for(gpu, scene, view, settings, sensor, free, cancelled))?;
            if let Some(pilot) = pilot {
                reporter.note(&scene_report::pilot(&pilot, &settings.stop, self.point));
                if self.explain {
                    scene_report::pilot_table(&pilot, &settings.stop, self.point).lines().for_each(|line| reporter.note(line));
                }
                found = pilot.set(settings);
                rounds = pilot.rounds.expected(pilot.chosen, &settings.stop);
            }
        }
        if chosen.is_none() && save_settings.is_none() {
            return Ok(found);
        }
        let device = gpu.facts().kind;
        let this = For { scene: &scene.name, scene_hash: scene::scene_hash(geometry), size: sensor.size(), device };
        chosen.iter().for_each(|chosen| chosen.compare(&this));
        if let Some(file) = save_settings {
            Chosen::new(&found, rounds.next_multiple_of(found.rounds_per_block(matches!(sensor, Sensor::Picture { .. }))), &this)
                .write(file.clone())?;
            reporter.note(&format!("settings for about {}: wrote {}", counted(rounds, "round"), file.path().display()));
        }
        Ok(found)
    }
}
