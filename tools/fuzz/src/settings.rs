//! RoomSettings of any value -> validation -> plan: a plan whose sizes hold, or one line that says why not.

use std::sync::LazyLock;

use super::change::Random;
use super::refused;
use arbitrary::{Arbitrary, Result, Unstructured};
use photonmill::plan::scene::{MapPlan, ScenePlan};
use photonmill::plan::sensor::Sensor;
use photonmill::plan::{Limits, RoomPlan, photons_of};
use photonmill::rng::Rng;
use photonmill::scene::geometry::Geometry;
use photonmill::scene::open_box::open_box;
use photonmill::scene::{Scene, built_in};
use photonmill::settings::scene::{Effect, Filter, Illumination, Kernel, Part, SceneSettings};
use photonmill::settings::stop::{Measure, Stop};
use photonmill::settings::tile_samples::{MAX_SAMPLES, TILE, TileSamples};
use photonmill::settings::{Builder, EmissionLaw, Gather, Math, PhongDirection, Preset, RoomSettings, Sums};
use serde_json::json;

static SCENES: LazyLock<Vec<(Scene, Geometry)>> = LazyLock::new(|| {
    let scenes = ["open-box-phong", "cornell", "cornell-spheres", "glass-slab", "sky-over-plane", "mirror-corridor"];
    let scene = |name: &&str| built_in::by_name(name).expect("it is built in");
    scenes.iter().map(scene).map(|scene| Geometry::new(&scene).map(|geometry| (scene, geometry)).expect("it has triangles")).collect()
});

#[derive(Debug)]
pub struct Room(RoomSettings);

#[derive(Debug)]
pub struct Triangles {
    scene: usize,
    sensor: Sensor,
    settings: SceneSettings,
}

#[derive(Debug, Arbitrary)]
pub enum PlanRequest {
    Room(Room),
    Triangles(Triangles),
}

pub fn run(request: &PlanRequest) {
    let outcome = match request {
        PlanRequest::Room(Room(settings)) => plan_room(settings),
        PlanRequest::Triangles(request) => plan_triangles(request),
    };
    if let Err(error) = outcome {
        refused(&error);
    }
}

fn plan_room(settings: &RoomSettings) -> photonmill::error::Result<()> {
    let limits = Limits::of_host();
    let accepted = settings.validate();
    let plan = RoomPlan::new(&open_box(settings), settings, &limits);
    if let Err(error) = accepted {
        assert!(plan.is_err(), "planned though refused: {error}");
        return Err(error);
    }
    let plan = plan?;
    assert!(plan.photon_map_bytes() <= limits.buffer_bytes, "{} bytes of photons", plan.photon_map_bytes());
    assert!(plan.light_photons.iter().sum::<u32>() == settings.photons && plan.light_photons.iter().all(|count| *count > 0));
    assert!(plan.flux_unit.is_finite() && plan.flux_unit > 0.0, "flux unit {}", plan.flux_unit);
    assert!(plan.relative_flux.iter().all(|flux| *flux > 0.0 && *flux <= 1.0), "{:?}", plan.relative_flux);
    let last = plan.chunks_per_round - 1;
    for chunk in [0, last / 2, last] {
        assert!(photons_of(&plan.chunk(chunk)) <= plan.path_capacity, "chunk {chunk} of {last} does not fit {}", plan.path_capacity);
    }
    assert!(plan.grid.cells() > 0 && plan.grid.cells_per_metre.is_finite() && plan.grid.reach > 0.0, "{:?}", plan.grid);
    Ok(())
}

fn plan_triangles(request: &Triangles) -> photonmill::error::Result<()> {
    let Triangles { scene, sensor, settings } = request;
    let (scene, geometry) = &SCENES[*scene];
    let limits = Limits::of_host();
    let accepted = settings.validate();
    let plan = ScenePlan::new(scene, geometry, settings, *sensor, &limits);
    if let Err(error) = accepted {
        assert!(plan.is_err(), "planned though refused: {error}");
        return Err(error);
    }
    let plan = plan?;
    assert!(plan.bytes <= limits.memory_bytes, "{} bytes", plan.bytes);
    assert!(plan.film.is_sound(), "{:?}", plan.film);
    plan.maps().for_each(|map| check_map(&plan, map, &limits));
    // Without a pixel there is nothing to do.
    let at_once = [plan.camera_paths_at_once(), plan.points_at_once(), plan.photons_per_dispatch()];
    assert!(at_once.iter().all(|count| *count > 0) || sensor.pixels() == 0, "{at_once:?}");
    check_extra_samples(&plan);
    Ok(())
}

/// Samples of tiles that have more: a list of pixels behind what each pixel has in it.
fn check_extra_samples(plan: &ScenePlan) {
    let (extra, pixels) = (&plan.extra_samples, plan.sensor.pixels());
    assert!(extra.most <= MAX_SAMPLES && plan.samples() <= extra.most, "{} and {} samples", plan.samples(), extra.most);
    if extra.table.is_empty() {
        assert_eq!(extra.count, 0);
        return;
    }
    let (of_pixels, list) = extra.table.split_at(2 * pixels as usize + 2);
    assert!(list.len() == extra.count as usize && list.iter().all(|pixel| *pixel < pixels), "{} extra samples", extra.count);
    let ends = of_pixels[..2 * pixels as usize].chunks_exact(2).map(|of_pixel| of_pixel[0] + of_pixel[1]);
    assert!(ends.max().unwrap_or(0) <= extra.count, "a pixel has samples beyond {}", extra.count);
}

fn check_map(plan: &ScenePlan, map: &MapPlan, limits: &Limits) {
    assert!(map.chunk_photons >= 1 && map.chunk_photons <= map.photons && map.bucket_count.is_power_of_two(), "{map:?}");
    assert!(u64::from(map.capacity) * 32 <= 2 * limits.memory_bytes && map.capacity >= map.chunk_photons, "{map:?}");
    let chunks = map.chunks();
    // Each chunk is a dispatch; only the ends of a long list are looked at.
    assert_eq!(chunks.size_hint().0 as u32, map.photons.div_ceil(map.chunk_photons), "{map:?}");
    assert_eq!(map.chunks().next(), Some((0, map.chunk_photons)));
    let radii: Vec<f64> = [0, 1, 2, plan.settings.rounds.min(1000) - 1].iter().map(|round| plan.radius(map, *round)).collect();
    assert!(radii.iter().all(|radius| radius.is_finite() && *radius > 0.0), "{radii:?}");
}

/// What ends a run; no run is made here.
fn stop(u: &mut Unstructured) -> Result<Stop> {
    let usual = Stop::default();
    Ok(Stop {
        error: if u.arbitrary()? { Some(number(u, 0.01)?) } else { None },
        measure: *u.choose(&Measure::ALL)?,
        confidence: number(u, usual.confidence)?,
        seconds: if u.arbitrary()? { Some(number(u, 1.0)?) } else { None },
        photons: if u.arbitrary()? { Some(u.arbitrary()?) } else { None },
        bias: if u.arbitrary()? { Some(number(u, 0.01)?) } else { None },
    })
}

impl<'a> Arbitrary<'a> for Room {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Room> {
        let preset = *u.choose(&[Preset::Naive, Preset::Modified, Preset::Phong, Preset::Rounds])?;
        let usual = RoomSettings::preset(preset);
        Ok(Room(RoomSettings {
            builder: *u.choose(&Builder::ALL)?,
            photons: count(u, usual.photons)?,
            rounds: count(u, usual.rounds)?,
            bounces: count(u, usual.bounces)?,
            radius: number(u, usual.radius)?,
            full_light: number(u, usual.full_light)?,
            seed: u.arbitrary()?,
            rng: *u.choose(&[Rng::Rand48, Rng::Mt, Rng::Philox, Rng::Sobol])?,
            gather: *u.choose(&[Gather::Brute, Gather::Grid, Gather::KdTree])?,
            nearest: if u.arbitrary()? { Some(count(u, 50)?) } else { None },
            sums: *u.choose(&[Sums::Integer, Sums::F32, Sums::Compensated])?,
            math: *u.choose(&[Math::Fast, Math::Strict])?,
            paranoid: u.arbitrary()?,
            emission: *u.choose(&[EmissionLaw::Uniform, EmissionLaw::Cosine])?,
            shininess: if u.arbitrary()? { u.arbitrary()? } else { usual.shininess },
            phong_direction: *u.choose(&[PhongDirection::Mirror, PhongDirection::Sampled])?,
            eye: if u.arbitrary()? { u.arbitrary()? } else { usual.eye },
            light_radius: number(u, usual.light_radius)?,
            light_power: [number(u, usual.light_power[0])?, number(u, usual.light_power[1])?],
            reflectance: number(u, f64::from(usual.reflectance))? as f32,
            mesh: count(u, usual.mesh)?,
            edge_correction: u.arbitrary()?,
            threads: count(u, 1)? as usize,
            group_size: count(u, usual.group_size)?,
            counters: if u.arbitrary()? { Some(count(u, 8)?) } else { None },
            chunk: if u.arbitrary()? { Some(count(u, 64)?) } else { None },
            stop: stop(u)?,
        }))
    }
}

impl<'a> Arbitrary<'a> for Triangles {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Triangles> {
        let usual = SceneSettings::default();
        let sensor = match u.arbitrary()? {
            true => Sensor::Picture { width: count(u, 64)?, height: count(u, 64)? },
            false => Sensor::Receivers { count: count(u, 64)? },
        };
        let settings = SceneSettings {
            photons: count(u, usual.photons)?,
            caustic_photons: count(u, usual.caustic_photons)?,
            rounds: count(u, usual.rounds)?,
            block: if u.arbitrary()? { Some(count(u, 4)?) } else { None },
            bounces: count(u, usual.bounces)?,
            seed: u.arbitrary()?,
            neighbours: count(u, usual.neighbours)?,
            caustic_neighbours: count(u, usual.caustic_neighbours)?,
            radius: if u.arbitrary()? { Some(number(u, 0.05)?) } else { None },
            caustic_radius: if u.arbitrary()? { Some(number(u, 0.05)?) } else { None },
            alpha: number(u, usual.alpha)?,
            kernel: *u.choose(&[Kernel::Box, Kernel::Cone, Kernel::Epanechnikov])?,
            edge_correction: u.arbitrary()?,
            samples: count(u, usual.samples)?,
            tiles: if u.arbitrary()? { Some(tiles(u, sensor)?) } else { None },
            shadow_rays: count(u, usual.shadow_rays)?,
            final_gather: u.arbitrary()?,
            aim: u.arbitrary()?,
            illumination: *u.choose(&[Illumination::Split, Illumination::Photons])?,
            part: *u.choose(&[Part::All, Part::Direct, Part::Specular, Part::Caustic, Part::Indirect])?,
            keeps_parts: u.arbitrary()?,
            filter: *u.choose(&[Filter::Box, Filter::Tent, Filter::Gaussian])?,
            builder: if u.arbitrary()? { Some(*u.choose(&Builder::ON_GPU)?) } else { None },
            math: *u.choose(&[Math::Fast, Math::Strict])?,
            paranoid: u.arbitrary()?,
            group_size: count(u, usual.group_size)?,
            chunk: if u.arbitrary()? { Some(count(u, 64)?) } else { None },
            stop: stop(u)?,
            with: effects(u)?,
            without: effects(u)?,
        };
        Ok(Triangles { scene: u.choose_index(SCENES.len())?, sensor, settings })
    }
}

/// Tiles as a file of settings may have them: mostly those of the picture, where that is small.
fn tiles(u: &mut Unstructured, sensor: Sensor) -> Result<TileSamples> {
    let (width, height) = sensor.size();
    let (columns, rows) = if width.max(height) <= 64 && u.ratio(7, 8)? {
        (width.div_ceil(TILE), height.div_ceil(TILE))
    } else {
        (u.int_in_range(0..=16)?, u.int_in_range(0..=16)?)
    };
    let letters = *u.choose(&["0", "01", "0123", "0123456789", "01x"])?;
    let mut random = Random(u.arbitrary()?);
    let mut row = || (0..columns).map(|_| char::from(random.pick(letters.as_bytes()))).collect::<String>();
    let rows: Vec<String> = (0..rows).map(|_| row()).collect();
    Ok(serde_json::from_value(json!(rows)).expect("rows are text"))
}

/// The usual value, a power of two or its neighbour, or any.
fn count(u: &mut Unstructured, usual: u32) -> Result<u32> {
    Ok(match u.int_in_range(0..=3u8)? {
        0 => usual,
        1 => (1u32 << u.int_in_range(0..=31)?).wrapping_add(u.int_in_range(0..=2)?).wrapping_sub(1),
        2 => u32::from(u.arbitrary::<u16>()?),
        _ => u.arbitrary()?,
    })
}

fn number(u: &mut Unstructured, usual: f64) -> Result<f64> {
    Ok(match u.int_in_range(0..=3u8)? {
        0 | 1 => usual,
        2 => usual * 2f64.powi(u.int_in_range(-64..=64)?),
        _ => u.arbitrary()?,
    })
}

fn effects(u: &mut Unstructured) -> Result<Vec<Effect>> {
    (0..u.int_in_range(0..=4)?).map(|_| u.choose(&Effect::ALL).copied()).collect()
}
