//! No layered material returns more than it receives, whatever its layers, its normals and the direction: random ones, by the path
//! tracer's lobes and by the kernels' (a furnace: under a sky of 1, what is sent back is the mean weight of samples).

use photonmill::constants::NONE;
use photonmill::records::{LobeCase, LobeSample};
use photonmill::scene::material::Layers;
use photonmill::verify::judge::lobes::Kind;
use photonmill::verify::judge::{Random, random};

use super::lobe_sampling::{ask, judged};
use crate::common::densities::frame;
use crate::common::planted;
use crate::common::prelude::*;

const KINDS: [Kind; 6] = [Kind::Diffuse, Kind::Reflection, Kind::Transmission, Kind::Coat, Kind::Sheen, Kind::DiffuseTransmission];

/// What interpolated tables of albedos may add.
const OF_TABLES: f64 = 2e-3;

struct Draws(Random);

impl Draws {
    fn uniform(&mut self) -> f64 {
        f64::from(rand_pcg::rand_core::Rng::next_u32(&mut self.0)) / 4_294_967_296.0
    }

    fn is(&mut self, chance: f64) -> bool {
        self.uniform() < chance
    }

    /// A share: 0, 1, or in between.
    fn share(&mut self) -> f32 {
        let place = self.uniform();
        (if place < 0.2 {
            0.0
        } else if place < 0.6 {
            1.0
        } else {
            self.uniform()
        }) as f32
    }

    fn colour(&mut self) -> Vec3 {
        if self.is(0.6) { Vec3::ONE } else { Vec3::new(self.share(), self.share(), self.share()) }
    }

    /// Squared roughness: smooth, rough, or in between.
    fn alpha(&mut self) -> f32 {
        let roughness = self.share();
        roughness * roughness
    }

    /// At an angle of up to so many radians from the vertical.
    fn direction(&mut self, most: f64) -> DVec3 {
        let (sin, cos) = (most * self.uniform()).sin_cos();
        let azimuth = TAU * self.uniform();
        DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
    }

    /// As normal maps make it: none, or tilted, and moved towards the eye where it looks away (`mapped_normal` of the kernels).
    fn normal(&mut self, wo: DVec3) -> DVec3 {
        let n = if self.is(0.3) { DVec3::Z } else { self.direction(1.4) };
        let cosine = n.dot(wo);
        if cosine < 0.01 { (n + (0.01 - cosine) * wo).normalize() } else { n }
    }

    /// One of so many materials: the first are plates under clear coats, seen at two angles, with a normal map that tilts them towards the
    /// eye; the others are random.
    fn case_of(&mut self, number: usize) -> LobeCase {
        let Some(degrees) = [60.0f64, 87.0].get(number) else { return self.case() };
        let at = |degrees: f64| Vec3::new(degrees.to_radians().sin() as f32, 0.0, degrees.to_radians().cos() as f32);
        LobeCase {
            wo: at(*degrees),
            ng: Vec3::Z,
            ns: at(25.0),
            coat_normal: Vec3::Z,
            base_colour: Vec3::ONE,
            alpha: 1.0,
            ior: 1.5,
            eta: 1.0,
            coat: 1.0,
            sheen_alpha: 1.0,
            coverage: 1.0,
            film_ior: 1.0,
            lobe: NONE,
            ..LobeCase::default()
        }
    }

    fn case(&mut self) -> LobeCase {
        let most = if self.is(0.5) { 1.57 } else { 1.2 };
        let wo = self.direction(most);
        let wo = DVec3::new(wo.x, wo.y, wo.z.max(1e-3)).normalize();
        let (ns, coat_normal) = (self.normal(wo), self.normal(wo));
        let is_solid = self.is(0.4);
        let ior = [1.0, 1.33, 1.5, 2.4, 5.0][(5.0 * self.uniform()) as usize];
        let mut case = LobeCase {
            wo: wo.as_vec3(),
            ng: Vec3::Z,
            ns: ns.as_vec3(),
            coat_normal: coat_normal.as_vec3(),
            base_colour: self.colour(),
            metallic: if self.is(0.6) { 0.0 } else { self.share() },
            alpha: self.alpha(),
            ior,
            specular: if self.is(0.5) { 1.0 } else { self.share() },
            eta: 1.0,
            coat: self.share(),
            coat_alpha: self.alpha(),
            sheen_alpha: 1.0,
            coverage: 1.0,
            film_ior: 1.0,
            lobe: NONE,
            carries_radiance: 0,
            ..LobeCase::default()
        };
        if self.is(0.3) {
            (case.sheen, case.sheen_alpha) = (self.colour(), self.alpha().max(0.01));
        }
        if self.is(0.4) {
            case.transmission = self.share();
        }
        if self.is(0.3) {
            (case.diffuse_transmission, case.diffuse_transmission_colour) = (self.share(), self.colour());
        }
        if is_solid && case.transmission > 0.0 {
            case.is_solid = 1;
            case.eta = if self.is(0.5) { ior } else { 1.0 / ior };
        }
        if self.is(0.3) {
            case.alpha = case.alpha.max(1e-4);
            case.is_stretched = 1;
            let strength = self.share();
            case.alpha_along = case.alpha + strength * strength * (1.0 - case.alpha);
            let turn = TAU * self.uniform();
            case.tangent = (frame(ns, DVec3::X) * DVec3::new(turn.cos(), turn.sin(), 0.0)).normalize().as_vec3();
        }
        if self.is(0.3) {
            case.iridescence = self.share();
            case.film_ior = (1.0 + 1.5 * self.uniform()) as f32;
            case.film_thickness = (900.0 * self.uniform()) as f32;
            let thickness = [0.0, case.film_thickness];
            let of = Layers {
                iridescence: 1.0,
                film_ior: case.film_ior,
                film_thickness: thickness,
                ior,
                specular: case.specular,
                ..Layers::default()
            };
            case.film_bound = of.film_bound() as f32;
        }
        case
    }
}

/// Radiance over the squared index is what refraction leaves as it is.
fn flux_scale(case: &LobeCase, kind: Kind) -> f64 {
    if kind == Kind::Transmission && case.is_solid != 0 { f64::from(case.eta).powi(-2) } else { 1.0 }
}

/// What the path tracer's lobes send back of a sky of 1 in the largest channel, and its standard error. `below` is the case by which all
/// but the coat is lit.
fn returned(case: &LobeCase, below: &LobeCase, count: u32, rng: &mut Random) -> (f64, f64) {
    let (coat, others) = (judged(case), judged(below));
    let (mut mean, mut squared) = (DVec3::ZERO, DVec3::ZERO);
    for kind in KINDS {
        let lobes = if kind == Kind::Coat { &coat } else { &others };
        let count = if lobes.is_delta(kind) { 1 } else { count };
        let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
        for _ in 0..count {
            let weight = flux_scale(case, kind) * lobes.sample(kind, rng).map_or(DVec3::ZERO, |scattered| scattered.weight);
            sum += weight;
            squares += weight * weight;
        }
        let n = f64::from(count);
        mean += sum / n;
        squared += (squares / n - (sum / n) * (sum / n)).max(DVec3::ZERO) / n;
    }
    let channel = mean.max_position();
    (mean[channel], squared[channel].sqrt())
}

fn is_above_one(sum: f64, error: f64) -> bool {
    sum > 1.0 + OF_TABLES + 5.0 * error
}

/// Random materials of the path tracer that send back too much, the worst first.
fn gains(count: usize, most_samples: u32, below: impl Fn(LobeCase) -> LobeCase) -> Vec<(LobeCase, f64, f64)> {
    let mut draws = Draws(random(50, 4));
    let mut rng = random(50, 5);
    let mut found = Vec::new();
    for number in 0..count {
        let case = draws.case_of(number);
        let below = below(case);
        let (mut sum, mut error) = returned(&case, &below, 100, &mut rng);
        // What may be above is looked at more closely.
        for samples in [1000, most_samples] {
            if sum < 1.0 - 3.0 * error || is_above_one(sum, error) || error < 0.2 * OF_TABLES {
                break;
            }
            (sum, error) = returned(&case, &below, samples, &mut rng);
        }
        if is_above_one(sum, error) {
            found.push((case, sum, error));
        }
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found
}

fn no_gain_check(count: usize, most_samples: u32, below: impl Fn(LobeCase) -> LobeCase) -> Check {
    let found = gains(count, most_samples, below);
    found.iter().take(8).for_each(|(case, sum, error)| println!("{sum:.4} +- {error:.4}: {case:?}"));
    require(found.is_empty(), || format!("{} of {count} materials gain light, up to {}", found.len(), found[0].1))
}

#[test]
fn no_material_of_the_path_tracer_returns_more_than_it_receives() {
    assert_holds("random materials", no_gain_check(160, 5000, |case| case));
    // A coat that takes by the base's normal what it reflects by its own.
    let by_the_base = no_gain_check(20, 1000, |case| LobeCase { coat_normal: case.ns, ..case });
    assert_complains("coats that dim by the base's normal", by_the_base);
}

#[test]
#[ignore = "long: minutes"]
fn none_of_two_thousand_materials_returns_more_than_it_receives() {
    assert_holds("random materials", no_gain_check(2000, 60_000, |case| case));
}

/// The same of the kernels' samples, as a path chooses among all lobes.
fn kernels_check(gpu: &Gpu, count: usize) -> Check {
    const SAMPLES: usize = 2048;
    let mut draws = Draws(random(50, 6));
    let cases: Vec<LobeCase> = (0..count).map(|seed| LobeCase { seed: seed as u32, ..draws.case_of(seed) }).collect();
    let samples = ask(gpu, Math::Fast, true, &cases, SAMPLES);
    let (mut gains, mut most) = (0, 0.0f64);
    for (case, samples) in pairs(&cases, samples.chunks(SAMPLES)) {
        let passed = samples.iter().filter(|sample| sample.passes != 0).count();
        // What the caller of the sampling makes of it.
        let met = SAMPLES as f64 / (SAMPLES - passed).max(1) as f64;
        let weight = |sample: &LobeSample| match (sample.is_alive, sample.passes) {
            (0, _) => DVec3::ZERO,
            (_, 0) => met * sample.weight.as_dvec3(),
            _ => sample.weight.as_dvec3(),
        };
        let mean = samples.iter().map(weight).sum::<DVec3>() / SAMPLES as f64;
        let channel = mean.max_position();
        let squares = samples.iter().map(|sample| (weight(sample)[channel] - mean[channel]).powi(2)).sum::<f64>();
        let error = squares.sqrt() / SAMPLES as f64;
        require(mean.is_finite(), || format!("{case:?}: {mean}"))?;
        if is_above_one(mean[channel], error) {
            println!("{:.4} +- {error:.4}: {case:?}", mean[channel]);
            gains += 1;
        }
        most = most.max((mean[channel] - 1.0 - OF_TABLES) / error.max(1e-12));
    }
    println!("the most above 1, in standard errors: {most:.1}");
    require(gains == 0, || format!("{gains} of {count} materials gain light"))
}

#[test]
fn no_material_of_the_kernels_returns_more_than_it_receives() {
    let Some(mut gpu) = device() else { return };
    assert_holds("random materials", kernels_check(&gpu, 200));
    let (from, to) = ("max(dot(layers.coat_normal, wo), 1e-6)", "cosine");
    gpu.replace(planted::kernels(&["check_lobes"], "material/layered_lobes.glsl", &[(from, to)]));
    assert_complains("coats that dim by the base's normal", kernels_check(&gpu, 20));
}
