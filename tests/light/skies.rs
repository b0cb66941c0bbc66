//! Skies from pictures: what they light, against sums over all directions, the path tracer, and photons against rays.

use std::sync::Arc;

use crate::common::estimate_check;
use crate::common::prelude::*;
use crate::tests::light::openings::{direct, room_under};
use glam::dvec3;
use photonmill::engine::scene::Receivers;
use photonmill::scene::material::Coverage;
use photonmill::scene::sky::Sky;

/// A picture of so many pixels by their colours.
pub fn sky(width: u32, height: u32, colour: impl Fn(u32, u32) -> Vec3) -> Sky {
    let colours = (0..height).flat_map(|j| (0..width).map(move |i| (i, j))).map(|(i, j)| colour(i, j)).collect();
    Sky::of("sky", width, height, colours)
}

/// Brighter above, blue to one side, with one pixel of a low sun that has two thirds of the light.
pub fn sunny(width: u32, sun: f32) -> Sky {
    let (i_sun, j_sun) = (width * 5 / 8, width / 8);
    sky(width, width / 2, |i, j| {
        let (x, y) = (i as f32 / width as f32, 2.0 * j as f32 / width as f32);
        let sky = Vec3::new(1.0 - 0.8 * y, 0.9 - 0.5 * y, 0.3 + x);
        if (i, j) == (i_sun, j_sun) { sky + Vec3::new(sun, 0.9 * sun, 0.7 * sun) } else { sky }
    })
}

/// Irradiance on surfaces with these normals: sums over all directions.
fn irradiances<const N: usize>(sky: &Sky, normals: [DVec3; N]) -> [DVec3; N] {
    const ROWS: u32 = 1024;
    let step = PI / f64::from(ROWS);
    let mut sums = [DVec3::ZERO; N];
    for (j, i) in (0..ROWS).flat_map(|j| (0..2 * ROWS).map(move |i| (j, i))) {
        let [angle, turn] = [j, i].map(|place| step * (f64::from(place) + 0.5));
        let wi = dvec3(angle.sin() * turn.cos(), angle.cos(), angle.sin() * turn.sin());
        let arriving = angle.sin() * step * step * sky.radiance(wi);
        sums.iter_mut().zip(normals).for_each(|(sum, normal)| *sum += wi.dot(normal).max(0.0) * arriving);
    }
    sums
}

fn floor_under(sky: Sky) -> Scene {
    scene_of(vec![level(0.0, [4.0, 4.0], true, 0)], vec![matt(0.0)], vec![LightKind::Sky(Arc::new(sky))])
}

fn settings(illumination: Illumination) -> SceneSettings {
    SceneSettings { photons: 40_000, rounds: 32, illumination, ..by_rounds() }
}

/// Direct light of a sky by shadow rays alone. Where there is no opening rays are aimed at none, and kernels are made sooner.
fn by_shadow_rays() -> SceneSettings {
    SceneSettings { part: Part::Direct, aim: false, ..settings(Illumination::Split) }
}

/// Colours of the irradiance on surfaces that face all ways, beside a small floor.
pub fn facing_all_ways(gpu: &Gpu) -> Check<Complaint> {
    // Light that is wrong somewhere says more than noise.
    let mut noisy = None;
    for (width, sun, degrees) in [(2, 0.0, 0.0), (64, 0.0, 30.0), (64, 3000.0, 0.0), (256, 50_000.0, -100.0)] {
        let sky = sunny(width, sun).turned(degrees);
        let scene = scene_of(vec![level(-0.5, [1e-3; 2], true, 0)], vec![matt(0.0)], vec![LightKind::Sky(Arc::new(sky.clone()))]);
        let normals = [DVec3::Y, DVec3::X, DVec3::Z, dvec3(-0.6, 0.0, 0.8), DVec3::NEG_Y];
        let points = normals.map(|normal| (DVec3::ZERO, normal));
        let result = received(gpu, &scene, &SceneSettings { shadow_rays: 16, ..settings(Illumination::Split) }, &points);
        for ((point, normal), exact) in normals.into_iter().enumerate().zip(irradiances(&sky, normals)) {
            let (found, error) = (result.film.mean(point), result.film.standard_error(point));
            for channel in 0..3 {
                let (found, error, exact) = (found[channel], error[channel], exact[channel]);
                let what = format!("{width} pixels, sun {sun}, {degrees} degrees, {normal}, channel {channel}");
                println!("{what}: {found} +- {error}, {exact} expected");
                // The sum over directions errs a little about a sun.
                estimate_check(&what, found, exact, error.hypot(1e-3 * exact))?;
                if error > 0.1 * exact {
                    noisy.get_or_insert(Complaint::new(Kind::TooNoisy, format!("{what}: {found} +- {error}")));
                }
            }
        }
    }
    noisy.map_or(Ok(()), Err)
}

/// Photons and shadow rays bring the same.
pub fn photons_and_rays(gpu: &Gpu) -> Check<Complaint> {
    let sky = sunny(64, 3000.0).turned(20.0);
    let [exact] = irradiances(&sky, [DVec3::Y]);
    let scene = floor_under(sky);
    let points = [(DVec3::ZERO, DVec3::Y), (dvec3(0.5, 0.0, -0.3), DVec3::Y)];
    for illumination in BOTH {
        let result = received(gpu, &scene, &settings(illumination), &points);
        for point in 0..points.len() {
            let (found, error) = red(&result, point);
            estimate_check(&format!("{illumination:?}, point {point}"), found, exact.x, error.hypot(1e-3 * exact.x))?;
            require(error < 0.2 * exact.x, || format!("{found} +- {error}")).map_err(|text| Complaint::new(Kind::TooNoisy, text))?;
        }
    }
    Ok(())
}

#[test]
fn every_builder_has_the_same_photons_of_a_picture() {
    let Some(gpu) = device() else { return };
    assert_builders_agree(&gpu, &floor_under(sunny(64, 3000.0)), &settings(Illumination::Photons), &[(DVec3::ZERO, DVec3::Y)]);
}

/// A scene with a ball of glass, a mirror and layered plates under a picture: each part is what the path tracer finds.
#[test]
fn every_part_of_the_light_is_what_the_path_tracer_finds() {
    let Some(gpu) = device() else { return };
    let meshes = vec![
        level(0.0, [4.0, 4.0], true, 0),
        Mesh::sphere("glass", dvec3(0.0, 0.5, 0.0), 0.4, 32, 1),
        Mesh::parallelogram("mirror", dvec3(-1.5, 0.0, -1.5), DVec3::X * 3.0, DVec3::Y * 1.5, 2),
        Mesh::sphere("coat", dvec3(1.0, 0.3, 0.3), 0.3, 24, 3),
    ];
    let layered = Material { surface: Surface::Layered, ..matt(0.6) };
    let scene = scene_of(meshes, vec![matt(0.5), glass(1.5), mirror(0.9), layered], vec![LightKind::Sky(Arc::new(sunny(16, 40.0)))]);
    let camera = Camera::looking_at("eye", dvec3(0.5, 1.6, 2.8), dvec3(0.0, 0.3, 0.0), DVec3::Y, 0.8);
    let image = Judge::new(&scene, 32).image(&camera, 12, 9, 2000, 1);
    // Sums over the picture, whose errors are known from runs of other seeds.
    let runs: Vec<_> = (1..=16)
        .map(|seed| {
            let settings = SceneSettings { photons: 30_000, caustic_photons: 30_000, rounds: 4, seed, ..by_rounds() };
            let result = render(&gpu, &scene, &settings, Receivers::Image(&camera, [12, 9])).unwrap();
            let unit = result.plan.film.scale * f64::from(result.film.rounds);
            result.film.part_totals.iter().map(|total| *total as f64 / unit).collect::<Vec<_>>()
        })
        .collect();
    let mut family = Family::default();
    for (number, part) in Part::EACH.into_iter().enumerate() {
        let (found, own) = mean_and_error(&runs.iter().map(|run| run[number]).collect::<Vec<_>>());
        let expected = image.pixels.iter().map(|pixel| pixel.mean[part].element_sum()).sum::<f64>();
        let judged = image.pixels.iter().map(|pixel| pixel.standard_error[part].element_sum().powi(2)).sum::<f64>().sqrt();
        assert!(own.hypot(judged) < 0.1 * expected, "{part:?}: {expected} +- {judged}, {own}");
        family.expect_estimate(format!("{part:?}"), found, own.hypot(judged).hypot(0.005 * expected), runs.len() as u32, expected);
    }
    family.assert_detects(0.4, |_| true);
}

/// Where the sun itself shines in, rays that are aimed at the window take none from those that are aimed at the sun.
pub fn a_sun_that_shines_in_has_as_many_rays_as_without_openings(gpu: &Gpu, albedo: f32) {
    // 11 degrees from the vertical, so that its light falls on the floor half a metre beside the middle.
    let (i_sun, j_sun) = (160, 8);
    let picture = sky(256, 128, |i, j| if (i, j) == (i_sun, j_sun) { Vec3::splat(20_000.0) } else { Vec3::ONE });
    let (angle, turn) = (PI * (f64::from(j_sun) + 0.5) / 128.0, TAU * ((f64::from(i_sun) + 0.5) / 256.0 - 0.5));
    let middle = -3.0 * angle.tan() * dvec3(turn.cos(), 0.0, turn.sin());
    let near = |x: i32| (-2..=2).map(move |z| (middle + 0.1 * dvec3(f64::from(x), 0.0, f64::from(z)), DVec3::Y));
    let points: Vec<_> = (-2..=2).flat_map(near).collect();
    let scene = room_under(albedo, LightKind::Sky(Arc::new(picture)));
    let [aimed, other] = [true, false].map(|aim| {
        let settings = SceneSettings { rounds: 64, ..direct(aim) };
        render(gpu, &scene, &settings, Receivers::Points(&points)).unwrap()
    });
    assert!(aimed.plan.trial.as_ref().is_some_and(|trial| !trial.openings.is_empty()));
    let [little, much] = [&aimed, &other].map(|result| result.film.relative_error());
    println!("{:.2} % and {:.2} %", 100.0 * little, 100.0 * much);
    assert!(little < 1.1 * much, "{little} and {much}");
    for point in 0..points.len() {
        let ((a, own), (b, others)) = (red(&aimed, point), red(&other, point));
        assert_holds(format!("point {point}"), z_check("aimed", a, b, own.hypot(others)));
    }
}

/// A patch of sun among points that see the sky alone keeps its shadow rays, though aimed rays find the sky from all of them. What grey
/// walls scatter is not asked for, but has its photons in the trial.
pub fn a_patch_of_sun_keeps_its_rays(gpu: &Gpu, albedo: f32) {
    let way = dvec3(0.25, -1.0, 0.1).normalize();
    let mut scene = room_under(albedo, LightKind::Sky(Arc::new(sky(4, 2, |_, _| Vec3::splat(300.0)))));
    scene.lights.push(lamp(LightKind::Directional { direction: way, irradiance: Vec3::splat(100.0) }));
    // Too few lie in the sun to make a region of their own.
    let points: Vec<_> = grid(0.0, DVec3::Y, 9).into_iter().map(|(at, up)| (3.8 * at, up)).collect();
    let result = render(gpu, &scene, &direct(true), Receivers::Points(&points)).unwrap();
    let error = result.film.relative_error();
    println!("{:.2} %", 100.0 * error);
    // 1.8 times as much where all points count alike in the choice of lights.
    assert!(error < 0.115, "{error}");
}

/// A sky that is black, or almost, makes no number that is none, on a bare floor or one below a ball of glass.
fn skies_leave_no_odd_number(settings: &SceneSettings, has_glass: bool) {
    let Some(gpu) = device() else { return };
    let ball = Mesh::sphere("ball", dvec3(0.0, 0.5, 0.0), 0.4, 16, 1);
    for (width, height, bright) in [(1, 1, 0), (3, 2, 9), (64, 32, 64 * 20 + 5), (512, 1, 100)] {
        let picture = sky(width, height, |i, j| if j * width + i == bright { Vec3::splat(1e12) } else { Vec3::ZERO });
        let mut scene = floor_under(picture);
        if has_glass {
            scene.materials.push(glass(1.5));
            scene.meshes.push(ball.clone());
        }
        let settings = SceneSettings { rounds: 2, photons: 2000, caustic_photons: 2000, ..settings.clone() };
        let result = received(&gpu, &scene, &settings, &[(DVec3::X, DVec3::Y)]);
        assert!(result.film.mean(0).is_finite(), "{width} x {height}");
    }
}

/// By photons and by shadow rays, with the kernels of other tests here.
#[test]
fn black_skies_and_single_texels_leave_no_odd_number() {
    skies_leave_no_odd_number(&settings(Illumination::Photons), false);
    skies_leave_no_odd_number(&by_shadow_rays(), false);
    if is_long_run() {
        skies_leave_no_odd_number(&by_rounds(), true);
        skies_leave_no_odd_number(&SceneSettings { aim: true, ..by_shadow_rays() }, false);
    }
}

/// Each channel of an even sky lights a floor by what it is, whatever the ratio to the others.
#[test]
fn weak_channels_of_a_sky_keep_their_light() {
    let Some(gpu) = device() else { return };
    let colours = [[1000.0, 1.0, 0.3], [10.0, 2.0, 0.3], [1.0, 0.25, 0.002], [1.0, 1e-4, 1e-4]].map(Vec3::from);
    let ways = [false, true].into_iter().take(of_run(1, 2));
    for (aim, colour) in ways.flat_map(|aim| colours.map(|colour| (aim, colour))) {
        let settings = SceneSettings { rounds: 1, aim, ..by_shadow_rays() };
        let result = received(&gpu, &floor_under(sky(4, 2, |_, _| colour)), &settings, &[(DVec3::ZERO, DVec3::Y)]);
        let share = result.film.mean(0) / (PI * colour.as_dvec3());
        println!("{colour}: {share}");
        assert!((share - 1.0).abs().max_element() < 1e-3, "{colour}: {share}");
    }
}

/// A bright red sun, which many rays have met, leaves green and blue of its sky the errors that they have.
#[test]
fn a_sun_of_one_colour_leaves_the_others_their_errors() {
    let Some(gpu) = device() else { return };
    let colour = DVec3::new(0.0, 0.5, 0.01);
    let red = sky(64, 32, |i, j| if (i, j) == (15, 5) { Vec3::X * 1e5 } else { colour.as_vec3() });
    let settings = SceneSettings { rounds: 64, ..by_shadow_rays() };
    let result = received(&gpu, &floor_under(red), &settings, &[(DVec3::ZERO, DVec3::Y)]);
    let (found, error) = (result.film.mean(0), result.film.stated_errors()(0));
    println!("a red sun: {found} +- {error}");
    for channel in [1, 2] {
        let exact = PI * colour[channel];
        assert!((found[channel] - exact).abs() < 0.05 * exact && error[channel] < 0.2 * exact, "channel {channel}: {found} +- {error}");
    }
}

/// A sun that takes up little of a pixel: of the picture's sky itself, behind a sheet of which half is a gap, and behind the back of a sheet
/// of one side.
#[test]
fn a_sun_in_one_pixel_is_seen() {
    let Some(gpu) = device() else { return };
    const WIDTH: u32 = 512;
    let (i_sun, j_sun) = (WIDTH / 2 + 7, WIDTH / 4 - 9);
    let picture = sky(WIDTH, WIDTH / 2, |i, j| Vec3::splat(if (i, j) == (i_sun, j_sun) { 1e7 } else { 0.2 }));
    let step = PI / f64::from(WIDTH / 2);
    let direction = |x: f64, y: f64| {
        let (angle, turn) = (step * y, step * x - PI);
        dvec3(angle.sin() * turn.cos(), angle.cos(), angle.sin() * turn.sin())
    };
    let camera = Camera::looking_at("eye", DVec3::ZERO, DVec3::X, DVec3::Y, 1.0);
    const SIZE: u32 = 9;
    // Over the sun's tent, by its place in the picture: of the pixel's light each direction has its share of the pixel's solid angle.
    let edge = 2.0 * camera.half_height() / f64::from(SIZE);
    const PARTS: u32 = 64;
    let part = 2.0 / f64::from(PARTS);
    let (mut expected, mut pixels) = (0.0, HashSet::new());
    for (a, b) in (0..PARTS).flat_map(|a| (0..PARTS).map(move |b| (a, b))) {
        let [x, y] = [(a, i_sun), (b, j_sun)].map(|(part_number, texel)| f64::from(texel) - 0.5 + part * (f64::from(part_number) + 0.5));
        let wi = direction(x, y);
        let solid_angle = (step * part).powi(2) * (step * y).sin();
        expected += picture.radiance(wi).x * solid_angle / (edge * edge * wi.x.powi(3));
        let place = DVec2::new(wi.dot(camera.right), -wi.dot(camera.up)) / (wi.x * edge) + 0.5 * f64::from(SIZE);
        pixels.insert(place.floor().as_uvec2().to_array());
    }
    let pixels: Vec<usize> = pixels.into_iter().map(|[x, y]| (y * SIZE + x) as usize).collect();
    let sheet = |x: f64, faces_eye: bool, material: usize| {
        let (u, v) = (8.0 * DVec3::Y, 8.0 * DVec3::Z);
        let (u, v) = if faces_eye { (v, u) } else { (u, v) };
        Mesh::parallelogram("sheet", x * DVec3::X - 0.5 * (u + v), u, v, material)
    };
    let layered = |coverage, two_sided| Material { surface: Surface::Layered, coverage, two_sided, ..matt(0.0) };
    let materials = vec![layered(Coverage::Blend { alpha: 0.5 }, true), layered(Coverage::Whole, false)];
    for (what, meshes, share) in [
        ("bare", vec![sheet(-1.0, true, 0)], 1.0),
        ("half a sheet", vec![sheet(1.0, true, 0)], 0.5),
        ("a back", vec![sheet(1.0, false, 1), sheet(-1.0, true, 0)], 1.0),
        ("a front", vec![sheet(1.0, true, 1), sheet(-1.0, true, 0)], 0.0),
    ] {
        let scene = scene_of(meshes, materials.clone(), vec![LightKind::Sky(Arc::new(picture.clone()))]);
        // Sheets are black. Kernels have the effects of these sheets and no others.
        let without = vec![Effect::Indirect, Effect::ReflectiveCaustics, Effect::RefractiveCaustics];
        let settings = SceneSettings { samples: 16, rounds: 32, without, aim: false, ..by_rounds() };
        let result = render(&gpu, &scene, &settings, Receivers::Image(&camera, [SIZE; 2])).unwrap();
        let found = pixels.iter().map(|pixel| result.film.mean(*pixel).x).sum::<f64>();
        let error = pixels.iter().map(|pixel| result.film.standard_error(*pixel).x.powi(2)).sum::<f64>().sqrt();
        println!("{what}: {found} +- {error}, {} expected in {} pixels", share * expected, pixels.len());
        assert!((found - share * expected).abs() < 4.0 * error + 0.005 * share * expected + 1e-4, "{what}: {found} +- {error}");
        assert!(error <= 0.06 * expected, "{what}: {found} +- {error}");
    }
}
