//! Makes the plan of a scene: keeps effects or drops them, chooses radii, builder and chunks, and checks every size.

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use super::buffers::{PlannedBuffer, bytes_of};
use super::evidence::Facts;
use super::extra_samples::ExtraSamples;
use super::film::{BiasPlan, FilmPlan, LostOffSurfaces};
use super::maps::Maps;
use super::radius::Trial;
use super::scene::{Asked, LightOf, MapPlan, SEGMENT_BOUNCES, ScenePlan};
use super::sensor::Sensor;
use super::{Limits, effects};
use crate::constants::*;
use crate::error::{Error, Result, require};
use crate::scene::geometry::Geometry;
use crate::scene::{LobeKinds, Scene, Surface, openings};
use crate::settings::scene::{Effect, Illumination, SceneSettings};
use crate::settings::stop::Measure;
use crate::settings::{Builder, Math};

/// Triangles up to which a list may be asked for: a path tests it some hundred times, and loops are short.
const MAX_LIST_TRIANGLES: usize = 256;
/// Bits of a film unit below the scene's mean radiance.
const FILM_BITS: i32 = 24;
/// Most units that all rounds may add to a pixel, and rounds to which any run may go on with the same unit.
const MOST_UNITS: f64 = (1u64 << 62) as f64;
const ROUNDS_OF_UNIT: u32 = 1 << 16;
/// Chunks of so few photons take next to no memory.
const LEAST_CHUNK: u32 = 1 << 10;

impl ScenePlan {
    /// With radii by the scene's area where none are given.
    pub(crate) fn new(scene: &Scene, geometry: &Geometry, settings: &SceneSettings, sensor: Sensor, limits: &Limits) -> Result<ScenePlan> {
        ScenePlan::with_trial(scene, geometry, settings, sensor, limits, None)
    }

    /// With the radii of a trial round where none are given.
    pub(crate) fn with_trial(
        scene: &Scene,
        geometry: &Geometry,
        settings: &SceneSettings,
        sensor: Sensor,
        limits: &Limits,
        trial: Option<Trial>,
    ) -> Result<ScenePlan> {
        let asked = Asked { scene, geometry, settings, sensor, limits, trial: trial.as_ref() };
        let plan = asked.plan();
        if plan.is_ok() || !settings.keeps_parts {
            return plan;
        }
        // A picture that is too large with its parts may fit without them.
        Asked { settings: &SceneSettings { keeps_parts: false, ..settings.clone() }, ..asked }.plan()
    }
}

impl Asked<'_> {
    /// In as large pieces as fit on the device.
    fn plan(self) -> Result<ScenePlan> {
        let Asked { settings, limits, .. } = self;
        // Where the scene and the picture leave little room, photons are traced in smaller chunks.
        let mut for_maps = *limits;
        loop {
            let plan = self.with_maps_within(&for_maps)?;
            let chunk = plan.maps().map(|map| map.chunk_photons).max().unwrap_or(0);
            if plan.bytes <= limits.memory_bytes {
                return Ok(plan);
            }
            if chunk <= LEAST_CHUNK {
                // As much as is enough in any case.
                let boundless = Limits { memory_bytes: u64::MAX, ..*limits };
                let in_pieces = SceneSettings { chunk: Some(LEAST_CHUNK.min(settings.chunk.unwrap_or(LEAST_CHUNK))), ..settings.clone() };
                let all = Asked { settings: &in_pieces, ..self }.with_maps_within(&boundless)?.bytes;
                let needed = format!(
                    "is less than the {} MiB of device memory that the run needs even in small pieces; ask for a smaller picture, or choose another `device`",
                    all.max(plan.bytes).div_ceil(1 << 20)
                );
                return Err(Error::setting("memory", format!("{}M", limits.memory_bytes >> 20), needed));
            }
            for_maps.memory_bytes = for_maps.memory_bytes.min(4 * plan.bytes) / 2;
        }
    }

    fn with_maps_within(self, for_maps: &Limits) -> Result<ScenePlan> {
        let Asked { scene, geometry, settings, sensor, limits, trial } = self;
        let began = Instant::now();
        settings.validate()?;
        let count = geometry.triangles.len();
        let few = format!("is for scenes of {MAX_LIST_TRIANGLES} triangles at most, and this one has {count}");
        require(!settings.leaves_out(Effect::Bvh) || count <= MAX_LIST_TRIANGLES, "without", "bvh", few)?;
        let block = settings.rounds_per_block(matches!(sensor, Sensor::Picture { .. }));
        let whole = format!("must be whole blocks of {block} rounds (`block`), or fewer than one has");
        require(settings.rounds < block || settings.rounds.is_multiple_of(block), "rounds", settings.rounds, whole)?;
        let facts = Facts::new(scene, geometry, settings, sensor);
        let decisions = Effect::ALL.map(|effect| effects::decide(effect, &facts, settings)).to_vec();
        let simulates = |effect: Effect| decisions.iter().any(|decision| decision.effect == effect && decision.kept);

        let by_itself = if settings.math == Math::Strict || !limits.votes_in_loops { Builder::Ballot } else { Builder::Persistent };
        let settings = SceneSettings { builder: Some(settings.builder.unwrap_or(by_itself)), ..settings.clone() };
        let split = settings.illumination == Illumination::Split;
        let maps = Maps::new(Asked { settings: &settings, limits: for_maps, ..self }, &simulates)?;
        let gather_rays = match (simulates(Effect::Indirect), settings.final_gather, simulates(Effect::Glossy)) {
            (true, true, _) => GATHER_ALL,
            (true, false, true) if split => GATHER_GLOSSY,
            _ => GATHER_NONE,
        };
        let is_picture = matches!(sensor, Sensor::Picture { .. });
        let samples = if is_picture { settings.samples } else { 1 };
        // A software device counts loop iterations.
        let chain_steps = if limits.loop_iterations > LOOP_LIMIT { MAX_BOUNCES } else { SEGMENT_BOUNCES };
        let mut constants = constants(geometry, &settings, &facts, &maps, &simulates);
        constants.extend([("GATHER_RAYS", gather_rays), ("CHAIN_STEPS", chain_steps)]);
        constants.push(("HAS_SEEN_LIGHT", u32::from(is_picture)));
        let has_clusters = trial.is_some_and(|trial| trial.lights.is_some());
        constants.push(("HAS_LIGHT_CLUSTERS", u32::from(has_clusters)));
        let Maps { global, caustic, caustic_surfaces, targets, arrivals } = maps;
        let tiles = settings.tiles.as_ref().filter(|_| is_picture);
        tiles.map_or(Ok(()), |tiles| tiles.check(samples, sensor.size()))?;
        let of_tiles = "cannot name the pixels of tiles with more samples, as a pilot or `settings` gives them; set `samples` too";
        require(!settings.paranoid || tiles.is_none(), "paranoid", "on", of_tiles)?;
        let extra_samples = ExtraSamples::new(tiles, samples, sensor.size(), limits.buffer_bytes)?;
        let most_samples = extra_samples.most;
        let points_per_path = if gather_rays == GATHER_NONE { 1 } else { 2 };
        let arrival_sets = if split { 2 } else { 3 };
        let limit = MOST_UNITS / f64::from(settings.rounds.max(ROUNDS_OF_UNIT));
        let film = FilmPlan {
            scale: 1.0,
            limit,
            point_limit: limit / f64::from((most_samples * points_per_path * arrival_sets).next_power_of_two()),
            rounds_per_block: settings.rounds_per_block(is_picture),
            samples: most_samples,
            // What is seen straight is rounded by itself.
            roundings_per_round: f64::from(most_samples * (PART_COUNT + 1 + points_per_path * arrival_sets)),
            sees_light: is_picture,
            rare_radiance: 0.0,
            alpha: settings.alpha,
            widest_radii: [0.0; 2],
            confidence: settings.stop.confidence,
            measure: settings.stop.measure,
            bias: BiasPlan::NoMap,
            lost_off_surfaces: LostOffSurfaces::Nothing,
        };
        let mut plan = ScenePlan {
            settings,
            sensor,
            trial: trial.cloned(),
            decisions,
            constants,
            global,
            caustic,
            caustic_surfaces,
            targets,
            points_per_path,
            extra_samples,
            arrival_sets,
            arrivals,
            chain_steps,
            film,
            light_of: LightOf::All,
            footprint: 1.0,
            work_per_submission: limits.pair_tests_per_submission,
            bytes: 0,
            planned_in: Duration::ZERO,
        };
        plan.set_film(geometry, &facts);
        plan.film.lost_off_surfaces = plan.lost_off_surfaces(scene, &facts);
        plan.constants.push(("HAS_PARTS", u32::from(plan.keeps_parts())));
        plan.constants.push(("HAS_DIFFERENCES", u32::from(plan.film.bias == BiasPlan::Blocks)));
        plan.check_sizes(geometry, limits)?;
        plan.decisions = plan.decisions.iter().map(|decision| effects::with_cost(decision, &plan, geometry)).collect();
        plan.planned_in = began.elapsed();
        Ok(plan)
    }
}

impl ScenePlan {
    /// A unit far below the scene's mean radiance, and sums that cannot overflow however long the run goes on.
    fn set_film(&mut self, geometry: &Geometry, facts: &Facts) {
        let mean = (geometry.power / 3.0 / (PI * geometry.area)).max(f64::MIN_POSITIVE);
        let by_mean = FILM_BITS - mean.log2().floor() as i32;
        // A picture of a lamp may be far above the mean.
        let brightest = 4.0 * geometry.brightest().max(mean);
        let by_brightest = (self.film.limit / brightest).log2().floor() as i32;
        self.film.scale = 2f64.powi(by_mean.min(by_brightest).clamp(-112, 126));
        let shows_lamps = self.simulates(Effect::SpecularChains) && facts.has_kind(LobeKinds::is_sharp);
        if shows_lamps && self.film.sees_light && self.settings.part as u32 & PART_SPECULAR != 0 {
            // A path of one channel stands for three.
            let of_channel = if self.simulates(Effect::Dispersion) { 3.0 } else { 1.0 };
            // Where a pixel has fewest samples, each counts more than where it has most.
            let fewest = f64::from(self.film.samples / self.samples());
            self.film.rare_radiance = fewest * of_channel * geometry.brightest_shown();
        }
        let widest = |map: &Option<MapPlan>| map.as_ref().map_or(0.0, |map| self.widest_radius(map, 0));
        self.film.widest_radii = [widest(&self.global), widest(&self.caustic)];
        self.film.bias = match self.film.measure {
            _ if self.maps().next().is_none() => BiasPlan::NoMap,
            _ if self.bias_is_unknown() => BiasPlan::Nothing,
            Measure::Rmse => BiasPlan::Blocks,
            Measure::RelMse => BiasPlan::ExtraRuns,
        };
    }

    /// What points off all surfaces cannot get of this scene's lights.
    fn lost_off_surfaces(&self, scene: &Scene, facts: &Facts) -> LostOffSurfaces {
        let has_lamps = scene.lights.iter().any(|light| !light.kind.is_environment());
        match self.settings.illumination {
            _ if self.film.sees_light => LostOffSurfaces::Nothing,
            Illumination::Photons if !scene.lights.is_empty() => LostOffSurfaces::Lamps,
            _ if has_lamps && self.caustic.is_some() && facts.has_kind(LobeKinds::is_sharp) => LostOffSurfaces::Caustics,
            _ => LostOffSurfaces::Nothing,
        }
    }

    fn check_sizes(&mut self, geometry: &Geometry, limits: &Limits) -> Result<()> {
        if let Some(too_large) = self.scene_buffers(geometry).iter().find(|buffer| buffer.bytes() > limits.buffer_bytes) {
            let allowed = format!(
                "{} take {} bytes, but a buffer on this device holds at most {}; choose another `device`",
                too_large.why,
                too_large.bytes(),
                limits.buffer_bytes
            );
            return Err(Error::setting("SCENE", format!("({} triangles)", geometry.triangles.len()), allowed));
        }
        let pixels = u64::from(self.sensor.pixels());
        let largest = self.sensor_buffers().iter().map(PlannedBuffer::bytes).max().unwrap_or(0);
        if largest > limits.buffer_bytes {
            let most = limits.buffer_bytes / (largest / pixels);
            return Err(match self.sensor {
                Sensor::Picture { width, height } => Error::setting(
                    "size",
                    format!("{width}x{height}"),
                    match self.samples() {
                        1 => format!("has {pixels} pixels, but the device's buffers hold at most {most}; ask for a smaller picture"),
                        samples => format!(
                            "has {pixels} pixels, but the device's buffers hold at most {most} with `samples` {samples}; ask for fewer samples or a smaller picture"
                        ),
                    },
                ),
                Sensor::Receivers { count } => {
                    Error::setting("points", count, format!("exceed the device's buffers, which hold at most {most}; ask for fewer"))
                }
            });
        }
        self.bytes = bytes_of(&self.buffers(geometry));
        Ok(())
    }
}

/// Specialization constants that follow from effects, maps and settings.
fn constants(
    geometry: &Geometry,
    settings: &SceneSettings,
    facts: &Facts,
    maps: &Maps,
    simulates: &dyn Fn(Effect) -> bool,
) -> Vec<(&'static str, u32)> {
    let split = settings.illumination == Illumination::Split;
    let mut constants = effects::constants(simulates);
    constants.extend([
        ("HAS_OVERLAPS", u32::from(geometry.triangles.iter().any(|triangle| triangle.plane >= HIDDEN))),
        ("HAS_MANY_TEXELS", u32::from(geometry.texels.len() > TEXELS_PER_BUFFER as usize)),
        ("HAS_LAYER_TEXTURES", u32::from(simulates(Effect::Layers) && simulates(Effect::Textures) && facts.has_layer_textures())),
        ("HAS_PANES", u32::from(simulates(Effect::Transmission) && facts.has_kind(|kinds| kinds.pane))),
        ("MEDIUM_BITS", geometry.medium_bits),
        ("HAS_MEDIA_BY_SIZE", u32::from(simulates(Effect::Media) && geometry.has_media_by_size)),
        ("HAS_PASSING", u32::from(simulates(Effect::Layers) && facts.has_kind(|kinds| kinds.passing))),
        ("HAS_MIRROR", u32::from(facts.has(|surface| surface == Surface::Mirror) || settings.forces(Effect::SpecularChains))),
        (
            "HAS_DIELECTRIC",
            u32::from(facts.has(|surface| matches!(surface, Surface::Dielectric { .. })) || settings.forces(Effect::SpecularChains)),
        ),
        ("HAS_PAPER_PHONG", u32::from(facts.has(|surface| matches!(surface, Surface::PaperPhong { .. })))),
        ("HAS_SKY_PICTURE", u32::from(simulates(Effect::Environment) && geometry.has_sky_picture())),
        ("PARANOID", u32::from(settings.paranoid)),
        ("STRICT_MATH", settings.math as u32),
        ("HAS_SHADOW_RAYS", u32::from(split && simulates(Effect::Direct))),
        ("KERNEL", settings.kernel as u32),
        ("HAS_EDGE_CORRECTION", u32::from(settings.edge_correction)),
        ("HAS_CAUSTIC_MAP", u32::from(maps.caustic.is_some())),
        ("HAS_ALL_ARRIVALS", u32::from(!split)),
        ("PARTS", settings.part as u32),
        ("FILTER", settings.filter as u32),
        ("HAS_SLOTS", u32::from(settings.builder == Some(Builder::Naive))),
        ("HAS_AIMED_PHOTONS", u32::from(!maps.targets.is_empty())),
        ("HAS_OPENINGS", u32::from(settings.aim && openings::light_from_beyond(geometry))),
        ("HAS_RADIUS_CLASSES", u32::from(maps.global.iter().chain(&maps.caustic).any(|map| map.classes.is_some()))),
    ]);
    constants
}
