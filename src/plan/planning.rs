//! Makes the plan of a scene: keeps effects or drops them, chooses radii, builder and chunks, and checks every size.

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use super::capacity::{self, Persistence};
use super::evidence::{EffectDecision, Facts};
use super::scene::{MapPlan, RADIUS_RANGE, RadiusFrom, SEGMENT_BOUNCES, ScenePlan, Trial};
use super::sensor::Sensor;
use super::{Limits, memory};
use crate::constants::*;
use crate::error::{Error, Result};
use crate::photon::MapPhoton;
use crate::records::*;
use crate::scene::geometry::Geometry;
use crate::scene::targets::{aimed_shares, caustic_targets};
use crate::scene::{Scene, Surface};
use crate::settings::scene::{Effect, Illumination, SceneSettings};
use crate::settings::{Builder, Math};

/// Triangles up to which a list may be asked for: a path tests it some hundred times, and loops are short.
const MAX_LIST_TRIANGLES: usize = 256;
/// Photons within the first radius of the global map, on average.
const PHOTONS_PER_ESTIMATE: f64 = 60.0;
/// A caustic's photons lie closer: its radius over that of as many photons spread over everything.
const CAUSTIC_RADIUS_SHARE: f64 = 0.25;
/// Bits of a film unit below the scene's mean radiance: as many as leave so many above it, within these.
const FILM_BITS: (i32, i32) = (24, 32);
const FILM_HEADROOM_BITS: i32 = 24;
/// Photons that one invocation finds of those of a point's estimate.
const FOUND_BY_LANE: f64 = 60.0;
/// Loop iterations of choosing a light, of the random numbers with which a photon leaves it, and of aiming it.
const LOOPS_TO_SHINE: u32 = 128;
/// Loop iterations of a flight of a photon, mostly of its ray through the hierarchy.
const LOOPS_PER_FLIGHT: u32 = 256;
/// A photon in its map, sorted and unsorted, and its place in its bucket.
const MAP_ENTRY_BYTES: u64 = 2 * size_of::<MapPhoton>() as u64 + 4;
/// Most bits of the gain of aimed photons: of lights that send less than a billionth towards what makes caustics.
const MAX_GAIN_BITS: f64 = 30.0;
/// Largest radius that is taken by default, relative to the same.
pub const MAX_DEFAULT_RADIUS: f64 = 0.125;

impl ScenePlan {
    /// With radii by the scene's area where none are given.
    pub fn new(scene: &Scene, geometry: &Geometry, settings: &SceneSettings, sensor: Sensor, limits: &Limits) -> Result<ScenePlan> {
        ScenePlan::with_trial(scene, geometry, settings, sensor, limits, None)
    }

    /// With the radii of a trial round where none are given.
    pub fn with_trial(
        scene: &Scene,
        geometry: &Geometry,
        settings: &SceneSettings,
        sensor: Sensor,
        limits: &Limits,
        trial: Option<Trial>,
    ) -> Result<ScenePlan> {
        let began = Instant::now();
        settings.validate()?;
        if settings.leaves_out(Effect::Bvh) && geometry.triangles.len() > MAX_LIST_TRIANGLES {
            let count = geometry.triangles.len();
            return Err(Error::setting(
                "--without",
                "bvh",
                format!("is for scenes of {MAX_LIST_TRIANGLES} triangles at most, and this one has {count}"),
            ));
        }
        let facts = Facts::new(scene, geometry, settings, sensor);
        let mut decisions: Vec<EffectDecision> = Effect::ALL.iter().map(|effect| facts.decide(*effect, settings)).collect();
        let keeps = |effect: Effect| decisions.iter().any(|decision| decision.effect == effect && decision.kept);

        let split = settings.illumination == Illumination::Split;
        let caustic_surfaces = (u32::from(keeps(Effect::ReflectiveCaustics)) << SURFACE_MIRROR)
            | (u32::from(keeps(Effect::RefractiveCaustics)) << SURFACE_DIELECTRIC);
        let caustics = caustic_surfaces != 0;
        let stored = [
            (keeps(Effect::Direct) && !split, ARRIVED_DIRECT),
            (caustics && !split, ARRIVED_CAUSTIC),
            (keeps(Effect::Indirect), ARRIVED_INDIRECT),
        ]
        .iter()
        .map(|(kept, arrival)| if *kept { *arrival } else { 0 })
        .sum::<u32>();

        let by_itself = if settings.math == Math::Strict || !limits.votes_in_loops { Builder::Ballot } else { Builder::Persistent };
        let builder = settings.builder.unwrap_or(by_itself);
        limits.check_builder(builder)?;
        let persistent = builder == Builder::Persistent;
        let landings_of_each = expected_landings(scene, settings.bounces);
        let map = |name, domain, photons: u32, stored, caustic_only: bool, radius: Option<f64>, option| -> Result<MapPlan> {
            let usual = usual_radius(geometry, f64::from(photons)) * if caustic_only { CAUSTIC_RADIUS_SHARE } else { 1.0 };
            let tried = trial.as_ref().and_then(|trial| if caustic_only { trial.caustic_radius } else { trial.global_radius });
            let (radius, radius_from) = match (radius, tried) {
                (None, Some(tried)) => (tried, RadiusFrom::Trial),
                (None, None) => (area_radius(geometry, photons, caustic_only), RadiusFrom::Area),
                (Some(metres), _) => {
                    let (least, most) = (RADIUS_RANGE.0 * geometry.unit, RADIUS_RANGE.1 * geometry.unit);
                    if !(least..=most).contains(&metres) {
                        return Err(Error::setting(option, metres, format!("must be from {least:e} to {most} metres in this scene")));
                    }
                    (metres / geometry.unit, RadiusFrom::User)
                }
            };
            let expected = match radius_from {
                RadiusFrom::Trial => PHOTONS_PER_ESTIMATE,
                RadiusFrom::User | RadiusFrom::Area => PHOTONS_PER_ESTIMATE * (radius / usual).powi(2),
            };
            // Photons of a pass land once at every bounce at most; a caustic's only once.
            let landings = if caustic_only { 1 } else { u64::from(settings.bounces.min(SEGMENT_BOUNCES)) };
            let chunk_photons = chunk_photons(photons, landings, settings, limits)?;
            let capacity = chunk_photons * landings as u32;
            let fits = caustic_only || settings.bounces <= SEGMENT_BOUNCES || {
                // Ten deviations above what is expected, twice.
                let photons = f64::from(chunk_photons);
                2.0 * landings_of_each * (photons + 10.0 * photons.sqrt()) <= f64::from(capacity)
            };
            let in_one = persistent && fits && settings.bounces <= flights_of_an_invocation(limits);
            let segment_bounces = if in_one { settings.bounces } else { settings.bounces.min(SEGMENT_BOUNCES) };
            Ok(MapPlan {
                name,
                domain,
                photons,
                chunk_photons,
                capacity,
                path_array_length: if in_one { 0 } else { chunk_photons },
                persistence: Persistence::new(LOOPS_TO_SHINE, LOOPS_PER_FLIGHT, segment_bounces.min(2 * SEGMENT_BOUNCES), limits),
                bounces: settings.bounces,
                segment_bounces,
                stored,
                caustic_only,
                bucket_count: chunk_photons.clamp(1 << 10, 1 << 24).next_power_of_two(),
                radius,
                radius_from,
                lanes: capacity::lanes_of(expected / FOUND_BY_LANE, limits),
                target_count: 0,
                flux_gain: 1.0,
            })
        };
        // Without a light there is nothing to trace.
        let shines = !geometry.emitters.is_empty();
        let global = (shines && stored != 0)
            .then(|| map("global", DOMAIN_PHOTONS, settings.photons, stored, false, settings.radius, "--radius"))
            .transpose()?;
        let mut caustic = (shines && split && caustics)
            .then(|| {
                let radius = settings.caustic_radius;
                map("caustic", DOMAIN_CAUSTIC_PHOTONS, settings.caustic_photons, ARRIVED_CAUSTIC, true, radius, "--caustic-radius")
            })
            .transpose()?;
        let mut targets = Vec::new();
        if let Some(map) = caustic.as_mut().filter(|_| settings.aim) {
            targets = caustic_targets(geometry, caustic_surfaces);
            let (least, most) = aimed_shares(geometry, &targets);
            if least < 1.0 && most > 0.0 {
                map.target_count = targets.len() as u32;
                // No photon carries more than 1, but for rounding.
                map.flux_gain = 2f64.powi((-most.log2()).floor().min(MAX_GAIN_BITS) as i32);
            } else {
                targets.clear();
            }
        }
        let arrivals = stored | if caustic.is_some() { ARRIVED_CAUSTIC } else { 0 };

        let indirect = keeps(Effect::Indirect);
        let gather_rays = match (indirect, settings.final_gather, keeps(Effect::Glossy)) {
            (true, true, _) => GATHER_ALL,
            (true, false, true) if split => GATHER_GLOSSY,
            _ => GATHER_NONE,
        };
        let samples = if matches!(sensor, Sensor::Picture { .. }) { settings.samples } else { 1 };
        let points_per_pixel = samples * if gather_rays == GATHER_NONE { 1 } else { 2 };
        let arrival_sets = if split { 2 } else { 3 };
        // A software device counts loop iterations.
        let chain_steps = if limits.loop_iterations > LOOP_LIMIT { MAX_BOUNCES } else { SEGMENT_BOUNCES };
        let flag = |effect: Effect| u32::from(keeps(effect));
        let shadow_rays = if split && keeps(Effect::Direct) { settings.shadow_rays } else { 0 };
        let constants = vec![
            ("HAS_BVH", flag(Effect::Bvh)),
            ("HAS_OVERLAPS", u32::from(geometry.triangles.iter().any(|triangle| triangle.plane >= HIDDEN))),
            ("HAS_SMOOTH_NORMALS", flag(Effect::SmoothNormals)),
            ("HAS_TEXTURES", flag(Effect::Textures)),
            ("HAS_TWO_SIDED", flag(Effect::TwoSided)),
            ("HAS_GLOSSY", flag(Effect::Glossy)),
            ("HAS_MIRROR", u32::from(facts.has(|surface| surface == Surface::Mirror) || settings.forces(Effect::SpecularChains))),
            (
                "HAS_DIELECTRIC",
                u32::from(facts.has(|surface| matches!(surface, Surface::Dielectric { .. })) || settings.forces(Effect::SpecularChains)),
            ),
            ("HAS_PAPER_PHONG", u32::from(facts.has(|surface| matches!(surface, Surface::PaperPhong { .. })))),
            ("HAS_TRIANGLE_LIGHTS", flag(Effect::MeshLights)),
            ("HAS_POINT_LIGHTS", flag(Effect::PointLights)),
            ("HAS_SPOT_LIGHTS", flag(Effect::SpotLights)),
            ("HAS_DIRECTIONAL_LIGHTS", flag(Effect::DirectionalLights)),
            ("HAS_DISC_LIGHTS", flag(Effect::DiscLights)),
            ("HAS_ENVIRONMENT", flag(Effect::Environment)),
            ("PARANOID", u32::from(settings.paranoid)),
            ("STRICT_MATH", settings.math.code()),
            ("SHADOW_RAYS", shadow_rays),
            ("SAMPLES", samples),
            ("KERNEL", settings.kernel.code()),
            ("HAS_EDGE_CORRECTION", u32::from(settings.edge_correction)),
            ("HAS_CAUSTIC_MAP", u32::from(caustic.is_some())),
            ("HAS_ALL_ARRIVALS", u32::from(!split)),
            ("GATHER_RAYS", gather_rays),
            ("PARTS", settings.part.mask()),
            ("FILTER", settings.filter.code()),
            ("HAS_SPECULAR_CHAINS", flag(Effect::SpecularChains)),
            ("CHAIN_STEPS", chain_steps),
            ("HAS_SLOTS", u32::from(builder == Builder::Naive)),
            ("HAS_AIMED_PHOTONS", u32::from(!targets.is_empty())),
        ];

        let mut plan = ScenePlan {
            settings: SceneSettings { builder: Some(builder), ..settings.clone() },
            sensor,
            trial: None,
            decisions: Vec::new(),
            constants,
            global,
            caustic,
            caustic_surfaces,
            targets,
            points_per_pixel,
            arrival_sets,
            arrivals,
            chain_steps,
            film_scale: 1.0,
            film_limit: 1.0,
            work_per_submission: limits.pair_tests_per_submission,
            bytes: 0,
            planned_in: Duration::ZERO,
        };
        plan.set_film(geometry);
        plan.check_sizes(geometry, &keeps, limits)?;
        for decision in &mut decisions {
            plan.give(decision, geometry);
        }
        plan.decisions = decisions;
        plan.trial = trial;
        plan.planned_in = began.elapsed();
        Ok(plan)
    }

    /// A unit far below the scene's mean radiance, and sums that cannot overflow.
    fn set_film(&mut self, geometry: &Geometry) {
        let mean = (geometry.power / 3.0 / (PI * geometry.area)).max(f64::MIN_POSITIVE);
        let limit = 2f64.powi(62) / f64::from(self.settings.rounds);
        let bits = (limit.log2() as i32 - FILM_HEADROOM_BITS).clamp(FILM_BITS.0, FILM_BITS.1);
        let by_mean = bits - mean.log2().floor() as i32;
        // A picture of a lamp may be far above the mean.
        let brightest = 4.0 * geometry.brightest().max(mean);
        let by_brightest = (limit / brightest).log2().floor() as i32;
        self.film_scale = 2f64.powi(by_mean.min(by_brightest).clamp(-112, 126));
        self.film_limit = limit;
    }

    fn check_sizes(&mut self, geometry: &Geometry, keeps: &dyn Fn(Effect) -> bool, limits: &Limits) -> Result<()> {
        let pixels = u64::from(self.sensor.pixels());
        let points = u64::from(self.visible_points());
        let film = [
            ("the film", 48 * pixels),
            ("the samples of pixels", 24 * pixels * u64::from(self.samples())),
            ("visible points", points * size_of::<VisiblePoint>() as u64),
            ("estimates", points * u64::from(self.arrival_sets) * 24),
        ];
        let scene = [
            ("triangles", size_of_val(geometry.triangles.as_slice()) as u64),
            ("the triangles' planes", size_of_val(geometry.planes.as_slice()) as u64),
            ("the triangles' texture coordinates", size_of_val(geometry.uvs.as_slice()) as u64),
            ("the triangles' hierarchy", size_of_val(geometry.nodes.as_slice()) as u64),
            ("textures", size_of_val(geometry.texels.as_slice()) as u64),
            ("emitters", size_of_val(geometry.emitters.as_slice()) as u64),
        ];
        let too_large = |(_, bytes): &&(&'static str, u64)| *bytes > limits.buffer_bytes;
        if let Some((what, bytes)) = scene.iter().find(too_large) {
            let allowed = format!(
                "{what} take {bytes} bytes, but a buffer on this device holds at most {}; choose another --device",
                limits.buffer_bytes
            );
            return Err(Error::setting("SCENE", format!("({} triangles)", geometry.triangles.len()), allowed));
        }
        if film.iter().any(|(_, bytes)| *bytes > limits.buffer_bytes) {
            let per_pixel = film.iter().map(|(_, bytes)| bytes / pixels).max().unwrap_or(1);
            let most = limits.buffer_bytes / per_pixel;
            return Err(match self.sensor {
                Sensor::Picture { width, height } => Error::setting(
                    "--size",
                    format!("{width}x{height}"),
                    match self.samples() {
                        1 => format!("has {pixels} pixels, but the device's buffers hold at most {most}; ask for a smaller picture"),
                        samples => format!(
                            "has {pixels} pixels, but the device's buffers hold at most {most} with --samples {samples}; ask for fewer samples or a smaller picture"
                        ),
                    },
                ),
                Sensor::Receivers { count } => {
                    Error::setting("--points", count, format!("exceed the device's buffers, which hold at most {most}; ask for fewer"))
                }
            });
        }
        self.bytes = memory::of_transport(self, geometry, keeps).iter().map(|(_, bytes)| bytes).sum();
        if self.bytes > limits.memory_bytes {
            return Err(Error::setting(
                "--chunk",
                self.settings.chunk.map_or("(default)".into(), |chunk| chunk.to_string()),
                format!(
                    "the run needs {} bytes of device memory, but the device has {}; ask for smaller chunks or a smaller picture",
                    self.bytes, limits.memory_bytes
                ),
            ));
        }
        Ok(())
    }

    fn aim_in_words(&self) -> String {
        match (&self.caustic, self.targets.len()) {
            (None, _) => String::new(),
            (_, 0) => "; photons emitted in all directions".into(),
            (_, 1) => "; photons aimed at 1 bounding sphere".into(),
            (_, count) => format!("; photons aimed at {count} bounding spheres"),
        }
    }

    /// Photons and bytes that exist for one effect, and what became of it.
    fn give(&self, decision: &mut EffectDecision, geometry: &Geometry) {
        if !decision.kept {
            return;
        }
        let map_bytes = |map: &MapPlan| u64::from(map.capacity) * MAP_ENTRY_BYTES + u64::from(map.bucket_count) * 4;
        (decision.photons, decision.bytes) = match decision.effect {
            Effect::Indirect => self.global.as_ref().map_or((0, 0), |map| (u64::from(map.photons), map_bytes(map))),
            effect if effect.is_caustic() => {
                decision.evidence.push_str(&self.aim_in_words());
                self.caustic.as_ref().map_or((0, 0), |map| (u64::from(map.photons), map_bytes(map)))
            }
            Effect::Textures => (0, size_of_val(geometry.uvs.as_slice()) as u64 + size_of_val(geometry.texels.as_slice()) as u64),
            Effect::SmoothNormals => (0, size_of_val(geometry.normals.as_slice()) as u64),
            Effect::Bvh => (0, size_of_val(geometry.nodes.as_slice()) as u64),
            _ => (0, 0),
        };
    }
}

/// Landings of a photon in a map, at most on average: roulette keeps as large a share of photons as the brightest channel of the
/// brightest surface that scatters; shading normals and rounding have room in what the plan makes of it.
fn expected_landings(scene: &Scene, bounces: u32) -> f64 {
    let is_specular = |surface: &Surface| matches!(surface, Surface::Mirror | Surface::Dielectric { .. });
    let scatterers = scene.materials.iter().filter(|material| !is_specular(&material.surface));
    let most = scatterers.map(|material| f64::from(material.base_colour.max_element())).fold(0.0, f64::max);
    (1.0 / (1.0 - most).max(1e-9)).min(f64::from(bounces))
}

/// Flights that one invocation may take: software devices count loops, others only time, of which so many take milliseconds.
fn flights_of_an_invocation(limits: &Limits) -> u32 {
    if limits.loop_iterations > LOOP_LIMIT { MAX_BOUNCES } else { limits.loop_iterations / LOOPS_PER_FLIGHT }
}

/// Radius, normalised, in which so many photons from lamps leave [`PHOTONS_PER_ESTIMATE`] on average: each lands about twice.
pub fn usual_radius(geometry: &Geometry, photons: f64) -> f64 {
    (PHOTONS_PER_ESTIMATE * geometry.area / (PI * 2.0 * photons)).sqrt()
}

/// Radius of a map's first round, normalised, where nothing but the scene's area is known.
pub fn area_radius(geometry: &Geometry, photons: u32, caustic_only: bool) -> f64 {
    let share = if caustic_only { CAUSTIC_RADIUS_SHARE } else { 1.0 };
    (usual_radius(geometry, f64::from(photons)) * share).clamp(RADIUS_RANGE.0, MAX_DEFAULT_RADIUS)
}

/// Photons traced at once, so that their map can never be full.
fn chunk_photons(photons: u32, landings: u64, settings: &SceneSettings, limits: &Limits) -> Result<u32> {
    let (path, photon) = (size_of::<LightPath>() as u64, size_of::<MapPhoton>() as u64);
    let by_buffer = (limits.buffer_bytes / path).min(limits.buffer_bytes / (photon * landings));
    // Two maps of a chunk, sorted and unsorted, and its paths twice, with room for the film.
    let by_memory = limits.memory_bytes / 2 / (4 * photon * landings + 4 * path);
    let fits = by_buffer.min(by_memory).min(u64::from(u32::MAX) / landings);
    if fits == 0 {
        return Err(Error::setting(
            "--bounces",
            settings.bounces,
            format!("the hits of one photon exceed the device's largest buffer, {} bytes; ask for fewer bounces", limits.buffer_bytes),
        ));
    }
    Ok(fits.min(settings.chunk.map_or(u64::MAX, u64::from)).min(u64::from(photons)) as u32)
}
