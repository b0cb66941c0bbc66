//! The paper's question on today's devices: which builder stores survivors fastest, by photon count and survival. All
//! builders trace the same photons, which is checked, so that a difference in time has one cause.

pub mod chart;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::engine;
use crate::engine::room::resources::RoomResources;
use crate::engine::room::trace;
use crate::engine::room::{constants, photons_on_gpu};
use crate::engine::tallies;
use crate::error::{Error, Result};
use crate::gpu::{Commands, Gpu};
use crate::output::words::{count, number};
use crate::photon::Photon;
use crate::plan::RoomPlan;
use crate::records::Tally;
use crate::rng::Rng;
use crate::scene::open_box::open_box;
use crate::scene::room::{RoomScene, Wall};
use crate::settings::{Builder, Gather, RoomSettings};
use crate::timings::Spread;

/// What is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// Shares of the paths that every bounce lets go on.
    pub survivals: Vec<f32>,
    /// Photons, fewest first.
    pub sizes: Vec<u32>,
    pub bounces: u32,
    /// Runs of each builder that count.
    pub turns: usize,
    /// No size is begun that would probably exceed this time.
    pub budget: Duration,
}

impl Request {
    /// Powers of four from 2^12 up to `most` photons, survival from 5 to 95 %.
    pub fn up_to(most: u32, budget: Duration) -> Request {
        let sizes = (6..=14).map(|power| 1 << (2 * power)).filter(|photons| *photons <= most.max(1 << 12)).collect();
        Request { survivals: vec![0.05, 0.25, 0.5, 0.75, 0.95], sizes, bounces: 15, turns: 3, budget }
    }
}

/// The fastest builder by photon count and survival.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Map {
    pub device: String,
    pub driver: String,
    pub bounces: u32,
    pub cells: Vec<Cell>,
    /// Sizes that the budget left out.
    pub left_out: Vec<u32>,
}

/// One number of photons at one survival.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cell {
    pub survival: f32,
    pub photons: u32,
    /// Stored over all bounces.
    pub stored: u64,
    /// What every builder agreed on with all others.
    pub agreed: Agreed,
    /// The fastest first.
    pub builders: Vec<Timed>,
}

/// How far builders were compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Agreed {
    /// Every photon stored, to the bit.
    Photons,
    /// Fates of all photons, bounce by bounce; the photons themselves are too many to be brought together.
    Fates,
}

impl Agreed {
    fn name(self) -> &'static str {
        match self {
            Agreed::Photons => "photons",
            Agreed::Fates => "fates",
        }
    }
}

/// What a builder took.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Timed {
    pub builder: Builder,
    /// Milliseconds of the device to trace and store all photons.
    pub ms: Spread,
}

/// Stored photons up to which all of them are compared.
const MOST_COMPARED: f64 = 1e6;

/// A closed room, whose every wall lets the same share go on.
fn room(settings: &RoomSettings) -> RoomScene {
    let mut room = open_box(settings);
    room.faces.iter_mut().for_each(|face| *face = Some(Wall { name: "wall", albedo: settings.reflectance, shininess: None }));
    room
}

/// Measures all builders at all sizes and survivals.
pub fn measure(gpu: &Gpu, request: &Request, cancelled: &AtomicBool, tell: &mut dyn FnMut(&str)) -> Result<Map> {
    let began = Instant::now();
    let facts = gpu.facts();
    let mut map =
        Map { device: facts.name.clone(), driver: facts.driver.clone(), bounces: request.bounces, cells: Vec::new(), left_out: Vec::new() };
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
        let whole = map.cells.len();
        for &survival in &request.survivals {
            if cancelled.load(Ordering::Relaxed) {
                // Whole sizes are kept.
                map.cells.truncate(whole);
                return if whole == 0 { Err(Error::Interrupted) } else { Ok(map) };
            }
            tell(&format!("compaction: {} photons, survival {survival}", count(u64::from(photons))));
            map.cells.push(cell(gpu, request, photons, survival)?);
        }
        (before, last) = (last, (photons, size_began.elapsed()));
    }
    Ok(map)
}

fn cell(gpu: &Gpu, request: &Request, photons: u32, survival: f32) -> Result<Cell> {
    let base = RoomSettings {
        photons,
        // At once, as far as they fit, so that builders differ in nothing else.
        chunk: Some(photons),
        bounces: request.bounces,
        reflectance: survival,
        rng: Rng::Philox,
        mesh: 1,
        gather: Gather::Brute,
        ..RoomSettings::default()
    };
    let room = room(&base);
    let of = |builder| RoomSettings { builder, ..base.clone() };
    let mut builders = Vec::new();
    let mut fates: Option<Vec<Tally>> = None;
    for builder in Builder::ON_GPU {
        let (ms, tallies) = run(gpu, &room, &of(builder), request.turns)?;
        let expected = fates.get_or_insert_with(|| tallies.clone());
        agree(gpu, builder, photons, survival, *expected == tallies)?;
        builders.push(Timed { builder, ms });
    }
    let stored: u64 = fates.iter().flatten().map(|tally| u64::from(tally.stored)).sum();
    let mut agreed = Agreed::Fates;
    if stored as f64 <= MOST_COMPARED {
        let in_order = |builder| -> Result<Vec<Photon>> {
            let mut stored = photons_on_gpu(gpu, &room, &of(builder))?;
            stored.sort_by_key(|photon| (photon.photon, photon.bounce));
            Ok(stored)
        };
        let expected = in_order(Builder::Naive)?;
        for builder in Builder::ON_GPU {
            let found = in_order(builder)?;
            agree(gpu, builder, photons, survival, bytemuck::cast_slice::<_, u8>(&found) == bytemuck::cast_slice::<_, u8>(&expected))?;
        }
        agreed = Agreed::Photons;
    }
    builders.sort_by(|a, b| a.ms.median.total_cmp(&b.ms.median));
    Ok(Cell { survival, photons, stored, agreed, builders })
}

fn agree(gpu: &Gpu, builder: Builder, photons: u32, survival: f32, same: bool) -> Result<()> {
    if same {
        return Ok(());
    }
    let what = format!("the photon map of --variant {}, of {photons} photons at survival {survival},", builder.name());
    Err(Error::Miscalculated { device: gpu.facts().name.clone(), what })
}

/// Milliseconds to trace and store all photons, on the device's clock where it has one, and their fates.
fn run(gpu: &Gpu, room: &RoomScene, settings: &RoomSettings, turns: usize) -> Result<(Spread, Vec<Tally>)> {
    let began = Instant::now();
    let plan = RoomPlan::new(room, settings, &engine::limits(gpu.facts()))?;
    gpu.prepare(&trace::modules(&plan), &constants(&plan))?;
    let mut commands = Commands::new(gpu, constants(&plan), began)?;
    let resources = RoomResources::new(gpu, &mut commands, room, &plan)?;
    commands.warm_up()?;
    commands.submit()?;
    let mut fates = Vec::new();
    // The first turn fills caches.
    for turn in 0..=turns {
        tallies::clear(&mut commands, &resources.tallies);
        for ranges in plan.chunks() {
            commands.scope(&turn_name(turn), |commands| trace::chunk(commands, &resources, &plan, 0, &ranges))?;
            commands.submit()?;
        }
        fates = tallies::read(&mut commands, &resources.tallies, settings.bounces)?;
    }
    gpu.check_validation()?;
    let timings = commands.finish("compaction");
    let times = (1..=turns).map(|turn| timings.best_ms(&turn_name(turn)).expect("the turn has run"));
    Ok((Spread::of(times.collect()).expect("there is a turn that counts"), fates))
}

fn turn_name(turn: usize) -> String {
    format!("turn {turn}")
}

impl Cell {
    pub fn of(&self, builder: Builder) -> &Timed {
        self.builders.iter().find(|timed| timed.builder == builder).expect("every builder was timed")
    }

    /// The fastest builder, and those not significantly slower: their fastest run is no slower than its slowest.
    pub fn winners(&self) -> impl Iterator<Item = Builder> {
        let slowest = self.builders[0].ms.max;
        self.builders.iter().filter(move |timed| timed.ms.min <= slowest).map(|timed| timed.builder)
    }

    /// How many times longer the paper's modified builder takes than the fastest.
    pub fn gain(&self) -> f64 {
        self.of(Builder::Atomic).ms.median / self.builders[0].ms.median
    }
}

impl Map {
    pub fn sizes(&self) -> Vec<u32> {
        let mut sizes: Vec<u32> = self.cells.iter().map(|cell| cell.photons).collect();
        sizes.dedup();
        sizes
    }

    pub fn survivals(&self) -> Vec<f32> {
        let first = self.cells.first().map_or(0, |cell| cell.photons);
        self.cells.iter().take_while(|cell| cell.photons == first).map(|cell| cell.survival).collect()
    }

    pub fn cell(&self, photons: u32, survival: f32) -> Option<&Cell> {
        self.cells.iter().find(|cell| cell.photons == photons && cell.survival == survival)
    }

    /// A line for each cell: the fastest builder, those not significantly slower, and every builder's time relative to it.
    pub fn text(&self) -> String {
        let mut text = format!(
            "{:>12} {:>9} {:>14} {:>8} {:>10}  {}\n",
            "photons", "survival", "stored", "compared", "best, ms", "time relative to the best"
        );
        for cell in &self.cells {
            let best = cell.builders[0].ms.median;
            let winners: Vec<Builder> = cell.winners().collect();
            let all: Vec<String> = cell
                .builders
                .iter()
                .map(|timed| {
                    let mark = if winners.contains(&timed.builder) { "*" } else { "" };
                    format!("{}{mark} {:.2}", timed.builder.name(), timed.ms.median / best)
                })
                .collect();
            let line = format!(
                "{:>12} {:>8}% {:>14} {:>8} {:>10}  {}
",
                count(u64::from(cell.photons)),
                number(100.0 * f64::from(cell.survival)),
                count(cell.stored),
                cell.agreed.name(),
                number(best),
                all.join(", ")
            );
            text.push_str(&line);
        }
        if !self.left_out.is_empty() {
            let sizes: Vec<String> = self.left_out.iter().map(|photons| count(u64::from(*photons))).collect();
            text.push_str(&format!("not measured, for lack of time: {} photons\n", sizes.join(", ")));
        }
        text.push_str("* not significantly slower than the best: its fastest run is no slower than the best builder's slowest run\n");
        text
    }
}
