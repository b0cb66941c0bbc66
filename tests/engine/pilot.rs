//! A pilot's choice: what it expects of a round is what rounds are like, and it chooses the same twice.

use std::sync::atomic::AtomicBool;

use crate::common::prelude::*;
use photonmill::engine::scene::SceneFilm;
use photonmill::engine::scene::pilot::{self, Pilot};
use photonmill::engine::scene::{View, light, trial};
use photonmill::plan::work_division::{Division, Free};
use photonmill::settings::stop::Stop;
use photonmill::settings::tile_samples::TileSamples;

const SIZE: u32 = 32;
static NEVER: AtomicBool = AtomicBool::new(false);

struct Subject {
    scene: Scene,
    geometry: Geometry,
}

impl Subject {
    fn new(name: &str) -> Subject {
        let scene = scene(name);
        Subject { geometry: Geometry::new(&scene).unwrap(), scene }
    }

    fn view<'a>(&'a self, camera: &'a Camera) -> View<'a> {
        View { geometry: &self.geometry, camera: Some(camera), phases: &[] }
    }

    fn chosen(&self, gpu: &Gpu, settings: &SceneSettings, free: Free) -> Option<Pilot> {
        let camera = self.scene.first_camera();
        let view = self.view(&camera);
        let plan = trial::plan(gpu, &self.scene, &view, settings, square_picture(SIZE)).unwrap();
        pilot::choose(gpu, &self.scene, &view, &plan, free, &NEVER).unwrap()
    }

    /// The squared noise of a round, relative to the mean.
    fn variance(&self, gpu: &Gpu, settings: &SceneSettings) -> f64 {
        let camera = self.scene.first_camera();
        let view = self.view(&camera);
        let settings = SceneSettings { rounds: 64, alpha: 1.0, seed: 5, stop: Stop::default(), ..settings.clone() };
        let plan = trial::plan(gpu, &self.scene, &view, &settings, square_picture(SIZE)).unwrap();
        let lit = light(gpu, &view, plan, &mut Control::default()).unwrap();
        let noise = lit.film.relative_error();
        noise * noise * f64::from(lit.film.rounds)
    }
}

/// Few photons, which a software device traces in time.
fn few() -> SceneSettings {
    let stop = Stop { error: Some(0.05), ..Stop::default() };
    SceneSettings { photons: 1 << 13, caustic_photons: 1 << 13, stop, ..SceneSettings::default() }
}

/// Within a factor: rare light is met by chance, and even samples vary less the more there are.
#[test]
fn rounds_vary_as_the_pilot_expects() {
    let Some(gpu) = device() else { return };
    for name in ["cornell", "cornell-spheres"] {
        let subject = Subject::new(name);
        let found = subject.chosen(&gpu, &few(), Free { photons: false, caustic_photons: false, ..Free::ALL }).unwrap();
        for division in [found.before, found.chosen] {
            let measured = subject.variance(&gpu, &division.set(&few()));
            let variance = &found.rounds.variance;
            let of_paths = variance.of_paths_in_round(division);
            let of_maps = variance.global.of_first_round(division.global(), division.samples)
                + variance.caustic.of_first_round(division.caustic(), division.samples);
            let expected = of_paths + of_maps;
            println!("{name}: {division:?}: {of_paths:.4} + {of_maps:.4} expected, {measured:.4} found");
            assert!((0.3..4.0).contains(&(expected / measured)), "{name}, {division:?}: {expected} of {measured}");
        }
    }
}

/// Mirrors and glass show each path something else, and what is set stays.
#[test]
fn what_is_set_stays_and_the_rest_is_chosen_alike_each_time() {
    let Some(gpu) = device() else { return };
    let subject = Subject::new("cornell-spheres");
    let goal = |error, seconds| SceneSettings { stop: Stop { error, seconds, ..Stop::default() }, ..SceneSettings::default() };
    let fine = goal(Some(0.01), None);
    let found = subject.chosen(&gpu, &fine, Free::ALL).unwrap();
    assert!(found.tiles.is_some() && found.gain(&fine.stop) > 2.0, "{}: {found:?}", found.gain(&fine.stop));
    let again = subject.chosen(&gpu, &SceneSettings { seed: 77, ..fine.clone() }, Free::ALL).unwrap();
    assert_eq!((found.chosen, found.rounds), (again.chosen, again.rounds));
    let of_rays = subject.chosen(&gpu, &fine, Free { shadow_rays: true, ..Free::default() }).unwrap();
    assert_eq!(of_rays.chosen, Division { shadow_rays: of_rays.chosen.shadow_rays, ..of_rays.before });
    let three = SceneSettings { shadow_rays: 3, ..fine.clone() };
    let of_others = subject.chosen(&gpu, &three, Free { shadow_rays: false, ..Free::ALL }).unwrap();
    assert!(of_others.chosen.shadow_rays == 3 && of_others.chosen != of_others.before, "{of_others:?}");
    assert_eq!(subject.chosen(&gpu, &fine, Free::default()), None);
    // A small error takes more of it.
    let coarse = subject.chosen(&gpu, &goal(Some(0.3), None), Free::ALL).unwrap();
    let [rough, good] = [(&coarse, 0.3), (&found, 0.01)].map(|(pilot, error)| pilot.rounds.until(pilot.chosen, error));
    assert!(rough.0 >= 16.0 && rough.1 < 0.1 * good.1, "{rough:?} {good:?}");
}

/// The time of the device until an error, that of the pilot included, and rounds.
#[test]
fn what_a_pilot_chooses_is_faster_and_takes_about_the_rounds_that_it_expects() {
    let Some(gpu) = device() else { return };
    for name in ["open-box", "cornell-spheres"] {
        let subject = Subject::new(name);
        let usual = SceneSettings {
            rounds: 1 << 12,
            stop: Stop { error: Some(0.2), seconds: Some(60.0), ..Stop::default() },
            ..SceneSettings::default()
        };
        let pilot = subject.chosen(&gpu, &usual, Free::ALL).unwrap();
        let camera = subject.scene.first_camera();
        let view = subject.view(&camera);
        let [(chosen, rounds), (before, _)] = [pilot.set(&usual), usual.clone()].map(|settings| {
            let plan = trial::plan(&gpu, &subject.scene, &view, &settings, square_picture(SIZE)).unwrap();
            let lit = light(&gpu, &view, plan, &mut Control::default()).unwrap();
            (lit.timings.row("round").unwrap().gpu_ms.unwrap(), f64::from(lit.film.rounds))
        });
        let (expected, _) = pilot.rounds.until(pilot.chosen, 0.2);
        println!("{name}: {chosen:.0} + {:.0} of {before:.0} ms, {rounds} of {expected:.0} rounds", pilot.spent);
        assert!(chosen + pilot.spent < before, "{name}: {chosen} ms and {} for the pilot, {before} as usual", pilot.spent);
        assert!((0.3..3.0).contains(&(rounds / expected)), "{name}: {rounds} rounds, {expected} expected");
    }
}

/// Nodes that rays visit: more shadow rays more of them, each path about as many, and whatever is dispatched at once.
#[test]
fn what_paths_meet_is_counted() {
    let Some(gpu) = device() else { return };
    let subject = Subject::new("cornell-spheres");
    let camera = subject.scene.first_camera();
    let view = subject.view(&camera);
    let counted = |samples: u32, shadow_rays: u32, is_split: bool| {
        let settings = SceneSettings { samples, shadow_rays, rounds: 4, block: Some(1), stop: Stop::default(), ..few() };
        let mut plan = trial::plan(&gpu, &subject.scene, &view, &settings, square_picture(SIZE)).unwrap();
        if is_split {
            plan.work_per_submission = 1;
        }
        let [nodes, triangles] = light(&gpu, &view, plan, &mut Control::default()).unwrap().film.visited();
        let paths = f64::from(4 * samples * SIZE * SIZE);
        (nodes as f64 / paths, triangles)
    };
    let (one, triangles) = counted(1, 1, false);
    assert!(one > 2.0 && triangles > 0, "{one} nodes a path, {triangles} triangles");
    assert_eq!(counted(1, 1, true), (one, triangles));
    let (more_paths, more_rays) = (counted(4, 1, false).0, counted(1, 4, false).0);
    assert!((more_paths / one - 1.0).abs() < 0.1 && more_rays > 1.2 * one, "{one}, {more_paths}, {more_rays}");
}

/// The program takes what a pilot finds where an error ends the run and nothing is set, and goes on with it.
#[test]
fn the_program_has_a_pilot_where_an_error_ends_the_run() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let line = "render cornell-spheres --size 16x16";
    let (_, stderr) = place.succeed(&format!("{line} --error 20% -o a.exr --json a.json --checkpoint a.pms"));
    let settings = place.json("a.json")["settings"].clone();
    let names = ["samples", "shadow_rays", "photons", "caustic_photons", "neighbours", "caustic_neighbours"];
    let values = names.map(|name| settings[name].as_u64().unwrap());
    assert!(values[2] < 131_072 && stderr.contains(&format!("pilot: {} path", values[0])), "{stderr}");
    // By hand it is the same run.
    let by_hand: String = names.iter().zip(values).map(|(name, value)| format!(" --{} {value}", name.replace('_', "-"))).collect();
    place.succeed(&format!("{line} --error 20% -o b.exr{by_hand} -q"));
    assert!(std::fs::read(place.at("a.exr")).unwrap() == std::fs::read(place.at("b.exr")).unwrap());
    // And it goes on without a pilot.
    let (_, stderr) = place.succeed(&format!("{line} --error 19% -o c.exr --json c.json --resume a.pms"));
    assert!(!stderr.contains("pilot: ") && names.iter().all(|name| place.json("c.json")["settings"][name] == settings[name]), "{stderr}");
    let (_, stderr) = place.succeed(&format!("{line} --rounds 4 --photons 2000 -o d.exr"));
    assert!(!stderr.contains("pilot: "), "{stderr}");
}

/// Tiles with more samples show the same picture: what differs is noise, and there is less of it.
#[test]
fn tiles_with_more_samples_change_no_mean() {
    let Some(gpu) = device() else { return };
    for final_gather in [false, true] {
        let subject = Subject::new("cornell-spheres");
        let camera = subject.scene.first_camera();
        let rows: Vec<u32> = (0..64).map(|tile| [0, 1, 0, 2, 3, 0, 0, 1][tile as usize % 8]).collect();
        let light_of = |tiles: Option<TileSamples>| {
            let stop = Stop::default();
            let settings = SceneSettings { tiles, rounds: 32, final_gather, stop, ..few() };
            let plan = trial::plan(&gpu, &subject.scene, &subject.view(&camera), &settings, square_picture(SIZE)).unwrap();
            light(&gpu, &subject.view(&camera), plan, &mut Control::default()).unwrap().film
        };
        let (even, tiled) = (light_of(None), light_of(Some(TileSamples::new(&rows, (SIZE, SIZE)))));
        let mut squares = 0.0;
        for pixel in 0..even.pixels() {
            let [one, other] = [&even, &tiled].map(|film| (film.mean(pixel), film.standard_error(pixel)));
            let variance = one.1.length_squared() + other.1.length_squared();
            // What shines by itself does not vary.
            squares += if variance > 0.0 { (one.0 - other.0).length_squared() / variance } else { 0.0 };
        }
        // Of independent errors it is 1; those of the same photons go together.
        let squares = squares / even.pixels() as f64;
        println!("final gather {final_gather}: squared differences over their variance {squares:.2}");
        assert!(squares < 2.0, "{squares}");
        let [one, other] = [&even, &tiled].map(|film| film.surface_means().map(DVec3::element_sum).sum::<f64>());
        assert!((one / other - 1.0).abs() < 0.02, "{one} {other}");
        // Where there are eight times the paths there is less noise; that of gather rays is mostly the photons'.
        let noise = |film: &SceneFilm, column: u32| {
            (0..SIZE)
                .flat_map(|y| (4 * column..4 * column + 4).map(move |x| y * SIZE + x))
                .map(|pixel| film.surface_error(pixel as usize).length_squared())
                .sum::<f64>()
        };
        let quieter = noise(&tiled, 4) / noise(&even, 4);
        println!("8 times the samples leave {quieter:.3} of the squared noise");
        assert!(final_gather || quieter < 0.6, "{quieter}");
        // As many pixels show surfaces.
        assert_eq!(format!("{:.2?}", even.measure()), format!("{:.2?}", tiled.measure()));
    }
}

/// What a pilot has chosen is kept in a file, and used again to the same bits.
#[test]
fn settings_are_kept_in_a_file() {
    let Some(gpu) = device() else { return };
    let place = Place::new();
    // So small that the pilot looks at all pixels, and finds tiles.
    let is_cpu = gpu.facts().kind == "cpu";
    let [error, smaller] = if is_cpu { ["12% --photons 1024 --caustic-photons 1024", "11%"] } else { ["3%", "2%"] };
    let line = format!("render cornell-spheres --size 24x24 --error {error}");
    place.succeed(&format!("{line} -o a.exr --save-settings s.json --checkpoint a.pms"));
    let chosen = place.json("s.json");
    assert!(chosen["rounds"].as_u64().unwrap() >= 16 && chosen["tiles"].is_array(), "{chosen}");
    let (_, stderr) = place.succeed(&format!("{line} -o b.exr --settings s.json"));
    assert!(!stderr.contains("pilot") && !stderr.contains("warning"), "{stderr}");
    let bytes = |name: &str| std::fs::read(place.at(name)).unwrap();
    assert!(bytes("a.exr") == bytes("b.exr"));
    // A pilot alone, and shards that use it.
    let (_, stderr) = place.succeed(&format!("{line} --save-settings t.json"));
    assert!(stderr.contains("wrote t.json") && bytes("s.json") == bytes("t.json"), "{stderr}");
    for shard in [1, 2] {
        place.succeed(&format!("render cornell-spheres --size 24x24 --settings s.json --shard {shard}/2 --checkpoint {shard}.pms -q"));
    }
    place.succeed("merge 1.pms 2.pms -o merged.exr");
    place.succeed("render cornell-spheres --size 24x24 --settings s.json -o whole.exr -q");
    let light = |name: &str| image::open(place.at(name)).unwrap().into_rgb32f();
    assert!(light("merged.exr") == light("whole.exr"));
    // A checkpoint carries all of it.
    place.succeed(&format!("render cornell-spheres --size 24x24 --error {smaller} -o c.exr --json c.json --resume a.pms -q"));
    assert_eq!(place.json("c.json")["settings"]["tiles"], chosen["tiles"]);
    let (_, stderr) = place.succeed("render cornell --size 24x24 --settings s.json --rounds 1 -o d.exr");
    assert!(stderr.contains("warning: --settings: chosen for cornell-spheres, which was another scene"), "{stderr}");
    std::fs::write(place.at("wrong.json"), b"{}").unwrap();
    let text = String::from_utf8(bytes("s.json")).unwrap();
    std::fs::write(place.at("many.json"), text.replace("\"shadow_rays\": ", "\"shadow_rays\": 9")).unwrap();
    place.assert_refused([
        ("render cornell --settings absent.json -o e.exr", ["--settings absent.json", "cannot be read"].as_slice()),
        ("render cornell --settings wrong.json -o e.exr", &["--settings wrong.json", "is no file of --save-settings"]),
        ("render cornell --settings many.json -o e.exr", &["--settings many.json", "--shadow-rays"]),
        ("render cornell-spheres --size 24x24 --settings s.json --paranoid -o e.exr -q", &["--paranoid", "--samples"]),
    ]);
}
