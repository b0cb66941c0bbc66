//! The lobes of layered materials in f64, as the path tracer has them: albedos and reciprocity. Densities are `lobe_sampling`'s.

use crate::common::layered;
use crate::common::prelude::*;
use photonmill::verify::judge::lobes::{Film, Frame, Inputs, Kind, Lobes, Wall};
use photonmill::verify::judge::{Random, random};

const COSINES: [f64; 5] = [1.0, 0.8, 0.5, 0.2, 0.05];
const KINDS: [Kind; 6] = [Kind::Diffuse, Kind::Reflection, Kind::Transmission, Kind::Coat, Kind::Sheen, Kind::DiffuseTransmission];

/// A white dielectric without anything else, of this roughness.
fn plastic(roughness: f64) -> Inputs {
    Inputs {
        base_colour: DVec3::ONE,
        metalness: 0.0,
        alpha: roughness * roughness,
        stretch: None,
        ior: 1.5,
        specular: 1.0,
        specular_colour: DVec3::ONE,
        transmission: 0.0,
        diffuse_transmission: 0.0,
        diffuse_transmission_colour: DVec3::ONE,
        film: Film::NONE,
        wall: Wall::Thin,
        coat: 0.0,
        coat_alpha: 0.0,
        sheen_colour: DVec3::ZERO,
        sheen_s: 0.01,
    }
}

fn metal(roughness: f64) -> Inputs {
    Inputs { metalness: 1.0, ..plastic(roughness) }
}

fn glass(roughness: f64, wall: Wall) -> Inputs {
    Inputs { transmission: 1.0, wall, ..plastic(roughness) }
}

fn solid(roughness: f64, from: f64, to: f64) -> Inputs {
    glass(roughness, Wall::Solid { from, to })
}

fn film(ior: f64, thickness: f64, bound: f64) -> Film {
    Film { share: 1.0, ior, thickness, bound }
}

fn wo(cosine: f64) -> DVec3 {
    DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine)
}

#[expect(clippy::large_types_passed_by_value, reason = "the lobes keep it")]
fn lobes(inputs: Inputs, wo: DVec3) -> Lobes {
    Lobes::new(inputs, Frame { wo, ng: DVec3::Z, n: DVec3::Z, coat_n: DVec3::Z })
}

/// Of every lobe alone and of mixtures.
fn materials() -> Vec<(&'static str, Inputs)> {
    let tinted = DVec3::new(0.9, 0.5, 0.1);
    let sheen = |roughness: f64| Inputs { sheen_colour: DVec3::ONE, sheen_s: roughness * roughness, ..plastic(0.5) };
    vec![
        ("plastic", plastic(0.45)),
        ("rough plastic", plastic(1.0)),
        ("smooth plastic", plastic(0.0)),
        ("ior 0", Inputs { ior: 0.0, ..plastic(0.6) }),
        ("tinted specular", Inputs { specular_colour: tinted * 30.0, specular: 0.7, ior: 1.8, ..plastic(0.6) }),
        ("metal", metal(0.5)),
        ("half metal", Inputs { metalness: 0.5, base_colour: tinted, ..plastic(0.7) }),
        ("thin glass", glass(0.0, Wall::Thin)),
        ("rough thin glass", glass(0.5, Wall::Thin)),
        ("half thin glass", Inputs { transmission: 0.5, metalness: 0.2, ..glass(0.7, Wall::Thin) }),
        ("glass", solid(0.0, 1.0, 1.5)),
        ("rough glass", solid(0.6, 1.0, 1.5)),
        ("rough glass from inside", solid(0.6, 1.5, 1.0)),
        ("rough glass in oil", Inputs { specular: 0.5, transmission: 0.7, ..solid(0.8, 1.2, 1.8) }),
        ("coat over metal", Inputs { coat: 1.0, coat_alpha: 0.2, ..metal(0.6) }),
        ("coat over plastic", Inputs { coat: 1.0, coat_alpha: 0.25, ..plastic(0.7) }),
        ("smooth coat over plastic", Inputs { coat: 1.0, ..plastic(0.5) }),
        ("coat over glass", Inputs { coat: 0.5, coat_alpha: 0.3, ..glass(0.5, Wall::Thin) }),
        ("sheen", sheen(1.0)),
        ("sharper sheen", sheen(0.4)),
        ("paper", Inputs { diffuse_transmission: 0.6, diffuse_transmission_colour: tinted, ..plastic(0.6) }),
        ("a leaf", Inputs { diffuse_transmission: 1.0, transmission: 0.3, coat: 0.5, coat_alpha: 0.2, ..sheen(0.6) }),
        ("oil on plastic", Inputs { film: film(1.4, 380.0, 0.1), ..plastic(0.5) }),
        ("a film on metal", Inputs { film: film(1.9, 250.0, 0.0), ..metal(0.4) }),
        ("a bubble", Inputs { film: film(1.33, 500.0, 0.0), ..glass(0.5, Wall::Thin) }),
        ("coated glass of lenses", Inputs { film: film(1.38, 100.0, 0.0), ..solid(0.5, 1.0, 1.5) }),
        ("the same from inside", Inputs { film: film(1.38, 100.0, 0.0), ..solid(0.5, 1.5, 1.0) }),
        ("all", Inputs { coat: 0.7, coat_alpha: 0.2, metalness: 0.3, transmission: 0.4, base_colour: tinted, ..sheen(0.7) }),
    ]
}

/// The integral of a function over the hemisphere around z, or around -z: by the midpoint rule on a grid that is denser at the
/// horizon and at the pole.
fn over_hemisphere(side: f64, count: usize, f: impl Fn(DVec3) -> DVec3) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for row in 0..count {
        let (sin, cos) = (FRAC_PI_2 * (row as f64 + 0.5) / count as f64).sin_cos();
        let height = sin * sin;
        let ring: DVec3 = (0..count)
            .map(|column| {
                let azimuth = PI * (column as f64 + 0.5) / count as f64;
                let sine = (1.0 - height * height).sqrt();
                f(DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), side * height))
            })
            .sum();
        sum += PI * sin * cos * ring;
    }
    // The eye lies in the plane of x and z, and both sides of it are alike.
    sum * TAU / (count * count) as f64
}

/// Directional albedo of a lobe that is no delta, by quadrature of its BSDF.
fn albedo(lobes: &Lobes, kind: Kind, count: usize) -> DVec3 {
    let side = if kind.is_beyond() { -1.0 } else { 1.0 };
    over_hemisphere(side, count, |wi| wi.z.abs() * lobes.evaluate(kind, wi))
}

/// The same of reflection, over half vectors, for the sharpest lobes.
#[expect(clippy::large_types_passed_by_value, reason = "the lobes keep it")]
fn reflection_albedo(inputs: Inputs, cosine: f64, count: usize) -> DVec3 {
    let (wo, alpha) = (wo(cosine), inputs.alpha);
    let lobes = lobes(inputs, wo);
    let step = |index: usize| (index as f64 + 0.5) / count as f64;
    let mut sum = DVec3::ZERO;
    for psi in (0..count).map(|index| FRAC_PI_2 * step(index)) {
        let tangent = alpha * psi.tan();
        let cos = 1.0 / (1.0 + tangent * tangent).sqrt();
        // Of the polar angle by psi.
        let slope = cos * cos * alpha / psi.cos().powi(2);
        for azimuth in (0..count).map(|index| PI * step(index)) {
            let h = cos * DVec3::new(tangent * azimuth.cos(), tangent * azimuth.sin(), 1.0);
            let wi = 2.0 * wo.dot(h) * h - wo;
            if wo.dot(h) > 0.0 && wi.z > 0.0 {
                sum += lobes.evaluate(Kind::Reflection, wi) * wi.z * 4.0 * wo.dot(h) * cos * tangent * slope;
            }
        }
    }
    sum * TAU * FRAC_PI_2 / (count * count) as f64
}

#[test]
fn reflection_has_the_albedos_of_the_table() {
    // Below 1e-4 it is a delta.
    for (alpha, expected) in layered::METALS.into_iter().filter(|(alpha, _)| *alpha > 0.0) {
        for (cosine, expected) in COSINES.into_iter().zip(expected) {
            let found = reflection_albedo(Inputs { alpha, ..metal(0.0) }, cosine, 400).x;
            assert_holds(format!("alpha {alpha} at {cosine}"), relative_check("albedo", found, expected, 1e-3));
        }
    }
}

/// Means of the three channels of a lobe's samples, and their standard errors.
fn sampled(lobes: &Lobes, kind: Kind, count: u32, rng: &mut Random) -> (DVec3, DVec3) {
    let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
    for _ in 0..count {
        let weight = lobes.sample(kind, rng).map_or(DVec3::ZERO, |scattered| scattered.weight);
        sum += weight;
        squares += weight * weight;
    }
    let n = f64::from(count);
    (sum / n, ((squares / n - (sum / n) * (sum / n)).max(DVec3::ZERO) / n).map(f64::sqrt))
}

/// Each material has every `step`th cosine.
fn samples_have_the_albedo_of_their_lobe(step: usize) {
    let mut rng = random(1, 1);
    for (number, (what, inputs)) in materials().into_iter().enumerate() {
        // Radiance over the squared index is what refraction leaves as it is.
        let scale = match inputs.wall {
            Wall::Solid { from, to } => (to / from).powi(2),
            Wall::Thin => 1.0,
        };
        for cosine in COSINES.into_iter().skip(number % step).step_by(step) {
            let lobes = lobes(inputs, wo(cosine));
            let mut total = DVec3::ZERO;
            for kind in KINDS {
                // Finds 2 % of most lobes. That samples follow their density is `lobe_sampling`'s.
                let (mean, error) = sampled(&lobes, kind, 5000, &mut rng);
                let expected = match kind {
                    kind if lobes.is_delta(kind) => mean,
                    Kind::Reflection => reflection_albedo(inputs, cosine, 100),
                    // Refraction ends at an edge.
                    Kind::Transmission => albedo(&lobes, kind, 200),
                    kind => albedo(&lobes, kind, 100),
                };
                let off = (mean - expected).abs();
                assert!(off.cmple(4.5 * error + 1e-3).all(), "{what}, {kind:?} at {cosine}: {mean} +- {error}, expected {expected}");
                total += expected * if kind == Kind::Transmission { scale } else { 1.0 };
                let is_chosen = lobes.chances().any(|(chosen, _)| chosen == kind);
                assert!(is_chosen || expected.max_element() < 1e-12, "{what}: {kind:?} is never chosen at {cosine}, albedo {expected}");
            }
            println!("{what} at {cosine}: {total}");
            assert!(total.max_element() < 1.0 + 1e-3, "{what} at {cosine}: {total}");
            let chances: f64 = lobes.chances().map(|(_, chance)| chance).sum();
            assert!((chances - 1.0).abs() < 1e-12, "{what}: {chances}");
        }
    }
}

#[test]
fn samples_have_the_albedo_of_their_lobe_and_nothing_is_won() {
    samples_have_the_albedo_of_their_lobe(2);
}

#[test]
#[ignore = "long: every material at every cosine"]
fn samples_have_the_albedo_of_their_lobe_at_every_cosine() {
    samples_have_the_albedo_of_their_lobe(1);
}

#[test]
fn white_surfaces_return_all_that_single_scattering_leaves() {
    let whole = |inputs: Inputs, cosine: f64| -> f64 {
        let lobes = lobes(inputs, wo(cosine));
        let of = |kind| match lobes.is_delta(kind) {
            true => lobes.sample(kind, &mut random(1, 1)).map_or(0.0, |scattered| scattered.weight.x),
            // It may be sharp.
            false if kind == Kind::Reflection => reflection_albedo(inputs, cosine, 400).x,
            false => albedo(&lobes, kind, 100).x,
        };
        KINDS.into_iter().map(of).sum()
    };
    for cosine in COSINES {
        for roughness in [0.0, 0.3, 0.6, 1.0] {
            let returned = whole(plastic(roughness), cosine);
            assert!((returned - 1.0).abs() < 3e-4, "plastic of roughness {roughness} at {cosine}: {returned}");
        }
        let returned = whole(Inputs { coat: 1.0, ..plastic(0.0) }, cosine);
        assert!((returned - 1.0).abs() < 3e-4, "smooth coat at {cosine}: {returned}");
        let returned = whole(Inputs { metalness: 1.0, coat: 1.0, ..plastic(0.0) }, cosine);
        assert!((returned - 1.0).abs() < 1e-9, "coated mirror at {cosine}: {returned}");
        // Lossless thin walls, smooth ones, and solids.
        for (inputs, scale) in [(glass(0.0, Wall::Thin), 1.0), (solid(0.0, 1.0, 1.5), 2.25), (solid(0.0, 1.5, 1.0), 1.0 / 2.25)] {
            let lobes = lobes(inputs, wo(cosine));
            let of = |kind| lobes.sample(kind, &mut random(1, 1)).map_or(0.0, |scattered| scattered.weight.x);
            let returned = of(Kind::Reflection) + scale * of(Kind::Transmission);
            assert!((returned - 1.0).abs() < 1e-12, "{inputs:?} at {cosine}: {returned}");
        }
    }
}

/// A direction on a side of the plane of x and y.
fn direction(side: f64, rng: &mut Random) -> DVec3 {
    let mut uniform = || (rand_word(rng) as f64 + 0.5) / 4_294_967_296.0;
    let (height, azimuth) = (uniform(), TAU * uniform());
    let sine = (1.0 - height * height).sqrt();
    DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), side * height)
}

fn rand_word(rng: &mut Random) -> u32 {
    rand_pcg::rand_core::Rng::next_u32(rng)
}

#[test]
fn lobes_are_reciprocal() {
    let mut rng = random(2, 1);
    let mut tested = 0;
    for (what, inputs) in materials() {
        for _ in 0..200 {
            for kind in KINDS {
                let side = if kind.is_beyond() { -1.0 } else { 1.0 };
                let (v, l) = (direction(1.0, &mut rng), direction(side, &mut rng));
                let there = lobes(inputs, v).evaluate(kind, l);
                let (swapped, scale) = match inputs.wall {
                    Wall::Solid { from, to } => {
                        let scale = if kind == Kind::Transmission { (to / from).powi(2) } else { 1.0 };
                        (
                            if kind == Kind::Transmission { Inputs { wall: Wall::Solid { from: to, to: from }, ..inputs } } else { inputs },
                            scale,
                        )
                    }
                    Wall::Thin => (inputs, 1.0),
                };
                let n = side * DVec3::Z;
                let back = Lobes::new(swapped, Frame { wo: l, ng: n, n, coat_n: n }).evaluate(kind, v);
                let off = (scale * there - back).abs();
                assert!(off.cmple(1e-9 * (back.abs() + 1e-3)).all(), "{what}, {kind:?}: {there} and {back} between {v} and {l}");
                tested += u32::from(there.max_element() > 0.0);
            }
        }
    }
    assert!(tested > 3000, "{tested}");
}
