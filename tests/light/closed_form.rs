//! Closed forms (`photonmill::verify::selfcheck`) on the device, and those of direct light that need a scene of their own.
//! `tests/light/closed_rooms.rs` has light that is scattered to and fro, `tests/light/optics.rs` mirrors and glass,
//! `tests/light/radiosity.rs` the paper's box.

use std::sync::atomic::AtomicBool;

use crate::common::estimate_check;
use crate::common::family::{FALSE_ALARM, normal_p_value};
use crate::common::known::kept;
use crate::common::prelude::*;
use crate::common::rendered::sides;
use photonmill::scene::closed_forms::SCENES;
use photonmill::verify::selfcheck::{self, Estimate, Finding};

/// What is found of one closed form, by its name.
fn finding(gpu: &Gpu, name: &str) -> Result<Finding, Error> {
    let case = selfcheck::cases().into_iter().find(|case| case.name == name).unwrap_or_else(|| panic!("there is no case {name}"));
    Ok(Finding::new(name, case.expected, (case.measure)(Some(gpu))?))
}

pub fn closed_form_check(gpu: &Gpu, name: &str) -> Check<Complaint> {
    let Finding { found, expected, standard_error, .. } = finding(gpu, name)?;
    estimate_check(name, found, expected, standard_error)
}

/// Right within the error, and the error small enough for 1 % to be seen.
fn check(finding: &Finding) {
    assert!(finding.passed, "{finding:?}");
    for wrong in [0.99, 1.01] {
        let estimate = Estimate { mean: finding.found, standard_error: finding.standard_error };
        let spoiled = Finding::new(&finding.name, wrong * finding.expected, estimate);
        assert!(!spoiled.passed, "{} times {wrong} is not noticed: {spoiled:?}", finding.name);
    }
}

/// Of what neither `tests/engine/planted_faults.rs` nor other closed forms of the tests ask for; all in the long run.
#[test]
fn closed_forms_that_nothing_else_asks_for_hold() {
    let Some(gpu) = device() else { return };
    for name in [
        "open box, persistent builder, cosine lights: hits stored per photon",
        "mirror corridor, 6 mirrors: radiance",
        "point light, photons: irradiance",
    ] {
        check(&finding(&gpu, name).unwrap());
    }
    if is_long_run() {
        let never = AtomicBool::new(false);
        let findings = selfcheck::run(Some(&gpu), &never, |_| {}).unwrap();
        assert_eq!(findings.len(), selfcheck::cases().len());
        findings.iter().for_each(check);
    }
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
    let source = include_str!("../../src/verify/selfcheck/closed_forms.rs");
    SCENES.iter().for_each(|(name, _)| assert!(source.contains(&format!("\"{name}\"")), "{name}"));
}

/// The judges, judged: families that complain about what is off and what is no number.
#[test]
fn families_distinguish_chance_from_error() {
    let family = |found: f64, error: f64, count: usize| {
        let mut family = Family::default();
        (0..count).for_each(|k| family.expect(format!("{k}"), if k == 0 { found } else { 1.0 }, 1.0, error));
        family.check()
    };
    // One of a thousand may be further off than one alone.
    assert!(normal_p_value(4.0) < FALSE_ALARM && normal_p_value(4.0) > 1e-6);
    assert_complains("four errors, alone", family(1.04, 0.01, 1));
    assert_holds("four errors, one of a thousand", family(1.04, 0.01, 1000));
    assert_complains("six errors, one of a thousand", family(1.06, 0.01, 1000));
    assert_complains("no number", family(f64::NAN, 0.01, 1));
    assert_complains("an error that is no number", family(1.0, f64::NAN, 1));
    assert_complains("nothing tested", Family::default().check());
}

fn settings() -> SceneSettings {
    // Without aim skies have the kernels of other lights.
    kept(SceneSettings { part: Part::Direct, rounds: 2, shadow_rays: 32, aim: false, ..by_rounds() })
}

#[test]
fn two_skies_emit_as_one_of_both_radiances() {
    let Some(gpu) = device() else { return };
    let mut both = scene("sky-over-plane");
    both.lights.push(both.lights[0].clone());
    assert!(matches!(both.lights[0].kind, LightKind::Environment { .. }));
    // Nothing is random: a sky is sampled by the cosine.
    let (plane, _) = red(&received(&gpu, &both, &settings(), &[(DVec3::ZERO, DVec3::Y)]), 0);
    assert_holds("the plane under two skies", relative_check("irradiance", plane, 2.0 * PI, 1e-4));
    let up = radiances(&gpu, &both, &settings(), DVec3::Y, DVec3::Y * 2.0, 4);
    up.iter().for_each(|seen| assert_holds("two skies seen", relative_check("radiance", *seen, 2.0, 1e-4)));
}

/// A lamp in the middle of the floor of a box as large as the paper's, whose walls scatter nothing.
fn lamp_in_a_black_box(law: EmissionLaw) -> Scene {
    let walls = sides(DVec3::splat(-0.25), DVec3::splat(0.5), true, [0; 6]);
    scene_of(walls, vec![matt(0.0)], vec![disc(DVec3::NEG_Y * 0.25, DVec3::Y, 0.05, law)])
}

/// A disc of radius R = 0.05 m and 1 W, Lambertian or of equal intensity, lights points that face it at 0.5 m and a wall
/// at 0.25 m beside it: by the configuration factor of a disc (Howell's catalogue, B-13 and B-15) over its area, and by
/// its solid angle over 2 pi times its area; both checked by quadrature of 30 digits.
#[test]
fn a_disc_lights_points_and_a_wall_by_either_law() {
    let Some(gpu) = device() else { return };
    let facing = |a: f64| (DVec3::new(a, 0.25, 0.0), DVec3::NEG_Y);
    let beside = |height: f64| (DVec3::new(0.25, height - 0.25, 0.0), DVec3::NEG_X);
    let known = [
        ("facing, on the axis", facing(0.0), 1.260_633_212_610, 0.631_884_567_764),
        ("facing, 0.1 m aside", facing(0.1), 1.167_244_974_084, 0.596_360_272_116),
        ("facing, in the middle of the edge", facing(0.25), 0.812_255_482_758, 0.454_159_949_334),
        ("beside, 0.05 m up", beside(0.05), 0.974_798_572_075, 2.429_370_980_874),
        ("beside, 0.125 m up", beside(0.125), 1.650_247_370_579, 1.821_680_709_903),
        ("beside, 0.25 m up", beside(0.25), 1.260_256_396_194, 0.890_126_344_414),
        ("beside, 0.45 m up", beside(0.45), 0.503_745_874_056, 0.288_774_709_142),
    ];
    // Each point several times over, since each draws random numbers of its own.
    let times = 256;
    let points: Vec<_> = known.iter().flat_map(|(_, point, ..)| vec![*point; times]).collect();
    let mut family = Family::default();
    for law in [EmissionLaw::Cosine, EmissionLaw::Uniform] {
        let settings = SceneSettings { rounds: 8, ..settings() };
        let found = irradiances(&gpu, &lamp_in_a_black_box(law), &settings, &points, 1..2).remove(0);
        for ((what, _, cosine, uniform), found) in pairs(&known, found.chunks(times)) {
            let found: Vec<f64> = found.iter().map(|light| light.x).collect();
            family.expect_mean(format!("{law:?}, {what}"), &found, if law == EmissionLaw::Cosine { *cosine } else { *uniform });
        }
    }
    family.assert_detects_one_per_cent();
}
