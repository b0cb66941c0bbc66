//! A pilot's choice of samples and shadow rays: what it expects of a round is what rounds are like, and it chooses the same twice.

use crate::common::prelude::*;
use photonmill::engine::scene::pilot::{self, Free, Pilot};
use photonmill::engine::scene::{View, light, trial};
use photonmill::settings::stop::Stop;

const SIZE: u32 = 32;
const ALL: Free = Free { samples: true, shadow_rays: true };

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
        pilot::choose(gpu, &self.scene, &view, &plan, free).unwrap()
    }

    /// The squared noise of a round, relative to the mean.
    fn variance(&self, gpu: &Gpu, settings: &SceneSettings) -> f64 {
        let camera = self.scene.first_camera();
        let view = self.view(&camera);
        let settings = SceneSettings { rounds: 64, alpha: 1.0, seed: 5, ..settings.clone() };
        let plan = trial::plan(gpu, &self.scene, &view, &settings, square_picture(SIZE)).unwrap();
        let lit = light(gpu, &view, plan, &mut Control::default()).unwrap();
        let noise = lit.film.relative_error();
        noise * noise * f64::from(lit.film.rounds)
    }
}

/// Few photons, which a software device traces in time.
fn few() -> SceneSettings {
    SceneSettings { photons: 1 << 13, caustic_photons: 1 << 13, ..SceneSettings::default() }
}

/// Within a factor: rare light is met by chance, and even samples vary less the more there are.
#[test]
fn rounds_vary_as_the_pilot_expects() {
    let Some(gpu) = device() else { return };
    for name in ["cornell", "cornell-spheres"] {
        let subject = Subject::new(name);
        let found = subject.chosen(&gpu, &few(), ALL).unwrap();
        let products = [found.before, found.chosen].map(|division| {
            let measured = subject.variance(&gpu, &pilot::with(&few(), division));
            let expected = found.variance.variance(division);
            println!("{name}: {division:?}: {expected:.4} expected, {measured:.4} found");
            assert!((0.3..4.0).contains(&(expected / measured)), "{name}, {division:?}: {expected} of {measured}");
            measured * found.cost.cost(division)
        });
        let gain = products[0] / products[1];
        println!("{name}: {:?}, {:?}; a gain of {:.2} expected, {gain:.2} found", found.variance, found.of_parts, found.gain());
        assert!(found.gain() >= 1.0 && gain >= 0.9, "{name}: {products:?}");
    }
}

/// Mirrors and glass show each path something else, and what is set stays.
#[test]
fn what_is_set_stays_and_the_rest_is_chosen_alike_each_time() {
    let Some(gpu) = device() else { return };
    let subject = Subject::new("cornell-spheres");
    let found = subject.chosen(&gpu, &few(), ALL).unwrap();
    assert!(found.chosen.samples >= 4 && found.gain() > 2.0, "{found:?}");
    let again = subject.chosen(&gpu, &SceneSettings { seed: 77, ..few() }, ALL).unwrap();
    assert_eq!((found.chosen, found.variance), (again.chosen, again.variance));
    let of_rays = subject.chosen(&gpu, &few(), Free { samples: false, shadow_rays: true }).unwrap();
    assert_eq!(of_rays.chosen.samples, 1);
    let of_samples = subject.chosen(&gpu, &few(), Free { samples: true, shadow_rays: false }).unwrap();
    assert_eq!(of_samples.chosen.shadow_rays, 4);
    assert_eq!(subject.chosen(&gpu, &few(), Free::default()), None);
    // A large error needs few rounds, and little time leaves few.
    let goal = |error, seconds| SceneSettings { stop: Stop { error, seconds, ..Stop::default() }, ..few() };
    let coarse = subject.chosen(&gpu, &goal(Some(0.3), None), ALL).unwrap();
    assert!(coarse.chosen.samples < found.chosen.samples && coarse.until(0.3).0 >= 16.0, "{coarse:?}");
    let short = subject.chosen(&gpu, &goal(None, Some(1e-3)), ALL).unwrap();
    assert_eq!(short.chosen.samples, 1, "{short:?}");
}

/// The program takes what a pilot finds where an error ends the run and nothing is set, and goes on with it.
#[test]
fn the_program_has_a_pilot_where_an_error_ends_the_run() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let line = "render cornell-spheres --size 16x16 --photons 2000 --caustic-photons 2000";
    let (_, stderr) = place.succeed(&format!("{line} --error 20% -o a.exr --json a.json --checkpoint a.pms"));
    let settings = place.json("a.json")["settings"].clone();
    let [samples, shadow_rays] = ["samples", "shadow_rays"].map(|name| settings[name].as_u64().unwrap());
    assert!(samples > 1 && stderr.contains(&format!("pilot: {samples} paths per pixel and {shadow_rays} shadow ray")), "{stderr}");
    // By hand it is the same run.
    place.succeed(&format!("{line} --error 20% -o b.exr --samples {samples} --shadow-rays {shadow_rays} -q"));
    assert!(std::fs::read(place.at("a.exr")).unwrap() == std::fs::read(place.at("b.exr")).unwrap());
    // And it goes on without a pilot.
    let (_, stderr) = place.succeed(&format!("{line} --error 19% -o c.exr --json c.json --resume a.pms"));
    assert!(!stderr.contains("pilot: ") && place.json("c.json")["settings"]["samples"] == settings["samples"], "{stderr}");
    let (_, stderr) = place.succeed(&format!("{line} --rounds 4 -o d.exr"));
    assert!(!stderr.contains("pilot: "), "{stderr}");
}
