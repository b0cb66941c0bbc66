//! The lobes of layered materials in f64, as the path tracer has them: albedos and reciprocity. Densities are `lobe_sampling`'s.

use super::furnace::Draws;
use crate::common::layered::{self, LOBES, inputs, layered, sampled};
use crate::common::plates::COSINES;
use crate::common::prelude::*;
use photonmill::verify::judge::lobes::{Film, Frame, Inputs, Kind, Lobes, Wall};
use photonmill::verify::judge::random;

/// A white dielectric without anything else, of this roughness.
fn plastic(roughness: f64) -> Inputs {
    Inputs { alpha: roughness * roughness, ..inputs(&layered(Vec3::ONE, &layered::plastic(0.0))) }
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

fn lobes(inputs: &Inputs, wo: DVec3) -> Lobes {
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
fn reflection_albedo(inputs: &Inputs, cosine: f64, count: usize) -> DVec3 {
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
            let found = reflection_albedo(&Inputs { alpha, ..metal(0.0) }, cosine, 400).x;
            assert_holds(format!("alpha {alpha} at {cosine}"), relative_check("albedo", found, expected, 1e-3));
        }
    }
}

/// What refraction does not change is the radiance over the squared index.
fn flux_scale(wall: Wall, kind: Kind) -> f64 {
    match wall {
        Wall::Solid { from, to } if kind == Kind::Transmission => (to / from).powi(2),
        _ => 1.0,
    }
}

/// Each material has every `step`th cosine.
#[test]
fn samples_have_the_albedo_of_their_lobe_and_nothing_is_won() {
    let step = of_run(2, 1);
    let mut rng = random(1, 1);
    for (number, (what, inputs)) in materials().into_iter().enumerate() {
        for cosine in COSINES.into_iter().skip(number % step).step_by(step) {
            let lobes = lobes(&inputs, wo(cosine));
            let mut total = DVec3::ZERO;
            for kind in LOBES {
                // Finds 2 % of most lobes. That samples follow their density is `lobe_sampling`'s.
                let (mean, squared) = sampled(&lobes, kind, 5000, &mut rng, |_| 1.0);
                let error = squared.map(f64::sqrt);
                let expected = match kind {
                    kind if lobes.is_delta(kind) => mean,
                    Kind::Reflection => reflection_albedo(&inputs, cosine, 100),
                    // Refraction ends at an edge.
                    Kind::Transmission => albedo(&lobes, kind, 200),
                    kind => albedo(&lobes, kind, 100),
                };
                let off = (mean - expected).abs();
                assert!(off.cmple(4.5 * error + 1e-3).all(), "{what}, {kind:?} at {cosine}: {mean} +- {error}, expected {expected}");
                total += expected * flux_scale(inputs.wall, kind);
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
fn white_surfaces_return_all_that_single_scattering_leaves() {
    let whole = |inputs: Inputs, cosine: f64| -> f64 {
        let lobes = lobes(&inputs, wo(cosine));
        let of = |kind| match lobes.is_delta(kind) {
            true => lobes.sample(kind, &mut random(1, 1)).map_or(0.0, |scattered| scattered.weight.x),
            // It may be sharp.
            false if kind == Kind::Reflection => reflection_albedo(&inputs, cosine, 400).x,
            false => albedo(&lobes, kind, 100).x,
        };
        LOBES.into_iter().map(|kind| flux_scale(inputs.wall, kind) * of(kind)).sum()
    };
    let plastics = [0.0, 0.3, 0.6, 1.0].map(|roughness| (plastic(roughness), 3e-4));
    let coated = [(Inputs { coat: 1.0, ..plastic(0.0) }, 3e-4), (Inputs { coat: 1.0, ..metal(0.0) }, 1e-9)];
    // Lossless thin walls, smooth ones, and solids.
    let clear = [glass(0.0, Wall::Thin), solid(0.0, 1.0, 1.5), solid(0.0, 1.5, 1.0)].map(|inputs| (inputs, 1e-12));
    for (inputs, tolerance) in plastics.into_iter().chain(coated).chain(clear) {
        for cosine in COSINES {
            let returned = whole(inputs, cosine);
            assert!((returned - 1.0).abs() < tolerance, "{inputs:?} at {cosine}: {returned}");
        }
    }
}

#[test]
fn lobes_are_reciprocal() {
    let mut draws = Draws(random(2, 1));
    let mut tested = 0;
    for (what, inputs) in materials() {
        for _ in 0..200 {
            for kind in LOBES {
                let side = if kind.is_beyond() { -1.0 } else { 1.0 };
                let (v, l) = (draws.direction(FRAC_PI_2), side * draws.direction(FRAC_PI_2));
                let there = lobes(&inputs, v).evaluate(kind, l);
                let wall = match inputs.wall {
                    Wall::Solid { from, to } if kind == Kind::Transmission => Wall::Solid { from: to, to: from },
                    wall => wall,
                };
                let n = side * DVec3::Z;
                let back = Lobes::new(&Inputs { wall, ..inputs }, Frame { wo: l, ng: n, n, coat_n: n }).evaluate(kind, v);
                let off = (flux_scale(inputs.wall, kind) * there - back).abs();
                assert!(off.cmple(1e-9 * (back.abs() + 1e-3)).all(), "{what}, {kind:?}: {there} and {back} between {v} and {l}");
                tested += u32::from(there.max_element() > 0.0);
            }
        }
    }
    assert!(tested > 3000, "{tested}");
}
