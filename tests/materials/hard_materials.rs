//! Hard cases of materials: ends of reflectance and of bounces, colours, lobes of any width, glass of any index. The
//! table in `tests/common/cases.rs` names them by case.

use crate::common::known;
use crate::common::prelude::*;
use crate::light::hard_cases::{POINTS, settings};
use photonmill::verify::selfcheck::Estimate;
use photonmill::verify::selfcheck::measure::{irradiance, radiance};

/// A lamp and a glass pane in a room: an index of refraction of 1 is no pane.
fn behind_a_pane(ior: Option<f32>) -> Scene {
    let mut scene = scene("cornell");
    if let Some(ior) = ior {
        scene.materials.push(Material { surface: Surface::Dielectric { ior }, ..Material::lambert("pane", Vec3::ONE) });
        let pane = scene.materials.len() - 1;
        let (x, z) = (DVec3::X, DVec3::Z);
        scene.meshes.push(Mesh::parallelogram("above", DVec3::new(0.0, 0.97, 0.0), z, x, pane));
        scene.meshes.push(Mesh::parallelogram("below", DVec3::new(0.0, 0.96, 0.0), x, z, pane));
    }
    scene
}

#[test]
fn glass_of_the_air_s_own_index_is_not_there() {
    let Some(gpu) = device() else { return };
    // A wide radius: all direct light comes as a caustic now.
    let settings = SceneSettings { photons: 30_000, caustic_photons: 30_000, caustic_radius: Some(0.08), ..settings() };
    let expected = irradiance(&gpu, &behind_a_pane(None), &settings, &POINTS).unwrap();
    for ior in [1.0, 1.0 + 1e-6] {
        let found = irradiance(&gpu, &behind_a_pane(Some(ior)), &SceneSettings { seed: 97, ..settings.clone() }, &POINTS).unwrap();
        // The wide radius blurs the light by a per cent or so.
        let found = Estimate { standard_error: found.standard_error.hypot(0.01 * expected.mean), ..found };
        assert_holds(ior, same_light(&format!("index {ior}"), found, expected));
    }
    let found = irradiance(&gpu, &behind_a_pane(Some(2.5)), &settings, &POINTS).unwrap();
    assert_complains("an index of 2.5", same_light("index 2.5", found, expected));
}

/// The furnace at the ends of reflectance and of bounces.
#[test]
fn reflectances_and_bounces_at_their_ends_are_right() {
    let Some(gpu) = device() else { return };
    let points = [(DVec3::new(0.5, 0.0, 0.5), DVec3::Y), (DVec3::new(0.2, 0.0, 0.999), DVec3::Y)];
    let ask = |gpu: &Gpu, albedo, bounces| {
        let mut furnace = scene("furnace");
        furnace.materials[0].base_colour = Vec3::splat(albedo);
        irradiance(gpu, &furnace, &mapped(4000, 2, bounces, 0.2), &points).unwrap()
    };
    // b landings: 1 + rho + ... + rho^(b - 1) times pi.
    for (albedo, bounces, exact) in [(0.0, 32, PI), (1.0, 1, PI), (1.0, 7, 7.0 * PI), (0.9, 1000, 10.0 * PI), (0.5, 2, 1.5 * PI)] {
        let Estimate { mean, standard_error } = ask(&gpu, albedo, bounces);
        let what = format!("albedo {albedo}, {bounces} bounces");
        assert!(standard_error < 0.05 * exact, "{what}: error {standard_error}");
        assert_holds(&what, z_check(&what, mean, exact, standard_error));
    }
}

/// Three channels of their own reflectance: each is a series of its own, and roulette by the brightest is repaid.
#[test]
fn each_channel_has_its_own_reflectance() {
    let Some(gpu) = device() else { return };
    for colour in [Vec3::new(0.9, 0.1, 0.1), Vec3::new(0.1, 0.9, 0.1), Vec3::new(0.5, 0.5, 0.9)] {
        let mut furnace = scene("furnace");
        furnace.materials[0].base_colour = colour;
        let settings = mapped(8000, 2, 300, 0.5);
        let exact = PI / (1.0 - f64::from(colour.x));
        let found = irradiance(&gpu, &furnace, &settings, &[(DVec3::new(0.5, 0.0, 0.5), DVec3::Y)]).unwrap();
        assert!(found.standard_error < 0.02 * exact, "{colour}: {found:?}");
        assert_holds(colour, z_check("red", found.mean, exact, found.standard_error));
        let grey = PI / (1.0 - f64::from(colour.element_sum()) / 3.0);
        assert_complains("their mean", z_check("red", found.mean, grey, found.standard_error));
    }
}

fn plate(surface: Surface, lights: Vec<LightKind>) -> Scene {
    let mut plate = scene("sky-over-plane");
    plate.materials[0] = Material { surface, ..Material::lambert("plate", Vec3::ONE) };
    plate.lights = lights.into_iter().map(lamp).collect();
    plate
}

fn towards(angle: f64) -> DVec3 {
    DVec3::new(angle.sin(), angle.cos(), 0.0)
}

/// Share of an even sky that a lobe (n + 2) / (2 pi) cos^n sends to an eye at 0, 30, 60 and 80 degrees: what lies
/// below the horizon is lost. By quadrature.
#[test]
fn lobes_reflect_what_lies_above_the_horizon() {
    let Some(gpu) = device() else { return };
    let table = [
        (0.01, [1.0, 0.9318, 0.7472, 0.5835]),
        (0.5, [1.0, 0.8956, 0.6560, 0.4711]),
        (2.0, [1.0, 0.8705, 0.5625, 0.3444]),
        (5.0, [1.0, 0.8663, 0.5194, 0.2693]),
    ];
    let sky = || vec![LightKind::Environment { radiance: Vec3::ONE }];
    for (exponent, albedos) in table {
        for (degrees, albedo) in [0.0f64, 30.0, 60.0, 80.0].into_iter().zip(albedos) {
            let settings = SceneSettings { photons: 1, rounds: 1, shadow_rays: 32, ..settings() };
            let eye = towards(degrees.to_radians());
            let found = radiance(&gpu, &plate(Surface::Glossy { exponent }, sky()), &settings, eye, DVec3::ZERO).unwrap();
            // The table has four digits.
            let error = found.standard_error.hypot(5e-5);
            println!("exponent {exponent}, {degrees} degrees: {:.4} +- {:.4}, expected {albedo}", found.mean, found.standard_error);
            assert!(found.standard_error < 0.01, "{found:?}");
            assert_holds(format!("exponent {exponent}, {degrees} degrees"), z_check("albedo", found.mean, albedo, error));
            assert!(found.mean <= 1.0 + 5.0 * error, "more light than there is");
            assert_complains(
                "(n + 1) in place of (n + 2)",
                z_check("albedo", found.mean, albedo * f64::from((exponent + 1.0) / (exponent + 2.0)), error),
            );
        }
    }
}

/// Light of a narrow beam that a lobe throws onto a screen at unit distance: the share within a radius h is
/// 1 - cos^(n + 2), of the angle whose tangent is h. The least roughness that is no mirror has n = 48 826.
#[test]
fn lobes_of_any_width_throw_their_share() {
    let Some(gpu) = device() else { return };
    // The beam is 3.5e-4 wide, beside a lobe 6.4e-3 wide at the last exponent: 0.1 % of the light.
    for (exponent, tolerance) in [(0.0, 0.0), (5.0, 0.0), (100.0, 0.0), (1e4, 0.0), (48_826.0, 0.001)] {
        let n = f64::from(exponent);
        // Half of the light within h.
        let cosine = 0.5f64.powf(1.0 / (n + 2.0));
        let h = (1.0 - cosine * cosine).sqrt() / cosine;
        let (beam, watts) = beam(DVec3::Y * 0.9, DVec3::NEG_Y);
        let mut bench = plate(Surface::Glossy { exponent }, vec![beam]);
        bench.materials.push(Material::lambert("screen", Vec3::ZERO));
        bench.meshes.push(Mesh::parallelogram("screen", DVec3::new(-2.0, 1.0, -2.0), DVec3::X * 4.0, DVec3::Z * 4.0, 1));
        let settings = SceneSettings { photons: 20_000, bounces: 2, radius: Some(h), alpha: 1.0, ..settings() };
        let found = irradiance(&gpu, &bench, &settings, &[(DVec3::Y, DVec3::NEG_Y)]).unwrap();
        let expected = 0.5 * watts / (PI * h * h);
        let error = found.standard_error.hypot(tolerance * expected);
        println!("exponent {exponent}: {:.5} +- {:.5} of the expected", found.mean / expected, found.standard_error / expected);
        assert!(found.standard_error < 0.02 * expected, "{found:?}");
        assert_holds(exponent, z_check("within h", found.mean, expected, error));
        assert_complains("a lobe a fifth wider", z_check("within h", found.mean, expected * (1.0 - 0.5f64.powf(1.0 / 1.44)) / 0.5, error));
    }
}

/// The sun in a plate: albedo E cos / pi by cos^n of the angle off the mirror direction, by each of the paper's
/// exponents and both models; behind the lobe there is nothing.
#[test]
fn a_sun_in_a_plate_is_a_power_of_the_cosine() {
    let Some(gpu) = device() else { return };
    let incidence = PI / 4.0;
    let sun = || vec![LightKind::Directional { direction: -towards(incidence), irradiance: Vec3::splat(2.0) }];
    let mut worst = [0.0f64; 2];
    for exponent in [0.0f32, 0.01, 0.5, 2.0, 5.0, 1e4, 48_826.0] {
        let n = f64::from(exponent);
        for (surface, scale) in [(Surface::PaperPhong { exponent }, 1.0 / PI), (Surface::Glossy { exponent }, (n + 2.0) / (2.0 * PI))] {
            for off in [0.0, 0.005, 0.02, 0.035, 0.5, 0.7, -0.5, 1.2, 1.6, 2.0] {
                // From the mirror direction over the normal towards the sun.
                let eye = towards(-incidence + off);
                if eye.y < 0.05 {
                    continue;
                }
                let camera = Camera::looking_at("eye", eye, DVec3::ZERO, DVec3::Z, 1e-9);
                let settings = SceneSettings { photons: 1, rounds: 1, shadow_rays: 1, part: Part::Direct, ..by_rounds() };
                let lit = seen(&gpu, &plate(surface, sun()), &settings, &camera, [4, 4]);
                let found = mean_red(&lit);
                let what = format!("{surface:?}, {off} off");
                if off > PI / 2.0 {
                    assert_eq!(found, 0.0, "{what}");
                    continue;
                }
                let exact = 2.0 * incidence.cos() * scale * off.cos().powf(n);
                if exact < 1e-4 {
                    assert!(found < 2e-4, "{what}: {found}");
                    continue;
                }
                // A direction in f32 is an angle of 1e-7 off. A cosine would be by as much, which the exponent multiplies.
                let place = usize::from(n > 5.0);
                let allowed = 1e-5 + n * off.abs().tan() * 1e-7;
                worst[place] = worst[place].max((found / exact - 1.0).abs());
                assert_holds(&what, relative_check(&what, found, exact, allowed));
                assert_complains("1 per mille more", relative_check(&what, 1.001 * found, exact, allowed));
                if n > 5.0 {
                    let rounded = found * (n * f64::from(f32::EPSILON / 2.0)).exp();
                    assert_complains("1 - cosine, one rounding off", relative_check(&what, rounded, exact, allowed));
                }
            }
        }
    }
    println!("relative error up to {:.1e}, at exponents 1e4 and 48 826 {:.1e}", worst[0], worst[1]);
}

/// Reflectance of a boundary for unpolarised light, in f64.
fn fresnel(cos_i: f64, eta: f64) -> f64 {
    let k = 1.0 - eta * eta * (1.0 - cos_i * cos_i);
    if k <= 0.0 {
        return 1.0;
    }
    let cos_t = k.sqrt();
    let parallel = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let perpendicular = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// A surface of glass, 4 m wide, under an even sky and `depth` over a black ground that catches what goes through.
fn over_glass(ior: f32, depth: f64) -> Scene {
    let mut scene = plate(Surface::Dielectric { ior }, vec![LightKind::Environment { radiance: Vec3::ONE }]);
    scene.materials.push(Material::lambert("ground", Vec3::ZERO));
    scene.meshes.push(Mesh::parallelogram("ground", DVec3::new(-40.0, -depth, -40.0), DVec3::Z * 80.0, DVec3::X * 80.0, 1));
    scene
}

/// Radiance along one ray and the number of samples.
fn along(gpu: &Gpu, scene: &Scene, eye: DVec3) -> (f64, f64) {
    let camera = Camera::looking_at("ray", eye, DVec3::ZERO, DVec3::Z, 1e-6);
    let settings = SceneSettings { photons: 1, caustic_photons: 1, rounds: 4, part: Part::Specular, ..by_rounds() };
    let lit = seen(gpu, scene, &settings, &camera, [64, 64]);
    (mean_red(&lit), 4.0 * 64.0 * 64.0)
}

/// From outside, up to the horizon: F = 0.04, 0.38770, 0.90418, 0.98991, 0.99899 at 0, 80, 89, 89.9 and 89.99 degrees.
#[test]
fn glass_reflects_by_fresnel_up_to_the_horizon() {
    let Some(gpu) = device() else { return };
    for (degrees, printed) in [(0.0f64, 0.04), (80.0, 0.387_70), (89.0, 0.904_18), (89.9, 0.989_91), (89.99, 0.998_99)] {
        let reflectance = fresnel(degrees.to_radians().cos(), 1.0 / 1.5);
        assert!((reflectance - printed).abs() < 1e-5, "{degrees} degrees: {reflectance}");
        let (found, samples) = along(&gpu, &over_glass(1.5, 0.25), towards(degrees.to_radians()));
        let error = (reflectance * (1.0 - reflectance) / samples).sqrt();
        println!("{degrees} degrees: {found:.5}, expected {reflectance:.5} +- {error:.5}");
        assert_holds(degrees, z_check("reflectance", found, reflectance, error));
        let other = fresnel(degrees.to_radians().cos(), 1.0 / 2.5);
        let error = (other * (1.0 - other) / samples).sqrt();
        if degrees <= 80.0 {
            assert_complains("diamond", z_check("reflectance", found, other, error));
        }
    }
}

/// From inside, around the critical angle of 41.8103 degrees: radiance n^2 (1 - F) below it, nothing beyond.
#[test]
fn total_reflection_begins_at_the_critical_angle() {
    let Some(gpu) = device() else { return };
    for degrees in [0.0f64, 30.0, 41.0, 41.8, 41.809, 41.82, 45.0, 60.0] {
        let (found, samples) = along(&gpu, &over_glass(1.5, 0.25), towards(degrees.to_radians()) * DVec3::new(0.2, -0.2, 0.2));
        if degrees > 41.8103 {
            assert_eq!(found, 0.0, "{degrees} degrees");
            continue;
        }
        let passed = 1.0 - fresnel(degrees.to_radians().cos(), 1.5);
        let error = 2.25 * (passed * (1.0 - passed) / samples).sqrt();
        println!("{degrees} degrees: {found:.5}, expected {:.5} +- {error:.5}", 2.25 * passed);
        assert_holds(degrees, z_check("radiance", found, 2.25 * passed, error));
        assert_complains("no n^2", z_check("radiance", found, passed, error));
    }
}

/// An index of 1 is no surface: whatever the angle, nothing is reflected and everything goes through unturned.
#[test]
fn an_index_of_one_reflects_nothing_at_any_angle() {
    let Some(gpu) = device() else { return };
    let mut complaints = Vec::new();
    for degrees in [0.0f64, 60.0, 89.0, 89.9, 89.99, 89.999] {
        let (found, _) = along(&gpu, &over_glass(1.0, 1.0 / 4096.0), towards(degrees.to_radians()));
        if found != 0.0 {
            complaints.push(format!("at {degrees} degrees {found} is reflected"));
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("; "));
}

/// Diffuse light that meets glass: 0.4036542 of it leaves, 0.9082220 enters, n^2 times as much; flux is not scaled.
#[test]
fn diffuse_light_crosses_glass_by_its_mean_transmittance() {
    let Some(gpu) = device() else { return };
    for (what, height, normal, expected) in [("leaving", -0.1, DVec3::Y, 0.403_654_2), ("entering", 0.1, DVec3::NEG_Y, 0.908_222_0)] {
        let mut scene = plate(Surface::Dielectric { ior: 1.5 }, vec![disc(DVec3::Y * height, normal, 0.01, EmissionLaw::Cosine)]);
        // So wide that one photon in a hundred thousand misses it.
        scene.meshes[0].positions.iter_mut().for_each(|at| *at *= 16.0);
        scene.materials.push(Material::lambert("ground", Vec3::ZERO));
        scene.meshes.push(Mesh::parallelogram("ground", DVec3::new(-400.0, -0.25, -400.0), DVec3::Z * 800.0, DVec3::X * 800.0, 1));
        let settings = SceneSettings { radius: None, ..flights(400_000, 2) };
        let fates = received(&gpu, &scene, &settings, &[(DVec3::Y * -0.25, DVec3::Y)]).fates[0].clone();
        let through = if height < 0.0 { fates.bounces[1].escaped } else { fates.bounces[1].absorbed };
        println!("{what}: {} passes, expected {expected}", through as f64 / fates.emitted as f64);
        assert_holds(what, share_check(what, through, fates.emitted, expected));
        assert_complains("flux over n^2", share_check(what, through, fates.emitted, expected / 2.25));
    }
}

#[test]
fn vertex_colours_multiply_the_base_colour() {
    let Some(gpu) = device() else { return };
    assert_holds("a coloured floor", known::vertex_colours(&gpu));
}

#[test]
fn textures_go_on_beyond_their_edges_as_their_wrapping_says() {
    let Some(gpu) = device() else { return };
    for u in [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::Clamp] {
        for v in [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::Clamp] {
            assert_holds("the picture", known::wrapped_texture(&gpu, [u, v], false));
            assert_holds("the picture", known::wrapped_texture(&gpu, [u, v], true));
        }
    }
}

/// More than one buffer of 128 MiB holds, and more than two.
#[test]
fn twenty_large_textures_are_read_each_from_its_own_buffer() {
    let Some(gpu) = device() else { return };
    let side = 2048;
    let code = |k: usize| [12 * k as u8, 255 - 12 * k as u8, 7 * k as u8, 255];
    let mut wall = Scene::default();
    for k in 0..20 {
        wall.meshes.push(Mesh::parallelogram("square", DVec3::X * k as f64, DVec3::X, DVec3::Y, k));
        wall.materials.push(Material { emission: Vec3::ONE, emission_texture: Some(TextureUse::of(k, 0)), ..matt(0.0) });
        let texels = Texels::Srgb(vec![code(k); side * side]);
        let texture = Texture {
            name: format!("picture {k}"),
            width: side as u32,
            height: side as u32,
            texels,
            wrap: [Wrap::Repeat; 2],
            filter: Default::default(),
        };
        wall.textures.push(texture);
    }
    // Three pixels a square.
    let camera = Camera::looking_at("eye", DVec3::new(10.0, 0.5, 60.0), DVec3::new(10.0, 0.5, 0.0), DVec3::Y, 2.0 * (0.5f64 / 60.0).atan());
    let settings = SceneSettings { rounds: 1, part: Part::Direct, ..by_rounds() };
    let found = means(&seen(&gpu, &wall, &settings, &camera, [60, 3]));
    for k in 0..20 {
        let (found, expected) = (found[60 + 3 * k + 1], wall.textures[k].texels.at(0).truncate().as_dvec3());
        assert!((found - expected).abs().max_element() < 1e-5, "picture {k}: {found} instead of {expected}");
    }
}

#[test]
fn shading_normals_turn_light_and_no_more() {
    let Some(gpu) = device() else { return };
    for illumination in BOTH {
        assert_holds("the plane", known::leaning_plane(&gpu, illumination));
    }
    assert_holds("the scatterer", known::leaning_scatterer(&gpu));
}

/// Of spheres so coarse that smooth normals send rays to the wrong side of their triangles, no light is lost.
fn coarse_spheres_lose_no_light(material: &Material, ground_segments: u32) {
    let Some(gpu) = device() else { return };
    for segments in [8, 16, 32] {
        assert_holds("in a furnace", known::coarse_sphere_in_a_furnace(&gpu, material.clone(), segments));
        assert_holds("in the sun", known::coarse_sphere_in_the_sun(&gpu, material.clone(), segments));
    }
    assert_holds("the ground", known::ground_by_a_coarse_sphere(&gpu, material.clone(), ground_segments));
}

#[test]
fn coarse_mirrors_with_smooth_normals_lose_no_light() {
    coarse_spheres_lose_no_light(&mirror(1.0), 32);
}

/// Nor does any of it stay in the glass for long.
#[test]
fn coarse_glass_with_smooth_normals_loses_no_light() {
    coarse_spheres_lose_no_light(&glass(1.5), 16);
}
