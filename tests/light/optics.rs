//! Mirrors and glass against closed forms: Snell's and Fresnel's laws along rays from the eye and by photons, total
//! reflection, a corridor of mirrors, a paraboloid and its focus.

use crate::common::known::kept;
use crate::common::prelude::*;
use photonmill::verify::judge::fresnel;

const IOR: f64 = 1.5;

/// Sine of the refracted ray (Snell).
fn refracted(angle: f64, ior: f64) -> f64 {
    (angle.sin() / ior).asin()
}

/// Reflectance of unpolarised light (Fresnel; `tests/light/judge.rs` has its special values); from the inside `ior` is the reciprocal.
fn reflectance(angle: f64, ior: f64) -> f64 {
    fresnel(angle.cos(), 1.0, ior)
}

/// Where a ray from above in the plane z = 0, at this angle to the vertical, starts to pass the origin.
fn slanting(angle: f64, distance: f64) -> DVec3 {
    distance * DVec3::new(-angle.sin(), angle.cos(), 0.0)
}

/// Kernels for all scenes here: what a scene lacks changes no bit (`tests/light/transport.rs`).
fn optics(settings: SceneSettings) -> SceneSettings {
    kept(SceneSettings { aim: false, with: vec![Effect::SpecularChains, Effect::SmoothNormals], ..settings })
}

/// No photons: rays from the eye alone.
fn rays(rounds: u32) -> SceneSettings {
    let without = vec![Effect::Indirect, Effect::ReflectiveCaustics, Effect::RefractiveCaustics];
    optics(SceneSettings { photons: 1, caustic_photons: 1, shadow_rays: 1, part: Part::Specular, rounds, without, ..by_rounds() })
}

/// Rays that all but coincide, all channels: one for each pixel of a picture.
fn along(gpu: &Gpu, scene: &Scene, eye: DVec3, side: u32) -> Vec<DVec3> {
    let camera = Camera::looking_at("ray", eye, DVec3::ZERO, DVec3::Z, 1e-6);
    means(&seen(gpu, scene, &rays(1), &camera, [side, side]))
}

/// Mean of a channel where nothing is random: what emits light behind a surface is seen by all its ways at once. Near the critical angle
/// single precision knows a direction to a thousandth of what it lets through.
fn expect_exactly(family: &mut Family, what: String, found: &[DVec3], channel: usize, exact: f64) {
    let mean = found.iter().map(|seen| seen[channel]).sum::<f64>() / found.len() as f64;
    family.expect(what, mean, exact, 1e-3 * exact);
}

/// A surface of glass under an even green sky, over a black or a red lamp that is this deep.
fn over_glass(ior: f64, depth: f64, red: f32) -> Scene {
    let lamp = Material { emission: Vec3::X * red, ..matt(0.0) };
    let meshes = vec![level(0.0, [4.0; 2], true, 0), level(-depth, [80.0; 2], true, 1)];
    scene_of(meshes, vec![glass(ior as f32), lamp], vec![LightKind::Environment { radiance: Vec3::Y }])
}

/// What a smooth surface reflects of an even sky, with nothing but black below, up to the horizon: F = 0.04, 0.0892, 0.388, 0.904 and
/// 0.99899 at 0, 60, 80, 89 and 89.99 degrees, for an index of 1.5; and (1 / 3)^2 for one of 2.
#[test]
fn glass_reflects_by_fresnel_up_to_the_horizon() {
    let Some(gpu) = device() else { return };
    let mut family = Family::default();
    for (degrees, ior) in [(0.0, 2.0), (0.0, IOR), (60.0, IOR), (80.0, IOR), (89.0, IOR), (89.9, IOR), (89.99, IOR)] {
        let angle = f64::to_radians(degrees);
        let found = along(&gpu, &over_glass(ior, 0.25, 0.0), slanting(angle, 1.0), 16);
        expect_exactly(&mut family, format!("reflected, index {ior}, {degrees} degrees"), &found, 1, reflectance(angle, ior));
    }
    family.assert_detects_one_per_cent();
}

/// From inside, the sky is seen by (1 - F) n^2 short of the critical angle of 41.8103 degrees, as radiance is compressed, and not at
/// all beyond it; a lamp below by F and whole.
#[test]
fn total_reflection_begins_at_the_critical_angle() {
    let Some(gpu) = device() else { return };
    let mut family = Family::default();
    for degrees in [0.0, 30.0, 41.0, 41.8, 41.809, 41.82, 45.0, 60.0, 85.0] {
        let angle = f64::to_radians(degrees);
        let eye = slanting(angle, 0.2) * DVec3::new(1.0, -1.0, 1.0);
        let found = along(&gpu, &over_glass(IOR, 1.0, 1.0), eye, 16);
        let reflected = reflectance(angle, 1.0 / IOR);
        assert_eq!(degrees > 41.8103, reflected == 1.0);
        expect_exactly(&mut family, format!("reflected inside, {degrees} degrees"), &found, 0, reflected);
        if degrees > 41.8103 {
            assert!(found.iter().all(|seen| seen.y == 0.0), "{degrees} degrees: light from outside");
        } else {
            let passed = IOR * IOR * (1.0 - reflected);
            expect_exactly(&mut family, format!("seen from inside, {degrees} degrees"), &found, 1, passed);
        }
    }
    family.assert_detects_one_per_cent();
}

/// An index of 1 is no surface: whatever the angle, nothing of the sky is reflected.
#[test]
fn an_index_of_one_reflects_nothing_at_any_angle() {
    let Some(gpu) = device() else { return };
    for degrees in [0.0, 60.0, 89.0, 89.9, 89.99, 89.999] {
        let found = along(&gpu, &over_glass(1.0, 1.0 / 4096.0, 0.0), slanting(f64::to_radians(degrees), 1.0), 16);
        assert!(found.iter().all(|seen| seen.y == 0.0), "{degrees} degrees: the sky is reflected");
    }
}

/// Through a slab of thickness d a ray goes on parallel to itself, d (tan i - tan t) short of where it was heading, so
/// that a narrow lamp is seen there, by (1 - F)^2, and again 2 d tan t further after two reflections inside, by
/// (1 - F)^2 F^2; everywhere else is dark. All of a wide lamp is (1 - F) / (1 + F).
#[test]
fn a_slab_shifts_a_slanting_ray() {
    let (side, detected, detected_inside) = of_run((256, 0.03, 0.1), (1024, 0.01, 0.02));
    let Some(gpu) = device() else { return };
    let mut family = Family::default();
    let (thickness, below) = (0.2, 0.4);
    for degrees in [45.0, 60.0, 80.0] {
        let angle = f64::to_radians(degrees);
        let inside = refracted(angle, IOR);
        let f = reflectance(angle, IOR);
        let arrives = thickness * inside.tan() + (below - thickness) * angle.tan();
        let again = 2.0 * thickness * inside.tan();
        // All of the plane in red, but a strip where the ray arrives first in green, and second in blue.
        let strip = |from: f64, to: f64, material: usize| {
            let corner = DVec3::new(from, -below, -20.0);
            Mesh::parallelogram("strip", corner, DVec3::Z * 40.0, DVec3::X * (to - from), material)
        };
        let mut ends = vec![-20.0];
        ends.extend([arrives, arrives + again].iter().flat_map(|middle| [middle - 0.025, middle + 0.025]));
        ends.push(20.0);
        let mut meshes = vec![level(0.0, [40.0; 2], true, 0), level(-thickness, [40.0; 2], false, 0)];
        meshes.extend((0..5).map(|k| strip(ends[k], ends[k + 1], 1 + [0, 1, 0, 2, 0][k])));
        let lamps = [Vec3::X, Vec3::Y, Vec3::Z].map(|emission| Material { emission, ..matt(0.0) });
        let scene = scene_of(meshes, [vec![glass(IOR as f32)], lamps.to_vec()].concat(), vec![]);
        let found = along(&gpu, &scene, slanting(angle, 3.0), side);
        let of = |seen: &dyn Fn(&DVec3) -> f64| found.iter().map(seen).collect::<Vec<f64>>();
        let all = (1.0 - f) / (1.0 + f);
        let [once, twice] = [(1.0 - f).powi(2), ((1.0 - f) * f).powi(2)];
        family.expect_mean(format!("slab at {degrees} degrees, in all"), &of(&|seen| seen.element_sum()), all);
        family.expect_mean(format!("slab at {degrees} degrees, straight through"), &of(&|seen| seen.y), once);
        if degrees == 80.0 {
            // One path in eighteen comes this way.
            family.expect_mean("slab, reflected inside", &of(&|seen| seen.z), twice);
            family.expect_mean("slab, reflected inside again", &of(&|seen| seen.x), all - once - twice);
        }
    }
    let is_rare = |what: &str| what.contains("reflected inside");
    family.assert_detects(detected, |what| !is_rare(what));
    family.assert_detects(detected_inside, |what| what.ends_with("reflected inside"));
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
/// 0.908222 / n^2 = 0.403654 leaves it (flux is not compressed, unlike radiance); the rest returns to the black lamp. The lamp
/// above is red, the one below green. Notices 4.5 %: all angles as if straight on would be 6 %. In the long run by shadow rays and a caustic map
/// too, and by every builder.
#[test]
fn diffuse_light_crosses_glass_by_its_mean_transmittance() {
    let all = is_long_run();
    let Some(gpu) = device() else { return };
    let entering = let_in(IOR);
    assert!((entering - 0.908_222_0).abs() < 1e-6, "{entering}");
    let leaving = entering / (IOR * IOR);
    let mut meshes = shaft(-0.5, 0.5, 3);
    meshes.extend([level(0.0, [1.0; 2], true, 0), level(-0.5, [1.0; 2], true, 1), level(0.5, [1.0; 2], false, 2)]);
    let lamps = [Vec3::Y, Vec3::X].map(|emission| Material { emission, ..matt(0.0) });
    let scene = scene_of(meshes, [vec![glass(IOR as f32)], lamps.to_vec(), vec![mirror(1.0)]].concat(), vec![]);
    let points = [grid(-0.5, DVec3::Y, 6), grid(0.5, DVec3::NEG_Y, 6)].concat();
    let mut family = Family::default();
    for illumination in BOTH.into_iter().filter(|illumination| all || *illumination == Illumination::Photons) {
        // More than n hits of the sides lie ahead of a ray with the chance 1.6 / n^2: 4e-4 of the light is left out.
        let settings = optics(fixed_radius(illumination, 20_000, 1, 64, 0.1));
        if all && illumination == Illumination::Photons {
            assert_builders_agree(&gpu, &scene, &settings, &points);
        }
        let runs = irradiances(&gpu, &scene, &settings, &points, 1..13);
        for (what, of_points, channel, share) in [
            ("into glass", 0..36, 0, entering),
            ("back into the air", 36..72, 0, 1.0 - entering),
            ("out of glass", 36..72, 1, leaving),
            ("back into glass", 0..36, 1, 1.0 - leaving),
        ] {
            let mean = |run: &Vec<DVec3>| run[of_points.clone()].iter().map(|light| light[channel]).sum::<f64>() / 36.0;
            family.expect_mean(format!("{what}, {illumination:?}"), &runs.iter().map(mean).collect::<Vec<_>>(), PI * share);
        }
    }
    // What returns into the air is so little of the light that it notices less.
    family.assert_detects(0.045, |what| !what.starts_with("back into the air"));
}

/// A spot light between two mirrors of reflectance 0.8, 1 m before the end of their corridor: the end is lit by all
/// images, sum of 0.8^|n| I cos / d^2 over those whose ray leaves the lamp within its cone. Photons give the mean over
/// a disc, here by a raster whose error is below 1e-4; shadow rays add the lamp's own part at the middle.
#[test]
fn images_light_the_end_of_a_corridor() {
    let illuminations = of_run::<&[_]>(&[Illumination::Photons], &BOTH);
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
    for &illumination in illuminations {
        let settings = SceneSettings { caustic_photons: 40_000, ..fixed_radius(illumination, 20_000, 24, 8, radius) };
        let points = [(DVec3::ZERO, DVec3::Z)];
        let result = received(&gpu, &scene, &optics(settings), &points);
        let own = if illumination == Illumination::Split { image(0, 0.0, 0.0) } else { over_disc(&|x, y| image(0, x, y)) };
        let (mean, error) = red(&result, 0);
        family.expect_estimate(format!("corridor, {illumination:?}"), mean, error, 24, own + reflected);
    }
    family.assert_detects(0.02, |_| true);
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

fn caustics(illumination: Illumination, radius: f64) -> SceneSettings {
    optics(fixed_radius(illumination, 6000, 24, 4, radius))
}

/// Light from the focus leaves a paraboloid parallel to its axis, so that a plane across it has the same irradiance at
/// any distance: what leaves at the angle a to the axis arrives at r = 2 f tan(a / 2), hence
/// I / f^2 / (1 + r^2 / 4 f^2)^2, and as the mean over a disc of radius h, which photons show,
/// I / f^2 / (1 + h^2 / 4 f^2).
/// The reverse, sunlight that meets in the focus, is tested by both illuminations.
#[test]
fn light_from_a_focus_leaves_in_parallel() {
    let illuminations = of_run::<&[_]>(&[Illumination::Photons], &BOTH);
    let Some(gpu) = device() else { return };
    let mut family = Family::default();
    let h: f64 = 0.4;
    let expected = 0.9 / (FOCUS * FOCUS) / (1.0 + h * h / (4.0 * FOCUS * FOCUS));
    for distance in [1.0, 4.0] {
        let lamp = cone(DVec3::Y * FOCUS, DVec3::NEG_Y, 1.0);
        let scene = scene_of(vec![paraboloid(0), level(distance, [2.0; 2], false, 1)], vec![mirror(0.9), matt(0.0)], vec![lamp]);
        for &illumination in illuminations {
            let result = received(&gpu, &scene, &caustics(illumination, h), &[(DVec3::Y * distance, DVec3::NEG_Y)]);
            let (mean, error) = red(&result, 0);
            family.expect_estimate(format!("{distance} m off, {illumination:?}"), mean, error, 24, expected);
        }
    }
    family.assert_detects(0.02, |_| true);
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
        let result = received(&gpu, &scene, &caustics(illumination, radius), &[(DVec3::Y * FOCUS, DVec3::NEG_Y)]);
        let (mean, error) = red(&result, 0);
        family.expect_estimate(format!("in the focus, {illumination:?}"), mean, error, 24, expected);
    }
    family.assert_detects(0.02, |_| true);
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
            let lamp = Mesh::parallelogram("lamp", DVec3::new(middle - 0.01, distance, -1.0), DVec3::X * 0.02, DVec3::Z * 2.0, 1);
            let scene = scene_of(vec![paraboloid(0), lamp], vec![mirror(0.9), emissive(0.0)], vec![]);
            let eye = DVec3::Y * FOCUS;
            radiances(&gpu, &scene, &rays(1), eye, eye + DVec3::new(angle.sin(), -angle.cos(), 0.0), 32)
        };
        family.expect_mean(format!("{degrees} degrees, {distance} m off"), &see(off), 0.9);
        for beside in [-0.02, 0.02] {
            assert!(see(off + beside).iter().all(|seen| *seen == 0.0), "{degrees} degrees, {distance} m off: light {beside} m beside");
        }
    }
    family.assert_detects_one_per_cent();
}
