//! Physical units: what the film says in W/m2 against closed forms of the direct light, against the
//! arrivals of the independent f64 model, and against its own photon counts.

use crate::common::prelude::*;
use crate::common::reference::{Arrival, Emission, HALF_EDGE, MESH, Model, texels_in_reach};
use photonmill::engine::room::RunResult;
use photonmill::engine::room::film::{WallEstimate, estimate_walls};
use photonmill::verify::judge::radiosity::{inward, on_wall};

fn walls(outcome: &RunResult) -> Vec<WallEstimate> {
    estimate_walls(&outcome.film, &open_box(&outcome.plan.settings), &outcome.plan)
}

fn irradiance_of(outcome: &RunResult) -> Vec<f64> {
    walls(outcome).into_iter().flat_map(|wall| wall.irradiance).collect()
}

/// Irradiance at a point of a wall from a disc of light of 1 W in the centre of a wall on the negative
/// side: the integral of intensity * cosine / distance^2 over the disc, by the midpoint rule on rings
/// of equal area. The disc lies in its wall, so that wall receives nothing.
fn direct_from(light_wall: usize, emission: EmissionLaw, receiver_wall: usize, point: DVec3, rings: usize, spokes: usize) -> f64 {
    if light_wall == receiver_wall {
        return 0.0;
    }
    let radius = 0.05;
    let mut sum = 0.0;
    for ring in 0..rings {
        let distance = radius * ((ring as f64 + 0.5) / rings as f64).sqrt();
        for spoke in 0..spokes {
            let angle = TAU * (spoke as f64 + 0.5) / spokes as f64;
            let from = on_wall(light_wall, distance * angle.cos(), distance * angle.sin());
            let ray = point - from;
            let intensity = match emission {
                EmissionLaw::Uniform => 1.0 / TAU,
                EmissionLaw::Cosine => ray.dot(inward(light_wall)) / ray.length() / PI,
            };
            let arriving = -ray.dot(inward(receiver_wall)) / ray.length();
            sum += intensity * arriving.max(0.0) / ray.length_squared();
        }
    }
    sum / (rings * spokes) as f64
}

/// Closed forms for the disc of radius 0.05 and 1 W: facing at distance 0.5, perpendicular at distance
/// 0.25 from the axis. (height or offset, cosine, uniform)
const FACING: [(f64, f64, f64); 3] = [
    (0.0, 1.260_633_212_610, 0.631_884_567_764),
    (0.1, 1.167_244_974_084, 0.596_360_272_116),
    (0.25, 0.812_255_482_758, 0.454_159_949_334),
];
const BESIDE: [(f64, f64, f64); 4] = [
    (0.05, 0.974_798_572_075, 2.429_370_980_874),
    (0.125, 1.650_247_370_579, 1.821_680_709_903),
    (0.25, 1.260_256_396_194, 0.890_126_344_414),
    (0.45, 0.503_745_874_056, 0.288_774_709_142),
];

#[test]
fn the_quadrature_gives_the_closed_forms() {
    let laws = |cosine, uniform| [(EmissionLaw::Cosine, cosine), (EmissionLaw::Uniform, uniform)];
    for (offset, cosine, uniform) in FACING {
        for (law, expected) in laws(cosine, uniform) {
            // The floor's disc seen from the ceiling.
            let found = direct_from(2, law, 3, on_wall(3, offset, 0.0), 64, 64);
            assert!((found / expected - 1.0).abs() < 1e-4, "facing, {law:?}, offset {offset}: {found}");
        }
    }
    for (height, cosine, uniform) in BESIDE {
        for (law, expected) in laws(cosine, uniform) {
            // From the right wall, `height` above the floor and in the middle of it.
            let found = direct_from(2, law, 1, on_wall(1, height - HALF_EDGE, 0.0), 64, 64);
            assert!((found / expected - 1.0).abs() < 1e-3, "beside, {law:?}, height {height}: {found}");
        }
    }
}

/// Walls with the numbers of the faces on which the floor's and the left wall's light lie.
const LIGHTS: [usize; 2] = [2, 0];

/// Flux that reaches the part of a disc that lies on its wall, from each light of 1 W, and the area of
/// that part.
fn direct_on_disc(emission: EmissionLaw, wall: usize, centre: [f64; 2], radius: f64, [rings, spokes]: [u32; 2]) -> ([f64; 2], f64) {
    let cell = PI * radius * radius / f64::from(rings * spokes);
    let (mut flux, mut area) = ([0.0; 2], 0.0);
    for ring in 0..rings {
        let distance = radius * ((f64::from(ring) + 0.5) / f64::from(rings)).sqrt();
        for spoke in 0..spokes {
            let angle = TAU * (f64::from(spoke) + 0.5) / f64::from(spokes);
            let [s, t] = [centre[0] + distance * angle.cos(), centre[1] + distance * angle.sin()];
            if s.abs() > HALF_EDGE || t.abs() > HALF_EDGE {
                continue;
            }
            area += cell;
            for (light, flux) in LIGHTS.into_iter().zip(&mut flux) {
                *flux += cell * direct_from(light, emission, wall, on_wall(wall, s, t), 4, 12);
            }
        }
    }
    (flux, area)
}

/// Mean irradiance over the disc around each texel from both lights, and its standard error for
/// `photons` photons of which each light has half and each hit is stored with the albedo's chance.
fn expected_direct(settings: &RoomSettings) -> Vec<(f64, f64)> {
    let mesh = settings.mesh as usize;
    let albedo = f64::from(settings.reflectance);
    let texel = |i: usize| (i as f64 + 0.5) / mesh as f64 * 2.0 * HALF_EDGE - HALF_EDGE;
    let mut expected = Vec::new();
    for (wall, place) in (0..5).flat_map(|wall| (0..mesh * mesh).map(move |place| (wall, place))) {
        let (flux, area) = direct_on_disc(settings.emission, wall, [texel(place % mesh), texel(place / mesh)], settings.radius, [6, 16]);
        let of_light = f64::from(settings.photons) / 2.0;
        // Each photon of a light is stored in the disc with the probability albedo * flux.
        let variance: f64 = flux.iter().map(|flux| of_light * albedo * flux * (1.0 - albedo * flux)).sum();
        expected.push((flux.iter().sum::<f64>() / area, variance.sqrt() / of_light / albedo / area));
    }
    expected
}

/// Each texel, and all of them together, against the expected irradiance. Discs must not overlap, so
/// that the texels' errors are as good as independent.
fn direct_check(irradiance: &[f64], expected: &[(f64, f64)]) -> Check {
    let (mean, variance) = expected.iter().fold((0.0, 0.0), |(sum, variance), (mean, error)| (sum + mean, variance + error * error));
    z_check("all texels", irradiance.iter().sum(), mean, variance.sqrt())?;
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
        let outcome = run(&gpu, &settings);
        let irradiance = irradiance_of(&outcome);
        let expected = expected_direct(&settings);
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
    let mean = |settings: &RoomSettings| {
        let irradiance = irradiance_of(&run(&gpu, settings));
        irradiance.iter().sum::<f64>() / irradiance.len() as f64
    };
    let expected = expected_direct(&settings);
    let one_watt = expected.iter().map(|(mean, _)| mean).sum::<f64>() / expected.len() as f64;
    let error = expected.iter().map(|(_, error)| error * error).sum::<f64>().sqrt() / expected.len() as f64;
    assert_holds("one round", z_check("mean irradiance", mean(&settings), one_watt, error));
    let bright = RoomSettings { light_power: [10.0, 10.0], ..settings.clone() };
    assert_holds("ten watts", z_check("mean irradiance", mean(&bright), 10.0 * one_watt, 10.0 * error));
    for rounds in [2, 5] {
        let rounds = RoomSettings { rounds, photons: 400_000 / rounds, ..settings.clone() };
        assert_holds(format!("{} rounds", rounds.rounds), z_check("mean irradiance", mean(&rounds), one_watt, error));
    }
    // By symmetry of the two lights, whose walls are mirror images, the watts of one may move to the other.
    let uneven = RoomSettings { light_power: [1.9, 0.1], ..settings };
    assert_holds("uneven lights", z_check("mean irradiance", mean(&uneven), one_watt, 2.0 * error));
}

/// Irradiance over the blocks of a wall: 3 x 3 blocks of texels that the radius does not lead off the
/// wall, so that no edge correction is needed.
struct Blocks {
    radius: f64,
}

const BLOCKS: usize = 5 * 3 * 3;

impl Blocks {
    /// Block of a texel in the table of all walls, if it is an inner one.
    fn of(&self, texel: usize) -> Option<usize> {
        let margin = (self.radius / (2.0 * HALF_EDGE) * MESH as f64).ceil() as usize;
        let (wall, row, column) = (texel / (MESH * MESH), texel / MESH % MESH, texel % MESH);
        let inner = margin..MESH - margin;
        if !inner.contains(&row) || !inner.contains(&column) {
            return None;
        }
        let third = |i: usize| (i - margin) * 3 / inner.len();
        Some((wall * 3 + third(row)) * 3 + third(column))
    }

    /// Mean over each block of a value a texel.
    fn means(&self, values: &[f64]) -> Vec<f64> {
        let (mut sums, mut counts) = (vec![0.0; BLOCKS], vec![0.0; BLOCKS]);
        for (texel, value) in values.iter().enumerate() {
            if let Some(block) = self.of(texel) {
                sums[block] += value;
                counts[block] += 1.0;
            }
        }
        sums.iter().zip(counts).map(|(sum, count)| sum / count).collect()
    }

    /// Mean irradiance of each block and its variance, from arrivals that `share` makes watts of; the
    /// variance is that of the photons' own contributions, each a chain of arrivals.
    fn estimate(&self, model: &Model, arrivals: &[Arrival], share: impl Fn(&Arrival) -> f64) -> Vec<(f64, f64)> {
        let mut texels = vec![0.0; BLOCKS];
        (0..5 * MESH * MESH).filter_map(|texel| self.of(texel)).for_each(|block| texels[block] += 1.0);
        let area = PI * self.radius * self.radius;
        let mut by_photon: Vec<&Arrival> = arrivals.iter().collect();
        by_photon.sort_by_key(|arrival| arrival.photon);
        let (mut sums, mut squares) = (vec![0.0; BLOCKS], vec![0.0; BLOCKS]);
        for chain in by_photon.chunk_by(|a, b| a.photon == b.photon) {
            let mut contribution = vec![0.0; BLOCKS];
            for arrival in chain {
                for block in texels_in_reach(arrival, self.radius).filter_map(|texel| self.of(texel)) {
                    contribution[block] += share(arrival) * 2.0 / area / texels[block];
                }
            }
            for block in 0..BLOCKS {
                sums[block] += contribution[block];
                squares[block] += contribution[block] * contribution[block];
            }
        }
        let n = model.photons as f64;
        sums.iter().zip(squares).map(|(sum, square)| (sum / n, (square / n - (sum / n) * (sum / n)) / n)).collect()
    }
}

/// What is stored is what is reflected: photonmill's irradiance, from stored photons over the albedo,
/// against every photon that arrives in the f64 model, the absorbed ones too, of another sequence.
#[test]
fn stored_photons_over_albedo_are_the_arriving_ones() {
    let settings = RoomSettings { photons: 120_001, rng: Rng::Philox, seed: 7, threads: 2, ..RoomSettings::default() };
    let outcome = match device() {
        Some(gpu) => run(&gpu, &settings),
        None => run_on_cpu(&settings),
    };
    let irradiance = irradiance_of(&outcome);
    let blocks = Blocks { radius: settings.radius };
    let found = blocks.means(&irradiance);

    let model = Model { photons: 60_001, seed: 3, emission: Emission::Uniform, ..Model::default() };
    let arrivals = model.trace(0);
    let arriving = blocks.estimate(&model, &arrivals, |_| 1.0);
    // The same chain of photons as photonmill sees it, for the variance of its side.
    let reflected = blocks.estimate(&model, &arrivals, |arrival| if arrival.stored { 1.0 / model.reflectance } else { 0.0 });
    let fewer = model.photons as f64 / f64::from(settings.photons);
    let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / BLOCKS as f64;
    let (mean_found, mean_expected) = (mean(&mut found.iter().copied()), mean(&mut arriving.iter().map(|(mean, _)| *mean)));
    let check = |gain: f64| -> Check {
        // All blocks together tell a percent or two, as errors of neighbours are not independent.
        require((gain * mean_found / mean_expected - 1.0).abs() <= 0.015, || {
            format!("{} W/m2 over all blocks where {mean_expected} arrive", gain * mean_found)
        })?;
        (0..BLOCKS).try_for_each(|block| {
            let (expected, variance) = arriving[block];
            let error = (variance + fewer * reflected[block].1).sqrt();
            z_check(&format!("block {block}"), gain * found[block], expected, error)
        })
    };
    assert_holds("irradiance", check(1.0));
    assert_complains("reflected flux in place of arriving flux", check(0.75));
    assert_complains("a gain of 3 %", check(1.03));
}

/// Watts that all walls reflect: the radiosity over the walls' area is the flux of the stored photons.
/// What a texel sees is a mean over its disc, so edges shift a little of it: bounded by half a percent
/// at this radius.
#[test]
fn reflected_flux_is_that_of_the_stored_photons() {
    let settings = RoomSettings { photons: 50_001, rng: Rng::Philox, radius: 0.015, threads: 2, ..RoomSettings::default() };
    let reflected = |settings: &RoomSettings| {
        let outcome = run_on_cpu(settings);
        let texel_area = (2.0 * HALF_EDGE / f64::from(settings.mesh)).powi(2);
        let walls = walls(&outcome);
        for (radiosity, irradiance) in walls.iter().flat_map(|wall| pairs(&wall.radiosity, &wall.irradiance)) {
            let expected = f64::from(settings.reflectance) * irradiance;
            assert!((radiosity - expected).abs() <= 1e-12 * expected, "{radiosity} and {irradiance}");
        }
        let watts = walls.iter().flat_map(|wall| &wall.radiosity).sum::<f64>() * texel_area;
        let stored = outcome.ledger().stored as f64;
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
    let corrected = RoomSettings { bounces: 1, photons: 200_000, rng: Rng::Philox, ..RoomSettings::default() };
    let uncorrected = RoomSettings { edge_correction: false, ..corrected.clone() };
    let (with, without) = (walls(&run(&gpu, &corrected)), walls(&run(&gpu, &uncorrected)));
    let radius = corrected.radius;
    let half_texel = HALF_EDGE / 64.0;
    // (column, row): an edge, the corner, the middle.
    for (place, column, row) in [("edge", 0, 32), ("edge", 20, 63), ("corner", 0, 0), ("corner", 63, 0), ("middle", 32, 32)] {
        for wall in [1, 3, 4] {
            let texel = row * 64 + column;
            let centre = [column, row].map(|i| (i as f64 + 0.5) / 64.0 * 2.0 * HALF_EDGE - HALF_EDGE);
            // Fine enough for discs that an edge cuts.
            let (flux, _) = direct_on_disc(EmissionLaw::Uniform, wall, centre, radius, [40, 160]);
            let t = half_texel / radius;
            let edge_share = 1.0 - (t.acos() - t * (1.0 - t * t).sqrt()) / PI;
            // In a corner the parts beyond both edges overlap: shares F + F - 1 plus what was cut twice.
            let share = match place {
                "edge" => edge_share,
                "corner" => corner_share(t),
                _ => 1.0,
            };
            let area = share * PI * radius * radius;
            let per_light = 0.5 * f64::from(corrected.photons);
            let variance: f64 = flux.iter().map(|flux| per_light * 0.75 * flux * (1.0 - 0.75 * flux)).sum();
            let (mean, error) = (flux.iter().sum::<f64>() / area, variance.sqrt() / per_light / 0.75 / area);
            let what = format!("{place} of wall {wall}");
            // The raster of the flux is good to a part in 250.
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

/// Share of a disc in a corner whose edges are both t radii away, t small: a quarter, two strips and a
/// square of t.
fn corner_share(t: f64) -> f64 {
    let strip = t * (1.0 - t * t).sqrt() + t.asin();
    0.25 + strip / PI + t * t / PI
}
