//! Light from beyond the scene that comes in through a small opening: rays and photons are aimed at it.

use std::sync::Arc;

use crate::common::estimate_check;
use crate::common::prelude::*;
use crate::common::rectangles::{self, Rectangle};
use crate::common::rendered::around_hole;
use crate::tests::engine::unseen_light::room_without_floor;
use crate::tests::light::skies::{a_patch_of_sun_keeps_its_rays, a_sun_that_shines_in_has_as_many_rays_as_without_openings, sky, sunny};
use glam::dvec3;
use photonmill::engine::scene::{Receivers, RunResult};
use photonmill::scene::sky::Sky;

/// Half the edge of the hole, which has 1 % of 80 m2 of walls.
const HALF: f64 = 0.447;

/// A room of 4 x 4 x 3 m that sees a light from beyond the scene through a square hole in its ceiling.
pub fn room_under(albedo: f32, light: LightKind) -> Scene {
    let meshes = [room_without_floor(HALF), vec![level(0.0, [4.0, 4.0], true, 0)]].concat();
    scene_of(meshes, vec![matt(albedo)], vec![light])
}

fn room_under_an_even_sky() -> Scene {
    room_under(0.5, LightKind::Environment { radiance: Vec3::ONE })
}

/// What emits 1 W/m2/sr, as an even sky does in an opening.
fn opening(origin: DVec3, u: DVec3, v: DVec3) -> Rectangle {
    Rectangle { origin, u, v, albedo: DVec3::ZERO, emission: DVec3::ONE, blocks: false }
}

/// Mean of scattered light over the points, by the path tracer with 40 000 samples of each.
const SCATTERED: f64 = 0.0285;

fn points() -> Vec<(DVec3, DVec3)> {
    [-1.5, -0.5, 0.0, 0.5, 1.5].iter().flat_map(|x| [-1.5, 0.0, 1.5].map(|z| (dvec3(*x, 0.0, z), DVec3::Y))).collect()
}

fn result_of(gpu: &Gpu, scene: &Scene, settings: &SceneSettings) -> RunResult {
    render(gpu, scene, settings, Receivers::Points(&points())).unwrap()
}

fn settings(part: Part, aim: bool) -> SceneSettings {
    SceneSettings { photons: 20_000, rounds: 32, part, aim, ..by_rounds() }
}

/// Skies with and without a sun have one set of kernels, over many triangles and few.
pub fn direct(aim: bool) -> SceneSettings {
    SceneSettings { with: vec![Effect::DirectionalLights, Effect::Bvh], ..settings(Part::Direct, aim) }
}

fn indirect(aim: bool) -> SceneSettings {
    settings(Part::Indirect, aim)
}

/// Direct light in black rooms, which need no photons in the trial: through a small window it is what a path tracer finds, and its variance
/// less than a tenth of that of rays that are not aimed. All of it has the same kernels.
#[test]
fn light_through_openings_is_found() {
    let Some(gpu) = device() else { return };
    lights_through_a_window(&gpu, "even", 0.0, sky(4, 2, |_, _| Vec3::ONE), &[Part::Direct]);
    an_open_scene_has_no_openings_and_the_same_bits(&gpu);
    a_patch_of_sun_keeps_its_rays(&gpu, 0.0);
    a_sun_that_shines_in_has_as_many_rays_as_without_openings(&gpu, 0.0);
    if is_long_run() {
        lights_through_a_window(&gpu, "even", 0.5, sky(4, 2, |_, _| Vec3::ONE), &[Part::Direct, Part::Indirect]);
        lights_through_a_window(&gpu, "sunny", 0.5, sunny(32, 300.0), &[Part::Direct, Part::Indirect]);
        a_patch_of_sun_keeps_its_rays(&gpu, 0.5);
        a_sun_that_shines_in_has_as_many_rays_as_without_openings(&gpu, 0.5);
    }
}

fn lights_through_a_window(gpu: &Gpu, sky: &str, albedo: f32, picture: Sky, parts: &[Part]) {
    let scene = room_under(albedo, LightKind::Sky(Arc::new(picture)));
    let judged = Judge::new(&scene, 32).irradiance_at(&points(), 10_000, 1);
    let scattered = judged.iter().map(|point| point.mean.indirect.x).sum::<f64>() / judged.len() as f64;
    assert!(sky == "sunny" || albedo == 0.0 || (scattered / SCATTERED - 1.0).abs() < 0.02, "{scattered}");
    for &part in parts {
        let settings = if part == Part::Direct { direct } else { indirect };
        let [aimed, other] = [true, false].map(|aim| result_of(gpu, &scene, &settings(aim)));
        assert_eq!(aimed.plan.trial.as_ref().map(|trial| trial.openings.len()), Some(1), "{sky}, {part:?}");
        let [little, much] = [&aimed, &other].map(|result| result.film.relative_error());
        println!("{sky}, {part:?}: {:.2} % and {:.2} %", 100.0 * little, 100.0 * much);
        assert!((much / little).powi(2) > 10.0, "{sky}, {part:?}: {little} and {much}");
        // Paths seldom meet the sun, so that points together are asked for its light.
        for together in judged.iter().enumerate().collect::<Vec<_>>().chunks(if sky == "even" { 1 } else { judged.len() }) {
            let [mut found, mut expected, mut error, mut judges_error] = [0.0; 4];
            for &(point, judged) in together {
                let (mean, own) = red(&aimed, point);
                let judges = judged.standard_error[part].x;
                (found, expected) = (found + mean, expected + judged.mean[part].x);
                (error, judges_error) = (error + own.hypot(judges), judges_error + judges);
            }
            let what = format!("{sky}, {part:?}, {:?}", together[0].0);
            assert!(judges_error < 0.15 * expected, "{what}: {expected} +- {judges_error}");
            assert_holds(&what, z_check("aimed", found, expected, error));
        }
    }
}

/// Direct light below the middle of the hole is that of the closed form, and the light of all points that of the photons of many more
/// rounds.
pub fn light_through_a_window(gpu: &Gpu) -> Check<Complaint> {
    let scene = room_under_an_even_sky();
    let direct = result_of(gpu, &scene, &SceneSettings { shadow_rays: 64, ..settings(Part::Direct, true) });
    let hole = opening(dvec3(-HALF, 3.0, -HALF), 2.0 * HALF * DVec3::X, 2.0 * HALF * DVec3::Z);
    let ((found, error), exact) = (red(&direct, 7), rectangles::direct(&[hole], DVec3::ZERO, DVec3::Y).x);
    assert!(error < 0.02 * found, "{found} +- {error}");
    estimate_check("below the hole", found, exact, error)?;
    let indirect = result_of(gpu, &scene, &settings(Part::Indirect, true));
    let errors: f64 = (0..points().len()).map(|point| red(&indirect, point).1).sum();
    estimate_check("scattered light", mean_red(&indirect), SCATTERED, errors / points().len() as f64)
}

/// A niche with a hole of its own, three centimetres wide, that one point of two hundred sees beside the window: rays are aimed at the
/// window, and of the hole's light it is said that it may be missing.
pub fn second_opening(gpu: &Gpu) -> Check<Complaint> {
    let mut room = room_under_an_even_sky();
    room.materials[0] = Material { two_sided: true, ..matt(0.0) };
    room.meshes.retain(|mesh| mesh.name != "right");
    let sheet = |origin: DVec3, u: DVec3, v: DVec3| Mesh::parallelogram("sheet", origin, u, v, 0);
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    // The wall about a hole of 3 cm, and a screen before it.
    let hole = [DVec2::new(1.985 / 4.0, 0.11 / 3.0), DVec2::new(2.015 / 4.0, 0.14 / 3.0)];
    room.meshes.extend(around_hole(dvec3(2.0, 0.0, -2.0), z * 4.0, y * 3.0, hole, 0));
    room.meshes.extend([
        sheet(dvec3(1.7, 0.0, -0.3), y * 0.2, z * 0.6),
        sheet(dvec3(1.7, 0.0, -0.3), x * 0.3, y * 0.2),
        sheet(dvec3(1.7, 0.0, 0.3), x * 0.3, y * 0.2),
    ]);
    let mut points: Vec<_> =
        (0..200).map(|k| (dvec3(-1.9 + 0.33 * f64::from(k % 10), 0.0, -1.9 + 0.19 * f64::from(k / 10)), DVec3::Y)).collect();
    points.push((dvec3(1.85, 0.0, 0.0), DVec3::Y));
    // Of the hole: from the middle of the point's view of it.
    let way = dvec3(0.15, 0.125, 0.0);
    let missing = 0.0009 * way.x * way.y / way.length_squared().powi(2);
    let result = render(gpu, &room, &by_rounds(), Receivers::Points(&points)).unwrap();
    let hidden = result.film.unknown(0.95).hidden;
    println!("{hidden:?}, {missing} may be missing; {:?}", red(&result, 200));
    assert_eq!(result.plan.trial.as_ref().map(|trial| trial.openings.len()), Some(1));
    let (found, error) = red(&result, 200);
    assert!(found > 0.01 && error < 0.5 * missing, "the window alone: {found} +- {error}");
    if hidden.points < 150 || hidden.upper_bound < missing {
        return Err(Complaint::new(Kind::TooDark, format!("{missing} W/m2 may be missing, and {hidden:?} is known")));
    }
    assert!(result.film.unknown(0.95).text("point", "W/m2", 0.95, 16).contains("some part of the sky"));
    Ok(())
}

/// In a picture it is next to nothing beside the light of all pixels.
#[test]
#[ignore = "long: ten seconds on a software device"]
fn a_second_opening_is_next_to_nothing_in_a_picture() {
    let Some(gpu) = device() else { return };
    let eye = Camera::looking_at("eye", dvec3(-1.9, 2.0, -1.9), dvec3(0.5, 0.5, 0.5), DVec3::Y, 1.0);
    let seen = render(&gpu, &room_under_an_even_sky(), &by_rounds(), Receivers::Image(&eye, [64, 64])).unwrap();
    let hidden = seen.film.unknown(0.95).hidden;
    assert!(hidden.of_mean < 0.01, "{hidden:?}");
}

/// Where nothing is gained nothing changes: under the open sky.
fn an_open_scene_has_no_openings_and_the_same_bits(gpu: &Gpu) {
    let mut scene = room_under(0.5, LightKind::Sky(Arc::new(sunny(32, 300.0))));
    // The floor and one wall.
    scene.meshes.retain(|mesh| ["level", "right"].contains(&mesh.name.as_str()));
    assert_eq!(scene.meshes.len(), 2);
    // What they scatter is not asked for here: a black floor needs no photons in the trial.
    let black = Scene { materials: vec![matt(0.0)], ..scene.clone() };
    let [aimed, other] = [true, false].map(|aim| result_of(gpu, &black, &SceneSettings { rounds: 4, ..direct(aim) }));
    assert!(aimed.plan.trial.as_ref().is_none_or(|trial| trial.openings.is_empty()));
    assert!(aimed.film.sums.iter().any(|sum| *sum > 0));
    assert_eq!(aimed.film.sums, other.film.sums);
    // Photons neither.
    let plan = scene_plan(gpu, &scene, &indirect(true), Sensor::Receivers { count: 1 }).unwrap().1;
    assert!(plan.trial.as_ref().is_none_or(|trial| trial.openings.is_empty()));
}

/// A skylight of 0.2 x 0.2 m that shows the sun, beside a window of 2 x 1.4 m in a black room. Lines from the points cross each other where
/// these stand close together, so that what the trial takes for an opening may lie there; from one point in the patch of sun nothing that it
/// found shows the sun. Rays look for it all the same.
pub fn sun_through_a_small_window(gpu: &Gpu) -> Check<Complaint> {
    let sheet = |origin: DVec3, u: DVec3, v: DVec3| Mesh::parallelogram("sheet", origin, u, v, 0);
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let hole = dvec3(-0.5, 3.0, -0.3);
    let mut meshes = vec![
        sheet(dvec3(-2.0, 0.0, -2.0), 4.0 * x, 4.0 * z),
        sheet(dvec3(-2.0, 0.0, -2.0), 4.0 * x, 3.0 * y),
        sheet(dvec3(-2.0, 0.0, 2.0), 4.0 * x, 3.0 * y),
        sheet(dvec3(-2.0, 0.0, -2.0), 4.0 * z, 3.0 * y),
    ];
    let window = [DVec2::new(0.25, 0.8 / 3.0), DVec2::new(0.75, 2.2 / 3.0)];
    let skylight = [-0.1, 0.1].map(|half| (DVec2::new(hole.z, hole.x) + 2.0 + half) / 4.0);
    meshes.extend(around_hole(dvec3(2.0, 0.0, -2.0), 4.0 * z, 3.0 * y, window, 0));
    meshes.extend(around_hole(dvec3(-2.0, 3.0, -2.0), 4.0 * z, 4.0 * x, skylight, 0));
    // 20 degrees from the vertical, away from the window.
    let picture = sky(2048, 1024, |i, j| Vec3::splat(if (i, j) == (0, 114) { 1.3e6 } else { 1.0 }));
    let (angle, turn) = (PI * 114.5 / 1024.0, TAU * (0.5 / 2048.0 - 0.5));
    let patch = hole - 3.0 * dvec3(angle.tan() * turn.cos(), 1.0, angle.tan() * turn.sin());
    let near = grid(0.0, DVec3::Y, 3).into_iter().map(|(at, _)| patch + 0.06 * at);
    // All of the sun shines on the first ten.
    let others = [patch + dvec3(0.085, 0.0, 0.085), dvec3(1.0, 0.0, 1.0), dvec3(-1.0, 0.0, 1.0), dvec3(1.5, 0.0, -1.0)];
    let points: Vec<_> = near.chain(others).map(|place| (place, DVec3::Y)).collect();
    // Of its texel's tent, over the sky around; and of an even sky in both openings.
    let towards = dvec3(angle.sin() * turn.cos(), angle.cos(), angle.sin() * turn.sin());
    let sun = (picture.radiance(towards).x - 1.0) * (PI / 1024.0).powi(2) * angle.sin() * angle.cos();
    let openings = [opening(dvec3(2.0, 0.8, -1.0), 2.0 * z, 1.4 * y), opening(hole - 0.1 * (x + z), 0.2 * x, 0.2 * z)];
    let black = Material { two_sided: true, ..matt(0.0) };
    let scene = scene_of(meshes, vec![black], vec![LightKind::Sky(Arc::new(picture))]);
    let settings = SceneSettings { rounds: 64, shadow_rays: 4, ..direct(true) };
    let aimed = render(gpu, &scene, &settings, Receivers::Points(&points)).unwrap();
    assert!(aimed.plan.trial.as_ref().is_some_and(|trial| !trial.openings.is_empty()));
    // Without a least share of the table one point has a tenth of its light.
    for (number, (at, normal)) in points.iter().enumerate() {
        let (found, error) = red(&aimed, number);
        let expected = rectangles::direct(&openings, *at, *normal).x + if number < 10 { sun } else { 0.0 };
        println!("point {number}: {found} +- {error}, {expected} expected");
        estimate_check(&format!("point {number}"), found, expected, error.hypot(1e-3 * expected))?;
    }
    Ok(())
}
