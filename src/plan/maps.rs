//! The photon maps that a scene's plan calls for: what they store, their radii, what their photons are aimed at, and how many are
//! traced at once.

use super::Limits;
use super::capacity::{self, Persistence};
use super::radius::FirstRadius;
use super::scene::{Asked, MapPlan, SEGMENT_BOUNCES};
use crate::constants::*;
use crate::error::{Result, require};
use crate::photon::MapPhoton;
use crate::records::{CausticTarget, PhotonState};
use crate::scene::geometry::Geometry;
use crate::scene::openings::OPENING_SHARE;
use crate::scene::targets::{aimed_shares, caustic_targets};
use crate::scene::{LobeKinds, Material, Scene, Surface};
use crate::settings::Builder;
use crate::settings::scene::{Effect, Illumination, SceneSettings};

/// Photons that one invocation finds of those of a point's estimate.
const FOUND_BY_LANE: f64 = 60.0;
/// Loop iterations of choosing a light, of the random numbers with which a photon leaves it, and of aiming it.
const LOOPS_TO_EMIT: u32 = 128;
/// Loop iterations of a flight of a photon, mostly of its ray through the hierarchy.
const LOOPS_PER_FLIGHT: u32 = 256;
/// Most bits of the gain of aimed photons: of lights that send less than a billionth towards what makes caustics.
const MAX_GAIN_BITS: f64 = 30.0;

pub(super) struct Maps {
    pub(super) global: Option<MapPlan>,
    pub(super) caustic: Option<MapPlan>,
    /// Mask of `SURFACE_...` whose caustics are wanted.
    pub(super) caustic_surfaces: u32,
    /// What photons of the caustic map are aimed at.
    pub(super) targets: Vec<CausticTarget>,
    /// Mask of the arrivals that some map holds.
    pub(super) arrivals: u32,
}

impl Maps {
    /// `settings` have a builder.
    pub(super) fn new(asked: Asked, simulates: &dyn Fn(Effect) -> bool) -> Result<Maps> {
        let Asked { scene, geometry, settings, limits, .. } = asked;
        let builder = settings.builder.expect("the plan chose a builder");
        limits.check_builder(builder)?;
        let split = settings.illumination == Illumination::Split;
        let caustic_surfaces = (u32::from(simulates(Effect::ReflectiveCaustics)) << SURFACE_MIRROR)
            | (u32::from(simulates(Effect::RefractiveCaustics)) << SURFACE_DIELECTRIC);
        let caustics = caustic_surfaces != 0;
        let of = |is_kept: bool, arrival: u32| if is_kept { arrival } else { 0 };
        let stored = of(simulates(Effect::Direct) && !split, ARRIVED_DIRECT)
            | of(caustics && !split, ARRIVED_CAUSTIC)
            | of(simulates(Effect::Indirect), ARRIVED_INDIRECT);

        let landings = Landings::of(scene, settings.bounces);
        let map = |caustic_only, stored| map(caustic_only, stored, asked, &landings);
        // Without a light there is nothing to trace.
        let has_light = !geometry.emitters.is_empty();
        let global = (has_light && stored != 0).then(|| map(false, stored)).transpose()?;
        let mut caustic = (has_light && split && caustics).then(|| map(true, ARRIVED_CAUSTIC)).transpose()?;
        let targets = caustic.as_mut().filter(|_| settings.aim).map_or_else(Vec::new, |map| aim(map, scene, geometry, caustic_surfaces));
        let arrivals = stored | if caustic.is_some() { ARRIVED_CAUSTIC } else { 0 };
        Ok(Maps { global, caustic, caustic_surfaces, targets, arrivals })
    }
}

/// The global map, or the caustic map.
fn map(caustic_only: bool, stored: u32, asked: Asked, landings: &Landings) -> Result<MapPlan> {
    let Asked { geometry, settings, limits, trial, .. } = asked;
    let (name, domain, photons, neighbours, radius) = if caustic_only {
        let radius = ("caustic_radius", settings.caustic_radius);
        ("caustic", DOMAIN_CAUSTIC_PHOTONS, settings.caustic_photons, settings.caustic_neighbours, radius)
    } else {
        ("global", DOMAIN_PHOTONS, settings.photons, settings.neighbours, ("radius", settings.radius))
    };
    let FirstRadius { radius, from, expected, classes } = FirstRadius::new(geometry, (photons, neighbours), caustic_only, radius, trial)?;
    // Photons of a round land once at every bounce at most; a caustic's only once, but for what they pass.
    let lands_once = caustic_only && !landings.some_pass;
    let most_landings = if lands_once { 1 } else { u64::from(settings.bounces.min(SEGMENT_BOUNCES)) };
    let chunk_photons = chunk_photons(photons, most_landings, settings, limits)?;
    let capacity = chunk_photons * most_landings as u32;
    let fits = lands_once || settings.bounces <= SEGMENT_BOUNCES || {
        // Ten deviations above what is expected, twice.
        let photons = f64::from(chunk_photons);
        2.0 * landings.expected * (photons + 10.0 * photons.sqrt()) <= f64::from(capacity)
    };
    let through_openings = !caustic_only && trial.is_some_and(|trial| !trial.openings.is_empty());
    let is_persistent = settings.builder == Some(Builder::Persistent);
    let in_one = is_persistent && fits && settings.bounces <= flights_of_an_invocation(limits);
    let segment_bounces = if in_one { settings.bounces } else { settings.bounces.min(SEGMENT_BOUNCES) };
    Ok(MapPlan {
        name,
        domain,
        photons,
        chunk_photons,
        capacity,
        path_array_length: if in_one { 0 } else { chunk_photons },
        persistence: Persistence::new(LOOPS_TO_EMIT, LOOPS_PER_FLIGHT, segment_bounces.min(2 * SEGMENT_BOUNCES), limits),
        bounces: settings.bounces,
        segment_bounces,
        stored,
        caustic_only,
        lands_once,
        bucket_count: chunk_photons.clamp(1 << 10, 1 << 24).next_power_of_two(),
        radius,
        radius_from: from,
        classes,
        expected,
        neighbours: f64::from(neighbours),
        lanes: capacity::lanes_of(expected / FOUND_BY_LANE, limits),
        target_count: 0,
        through_openings,
        // Photons that are not aimed carry the most: 1 / (1 - OPENING_SHARE) times what they would if none were.
        flux_gain: if through_openings { 1.0 - OPENING_SHARE } else { 1.0 },
        flux_scale: trial.and_then(|trial| trial.lights.as_ref()).map_or(1.0, |lights| lights.flux_scale),
    })
}

/// Materials that make caustics of the wanted kinds, a mask of `SURFACE_...`.
fn makes_caustics(scene: &Scene, caustic_surfaces: u32) -> Vec<bool> {
    let wants = |surface: u32| caustic_surfaces >> surface & 1 != 0;
    let of = |(material, kinds): (&Material, LobeKinds)| match material.surface {
        Surface::Dielectric { .. } => wants(SURFACE_DIELECTRIC),
        _ => kinds.sharp_reflection && wants(SURFACE_MIRROR) || kinds.sharp_transmission && wants(SURFACE_DIELECTRIC),
    };
    scene.materials.iter().zip(scene.lobe_kinds()).map(of).collect()
}

/// What the photons of a caustic map are aimed at; nothing where that would leave none, or none out.
fn aim(map: &mut MapPlan, scene: &Scene, geometry: &Geometry, caustic_surfaces: u32) -> Vec<CausticTarget> {
    let targets = caustic_targets(geometry, &makes_caustics(scene, caustic_surfaces));
    let (least, most) = aimed_shares(geometry, &targets);
    if least >= 1.0 || most <= 0.0 {
        return Vec::new();
    }
    map.target_count = targets.len() as u32;
    // No photon carries more than 1, but for rounding.
    map.flux_gain = 2f64.powi((-most.log2()).floor().min(MAX_GAIN_BITS) as i32);
    targets
}

/// How often photons land in a map.
struct Landings {
    /// At most, on average: roulette keeps as large a share of photons as the brightest channel of the brightest surface that scatters;
    /// shading normals and rounding have room in what the plan makes of it.
    expected: f64,
    /// Some surfaces that keep photons let light pass, and each of those is a landing.
    some_pass: bool,
}

impl Landings {
    fn of(scene: &Scene, bounces: u32) -> Landings {
        let brightest = |(material, kinds): &(&Material, LobeKinds)| match material.surface {
            _ if kinds.passing => 1.0,
            // Reflection is at most some share of what a colour leaves.
            Surface::Layered => 0.7 * f64::from(material.base_colour.max_element()) + 0.3,
            _ => f64::from(material.base_colour.max_element()),
        };
        let scatterers: Vec<_> = scene.materials.iter().zip(scene.lobe_kinds()).filter(|(_, kinds)| kinds.rough).collect();
        let most = scatterers.iter().map(brightest).fold(0.0, f64::max);
        let expected = (1.0 / (1.0 - most).max(1e-9)).min(f64::from(bounces));
        Landings { expected, some_pass: scatterers.iter().any(|(_, kinds)| kinds.passing) }
    }
}

/// Flights that one invocation may take: software devices count loops, others only time, of which so many take milliseconds.
fn flights_of_an_invocation(limits: &Limits) -> u32 {
    if limits.loop_iterations > LOOP_LIMIT { MAX_BOUNCES } else { limits.loop_iterations / LOOPS_PER_FLIGHT }
}

/// Photons traced at once, so that their map can never be full.
fn chunk_photons(photons: u32, landings: u64, settings: &SceneSettings, limits: &Limits) -> Result<u32> {
    let (path, photon) = (size_of::<PhotonState>() as u64, size_of::<MapPhoton>() as u64);
    let by_buffer = (limits.buffer_bytes / path).min(limits.buffer_bytes / (photon * landings));
    // Two maps of a chunk, sorted and unsorted, and its paths twice, with room for the film.
    let by_memory = limits.memory_bytes / 2 / (4 * photon * landings + 4 * path);
    let fits = by_buffer.min(by_memory).min(u64::from(u32::MAX) / landings);
    let too_many =
        format!("the hits of one photon exceed the device's largest buffer, {} bytes; ask for fewer bounces", limits.buffer_bytes);
    require(fits > 0, "bounces", settings.bounces, too_many)?;
    Ok(fits.min(settings.chunk.map_or(u64::MAX, u64::from)).min(u64::from(photons)) as u32)
}
