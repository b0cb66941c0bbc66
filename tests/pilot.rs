//! A pilot's choice: what it expects of a round is what rounds are like, and it chooses the same twice.

use crate::common::prelude::*;
use photonmill::engine::scene::pilot::{self, Pilot};
use photonmill::engine::scene::{View, light, trial};
use photonmill::plan::work_division::{Division, Free};
use photonmill::settings::stop::Stop;

const SIZE: u32 = 32;
const ALL: Free = Free { samples: true, shadow_rays: true, photons: true, caustic_photons: true, neighbours: true };
const NONE: Free = Free { samples: false, shadow_rays: false, photons: false, caustic_photons: false, neighbours: false };

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
        let found = subject.chosen(&gpu, &few(), Free { photons: false, caustic_photons: false, ..ALL }).unwrap();
        for division in [found.before, found.chosen] {
            let measured = subject.variance(&gpu, &division.set(&few()));
            let variance = &found.rounds.variance;
            let of_paths = (variance.path + variance.shadow_ray / f64::from(division.shadow_rays)) / f64::from(division.samples);
            let of_maps = variance.global.of_first_round(division.photons, division.neighbours)
                + variance.caustic.of_first_round(division.caustic_photons, division.neighbours);
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
    let goal = |error, seconds| SceneSettings { stop: Stop { error, seconds, ..Stop::default() }, ..few() };
    let fine = goal(Some(0.01), None);
    let found = subject.chosen(&gpu, &fine, ALL).unwrap();
    assert!(found.chosen.samples >= 4 && found.gain(&fine.stop) > 1.5, "{}: {found:?}", found.gain(&fine.stop));
    let again = subject.chosen(&gpu, &SceneSettings { seed: 77, ..fine.clone() }, ALL).unwrap();
    assert_eq!((found.chosen, found.rounds), (again.chosen, again.rounds));
    let of_rays = subject.chosen(&gpu, &fine, Free { shadow_rays: true, ..NONE }).unwrap();
    assert_eq!(of_rays.chosen, Division { shadow_rays: of_rays.chosen.shadow_rays, ..of_rays.before });
    let three = SceneSettings { shadow_rays: 3, ..fine.clone() };
    let of_others = subject.chosen(&gpu, &three, Free { shadow_rays: false, ..ALL }).unwrap();
    assert!(of_others.chosen.shadow_rays == 3 && of_others.chosen.samples >= 4, "{of_others:?}");
    assert_eq!(subject.chosen(&gpu, &fine, NONE), None);
    // A small error takes more of it.
    let coarse = subject.chosen(&gpu, &goal(Some(0.3), None), ALL).unwrap();
    let [rough, good] = [(&coarse, 0.3), (&found, 0.01)].map(|(pilot, error)| pilot.rounds.until(pilot.chosen, error));
    assert!(rough.0 >= 16.0 && rough.1 < 0.1 * good.1, "{rough:?} {good:?}");
    let short = subject.chosen(&gpu, &goal(None, Some(1e-3)), ALL).unwrap();
    assert!(short.chosen.samples <= 4 && short.rounds.cost(short.chosen) < short.rounds.cost(short.before), "{short:?}");
}

/// The program takes what a pilot finds where an error ends the run and nothing is set, and goes on with it.
#[test]
fn the_program_has_a_pilot_where_an_error_ends_the_run() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let line = "render cornell-spheres --size 16x16";
    let (_, stderr) = place.succeed(&format!("{line} --error 20% -o a.exr --json a.json --checkpoint a.pms"));
    let settings = place.json("a.json")["settings"].clone();
    let names = ["samples", "shadow_rays", "photons", "caustic_photons", "neighbours"];
    let values = names.map(|name| settings[name].as_u64().unwrap());
    assert!(values[2] < 131_072 && stderr.contains(&format!("pilot: {} path", values[0])), "{stderr}");
    // By hand it is the same run.
    let [samples, shadow_rays, photons, caustic_photons, neighbours] = values;
    place.succeed(&format!(
        "{line} --error 20% -o b.exr --samples {samples} --shadow-rays {shadow_rays} --photons {photons} --caustic-photons {caustic_photons} --neighbours {neighbours} -q"
    ));
    assert!(std::fs::read(place.at("a.exr")).unwrap() == std::fs::read(place.at("b.exr")).unwrap());
    // And it goes on without a pilot.
    let (_, stderr) = place.succeed(&format!("{line} --error 19% -o c.exr --json c.json --resume a.pms"));
    assert!(!stderr.contains("pilot: ") && names.iter().all(|name| place.json("c.json")["settings"][name] == settings[name]), "{stderr}");
    let (_, stderr) = place.succeed(&format!("{line} --rounds 4 --photons 2000 -o d.exr"));
    assert!(!stderr.contains("pilot: "), "{stderr}");
}
