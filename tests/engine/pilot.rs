//! A pilot's choice: what it expects of a round is what rounds are like, and it chooses the same twice.

use std::sync::atomic::AtomicBool;

use crate::common::prelude::*;
use crate::common::rendered::Viewed;
use photonmill::engine::End;
use photonmill::engine::scene::pilot::{self, Pilot};
use photonmill::engine::scene::{RunResult, SceneFilm};
use photonmill::plan::work_division::{Division, TunableSettings};
use photonmill::settings::stop::Stop;
use photonmill::settings::tile_samples::TileSamples;

const SIZE: u32 = 16;
static NEVER: AtomicBool = AtomicBool::new(false);

/// Mirrors and glass show each path something else.
fn spheres() -> Viewed {
    Viewed::new(scene("cornell-spheres"))
}

fn chosen(gpu: &Gpu, spheres: &Viewed, settings: &SceneSettings, tunable: TunableSettings) -> Option<Pilot> {
    let plan = spheres.tried(gpu, settings, square_picture(SIZE));
    pilot::choose(gpu, &spheres.scene, &spheres.viewpoint(), &plan, tunable, &NEVER).unwrap()
}

fn result_of(gpu: &Gpu, spheres: &Viewed, settings: &SceneSettings) -> RunResult {
    spheres.run(gpu, spheres.tried(gpu, settings, square_picture(SIZE)))
}

/// Few photons, which a software device traces in time.
fn few() -> SceneSettings {
    let stop = Stop { error: Some(0.05), ..Stop::default() };
    SceneSettings { photons: 1 << 13, caustic_photons: 1 << 13, stop, ..SceneSettings::default() }
}

/// Within a factor: rare light is met by chance, and even samples vary less the more there are. In the long run before the pilot has chosen,
/// too, and of more rounds.
fn rounds_vary_as_the_pilot_expects(gpu: &Gpu, spheres: &Viewed) {
    let found = chosen(gpu, spheres, &few(), TunableSettings { photons: false, caustic_photons: false, ..TunableSettings::ALL }).unwrap();
    let rounds = of_run(16, 32);
    for division in [found.chosen].into_iter().chain(is_long_run().then_some(found.before)) {
        // The squared noise of a round, relative to the mean.
        let result = result_of(gpu, spheres, &SceneSettings { rounds, alpha: 1.0, seed: 5, stop: Stop::default(), ..division.set(&few()) });
        let measured = result.film.relative_error().powi(2) * f64::from(result.film.rounds);
        let variance = &found.rounds.variance;
        let of_paths = variance.of_paths_in_round(division);
        let of_maps = variance.global.of_first_round(division.global(), division.samples)
            + variance.caustic.of_first_round(division.caustic(), division.samples);
        println!("{division:?}: {of_paths:.4} + {of_maps:.4} expected, {measured:.4} found");
        assert!((0.3..4.0).contains(&((of_paths + of_maps) / measured)), "{division:?}: {of_paths} + {of_maps} of {measured}");
    }
}

fn what_is_set_stays_and_the_rest_is_chosen_alike_each_time(gpu: &Gpu, spheres: &Viewed) {
    let goal = |error| SceneSettings { stop: Stop { error: Some(error), ..Stop::default() }, ..SceneSettings::default() };
    let (usual, coarse) = (goal(0.1), goal(0.4));
    let found = chosen(gpu, spheres, &usual, TunableSettings::ALL).unwrap();
    assert!(found.gain(&usual.stop) > 2.0, "{}: {found:?}", found.gain(&usual.stop));
    let again = chosen(gpu, spheres, &SceneSettings { seed: 77, ..usual.clone() }, TunableSettings::ALL).unwrap();
    assert_eq!((found.chosen, found.rounds), (again.chosen, again.rounds));
    let of_rays = chosen(gpu, spheres, &usual, TunableSettings { shadow_rays: true, ..TunableSettings::default() }).unwrap();
    assert_eq!(of_rays.chosen, Division { shadow_rays: of_rays.chosen.shadow_rays, ..of_rays.before });
    let three = SceneSettings { shadow_rays: 3, ..usual.clone() };
    let of_others = chosen(gpu, spheres, &three, TunableSettings { shadow_rays: false, ..TunableSettings::ALL }).unwrap();
    assert!(of_others.chosen.shadow_rays == 3 && of_others.chosen != of_others.before, "{of_others:?}");
    assert_eq!(chosen(gpu, spheres, &usual, TunableSettings::default()), None);
    // A small error takes more of it; a GPU, on which a round costs more than its paths, saves little by a large one.
    let most = if gpu.facts().kind == "cpu" { 0.5 } else { 1.0 };
    let rough = chosen(gpu, spheres, &coarse, TunableSettings::ALL).unwrap();
    let [rough, good] = [(&rough, 0.4), (&found, 0.1)].map(|(pilot, error)| pilot.rounds.until(pilot.chosen, error));
    assert!(rough.0 >= 16.0 && rough.1 < most * good.1, "{rough:?} {good:?}");
}

/// The work until an error, by what the pilot says of a round and the rounds that runs took.
fn what_a_pilot_chooses_is_less_work_and_takes_about_the_rounds_that_it_expects(gpu: &Gpu, spheres: &Viewed) {
    let stop = Stop { error: Some(0.5), ..Stop::default() };
    let usual = SceneSettings { photons: 1 << 13, caustic_photons: 1 << 13, rounds: 1 << 12, stop, ..SceneSettings::default() };
    let pilot = chosen(gpu, spheres, &usual, TunableSettings::ALL).unwrap();
    let [(work, rounds), (before, _)] = [(pilot.chosen, pilot.set(&usual)), (pilot.before, usual)].map(|(division, settings)| {
        let result = result_of(gpu, spheres, &settings);
        assert_eq!(result.end, End::Error, "{division:?}");
        let rounds = f64::from(result.film.rounds);
        (1e-6 * rounds * pilot.rounds.cost(division), rounds)
    });
    let (expected, _) = pilot.rounds.until(pilot.chosen, 0.5);
    println!("{work:.0} of {before:.0} ms, {rounds} of {expected:.0} rounds");
    assert!(work < before, "{work} ms, {before} as usual");
    assert!((0.3..3.0).contains(&(rounds / expected)), "{rounds} rounds, {expected} expected");
}

/// Nodes that rays visit, whatever is dispatched at once; more shadow rays visit more of them, and each path about as many.
fn what_paths_meet_is_counted(gpu: &Gpu, spheres: &Viewed) {
    let counted = |samples: u32, shadow_rays: u32, is_split: bool| {
        let settings = SceneSettings { samples, shadow_rays, rounds: 1, block: Some(1), stop: Stop::default(), ..few() };
        let mut plan = spheres.tried(gpu, &settings, square_picture(SIZE));
        if is_split {
            plan.work_per_submission = 1;
        }
        let [nodes, triangles] = spheres.run(gpu, plan).film.visited();
        let paths = f64::from(samples * SIZE * SIZE);
        (nodes as f64 / paths, triangles)
    };
    let (one, triangles) = counted(1, 1, false);
    assert!(one > 2.0 && triangles > 0, "{one} nodes a path, {triangles} triangles");
    assert_eq!(counted(1, 1, true), (one, triangles));
    if !is_long_run() {
        return;
    }
    let (more_paths, more_rays) = (counted(4, 1, false).0, counted(1, 4, false).0);
    assert!((more_paths / one - 1.0).abs() < 0.1 && more_rays > 1.2 * one, "{one}, {more_paths}, {more_rays}");
}

/// Tiles with more samples show the same picture: what differs is noise, and there is less of it.
fn tiles_with_more_samples_change_no_mean(gpu: &Gpu, spheres: &Viewed, final_gather: bool) {
    // The third column of tiles has eight times the samples.
    let rows: Vec<u32> = (0..16).map(|tile| [0, 1, 3, 2][tile % 4]).collect();
    let light_of = |tiles: Option<TileSamples>| {
        result_of(gpu, spheres, &SceneSettings { tiles, rounds: 16, final_gather, stop: Stop::default(), ..few() }).film
    };
    let (even, tiled) = (light_of(None), light_of(Some(TileSamples::new(&rows, (SIZE, SIZE)))));
    let mut squares = 0.0;
    for pixel in 0..even.pixels() {
        let [one, other] = [&even, &tiled].map(|film| (film.mean(pixel), film.standard_error(pixel)));
        let variance = one.1.length_squared() + other.1.length_squared();
        // What emits light does not vary.
        squares += if variance > 0.0 { (one.0 - other.0).length_squared() / variance } else { 0.0 };
    }
    // Of independent errors it is 1; those of the same photons go together.
    let squares = squares / even.pixels() as f64;
    println!("final gather {final_gather}: squared differences over their variance {squares:.2}");
    assert!(squares < 2.0, "{squares}");
    let [one, other] = [&even, &tiled].map(|film| film.surface_means().map(DVec3::element_sum).sum::<f64>());
    assert!((one / other - 1.0).abs() < 0.02, "{one} {other}");
    // There is less noise; that of gather rays is mostly the photons'.
    let column = || (0..SIZE * SIZE).filter(|pixel| pixel % SIZE / 4 == 2);
    let noise = |film: &SceneFilm| column().map(|pixel| film.surface_error(pixel as usize).length_squared()).sum::<f64>();
    let quieter = noise(&tiled) / noise(&even);
    println!("8 times the samples leave {quieter:.3} of the squared noise");
    assert!(final_gather || quieter < 0.6, "{quieter}");
    // As many pixels show surfaces.
    let [one, other] = [&even, &tiled].map(|film| film.surface_means().filter(|mean| mean.max_element() > 0.0).count());
    assert_eq!(one, other);
}

/// One device for all of it, which compiles the kernels of the scene once.
#[test]
fn a_pilot_expects_what_rounds_are_like_and_chooses_the_same_twice() {
    let Some(gpu) = device() else { return };
    let spheres = spheres();
    rounds_vary_as_the_pilot_expects(&gpu, &spheres);
    what_is_set_stays_and_the_rest_is_chosen_alike_each_time(&gpu, &spheres);
    what_paths_meet_is_counted(&gpu, &spheres);
    tiles_with_more_samples_change_no_mean(&gpu, &spheres, false);
    if is_long_run() {
        what_a_pilot_chooses_is_less_work_and_takes_about_the_rounds_that_it_expects(&gpu, &spheres);
        tiles_with_more_samples_change_no_mean(&gpu, &spheres, true);
    }
}

/// The program takes what a pilot finds where an error ends the run and nothing is set.
#[test]
fn the_program_has_a_pilot_where_an_error_ends_the_run() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let line = "render cornell-spheres --size 8x8";
    let (_, stderr) = place.succeed(&format!("{line} --error 80% -o a.exr --json a.json"));
    let settings = place.json("a.json")["settings"].clone();
    let names = ["samples", "shadow_rays", "photons", "caustic_photons", "neighbours", "caustic_neighbours"];
    let values = names.map(|name| settings[name].as_u64().unwrap());
    assert!(values[2] < 131_072 && stderr.contains(&format!("pilot: {} path", values[0])), "{stderr}");
    // By hand it is the same run.
    let by_hand: String = names.iter().zip(values).map(|(name, value)| format!(" --{} {value}", name.replace('_', "-"))).collect();
    place.succeed(&format!("{line} --error 80% -o b.exr{by_hand} -q"));
    assert!(std::fs::read(place.at("a.exr")).unwrap() == std::fs::read(place.at("b.exr")).unwrap());
    let (_, stderr) = place.succeed(&format!("{line} --rounds 4 --photons 2000 -o d.exr"));
    assert!(!stderr.contains("pilot: "), "{stderr}");
}

/// What a pilot has chosen is kept in a file, and used again to the same bits; in the long run by a pilot alone and by shards too, and
/// of a run so long that the pilot looks at all pixels, and finds tiles.
#[test]
fn settings_are_kept_in_a_file() {
    let Some(gpu) = device() else { return };
    let of_tiles = if gpu.facts().kind == "cpu" { (24, ["15%", "14%"], true) } else { (64, ["6%", "5%"], true) };
    for (size, [error, smaller], finds_tiles) in [(16, ["50%", "45%"], false), of_tiles].into_iter().take(of_run(1, 2)) {
        let place = Place::new();
        let scene = format!("render cornell-spheres --size {size}x{size}");
        let line = format!("{scene} --error {error} --photons 1024 --caustic-photons 1024");
        let (_, stderr) = place.succeed(&format!("{line} -o a.exr --save-settings s.json --checkpoint a.pms"));
        let mut chosen = place.json("s.json");
        assert!(
            stderr.contains("pilot: ") && chosen["rounds"].as_u64().unwrap() >= 16 && chosen["tiles"].is_array() == finds_tiles,
            "{chosen}"
        );
        let (_, stderr) = place.succeed(&format!("{line} -o b.exr --settings s.json"));
        assert!(!stderr.contains("pilot") && !stderr.contains("warning"), "{stderr}");
        let bytes = |name: &str| std::fs::read(place.at(name)).unwrap();
        assert!(bytes("a.exr") == bytes("b.exr"));
        if is_long_run() {
            // A pilot alone.
            let (_, stderr) = place.succeed(&format!("{line} --save-settings t.json"));
            assert!(stderr.contains("wrote t.json") && bytes("s.json") == bytes("t.json"), "{stderr}");
        }
        // A checkpoint carries all of it.
        let (_, stderr) = place.succeed(&format!("{scene} --error {smaller} -o c.exr --json c.json --resume a.pms"));
        let kept = &place.json("c.json")["settings"];
        let is_kept = chosen["settings"].as_object().unwrap().iter().all(|(name, value)| kept[name] == *value);
        assert!(is_kept && kept["tiles"] == chosen["tiles"] && !stderr.contains("pilot: "), "{stderr}");
        // Shards use it, with tiles, and so does another scene.
        if !finds_tiles {
            chosen["tiles"] = vec!["0012"; size as usize / 4].into();
            place.write("s.json", serde_json::to_string_pretty(&chosen).unwrap());
        }
        if is_long_run() {
            let short = format!("{scene} --settings s.json --rounds 8 -q");
            for shard in [1, 2] {
                place.succeed(&format!("{short} --shard {shard}/2 --checkpoint {shard}.pms"));
            }
            place.succeed("merge 1.pms 2.pms -o merged.exr");
            place.succeed(&format!("{short} -o whole.exr"));
            assert!(place.pixels("merged.exr") == place.pixels("whole.exr"));
        }
        let (_, stderr) = place.succeed(&format!("render point-over-plane --size {size}x{size} --settings s.json --rounds 1 -o d.exr"));
        assert!(stderr.contains("warning: --settings: chosen for cornell-spheres, which was another scene"), "{stderr}");
        place.write("wrong.json", "{}");
        place.write("many.json", place.text("s.json").replace("\"shadow_rays\": ", "\"shadow_rays\": 9"));
        place.assert_refused([
            ("render cornell --settings absent.json -o e.exr", ["--settings absent.json", "cannot be read"].as_slice()),
            ("render cornell --settings wrong.json -o e.exr", &["--settings wrong.json", "is no file of --save-settings"]),
            ("render cornell --settings many.json -o e.exr", &["--settings many.json", "--shadow-rays"]),
            (&format!("{scene} --settings s.json --paranoid -o e.exr -q"), &["--paranoid", "--samples"]),
        ]);
    }
}
