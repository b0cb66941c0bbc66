//! The bias of a radius, as runs state it, against the truth: the stated interval holds it as often as it says.

use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use crate::common::prelude::*;
use crate::common::rendered::Viewed;
use photonmill::engine::error::bias::{Bias, BiasFrom};
use photonmill::engine::error::bias_batches::{self, Batches};
use photonmill::engine::room;
use photonmill::engine::room::film::estimate_walls;
use photonmill::engine::scene;
use photonmill::plan::radius::mean_squared_radius;
use photonmill::settings::stop::{Measure, Stop};
use photonmill::verify::judge::radiosity::{Law, Radiosity, WALLS, on_wall};

const CONFIDENCE: f64 = 0.9;
static NEVER: AtomicBool = AtomicBool::new(false);

fn stop() -> Stop {
    Stop { confidence: CONFIDENCE, ..Stop::default() }
}

/// Texels along a wall of the box.
const MESH: usize = 12;

fn in_box(radius: f64, photons: u32, seed: u64) -> RoomSettings {
    RoomSettings { mesh: MESH as u32, radius, photons, seed, rng: Rng::Philox, stop: stop(), threads: 2, ..RoomSettings::default() }
}

/// Irradiance of the box at the middles of its texels, W/m2, by radiosity: what a radius of 0 would find.
fn at_points() -> &'static [f64] {
    static LIGHT: OnceLock<Vec<f64>> = OnceLock::new();
    LIGHT.get_or_init(|| {
        let solution = Radiosity::solve(Law::Uniform, 0.75, 24, 15);
        let middle = |i: usize| (i as f64 + 0.5) / MESH as f64 * 0.5 - 0.25;
        let light = |wall: usize, k: usize| {
            let point = on_wall(wall, middle(k % MESH), middle(k / MESH));
            solution.direct_at(wall, point) + solution.reflected_at(wall, point)
        };
        (0..WALLS).flat_map(|wall| (0..MESH * MESH).map(move |k| light(wall, k))).collect()
    })
}

/// The relative bias of the box at a radius: a long run's mean squared distance from the truth, less its variance.
fn true_bias_in_box(gpu: Option<&Gpu>, radius: f64) -> f64 {
    let settings = RoomSettings { rounds: 48, ..in_box(radius, 8191, 4711) };
    let scene = open_box(&settings);
    let result = room::run(gpu, &scene, &settings, &mut Control::default()).unwrap();
    let (mut off, mut light, mut count) = (0.0, 0.0, 0.0f64);
    let walls = estimate_walls(&result.film, &scene, &result.plan);
    let found = walls.iter().flat_map(|wall| pairs(&wall.irradiance, &wall.irradiance_error));
    for ((found, error), expected) in pairs(found, at_points()) {
        off += (found - expected).powi(2) - error * error;
        light += expected;
        count += 1.0;
    }
    (off * count).max(0.0).sqrt() / light
}

/// Whether the interval of a bias holds the truth.
fn interval_check(bias: &Bias, truth: f64) -> Check {
    let Bias { lower, upper, relative, .. } = *bias;
    require((lower..=upper).contains(&truth), || {
        format!("{truth:.5} where {lower:.5} to {upper:.5} is stated, {relative:.5} in the middle")
    })
}

/// Whether intervals hold the truth as often as they say.
fn coverage_check(biases: &[Bias], truth: f64) -> Check {
    let within = biases.iter().filter(|bias| interval_check(bias, truth).is_ok()).count() as f64 / biases.len() as f64;
    if within >= CONFIDENCE { Ok(()) } else { Err(format!("{:.0} % of the intervals hold {truth:.5}", 100.0 * within)) }
}

/// Fails unless they do, and prints how wide they are.
fn assert_coverage(what: &str, biases: &[Bias], truth: f64) {
    let mean = |of: fn(&Bias) -> f64| biases.iter().map(of).sum::<f64>() / biases.len() as f64;
    let [middle, lower, upper] = [mean(|bias| bias.relative), mean(|bias| bias.lower), mean(|bias| bias.upper)];
    let within = biases.iter().filter(|bias| interval_check(bias, truth).is_ok()).count();
    println!("{what}: bias {truth:.4}; on average {middle:.4}, {lower:.4} to {upper:.4}; {within} of {} intervals hold it", biases.len());
    assert_holds(what, coverage_check(biases, truth));
}

/// Light along x that does not change along y, as the mean over the discs of radius r around points of the x axis, where
/// the surface is; and as it is. Midpoint rule over 400 strips of the disc.
fn disc_means(light: impl Fn(f64) -> f64, has_surface: impl Fn(f64) -> bool, radius: f64, points: &[f64]) -> Vec<f64> {
    const STRIPS: i32 = 400;
    let mean = |x: f64| {
        let (mut sum, mut area) = (0.0, 0.0);
        for strip in 0..STRIPS {
            let off = 2.0 * (f64::from(strip) + 0.5) / f64::from(STRIPS) - 1.0;
            let at = x + radius * off;
            if has_surface(at) {
                let height = (1.0 - off * off).sqrt();
                sum += height * light(at);
                area += height;
            }
        }
        sum / area
    };
    points.iter().map(|x| if radius == 0.0 { light(*x) } else { mean(*x) }).collect()
}

/// Where the law c r^2 fails, by how much: the stated interval of light without noise is the allowance alone.
#[test]
fn the_allowance_covers_edges_shadows_and_bumps() {
    let bump = |width: f64| move |x: f64| 1.0 + (-0.5 * (x / width).powi(2)).exp();
    type OfX = Box<dyn Fn(f64) -> f64>;
    let cases: [(&str, OfX, bool, f64); 7] = [
        ("a parabola", Box::new(|x| x * x), false, 1.0),
        ("the edge of a surface", Box::new(|x| 1.0 + x), true, 1.12),
        ("the edge of a shadow", Box::new(|x| if x > 0.0 { 1.0 } else { 0.0 }), false, 1.82),
        ("a bump of two radii", Box::new(bump(2.0)), false, 1.01),
        ("a bump of one radius", Box::new(bump(1.0)), false, 1.05),
        ("a bump of half a radius", Box::new(bump(0.5)), false, 1.2),
        ("a bump of a quarter radius", Box::new(bump(0.25)), false, 1.6),
    ];
    for (what, light, at_edge, expected) in cases {
        let points: Vec<f64> = (0..800).map(|k| (f64::from(k) + 0.5) / 100.0 - if at_edge { 0.0 } else { 4.0 }).collect();
        let has_surface = |x: f64| !at_edge || x > 0.0;
        let at = |radius: f64| disc_means(&light, has_surface, radius, &points);
        let bias = bias_batches::extrapolate(Measure::Rmse, CONFIDENCE, 1, |factor, _| Ok(Some(at(factor)))).unwrap().unwrap();
        let (found, truth) = (at(1.0), at(0.0));
        let off: f64 = pairs(&found, &truth).map(|(found, truth)| (found - truth).powi(2)).sum();
        let positive = found.iter().filter(|value| **value > 0.0).count() as f64;
        let relative = (off * positive).sqrt() / found.iter().sum::<f64>();
        println!("{what}: {:.3} of what is extrapolated", relative / bias.relative);
        assert!((relative / bias.relative - expected).abs() < 0.02, "{what}: {}", relative / bias.relative);
        assert_holds(what, interval_check(&bias, relative));
        assert_complains("a bias of which most is lost", interval_check(&bias.scaled(0.4), relative));
    }
}

/// Intervals of so many seeds in the paper's box.
#[test]
fn the_bias_of_the_box_lies_in_its_interval_as_often_as_stated() {
    let seeds = of_run(12, 50);
    let radii = of_run::<&[_]>(&[0.2], &[0.2, 0.15, 0.1, 0.07]);
    let gpu = device();
    let gpu = gpu.as_deref();
    for &radius in radii {
        let truth = true_bias_in_box(gpu, radius);
        let measured = |seed, photons| {
            let settings = in_box(radius, photons, seed);
            room::measure_bias(gpu, &open_box(&settings), &settings, 1, &NEVER).unwrap().unwrap()
        };
        let biases: Vec<Bias> = (1..=seeds).map(|seed| measured(seed, 3001)).collect();
        assert_coverage(&format!("the paper's box, radius {radius} m"), &biases, truth);
        // A factor 2 shows where noise is less than that: it is what the difference of the two radii leaves out.
        if radius >= 0.15 {
            assert!(biases.iter().all(|bias| bias.upper < 4.0 * truth), "an interval that says nothing");
            let spoiled: Vec<Bias> = biases.iter().map(|bias| bias.scaled(0.5)).collect();
            assert_complains("biases without their factor 2", coverage_check(&spoiled, truth));
        }
    }
}

/// The same of scenes of triangles: name, illumination, radius as a share of the scene. The truth is the difference from
/// light at a fifth of the radius, at which a 25th of the bias is left.
#[test]
fn the_bias_of_scenes_lies_in_its_interval_as_often_as_stated() {
    let (seeds, rounds, names) =
        of_run::<(_, _, &[_])>((8, 2, &[]), (20, 16, &["open-box", "cornell", "cornell-spheres", "caustic-sphere"]));
    let pictures = names.iter().flat_map(|name| BOTH.map(|illumination| (*name, illumination, 0.15)));
    let Some(gpu) = device() else { return };
    for (name, illumination, radius) in pictures.chain([("disc-over-plane", Illumination::Photons, 0.1)]) {
        let long = PlannedImage::new(name, illumination, radius, 20_000, 99, &gpu);
        let batch = |factor: f64, number: u32| long.batch(&gpu, rounds, factor, number);
        let differences = bias_batches::difference(Measure::Rmse, CONFIDENCE, 0.2, batch).unwrap().unwrap();
        let [lower, middle, upper] = differences.map(|difference| difference / (1.0 - 0.04));
        let biases: Vec<Bias> =
            (1..=seeds).map(|seed| PlannedImage::new(name, illumination, radius, 4000, seed, &gpu).bias_of_blocks(&gpu, 16)).collect();
        println!("{name}: {lower:.4} to {upper:.4}");
        assert_coverage(&format!("{name}, {illumination:?}, radius {radius}"), &biases, middle);
    }
}

/// A wall that cuts the disc of the whole radius and not that of the smaller one leaves no edge in the latter; whether it is whole or
/// empty was then decided by edges as short as rounding. One estimate in ten million was 200 000 times too bright.
#[test]
#[ignore = "ten million estimates: most of a minute on a software device"]
fn no_area_is_lost_where_a_wall_lies_between_the_two_radii() {
    let Some(gpu) = device() else { return };
    let scene = scene("cornell");
    let settings = SceneSettings { rounds: 28, stop: stop(), ..SceneSettings::default() };
    let bias = seen(&gpu, &scene, &settings, &scene.first_camera(), [512; 2]).error().bias.unwrap();
    println!("{bias:?}");
    assert!(bias.upper < 0.1, "{bias:?}");
}

/// Of a run whose radius shrinks the bias is that of the first radius, scaled with the mean square of all.
#[test]
#[ignore = "long: minutes on a software device"]
fn the_bias_of_a_shrinking_radius_lies_in_the_scaled_interval() {
    let Some(gpu) = device() else { return };
    const ROUNDS: u32 = 32;
    let long = PlannedImage::new("disc-over-plane", Illumination::Photons, 0.15, 4000, 99, &gpu);
    let alpha = by_rounds().alpha;
    let batch = |factor: f64, number: u32| {
        if factor < 1.0 {
            return long.batch(&gpu, ROUNDS, factor, number);
        }
        let seed = bias_batches::seed(long.plan.settings.seed, number);
        let settings = SceneSettings { rounds: ROUNDS, alpha, seed, ..long.plan.settings.clone() };
        let result = long.of.run(&gpu, long.of.planned(&gpu, &settings, long.plan.sensor));
        Ok(Some(result.film.surface_means().flat_map(|mean| mean.to_array()).collect()))
    };
    let truth = bias_batches::difference(Measure::Rmse, CONFIDENCE, 0.2, batch).unwrap().unwrap()[1];
    let of_seed = |seed| PlannedImage::new("disc-over-plane", Illumination::Photons, 0.15, 4000, seed, &gpu).bias(&gpu, 2);
    let first: Vec<Bias> = (1..=8).map(of_seed).collect();
    let scaled: Vec<Bias> = first.iter().map(|bias| bias.scaled(mean_squared_radius(alpha, ROUNDS))).collect();
    assert_coverage("a shrinking radius", &scaled, truth);
    assert!(first.iter().all(|bias| bias.relative > 1.5 * truth), "the first radius's bias is no smaller: {first:?}");
}

/// Light that no map has, has no bias.
#[test]
fn light_without_a_map_has_no_bias() {
    let Some(gpu) = device() else { return };
    let image = PlannedImage::new("disc-over-plane", Illumination::Split, 0.1, 100, 1, &gpu);
    assert_eq!(image.bias(&gpu, 1).upper, 0.0);
}

/// A picture of a scene.
struct PlannedImage {
    of: Viewed,
    plan: ScenePlan,
}

impl PlannedImage {
    /// `radius` as a share of the scene's extent.
    fn new(name: &str, illumination: Illumination, radius: f64, photons: u32, seed: u64, gpu: &Gpu) -> PlannedImage {
        let of = Viewed::new(scene(name));
        let (min, max) = of.scene.bounds();
        let radius = Some(radius * (max - min).max_element());
        let radii = SceneSettings { radius, caustic_radius: radius, shadow_rays: 1, stop: stop(), ..by_rounds() };
        let settings = SceneSettings { photons, caustic_photons: photons, illumination, seed, ..radii };
        PlannedImage { plan: of.planned(gpu, &settings, square_picture(16)), of }
    }

    fn bias(&self, gpu: &Gpu, rounds: u32) -> Bias {
        scene::bias::measure(gpu, &self.of.scene, &self.of.viewpoint(), &self.plan, (1.0, rounds), &NEVER).unwrap().unwrap()
    }

    /// As so many blocks of a run give it.
    fn bias_of_blocks(&self, gpu: &Gpu, blocks: u32) -> Bias {
        let settings = SceneSettings { rounds: blocks, alpha: 1.0, ..self.plan.settings.clone() };
        let bias = self.of.run(gpu, self.of.planned(gpu, &settings, self.plan.sensor)).error().bias.unwrap();
        assert_eq!(bias.from, BiasFrom::Blocks(blocks));
        bias
    }

    /// Values of a batch at radii times a factor.
    fn batch(&self, gpu: &Gpu, rounds: u32, factor: f64, number: u32) -> photonmill::error::Result<Option<Vec<f64>>> {
        let batches = Batches { seed: self.plan.settings.seed, measure: Measure::Rmse, confidence: CONFIDENCE, rounds, cancelled: &NEVER };
        batches.values(factor, number, |batch, control| {
            scene::bias::batch(gpu, &self.of.scene, &self.of.viewpoint(), &self.plan, batch, control)
        })
    }
}
