//! What nothing has reached has an unknown error and an upper bound, and no run ends on it.

use crate::common::known::of_any_room;
use crate::common::prelude::*;
use crate::common::rendered::{around_hole, sides};
use glam::dvec3;
use photonmill::engine::End;
use photonmill::engine::room::film::{estimate_walls, irradiance_weights};
use photonmill::engine::scene::{Receivers, RunResult};
use photonmill::settings::stop::Stop;

/// Walls of a room over [-2, 2] x [-2, 2], as high as 3 m, that face inwards; and its ceiling but for a hole in the middle.
pub fn room_without_floor(hole: f64) -> Vec<Mesh> {
    let [side, height, depth] = [4.0 * DVec3::X, 3.0 * DVec3::Y, 4.0 * DVec3::Z];
    let wall = |name, origin, u, v| Mesh::parallelogram(name, origin, u, v, 0);
    let walls = vec![
        wall("back", dvec3(-2.0, 0.0, -2.0), side, height),
        wall("front", dvec3(-2.0, 0.0, 2.0), height, side),
        wall("left", dvec3(-2.0, 0.0, -2.0), height, depth),
        wall("right", dvec3(2.0, 0.0, -2.0), depth, height),
    ];
    [walls, around_hole(dvec3(-2.0, 3.0, -2.0), side, depth, about(hole), 0)].concat()
}

/// A square hole that reaches so far from the middle of 4 m, as shares of these.
fn about(hole: f64) -> [DVec2; 2] {
    [0.5 - 0.25 * hole, 0.5 + 0.25 * hole].map(DVec2::splat)
}

/// Puts a window into the right wall of such a room, from `low` to `high` as shares of its width and height.
fn open_right_wall(meshes: &mut Vec<Mesh>, low: (f64, f64), high: (f64, f64)) {
    let hole = [low, high].map(DVec2::from);
    meshes.splice(3..4, around_hole(dvec3(2.0, 0.0, -2.0), 4.0 * DVec3::Z, 3.0 * DVec3::Y, hole, 0));
}

/// A room lit through a hole in its ceiling, so small that no photon of a run may find it.
fn pinhole_room() -> Scene {
    let meshes = [room_without_floor(0.01), vec![level(0.0, [4.0, 4.0], true, 0), level(4.0, [4.0, 4.0], false, 1)]].concat();
    scene_of(meshes, vec![matt(0.5), emissive(0.0)], vec![])
}

fn is_black(result: &RunResult) -> bool {
    result.film.sums.iter().all(|sum| *sum == 0)
}

#[test]
fn no_run_ends_on_a_picture_that_nothing_has_reached() {
    let Some(gpu) = device() else { return };
    let scene = pinhole_room();
    let camera = Camera::looking_at("camera", dvec3(0.0, 1.5, 1.9), DVec3::ZERO, DVec3::Y, 1.2);
    let mut black = 0;
    for seed in 1..=6 {
        let stop = Stop { error: Some(0.02), ..Stop::default() };
        let settings = SceneSettings { photons: 300, rounds: 40, shadow_rays: 1, seed, stop, ..by_rounds() };
        let result = seen(&gpu, &scene, &settings, &camera, [6, 6]);
        assert_eq!((result.end, result.film.rounds), (End::Rounds, 40), "seed {seed}");
        if is_black(&result) {
            black += 1;
            // By its spread alone a run would have been known exactly.
            assert_eq!(result.film.relative_error(), 0.0);
            let unknown = result.film.unknown(0.95);
            assert_eq!((unknown.asked, unknown.unreached), (36, 36), "seed {seed}");
            assert_eq!(unknown.absent, ["shadow ray", "photon of the global map"], "seed {seed}");
            assert_eq!(result.film.error(0.95).bound(0.95), f64::INFINITY);
            assert_eq!(result.film.stated_error(7), DVec3::INFINITY);
        }
    }
    assert!(black > 1, "{black} of 6 seeds: the hole is too large for this test");
}

/// A house with a window on a sunlit plain: photons fall everywhere, and next to none of them into the house.
#[test]
fn probes_in_a_house_on_a_sunlit_plain_have_a_bound_and_no_error() {
    let Some(gpu) = device() else { return };
    let mut meshes = room_without_floor(0.0);
    // Sun comes from the left, and light of the ground through a window in the right wall.
    open_right_wall(&mut meshes, (0.0, 1.0 / 3.0), (1.0, 2.0 / 3.0));
    meshes.push(level(0.0, [800.0, 800.0], true, 0));
    let sun = LightKind::Directional { direction: dvec3(1.0, -1.0, 0.0).normalize(), irradiance: Vec3::splat(1000.0) };
    let scene = scene_of(meshes, vec![matt(0.5)], vec![sun]);
    let inside = [(dvec3(0.5, 0.0, 0.5), DVec3::Y), (dvec3(-1.0, 0.0, -0.5), DVec3::Y)];
    let settings = SceneSettings { photons: 3000, rounds: 16, radius: Some(1.0), alpha: 1.0, ..by_rounds() };
    let result = received(&gpu, &scene, &settings, &inside);
    assert!(is_black(&result), "light has found the house: the test needs fewer photons");
    let unknown = result.film.unknown(0.95);
    assert_eq!((unknown.asked, unknown.unreached, unknown.relative), (2, 2, f64::INFINITY), "{unknown:?}");
    assert_eq!(result.film.stated_error(0), DVec3::INFINITY);
    // The rule of three: 3.0 photons of all rounds at most, each with its share of what falls on the scene's sphere, in a disc
    // of 1 m.
    let geometry = Geometry::new(&scene).unwrap();
    let expected = 20f64.ln() * 1000.0 * (geometry.radius * geometry.unit).powi(2) / (3000.0 * 16.0);
    assert!((unknown.upper_bound / expected - 1.0).abs() < 1e-3, "{unknown:?}: {expected}");
    for truth in Judge::new(&scene, 8).irradiance_at(&inside, 1000, 1) {
        let truth = truth.mean.total().x;
        assert!(truth > 0.05 && truth < unknown.upper_bound, "{truth}, {unknown:?}");
    }
}

/// Darkness that matters little beside what is lit, and what asks for no light, keep no run from its end.
#[test]
fn runs_end_where_the_dark_is_known_well_enough() {
    let Some(gpu) = device() else { return };
    let stop = Stop { error: Some(0.2), ..Stop::default() };
    let settings = SceneSettings { photons: 3000, rounds: 2000, stop, ..by_rounds() };
    let closed = [room_without_floor(0.0), vec![level(0.0, [4.0, 4.0], true, 0)]].concat();
    let lamp_outside = vec![level(3.5, [4.0, 4.0], true, 1), level(8.0, [4.0, 4.0], false, 0)];
    let scene = scene_of([closed, lamp_outside].concat(), vec![matt(0.5), emissive(0.0)], vec![]);
    let result = received(&gpu, &scene, &settings, &[(dvec3(0.0, 8.0, 0.0), -DVec3::Y), (DVec3::ZERO, DVec3::Y)]);
    assert_eq!(result.end, End::Error);
    let unknown = result.film.unknown(0.95);
    assert_eq!((unknown.asked, unknown.unreached), (2, 1), "{unknown:?}");
    assert!(unknown.relative > 0.0 && unknown.relative < 0.2, "{unknown:?}");
    assert!(result.film.stated_error(0).is_finite() && result.film.stated_error(1) == DVec3::INFINITY);

    // A lit square before nothing: the background is black for certain.
    let lamp = LightKind::Point { position: dvec3(0.0, 1.0, 0.0), intensity: Vec3::ONE };
    let scene = scene_of(vec![level(0.0, [1.0, 1.0], true, 0)], vec![matt(0.5)], vec![lamp]);
    let camera = Camera::looking_at("camera", dvec3(0.0, 3.0, 0.01), DVec3::ZERO, DVec3::Z, 1.2);
    let result = seen(&gpu, &scene, &settings, &camera, [8, 8]);
    let unknown = result.film.unknown(0.95);
    assert_eq!((result.end, unknown.unreached), (End::Error, 0), "{unknown:?}");
    assert!(unknown.asked > 0 && unknown.asked < 60, "{unknown:?}");
    // And nothing but background has no error at all.
    let away = Camera::looking_at("camera", dvec3(0.0, 3.0, 0.0), dvec3(0.0, 9.0, 0.0), DVec3::Z, 0.5);
    let result = seen(&gpu, &scene, &settings, &away, [4, 4]);
    assert_eq!((result.end, result.film.error(0.95).bound(0.95)), (End::Error, 0.0));
}

/// A mirror below the floor is a target of the caustic map's photons, and none of them gets there.
#[test]
fn a_map_of_which_no_photon_arrives_is_named() {
    let Some(gpu) = device() else { return };
    let below = level(-1.0, [1.0, 1.0], true, 2);
    let scene = |meshes: Vec<Mesh>| scene_of(meshes, vec![matt(0.5), emissive(0.0), mirror(0.9)], vec![]);
    let hidden = scene(vec![level(0.0, [4.0, 4.0], true, 0), level(2.0, [1.0, 1.0], false, 1), below.clone()]);
    let settings = SceneSettings { photons: 3000, caustic_photons: 1000, rounds: 4, ..by_rounds() };
    let point = [(dvec3(0.3, 0.0, 0.0), DVec3::Y)];
    let result = received(&gpu, &hidden, &settings, &point);
    let unknown = result.film.unknown(0.95);
    assert!(unknown.absent.contains(&"photon of the caustic map") && unknown.unreached == 0, "{unknown:?}");
    assert!(unknown.relative > 0.0 && unknown.relative.is_finite(), "{unknown:?}");
    assert!(unknown.text("point", "W/m2", 0.95, 2).contains("no photon of the caustic map has reached any point"));
}

/// The paper's box means the same by it: texels that no photon has found.
#[test]
fn texels_of_the_box_that_no_photon_has_found_have_no_error() {
    let Some(gpu) = device() else { return };
    let settings = RoomSettings { photons: 15, rounds: 8, mesh: 16, radius: 0.01, rng: Rng::Philox, ..RoomSettings::default() };
    let result = run(&gpu, &settings);
    let scene = open_box(&result.plan.settings);
    let unknown = result.film.unknown(&irradiance_weights(&scene, &result.plan), 1.0, &Stop::default());
    let walls = estimate_walls(&result.film, &scene, &result.plan);
    let texels = || walls.iter().flat_map(|wall| wall.irradiance.iter().zip(&wall.irradiance_error));
    let dark = texels().filter(|(irradiance, _)| **irradiance == 0.0).count() as u64;
    assert_eq!((unknown.unreached, unknown.asked), (dark, texels().count() as u64));
    assert!(dark > 0 && dark < unknown.asked, "{unknown:?}");
    assert!(texels().all(|(irradiance, error)| (*irradiance == 0.0) == error.is_infinite()));
    // Each bound is 3.0 photons' worth, and the texels that are lit have one or a few each.
    let weights = irradiance_weights(&scene, &result.plan);
    let square = |of: &dyn Fn(usize) -> f64| (0..weights.len()).map(|texel| (weights[texel] * of(texel)).powi(2)).sum::<f64>();
    let bounds = square(&|texel| if result.film.flux(texel) == 0.0 { 20f64.ln() } else { 0.0 });
    let sum: f64 = (0..weights.len()).map(|texel| weights[texel] * result.film.flux(texel)).sum();
    let expected = (bounds * weights.iter().filter(|weight| **weight > 0.0).count() as f64).sqrt() / sum;
    assert!((unknown.relative / expected - 1.0).abs() < 1e-9, "{unknown:?}: {expected}");
}

/// In a furnace of which few photons reach few points, shadow rays reach all: half of the light is missing where no photon came, and
/// the spread of the other half is no error of that: it is said apart.
#[test]
fn points_that_no_photon_has_reached_say_how_much_may_be_unseen() {
    let Some(gpu) = device() else { return };
    let places = || (0..36).map(|k| (f64::from(k % 6) / 6.0 + 0.08, f64::from(k / 6) / 6.0 + 0.08));
    let points: Vec<_> = places().map(|(x, z)| (dvec3(x, 1.0, z), DVec3::NEG_Y)).collect();
    let settings = SceneSettings { photons: 10, rounds: 16, radius: Some(0.05), shadow_rays: 64, ..by_rounds() };
    let result = received(&gpu, &scene("furnace"), &settings, &points);
    // What is missing beyond what was not seen, in stated errors.
    let most = |unseen: &dyn Fn(usize) -> f64, errors: &dyn Fn(usize) -> DVec3| {
        (0..points.len()).map(|point| ((result.film.mean(point).x - TAU).abs() - unseen(point)) / errors(point).x).fold(0.0, f64::max)
    };
    let errors = result.film.stated_errors();
    let (with, without) = (most(&result.film.unseen_bounds(), &errors), most(&|_| 0.0, &errors));
    let unseen = result.film.unknown(0.95).unseen;
    println!("at most {with:.1} stated errors off beyond what was not seen, {without:.1} in all: {unseen:?}");
    assert!(with < 5.0 && without > 10.0, "{with} and {without}");
    assert!(unseen.points > 10 && unseen.of_mean > 0.1, "{unseen:?}");
}

/// A lamp that is seen through a gap which every ray misses: another lamp lights the points, so that their spread is no error of it. The
/// report says what it may add.
pub fn hidden_lamp(gpu: &Gpu) -> Check<Complaint> {
    // A black sheet 1 m above the floor with a hole of 1 cm, and a bright lamp above it.
    let half = 0.005;
    let sheet = around_hole(dvec3(-2.0, 1.0, -2.0), 4.0 * DVec3::Z, 4.0 * DVec3::X, about(half), 3);
    let dim = Mesh::parallelogram("dim", DVec3::new(0.6, 0.5, 0.6), DVec3::X * 0.2, DVec3::Z * 0.2, 1);
    let meshes = [vec![level(0.0, [4.0; 2], true, 0), level(2.0, [2.0; 2], false, 2), dim], sheet].concat();
    let emissive = |radiance: f32| Material { emission: Vec3::splat(radiance), ..matt(0.0) };
    // A black floor needs no photons in the trial.
    let scene = scene_of(meshes, vec![matt(0.0), emissive(1.0), emissive(1000.0), Material { two_sided: true, ..matt(0.0) }], vec![]);
    let points: Vec<_> = (0..16).map(|k| (DVec3::new(f64::from(k % 4), 0.0, f64::from(k / 4)) * 0.1, DVec3::Y)).collect();
    let settings = of_any_room(by_rounds());
    let result = render(gpu, &scene, &settings, Receivers::Points(&points)).unwrap();
    let unknown = result.film.unknown(0.95);
    // Of the hole below the lamp's middle: radiance times its area over the squared distance, both seen straight.
    let missing = 1000.0 * 4.0 * half * half;
    println!("{:?}, {missing} are missing", unknown.hidden);
    let (found, error) = (result.film.mean(0).x, result.film.stated_error(0).x);
    assert!(missing - found > 5.0 * error, "some ray has met it: look for a smaller hole");
    let is_said = unknown.text("point", "W/m2", 0.95, 16).contains("hidden: ");
    let is_known = unknown.hidden.upper_bound >= missing && is_said;
    Kind::TooDark.unless(is_known, || format!("{missing} W/m2 are missing, and {:?} is known", unknown.hidden))?;
    let open = Scene { meshes: scene.meshes[..3].to_vec(), ..scene };
    let result = render(gpu, &open, &settings, Receivers::Points(&points)).unwrap();
    let points = result.film.unknown(0.95).hidden.points;
    Kind::TooDark.unless(points == 0, || format!("lamps in full sight are hidden from {points} points"))
}

/// A box that stands in the middle of the floor of a furnace of 2 m, points of its sides, and what they receive.
fn box_in_a_furnace(gpu: &Gpu, width: f64) -> Result<RunResult, Error> {
    let corner = dvec3(1.0 - 0.5 * width, 0.0, 1.0 - 0.5 * width);
    let room = sides(DVec3::ZERO, DVec3::splat(2.0), true, [0; 6]);
    let glowing = Material { emission: Vec3::splat(0.5), ..matt(0.5) };
    let scene = scene_of([room, sides(corner, DVec3::splat(width), false, [0; 6])].concat(), vec![glowing], vec![]);
    let heights = [0.25, 0.5, 0.75].into_iter();
    let points: Vec<_> = heights
        .flat_map(|height| {
            let at = dvec3(1.0, height * width, 1.0);
            [DVec3::X, DVec3::NEG_X, DVec3::Z, DVec3::NEG_Z].map(|normal| (at + 0.5 * width * normal, normal))
        })
        .collect();
    render(gpu, &scene, &by_rounds(), Receivers::Points(&points))
}

/// A box so small that next to no photon of the walls meets it, and many of its own do, each of which carries little: their spread is no
/// error of the light that is missing. The report says that brighter photons may be missing, and how much they may add.
pub fn dim_photons(gpu: &Gpu) -> Check<Complaint> {
    let result = box_in_a_furnace(gpu, 0.002)?;
    let missing = |point: usize| PI - result.film.mean(point).x;
    let is_silent = |point: &usize| missing(*point) > 5.0 * result.film.stated_error(*point).x;
    let silent: Vec<usize> = (0..result.film.pixels()).filter(is_silent).collect();
    let most = silent.iter().map(|point| missing(*point)).fold(0.0, f64::max);
    let unknown = result.film.unknown(0.95);
    println!("{} of 12 points lack up to {most} W/m2 without an error of it: {:?}", silent.len(), unknown.dim);
    assert!(silent.len() > 4, "bright photons have met the box: look for a smaller one");
    let is_said = unknown.text("point", "W/m2", 0.95, 16).contains("dim: ");
    let is_known = unknown.dim.points >= silent.len() as u64 && unknown.dim.upper_bound >= most && is_said;
    Kind::TooDark.unless(is_known, || format!("{} points lack up to {most} W/m2, and {:?} is known", silent.len(), unknown.dim))?;
    let result = box_in_a_furnace(gpu, 0.4)?;
    let points = result.film.unknown(0.95).dim.points;
    Kind::TooDark.unless(points == 0, || format!("{points} points among bright photons have met none of them"))
}

/// Photons that are aimed at a window are dim; those that the ground scatters into it are bright and rare. Without them a room is too dark
/// for its error, and the report says so.
#[test]
fn light_that_the_ground_scatters_into_a_room_is_said_to_be_missing() {
    let Some(gpu) = device() else { return };
    let mut meshes = room_without_floor(0.0);
    open_right_wall(&mut meshes, (0.375, 1.0 / 3.0), (0.625, 2.0 / 3.0));
    meshes.extend([level(0.0, [4.0; 2], true, 0), level(-0.01, [100.0; 2], true, 0)]);
    let scene = scene_of(meshes, vec![matt(0.5)], vec![LightKind::Environment { radiance: Vec3::ONE }]);
    let both = |(x, z): (f64, f64)| [(dvec3(x, 3.0, z), DVec3::NEG_Y), (dvec3(x, 0.0, z), DVec3::Y)];
    let points: Vec<_> = (0..9).flat_map(|k| both((f64::from(k / 3) - 1.5, f64::from(k % 3) - 1.0))).collect();
    let result = render(&gpu, &scene, &SceneSettings { part: Part::Indirect, ..by_rounds() }, Receivers::Points(&points)).unwrap();
    let truth = Judge::new(&scene, 16).irradiance_at(&points, 6000, 1);
    let found: f64 = (0..points.len()).map(|point| red(&result, point).0).sum();
    let missing = truth.iter().map(|point| point.mean.indirect.x).sum::<f64>() - found;
    let errors: f64 = (0..points.len()).map(|point| result.film.stated_error(point).x + truth[point].standard_error.indirect.x).sum();
    let dim = result.film.unknown(0.95).dim;
    println!("{missing:.4} is missing beside {found:.4} +- {errors:.4}: {dim:?}");
    // Even if all errors went the same way.
    assert!(missing > errors, "light of the ground has been found: the test needs a larger one");
    assert!(dim.points == points.len() as u64 && dim.of_mean > missing / found, "{missing} of {found} is missing, and {dim:?} is known");
}

/// Two faces of glass, of an index of 1.5, let so much of a ray at 45 degrees pass, over and over (Fresnel); of the irradiance of 1.
fn through_a_pane_at_45_degrees() -> f64 {
    let (cos_i, cos_t) = (0.5f64.sqrt(), (1.0f64 - 0.5 / 2.25).sqrt());
    let squared = |a: f64, b: f64| ((a - b) / (a + b)).powi(2);
    let r = 0.5 * (squared(cos_i, 1.5 * cos_t) + squared(1.5 * cos_i, cos_t));
    cos_i * (1.0 - r) / (1.0 + r)
}

fn below_a_pane(lights: Vec<LightKind>) -> Scene {
    let mut meshes = crate::tests::materials::media::cuboid("pane", dvec3(-3.0, 2.0, -3.0), dvec3(3.0, 2.01, 3.0), 1);
    meshes.push(level(0.0, [6.0; 2], true, 0));
    scene_of(meshes, vec![matt(0.0), glass(1.5)], lights)
}

fn below_a_pane_settings() -> SceneSettings {
    SceneSettings { photons: 20_000, caustic_photons: 20_000, rounds: 32, block: Some(1), ..by_rounds() }
}

/// Points in the air get what the sun sends through glass: on a work plane, a hair above the floor, and where rounding moves them off a plane
/// that leans.
#[test]
fn points_in_the_air_get_what_comes_through_glass() {
    let Some(gpu) = device() else { return };
    let scene = below_a_pane(vec![sun(dvec3(-1.0, -1.0, 0.0))]);
    let irradiance = through_a_pane_at_45_degrees();
    let lean = dvec3(0.5, 3f64.sqrt() / 2.0, 0.0);
    // Three decimals.
    let on_the_lean = |x: f64| (1000.0 * dvec3(x, 1.0 - x * lean.x / lean.y, 0.1 * x)).round() / 1000.0;
    let mut points: Vec<(DVec3, DVec3)> = (0..6).map(|k| (dvec3(0.3 * f64::from(k % 3), 0.85, 0.2 * f64::from(k / 3)), DVec3::Y)).collect();
    points.extend([(dvec3(0.5, 3e-5, 0.0), DVec3::Y), (DVec3::ZERO, DVec3::Y), (dvec3(-0.4, 0.85, 0.0), DVec3::NEG_Y)]);
    points.extend([-0.2, 0.0, 0.3].map(|x| (on_the_lean(x), lean)));
    let result = render(&gpu, &scene, &below_a_pane_settings(), Receivers::Points(&points)).unwrap();
    assert_eq!(result.film.unknown(0.95).off_surfaces.points, 0);
    // The sun comes down along (-1, -1, 0).
    let sunward = dvec3(1.0, 1.0, 0.0).normalize();
    for (place, (point, normal)) in points.iter().enumerate() {
        let exact = irradiance / 0.5f64.sqrt() * normal.dot(sunward).max(0.0);
        let (found, error) = red(&result, place);
        println!("{point} {normal}: {found} +- {error}, {exact} expected");
        if exact == 0.0 {
            assert_eq!(found, 0.0, "{point}");
        } else {
            assert_holds(format!("{point}"), z_check("the sun through glass", found, exact, error));
            assert!(error < 0.35 * exact, "{point}: {found} +- {error}");
        }
    }
}

/// A lamp above a pane, and points below it in all six directions: what the path tracer finds, whatever the floor, and no bound is too
/// low.
#[test]
fn bounds_of_points_below_glass_hold() {
    let Some(gpu) = device() else { return };
    let lamp = Mesh::parallelogram("lamp", dvec3(-0.2, 3.0, -0.2), 0.4 * DVec3::X, 0.4 * DVec3::Z, 2);
    let mut scene = below_a_pane(Vec::new());
    scene.meshes.push(lamp);
    scene.materials.push(Material { emission: Vec3::splat(10.0), ..matt(0.0) });
    scene.materials[0] = matt(0.3);
    let axes = [DVec3::Y, DVec3::X, DVec3::Z, DVec3::NEG_Y, DVec3::NEG_X, DVec3::NEG_Z];
    let points: Vec<(DVec3, DVec3)> =
        (0..24).map(|k| (dvec3(0.3 * f64::from(k % 6) - 0.75, 0.85, 0.4 * f64::from(k / 6) - 0.6), axes[k as usize % 6])).collect();
    let result = render(&gpu, &scene, &below_a_pane_settings(), Receivers::Points(&points)).unwrap();
    let truth = Judge::new(&scene, 16).irradiance_at(&points, 20_000, 1);
    let unseen = result.film.unseen_bounds();
    let mut squares = 0.0;
    for (place, of) in truth.iter().enumerate() {
        let (found, error) = red(&result, place);
        let (expected, of_truth) = (of.mean.total().x, of.total_standard_error.x);
        let error = error.hypot(of_truth);
        println!(
            "{} {}: {found} +- {error}, {expected} +- {of_truth} expected, at most {} unseen",
            points[place].0,
            points[place].1,
            unseen(place)
        );
        assert!((found - expected).abs() < 5.0 * error + unseen(place), "point {place}");
        assert!(error < 0.35 * expected, "point {place}");
        squares += ((found - expected) / error).powi(2) / truth.len() as f64;
    }
    // Mean square of 24 deviations; 2.3 is passed once in ten thousand.
    assert!(squares < 2.3, "{squares}");
}

/// Without what lets light pass a sheet, a point in the air has none, lacks what the sun sends through glass, and says so.
#[test]
fn points_off_surfaces_have_no_error_where_photons_alone_bring_light() {
    let Some(gpu) = device() else { return };
    let scene = below_a_pane(vec![sun(dvec3(-1.0, -1.0, 0.0))]);
    let settings = SceneSettings { without: vec![Effect::Alpha], ..below_a_pane_settings() };
    let result_at = |points: &[(DVec3, DVec3)], settings: &SceneSettings| render(&gpu, &scene, settings, Receivers::Points(points));
    let result = result_at(&[(dvec3(0.5, 0.85, 0.0), DVec3::Y), (DVec3::ZERO, DVec3::Y)], &settings).unwrap();
    assert_eq!((result.film.mean(0).x, result.film.stated_error(0).x), (0.0, f64::INFINITY));
    let off = result.film.unknown(0.95).off_surfaces;
    assert_eq!((off.points, off.of, &off.first[..]), (1, 2, &[1][..]));
    assert!(result.film.unknown(0.95).text("point", "W/m2", 0.95, 32).contains("1 of 2 points (1) lie on no surface"));
    let exact = through_a_pane_at_45_degrees();
    assert_holds("on the floor", z_check("on the floor", result.film.mean(1).x, exact, result.film.stated_error(1).x));
    // An error that no round can reach ends the run with a line.
    let stop = Stop { error: Some(0.05), ..Stop::default() };
    let refused = result_at(&[(dvec3(0.5, 0.85, 0.0), DVec3::Y)], &SceneSettings { stop, ..settings }).err().map(|error| error.to_string());
    assert!(refused.as_ref().is_some_and(|line| line.contains("`error` 5%") && line.contains("no point lies on a surface")), "{refused:?}");
}
