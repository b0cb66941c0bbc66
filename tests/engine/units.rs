//! Physical units: what the film says in W/m2 against closed forms of the direct light and against its own photon counts. All light is
//! that of radiosity (`tests/light/radiosity.rs`).

use crate::common::prelude::*;
use crate::common::reference::HALF_EDGE;
use photonmill::engine::room::RunResult;
use photonmill::engine::room::film::{WallEstimate, estimate_walls};
use photonmill::verify::judge::radiosity::{Law, Radiosity, on_wall};

fn walls(result: &RunResult) -> Vec<WallEstimate> {
    estimate_walls(&result.film, &open_box(&result.plan.settings), &result.plan)
}

fn irradiance_of(result: &RunResult) -> Vec<f64> {
    walls(result).into_iter().flat_map(|wall| wall.irradiance).collect()
}

/// The direct light of a law of emission, by quadrature over the lamps.
fn judge(emission: EmissionLaw) -> Radiosity {
    let law = if emission == EmissionLaw::Uniform { Law::Uniform } else { Law::Cosine };
    Radiosity { n: 0, law, albedo: 0.0, orders: Vec::new() }
}

/// Closed forms for a disc of radius 0.05 and 1 W: perpendicular at distance 0.25 from the axis, at a height over the disc.
/// (height, cosine, uniform)
const BESIDE: [(f64, f64, f64); 4] = [
    (0.05, 0.974_798_572_075, 2.429_370_980_874),
    (0.125, 1.650_247_370_579, 1.821_680_709_903),
    (0.25, 1.260_256_396_194, 0.890_126_344_414),
    (0.45, 0.503_745_874_056, 0.288_774_709_142),
];
/// The same of a point that faces the disc at distance 0.5, on its axis.
const FACING: (f64, f64) = (1.260_633_212_610, 0.631_884_567_764);

/// The left wall sees the floor's disc alone; the middle of the ceiling that of the floor and, as high over it, that of the left wall.
#[test]
fn the_quadrature_gives_the_closed_forms() {
    let left = BESIDE.map(|(height, cosine, uniform)| (0, height - HALF_EDGE, cosine, uniform));
    let ceiling = (3, 0.0, FACING.0 + BESIDE[2].1, FACING.1 + BESIDE[2].2);
    for (wall, s, cosine, uniform) in left.into_iter().chain([ceiling]) {
        for (emission, expected) in [(EmissionLaw::Cosine, cosine), (EmissionLaw::Uniform, uniform)] {
            let found = judge(emission).direct_at(wall, on_wall(wall, s, 0.0));
            assert_holds(format!("wall {wall}, {s}, {emission:?}"), relative_check("irradiance", found, expected, 1e-8));
        }
    }
}

/// Mean irradiance over the part of a disc that lies on its wall, from both lights of 1 W, and its standard error for so many photons,
/// of which each light has half and each hit is stored with the albedo's chance.
fn expected_on_disc(settings: &RoomSettings, wall: usize, centre: [f64; 2], [rings, spokes]: [u32; 2]) -> (f64, f64) {
    let (judge, radius) = (judge(settings.emission), settings.radius);
    let (mut sum, mut count) = (0.0, 0.0);
    for (ring, spoke) in (0..rings).flat_map(|ring| (0..spokes).map(move |spoke| (ring, spoke))) {
        let distance = radius * ((f64::from(ring) + 0.5) / f64::from(rings)).sqrt();
        let angle = TAU * (f64::from(spoke) + 0.5) / f64::from(spokes);
        let [s, t] = [centre[0] + distance * angle.cos(), centre[1] + distance * angle.sin()];
        if s.abs() <= HALF_EDGE && t.abs() <= HALF_EDGE {
            sum += judge.direct_at(wall, on_wall(wall, s, t));
            count += 1.0;
        }
    }
    let (irradiance, area) = (sum / count, PI * radius * radius * count / f64::from(rings * spokes));
    // A photon is stored in the disc with the probability albedo * flux, of each light about half of that.
    let (of_light, stored) = (0.5 * settings.total_photons() as f64, f64::from(settings.reflectance) * irradiance * area);
    (irradiance, irradiance * (of_light * stored * (1.0 - 0.5 * stored)).sqrt() / (of_light * stored))
}

/// The same around each texel.
fn expected_direct(settings: &RoomSettings) -> Vec<(f64, f64)> {
    let mesh = settings.mesh as usize;
    let texel = |i: usize| (i as f64 + 0.5) / mesh as f64 * 2.0 * HALF_EDGE - HALF_EDGE;
    let places = (0..5).flat_map(|wall| (0..mesh * mesh).map(move |place| (wall, place)));
    places.map(|(wall, place)| expected_on_disc(settings, wall, [texel(place % mesh), texel(place / mesh)], [6, 16])).collect()
}

/// All texels together against the expected irradiance, with so many times its standard error. Discs must not overlap, so
/// that the texels' errors are as good as independent.
fn sum_check(irradiance: &[f64], expected: &[(f64, f64)], times: f64) -> Check {
    let (mean, variance) = expected.iter().fold((0.0, 0.0), |(sum, variance), (mean, error)| (sum + mean, variance + error * error));
    z_check("all texels", irradiance.iter().sum(), mean, times * variance.sqrt())
}

/// And each texel.
fn direct_check(irradiance: &[f64], expected: &[(f64, f64)]) -> Check {
    sum_check(irradiance, expected, 1.0)?;
    for (texel, (found, (mean, error))) in pairs(irradiance, expected).enumerate() {
        z_check(&format!("texel {texel}"), *found, *mean, *error)?;
    }
    Ok(())
}

/// Direct light alone, in discs that do not overlap and lie on their walls: so many photons find a gain of 1 % with 6 standard errors.
fn direct_settings(emission: EmissionLaw) -> RoomSettings {
    RoomSettings { emission, bounces: 1, photons: 1_000_000, rng: Rng::Philox, mesh: 16, radius: 0.015, ..RoomSettings::default() }
}

#[test]
fn direct_light_is_the_closed_form() {
    let Some(gpu) = device() else { return };
    for emission in [EmissionLaw::Uniform, EmissionLaw::Cosine] {
        let settings = direct_settings(emission);
        let (irradiance, expected) = (irradiance_of(&run(&gpu, &settings)), expected_direct(&settings));
        assert_holds(format!("{emission:?}"), direct_check(&irradiance, &expected));

        let gained: Vec<f64> = irradiance.iter().map(|value| value * 1.01).collect();
        assert_complains("a gain of 1 %", direct_check(&gained, &expected));
        // A gather that looks 1 % too far, divided by the area it should have looked at.
        let wider = RoomSettings { radius: 1.01 * settings.radius, edge_correction: false, ..settings.clone() };
        let wider: Vec<f64> = irradiance_of(&run(&gpu, &wider)).iter().map(|value| value * 1.01 * 1.01).collect();
        assert_complains("a radius 1 % too large", direct_check(&wider, &expected));
        let other = if emission == EmissionLaw::Uniform { EmissionLaw::Cosine } else { EmissionLaw::Uniform };
        let by_other = expected_direct(&RoomSettings { emission: other, ..settings });
        assert_complains("the other law of emission", direct_check(&irradiance, &by_other));
    }
}

/// Watts and rounds: flux scales with the lights' power, and more photons or rounds make an estimate
/// smoother and not brighter.
#[test]
fn power_and_rounds_scale_as_watts_do() {
    let Some(gpu) = device() else { return };
    let settings = RoomSettings { photons: 400_000, ..direct_settings(EmissionLaw::Uniform) };
    let expected = expected_direct(&settings);
    let of_one_watt = |light_power: [f64; 2], rounds: u32| -> Vec<f64> {
        let result = run(&gpu, &RoomSettings { light_power, rounds, photons: 400_000 / rounds, ..settings.clone() });
        irradiance_of(&result).iter().map(|irradiance| irradiance / (0.5 * light_power.iter().sum::<f64>())).collect()
    };
    assert_holds("ten watts in two rounds", direct_check(&of_one_watt([10.0, 10.0], 2), &expected));
    // By symmetry of the two lights, whose walls are mirror images, the watts of one may move to the other.
    assert_holds("uneven lights in five rounds", sum_check(&of_one_watt([1.9, 0.1], 5), &expected, 2.0));
}

/// Watts that all walls reflect: the radiosity over the walls' area is the flux of the stored photons.
/// What a texel sees is a mean over its disc, so edges shift a little of it: bounded by half a percent
/// at this radius.
#[test]
fn reflected_flux_is_that_of_the_stored_photons() {
    let settings = RoomSettings { photons: 50_001, rng: Rng::Philox, radius: 0.015, threads: 2, ..RoomSettings::default() };
    let reflected = |settings: &RoomSettings| {
        let result = run_on_cpu(settings);
        let texel_area = (2.0 * HALF_EDGE / f64::from(settings.mesh)).powi(2);
        let walls = walls(&result);
        for (radiosity, irradiance) in walls.iter().flat_map(|wall| pairs(&wall.radiosity, &wall.irradiance)) {
            let expected = f64::from(settings.reflectance) * irradiance;
            assert!((radiosity - expected).abs() <= 1e-12 * expected, "{radiosity} and {irradiance}");
        }
        let watts = walls.iter().flat_map(|wall| &wall.radiosity).sum::<f64>() * texel_area;
        let stored = result.ledger().stored as f64;
        (watts, stored * settings.light_power.iter().sum::<f64>() / settings.total_photons() as f64)
    };
    for settings in [
        settings.clone(),
        RoomSettings { light_power: [7.0, 7.0], ..settings.clone() },
        RoomSettings { photons: 12_501, rounds: 4, ..settings.clone() },
        RoomSettings { reflectance: 0.25, ..settings.clone() },
        RoomSettings { shininess: [Some(5.0); 5], ..settings },
    ] {
        let (film, photons) = reflected(&settings);
        assert!((film / photons - 1.0).abs() < 0.005, "{film} W in the film, {photons} W stored, {} rounds", settings.rounds);
    }
}

/// At an edge half of the disc lies off the wall: divided by the covered area the estimate is within
/// noise of what arrives there, divided by the whole disc it is dark by the covered share.
#[test]
fn edge_correction_divides_by_what_lies_on_the_wall() {
    let Some(gpu) = device() else { return };
    let settings = RoomSettings { bounces: 1, photons: 200_000, rng: Rng::Philox, ..RoomSettings::default() };
    let [with, without] = [true, false].map(|edge_correction| walls(&run(&gpu, &RoomSettings { edge_correction, ..settings.clone() })));
    // Half a texel, in radii.
    let t = HALF_EDGE / 64.0 / settings.radius;
    // (column, row): an edge, the corner, the middle.
    for (place, column, row) in [("edge", 0, 32), ("edge", 20, 63), ("corner", 0, 0), ("corner", 63, 0), ("middle", 32, 32)] {
        for wall in [1, 3, 4] {
            let texel = row * 64 + column;
            let centre = [column, row].map(|i| (i as f64 + 0.5) / 64.0 * 2.0 * HALF_EDGE - HALF_EDGE);
            // Fine enough for discs that an edge cuts.
            let (mean, error) = expected_on_disc(&settings, wall, centre, [40, 160]);
            // In a corner lie a quarter, two strips and a square of t.
            let share = match place {
                "edge" => 1.0 - (t.acos() - t * (1.0 - t * t).sqrt()) / PI,
                "corner" => 0.25 + (t * (1.0 - t * t).sqrt() + t.asin() + t * t) / PI,
                _ => 1.0,
            };
            let what = format!("{place} of wall {wall}");
            // The raster of the disc is good to a part in 250.
            assert_holds(&what, z_check(&what, with[wall].irradiance[texel], mean, error + 0.004 * mean));
            let ratio = without[wall].irradiance[texel] / with[wall].irradiance[texel];
            assert!((ratio - share).abs() < 1e-9, "{what}: {ratio} where {share} of the disc is on the wall");
            if place == "edge" {
                assert!((0.5..0.6).contains(&ratio), "{ratio}");
                assert_complains("an edge without correction", z_check(&what, without[wall].irradiance[texel], mean, error + 0.004 * mean));
            }
        }
    }
}
