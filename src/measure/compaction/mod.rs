//! The paper's question on today's devices: which builder stores survivors fastest, by photon count and survival. All
//! builders trace the same photons, which is checked, so that a difference in time has one cause.

pub(crate) mod chart;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::engine;
use crate::engine::room::resources::RoomResources;
use crate::engine::room::{constants, photons_on_gpu, trace};
use crate::engine::scene::resources::SceneResources;
use crate::engine::scene::{self, Round, trace as scene_trace};
use crate::engine::tallies;
use crate::error::{Error, Result};
use crate::gpu::{Commands, Gpu};
use crate::output::words::{count, lower_case, number};
use crate::plan::RoomPlan;
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::plan::sensor::Sensor;
use crate::records::Tally;
use crate::rng::Rng;
use crate::scene::Scene;
use crate::scene::geometry::Geometry;
use crate::scene::open_box::open_box;
use crate::scene::room::{RoomScene, Wall};
use crate::settings::scene::{Illumination, SceneSettings};
use crate::settings::{Builder, Gather, RoomSettings};
use crate::timings::Spread;

/// What is asked for.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CompactionRequest {
    /// Shares of the paths that every bounce in a closed room lets go on.
    pub survivals: Vec<f32>,
    /// Photons, fewest first.
    pub sizes: Vec<u32>,
    pub bounces: u32,
    /// Runs of each builder that count.
    pub turns: usize,
    /// No size is begun that would probably exceed this time.
    pub budget: Duration,
}

impl CompactionRequest {
    /// Powers of four from 2^12 up to `most` photons, survival from 5 to 95 %.
    pub(crate) fn up_to(most: u32, budget: Duration) -> CompactionRequest {
        let sizes = (6..=14).map(|power| 1 << (2 * power)).filter(|photons| *photons <= most.max(1 << 12)).collect();
        CompactionRequest { survivals: vec![0.05, 0.25, 0.5, 0.75, 0.95], sizes, bounces: 15, turns: 3, budget }
    }
}

/// The fastest builder by photon count and survival.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Map {
    pub device: String,
    pub driver: String,
    pub bounces: u32,
    pub cells: Vec<Cell>,
    /// Sizes that the budget left out.
    pub left_out: Vec<u32>,
}

/// One number of photons at one survival.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Cell {
    /// Name of the scene; `None`: the closed room.
    pub scene: Option<String>,
    /// Share of the paths that a bounce lets go on; of a scene over all bounces.
    pub survival: f32,
    pub photons: u32,
    /// Paths that went on, over all bounces; a room stores these.
    pub survivors: u64,
    /// What every builder agreed on with all others.
    pub agreed: Agreed,
    /// The fastest first.
    pub builders: Vec<Timed>,
}

/// How far builders were compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Agreed {
    /// Every photon stored, to the bit.
    Photons,
    /// Fates of all photons, bounce by bounce; the photons themselves are too many to be brought together.
    Fates,
}

/// What a builder took.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Timed {
    pub builder: Builder,
    /// Milliseconds of the device to trace and store all photons.
    pub ms: Spread,
}

/// Stored photons up to which all of them are compared.
const MOST_COMPARED: f64 = 1e6;

/// Where photons are traced.
enum Place<'a> {
    /// A closed room, whose every wall lets the same share of paths go on.
    Room(f32),
    /// All light of a scene in one map.
    Scene(&'a Scene, &'a Geometry),
}

/// Measures all builders at all sizes, in a closed room of each survival and in a scene.
pub(crate) fn measure(
    gpu: &Gpu,
    request: &CompactionRequest,
    scene: Option<&Scene>,
    cancelled: &AtomicBool,
    report: &mut dyn FnMut(&str),
) -> Result<Map> {
    let began = Instant::now();
    let facts = gpu.facts();
    let mut map =
        Map { device: facts.name.clone(), driver: facts.driver.clone(), bounces: request.bounces, cells: Vec::new(), left_out: Vec::new() };
    let geometry = scene.map(Geometry::new).transpose()?;
    let rooms = request.survivals.iter().map(|survival| Place::Room(*survival));
    let places: Vec<Place> = rooms.chain(scene.zip(geometry.as_ref()).map(|(scene, geometry)| Place::Scene(scene, geometry))).collect();
    // Sizes and what they took, the last two: time goes with photons, and some of it with none.
    let (mut before, mut last) = ((0u32, Duration::ZERO), (0u32, Duration::ZERO));
    for &photons in &request.sizes {
        let per_photon = last.1.saturating_sub(before.1).div_f64(f64::from((last.0 - before.0).max(1)));
        let expected = if before.0 == 0 { last.1 } else { last.1 + per_photon.mul_f64(f64::from(photons - last.0)) };
        if began.elapsed() + expected > request.budget {
            map.left_out.push(photons);
            continue;
        }
        let size_began = Instant::now();
        let complete = map.cells.len();
        for place in &places {
            if cancelled.load(Ordering::Relaxed) {
                // Sizes that are complete are kept.
                map.cells.truncate(complete);
                return if complete == 0 { Err(Error::Interrupted) } else { Ok(map) };
            }
            report(&format!("compaction: {} photons, {}", count(u64::from(photons)), place.label()));
            map.cells.push(Trial { gpu, request, photons, place }.cell()?);
        }
        (before, last) = (last, (photons, size_began.elapsed()));
    }
    Ok(map)
}

impl Place<'_> {
    fn label(&self) -> String {
        match self {
            Place::Room(survival) => format!("survival {survival}"),
            Place::Scene(scene, _) => scene.name.clone(),
        }
    }
}

/// One cell under measurement.
struct Trial<'a> {
    gpu: &'a Gpu,
    request: &'a CompactionRequest,
    photons: u32,
    place: &'a Place<'a>,
}

impl Trial<'_> {
    fn cell(&self) -> Result<Cell> {
        let mut builders = Vec::new();
        let mut fates: Option<Vec<Tally>> = None;
        for builder in Builder::ON_GPU {
            let (ms, tallies) = self.time(builder)?;
            let expected = fates.get_or_insert_with(|| tallies.clone());
            self.agree(builder, *expected == tallies)?;
            builders.push(Timed { builder, ms });
        }
        let sum = |of: fn(&Tally) -> u32| fates.iter().flatten().map(|tally| u64::from(of(tally))).sum::<u64>();
        // A room stores what goes on, a scene what arrives: that is what goes on or was absorbed, but for mirrors and glass.
        let (survivors, others) = (sum(|tally| tally.stored), sum(|tally| tally.absorbed) + sum(|tally| tally.escaped));
        let mut agreed = Agreed::Fates;
        if (survivors + others) as f64 <= MOST_COMPARED {
            let expected = self.stored(Builder::Naive)?;
            for builder in Builder::ON_GPU {
                self.agree(builder, self.stored(builder)? == expected)?;
            }
            agreed = Agreed::Photons;
        }
        builders.sort_by(|a, b| a.ms.median.total_cmp(&b.ms.median));
        let (scene, survival) = match self.place {
            Place::Room(survival) => (None, *survival),
            Place::Scene(scene, _) => (Some(scene.name.clone()), (survivors as f64 / (survivors + others).max(1) as f64) as f32),
        };
        Ok(Cell { scene, survival, photons: self.photons, survivors, agreed, builders })
    }

    fn agree(&self, builder: Builder, same: bool) -> Result<()> {
        if same {
            return Ok(());
        }
        let what = format!("the photon map of --variant {}, of {} photons at {},", builder.name(), self.photons, self.place.label());
        Err(Error::Miscalculated { device: self.gpu.facts().name.clone(), what })
    }

    /// A closed room, whose every wall lets the same share of paths go on.
    fn room(&self, survival: f32, builder: Builder) -> (RoomScene, RoomSettings) {
        let settings = RoomSettings {
            builder,
            photons: self.photons,
            // At once, as far as they fit, so that builders differ in nothing else.
            chunk: Some(self.photons),
            bounces: self.request.bounces,
            reflectance: survival,
            rng: Rng::Philox,
            mesh: 1,
            gather: Gather::Brute,
            ..RoomSettings::default()
        };
        let mut room = open_box(&settings);
        room.faces.fill(Some(Wall { name: "wall", albedo: survival, shininess: None }));
        (room, settings)
    }

    /// All light of a scene goes into one map.
    fn scene_plan(&self, scene: &Scene, geometry: &Geometry, builder: Builder) -> Result<ScenePlan> {
        let settings = SceneSettings {
            builder: Some(builder),
            photons: self.photons,
            chunk: Some(self.photons),
            bounces: self.request.bounces,
            illumination: Illumination::Photons,
            block: Some(1),
            ..SceneSettings::default()
        };
        let plan = ScenePlan::new(scene, geometry, &settings, Sensor::Receivers { count: 1 }, &engine::limits(self.gpu.facts()))?;
        if plan.global.is_none() {
            return Err(Error::setting("SCENE", &scene.name, "has no light, and so no photons; name a scene that has some"));
        }
        Ok(plan)
    }

    /// The photon map, sorted.
    fn stored(&self, builder: Builder) -> Result<Vec<[u32; 8]>> {
        let mut stored: Vec<[u32; 8]> = match self.place {
            Place::Room(survival) => {
                let (room, settings) = self.room(*survival, builder);
                photons_on_gpu(self.gpu, &room, &settings)?.into_iter().map(bytemuck::cast).collect()
            }
            Place::Scene(scene, geometry) => {
                let plan = self.scene_plan(scene, geometry, builder)?;
                let mut commands = Commands::new(self.gpu, scene::constants(&plan), Instant::now())?;
                let resources = SceneResources::new(&mut commands, geometry, &plan, &[])?;
                let round = Round { resources: &resources, geometry, plan: &plan, number: 0 };
                scene_trace::stored(&mut commands, round, global_map(&plan))?.into_iter().map(bytemuck::cast).collect()
            }
        };
        stored.sort_unstable();
        Ok(stored)
    }

    /// Milliseconds to trace and store all photons, on the device's clock where it has one, and their fates.
    fn time(&self, builder: Builder) -> Result<(Spread, Vec<Tally>)> {
        match self.place {
            Place::Room(survival) => {
                let (room, settings) = self.room(*survival, builder);
                let plan = RoomPlan::new(&room, &settings, &engine::limits(self.gpu.facts()))?;
                self.gpu.prepare(&trace::modules(&plan), &constants(&plan))?;
                let mut commands = Commands::new(self.gpu, constants(&plan), Instant::now())?;
                let resources = RoomResources::new(&mut commands, &room, &plan)?;
                self.turns(commands, |commands, turn| {
                    commands.clear(&resources.tallies);
                    for ranges in plan.chunks() {
                        commands.scope(turn, |commands| trace::chunk(commands, &resources, &plan, 0, &ranges))?;
                        commands.submit()?;
                    }
                    tallies::read(commands, &resources.tallies, settings.bounces)
                })
            }
            Place::Scene(scene, geometry) => {
                let plan = self.scene_plan(scene, geometry, builder)?;
                self.gpu.prepare(&scene_trace::modules(&plan), &scene::constants(&plan))?;
                let mut commands = Commands::new(self.gpu, scene::constants(&plan), Instant::now())?;
                let resources = SceneResources::new(&mut commands, geometry, &plan, &[])?;
                let (round, map) = (Round { resources: &resources, geometry, plan: &plan, number: 0 }, global_map(&plan));
                let buffers = round.photons();
                self.turns(commands, |commands, turn| {
                    commands.clear(&buffers.tallies[0]);
                    for chunk in map.chunks() {
                        commands.scope(turn, |commands| scene_trace::trace(commands, round, map, chunk, &mut |_, _| Ok(())))?;
                        commands.submit()?;
                    }
                    tallies::read(commands, &buffers.tallies[0], plan.tally_rows())
                })
            }
        }
    }

    /// Milliseconds of each turn, and the fates of the last; the first turn, which fills caches, does not count.
    fn turns(
        &self,
        mut commands: Commands,
        mut turn: impl FnMut(&mut Commands, &str) -> Result<Vec<Tally>>,
    ) -> Result<(Spread, Vec<Tally>)> {
        commands.warm_up()?;
        commands.submit()?;
        let names: Vec<String> = (0..=self.request.turns).map(|number| format!("turn {number}")).collect();
        let mut fates = Vec::new();
        for name in &names {
            fates = turn(&mut commands, name)?;
        }
        self.gpu.check_validation()?;
        let timings = commands.finish("compaction");
        let times = names[1..].iter().map(|name| timings.best_ms(name).expect("the turn has run"));
        Ok((Spread::of(times.collect()).expect("there is a turn that counts"), fates))
    }
}

fn global_map(plan: &ScenePlan) -> &MapPlan {
    plan.global.as_ref().expect("a plan without the map is refused")
}

impl Cell {
    pub(crate) fn of(&self, builder: Builder) -> &Timed {
        self.builders.iter().find(|timed| timed.builder == builder).expect("every builder was timed")
    }

    /// The fastest builder, and those not significantly slower: their fastest run is no slower than its slowest.
    pub(crate) fn winners(&self) -> impl Iterator<Item = Builder> {
        let slowest = self.builders[0].ms.max;
        self.builders.iter().filter(move |timed| timed.ms.min <= slowest).map(|timed| timed.builder)
    }

    /// How many times longer the paper's modified builder takes than the fastest.
    pub(crate) fn gain(&self) -> f64 {
        self.of(Builder::Atomic).ms.median / self.builders[0].ms.median
    }
}

impl Map {
    pub(crate) fn sizes(&self) -> Vec<u32> {
        let mut sizes: Vec<u32> = self.cells.iter().map(|cell| cell.photons).collect();
        sizes.dedup();
        sizes
    }

    /// The cells of each row, a room's survivals first, then the scene: as many as sizes.
    pub(crate) fn rows(&self) -> Vec<Vec<&Cell>> {
        let sizes = self.sizes();
        let rows = self.cells.len() / sizes.len().max(1);
        (0..rows).map(|row| self.cells.iter().skip(row).step_by(rows).collect()).collect()
    }

    /// A line for each cell: the fastest builder, those not significantly slower, and every builder's time relative to it.
    pub(crate) fn text(&self) -> String {
        let mut text = format!(
            "{:>12} {:>9} {:>14} {:>8} {:>10}  {}\n",
            "photons", "survival", "survivors", "compared", "best, ms", "time relative to the best"
        );
        for cell in &self.cells {
            let best = cell.builders[0].ms.median;
            let winners: Vec<Builder> = cell.winners().collect();
            let relative = |timed: &Timed| {
                let mark = if winners.contains(&timed.builder) { "*" } else { "" };
                format!("{}{mark} {:.2}", timed.builder.name(), timed.ms.median / best)
            };
            text += &format!(
                "{:>12} {:>8}% {:>14} {:>8} {:>10}  {}{}\n",
                count(u64::from(cell.photons)),
                number(100.0 * f64::from(cell.survival)),
                count(cell.survivors),
                lower_case(cell.agreed),
                number(best),
                cell.builders.iter().map(relative).collect::<Vec<_>>().join(", "),
                cell.scene.as_ref().map_or_else(String::new, |scene| format!("  ({scene})"))
            );
        }
        if !self.left_out.is_empty() {
            let sizes: Vec<String> = self.left_out.iter().map(|photons| count(u64::from(*photons))).collect();
            text.push_str(&format!("not measured, for lack of time: {} photons\n", sizes.join(", ")));
        }
        text.push_str("* not significantly slower than the best: its fastest run is no slower than the best builder's slowest run\n");
        text
    }
}
