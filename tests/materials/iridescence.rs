//! Thin films against closed forms.

use crate::common::layered;
use crate::common::prelude::*;
use photonmill::scene::film;

/// Without thickness, or of the index of air, a film is nothing; a thick one reflects what both of its boundaries do without
/// interference, R = R1 + T1^2 R2 / (1 - R1 R2); a quarter of a wave thick, of the root of the base's index, it reflects
/// little of green, and half a wave thick as much as the base alone.
#[test]
fn films_reflect_as_their_closed_forms_say() {
    let base = DVec3::splat(0.04);
    let at = |ior: f64, thickness: f64, cosine: f64| film::reflectance(base, ior, thickness, cosine);
    let schlick = |f0: f64, cosine: f64| f0 + (1.0 - f0) * (1.0 - cosine).powi(5);
    for cosine in [1.0, 0.7, 0.3, 0.1] {
        for nothing in [at(1.4, 0.0, cosine), at(1.0, 300.0, cosine)] {
            // The observer's white is not quite that of the channels, and beside the normal Schlick's formula reflects without a boundary, too.
            assert!(cosine < 1.0 || (nothing - schlick(0.04, cosine)).abs().max_element() < 0.01, "{nothing} at {cosine}");
        }
        let inside = (1.0 - (1.0 - cosine * cosine) / 1.96).sqrt();
        let (first, second) = (schlick((0.4f64 / 2.4).powi(2), cosine), schlick((0.1f64 / 2.9).powi(2), inside));
        let thick = first + (1.0 - first).powi(2) * second / (1.0 - first * second);
        assert!((at(1.4, 1e5, cosine) - thick).abs().max_element() < 1e-9, "{} for {thick}", at(1.4, 1e5, cosine));
    }
    let root = 1.5f64.sqrt();
    let (quarter, half) = (at(root, 550.0 / 4.0 / root, 1.0), at(root, 550.0 / 2.0 / root, 1.0));
    println!("quarter {quarter}, half {half}");
    assert!(quarter.y < 0.01 && half.y > 0.03, "{quarter} {half}");
}

/// No film reflects more than its bound, and none gains light.
#[test]
fn bounds_hold_for_every_angle() {
    for (ior, nanometres) in [(1.0, 0.0), (1.3, 400.0), (1.33, 1200.0), (2.0, 250.0), (2.4, 5000.0), (100.0, 30.0)] {
        let bound = layered::film(ior, nanometres, &layered::plastic(0.5)).film_bound();
        for k in 1..2000 {
            let cosine = f64::from(k) / 2000.0;
            let found = film::reflectance(DVec3::splat(0.04), ior.into(), nanometres.into(), cosine).max_element();
            let most = bound + (1.0 - bound) * (1.0 - cosine).powi(5);
            assert!(found <= most + 2e-3, "{ior} {nanometres} at {cosine}: {found}, at most {most}");
        }
    }
}
