//! The lobes of layered materials as the kernels and the judge sample them: directions pass a two-sided chi-square test against the
//! densities of the judge, which has the guide's formulas in f64; the kernels' weights and densities are those of the judge and of the
//! kernels' own BRDFs.

use std::cell::Cell;

use crate::common::chi_square::{Grid, counts_check, density_check, even};
use crate::common::densities::{AXIS, ULP, angles, frame, hemisphere_check, is_unit, on_sphere, polar};
use crate::common::plates::COSINES;
use crate::common::prelude::*;
use crate::common::{layered, planted, share_check};
use photonmill::constants::NONE;
use photonmill::engine::scene::resources::SceneResources;
use photonmill::gpu::kernels::CheckLobes;
use photonmill::records::{LobeCase, LobeSample};
use photonmill::verify::judge::lobes::{Class, Film, Frame, Inputs, Kind, Lobes, Wall};
use photonmill::verify::judge::{Random, random};

/// In the order of the kernels' numbers.
const KINDS: [Kind; 6] = [Kind::Diffuse, Kind::Reflection, Kind::Coat, Kind::Transmission, Kind::Sheen, Kind::DiffuseTransmission];
/// Of each case.
const SAMPLES: usize = 8192;

/// Of these, weights and densities are compared: what is wrong with one is wrong with all.
const VALUES: usize = 8;

/// So many roughnesses from the sharpest lobe that is no delta on, by even ratios.
fn alphas(count: i32) -> Vec<f32> {
    let share = |k: i32| 1.0 - f64::from(k) / f64::from(count - 1);
    (0..count).map(|k| (1.000_001 * 1e-4f64.powf(share(k))).min(1.0) as f32).collect()
}

/// Enough for the test of all samples together to notice facets of an alpha 2 % too large.
const ALPHAS: i32 = 10;

/// A white and matt dielectric, without anything that it need not have.
pub(super) fn white(wo: Vec3, normal: Vec3) -> LobeCase {
    LobeCase {
        wo,
        ng: normal,
        ns: normal,
        coat_normal: normal,
        base_colour: Vec3::ONE,
        alpha: 1.0,
        ior: 1.5,
        specular: 1.0,
        eta: 1.0,
        coat_alpha: 1.0,
        sheen_alpha: 1.0,
        coverage: 1.0,
        film_ior: 1.0,
        lobe: NONE,
        ..LobeCase::default()
    }
}

/// A dielectric, seen at a cosine. Its normal has no special direction.
fn plastic(alpha: f32, cosine: f64) -> LobeCase {
    let sine = (1.0 - cosine * cosine).sqrt();
    let wo = (frame(AXIS, DVec3::X) * DVec3::new(0.6 * sine, 0.8 * sine, cosine)).normalize().as_vec3();
    let base_colour = Vec3::new(0.9, 0.4, 0.1);
    LobeCase { base_colour, alpha, seed: 100, carries_radiance: 1, ..white(wo, AXIS.normalize().as_vec3()) }
}

/// The same as a thin wall of glass.
fn pane(alpha: f32, cosine: f64) -> LobeCase {
    LobeCase { transmission: 1.0, ..plastic(alpha, cosine) }
}

/// The same with anisotropy, along a direction that is neither towards the eye nor across.
fn stretched(strength: f32, case: LobeCase) -> LobeCase {
    let tangent = (frame(AXIS, DVec3::X) * DVec3::new(0.96, -0.28, 0.0)).normalize().as_vec3();
    LobeCase { is_stretched: 1, alpha_along: case.alpha + strength * strength * (1.0 - case.alpha), tangent, ..case }
}

/// A lobe by itself.
struct SampledLobe {
    what: &'static str,
    kind: Kind,
    cosines: &'static [f64],
    case: fn(f32, f64) -> LobeCase,
}

#[rustfmt::skip]
const SAMPLED_LOBES: [SampledLobe; 8] = [
    SampledLobe { what: "reflection of a metal", kind: Kind::Reflection, cosines: &COSINES,
        case: |alpha, cosine| LobeCase { metallic: 1.0, ..plastic(alpha, cosine) } },
    // Over black, of which nothing comes back.
    SampledLobe { what: "coat", kind: Kind::Coat, cosines: &COSINES,
        case: |alpha, cosine| LobeCase { coat: 0.8, coat_alpha: alpha, specular: 0.0, base_colour: Vec3::ZERO, ..plastic(0.5, cosine) } },
    SampledLobe { what: "thin transmission", kind: Kind::Transmission, cosines: &COSINES, case: pane },
    SampledLobe { what: "refraction into glass", kind: Kind::Transmission, cosines: &COSINES,
        case: |alpha, cosine| LobeCase { is_solid: 1, eta: 1.0 / 1.5, ..pane(alpha, cosine) } },
    // Total reflection begins at 0.745.
    SampledLobe { what: "refraction out of glass", kind: Kind::Transmission, cosines: &[1.0, 0.8, 0.76, 0.5, 0.2, 0.05],
        case: |alpha, cosine| LobeCase { is_solid: 1, eta: 1.5, carries_radiance: 0, ..pane(alpha, cosine) } },
    SampledLobe { what: "reflection in glass", kind: Kind::Reflection, cosines: &COSINES,
        case: |alpha, cosine| LobeCase { is_solid: 1, eta: 1.5, ..pane(alpha, cosine) } },
    SampledLobe { what: "reflection of an anisotropic metal", kind: Kind::Reflection, cosines: &COSINES,
        case: |alpha, cosine| LobeCase { metallic: 1.0, ..stretched(0.7, plastic(alpha, cosine)) } },
    SampledLobe { what: "refraction into anisotropic glass", kind: Kind::Transmission, cosines: &COSINES,
        case: |alpha, cosine| LobeCase { is_solid: 1, eta: 1.0 / 1.5, ..stretched(0.4, pane(alpha, cosine)) } },
];

fn unit(v: Vec3) -> DVec3 {
    v.as_dvec3().normalize()
}

fn number(kind: Kind) -> u32 {
    KINDS.iter().position(|other| *other == kind).expect("every kind has a number") as u32
}

/// What the judge has for a case.
pub(super) fn judged(case: &LobeCase) -> Lobes {
    let wall = if case.is_solid == 0 { Wall::Thin } else { Wall::Solid { from: f64::from(case.eta), to: 1.0 } };
    let [share, ior, thickness, bound] = [case.iridescence, case.film_ior, case.film_thickness, case.film_bound].map(f64::from);
    let inputs = Inputs {
        base_colour: case.base_colour.as_dvec3(),
        metalness: case.metallic.into(),
        alpha: case.alpha.into(),
        stretch: (case.is_stretched != 0).then(|| (unit(case.tangent), case.alpha_along.into())),
        ior: case.ior.into(),
        specular: case.specular.into(),
        specular_colour: DVec3::ONE,
        transmission: case.transmission.into(),
        diffuse_transmission: case.diffuse_transmission.into(),
        diffuse_transmission_colour: case.diffuse_transmission_colour.as_dvec3(),
        film: Film { share, ior, thickness, bound },
        wall,
        coat: case.coat.into(),
        coat_alpha: case.coat_alpha.into(),
        sheen_colour: case.sheen.as_dvec3(),
        sheen_s: case.sheen_alpha.into(),
    };
    Lobes::new(&inputs, Frame { wo: unit(case.wo), ng: unit(case.ng), n: unit(case.ns), coat_n: unit(case.coat_normal) })
}

/// A direction with the digits that rounding took from its largest component.
fn sharpened(w: Vec3) -> DVec3 {
    let mut w = w.as_dvec3();
    let largest = w.abs().max_position();
    let rest = w.length_squared() - w[largest] * w[largest];
    w[largest] = w[largest].signum() * (1.0 - rest).max(0.0).sqrt();
    w
}

/// A lobe of GGX as the half vectors see it. Their place is (psi / (pi / 2), azimuth), with their slopes over alpha in polar coordinates
/// (tan(psi), azimuth): lobes of every width are equally wide there.
struct Facets<'a> {
    lobes: &'a Lobes,
    kind: Kind,
    wo: DVec3,
    n: DVec3,
    frame: DMat3,
    /// The lesser one.
    alpha: f64,
    /// Along the frame's first axis and its second.
    alphas: DVec2,
    /// Index on this side over the other one, where light is refracted.
    eta: Option<f64>,
}

impl Facets<'_> {
    fn new<'a>(case: &LobeCase, lobes: &'a Lobes, kind: Kind) -> Facets<'a> {
        let (n, alpha) = if kind == Kind::Coat { (case.coat_normal, case.coat_alpha) } else { (case.ns, case.alpha) };
        let (wo, n) = (unit(case.wo), unit(n));
        let is_refracted = kind == Kind::Transmission && case.is_solid != 0;
        let (alpha, eta) = (f64::from(alpha), is_refracted.then(|| case.eta.into()));
        let (frame, along) = match case.is_stretched != 0 && kind != Kind::Coat {
            true => (frame(n, unit(case.tangent)), case.alpha_along.into()),
            false => (frame(n, wo), alpha),
        };
        Facets { lobes, kind, wo, n, frame, alpha, alphas: DVec2::new(along, alpha), eta }
    }

    /// Of any length.
    fn half(&self, wi: DVec3) -> DVec3 {
        match (self.eta, self.kind) {
            (Some(eta), _) => {
                let h = eta * self.wo + wi;
                if h.dot(self.n) < 0.0 { -h } else { h }
            }
            (None, Kind::Transmission) => self.wo + wi - 2.0 * wi.dot(self.n) * self.n,
            _ => self.wo + wi,
        }
    }

    fn place(&self, wi: DVec3) -> (f64, f64) {
        let h = self.frame.transpose() * self.half(wi);
        let scaled = h.truncate() / self.alphas;
        (scaled.length().atan2(h.z) / FRAC_PI_2, scaled.to_angle())
    }

    /// Where a half vector sends light, and the solid angle there over its own.
    fn incoming(&self, h: DVec3) -> Option<(DVec3, f64)> {
        let v_h = self.wo.dot(h);
        if v_h <= 0.0 {
            return None;
        }
        match self.eta {
            Some(eta) => {
                let squared = 1.0 - eta * eta * (1.0 - v_h * v_h);
                let spread = eta * v_h - squared.max(0.0).sqrt();
                (squared > 0.0).then(|| (spread * h - eta * self.wo, spread * spread / squared.sqrt()))
            }
            None => {
                let wi = 2.0 * v_h * h - self.wo;
                let is_beyond = self.kind == Kind::Transmission;
                Some((if is_beyond { wi - 2.0 * wi.dot(self.n) * self.n } else { wi }, 4.0 * v_h))
            }
        }
    }

    /// The judge's density, per area of places.
    fn density(&self, x: f64, azimuth: f64) -> f64 {
        let (psi_sin, psi_cos) = (FRAC_PI_2 * x).sin_cos();
        let slope = psi_sin / psi_cos;
        let local = (slope * self.alphas * DVec2::from_angle(azimuth)).extend(1.0).normalize();
        let solid_angle = slope * local.z.powi(3) * self.alphas.element_product() / (psi_cos * psi_cos) * FRAC_PI_2;
        self.incoming(self.frame * local).map_or(0.0, |(wi, spread)| self.lobes.density(self.kind, wi) * spread * solid_angle)
    }

    /// Probabilities of the cells, and that no light goes on.
    fn probabilities(&self) -> Vec<f64> {
        let grid = cells();
        let mut probabilities = Vec::new();
        for y in grid.y.windows(2) {
            for x in grid.x.windows(2) {
                let (has_light, has_none) = (Cell::new(false), Cell::new(false));
                let density = |x: f64, azimuth: f64| {
                    let density = self.density(x, azimuth);
                    if density > 0.0 { &has_light } else { &has_none }.set(true);
                    density
                };
                let cell = |count| Grid { x: even(x[0], x[1], count), y: even(y[0], y[1], count) };
                let mut probability: f64 = cell(1).probabilities(&density).iter().sum();
                // The density ends within the cell.
                if has_light.get() && has_none.get() && probability > 1e-6 {
                    probability = cell(6).probabilities(&density).iter().sum();
                }
                probabilities.push(probability);
            }
        }
        let sum: f64 = probabilities.iter().sum();
        probabilities.push((1.0 - sum).max(0.0));
        probabilities
    }

    /// Directions in each cell, and trials that gave none.
    fn counts(&self, trials: usize, directions: impl Iterator<Item = DVec3>) -> Result<Vec<u64>, String> {
        let places: Vec<(f64, f64)> = directions.map(|wi| self.place(wi)).collect();
        let mut counts = cells().counts(&places)?;
        counts.push((trials - places.len()) as u64);
        Ok(counts)
    }
}

/// The last ones are small: out of glass at grazing angles only facets that are tilted far let light through.
fn cells() -> Grid {
    let x = even(0.0, 0.9, 9).into_iter().chain([0.95, 0.98, 0.99, 0.995, 0.998, 0.999, 0.9995, 1.0]);
    Grid { x: x.collect(), y: even(-PI, PI, 12) }
}

/// Chi-square, or where nearly no sample goes on whether there are too many.
fn cells_check(what: &str, counts: &[u64], probabilities: &[f64]) -> Check {
    let sum: f64 = probabilities.iter().sum();
    require((sum - 1.0).abs() < 1e-3, || format!("{what}: the density integrates to {sum}"))?;
    let trials = counts.iter().sum::<u64>();
    let alive = trials - counts[counts.len() - 1];
    let expected = trials as f64 * (1.0 - probabilities[probabilities.len() - 1]);
    if expected < 20.0 {
        let most = expected + 6.0 * expected.sqrt() + 6.0;
        return require(alive as f64 <= most, || format!("{what}: {alive} samples instead of {expected}"));
    }
    counts_check(what, counts, probabilities)
}

/// Directions of the samples that go on.
fn alive<'a>(samples: impl Iterator<Item = &'a LobeSample>) -> impl Iterator<Item = DVec3> {
    samples.filter(|sample| sample.is_alive != 0).map(|sample| sharpened(sample.direction))
}

/// The same of the judge's own samples.
fn judges(lobes: &Lobes, kind: Kind, trials: usize, rng: &mut Random) -> impl Iterator<Item = DVec3> {
    (0..trials).filter_map(move |_| lobes.sample(kind, rng)).map(|scattered| scattered.wi)
}

/// What f32 loses: relative errors are bounded by so many units of its rounding, times what the geometry multiplies them by. The worst
/// that lavapipe has is 9.
const ROUNDINGS: f64 = 24.0;
/// Radians that packing turns the normal of a matt coat by.
const PACKED_NORMAL: f64 = 7e-5;

fn relative_error(found: f64, expected: f64) -> f64 {
    match (found - expected).abs() / found.abs().max(expected.abs()) {
        _ if found == expected => 0.0,
        error if error.is_nan() => f64::INFINITY,
        error => error,
    }
}

/// The largest of three channels.
fn largest_relative_error(found: Vec3, expected: DVec3) -> f64 {
    (0..3).map(|channel| relative_error(found[channel].into(), expected[channel])).fold(0.0, f64::max)
}

/// Relative differences of a living sample of a lobe of GGX, in units of [`ULP`] times what the geometry multiplies them by, from the
/// judge: of its weight, of its density; and of their product from the kernel's own BRDF times cosine. Next to the horizon nothing can be
/// said.
fn value_errors(case: &LobeCase, of: &Facets, sample: &LobeSample) -> Option<[f64; 3]> {
    let wi = sharpened(sample.direction);
    let half = of.half(wi);
    let v_h = of.wo.dot(half) / half.length();
    let (cos_v, cos_l) = (of.wo.dot(of.n), wi.dot(of.n).abs());
    // Exact reflectance has a root that ends where total reflection begins.
    let root = 1.0 - f64::from(case.eta).powi(2) * (1.0 - v_h * v_h);
    let smooth = 1.0 / cos_v + 1.0 / cos_l + 1.0 / v_h + if case.is_solid == 0 { 0.0 } else { 1.0 / root.abs() };
    // The half vector has the error of the kernel's frame, and that of the direction over its own length.
    let sharp = smooth + (1.0 + 1.0 / half.length()) / of.alpha;
    if smooth * ULP > 1e-3 {
        return None;
    }
    let chance = f64::from(sample.chance);
    let (density, value) = (of.lobes.density(of.kind, wi), of.lobes.evaluate(of.kind, wi) * wi.dot(of.lobes.axis(of.kind)));
    // Refraction compresses radiance, and no flux.
    let flux = if case.carries_radiance == 0 && of.eta.is_some() { f64::from(case.eta).powi(-2) } else { 1.0 };
    let is_rough = sample.is_sharp == 0;
    let own = if is_rough { sample.rough } else { sample.sharp };
    let own_unit = if is_rough && of.kind == Kind::Coat { PACKED_NORMAL } else { ULP };
    Some([
        largest_relative_error(sample.weight, value * flux / (density * chance)) / (smooth * ULP),
        relative_error(sample.density.into(), density * chance) / (sharp * ULP),
        largest_relative_error(own, sample.weight.as_dvec3() * f64::from(sample.density) / flux) / (sharp * own_unit),
    ])
}

/// On a scene whose table of albedos alone is read; of all lobes and gaps, or of those of facets alone.
pub(super) fn ask(gpu: &Gpu, math: Math, all: bool, cases: &[LobeCase], samples: usize) -> Vec<LobeSample> {
    let always = ["HAS_LAYERS", "HAS_TRANSMISSION", "HAS_COATS", "HAS_ANISOTROPY"].map(|name| (name, true));
    let others = ["HAS_SHEEN", "HAS_DIFFUSE_TRANSMISSION", "HAS_IRIDESCENCE", "HAS_PASSING"].map(|name| (name, all));
    let constants = always.into_iter().chain(others).fold(Constants::new(128), |set, (name, has)| set.set(name, has.into()));
    let constants = constants.set("STRICT_MATH", math as u32);
    let commands = &mut Commands::new(gpu, constants, Instant::now()).unwrap();
    let plate = scene_of(vec![level(0.0, [1.0; 2], true, 0)], vec![layered::dull(0.5)], vec![sun(DVec3::NEG_Y)]);
    let (geometry, plan) = scene_plan(gpu, &plate, &flights(100, 1), square_picture(1)).unwrap();
    let SceneResources { scene, .. } = &SceneResources::new(commands, &geometry, &plan, &[]).unwrap();
    let inputs = commands.uploaded("lobe cases", cases).unwrap();
    let count = cases.len() * samples;
    let results = gpu.buffer("lobe samples", count as u64, Memory::Device).unwrap();
    commands.dispatch(CheckLobes { scene, cases: &inputs, results: &results }, &(), Extent::Items(count as u64)).unwrap();
    commands.read(&results, count).unwrap()
}

/// All checks of a lobe at these roughnesses, by itself and over all of them.
fn sampled_lobe_check(gpu: &Gpu, sampled: usize, alphas: &[f32]) -> Check {
    let SampledLobe { what, kind, cosines, case } = &SAMPLED_LOBES[sampled];
    let (seed, lobe) = (sampled as u32, number(*kind));
    let with = |alpha: f32| cosines.iter().map(move |cosine| LobeCase { seed, lobe, ..case(alpha, *cosine) });
    let cases: Vec<LobeCase> = alphas.iter().flat_map(|alpha| with(*alpha)).collect();
    let samples = ask(gpu, Math::Fast, false, &cases, SAMPLES);
    let (mut worst, mut left_out, mut all_counts, mut all_probabilities) = ([0.0f64; 3], 0u32, Vec::new(), Vec::new());
    let mut rng = random(sampled as u64, 1);
    for (case, samples) in pairs(&cases, samples.chunks(SAMPLES)) {
        let lobes = judged(case);
        let of = Facets::new(case, &lobes, *kind);
        let what = format!("{what}, alpha {:.3e}, cosine {:.2}", of.alpha, of.wo.dot(of.n));
        let mut of_case = [0.0f64; 3];
        for (k, sample) in samples.iter().enumerate() {
            require(sample.lobe == lobe && sample.passes == 0, || format!("{what}: {sample:?} is of another lobe"))?;
            require((sample.is_sharp != 0) == (lobes.class(*kind) == Class::Sharp), || format!("{what}: {sample:?} is of another class"))?;
            if sample.is_alive != 0 {
                is_unit(&what, sample.direction, 32.0 * ULP)?;
                if k.is_multiple_of(VALUES) {
                    match value_errors(case, &of, sample) {
                        Some(errors) => of_case = std::array::from_fn(|which| of_case[which].max(errors[which])),
                        None => left_out += 1,
                    }
                }
            }
        }
        worst = std::array::from_fn(|which| worst[which].max(of_case[which]));
        for (error, values) in of_case.into_iter().zip(["weights are", "densities are", "the BRDF is"]) {
            require(error <= ROUNDINGS, || format!("{what}: {values} off, {of_case:?}"))?;
        }
        let counts = of.counts(SAMPLES, alive(samples.iter()))?;
        let probabilities = of.probabilities();
        cells_check(&what, &counts, &probabilities)?;
        let of_judge = of.counts(SAMPLES / 4, judges(&lobes, *kind, SAMPLES / 4, &mut rng))?;
        cells_check(&format!("{what}, of the judge"), &of_judge, &probabilities)?;
        all_counts.resize(counts.len(), 0);
        all_probabilities.resize(counts.len(), 0.0);
        all_counts.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        all_probabilities.iter_mut().zip(probabilities).for_each(|(sum, share)| *sum += share / cases.len() as f64);
    }
    println!("{what}: {worst:?}, {left_out} left out");
    let share = f64::from(left_out) / (cases.len() * SAMPLES / VALUES) as f64;
    require(share < 1e-4, || format!("{what}: {share} of all samples lie too near the horizon"))?;
    cells_check(&format!("{what}, all together"), &all_counts, &all_probabilities)
}

#[test]
fn lobes_by_themselves_follow_their_densities() {
    let alphas = alphas(of_run(ALPHAS, 40));
    let Some(gpu) = device() else { return };
    for (number, sampled) in SAMPLED_LOBES.iter().enumerate() {
        assert_holds(sampled.what, sampled_lobe_check(&gpu, number, &alphas));
    }
}

/// A unit vector off another by a tenth or so.
fn tilted(normal: Vec3, aside: Vec3) -> Vec3 {
    (unit(normal) + 0.15 * aside.as_dvec3()).normalize().as_vec3()
}

/// Surfaces of many lobes.
fn mixtures() -> [(&'static str, LobeCase); 4] {
    let covered = LobeCase { coat: 0.7, coat_alpha: 0.2, sheen: Vec3::new(0.3, 0.25, 0.1), sheen_alpha: 0.3, ..plastic(0.1, 0.6) };
    let beyond = Vec3::new(0.2, 0.7, 0.5);
    let paper = LobeCase { diffuse_transmission: 0.4, diffuse_transmission_colour: beyond, ..covered };
    let all = LobeCase { metallic: 0.3, transmission: 0.4, coverage: 0.7, ..paper };
    [
        ("a thin wall of all lobes", LobeCase { ng: tilted(all.ng, Vec3::X), coat_normal: tilted(all.ns, Vec3::Z), ..all }),
        ("rough lobes", LobeCase { alpha: 0.5, coat_alpha: 0.4, transmission: 0.0, sheen_alpha: 0.1, coverage: 0.2, ..all }),
        ("anisotropic plastic", stretched(0.6, LobeCase { metallic: 0.2, coat: 0.3, coat_alpha: 0.3, ..plastic(0.3, 0.6) })),
        (
            "coated glass",
            LobeCase { is_solid: 1, eta: 1.0 / 1.5, transmission: 0.8, coat: 0.4, sheen: Vec3::ZERO, coverage: 1.0, ..plastic(0.3, 0.8) },
        ),
    ]
}

/// Of weights that rest on the tables of albedos. The worst is 0.0011.
const TABLE_ERROR: f64 = 0.004;
/// Below this cosine the tables are coarse.
const LEAST_COSINE: f64 = 0.02;

/// All lobes, as a path chooses among them.
fn mixture_check(gpu: &Gpu, math: Math) -> Check {
    let mut rng = random(1, 1);
    let samples_of_each = 16 * SAMPLES;
    let (names, cases): (Vec<_>, Vec<_>) = mixtures().into_iter().unzip();
    let samples = ask(gpu, math, true, &cases, samples_of_each);
    for ((what, case), samples) in pairs(pairs(names, &cases), samples.chunks(samples_of_each)) {
        let lobes = judged(case);
        let (passed, met): (Vec<&LobeSample>, Vec<&LobeSample>) = samples.iter().partition(|sample| sample.passes != 0);
        let gap = f64::from(1.0 - case.coverage);
        if gap > 0.0 {
            share_check(what, passed.len() as u64, samples.len() as u64, gap)?;
        }
        for sample in &passed {
            let is_right = sample.direction == -case.wo && sample.is_alive != 0 && sample.density == 0.0;
            require(is_right && largest_relative_error(sample.weight, DVec3::ONE) < 4.0 * ULP, || {
                format!("{what}: {sample:?} does not pass")
            })?;
        }
        let chance = |kind| met.iter().find(|sample| sample.lobe == number(kind)).map_or(0.0, |sample| f64::from(sample.chance));
        let chances = KINDS.map(chance);
        let sum: f64 = chances.iter().sum();
        require((sum - 1.0).abs() < 8.0 * ULP, || format!("{what}: {chances:?} make {sum}"))?;
        let of_kinds = KINDS.map(|kind| met.iter().copied().filter(|sample| sample.lobe == number(kind)).collect::<Vec<_>>());
        counts_check(what, &of_kinds.each_ref().map(|of| of.len() as u64), &chances)?;

        let mut worst = [0.0f64; 2];
        for (kind, samples) in KINDS.into_iter().zip(of_kinds) {
            if samples.is_empty() {
                continue;
            }
            let of = Facets::new(case, &lobes, kind);
            let what = format!("{math:?}, {what}, {kind:?}");
            let is_broad = matches!(kind, Kind::Diffuse | Kind::Sheen | Kind::DiffuseTransmission);
            if is_broad {
                let side = if kind.is_beyond() { -1.0 } else { 1.0 };
                let directions: Vec<Vec3> = samples.iter().map(|sample| side * sample.direction).collect();
                hemisphere_check(&what, &directions, of.frame, |wi| wi.dot(of.n) / PI)?;
                // Of the judge's some lie below the triangle and are lost.
                let places: Vec<(f64, f64)> =
                    judges(&lobes, kind, SAMPLES, &mut rng).map(|wi| polar(of.frame, (f64::from(side) * wi).as_vec3())).collect();
                let density = on_sphere(of.frame, |wi| lobes.density(kind, f64::from(side) * wi));
                let grid = angles(even(0.0, FRAC_PI_2, 20));
                density_check(&format!("{what}, of the judge"), &places, SAMPLES, &grid, (1.0 - 1e-9, 0.1), &density)?;
            } else {
                cells_check(&what, &of.counts(samples.len(), alive(samples.iter().copied()))?, &of.probabilities())?;
            }
            for sample in samples.into_iter().step_by(VALUES) {
                let wi = sharpened(sample.direction);
                let cosine = wi.dot(lobes.axis(kind));
                if sample.is_alive == 0 || wi.dot(of.n).abs().min(cosine) < LEAST_COSINE {
                    continue;
                }
                let density = if is_broad { cosine / PI } else { lobes.density(kind, wi) };
                let expected = lobes.evaluate(kind, wi) * cosine / (density * f64::from(sample.chance));
                let weight = largest_relative_error(sample.weight, expected);
                let all: DVec3 = KINDS.into_iter().map(|kind| lobes.evaluate(kind, wi) * wi.dot(lobes.axis(kind)).max(0.0)).sum();
                let together = largest_relative_error(sample.rough + sample.sharp, all);
                require(weight < TABLE_ERROR, || format!("{what}: {sample:?}: the weight is {weight} off {expected}"))?;
                require(together < TABLE_ERROR, || format!("{what}: {sample:?}: the BRDF is {together} off {all}"))?;
                worst = [worst[0].max(weight), worst[1].max(together)];
            }
        }
        println!("{math:?}, {what}: weights up to {:.1e} off, BRDFs {:.1e}", worst[0], worst[1]);
    }
    Ok(())
}

#[test]
fn surfaces_of_many_lobes_are_sampled_as_they_weigh_light() {
    let Some(gpu) = device() else { return };
    for math in [Math::Fast, Math::Strict].into_iter().take(of_run(1, 2)) {
        assert_holds(format!("{math:?}"), mixture_check(&gpu, math));
    }
}

/// A change of a file of the kernel, and which check must notice it: that of a subject, or of mixtures.
#[derive(Clone, Copy)]
struct Fault {
    what: &'static str,
    file: &'static str,
    from: &'static str,
    to: &'static str,
    sampled: Option<usize>,
    /// Part of the complaint.
    noticed: &'static str,
}

#[rustfmt::skip]
const FAULTS: [Fault; 12] = [
    Fault { what: "facets of a stretch 2 % too large", sampled: Some(6), noticed: "chi-square",
        file: "material/ggx.glsl", from: "alpha.x = facets.is_stretched ? facets.alpha_along : facets.alpha;",
        to: "alpha.x = facets.is_stretched ? 1.02 * facets.alpha_along : facets.alpha;" },
    Fault { what: "stretched facets that shadow as even ones", sampled: Some(6), noticed: "weights are off",
        file: "material/ggx.glsl", from: "return sqrt(dot(beside, beside) + cosine * cosine);",
        to: "return ggx_root(facets.alpha, cosine);" },
    Fault { what: "a density of stretched facets along the wrong axis", sampled: Some(7), noticed: "densities are off",
        file: "material/ggx.glsl", from: "ratio * h.x * h.x + divide(h.y * h.y, ratio)",
        to: "ratio * h.y * h.y + divide(h.x * h.x, ratio)" },
    Fault { what: "facets of an alpha 2 % too large", sampled: Some(0), noticed: "chi-square",
        file: "material/ggx.glsl", from: "return normalize(vec3(alpha * h.xy,",
        to: "return normalize(vec3(1.02 * alpha * h.xy," },
    Fault { what: "facets that are seen from the normal", sampled: Some(1), noticed: "chi-square",
        file: "material/ggx.glsl", from: "vec3 stretched = normalize(vec3(alpha * v.xy, v.z));",
        to: "vec3 stretched = vec3(0.0, 0.0, 1.0);" },
    Fault { what: "a weight with the masking of an alpha 1 % too large", sampled: Some(1), noticed: "weights are off",
        file: "material/ggx.glsl", from: "4.0 * facet_visibility(facets,",
        to: "4.0 * facet_visibility(even_facets(facets.n, 1.01 * facets.alpha)," },
    Fault { what: "a density 1 % too large", sampled: Some(2), noticed: "densities are off",
        file: "material/ggx.glsl", from: "density *= 0.25;",
        to: "density *= 0.2525;" },
    Fault { what: "refraction by an index 1 % too large", sampled: Some(3), noticed: "weights are off",
        file: "material/lobes/transmission.glsl", from: "refracted_cosine_squared(facet.along, eta);",
        to: "refracted_cosine_squared(facet.along, 1.01 * eta);" },
    Fault { what: "a density without the cosine of what is refracted", sampled: Some(4), noticed: "densities are off",
        file: "material/lobes/transmission.glsl", from: "density *= facet.along * divide(l_h,",
        to: "density *= facet.along * divide(1.0," },
    Fault { what: "a BTDF without the squared index", sampled: Some(4), noticed: "the BRDF is off",
        file: "material/lobes/transmission.glsl", from: "float value = eta * eta * both",
        to: "float value = both" },
    Fault { what: "a number that chooses the lobe and the direction", sampled: None, noticed: "chi-square",
        file: "material/bsdf.glsl", from: "return sample_facet_lobe(surface, lobes, wo, u.yz,",
        to: "return sample_facet_lobe(surface, lobes, wo, u.xz," },
    Fault { what: "a number that chooses the gap and the direction", sampled: None, noticed: "chi-square",
        file: "material/bsdf.glsl", from: "u.y = divide(u.y - lobes.pass_chance, 1.0 - lobes.pass_chance);",
        to: "" },
];

/// In the short run one that each complaint is about, and one of mixtures.
#[test]
fn faults_of_the_sampling_are_noticed() {
    let mut noticed = HashSet::new();
    let faults = FAULTS.iter().filter(|fault| is_long_run() || noticed.insert((fault.noticed, fault.sampled.is_some())));
    let Some(mut gpu) = device() else { return };
    let alphas = alphas(ALPHAS);
    for Fault { what, file, from, to, sampled, noticed } in faults.copied() {
        gpu.replace(planted::kernels(&["check_lobes"], file, &[(from, to)]));
        let check = match sampled {
            // Each value is wrong, and samples are by their number.
            Some(sampled) => sampled_lobe_check(&gpu, sampled, if noticed == "chi-square" { &alphas } else { &alphas[4..6] }),
            None => mixture_check(&gpu, Math::Fast),
        };
        println!("{what}: {check:?}");
        let is_noticed = check.as_ref().is_err_and(|complaint| complaint.contains(noticed));
        assert!(is_noticed, "{what} is to be noticed because {noticed}: {check:?}");
    }
}
