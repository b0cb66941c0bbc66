//! Mirrors and glass against closed forms: Snell's and Fresnel's laws along rays from the eye and by photons, total
//! reflection, a corridor of mirrors, a paraboloid and its focus.

use crate::common::prelude::*;

const IOR: f64 = 1.5;

/// Sine of the refracted ray (Snell).
fn refracted(angle: f64, ior: f64) -> f64 {
    (angle.sin() / ior).asin()
}

/// Reflectance of unpolarised light, the mean of sin^2(i - t) / sin^2(i + t) and tan^2(i - t) / tan^2(i + t) (Fresnel;
/// Born and Wolf 1.5.2); from the inside `ior` is the reciprocal.
fn reflectance(angle: f64, ior: f64) -> f64 {
    if angle.sin() >= ior {
        return 1.0;
    }
    if angle == 0.0 {
        return ((ior - 1.0) / (ior + 1.0)).powi(2);
    }
    let other = refracted(angle, ior);
    let (difference, sum) = (angle - other, angle + other);
    0.5 * ((difference.sin() / sum.sin()).powi(2) + (difference.tan() / sum.tan()).powi(2))
}

/// A ray from above in the plane z = 0, at this angle to the vertical: where it starts, to pass the origin, and its
/// direction.
fn slanting(angle: f64, distance: f64) -> (DVec3, DVec3) {
    let direction = DVec3::new(angle.sin(), -angle.cos(), 0.0);
    (-distance * direction, direction)
}

/// No photons: rays from the eye alone.
fn rays(rounds: u32) -> SceneSettings {
    SceneSettings { photons: 1, caustic_photons: 1, bounces: 1, shadow_rays: 1, part: Part::Specular, rounds, ..by_rounds() }
}

/// What a smooth surface reflects of an even sky, with nothing but black below: F = 0.04 at normal incidence, 0.0892 at
/// 60, 0.388 at 80, 0.904 at 89 degrees, for an index of 1.5; and (1 / 3)^2 for one of 2. One path a pixel
/// chooses reflection with the chance F, so that 1 % of 0.04 would take eight million rays: of that there are several
/// paths a pixel, some of which look for what is reflected whatever F is.
#[test]
fn glass_reflects_as_fresnel_says() {
    let Some(gpu) = device() else { return };
    let mut family = Family::default();
    for (degrees, ior, rounds, samples) in [(0.0, 2.0, 32u32, 1), (0.0, IOR, 2, 4), (60.0, IOR, 2, 4), (80.0, IOR, 8, 1), (89.0, IOR, 4, 1)]
    {
        let angle = f64::to_radians(degrees);
        let size = [300.0; 2];
        let scene = scene_of(
            vec![level(0.0, size, true, 0), level(-1.0, [600.0; 2], true, 1)],
            vec![glass(ior as f32), matt(0.0)],
            vec![LightKind::Environment { radiance: Vec3::ONE }],
        );
        let (eye, _) = slanting(angle, 100.0);
        let found = radiances(&gpu, &scene, &SceneSettings { samples, ..rays(rounds) }, eye, DVec3::ZERO, 256);
        family.expect_mean(format!("reflected, index {ior}, {degrees} degrees"), &found, reflectance(angle, ior));
    }
    family.assert_tells_one_per_cent();
}

/// From inside, a lamp below is seen whole in the surface above beyond the critical angle of 41.81 degrees, and by F
/// short of it; a lamp above, in the air, by (1 - F) n^2, as radiance is compressed.
#[test]
fn glass_reflects_totally_beyond_the_critical_angle() {
    let Some(gpu) = device() else { return };
    let mut family = Family::default();
    for degrees in [41.0, 41.7, 41.9, 60.0, 85.0] {
        let angle = f64::to_radians(degrees);
        let scene =
            scene_of(vec![level(0.0, [40.0; 2], true, 0), level(-1.0, [40.0; 2], true, 1)], vec![glass(IOR as f32), shining(0.0)], vec![]);
        let eye = DVec3::new(-0.5 * angle.tan(), -0.5, 0.0);
        let found = radiances(&gpu, &scene, &rays(8), eye, DVec3::ZERO, 256);
        let expected = reflectance(angle, 1.0 / IOR);
        assert!(degrees < 41.8 || expected == 1.0);
        family.expect_mean(format!("reflected inside, {degrees} degrees"), &found, expected);
    }
    for degrees in [0.0, 30.0, 41.0] {
        let angle = f64::to_radians(degrees);
        let scene =
            scene_of(vec![level(0.0, [40.0; 2], true, 0), level(1.0, [40.0; 2], false, 1)], vec![glass(IOR as f32), shining(0.0)], vec![]);
        let eye = DVec3::new(-0.5 * angle.tan(), -0.5, 0.0);
        let found = radiances(&gpu, &scene, &rays(8), eye, DVec3::ZERO, 256);
        family.expect_mean(format!("seen from inside, {degrees} degrees"), &found, IOR * IOR * (1.0 - reflectance(angle, 1.0 / IOR)));
    }
    family.assert_tells_one_per_cent();
}

/// Through a slab of thickness d a ray goes on parallel to itself, d (tan i - tan t) short of where it was heading, so
/// that a narrow lamp is seen there, by (1 - F)^2, and again 2 d tan t further after two reflections inside, by
/// (1 - F)^2 F^2; everywhere else is dark. All of a wide lamp is (1 - F) / (1 + F). Pixels draw the same numbers at
/// every angle, so that the errors go together.
fn slabs_shift_slanting_rays(rounds_inside: u32, told_inside: f64) {
    let Some(gpu) = device() else { return };
    let mut family = Family::default();
    let (thickness, below) = (0.2, 0.4);
    for (degrees, rounds) in [(45.0, 4u32), (60.0, 4), (80.0, 8)] {
        let angle = f64::to_radians(degrees);
        let inside = refracted(angle, IOR);
        let slab = |lamp: Mesh| {
            let size = [40.0; 2];
            scene_of(
                vec![level(0.0, size, true, 0), level(-thickness, size, false, 0), lamp],
                vec![glass(IOR as f32), shining(0.0)],
                vec![],
            )
        };
        let (eye, _) = slanting(angle, 3.0);
        let see_on = |scene: &Scene, rounds, side| radiances(&gpu, scene, &rays(rounds), eye, DVec3::ZERO, side);
        let see = |scene: &Scene, rounds| see_on(scene, rounds, 256);
        let wide = slab(level(-below, [40.0; 2], true, 1));
        let f = reflectance(angle, IOR);
        family.expect_mean(format!("slab at {degrees} degrees, wide lamp"), &see(&wide, rounds), (1.0 - f) / (1.0 + f));
        let arrives = thickness * inside.tan() + (below - thickness) * angle.tan();
        let again = 2.0 * thickness * inside.tan();
        let strip = |middle: f64| {
            let mut lamp = level(-below, [0.05, 1.0], true, 1);
            lamp.positions.iter_mut().for_each(|position| position.x += middle);
            slab(lamp)
        };
        family.expect_mean(format!("slab at {degrees} degrees, narrow lamp"), &see(&strip(arrives), rounds), (1.0 - f).powi(2));
        if degrees == 80.0 {
            // One path in eighteen comes this way.
            let twice = see(&strip(arrives + again), rounds_inside);
            family.expect_mean(format!("slab at {degrees} degrees, reflected inside"), &twice, ((1.0 - f) * f).powi(2));
        }
        for beside in [arrives - 0.06, arrives + 0.06, below * angle.tan()] {
            assert!(see_on(&strip(beside), 1, 32).iter().all(|seen| *seen == 0.0), "{degrees} degrees: light at {beside} m");
        }
    }
    let is_rare = |what: &str| what.ends_with("reflected inside");
    family.assert_tells(0.01, |what| !is_rare(what));
    family.assert_tells(told_inside, is_rare);
}

#[test]
fn a_slab_shifts_a_slanting_ray() {
    slabs_shift_slanting_rays(14, 0.03);
}

#[test]
#[ignore = "half a minute on a software device"]
fn a_slab_shifts_a_slanting_ray_to_one_per_cent() {
    slabs_shift_slanting_rays(110, 0.01);
}

/// Share of evenly scattered light that a surface lets through from outside: the integral of (1 - F) 2 sin cos.
fn let_in(ior: f64) -> f64 {
    let steps = 100_000;
    (0..steps)
        .map(|k| FRAC_PI_2 * (f64::from(k) + 0.5) / f64::from(steps))
        .map(|angle| (1.0 - reflectance(angle, ior)) * (2.0 * angle).sin() * FRAC_PI_2 / f64::from(steps))
        .sum()
}

/// A shaft of perfect mirrors is infinitely wide. Half of it is glass: of even light 0.908222 enters it, and
/// 0.908222 / n^2 = 0.403654 leaves it (flux is not compressed, unlike radiance); the rest returns to the black lamp.
#[test]
fn even_light_crosses_a_surface_of_glass() {
    let Some(gpu) = device() else { return };
    let entering = let_in(IOR);
    assert!((entering - 0.908_222_0).abs() < 1e-6, "{entering}");
    let leaving = entering / (IOR * IOR);
    let mut family = Family::default();
    for (what, share, lamp_below) in [("into glass", entering, false), ("out of glass", leaving, true)] {
        let (lamp, wall) = (1, 2);
        let mut meshes = shaft(-0.5, 0.5, 3);
        meshes.push(level(0.0, [1.0; 2], true, 0));
        meshes.push(level(-0.5, [1.0; 2], true, if lamp_below { lamp } else { wall }));
        meshes.push(level(0.5, [1.0; 2], false, if lamp_below { wall } else { lamp }));
        let scene = scene_of(meshes, vec![glass(IOR as f32), shining(0.0), matt(0.0), mirror(1.0)], vec![]);
        let (floor, ceiling) = (grid(-0.5, DVec3::Y, 6), grid(0.5, DVec3::NEG_Y, 6));
        let points = if lamp_below { [ceiling, floor] } else { [floor, ceiling] }.concat();
        for illumination in BOTH {
            // More than n hits of the sides lie ahead of a ray with the chance 1.6 / n^2: 4e-4 of the light is left out.
            let settings = fixed_radius(illumination, 40_000, 1, 64, 0.1);
            assert_builders_agree(&gpu, &scene, &settings, &points);
            let runs = irradiances(&gpu, &scene, &settings, &points, 1..25);
            for (where_, of_points, expected) in [("beyond", 0..36, share), ("back", 36..72, 1.0 - share)] {
                let mean = |run: &Vec<DVec3>| run[of_points.clone()].iter().map(|light| light.x).sum::<f64>() / of_points.len() as f64;
                family.expect_mean(
                    format!("{what}, {illumination:?}: {where_}"),
                    &runs.iter().map(mean).collect::<Vec<_>>(),
                    PI * expected,
                );
            }
        }
    }
    // What returns into the air is so little of the light that it notices less.
    family.assert_tells(0.01, |what| !what.contains("into glass") || what.contains("beyond"));
}

/// A spot light between two mirrors of reflectance 0.8, 1 m before the end of their corridor: the end is lit by all
/// images, sum of 0.8^|n| I cos / d^2 over those whose ray leaves the lamp within its cone. Photons tell the mean over
/// a disc, here by a raster whose error is below 1e-4; shadow rays add the lamp's own part at the middle.
#[test]
fn images_light_the_end_of_a_corridor() {
    let Some(gpu) = device() else { return };
    let (z, off, angle) = (1.0, 0.1, 1.0f64);
    let (side, length) = (1.0, 3.0);
    let corner = DVec3::new(-0.5, -side, 0.0);
    let (up, along) = (DVec3::Y * 2.0 * side, DVec3::Z * length);
    let scene = scene_of(
        vec![
            Mesh::parallelogram("left", corner, up, along, 0),
            Mesh::parallelogram("right", corner + DVec3::X, along, up, 0),
            Mesh::parallelogram("end", corner, DVec3::X, up, 1),
        ],
        vec![mirror(0.8), matt(0.0)],
        vec![cone(DVec3::new(off, 0.0, z), DVec3::NEG_Z, angle as f32)],
    );
    let image = |n: i32, x: f64, y: f64| {
        let from = f64::from(n) + if n % 2 == 0 { off } else { -off };
        let squared = (x - from).powi(2) + y * y + z * z;
        let cosine = z / squared.sqrt();
        if cosine > angle.cos() { 0.8f64.powi(n.abs()) * cosine / squared } else { 0.0 }
    };
    let radius = 0.49;
    let over_disc = |images: &dyn Fn(f64, f64) -> f64| {
        let steps = 400;
        let place = |k: i32| ((f64::from(k) + 0.5) / f64::from(steps) * 2.0 - 1.0) * radius;
        let (mut sum, mut count) = (0.0, 0.0);
        for (x, y) in (0..steps * steps).map(|k| (place(k % steps), place(k / steps))) {
            if x * x + y * y <= radius * radius {
                sum += images(x, y);
                count += 1.0;
            }
        }
        sum / count
    };
    let reflected = over_disc(&|x, y| (-9..=9).filter(|n| *n != 0).map(|n| image(n, x, y)).sum());
    let mut family = Family::default();
    for illumination in BOTH {
        let settings = SceneSettings { caustic_photons: 80_000, ..fixed_radius(illumination, 40_000, 32, 8, radius) };
        let points = [(DVec3::ZERO, DVec3::Z)];
        assert_builders_agree(&gpu, &scene, &settings, &points);
        let lit = received(&gpu, &scene, &settings, &points);
        let own = if illumination == Illumination::Split { image(0, 0.0, 0.0) } else { over_disc(&|x, y| image(0, x, y)) };
        let (mean, error) = red(&lit, 0);
        family.expect_estimate(format!("corridor, {illumination:?}"), mean, error, 32, own + reflected);
    }
    family.assert_tells_one_per_cent();
}

const FOCUS: f64 = 0.5;
const APERTURE: f64 = 0.5;
const SEGMENTS: u32 = 192;

/// The mirror y = r^2 / 4 f up to r = f, with its focus at (0, f, 0): rings of triangles with the paraboloid's normals.
fn paraboloid(material: usize) -> Mesh {
    let rings = SEGMENTS / 2;
    let mut mesh = Mesh { name: "paraboloid".into(), material, ..Mesh::default() };
    for ring in 0..=rings {
        let r = APERTURE * f64::from(ring) / f64::from(rings);
        for segment in 0..SEGMENTS {
            let (sin, cos) = (TAU * f64::from(segment) / f64::from(SEGMENTS)).sin_cos();
            mesh.positions.push(DVec3::new(r * cos, r * r / (4.0 * FOCUS), r * sin));
            mesh.normals.push(DVec3::new(-r / (2.0 * FOCUS) * cos, 1.0, -r / (2.0 * FOCUS) * sin).normalize());
        }
    }
    let vertex = |ring: u32, segment: u32| ring * SEGMENTS + segment % SEGMENTS;
    for ring in 0..rings {
        for segment in 0..SEGMENTS {
            let [a, b, c, d] = [vertex(ring, segment), vertex(ring + 1, segment), vertex(ring + 1, segment + 1), vertex(ring, segment + 1)];
            mesh.triangles.push([a, c, b]);
            if ring > 0 {
                mesh.triangles.push([a, d, c]);
            }
        }
    }
    mesh
}

fn caustics(illumination: Illumination, photons: u32, radius: f64) -> SceneSettings {
    SceneSettings { part: Part::Caustic, ..fixed_radius(illumination, photons, 24, 4, radius) }
}

/// Light from the focus leaves a paraboloid parallel to its axis, so that a plane across it has the same irradiance at
/// any distance: what leaves at the angle a to the axis arrives at r = 2 f tan(a / 2), hence
/// I / f^2 / (1 + r^2 / 4 f^2)^2, and as the mean over a disc of radius h, which photons tell,
/// I / f^2 / (1 + h^2 / 4 f^2).
#[test]
fn light_from_a_focus_leaves_in_parallel() {
    let Some(gpu) = device() else { return };
    let mut family = Family::default();
    let h: f64 = 0.4;
    let expected = 0.9 / (FOCUS * FOCUS) / (1.0 + h * h / (4.0 * FOCUS * FOCUS));
    for distance in [1.0, 4.0] {
        let lamp = cone(DVec3::Y * FOCUS, DVec3::NEG_Y, 1.0);
        let scene = scene_of(vec![paraboloid(0), level(distance, [2.0; 2], false, 1)], vec![mirror(0.9), matt(0.0)], vec![lamp]);
        for illumination in BOTH {
            let (settings, points) = (caustics(illumination, 12_000, h), [(DVec3::Y * distance, DVec3::NEG_Y)]);
            assert_builders_agree(&gpu, &scene, &settings, &points);
            let lit = received(&gpu, &scene, &settings, &points);
            let (mean, error) = red(&lit, 0);
            family.expect_estimate(format!("{distance} m off, {illumination:?}"), mean, error, 24, expected);
        }
    }
    family.assert_tells_one_per_cent();
}

/// All sunlight that enters a paraboloid along its axis passes its focus: through a disc of 1 cm there goes what the
/// opening receives, less the shadow of the little plate that is asked.
#[test]
fn sunlight_meets_in_the_focus() {
    let Some(gpu) = device() else { return };
    let mut family = Family::default();
    let (plate, radius) = (0.06, 0.01);
    let opening = 0.5 * f64::from(SEGMENTS) * APERTURE * APERTURE * (TAU / f64::from(SEGMENTS)).sin();
    // The plate's own back is black, and it takes its light away before the mirror.
    let scene = scene_of(vec![paraboloid(0), level(FOCUS, [plate; 2], false, 1)], vec![mirror(0.9), matt(0.0)], vec![sun(DVec3::NEG_Y)]);
    let expected = 0.9 * (opening - plate * plate) / (PI * radius * radius);
    for illumination in BOTH {
        let (settings, points) = (caustics(illumination, 20_000, radius), [(DVec3::Y * FOCUS, DVec3::NEG_Y)]);
        assert_builders_agree(&gpu, &scene, &settings, &points);
        let lit = received(&gpu, &scene, &settings, &points);
        let (mean, error) = red(&lit, 0);
        family.expect_estimate(format!("in the focus, {illumination:?}"), mean, error, 24, expected);
    }
    family.assert_tells_one_per_cent();
}

/// An eye in the focus looks along the axis wherever it looks into the mirror: at the angle a it sees what lies
/// 2 f tan(a / 2) off the axis, at any distance.
#[test]
fn an_eye_in_the_focus_looks_in_parallel() {
    let Some(gpu) = device() else { return };
    let mut family = Family::default();
    for (degrees, distance) in [(20.0, 2.0), (40.0, 2.0), (40.0, 30.0)] {
        let angle = f64::to_radians(degrees);
        let off = 2.0 * FOCUS * (0.5 * angle).tan();
        let see = |middle: f64| {
            let mut lamp = level(distance, [0.02, 2.0], false, 1);
            lamp.positions.iter_mut().for_each(|position| position.x += middle);
            let scene = scene_of(vec![paraboloid(0), lamp], vec![mirror(0.9), shining(0.0)], vec![]);
            let eye = DVec3::Y * FOCUS;
            radiances(&gpu, &scene, &rays(1), eye, eye + DVec3::new(angle.sin(), -angle.cos(), 0.0), 32)
        };
        family.expect_mean(format!("{degrees} degrees, {distance} m off"), &see(off), 0.9);
        for beside in [-0.02, 0.02] {
            assert!(see(off + beside).iter().all(|seen| *seen == 0.0), "{degrees} degrees, {distance} m off: light {beside} m beside");
        }
    }
    family.assert_tells_one_per_cent();
}
