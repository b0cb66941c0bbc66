//! No layered material returns more than it receives, whatever its layers, its normals and the direction: random ones, by the path
//! tracer's lobes and by the kernels' (a furnace: under a sky of 1, what is sent back is the mean weight of samples).

use photonmill::records::{LobeCase, LobeSample};
use photonmill::scene::material::Layers;
use photonmill::verify::judge::lobes::Kind;
use photonmill::verify::judge::{Random, random};

use super::lobe_sampling::{ask, judged, white};
use crate::common::densities::frame;
use crate::common::layered::{LOBES, film, sampled};
use crate::common::planted;
use crate::common::prelude::*;

/// What interpolated tables of albedos may add.
const OF_TABLES: f64 = 2e-3;

pub(super) struct Draws(pub(super) Random);

impl Draws {
    fn uniform(&mut self) -> f64 {
        f64::from(rand_pcg::rand_core::Rng::next_u32(&mut self.0)) / 4_294_967_296.0
    }

    fn is(&mut self, chance: f64) -> bool {
        self.uniform() < chance
    }

    /// A share: 0, 1, or in between.
    fn share(&mut self) -> f32 {
        match self.uniform() {
            place if place < 0.2 => 0.0,
            place if place < 0.6 => 1.0,
            _ => self.uniform() as f32,
        }
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
    pub(super) fn direction(&mut self, most: f64) -> DVec3 {
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
        LobeCase { ns: at(25.0), specular: 0.0, coat: 1.0, coat_alpha: 0.0, ..white(at(*degrees), Vec3::Z) }
    }

    fn case(&mut self) -> LobeCase {
        let most = if self.is(0.5) { 1.57 } else { 1.2 };
        let wo = self.direction(most);
        let wo = DVec3::new(wo.x, wo.y, wo.z.max(1e-3)).normalize();
        let (ns, coat_normal) = (self.normal(wo), self.normal(wo));
        let is_solid = self.is(0.4);
        let ior = [1.0, 1.33, 1.5, 2.4, 5.0][(5.0 * self.uniform()) as usize];
        let mut case = LobeCase {
            ns: ns.as_vec3(),
            coat_normal: coat_normal.as_vec3(),
            base_colour: self.colour(),
            metallic: if self.is(0.6) { 0.0 } else { self.share() },
            alpha: self.alpha(),
            ior,
            specular: if self.is(0.5) { 1.0 } else { self.share() },
            coat: self.share(),
            coat_alpha: self.alpha(),
            ..white(wo.as_vec3(), Vec3::Z)
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
            let of = Layers { ior, specular: case.specular, ..Layers::default() };
            case.film_bound = film(case.film_ior, case.film_thickness, &of).film_bound() as f32;
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
    for kind in LOBES {
        let lobes = if kind == Kind::Coat { &coat } else { &others };
        let count = if lobes.is_delta(kind) { 1 } else { count };
        let of_lobe = sampled(lobes, kind, count, rng, |_| flux_scale(case, kind));
        (mean, squared) = (mean + of_lobe.0, squared + of_lobe.1);
    }
    let channel = mean.max_position();
    (mean[channel], squared[channel].sqrt())
}

fn is_above_one(sum: f64, error: f64) -> bool {
    sum > 1.0 + OF_TABLES + 5.0 * error
}

/// Random materials of the path tracer of which none may send back too much; the worst are printed.
fn no_gain_check(count: usize, most_samples: u32, below: impl Fn(LobeCase) -> LobeCase) -> Check {
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
    found.iter().take(8).for_each(|(case, sum, error)| println!("{sum:.4} +- {error:.4}: {case:?}"));
    require(found.is_empty(), || format!("{} of {count} materials gain light, up to {}", found.len(), found[0].1))
}

#[test]
fn no_material_of_the_path_tracer_returns_more_than_it_receives() {
    let (count, most_samples) = of_run((160, 5000), (2000, 60_000));
    assert_holds("random materials", no_gain_check(count, most_samples, |case| case));
    // A coat that takes by the base's normal what it reflects by its own.
    let by_the_base = no_gain_check(20, 1000, |case| LobeCase { coat_normal: case.ns, ..case });
    assert_complains("coats that dim by the base's normal", by_the_base);
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
        let (means, errors) = mean_of_all(&samples.iter().map(weight).collect::<Vec<_>>());
        require(means.is_finite(), || format!("{case:?}: {means}"))?;
        let (mean, error) = (means.max_element(), errors[means.max_position()]);
        if is_above_one(mean, error) {
            println!("{mean:.4} +- {error:.4}: {case:?}");
            gains += 1;
        }
        most = most.max((mean - 1.0 - OF_TABLES) / error.max(1e-12));
    }
    println!("the most above 1, in standard errors: {most:.1}");
    require(gains == 0, || format!("{gains} of {count} materials gain light"))
}

#[test]
fn no_material_of_the_kernels_returns_more_than_it_receives() {
    let Some(mut gpu) = device() else { return };
    assert_holds("random materials", kernels_check(&gpu, 200));
    let (from, to) = ("max(dot(layers.coat_normal, wo), 1e-6)", "cosine");
    gpu.replace(planted::kernels(&["check_lobes"], "material/bsdf.glsl", &[(from, to)]));
    assert_complains("coats that dim by the base's normal", kernels_check(&gpu, 20));
}
