//! Photons as they leave every kind of light, and every kind of surface, against the densities, shares and weights
//! that they should have.

use crate::common::chi_square::{counts_check, density_check, even};
use crate::common::densities::{
    AXIS, ULP, angles, directions_check, disc_check, frame, hemisphere_check, independence_check, is_unit, lobe, lobe_angles, on_sphere,
    polar, sphere_check, triangle_check,
};
use crate::common::prelude::*;
use photonmill::constants::EMISSION_BLOCKS;
use photonmill::engine::scene::replay::{Flights, light_paths};
use photonmill::records::{PhotonState, Tally};
use photonmill::verify::judge::fresnel;

/// Photons of each scene.
const SAMPLES: u32 = 1 << 17;
const BOTH: [Math; 2] = [Math::Fast, Math::Strict];

/// One incidence of several is traced with strict arithmetic.
fn math_at(incidence: f64) -> Math {
    if incidence == 60.0 { Math::Strict } else { Math::Fast }
}

/// A plane of 1 m around the origin, and lights.
fn scene(normal: DVec3, material: Material, lights: Vec<LightKind>) -> Scene {
    let frame = frame(normal, DVec3::X);
    let (u, v) = (frame.x_axis, frame.y_axis);
    scene_of(vec![Mesh::parallelogram("plane", -0.5 * (u + v), u, v, 0)], vec![material], lights)
}

struct Traced {
    geometry: Geometry,
    /// As they leave the light.
    emitted: Vec<PhotonState>,
    /// Those that one flight left, and what became of all.
    survivors: Vec<PhotonState>,
    tally: Tally,
}

/// Some photons of a scene, by their numbers. All effects are on, so that all scenes share their kernels.
fn trace_photons(gpu: &Gpu, math: Math, scene: &Scene, photons: (u32, u32)) -> Traced {
    // One bounce more than is traced: what the last one leaves is cut off.
    let all = SceneSettings { bounces: 2, illumination: Illumination::Photons, with: Effect::ALL.to_vec(), ..by_rounds() };
    let settings = SceneSettings { photons: photons.0 + photons.1, chunk: Some(photons.1), math, ..all };
    let (geometry, plan) = scene_plan(gpu, scene, &settings, Sensor::Receivers { count: 1 }).unwrap();
    let map = plan.global.as_ref().expect("a lit scene has a map");
    let Flights { mut paths, tallies, .. } = light_paths(gpu, &geometry, &plan, map, 0, photons, 1).unwrap();
    let survivors = if paths.len() == 2 { paths.pop().unwrap() } else { Vec::new() };
    Traced { geometry, emitted: paths.pop().unwrap(), survivors, tally: tallies[0] }
}

fn trace(gpu: &Gpu, math: Math, scene: &Scene) -> Traced {
    trace_photons(gpu, math, scene, (0, SAMPLES))
}

impl Traced {
    fn directions(paths: &[PhotonState]) -> Vec<Vec3> {
        paths.iter().map(|path| path.direction).collect()
    }

    /// Normal of the scene's first triangle.
    fn normal(&self) -> DVec3 {
        let triangle = self.geometry.triangles[0];
        let [a, b, c] = [triangle.a, triangle.b, triangle.c].map(Vec3::as_dvec3);
        (b - a).cross(c - a).normalize()
    }
}

#[test]
fn triangles_emit_by_the_cosine_from_all_of_their_area() {
    let Some(gpu) = device() else { return };
    let texels = vec![Vec3::new(1.0, 0.25, 0.5), Vec3::new(0.125, 1.0, 0.5), Vec3::new(0.5, 0.75, 0.0), Vec3::new(0.25, 0.5, 2.0)];
    let texture = texture(2, texels, [Wrap::Clamp; 2]);
    let lamp = |two_sided: bool, textured: bool| {
        let mut mesh = Mesh::parallelogram("lamp", DVec3::ZERO, DVec3::new(0.6, 0.1, -0.2), DVec3::new(0.1, 0.3, 0.5), 0);
        mesh.triangles.truncate(1);
        let emission_texture = textured.then_some(TextureUse::of(0, 0));
        let material = Material { emission_texture, two_sided, ..emissive(1.0) };
        Scene { textures: vec![texture.clone()], ..scene_of(vec![mesh], vec![material], vec![]) }
    };
    for (what, two_sided, textured) in [("one side", false, false), ("two sides", true, false), ("a textured side", false, true)] {
        let traced = trace(&gpu, Math::Fast, &lamp(two_sided, textured));
        let normal = traced.normal();
        let triangle = traced.geometry.triangles[0];
        let (a, u, v) = (triangle.a.as_dvec3(), (triangle.b - triangle.a).as_dvec3(), (triangle.c - triangle.a).as_dvec3());
        let to_weights = DMat3::from_cols(u, v, normal).inverse();
        let weights: Vec<DVec3> = traced.emitted.iter().map(|path| to_weights * (path.position.as_dvec3() - a)).collect();
        // On the side to which the photon flies, by no more than rounding asks for.
        for (path, at) in pairs(&traced.emitted, &weights) {
            let height = at.z * path.direction.as_dvec3().dot(normal).signum();
            assert!(height > 0.0 && height < 1e-5, "{what}: {path:?} starts {height:e} above its side");
        }
        assert_holds("positions", triangle_check(what, &weights.iter().map(|at| at.truncate()).collect::<Vec<_>>()));
        let (front, back): (Vec<Vec3>, Vec<Vec3>) =
            Traced::directions(&traced.emitted).into_iter().partition(|direction| direction.as_dvec3().dot(normal) > 0.0);
        for (side, directions) in [(normal, &front), (-normal, &back)] {
            if side == normal || two_sided {
                let what = format!("{what}, directions");
                assert_holds(&what, hemisphere_check(&what, directions, frame(side, DVec3::X), |wi| wi.dot(side) / PI));
                let from_uniform = hemisphere_check("fault", directions, frame(side, DVec3::X), |_| 1.0 / TAU);
                assert_complains("cosines for uniform directions", from_uniform);
            }
        }
        if two_sided {
            assert_holds("sides", share_check("front", front.len() as u64, u64::from(SAMPLES), 0.5));
        } else {
            assert_eq!(back, []);
        }
        let cosine_squared = |path: &PhotonState| path.direction.as_dvec3().dot(normal).powi(2);
        let joint: Vec<(f64, f64)> =
            pairs(&weights, &traced.emitted).map(|(at, path)| ((at.x + at.y).powi(2), cosine_squared(path))).collect();
        assert_holds("place and direction", independence_check(what, &joint));
        assert_complains("a number drawn twice", independence_check("fault", &joint.iter().map(|(x, _)| (*x, *x)).collect::<Vec<_>>()));

        let base = traced.geometry.emitters[0].flux.as_dvec3();
        for (path, at) in pairs(&traced.emitted, &weights) {
            let uv = DVec2::new(at.x + at.y, at.y);
            let expected = if textured { base * texture.sample(uv).truncate().as_dvec3() } else { base };
            let off = (path.flux.as_dvec3() - expected).abs().max_element();
            assert!(off < 1e-4, "{what}: {path:?} instead of flux {expected}");
        }
    }
}

/// A light alone over a plane that it need not hit.
fn scene_with(kind: LightKind) -> Scene {
    scene(DVec3::Y, matt(1.0), vec![kind])
}

#[test]
fn lights_emit_as_their_kinds_have_it() {
    let Some(gpu) = device() else { return };
    let axis = AXIS.normalize().as_vec3().as_dvec3().normalize();
    let position = DVec3::new(0.25, 0.5, -0.125);

    let point = trace(&gpu, Math::Fast, &scene_with(point(position)));
    assert!(point.emitted.iter().all(|path| path.position == position.as_vec3()));
    assert_holds("point", sphere_check("point light", &Traced::directions(&point.emitted)));

    for (inner, outer) in [(0f64, 30f64), (0.02, 0.05), (45.0, 90.0)] {
        let (inner_angle, outer_angle) = (inner.to_radians() as f32, outer.to_radians() as f32);
        let spot = LightKind::Spot { position, direction: AXIS.normalize(), intensity: Vec3::ONE, inner_angle, outer_angle };
        let directions = Traced::directions(&trace(&gpu, Math::Fast, &scene_with(spot)).emitted);
        let spot_check = |inner: f64, outer: f64| {
            // glTF's falloff is linear in the cosine, and squared.
            let (cos_inner, cos_outer) = (inner.cos(), outer.cos());
            let whole = TAU * (1.0 - cos_inner + (cos_inner - cos_outer) / 3.0);
            let falloff = |wi: DVec3| ((wi.dot(axis) - cos_outer) / (cos_inner - cos_outer)).clamp(0.0, 1.0).powi(2) / whole;
            let mut polar = even(0.0, inner, 8);
            polar.extend(&even(inner, outer, 12)[1..]);
            polar.dedup();
            directions_check(&format!("spot {inner:.3} {outer:.3}"), &directions, frame(axis, DVec3::X), &angles(polar), falloff)
        };
        let (inner, outer) = (f64::from(inner_angle), f64::from(outer_angle));
        assert_holds("spot", spot_check(inner, outer));
        assert_complains("a spot 3 % narrower than its light", spot_check(1.03 * inner, 1.03 * outer));
    }

    let sun = trace(&gpu, Math::Fast, &scene_with(sun(AXIS)));
    assert!(sun.emitted.iter().all(|path| path.direction == AXIS.normalize().as_vec3()));
    let radius = sun.geometry.radius;
    let places: Vec<DVec3> = sun.emitted.iter().map(|path| path.position.as_dvec3() + 2.0 * radius * axis).collect();
    assert_holds("sun", disc_check("directional light", &places, axis, radius));
    assert_complains("a disc 1 % smaller", disc_check("fault", &places, axis, 0.99 * radius));

    for (what, law) in [("cosine disc", EmissionLaw::Cosine), ("uniform disc", EmissionLaw::Uniform)] {
        let disc = trace(&gpu, Math::Fast, &scene_with(disc(position, AXIS.normalize(), 0.125, law)));
        // Rounding lifted them off the disc.
        let flat = |path: &PhotonState| {
            let from_centre = path.position.as_dvec3() - position;
            from_centre - from_centre.dot(axis) * axis
        };
        assert_holds(what, disc_check(what, &disc.emitted.iter().map(flat).collect::<Vec<_>>(), axis, 0.125));
        let directions = Traced::directions(&disc.emitted);
        let as_law = |law| {
            let density = move |wi: DVec3| if law == EmissionLaw::Cosine { wi.dot(axis) / PI } else { 1.0 / TAU };
            hemisphere_check(what, &directions, frame(axis, DVec3::X), density)
        };
        assert_holds(what, as_law(law));
        let other = if law == EmissionLaw::Cosine { EmissionLaw::Uniform } else { EmissionLaw::Cosine };
        assert_complains("the other law of discs", as_law(other));
    }

    let sky = trace(&gpu, Math::Fast, &scene_with(LightKind::Environment { radiance: Vec3::ONE }));
    assert_holds("sky", sphere_check("sky, directions", &Traced::directions(&sky.emitted)));
    let radius = sky.geometry.radius;
    let place = |path: &PhotonState| {
        let (start, way) = (path.position.as_dvec3(), path.direction.as_dvec3());
        assert!((start.dot(way) + 2.0 * radius).abs() < 1e-5, "{path:?}");
        ((start + 2.0 * radius * way).length_squared() / (radius * radius), 0.5 + 0.5 * way.z)
    };
    let places: Vec<(f64, f64)> = sky.emitted.iter().map(place).collect();
    assert_holds("sky", independence_check("sky, starts", &places));
    assert_complains("r = u in the sky's disc", independence_check("fault", &places.iter().map(|(x, y)| (x * x, *y)).collect::<Vec<_>>()));
}

/// Among several lights each gets photons by its power.
#[test]
fn lights_are_chosen_by_their_power() {
    let Some(gpu) = device() else { return };
    let powers = [1.0f32, 20.0, 5.0, 0.01, 8.0];
    let bulb = |k: usize| LightKind::Point { position: DVec3::Y * k as f64, intensity: Vec3::splat(powers[k]) };
    let traced = trace(&gpu, Math::Fast, &scene(DVec3::Y, matt(1.0), (0..powers.len()).map(bulb).collect()));
    let counts: Vec<u64> = (0..powers.len())
        .map(|k| traced.emitted.iter().filter(|path| path.position == traced.geometry.to_local(DVec3::Y * k as f64)).count() as u64)
        .collect();
    let whole: f64 = powers.iter().map(|power| f64::from(*power)).sum();
    let shares: Vec<f64> = powers.iter().map(|power| f64::from(*power) / whole).collect();
    assert_holds("choice", counts_check("choice of lights", &counts, &shares));
    assert_complains("lights chosen evenly", counts_check("fault", &counts, &[0.2; 5]));
    // What a light was chosen by less it carries more of.
    assert!(traced.emitted.iter().all(|path| (path.flux.x - 1.0).abs() < 1e-3));
}

/// A beam of one direction, at an incidence in degrees, onto the front of a plane, or its back.
fn beam(material: Material, incidence: f64, from_behind: bool) -> Scene {
    let normal = AXIS.normalize();
    let frame = frame(normal, DVec3::X);
    let (sin, cos) = incidence.to_radians().sin_cos();
    let wo = cos * if from_behind { -normal } else { normal } + sin * (0.6 * frame.x_axis + 0.8 * frame.y_axis);
    // A cone so narrow that in f32 all its directions are one.
    let kind = LightKind::Spot { position: wo, direction: -wo, intensity: Vec3::ONE, inner_angle: 0.0, outer_angle: 1e-12 };
    scene(normal, material, vec![kind])
}

/// The beam's wo as the kernels have it, and the plane's normal on that side.
fn beam_at(traced: &Traced) -> (DVec3, DVec3) {
    let first = traced.emitted[0];
    assert!(traced.emitted.iter().all(|path| path.direction == first.direction && path.position == first.position));
    let wo = -first.direction.as_dvec3();
    let normal = traced.normal();
    (wo, if normal.dot(wo) < 0.0 { -normal } else { normal })
}

/// Of each case that has one of these arithmetics.
#[test]
fn lambertian_surfaces_scatter_by_the_cosine() {
    let of = of_run::<&[_]>(&[Math::Fast], &BOTH);
    let Some(gpu) = device() else { return };
    let colour = Vec3::new(0.75, 0.3, 0.1);
    let cases = [(0.0, false), (60.0, false), (89.0, false), (45.0, true)];
    for (incidence, from_behind) in cases.into_iter().filter(|(incidence, _)| of.contains(&math_at(*incidence))) {
        let math = math_at(incidence);
        let what = format!("{math:?}, Lambert at {incidence} degrees");
        let grey = Material { two_sided: from_behind, ..Material::lambert("grey", colour) };
        let traced = trace(&gpu, math, &beam(grey, incidence, from_behind));
        let normal = beam_at(&traced).1;
        let frame = frame(normal, DVec3::X);
        let places: Vec<(f64, f64)> = traced.survivors.iter().map(|path| polar(frame, path.direction)).collect();
        let scattered = |albedo: f64, density: &dyn Fn(DVec3) -> f64| {
            let grid = angles(even(0.0, FRAC_PI_2, 20));
            density_check(&what, &places, SAMPLES as usize, &grid, (albedo, 1e-6), &on_sphere(frame, |wi| albedo * density(wi)))
        };
        let albedo = f64::from(colour.x);
        assert_holds(&what, scattered(albedo, &|wi| wi.dot(normal) / PI));
        assert_complains("a uniform density", scattered(albedo, &|_| 1.0 / TAU));
        assert_complains("an albedo 3 % off", scattered(0.97 * albedo, &|wi| wi.dot(normal) / PI));
        assert_holds(&what, share_check("survivors", u64::from(traced.tally.stored), u64::from(SAMPLES), albedo));
        assert_complains("an albedo 1 % off", share_check("fault", u64::from(traced.tally.stored), u64::from(SAMPLES), 0.99 * albedo));
        assert_eq!(traced.tally.stored + traced.tally.absorbed, SAMPLES);
        // Roulette by the largest channel; the others lose what it did not take.
        for path in &traced.survivors {
            let off = (path.flux - traced.emitted[0].flux * colour / colour.x).abs().max_element();
            assert!(off < 1e-6, "{what}: {path:?}");
        }
    }
    // A back that does not scatter.
    assert_eq!(trace(&gpu, Math::Fast, &beam(Material::lambert("grey", colour), 45.0, true)).tally.stored, 0);
}

/// Albedo of the lobe (n + 2) / 2 pi cos^n at incidences 0, 30, 60, 80, 89.9 degrees, of the part above the horizon.
pub(super) const ALBEDOS: [(f64, &[f64]); 7] = [
    (0.01, &[1.0, 0.9318, 0.7472, 0.5835, 0.4974]),
    (0.5, &[1.0, 0.8956, 0.6560, 0.4711, 0.3823]),
    (2.0, &[1.0, 0.8705, 0.5625, 0.3444, 0.2509]),
    (5.0, &[1.0, 0.8663, 0.5194, 0.2693, 0.1706]),
    (1e4, &[1.0, 0.8660, 0.5, 0.1737, 0.0049]),
    // Wide of the horizon it is the cosine.
    (48_826.0, &[1.0, 0.866_025, 0.5, 0.173_648]),
    (1e6, &[1.0, 0.866_025, 0.5, 0.173_648]),
];
pub(super) const INCIDENCES: [f64; 5] = [0.0, 30.0, 60.0, 80.0, 89.9];

/// Of each case that has one of these arithmetics.
#[test]
fn glossy_surfaces_scatter_by_their_lobe() {
    let of = of_run::<&[_]>(&[Math::Fast], &BOTH);
    let Some(gpu) = device() else { return };
    for (k, (n, albedos)) in ALBEDOS.into_iter().enumerate() {
        // Each exponent has every other incidence.
        let cases = albedos.iter().zip(INCIDENCES).map(|(albedo, incidence)| (math_at(incidence), *albedo, incidence));
        for (math, albedo, incidence) in cases.skip(k % 2).step_by(2).filter(|(math, ..)| of.contains(math)) {
            // A colour for which the weight f cosine / pdf is the cosine: survivors are distributed by f cosine.
            let colour = (n + 1.0) / (n + 2.0);
            let glossy = |colour: f64| Material { surface: Surface::Glossy { exponent: n as f32 }, ..matt(colour as f32) };
            let what = format!("lobe {n} at {incidence} degrees");
            let traced = trace(&gpu, math, &beam(glossy(colour), incidence, false));
            let (wo, normal) = beam_at(&traced);
            let mirror = (2.0 * wo.dot(normal) * normal - wo).normalize();
            let frame = frame(mirror, normal);
            let places: Vec<(f64, f64)> = traced.survivors.iter().map(|path| polar(frame, path.direction)).collect();
            let scattered = |n: f64, bound: f64| {
                let f_cosine = move |wi: DVec3| colour * (n + 2.0) / TAU * lobe(wi.dot(mirror), n) * wi.dot(normal).max(0.0);
                let total = (colour * albedo, bound);
                density_check(&what, &places, SAMPLES as usize, &lobe_angles(n), total, &on_sphere(frame, f_cosine))
            };
            // The table has four digits.
            assert_holds(&what, scattered(n, 6e-5));
            // Where few photons are left they show less.
            if incidence < 85.0 {
                assert_complains(&format!("{what}: an exponent 10 % off"), scattered(1.1 * (n + 2.0) - 2.0, 1.0));
            }
            assert_holds(&what, share_check("survivors", u64::from(traced.tally.stored), u64::from(SAMPLES), colour * albedo));

            // White: what is heavier than 1 keeps its flux, so that the flux that is left is the albedo.
            if [0.5, 48_826.0].contains(&n) {
                let traced = trace(&gpu, math, &beam(glossy(1.0), incidence, false));
                let mut flux: Vec<f64> = traced.survivors.iter().map(|path| f64::from(path.flux.x / traced.emitted[0].flux.x)).collect();
                flux.resize(SAMPLES as usize, 0.0);
                let (mean, error) = mean_and_error(&flux);
                assert_holds(&what, z_check(&format!("{what}: flux"), mean, albedo, error.max(1e-5)));
            }
        }
    }
}

/// Shares and directions of what a smooth surface reflects and transmits, with eta = n_i / n_t.
fn smooth_check(what: &str, traced: &Traced, eta: f64, reflectance: f64) -> Check {
    let (wo, normal) = beam_at(traced);
    let cos_i = wo.dot(normal);
    let mirror = 2.0 * cos_i * normal - wo;
    let cos_t = (1.0 - eta * eta * (1.0 - cos_i * cos_i)).max(0.0).sqrt();
    let refracted = (eta * cos_i - cos_t) * normal - eta * wo;
    let mut reflected_count = 0;
    for path in &traced.survivors {
        let wi = path.direction.as_dvec3();
        let reflected = wi.dot(normal) > 0.0;
        reflected_count += u32::from(reflected);
        let off = (wi - if reflected { mirror } else { refracted }).length();
        // The angle of what grazes the surface is known to the root of what its cosine's square is.
        let bound = 8.0 * ULP / if reflected { 1.0 } else { cos_t.max(1e-3) };
        require(off <= bound, || format!("{what}: {wi}, {off:e} off"))?;
    }
    require(traced.survivors.len() as u32 == SAMPLES, || format!("{what}: {} of {SAMPLES} go on", traced.survivors.len()))?;
    let share = f64::from(reflected_count) / f64::from(SAMPLES);
    println!("{what}: {share:.6} reflected, {reflectance:.6} expected");
    // Where all are reflected, or none, there is no exception.
    z_check(what, share, reflectance, (reflectance * (1.0 - reflectance) / f64::from(SAMPLES)).sqrt().max(1e-9))
}

/// Of each case that has one of these arithmetics.
#[test]
fn glass_reflects_by_fresnel_and_refracts_by_snell() {
    let of = of_run::<&[_]>(&[Math::Fast], &BOTH);
    let Some(gpu) = device() else { return };
    let outside = [0.0, 45.0, 56.31, 80.0, 89.0, 89.9].map(|incidence| (1.5f32, incidence, false));
    // Total reflection begins at 41.81 degrees, with an index of 2.4 at 24.62.
    let inside = [0.0, 30.0, 41.0, 41.7, 41.82, 60.0, 89.9].map(|incidence| (1.5f32, incidence, true));
    let others =
        [(2.4f32, 30.0, false), (2.4, 24.5, true), (2.4, 24.7, true), (1.0001, 89.9, false), (0.8, 40.0, false), (0.8, 60.0, false)];
    // Each arithmetic has every other one.
    let cases = BOTH.into_iter().cycle().zip(outside.into_iter().chain(inside).chain(others));
    for (math, (ior, incidence, from_behind)) in cases.filter(|(math, _)| of.contains(math)) {
        let what = format!("{math:?}, index {ior} at {incidence} degrees from {}", if from_behind { "within" } else { "without" });
        let traced = trace(&gpu, math, &beam(glass(ior), incidence, from_behind));
        let (wo, normal) = beam_at(&traced);
        let cos_i = wo.dot(normal);
        let eta = if from_behind { f64::from(ior) } else { 1.0 / f64::from(ior) };
        assert_holds(&what, smooth_check(&what, &traced, eta, fresnel(cos_i, eta, 1.0)));
        if ior == 1.5 && incidence > 0.0 {
            assert_complains("an index upside down", smooth_check("fault", &traced, 1.0 / eta, fresnel(cos_i, 1.0, eta)));
        }
    }
    // An interface between equals is none, however it is met, and a mirror reflects all.
    for (material, incidence, reflected) in [0.0, 60.0, 89.99].into_iter().flat_map(|at| [(glass(1.0), at, 0.0), (mirror(1.0), at, 1.0)]) {
        let what = format!("{:?} at {incidence} degrees", material.surface);
        assert_holds(&what, smooth_check(&what, &trace(&gpu, Math::Fast, &beam(material, incidence, false)), 1.0, reflected));
    }
    let dim = trace(&gpu, Math::Fast, &beam(mirror(0.8), 30.0, false));
    assert_holds("a dim mirror", share_check("survivors", u64::from(dim.tally.stored), u64::from(SAMPLES), f64::from(0.8f32)));
    assert_complains("a mirror 1 % brighter", share_check("fault", u64::from(dim.tally.stored), u64::from(SAMPLES), 0.808));
}

/// The first photons of seed 1 whose 24 bits of a word are all zeros, and all ones.
fn edge_photons(word: usize) -> [u32; 2] {
    let block = if word < 2 { 1 } else { EMISSION_BLOCKS };
    let photons = [[6_983_761, 25_324_145], [27_077_537, 9_474_925], [1_944_736, 7_501_678], [6_095_361, 3_647_491]][word];
    assert_eq!(photons.map(|photon| philox([photon, 0, block, 0], [1, 0])[word] >> 8), [0, 0x00ff_ffff]);
    photons
}

/// The same words where photons draw them: one in 16 million does.
#[test]
fn photons_with_words_at_their_ends_fly_on() {
    let Some(gpu) = device() else { return };
    let axis = AXIS.normalize();
    let disc = |law| disc(DVec3::ZERO, axis, 0.125, law);
    let spot =
        LightKind::Spot { position: DVec3::ZERO, direction: axis, intensity: Vec3::ONE, inner_angle: 0.5, outer_angle: FRAC_PI_2 as f32 };
    let lights = [
        ("lamp", scene(DVec3::Y, emissive(1.0), vec![]), DVec3::Y, 1e-4),
        ("cosine disc", scene_with(disc(EmissionLaw::Cosine)), axis, 1e-4),
        // Rounding of the frame may turn what all but lies in a surface into it.
        ("uniform disc", scene_with(disc(EmissionLaw::Uniform)), axis, -2.0 * ULP),
        ("spot", scene_with(spot), axis, -2.0 * ULP),
        ("point", scene_with(point(DVec3::ZERO)), DVec3::ZERO, -1.0),
        ("sky", scene_with(LightKind::Environment { radiance: Vec3::ONE }), DVec3::ZERO, -1.0),
    ];
    for photon in [0, 1].into_iter().flat_map(edge_photons) {
        for (what, scene, axis, least) in &lights {
            let path = trace_photons(&gpu, Math::Fast, scene, (photon, 1)).emitted[0];
            assert_holds(format!("photon {photon}"), is_unit(what, path.direction, 4.0 * ULP));
            assert!(path.position.is_finite() && path.flux.min_element() > 0.0, "photon {photon}, {what}: {path:?}");
            assert!(path.direction.as_dvec3().dot(*axis) > *least, "photon {photon}, {what}: {path:?}");
        }
    }
    for photon in [2, 3].into_iter().flat_map(edge_photons) {
        for surface in [Surface::Lambert, Surface::Glossy { exponent: 0.5 }, Surface::Glossy { exponent: 48_826.0 }] {
            let traced = trace_photons(&gpu, Math::Fast, &beam(Material { surface, ..matt(1.0) }, 0.0, false), (photon, 1));
            let what = format!("photon {photon} on {surface:?}");
            // A wide lobe ends in the dark above the horizon.
            assert!(traced.tally.stored == 1 || surface == Surface::Glossy { exponent: 0.5 }, "{what} ends");
            for path in &traced.survivors {
                assert_holds(&what, is_unit("onward", path.direction, 4.0 * ULP));
                let cosine = path.direction.as_dvec3().dot(beam_at(&traced).1);
                assert!(cosine > 1e-4 && path.position.is_finite(), "{what}: {path:?}");
            }
        }
    }
}
