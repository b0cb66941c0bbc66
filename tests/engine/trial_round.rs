//! Default radii come from a trial round: from the photons around the points that are asked about, and not from the scene's
//! area.

use std::sync::atomic::AtomicBool;

use crate::common::layered::dull;
use crate::common::prelude::*;
use crate::common::rendered::{Viewed, light};
use crate::tests::engine::unseen_light::room_without_floor;
use glam::dvec3;
use photonmill::engine::scene::{self, Receivers, Viewpoint, trial};
use photonmill::output::scene_report;
use photonmill::plan::radius::{RadiusFrom, area_radius};
use photonmill::scene::material::Coverage;

/// A room of 4 x 4 x 3 m with a lamp under its ceiling, on a ground of 800 m.
fn room_on_a_plain() -> Scene {
    let mut meshes = room_without_floor(0.0);
    meshes.push(level(0.0, [800.0, 800.0], true, 0));
    meshes.push(level(2.9, [1.0, 1.0], false, 1));
    scene_of(meshes, vec![matt(0.6), emissive(0.0)], vec![])
}

#[test]
fn a_room_on_a_plain_is_lit_as_it_is_without_the_plain() {
    let Some(gpu) = device() else { return };
    let scene = room_on_a_plain();
    // Points of the room's floor, some of them near its walls.
    let places = [-1.7, -0.6, 0.5, 1.6];
    let points: Vec<_> = places.iter().flat_map(|x| places.map(|z| (dvec3(*x, 0.0, z), DVec3::Y))).collect();
    let geometry = Geometry::new(&scene).unwrap();
    let receivers = Receivers::Points(&points);
    let (phases, sensor) = (receivers.phases(&geometry), receivers.sensor());
    let viewpoint = Viewpoint { geometry: &geometry, camera: None, phases: &phases };
    let settings = SceneSettings { photons: 1 << 14, rounds: 12, part: Part::Indirect, ..by_rounds() };
    let mean = |plan: ScenePlan| mean_red(&light(&gpu, &viewpoint, plan));
    let judged = Judge::new(&scene, 32).irradiance_at(&points, 3000, 1);
    let expected = judged.iter().map(|point| point.mean.indirect.x).sum::<f64>() / points.len() as f64;
    let plan = trial::plan(&gpu, &scene, &viewpoint, &settings, sensor).unwrap();
    let radius = plan.global.as_ref().unwrap().radius * geometry.unit;
    let found = mean(plan);
    println!("radius {radius:.3} m, {found:.4} where {expected:.4} is right");
    let check = |found: f64| relative_check("light", found, expected, 0.04);
    assert_holds("the room", check(found));
    assert!((0.05..0.6).contains(&radius), "{radius}");
    let by_area = |settings: &SceneSettings| scene_plan(&gpu, &scene, settings, sensor).unwrap().1;
    // As wide as that, a disc is that of the room alone.
    assert_holds("a radius by the area, up to the walls", check(mean(by_area(&settings))));
    let beyond = SceneSettings { edge_correction: false, ..settings };
    assert_complains("a radius by the area, past the walls", check(mean(by_area(&beyond))));
}

const PICTURE: Sensor = Sensor::Picture { width: 32, height: 24 };

/// Where photons lie everywhere alike, so that the area shows the same.
fn keep_about_the_radius_of_their_area(gpu: &Gpu, names: &[&str]) {
    let settings = by_rounds();
    let mut off = Vec::new();
    for name in names {
        let viewed = Viewed::new(scene(name));
        let plan = viewed.tried(gpu, &settings, PICTURE);
        let trial = plan.trial.as_ref().unwrap();
        for map in plan.maps() {
            assert_eq!(map.radius_from, RadiusFrom::Trial);
            let neighbours = if map.caustic_only { settings.caustic_neighbours } else { settings.neighbours };
            let ratio = map.radius / area_radius(&viewed.geometry, map.photons, neighbours, map.caustic_only);
            println!("{name}, {}: {ratio:.3} of the radius by area, {trial:?}", map.name);
            if !(0.7..1.45).contains(&ratio) || trial.too_wide > 0.1 {
                off.push(format!("{name}, {}: {ratio}, {trial:?}", map.name));
            }
        }
    }
    assert!(off.is_empty(), "{off:#?}");
}

/// The radius follows from scene, points and settings alone; one that is given is taken, and nothing is tried.
#[test]
fn a_trial_knows_no_seed_builder_or_split() {
    let Some(gpu) = device() else { return };
    keep_about_the_radius_of_their_area(&gpu, &["cornell-spheres", "caustic-sphere", "furnace"][..of_run(1, 3)]);
    let spheres = Viewed::new(scene("cornell-spheres"));
    let radii = |settings: &SceneSettings| {
        let plan = spheres.tried(&gpu, settings, PICTURE);
        plan.maps().map(|map| (map.radius.to_bits(), map.radius_from)).collect::<Vec<_>>()
    };
    let settings = by_rounds();
    let expected = radii(&settings);
    for builder in [Builder::Atomic, Builder::Ballot] {
        let otherwise = SceneSettings { builder: Some(builder), seed: 7, chunk: Some(5000), ..settings.clone() };
        assert_eq!(radii(&otherwise), expected, "{builder:?}");
    }
    // A quarter of the photons: twice the radius, in whole steps.
    let fewer = radii(&SceneSettings { photons: settings.photons / 4, ..settings.clone() });
    assert_eq!(f64::from_bits(fewer[0].0), 2.0 * f64::from_bits(expected[0].0));

    let given = SceneSettings { radius: Some(0.03), ..settings.clone() };
    let one = radii(&given);
    assert_eq!((one[0].1, one[1]), (RadiusFrom::User, expected[1]));
    assert_eq!(spheres.tried(&gpu, &SceneSettings { caustic_radius: Some(0.01), ..given }, PICTURE).trial, None);
    let plan = spheres.tried(&gpu, &settings, PICTURE);
    let json: serde_json::Value = serde_json::from_slice(&scene_report::plan_json(&plan)).unwrap();
    assert!(json["trial"]["seconds"].as_f64().unwrap() > 0.0 && json["maps"][0]["radius_from"] == "trial", "{json}");
}

/// A sheet that lies on all surfaces, as a varnish with gaps, is no wall to the points below and above it.
#[test]
fn sheets_that_touch_a_surface_narrow_no_radius() {
    let Some(gpu) = device() else { return };
    let bare = scene("cornell");
    let mut varnished = bare.clone();
    for mesh in bare.meshes.iter().filter(|mesh| bare.materials[mesh.material].emission == Vec3::ZERO) {
        varnished.meshes.push(Mesh { name: format!("varnish of {}", mesh.name), material: varnished.materials.len(), ..mesh.clone() });
    }
    varnished.materials.push(Material { coverage: Coverage::Blend { alpha: 0.5 }, ..dull(0.5) });
    let [bare, varnished] = [bare, varnished].map(|scene| {
        let viewed = Viewed::new(scene);
        viewed.tried(&gpu, &by_rounds(), PICTURE).global.unwrap().radius * viewed.geometry.unit
    });
    println!("radius {bare:.4} m, {varnished:.4} m with sheets");
    assert!((0.5..2.0).contains(&(varnished / bare)), "{varnished}, {bare}");
}

/// A narrow shelf is all that is asked about: the radius that its few photons call for is wider than it.
#[test]
fn a_radius_wider_than_what_it_lies_in_is_warned_of() {
    let Some(gpu) = device() else { return };
    let scene = room_on_a_plain();
    let geometry = Geometry::new(&scene).unwrap();
    // All but two points stand in the room's corners, where the wall is near in most directions.
    let corner = |x: f64, z: f64| (dvec3(1.97 * x, 0.0, 1.97 * z), DVec3::Y);
    let corners = vec![corner(1.0, 1.0), corner(-1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)];
    let middle = vec![(DVec3::ZERO, DVec3::Y); 6];
    let warning = |points: Vec<(DVec3, DVec3)>| {
        let receivers = Receivers::Points(&points);
        let viewpoint = Viewpoint { geometry: &geometry, camera: None, phases: &receivers.phases(&geometry) };
        let plan = trial::plan(&gpu, &scene, &viewpoint, &SceneSettings { photons: 1 << 10, ..by_rounds() }, receivers.sensor()).unwrap();
        scene_report::radius_warning(&plan, &geometry, "point")
    };
    let text = warning([middle.clone(), corners].concat()).expect("a warning");
    assert!(text.contains("at 40 % of the points the next wall or edge is nearer than the search radius"), "{text}");
    assert_eq!(warning(middle), None);
}

/// The least radius that a scene of 200 km allows is wider than a room: two such radii differ by nothing, and give no bias.
#[test]
fn a_room_too_small_for_its_scene_has_an_unknown_bias() {
    let Some(gpu) = device() else { return };
    for (width, is_known) in [(10.0, true), (2e5, false)] {
        let mut scene = room_on_a_plain();
        scene.meshes.push(level(-1.0, [width; 2], true, 0));
        let geometry = Geometry::new(&scene).unwrap();
        let points: Vec<_> = (0..8).map(|k| (dvec3(0.4 * f64::from(k) - 1.4, 0.0, 0.1), DVec3::Y)).collect();
        let receivers = Receivers::Points(&points);
        let viewpoint = Viewpoint { geometry: &geometry, camera: None, phases: &receivers.phases(&geometry) };
        let plan = trial::plan(&gpu, &scene, &viewpoint, &SceneSettings { photons: 1 << 12, ..by_rounds() }, receivers.sensor()).unwrap();
        let bias = scene::bias::measure(&gpu, &scene, &viewpoint, &plan, (1.0, 2), &AtomicBool::new(false)).unwrap().unwrap();
        assert_eq!(bias.is_known(), is_known, "{width} m: {bias:?}");
        let warning = scene_report::radius_warning(&plan, &geometry, "point").unwrap_or_default();
        assert_eq!(warning.contains("use `final_gather`"), !is_known, "{width} m: {warning}");
    }
}

/// The spheres, with radii by a trial round.
fn rendered(gpu: &Gpu, settings: &SceneSettings, size: [u32; 2]) -> scene::RunResult {
    let scene = scene("cornell-spheres");
    render(gpu, &scene, settings, Receivers::Image(&scene.first_camera(), size)).unwrap()
}

/// Radii by density know no builder or chunk: films are the same to the bit.
#[test]
fn radii_by_density_change_no_bit_by_builder_or_chunk() {
    let Some(gpu) = device() else { return };
    let settings = SceneSettings { photons: 4000, caustic_photons: 2000, rounds: 2, ..by_rounds() };
    let whole = rendered(&gpu, &settings, [24, 18]);
    assert!(whole.plan.has_classes() && whole.plan.maps().any(|map| whole.film.classes(map).is_some_and(|(first, last)| first < last)));
    for (builder, chunk) in [(Builder::Naive, Some(700)), (Builder::Persistent, Some(1300))] {
        let other = rendered(&gpu, &SceneSettings { builder: Some(builder), chunk, ..settings.clone() }, [24, 18]);
        assert!(other.film == whole.film && other.film.class_counts == whole.film.class_counts, "{builder:?}, {chunk:?}");
    }
}

/// A radius that is given for one map leaves the other's to the trial, and neither loses its light.
#[test]
fn one_radius_may_be_given() {
    let Some(gpu) = device() else { return };
    let settings = SceneSettings { photons: 10_000, caustic_photons: 10_000, rounds: 4, ..by_rounds() };
    let part_totals = |settings: &SceneSettings| -> Vec<f64> {
        rendered(&gpu, settings, [16, 12]).film.part_totals.iter().map(|total| *total as f64).collect()
    };
    let expected = part_totals(&settings);
    let global = part_totals(&SceneSettings { radius: Some(0.1), ..settings.clone() });
    let caustic = part_totals(&SceneSettings { caustic_radius: Some(0.02), ..settings });
    for (what, part) in [("caustics", 2), ("indirect light", 3)] {
        for found in [&global, &caustic] {
            assert!((found[part] / expected[part] - 1.0).abs() < 0.2, "{what}: {found:?}, {expected:?}");
        }
    }
}
