//! Closed forms (`photonmill::selfcheck`) on the device, and those that need a scene of their own.

mod common;

use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;

use common::device;
use glam::{DVec3, Vec3};
use photonmill::scene::closed_forms::NAMES;
use photonmill::scene::light::LightKind;
use photonmill::scene::{Scene, built_in};
use photonmill::selfcheck::measure::{irradiance, radiance};
use photonmill::selfcheck::{self, Estimate, Finding};
use photonmill::settings::EmissionLaw;
use photonmill::settings::transport::TransportSettings;

fn scene(name: &str) -> Scene {
    built_in::by_name(name).unwrap_or_else(|| panic!("there is no scene {name}"))
}

/// Right within the error, and the error small enough for 2 % to be seen.
fn check(finding: &Finding) {
    assert!(finding.passed, "{finding:?}");
    for wrong in [0.98, 1.02] {
        let estimate = Estimate { mean: finding.found, standard_error: finding.standard_error };
        let spoiled = Finding::new(&finding.name, wrong * finding.expected, estimate);
        assert!(!spoiled.passed, "{} times {wrong} is not noticed: {spoiled:?}", finding.name);
    }
}

#[test]
fn every_closed_form_holds() {
    let Some(gpu) = device() else { return };
    let never = AtomicBool::new(false);
    let findings = selfcheck::run(Some(&gpu), &never, |_| {}).unwrap();
    assert_eq!(findings.len(), selfcheck::cases().len());
    findings.iter().for_each(check);
}

#[test]
fn the_cpu_builder_is_checked_without_a_device() {
    let never = AtomicBool::new(false);
    let findings = selfcheck::run(None, &never, |_| {}).unwrap();
    assert_eq!(findings.len(), 2);
    findings.iter().for_each(check);
}

#[test]
fn every_scene_of_a_closed_form_has_a_case() {
    let source = include_str!("../src/selfcheck/closed_forms.rs");
    NAMES.iter().for_each(|name| assert!(source.contains(&format!("\"{name}\"")), "{name}"));
}

fn settings() -> TransportSettings {
    TransportSettings { photons: 1000, rounds: 2, shadow_rays: 32, ..TransportSettings::default() }
}

#[test]
fn two_skies_shine_as_one_of_both_radiances() {
    let Some(gpu) = device() else { return };
    let mut both = scene("sky-over-plane");
    both.lights.push(both.lights[0].clone());
    assert!(matches!(both.lights[0].kind, LightKind::Environment { .. }));
    let plane = irradiance(&gpu, &both, &settings(), &[(DVec3::ZERO, DVec3::Y)]).unwrap();
    check(&Finding::new("the plane under two skies", 2.0 * PI, plane));
    let up = radiance(&gpu, both, &settings(), DVec3::Y, DVec3::Y * 2.0).unwrap();
    check(&Finding::new("two skies seen", 2.0, up));
}

/// One lamp of the paper's box, seen from a point straight before it.
#[test]
fn the_open_box_has_its_direct_light() {
    let Some(gpu) = device() else { return };
    let mut room = scene("open-box");
    // One lamp alone, and walls that scatter nothing.
    room.lights.truncate(1);
    room.materials.iter_mut().for_each(|material| material.base_colour = Vec3::ZERO);
    let LightKind::Disc { centre, normal, radius, power, law } = room.lights[0].kind else { panic!("{:?}", room.lights) };
    let d = 0.5;
    let p = f64::from(power.x);
    let exact = match law {
        EmissionLaw::Cosine => p / (PI * (radius * radius + d * d)),
        // Equal intensity in all directions: the wall's own cosine alone.
        EmissionLaw::Uniform => p / (PI * radius * radius) * (1.0 - d / (d * d + radius * radius).sqrt()),
    };
    let found = irradiance(&gpu, &room, &settings(), &[(centre + d * normal, -normal)]).unwrap();
    check(&Finding::new("opposite the lamp", exact, found));
}
