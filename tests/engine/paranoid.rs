//! `--paranoid` and `--replay`: no run has a value that is infinite or no number; one that is planted is counted and
//! its photon named; and that photon takes the same path alone as among all others.

use crate::common::nothing_odd;
use crate::common::prelude::*;
use crate::common::rendered::Viewed;
use photonmill::engine::nonfinite_values::{NonfiniteValues, What};
use photonmill::engine::replay::PhotonName;
use photonmill::engine::room;
use photonmill::engine::scene::RunResult;
use photonmill::engine::scene::replay::replay;

fn paranoid() -> SceneSettings {
    SceneSettings { photons: 3000, caustic_photons: 3000, rounds: 2, paranoid: true, ..by_rounds() }
}

fn result_of(gpu: &Gpu, viewed: &Viewed, settings: &SceneSettings) -> RunResult {
    viewed.run(gpu, viewed.planned(gpu, settings, square_picture(24)))
}

/// No value of a scene with mirrors and glass is infinite or no number, by either way of lighting it.
pub fn scene_is_finite(gpu: &Gpu, settings: &SceneSettings) -> Check<Complaint> {
    let spheres = Viewed::new(scene("cornell-spheres"));
    BOTH.into_iter().try_for_each(|illumination| {
        let settings = SceneSettings { illumination, paranoid: true, ..settings.clone() };
        nothing_odd(result_of(gpu, &spheres, &settings).nonfinite_values.as_ref().unwrap())
    })
}

/// Nor is one of the paper's box.
pub fn box_is_finite(gpu: &Gpu, settings: &RoomSettings) -> Check<Complaint> {
    room_result_of(gpu, &open_box(settings), &RoomSettings { paranoid: true, ..settings.clone() }).map(|_| ())
}

/// By either way of lighting; in the short run mirrors and glass, and a sky. (Of the paper's box every run of `tests/common` is looked at.)
/// Looking changes nothing, which is shown of some.
#[test]
fn no_built_in_scene_has_a_value_that_is_no_number() {
    let Some(gpu) = device() else { return };
    let few = [("cornell-spheres", Illumination::Split), ("sky-over-plane", Illumination::Photons)];
    let all = built_in::names().into_iter().flat_map(|name| BOTH.map(|illumination| (name, illumination)));
    let split = ["sky-over-plane", "mirror-corridor"].map(|name| (name, Illumination::Split));
    let from_photons = ["sky-over-plane", "cornell-spheres", "disc-over-plane"].map(|name| (name, Illumination::Photons));
    for case in of_run(few.to_vec(), all.collect()) {
        let (name, illumination) = case;
        let viewed = Viewed::new(scene(name));
        let settings = SceneSettings { illumination, final_gather: illumination == Illumination::Split, photons: 1000, ..paranoid() };
        let watched = result_of(&gpu, &viewed, &settings);
        assert_holds(format!("{case:?}"), nothing_odd(watched.nonfinite_values.as_ref().unwrap()));
        assert_eq!(watched.nonfinite_values, Some(NonfiniteValues::default()));
        if split.contains(&case) || from_photons.contains(&case) {
            let unwatched = result_of(&gpu, &viewed, &SceneSettings { paranoid: false, ..settings });
            assert_eq!(unwatched.nonfinite_values, None);
            assert_eq!(unwatched.film, watched.film, "{case:?}");
        }
    }
}

/// The mirror reflects no number: the photons that are named are those that meet it.
#[test]
fn a_planted_value_is_counted_and_its_photon_named() {
    let Some(gpu) = device() else { return };
    let mut spheres = Viewed::new(scene("cornell-spheres"));
    let mirror = spheres.scene.materials.iter().position(|material| material.name == "mirror").unwrap();
    for poison in [f32::NAN, f32::INFINITY] {
        spheres.geometry.materials[mirror].base_colour = Vec3::new(1.0, poison, 1.0);
        let settings = SceneSettings { rounds: 1, photons: 400, caustic_photons: 50, ..paranoid() };
        let plan = spheres.planned(&gpu, &settings, square_picture(24));
        let nonfinite_values = spheres.run(&gpu, plan.clone()).nonfinite_values.unwrap();
        assert!(nonfinite_values.count > 10, "{nonfinite_values:?}");
        assert!(nonfinite_values.text().contains("`replay` 0:"), "{}", nonfinite_values.text());
        let of_photons = nonfinite_values.first.iter().filter(|value| value.what == What::Photon);
        let named: BTreeSet<u32> = of_photons.map(|value| value.item).collect();
        // All of them were written down, so that those not named have nothing odd.
        assert!(named.len() < 60 && !named.is_empty(), "{nonfinite_values:?}");
        for photon in named.iter().copied().take(6).chain((0..400).filter(|photon| !named.contains(photon)).take(6)) {
            let path = replay(&gpu, &spheres.geometry, &plan, PhotonName { round: 0, photon, caustic: false }).unwrap();
            assert_eq!(path.nonfinite_values.unwrap().count > 0, named.contains(&photon), "photon {photon}: {:?}", path.vertices);
        }
    }
}

/// Where a photon of round 0 is stored when it is traced alone.
fn alone(gpu: Option<&Gpu>, settings: &RoomSettings, photon: u32) -> Vec<Photon> {
    let name = PhotonName { round: 0, photon, caustic: false };
    room::replay(gpu, &open_box(settings), settings, name).unwrap().vertices
}

/// Every builder's map holds of a photon what it stores when it is traced alone.
#[test]
fn a_photon_alone_takes_the_path_that_it_takes_among_others() {
    let Some(gpu) = device() else { return };
    for settings in [RoomSettings::default(), RoomSettings { photons: 20_001, rng: Rng::Philox, ..RoomSettings::default() }] {
        for builder in Builder::ON_GPU {
            let settings = RoomSettings { builder, ..settings.clone() };
            let all = in_order(photons(&gpu, &settings));
            let most = all.iter().max_by_key(|photon| photon.bounce).unwrap().photon;
            for photon in [0, 1, most, settings.photons / 2, settings.photons - 1] {
                let expected: Vec<_> = all.iter().copied().filter(|stored| stored.photon == photon).collect();
                let found = in_order(alone(Some(&gpu), &settings, photon));
                assert_eq!(found, expected, "{builder:?}, photon {photon}");
            }
        }
        let all = in_order(photons_on_cpu(&settings));
        let most = all.iter().max_by_key(|photon| photon.bounce).unwrap().photon;
        let expected: Vec<_> = all.into_iter().filter(|stored| stored.photon == most).collect();
        assert!(expected.len() > 5);
        assert_eq!(in_order(alone(None, &settings, most)), expected);
    }
}
