//! Photons of a caustic map that are aimed at what makes caustics bring the same light with less noise.

use crate::common::aimed::{SCENES, compare, far_lamp, scene, settings};
use crate::common::prelude::*;
use crate::common::rendered;
use photonmill::engine::scene::replay::{Flights, light_paths};

/// Under these kinds of light, by so many photons, and as many aimed ones as a tenth; errors of these shares are noticed
/// under the kinds with the least noise, and under all. As many aimed photons have a fraction of the error.
fn kinds_bring_the_same_light(gpu: &Gpu, kinds: &[&str], photons: u32, [precise_share, share]: [f64; 2]) {
    let mut family = Family::default();
    for kind in kinds {
        let gain = compare(gpu, kind, [photons, photons / 10], &mut family);
        let least = match *kind {
            "point" => 6.0,
            "sun" | "cosine disc" | "overlapping cones" => 4.0,
            _ => 0.0,
        };
        println!("{kind}: {gain:.2} times the error in all directions");
        assert!(gain > least, "{kind}: {gain}");
    }
    family.assert_detects(share, |what| what.ends_with("whole"));
    let precise = ["point", "spot", "cosine disc", "sun", "overlapping discs", "a ball before a mirror wall"];
    family.assert_detects(precise_share, |what| precise.iter().any(|kind| what == format!("{kind}: whole")));
}

/// Cones of a lamp's light and discs of a sun's. One device for all of it, which compiles the kernels of these scenes once.
#[test]
fn aimed_photons_bring_the_same_light_with_less_noise() {
    let Some(gpu) = device() else { return };
    let all = SCENES.map(|(kind, _)| kind);
    let few = ["overlapping cones", "overlapping discs"];
    let (kinds, photons, shares) = of_run::<(&[_], _, _)>((&few, 40_000, [0.07, 0.14]), (&all, 200_000, [0.025, 0.05]));
    kinds_bring_the_same_light(&gpu, kinds, photons, shares);
    a_millionth_of_a_lamps_light_lights_as_the_sun_does(&gpu);
    no_builder_and_no_split_changes_a_bit(&gpu, Math::Fast, &["overlapping cones", "two-sided triangles"]);
    if is_long_run() {
        no_builder_and_no_split_changes_a_bit(&gpu, Math::Strict, &["overlapping cones"]);
    }
}

fn a_millionth_of_a_lamps_light_lights_as_the_sun_does(gpu: &Gpu) {
    let points = grid(0.0, DVec3::Y, 4);
    let [far, sun] = far_lamp().map(|scene| {
        let (_, plan) = scene_plan(gpu, &scene, &settings(1, true), Sensor::Receivers { count: 1 }).unwrap();
        let runs = irradiances(gpu, &scene, &settings(20_000, true), &points, 1..17);
        (runs.iter().map(|run| run.iter().map(|light| light.x).sum::<f64>()).collect::<Vec<_>>(), plan.caustic.unwrap().flux_gain)
    });
    assert!(far.1 >= f64::from(1 << 18) && sun.1 < 256.0, "gains of {} and {}", far.1, sun.1);
    let expected = sun.0.iter().sum::<f64>() / sun.0.len() as f64;
    let mut family = Family::default();
    family.expect_mean("a lamp far off", &far.0, expected);
    family.assert_detects_one_per_cent();
}

/// Nearly all that is aimed at a ball meets it, with about equal flux, and none carries more than it did.
#[test]
fn aimed_photons_meet_what_they_are_aimed_at() {
    let Some(gpu) = device() else { return };
    for kind in ["caustic-sphere", "point", "sun", "sky", "cosine disc", "overlapping cones"] {
        let scene = if kind == "caustic-sphere" { rendered::scene(kind) } else { scene(kind) };
        // Photons of round 0 of the caustic map as lights emit them, and after their first flight.
        let [all, aimed] = [false, true].map(|aim| {
            let (geometry, plan) = scene_plan(&gpu, &scene, &settings(4000, aim), Sensor::Receivers { count: 1 }).unwrap();
            let map = plan.caustic.clone().unwrap();
            let flights = light_paths(&gpu, &geometry, &plan, &map, 0, (0, map.photons), 1).unwrap();
            (plan, flights)
        });
        // A ray at the rim of the sphere around a ball of few triangles may pass it, and the floor hides it from below.
        let least = if kind == "sky" { 0.6 } else { 0.85 };
        let met = |flights: &Flights| f64::from(flights.tallies[0].stored) / 4000.0;
        println!("{kind}: {} and {} meet a ball", met(&all.1), met(&aimed.1));
        assert!(all.0.targets.is_empty(), "{kind}: {} targets without aim", all.0.targets.len());
        assert!(met(&all.1) < 0.08 && met(&aimed.1) > least, "{kind}: {} and {} meet a ball", met(&all.1), met(&aimed.1));
        let map = aimed.0.caustic.as_ref().unwrap();
        assert_eq!(map.target_count as usize, aimed.0.targets.len());
        let most = aimed.1.paths[0].iter().map(|path| path.flux.max_element()).fold(0.0, f32::max);
        assert!((0.2..=1.0001).contains(&most), "{kind}: {most} with a gain of {}", map.flux_gain);
        let sum = |flights: &Flights| flights.paths[0].iter().map(|path| f64::from(path.flux.x)).sum::<f64>();
        assert!(sum(&aimed.1) / map.flux_gain < 0.2 * sum(&all.1), "{kind}: what meets no ball was sent");
    }
}

/// Where every lamp is within what it would be aimed at photons are the same to the bit.
#[test]
fn lamps_within_a_target_emit_in_all_directions() {
    let Some(gpu) = device() else { return };
    let mut room = rendered::scene("furnace");
    room.materials = vec![mirror(0.5), matt(0.5), glass(1.5)];
    room.meshes[0].material = 1;
    room.lights = vec![lamp(point(DVec3::new(0.4, 0.6, 0.5)))];
    let found = |aim| received(&gpu, &room, &settings(5000, aim), &[(DVec3::new(0.5, 0.0, 0.5), DVec3::Y)]);
    let [all, aimed] = [false, true].map(found);
    assert!(all.plan.targets.is_empty() && aimed.plan.targets.is_empty());
    assert!(all.film.sums[0] > 0);
    assert_eq!(all.film, aimed.film);
}

/// Aimed photons too are the same by every builder and in every split.
fn no_builder_and_no_split_changes_a_bit(gpu: &Gpu, math: Math, kinds: &[&str]) {
    // Each arithmetic and each builder has kernels of its own, which take seconds to make.
    let builders: &[(Builder, Option<u32>)] = match math {
        Math::Fast => &[(Builder::Ballot, None), (Builder::Persistent, Some(701))],
        Math::Strict => &[(Builder::Ballot, Some(701))],
    };
    for kind in kinds {
        let usual = SceneSettings { math, rounds: 2, ..settings(3001, true) };
        let found = |settings| received(gpu, &scene(kind), &settings, &grid(0.0, DVec3::Y, 4));
        let reference = found(usual.clone());
        for &(builder, chunk) in builders {
            let found = found(SceneSettings { builder: Some(builder), chunk, ..usual.clone() });
            let what = format!("{kind}, {builder:?}, chunks of {chunk:?}, {math:?}");
            assert_holds(what, equal_sums("light", &found.film.sums, &reference.film.sums));
            assert_eq!(found.fates, reference.fates);
        }
        if math == Math::Fast {
            let off = found(SceneSettings { aim: false, ..usual });
            assert_complains("photons in all directions", equal_sums("off", &off.film.sums, &reference.film.sums));
        }
    }
}

/// Built-in scenes with caustics: what a picture's caustic part sums up to, by pairs of runs. With the same seed both see
/// it along the same rays, so that their difference has the photons' noise alone.
#[test]
#[ignore = "long: minutes on a software device"]
fn pictures_have_the_same_caustics_to_a_per_cent() {
    let Some(gpu) = device() else { return };
    let mut family = Family::default();
    for name in ["caustic-sphere", "cornell-spheres"] {
        let scene = rendered::scene(name);
        let total = |aim, photons, seed| {
            let settings = SceneSettings { seed, caustic_radius: Some(0.05), bounces: 32, with: Vec::new(), ..settings(photons, aim) };
            let result = seen(&gpu, &scene, &settings, &scene.cameras[0], [48; 2]);
            result.film.part_totals[2] as f64 / result.plan.film.scale
        };
        let pairs: Vec<[f64; 2]> = (1..=48).map(|seed| [total(false, 100_000, seed), total(true, 10_000, seed)]).collect();
        let (all, _) = mean_and_error(&pairs.iter().map(|[all, _]| *all).collect::<Vec<_>>());
        let (difference, error) = mean_and_error(&pairs.iter().map(|[all, aimed]| aimed - all).collect::<Vec<_>>());
        family.expect_estimate(format!("{name}: whole"), all + difference, error, pairs.len() as u32, all);
    }
    family.assert_detects(0.0125, |_| true);
}

/// One map of everything has photons in all directions.
#[test]
fn only_caustic_maps_are_aimed() {
    let Some(gpu) = device() else { return };
    for (illumination, part) in [(Illumination::Photons, Part::All), (Illumination::Split, Part::Indirect)] {
        let settings = SceneSettings { illumination, part, ..settings(100, true) };
        let (_, plan) = scene_plan(&gpu, &scene("point"), &settings, Sensor::Receivers { count: 1 }).unwrap();
        assert!(plan.caustic.is_none() && plan.targets.is_empty());
        assert!(plan.maps().all(|map| map.target_count == 0 && map.flux_gain == 1.0));
    }
}
