//! Shadow rays and photons choose lights by what these do where it is asked.

use crate::common::chi_square::counts_check;
use crate::common::lamps::{
    ROOM, bright_spot, cut_lamp, dark_room, dim_room, hidden_lamp, many_lamps, planned, points, result_of, result_of_plan, rooms,
    same_light_and_noise, scattered_light, usual,
};
use crate::common::planted;
use crate::common::prelude::*;
use photonmill::constants::{LIGHT_LEAF, NONE};
use photonmill::engine::scene::resources::SceneResources;
use photonmill::engine::scene::{self, Receivers};
use photonmill::gpu::kernels::TryLights;
use photonmill::output::scene_report;
use photonmill::plan::light_choice::LightChoice;
use photonmill::records::{Draws, LightNode, Receiver, TryLightsPush};
use photonmill::scene::material::Layers;
use photonmill::verify::judge::Verdict;

#[test]
fn a_dim_room_beside_a_bright_one_is_lit_as_if_it_were_alone() {
    let Some(gpu) = device() else { return };
    assert_holds("1:1e6", dim_room(&gpu, 1e6, true));
    assert_complains("lights by power", dim_room(&gpu, 1e2, false));
}

/// Also of one that is dark, by the same kernels.
#[test]
fn scattered_light_of_a_dim_room_has_photons_of_its_own() {
    let Some(gpu) = device() else { return };
    assert_holds("1:1e6", scattered_light(&gpu, 1e6, true));
    a_dark_room_beside_a_bright_one_is_not_known_to_be_dark(&gpu);
}

#[test]
fn a_lamp_that_lights_what_lights_the_points_has_photons_too() {
    let Some(gpu) = device() else { return };
    assert_holds("a screened lamp", hidden_lamp(&gpu, 1e4, true));
    if is_long_run() {
        assert_complains("a screened lamp by power", hidden_lamp(&gpu, 1e4, false));
        assert_complains("a dim room by power", scattered_light(&gpu, 1e3, false));
    }
}

#[test]
fn a_small_bright_spot_of_a_textured_lamp_is_found() {
    let Some(gpu) = device() else { return };
    assert_holds("a bright spot", bright_spot(&gpu, Wrap::Clamp, Illumination::Photons));
    if is_long_run() {
        assert_holds("a bright spot", bright_spot(&gpu, Wrap::MirroredRepeat, Illumination::Split));
    }
}

/// Photons that choose lights otherwise bring the same light: within a radius that is given, nothing else differs.
#[test]
#[ignore = "long: two and a half million photons, and kernels with and without a choice"]
fn photons_by_sight_bring_as_much_light_as_by_power() {
    let Some(gpu) = device() else { return };
    let mut scene = rooms(&[1.0, 3.0]);
    // A lamp that faces the wall, so that little of it is seen, and a small one that is strong.
    let (corner, x, y) = (DVec3::new(-1.0, 1.0, -1.7), DVec3::X * 0.5, DVec3::Y * 0.5);
    scene.meshes.push(Mesh::parallelogram("cove", corner, y, x, 2));
    scene.meshes.push(Mesh::parallelogram("small", DVec3::new(1.0, 2.5, 1.0), DVec3::X * 0.1, DVec3::Z * 0.1, 3));
    scene.materials.push(Material { emission: Vec3::splat(50.0), ..matt(0.0) });
    let of_photons = SceneSettings { illumination: Illumination::Photons, radius: Some(0.3), alpha: 1.0, ..usual() };
    let settings = SceneSettings { photons: 1 << 14, rounds: 48, ..of_photons };
    let by_power = result_of(&gpu, &scene, &settings, &points(), false);
    let (geometry, plan) = planned(&gpu, &scene, &settings, &points(), true);
    let scale = |plan: &ScenePlan| plan.global.as_ref().unwrap().flux_scale;
    assert!(scale(&by_power.plan) == 1.0 && scale(&plan) > 1.5 && scale(&plan) < 2.1, "{}", scale(&plan));
    let by_sight = result_of_plan(&gpu, (geometry.clone(), plan.clone()), &points());
    assert_holds("photons by sight", same_light_and_noise("photons by sight", &by_sight, &by_power, 2.0));
    let mut more = plan;
    more.global.as_mut().unwrap().flux_scale *= 1.25;
    let more = result_of_plan(&gpu, (geometry, more), &points());
    assert_complains("photons that carry a quarter more", same_light_and_noise("a quarter more", &more, &by_power, 2.0));
}

#[test]
fn a_hundred_thousand_lamps_light_as_one_does() {
    let Some(gpu) = device() else { return };
    assert_holds("100 352 triangles", many_lamps(&gpu, 224, true));
    assert_complains("lights by power", many_lamps(&gpu, 224, false));
}

/// What nothing has reached stays unknown beside a room that is lit.
fn a_dark_room_beside_a_bright_one_is_not_known_to_be_dark(gpu: &Gpu) {
    let mut scene = rooms(&[1.0, 100.0]);
    scene.meshes.extend(dark_room(2.0 * ROOM));
    let dark = points().into_iter().map(|(at, normal)| (at + 2.0 * ROOM, normal));
    let all: Vec<_> = points().into_iter().chain(dark).collect();
    let found = result_of(gpu, &scene, &SceneSettings { rounds: 4, photons: 3000, ..usual() }, &all, true);
    let unknown = found.film.unknown(0.95);
    println!("{unknown:?}");
    assert_eq!((unknown.asked, unknown.unreached), (120, 60));
    assert!(unknown.upper_bound > 0.0 && (60..120).all(|point| found.film.stated_error(point) == DVec3::INFINITY));
}

/// The choice knows no builder, chunk, part or seed, and films are the same to the bit.
#[test]
fn lights_are_chosen_alike_by_every_builder_chunk_and_part() {
    let Some(gpu) = device() else { return };
    let scene = rooms(&[1.0, 30.0]);
    let settings = SceneSettings { photons: 4000, rounds: 2, ..usual() };
    let lights = |settings: &SceneSettings| planned(&gpu, &scene, settings, &points(), true).1.trial.unwrap().lights.unwrap();
    let expected_lights = lights(&settings);
    assert_eq!(expected_lights.clusters, 4);
    for part in [Part::Direct, Part::Indirect] {
        assert!(lights(&SceneSettings { part, ..settings.clone() }) == expected_lights, "{part:?}");
    }
    assert!(lights(&SceneSettings { seed: 7, ..settings.clone() }) == expected_lights);
    let expected = result_of(&gpu, &scene, &settings, &points(), true);
    for (builder, chunk) in [(Builder::Ballot, Some(700)), (Builder::Persistent, Some(1300))] {
        let found = result_of(&gpu, &scene, &SceneSettings { builder: Some(builder), chunk, ..settings.clone() }, &points(), true);
        assert!(found.film == expected.film, "{builder:?}, {chunk:?}");
        assert!(found.plan.trial.unwrap().lights.unwrap() == expected_lights, "{builder:?}, {chunk:?}");
    }
}

/// No maps, of which the choice of lights knows nothing.
fn lights_alone() -> SceneSettings {
    SceneSettings { without: vec![Effect::Indirect], ..usual() }
}

/// What a scene of one lamp does not need is in no plan of it, and reports say what others have.
#[test]
fn one_lamp_is_not_chosen() {
    let Some(gpu) = device() else { return };
    for (name, scene, clusters) in [("cornell", scene("cornell"), 0), ("two rooms", rooms(&[1.0, 2.0]), 4), ("pieces", cut_lamp(9), 64)] {
        let (_, plan) = planned(&gpu, &scene, &lights_alone(), &points(), true);
        assert_eq!(plan.lights().map_or(0, |lights| lights.clusters), clusters, "{name}");
        let table = scene_report::plan_table(&plan, None);
        assert_eq!(table.contains("by what a trial saw of them"), clusters > 0, "{table}");
    }
}

/// Twin of `light_importance` in `glsl/world/scene/light_choice.glsl`.
fn importance(node: &LightNode, position: Vec3) -> f32 {
    node.power / (node.centre - position).length_squared().max(node.radius_squared).max(1e-12)
}

/// The probability of each light below a node, at a place: twin of `choose_within`.
fn add_probabilities(lights: &LightChoice, node: u32, probability: f64, position: Vec3, of: &mut [f64]) {
    let child = lights.nodes[node as usize].child;
    if child & LIGHT_LEAF != 0 {
        of[(child & !LIGHT_LEAF) as usize] += probability;
        return;
    }
    let [left, right] = [child, child + 1].map(|half| importance(&lights.nodes[half as usize], position));
    let share = f64::from((65536.0 * left / (left + right)).round() / 65536.0).clamp(1.0 / 64.0, 63.0 / 64.0);
    add_probabilities(lights, child, share * probability, position, of);
    add_probabilities(lights, child + 1, (1.0 - share) * probability, position, of);
}

/// The probability of every light at a place, by a row of shares of clusters.
fn probabilities(lights: &LightChoice, row: usize, position: Vec3) -> Vec<f64> {
    let mut of = vec![0.0; lights.emitters.len()];
    let mut before = 0.0;
    for (cluster, share) in (0..).zip(&lights.shares[row..row + lights.clusters as usize]) {
        add_probabilities(lights, cluster, f64::from(share - before), position, &mut of);
        before = *share;
    }
    of
}

/// Where the rows of a place begin: twin of `row_of_shares`.
fn rows(lights: &LightChoice, place: [f32; 6]) -> usize {
    let mut region = lights.regions[0];
    while region.axis != NONE {
        let above = place[region.axis as usize] >= region.split;
        region = lights.regions[(region.next + u32::from(above)) as usize];
    }
    2 * (region.next * lights.clusters) as usize
}

/// Lights at three places, as many times as each of 64 clusters has a thread for each of so many receivers: by `choose_light`, from the
/// row of what the trial saw or from the other, in a kernel that says so in place of what a trial asks it. With the probability that
/// it states.
fn picks(gpu: &Gpu, geometry: &Geometry, plan: &ScenePlan, receivers: &[Receiver], unseen: bool) -> Vec<(usize, f64)> {
    let mut commands = Commands::new(gpu, scene::constants(plan), Instant::now()).unwrap();
    let resources = SceneResources::new(&mut commands, geometry, plan, &[]).unwrap();
    let pairs = receivers.len() * 64;
    let points = commands.uploaded("points", receivers).unwrap();
    let found = gpu.buffer::<f32>("found", pairs as u64, Memory::Device).unwrap();
    let mut ask = |what: u32| {
        let SceneResources { scene, nonfinite_values, .. } = &resources;
        let kernel = TryLights { scene, receivers: &points, found: &found, nonfinite_values };
        let draws = Draws { seed: UVec2::new(5, 6), round: 0, domain: 0 };
        let push = TryLightsPush { draws, first_pair: 0, end_pair: pairs as u32, cluster_count: 64, ray_count: what };
        commands.dispatch(kernel, &push, Extent::Items(pairs as u64)).unwrap();
        commands.read(&found, pairs).unwrap()
    };
    let (lights, probabilities) = (ask(2 * u32::from(unseen)), ask(2 * u32::from(unseen) + 1));
    lights.into_iter().zip(probabilities).map(|(light, probability)| (light as usize, f64::from(probability))).collect()
}

const PICK: &str = "ChosenLight pick = choose_light(row_of_shares(here.surface.position, here.surface.ng, push.ray_count < 2), here.surface.position, \
    stratified(0, 1, words_of(pair, 1, push.draws)).x, mix32(words.w));\n    \
    found[pair] = (push.ray_count & 1) == 0 ? float(pick.emitter) : pick.probability;";

/// A kernel chooses lights as often as it says, and as its twin here does.
#[test]
fn lights_are_chosen_as_often_as_is_said() {
    let Some(mut gpu) = open(Options::default()) else { return };
    let mut scene = cut_lamp(20);
    scene.meshes.extend(moved(rooms(&[1.0]), |at| at + ROOM).meshes);
    let (geometry, plan) = planned(&gpu, &scene, &lights_alone(), &points(), true);
    let lights = plan.lights().expect("there are many lights");
    assert_eq!(lights.clusters, 64);
    let last = "found[pair] = largest * sqrt(divide(sum, float(push.ray_count)));";
    gpu.replace(planted::kernels(&["try_lights"], "kernels/try_lights.comp", &[(last, PICK)]));
    let mut chosen = BTreeSet::new();
    for (position, normal) in [points()[0], points()[12], points()[30]] {
        let receiver = scene::receiver(&geometry, (position, normal));
        let place = [receiver.position.to_array(), receiver.normal.to_array()].concat();
        let row = rows(lights, place.try_into().unwrap());
        for (unseen, row) in [(false, row), (true, row + 64)] {
            let expected = probabilities(lights, row, receiver.position);
            let found = picks(&gpu, &geometry, &plan, &vec![receiver; 1024], unseen);
            let mut counts = vec![0u64; expected.len()];
            for (light, stated) in &found {
                counts[*light] += 1;
                assert!((stated / expected[*light] - 1.0).abs() < 1e-2, "{stated} is said, {} is right", expected[*light]);
            }
            assert_holds(format!("{position}"), counts_check("lights", &counts, &expected));
            chosen.extend(found.iter().map(|(light, _)| *light));
            let twisted: Vec<f64> = expected.iter().enumerate().map(|(k, share)| share * if k % 2 == 0 { 1.1 } else { 0.9 }).collect();
            let sum: f64 = twisted.iter().sum();
            let twisted: Vec<f64> = twisted.iter().map(|share| share / sum).collect();
            let is_one = expected.iter().filter(|share| **share > 1e-3).count() < 4;
            assert!(is_one || counts_check("other shares", &counts, &twisted).is_err(), "{position}");
        }
    }
    assert_eq!(chosen.len(), lights.emitters.len(), "lights that were chosen from somewhere");
}

/// From anywhere every light may be chosen, in one of two ways, whose probabilities add up to 1 each.
#[test]
fn no_light_is_impossible_and_probabilities_add_up_to_one() {
    let lights = of_run(Vec::new(), every_kind_of_light(1.0, 1e-3, EmissionLaw::Cosine));
    let Some(gpu) = device() else { return };
    let mut scene = rooms(&[1.0, 1e-6, 1e6]);
    scene.meshes.extend(moved(cut_lamp(30), |at| at + DVec3::new(0.0, 1.5, 6.0)).meshes.pop());
    scene.lights = lights;
    let below_lamps = grid(1.0, DVec3::Y, 6).into_iter().map(|(at, normal)| (at + DVec3::Z * 6.0, normal));
    let all: Vec<_> = points().into_iter().chain(below_lamps).collect();
    let (_, plan) = planned(&gpu, &scene, &lights_alone(), &all, true);
    let lights = plan.lights().expect("there are many lights");
    let emitter_count = lights.emitters.len();
    println!("{emitter_count} lights, {} clusters, {} shares", lights.clusters, lights.shares.len());
    assert!(emitter_count > 1800 && lights.clusters == 64 && lights.shares.len() > 4 * 2 * 64);
    let mut seen_from_some = BTreeSet::new();
    for k in 0..200u32 {
        let words = [philox([k, 0, 0, 0], [3, 4]), philox([k, 1, 0, 0], [3, 4])].concat();
        let place: [f32; 6] =
            std::array::from_fn(|axis| (f64::from(words[axis]) / 2f64.powi(31) - 1.0) as f32 * if axis < 3 { 0.5 } else { 1.0 });
        let position = Vec3::from_slice(&place);
        let row = rows(lights, place);
        let mut reached = vec![0.0; emitter_count];
        for (which, row) in [row, row + 64].into_iter().enumerate() {
            let own = probabilities(lights, row, position);
            let sum: f64 = own.iter().sum();
            assert!((sum - 1.0).abs() < 1e-9 || (which == 1 && sum == 0.0), "{place:?}: {sum}");
            if which == 0 {
                seen_from_some.extend(own.iter().enumerate().filter(|(_, share)| **share > 0.0).map(|(light, _)| light));
            }
            // No light is chosen in both ways.
            assert!(own.iter().zip(&reached).all(|(own, before)| *own == 0.0 || *before == 0.0), "{place:?}");
            reached.iter_mut().zip(&own).for_each(|(sum, own)| *sum += own);
        }
        assert!(reached.iter().all(|probability| *probability > 0.0), "{place:?}");
    }
    assert!(seen_from_some.len() > 1000 && seen_from_some.len() < emitter_count, "{}", seen_from_some.len());
    // Photons, too, may leave any.
    let sum: f64 = lights.emitters.iter().map(|emitter| f64::from(emitter.probability)).sum();
    assert!((sum - 1.0).abs() < 1e-6 && lights.emitters.iter().all(|emitter| emitter.probability > 0.0), "{sum}");
}

/// An emissive square of 0.8 m that transmits, 1 m above a floor; its front looks up.
fn glowing_pane() -> Scene {
    let layers = Layers { metallic: 0.0, transmission: 1.0, ..Layers::default() };
    let pane = Material { emission: Vec3::ONE, ..Material::layered("pane", Vec3::splat(0.5), layers) };
    let floor = Material { two_sided: true, ..Material::lambert("floor", Vec3::splat(0.6)) };
    let meshes = vec![level(0.0, [2.0, 2.0], true, 0), level(1.0, [0.8, 0.8], true, 1)];
    scene_of(meshes, vec![floor, pane], vec![])
}

/// What transmits has two sides, also where it emits: photons carry as much from its back, to a floor, as from its front, to a ceiling.
/// The number is by quadrature over the pane and the radius.
#[test]
fn glowing_panes_emit_both_ways() {
    let Some(gpu) = device() else { return };
    let mut scene = glowing_pane();
    scene.meshes.push(level(2.0, [2.0, 2.0], false, 0));
    let result = received(&gpu, &scene, &mapped(40_000, 32, 1, 0.1), &[(DVec3::ZERO, DVec3::Y), (2.0 * DVec3::Y, DVec3::NEG_Y)]);
    for (place, what) in ["floor", "ceiling"].into_iter().enumerate() {
        assert_holds(what, red_check(what, &result, place, 0.5247, [0.03, 0.0]));
    }
}

/// A camera sees what photons carry, by both illuminations.
#[test]
#[ignore = "long: a picture, and kernels of shadow rays too"]
fn glowing_panes_look_as_they_emit() {
    let Some(gpu) = device() else { return };
    let mut scene = glowing_pane();
    scene.cameras.push(Camera::looking_at("camera", DVec3::new(0.0, 0.5, 3.0), DVec3::new(0.0, 0.0, 0.3), DVec3::Y, 0.6));
    let camera = scene.first_camera();
    let judged = Judge::new(&scene, 64).image(&camera, 10, 10, 512, 5);
    for illumination in BOTH {
        let settings =
            SceneSettings { photons: 20_000, caustic_photons: 20_000, rounds: 32, radius: Some(0.1), illumination, ..by_rounds() };
        let result = render(&gpu, &scene, &settings, Receivers::Image(&camera, [10; 2])).unwrap();
        let verdict = Verdict::new(&means(&result), &standard_errors(&result), 32, &judged, None);
        assert!(verdict.agrees(), "{illumination:?}: {verdict}");
    }
}
