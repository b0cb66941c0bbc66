//! Small scenes whose light is known, each as a check of a device: a test holds it, and `tests/engine/planted_faults.rs` shows that it
//! complains.

use std::f64::consts::FRAC_PI_3;

use glam::dvec3;

use super::estimate_check;
use super::lamps;
use super::prelude::*;
use super::rendered::sides;
use photonmill::engine::scene::{Receivers, RunResult};
use photonmill::verify::selfcheck::Estimate;

/// Settings of which rooms of many triangles and few, with sheets of two sides and without, have one set of kernels.
pub fn of_any_room(settings: SceneSettings) -> SceneSettings {
    SceneSettings { with: vec![Effect::Bvh, Effect::TwoSided], ..settings }
}

/// Settings that keep every kind of light and what many scenes need, also where a scene lacks it, which changes no bit
/// (`tests/light/transport.rs`): so scenes share kernels, and a software device compiles them once.
pub fn kept(settings: SceneSettings) -> SceneSettings {
    let with = [
        Effect::MeshLights,
        Effect::PointLights,
        Effect::SpotLights,
        Effect::DirectionalLights,
        Effect::DiscLights,
        Effect::Environment,
        Effect::Bvh,
        Effect::TwoSided,
    ];
    SceneSettings { with: [&settings.with[..], &with].concat(), ..settings }
}

/// Mean of points in one run, whose rounds are its independent values. Points share photons: as if their errors were one.
pub fn mean_irradiance(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, points: &[(DVec3, DVec3)]) -> Estimate {
    let result = received(gpu, scene, settings, points);
    let error = standard_errors(&result).iter().map(|error| error.x).sum::<f64>() / points.len() as f64;
    Estimate { mean: mean_red(&result), standard_error: error }
}

/// A room of 1 m, grey, with a material for lamps.
fn bright_room() -> Scene {
    Scene { materials: vec![matt(0.7), Material { emission: Vec3::splat(10.0), ..matt(0.5) }], ..scene("furnace") }
}

/// A lamp shut in by a flat box of a height of 2^-11: nothing lights the floor and the ceiling of the room around it.
pub fn lamp_in_a_box(gpu: &Gpu, illumination: Illumination) -> Check<Complaint> {
    let mut room = bright_room();
    // Numbers without rounding, so that the sides share their corners to the bit.
    let (corner, size) = (DVec3::splat(0.375), dvec3(0.25, 1.0 / 2048.0, 0.25));
    // Both faces, as light must not pass either way. The lamp emits from below.
    room.meshes.extend(sides(corner, size, true, [1, 0, 0, 0, 0, 0]));
    room.meshes.extend(sides(corner, size, false, [0; 6]));
    let settings = SceneSettings { photons: 20_000, rounds: 4, illumination, ..by_rounds() };
    let points = [(DVec3::new(0.5, 0.0, 0.5), DVec3::Y), (DVec3::new(0.5, 1.0, 0.5), DVec3::NEG_Y)];
    let leaked = mean_red(&received(gpu, &room, &settings, &points));
    Kind::Leak.unless(leaked == 0.0, || format!("{leaked} W/m2 leave the box"))
}

/// A second floor a hundredth of the radius above the first, facing as it does, seals it off: its photons are not the
/// first one's.
pub fn shelf(gpu: &Gpu) -> Check<Complaint> {
    let mut room = bright_room();
    room.meshes.push(Mesh::parallelogram("shelf", DVec3::Y * 0.001, DVec3::Z, DVec3::X, 0));
    room.meshes.push(Mesh::parallelogram("lamp", DVec3::new(0.4, 0.9, 0.4), DVec3::X * 0.2, DVec3::Z * 0.2, 1));
    let settings = SceneSettings { radius: Some(0.1), photons: 20_000, rounds: 4, ..by_rounds() };
    let points = [(DVec3::new(0.3, 0.001, 0.3), DVec3::Y), (DVec3::new(0.3, 0.0, 0.3), DVec3::Y)];
    let found = means(&received(gpu, &room, &settings, &points));
    assert!(found[0].x > 0.1, "the shelf has {}", found[0]);
    Kind::Leak.unless(found[1] == DVec3::ZERO, || format!("{} W/m2 below the shelf", found[1]))
}

/// The sun straight above a black roof, half of it level and half at 60 degrees: beside the ridge each half has the
/// irradiance of its own slope, 1 and cos 60, from its own photons alone.
pub fn ridge(gpu: &Gpu) -> Check<Complaint> {
    let slope = DVec3::new(FRAC_PI_3.cos(), -FRAC_PI_3.sin(), 0.0);
    let (ridge, z) = (DVec3::NEG_Z, DVec3::Z * 2.0);
    let halves = vec![Mesh::parallelogram("level", ridge, DVec3::NEG_X, z, 0), Mesh::parallelogram("slope", ridge, z, slope, 0)];
    let roof = scene_of(halves, vec![matt(0.0)], vec![sun(DVec3::NEG_Y)]);
    let settings = mapped(40_000, 64, 1, 0.1);
    let normal = DVec3::new(-slope.y, slope.x, 0.0);
    let result = received(gpu, &roof, &settings, &[(DVec3::NEG_X * 0.02, DVec3::Y), (slope * 0.02, normal)]);
    red_check("beside the ridge", &result, 0, 1.0, [0.03, 1e-3])?;
    red_check("below the ridge", &result, 1, slope.x, [0.03, 1e-3])
}

/// A spot between its cones, straight onto a plane 1 m off: I s^2 cos^3 where s is how far the cosine is from the outer
/// cone's to the inner's. Shadow rays to it have nothing random.
pub fn spot(gpu: &Gpu) -> Check<Complaint> {
    let (inner_angle, outer_angle) = (0.3f32, 0.7f32);
    let spot = LightKind::Spot { position: DVec3::Y, direction: DVec3::NEG_Y, intensity: Vec3::splat(2.0), inner_angle, outer_angle };
    let floor = scene_of(vec![level(0.0, [4.0; 2], true, 0)], vec![matt(0.0)], vec![spot]);
    let (inner, outer) = (f64::from(inner_angle).cos(), f64::from(outer_angle).cos());
    let shares = [0.0, 0.1, 0.25, 0.5, 0.75, 1.0];
    let cosines = shares.map(|share| outer + share * (inner - outer));
    let points = cosines.map(|cosine| (DVec3::X * (1.0 - cosine * cosine).sqrt() / cosine, DVec3::Y));
    let settings = SceneSettings { rounds: 1, part: Part::Direct, ..by_rounds() };
    let found = means(&received(gpu, &floor, &settings, &points));
    pairs(pairs(shares, cosines), found).try_for_each(|((share, cosine), found)| {
        let exact = 2.0 * share * share * cosine.powi(3);
        // Nothing is random; five of these are 2e-5.
        estimate_check(&format!("{share} of the way into the cone"), found.x, exact, 4e-6)
    })
}

/// Texel of an axis of `size` at a place beyond it, as glTF has it.
fn texel_at(wrap: Wrap, place: i32, size: i32) -> i32 {
    match wrap {
        Wrap::Repeat => place.rem_euclid(size),
        Wrap::Clamp => place.clamp(0, size - 1),
        // There and back again, each end twice.
        Wrap::MirroredRepeat => (0..size).chain((0..size).rev()).nth(place.rem_euclid(2 * size) as usize).unwrap(),
    }
}

/// A lamp that wears a picture of 3 x 2 texels five times along each side, from -2 to 3: at the middle of every texel
/// emits that texel.
pub fn wrapped_texture(gpu: &Gpu, wrap: [Wrap; 2], is_transformed: bool) -> Check<Complaint> {
    // Any two are half apart in some channel; 188 is the code of 0.503.
    let codes = [[0, 0, 0], [255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0], [188, 188, 188]];
    let six = texture(3, Texels::Srgb(codes.map(|[red, green, blue]| [red, green, blue, 255]).to_vec()), wrap);
    let size = [3, 2];
    let mut mesh = Mesh::parallelogram("lamp", DVec3::new(-7.5, -5.0, 0.0), DVec3::X * 15.0, DVec3::Y * 10.0, 0);
    let transform = UvTransform { scale: DVec2::splat(5.0), rotation: 0.0, offset: DVec2::splat(-2.0) };
    let mut used = TextureUse::of(0, 0);
    if is_transformed {
        // The same, turned by a right angle and back.
        mesh.uvs[0].iter_mut().for_each(|uv| *uv = DVec2::new(-uv.y, uv.x));
        used.transform = UvTransform { rotation: FRAC_PI_2, ..transform };
    } else {
        mesh.uvs[0].iter_mut().for_each(|uv| *uv = transform.apply(*uv));
    }
    let emission_texture = Some(used);
    let mut sign = scene_of(vec![mesh], vec![Material { emission: Vec3::ONE, emission_texture, ..matt(0.0) }], vec![]);
    sign.textures = vec![six.clone()];
    // Five pixels a texel: the middle one of a row is within a tenth of the texel's middle.
    let eye = DVec3::Z * 20.0;
    let camera = Camera::looking_at("eye", eye, DVec3::ZERO, DVec3::Y, 2.0 * (5.0f64 / 20.0).atan());
    let settings = SceneSettings { rounds: 1, part: Part::Direct, ..by_rounds() };
    let found = means(&seen(gpu, &sign, &settings, &camera, [75, 50]));
    (0..150).map(|k| (k % 15, k / 15)).try_for_each(|(i, j)| {
        let [column, row] = [texel_at(wrap[0], i - 6, size[0]), texel_at(wrap[1], j - 4, size[1])];
        let expected = six.texels.at((row * size[0] + column) as usize).truncate().as_dvec3();
        // Rows of pixels from the top, of texels from v = 0.
        let found = found[((49 - (5 * j + 2)) * 75 + 5 * i + 2) as usize];
        let is_near = (found - expected).abs().cmple(DVec3::splat(0.2)).all();
        Kind::WrongTexel.unless(is_near, || format!("{wrap:?}, texel {i}, {j}: {found} instead of {expected}"))
    })
}

/// Under a sky of 1 W/m2/sr a floor shows its own colour: that of its material times those of its corners, between which it is even.
pub fn vertex_colours(gpu: &Gpu) -> Check<Complaint> {
    let corners = [DVec3::X, DVec3::Y, dvec3(0.0, 0.5, 1.0), DVec3::ONE];
    let floor = Mesh { colours: corners.to_vec(), ..level(0.0, [2.0; 2], true, 0) };
    let mut scene = scene_of(vec![floor], vec![matt(0.8)], vec![LightKind::Environment { radiance: Vec3::ONE }]);
    scene.meshes.push(level(-1.0, [1.0; 2], true, 0));
    // A square of 2 m fills the picture, seen from far so that all pixels are looked at straight.
    let camera = Camera::looking_at("above", DVec3::Y * 200.0, DVec3::ZERO, DVec3::Z, 2.0 * (1.0f64 / 200.0).atan());
    let settings = SceneSettings { rounds: 4, part: Part::Direct, ..by_rounds() };
    let result = seen(gpu, &scene, &settings, &camera, [8, 8]);
    let Mesh { positions, triangles, colours, .. } = &scene.meshes[0];
    for pixel in 0..64u32 {
        let place = |k: u32| (f64::from(k) + 0.5) / 4.0 - 1.0;
        let at = camera.right * place(pixel % 8) - camera.up * place(pixel / 8);
        // Pixels across the diagonal see both triangles.
        let on_diagonal = (at.x - at.z).abs() < 0.3 || (at.x + at.z).abs() < 0.3;
        let expected = triangles.iter().find_map(|triangle| {
            let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
            let whole = (b - a).cross(c - a).y;
            let [v, w] = [(at - a).cross(c - a).y / whole, (b - a).cross(at - a).y / whole];
            let [a, b, c] = triangle.map(|vertex| colours[vertex as usize]);
            (v >= 0.0 && w >= 0.0 && v + w <= 1.0).then(|| 0.8 * (a * (1.0 - v - w) + b * v + c * w))
        });
        let (found, expected) = (result.film.mean(pixel as usize), expected.expect("the floor fills the picture"));
        // A pixel is an eighth of the floor, over which the filter takes the mean of four rounds' places.
        let is_near = (found - expected).abs().cmple(DVec3::splat(0.08)).all();
        Kind::WrongTexel.unless(on_diagonal || is_near, || format!("pixel {pixel}: {found} instead of {expected}"))?;
    }
    Ok(())
}

/// A level plane whose shading normals lean by an angle towards x.
fn leaning(angle: f64) -> Mesh {
    Mesh { normals: vec![DVec3::new(angle.sin(), angle.cos(), 0.0); 4], ..level(0.0, [4.0; 2], true, 0) }
}

/// The sun straight above a plane whose shading normals lean by 40 degrees: rho E cos 40 / pi for an eye above them. An
/// eye below them sees the plane as flat, rho E / pi.
pub fn leaning_plane(gpu: &Gpu, illumination: Illumination) -> Check<Complaint> {
    let lean = 40f64.to_radians();
    let plane = scene_of(vec![leaning(lean)], vec![matt(0.8)], vec![sun(DVec3::NEG_Y)]);
    let settings = SceneSettings { photons: 20_000, rounds: 32, bounces: 1, radius: Some(0.5), alpha: 1.0, illumination, ..by_rounds() };
    for (what, degrees, cosine) in [("above", 30f64, lean.cos()), ("below", -70.0, 1.0)] {
        let eye = DVec3::new(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
        let camera = Camera::looking_at("eye", eye, DVec3::ZERO, DVec3::Z, 2e-4);
        let result = seen(gpu, &plane, &settings, &camera, [1, 1]);
        // Photons keep their direction in 30 bits.
        red_check(&format!("{illumination:?}, from {what} the shading normals"), &result, 0, 0.8 / PI * cosine, [0.03, 2e-4])?;
    }
    Ok(())
}

/// A narrow beam of W watts straight onto a plane whose shading normals lean by 40 degrees: it scatters
/// W cos 40 rho cos / pi a steradian, whatever the shading normal says of where that goes (Veach 1997, section 5.3),
/// onto a ceiling 1 m above, W cos 40 rho cos^4 / pi of irradiance.
pub fn leaning_scatterer(gpu: &Gpu) -> Check<Complaint> {
    let lean = 40f64.to_radians();
    let (beam, watts) = beam(DVec3::Y * 0.9, DVec3::NEG_Y);
    let bench = scene_of(vec![leaning(lean), level(1.0, [6.0; 2], false, 1)], vec![matt(0.8), matt(0.0)], vec![beam]);
    let radius = 0.3;
    let settings = mapped(5000, 32, 2, radius);
    let middle = DVec3::new(lean.tan(), 1.0, 0.0);
    let result = received(gpu, &bench, &settings, &[(middle, DVec3::NEG_Y)]);
    // The mean over the disc of the estimate, by parts of equal area.
    let parts = 64;
    let place = |k: i32| (f64::from(k) + 0.5) / f64::from(parts);
    let samples = (0..parts * parts).map(|k| {
        let (r, (sin, cos)) = (radius * place(k % parts).sqrt(), (TAU * place(k / parts)).sin_cos());
        (middle + DVec3::new(r * cos, 0.0, r * sin)).length_squared().powi(-2)
    });
    let exact = watts * lean.cos() * 0.8 / PI * samples.sum::<f64>() / f64::from(parts * parts);
    red_check("a leaning scatterer", &result, 0, exact, [0.03, 1e-3])
}

/// A white patch back to back with a white plane a hundred times its size, turned so that neither is in its plane to the
/// last bit: what they scatter meets neither again.
pub fn patch_in_a_plane(gpu: &Gpu) -> Check<Complaint> {
    let turn = DQuat::from_axis_angle(DVec3::new(0.3, 0.5, -0.8).normalize(), 1.1);
    let meshes = vec![level(0.0, [4.0; 2], false, 0), level(0.0, [0.04; 2], true, 0)];
    let spot = cone(turn * DVec3::new(0.1, 0.5, 0.2), turn * DVec3::new(-0.1, -0.5, -0.2).normalize(), 0.04);
    let sheets = moved(scene_of(meshes, vec![matt(1.0)], vec![spot]), |at| turn * at);
    let result = received(gpu, &sheets, &flights(40_000, 2), &[(DVec3::ZERO, turn * DVec3::Y)]);
    none_returns("a patch in a plane", &result)
}

/// What a flat or convex surface scatters never meets it again: neither the triangle it left nor those beside it.
pub fn none_returns(what: &str, result: &RunResult) -> Check<Complaint> {
    let [first, second] = [result.fates[0].bounces[0], result.fates[0].bounces[1]];
    assert!(first.stored > 10_000, "{what}: only {} photons were scattered", first.stored);
    let met = second.stored + second.absorbed;
    let text = || format!("{what}: {met} of {} scattered photons met the surface again", first.stored);
    Kind::PhotonsAdded.unless(met == 0 && second.escaped == first.stored, text)
}

/// Direct light of a picture of so many pixels a side, by the tree and by the list of all triangles.
fn by_tree_and_list(gpu: &Gpu, scene: &Scene, camera: &Camera, side: u32) -> [RunResult; 2] {
    let with = || vec![Effect::MeshLights, Effect::DirectionalLights, Effect::TwoSided];
    let usual = || SceneSettings { rounds: 1, part: Part::Direct, with: with(), ..by_rounds() };
    let by_tree = SceneSettings { with: [with(), vec![Effect::Bvh]].concat(), ..usual() };
    let by_list = SceneSettings { without: vec![Effect::Bvh], ..usual() };
    let [tree, list] = [by_tree, by_list].map(|settings| seen(gpu, scene, &settings, camera, [side; 2]));
    assert!(tree.plan.simulates(Effect::Bvh) && !list.plan.simulates(Effect::Bvh));
    [tree, list]
}

/// Sheets of other colours that overlap in one plane: a tree shows the parts that the list of all triangles does.
pub fn sheets_in_one_plane(gpu: &Gpu) -> Check<Complaint> {
    let sheets = 24;
    let sheet = |k: usize| {
        let size = (4 + 5 * k % 29) as f64 / 16.0;
        let corner = DVec3::new((3 * k % 17) as f64, 0.0, (7 * k % 13) as f64) / 16.0;
        Mesh::parallelogram("sheet", corner, DVec3::Z * size, DVec3::X * size, k)
    };
    let materials = (0..sheets).map(|k| matt(0.04 * k as f32)).collect();
    let scene = scene_of((0..sheets).map(sheet).collect(), materials, vec![sun(DVec3::NEG_Y)]);
    let camera = Camera::looking_at("above", DVec3::new(1.0, 3.0, 1.0), DVec3::new(1.0, 0.0, 1.0), DVec3::Z, 1.0);
    let [tree, list] = by_tree_and_list(gpu, &scene, &camera, 48);
    same_sums("tree and list", &tree.film.sums, &list.film.sums)
}

/// Triangles of one corner, met by rays that all go through it: a ray is equally far from all of them. The one with the lowest number
/// is met, in whatever order a tree tests them.
pub fn triangles_of_one_corner(gpu: &Gpu) -> Check<Complaint> {
    let count = 64;
    let rim = |k: usize| {
        let (sin, cos) = (TAU * k as f64 / count as f64).sin_cos();
        DVec3::new(0.5 * cos, 0.0, 0.5 * sin)
    };
    let material = |k: usize| Material { emission: Vec3::splat(1.0 + k as f32), ..matt(0.0) };
    // Their fronts: rounding differs between backs. Along a diagonal from a power of two away nothing is rounded.
    for (what, height, corners) in [("above", 4.0, [0, 2, 1]), ("below", -4.0, [0, 1, 2])] {
        let triangle = |k: usize| {
            let positions = vec![DVec3::ZERO, rim(k), rim(k + 1)];
            Mesh { name: "triangle".into(), positions, triangles: vec![corners], material: k, ..Mesh::default() }
        };
        let scene = scene_of((0..count).map(triangle).collect(), (0..count).map(material).collect(), vec![]);
        // So narrow that single precision knows one direction alone.
        let camera = Camera::looking_at(what, DVec3::splat(height), DVec3::ZERO, DVec3::Z, 1e-60);
        let [tree, list] = by_tree_and_list(gpu, &scene, &camera, 4);
        assert!(list.film.sums.iter().any(|sum| *sum > 0), "{what}: no triangle is met");
        same_sums(&format!("tree and list from {what}"), &tree.film.sums, &list.film.sums)?;
    }
    Ok(())
}

/// A stack of sheets, seen from 16 384 times its width, where a unit in the last place is more than its height: rays start near the
/// scene, and so meet the sheet that is next to the eye.
pub fn stack_from_afar(gpu: &Gpu) -> Check<Complaint> {
    let sheets = 256;
    let sheet = |k: usize| {
        // Twice as far from the next as surfaces must be not to overlap.
        let height = k as f64 / 1_048_576.0;
        let positions = [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5)].map(|(x, z)| DVec3::new(x, height, z)).to_vec();
        Mesh { name: "sheet".into(), positions, triangles: vec![[0, 1, 2]], material: k, ..Mesh::default() }
    };
    let material = |k: usize| Material { emission: Vec3::splat(1.0 + k as f32), two_sided: true, ..matt(0.0) };
    let scene = scene_of((0..sheets).map(sheet).collect(), (0..sheets).map(material).collect(), vec![]);
    let geometry = Geometry::new(&scene).unwrap();
    assert!(geometry.overlaps.is_empty() && geometry.triangles.len() == sheets);
    for (what, height, radiance) in [("above", 16_384.0, 256.0), ("below", -16_384.0, 1.0)] {
        let middle = DVec3::new(-0.2, 0.0, -0.2);
        let camera = Camera::looking_at(what, middle + DVec3::Y * height, middle, DVec3::Z, 2e-5);
        let [tree, list] = by_tree_and_list(gpu, &scene, &camera, 8);
        for mean in means(&list) {
            estimate_check(&format!("a stack from {what}"), mean.x, radiance, 1e-3)?;
        }
        same_sums(&format!("tree and list from {what}"), &tree.film.sums, &list.film.sums)?;
    }
    Ok(())
}

/// A sphere of mirror or glass with smooth normals of so many segments, and a speck of matt ground that calls for photons.
fn coarse_sphere(material: Material, segments: u32, light: LightKind) -> Scene {
    let speck = Mesh::parallelogram("speck", DVec3::new(3.0, -3.0, 3.0), DVec3::Z * 0.01, DVec3::X * 0.01, 1);
    scene_of(vec![Mesh::sphere("sphere", DVec3::ZERO, 1.0, segments, 0), speck], vec![material, matt(1.0)], vec![light])
}

/// Mirrors and glass share kernels.
fn of_coarse_spheres(settings: SceneSettings) -> SceneSettings {
    let with = vec![Effect::SpecularChains, Effect::Environment, Effect::MeshLights, Effect::DirectionalLights];
    SceneSettings { with, ..settings }
}

/// Under a sky that is 1 everywhere a coarse sphere that keeps all light is not to be seen at any pixel, as the sky is behind every
/// path however smooth normals turn it.
pub fn coarse_sphere_in_a_furnace(gpu: &Gpu, material: Material, segments: u32) -> Check<Complaint> {
    let scene = coarse_sphere(material, segments, LightKind::Environment { radiance: Vec3::ONE });
    let camera = Camera::looking_at("front", DVec3::new(0.3, 0.4, 4.0), DVec3::ZERO, DVec3::Y, 0.55);
    let settings = of_coarse_spheres(SceneSettings { samples: 1, rounds: 16, photons: 1000, ..by_rounds() });
    let result = seen(gpu, &scene, &settings, &camera, [24, 24]);
    let darkest = result.film.means().map(|mean| mean.x).fold(f64::INFINITY, f64::min);
    println!("{segments} segments: {} on the mean, {darkest} at the darkest pixel", mean_red(&result));
    estimate_check("the sphere", mean_red(&result), 1.0, 0.0001)?;
    estimate_check("its darkest pixel", darkest, 1.0, 0.0001)
}

/// No photon of the sun ends on it either, and few stay in it for long: two bounces go through glass.
pub fn coarse_sphere_in_the_sun(gpu: &Gpu, material: Material, segments: u32) -> Check<Complaint> {
    let scene = coarse_sphere(material, segments, sun(DVec3::new(0.2, -1.0, 0.3)));
    let settings = of_coarse_spheres(SceneSettings { photons: 50_000, rounds: 1, illumination: Illumination::Photons, ..by_rounds() });
    let result = received(gpu, &scene, &settings, &[(DVec3::new(3.005, -3.0, 3.005), DVec3::Y)]);
    let ledger = result.fates[0].ledger();
    assert!(ledger.closes(), "{ledger}");
    let ended = (ledger.absorbed + ledger.cut_off) as f64 / ledger.emitted as f64;
    // All that is under way at a bounce, on it and after it.
    let entered = result.fates[0].bounces.iter().map(|fates| fates.stored + fates.absorbed + fates.escaped);
    let bounces = entered.skip(1).sum::<u64>() as f64 / result.fates[0].bounces[0].stored as f64;
    println!("{segments} segments: {ended} of the photons end, {bounces} bounces on the mean");
    Kind::PhotonsLost.unless(ended <= 1e-4, || format!("{ended} of the photons end on a sphere that keeps all"))?;
    Kind::PhotonsAdded.unless(bounces <= 2.5, || format!("{bounces} bounces of a photon that meets the sphere"))
}

/// Photons that such a sphere passes on light the ground about it as paths from the ground do, which turn the other way.
/// The judge has this many paths per point: with the fewer of them a tenth of the light is noticed.
pub fn ground_by_a_coarse_sphere(gpu: &Gpu, material: Material, segments: u32, paths: u32) -> Check<Complaint> {
    let mut scene = coarse_sphere(material, segments, LightKind::Environment { radiance: Vec3::splat(1e-6) });
    scene.materials.push(Material { emission: Vec3::splat(10.0), ..matt(0.0) });
    let (x, z) = (DVec3::X, DVec3::Z);
    scene.meshes.push(Mesh::parallelogram("ground", DVec3::new(-3.0, -1.2, -3.0), z * 6.0, x * 6.0, 1));
    scene.meshes.push(Mesh::parallelogram("lamp", DVec3::new(-4.0, 3.0, -4.0), x * 8.0, z * 8.0, 2));
    let places = [-2.0, -1.0, 0.0, 1.0, 2.0];
    let points: Vec<_> = places.iter().flat_map(|x| places.map(|z| (DVec3::new(*x, -1.2, z), DVec3::Y))).collect();
    let caustic = SceneSettings { caustic_photons: 5 * paths, caustic_radius: Some(0.2), rounds: 8, part: Part::Caustic, ..by_rounds() };
    let settings = of_coarse_spheres(caustic);
    let result = received(gpu, &scene, &settings, &points);
    let truth = Judge::new(&scene, 64).irradiance_at(&points, paths, 1);
    let count = points.len() as f64;
    let expected = truth.iter().map(|point| point.mean.caustic.x).sum::<f64>() / count;
    let error = (0..points.len()).map(|place| red(&result, place).1.powi(2)).sum::<f64>();
    let error = (error + truth.iter().map(|point| point.standard_error.caustic.x.powi(2)).sum::<f64>()).sqrt() / count;
    println!("{segments} segments: {} on the ground, {expected} +- {error} expected", mean_red(&result));
    assert!(error < if paths < 10_000 { 0.04 } else { 0.02 } * expected, "{error} of {expected}");
    estimate_check("the ground", mean_red(&result), expected, error)
}

/// A block of glass and a mirror in a furnace are not to be seen: all directions are equally bright, whatever way a path
/// takes, and however many paths a pixel has.
pub fn glass_in_a_furnace(gpu: &Gpu, samples: u32, final_gather: bool) -> Check<Complaint> {
    let mut room = scene("furnace");
    room.materials.extend([glass(1.5), Material { two_sided: true, ..mirror(1.0) }]);
    room.meshes.extend(sides(DVec3::new(0.1, 0.3, 0.1), DVec3::splat(0.25), false, [1; 6]));
    room.meshes.push(Mesh::parallelogram("mirror", DVec3::new(0.4, 0.1, 0.2), DVec3::X * 0.25, DVec3::Y * 0.25, 2));
    let settings = SceneSettings { samples, final_gather, shadow_rays: 2, photons: 20_000, rounds: 8, ..by_rounds() };
    let result = seen(gpu, &room, &settings, &room.cameras[0], [24, 24]);
    // Emission over what a wall absorbs.
    let expected = 1.0 / (1.0 - 0.5);
    let errors = (0..result.film.pixels()).map(|pixel| result.film.standard_error(pixel).x.powi(2)).sum::<f64>();
    let error = errors.sqrt() / result.film.pixels() as f64;
    println!("{samples} samples, gather {final_gather}: {} +- {error}, {expected} expected", mean_red(&result));
    assert!(error < 0.005 * expected, "{error}");
    estimate_check("a furnace with glass", mean_red(&result), expected, error.max(0.003 * expected))
}

/// All light of the photon map on the floors of a room and of a hall of its shape, 50 times as large, each with a lamp of as much power;
/// four times as many points of the hall are asked. Radii follow the density of photons, and the light is the same but for a factor.
pub fn room_beside_a_hall(gpu: &Gpu) -> Check<Complaint> {
    let mut scene = scene_of(Vec::new(), vec![matt(0.5), emissive(0.0), emissive(0.0)], vec![]);
    scene.materials[2].emission *= 2500.0;
    let places = [-1.6, -0.5, 0.7, 1.8].iter().flat_map(|x| [-1.9, -0.8, 0.9, 1.4].map(|z| DVec3::new(*x, 0.0, z)));
    let [hall, room] = [(50.0, DVec3::ZERO, 1), (1.0, DVec3::new(150.0, 0.0, 0.0), 2)].map(|(scale, way, lamp)| {
        let mut meshes = lamps::dark_room(DVec3::ZERO);
        meshes.push(level(2.9, [1.0, 1.0], false, lamp));
        meshes.iter_mut().flat_map(|mesh| &mut mesh.positions).for_each(|at| *at = *at * scale + way);
        scene.meshes.extend(meshes);
        places.clone().map(|at| (at * scale + way, DVec3::Y)).collect::<Vec<_>>()
    });
    let points = [vec![hall.clone(); 4].concat(), room.clone()].concat();
    let settings = SceneSettings { photons: 1 << 15, rounds: 48, illumination: Illumination::Photons, ..by_rounds() };
    let result = lamps::result_of(gpu, &scene, &settings, &points, true);
    let mean = |point: usize| result.film.mean(point).x;
    let ratios: Vec<f64> = (0..room.len()).map(|point| mean(4 * hall.len() + point) / mean(point) / 2500.0).collect();
    let count = ratios.len() as f64;
    let (ratio, deviation) = (ratios.iter().sum::<f64>() / count, (ratios.iter().map(|r| (r - 1.0).powi(2)).sum::<f64>() / count).sqrt());
    println!("{ratio:.4} of the hall's light, off by {deviation:.4} at a point");
    estimate_check("the room", ratio, 1.0, 0.02)?;
    estimate_check("a point's deviation", deviation, 0.0, 0.025)
}

/// A room of 1 m, lit on one side of a sheet across it at x = 1/2: the brightest place of the other side's floor, right behind the sheet.
pub fn behind_a_wall(gpu: &Gpu) -> Check<Complaint> {
    let mut room = scene("furnace");
    room.materials = vec![matt(0.7), emissive(0.5), Material { two_sided: true, ..matt(0.7) }];
    room.meshes.push(Mesh::parallelogram("wall", DVec3::X * 0.5, DVec3::Z, DVec3::Y, 2));
    room.meshes.push(Mesh::parallelogram("lamp", dvec3(0.1, 0.9, 0.3), DVec3::X * 0.2, DVec3::Z * 0.2, 1));
    let behind = [1e-5, 1e-4, 1e-3, 1e-2, 0.05];
    let points: Vec<_> =
        behind.iter().flat_map(|behind| [0.01, 0.3, 0.6, 0.999].map(|z| (dvec3(0.5 + behind, 0.0, z), DVec3::Y))).collect();
    let settings = SceneSettings { photons: 30_000, rounds: 4, radius: Some(0.1), ..by_rounds() };
    let found = means(&render(gpu, &room, &settings, Receivers::Points(&points))?);
    let (point, leaked) = pairs(&points, &found).max_by(|a, b| a.1.x.total_cmp(&b.1.x)).expect("points are asked for");
    Kind::Leak.unless(*leaked == DVec3::ZERO, || format!("{leaked} W/m2 at {}", point.0))
}

/// Plates, each a two-hundredth of the radius wide and in a plane of its own, in a furnace whose light all comes by photons.
pub fn tiny_plates(gpu: &Gpu) -> Check<Complaint> {
    let mut room = scene("furnace");
    let side = 10u32;
    let place = |k: u32| dvec3(f64::from(k % side), f64::from(k), f64::from(k / side % side)) / dvec3(10.0, 330.0, 10.0) + 0.0437;
    let width = 0.002;
    let places: Vec<DVec3> = (0..300).map(place).collect();
    room.materials.push(matt(0.0));
    room.meshes.extend(places.iter().map(|at| Mesh::parallelogram("plate", *at, DVec3::Z * width, DVec3::X * width, 1)));
    let points: Vec<_> = places.iter().map(|at| (*at + dvec3(0.4, 0.0, 0.3) * width, DVec3::Y)).collect();
    let settings =
        SceneSettings { photons: 100_000, rounds: 4, radius: Some(0.4), alpha: 1.0, illumination: Illumination::Photons, ..by_rounds() };
    let result = render(gpu, &room, &settings, Receivers::Points(&points))?;
    println!("plates: {} of 2 pi", mean_red(&result) / TAU);
    // Five hundred photons in all.
    estimate_check("the mean plate", mean_red(&result), TAU, 0.045 * TAU)
}

/// In a furnace all light is the same everywhere, and half of it has been scattered: that half, around a box that stands on a floor which
/// goes on below it.
pub fn beside_a_box(gpu: &Gpu) -> Check<Complaint> {
    let mut room = scene("furnace");
    let (low, high) = (dvec3(0.35, 0.0, 0.4), dvec3(0.6, 0.3, 0.7));
    // All but the one on which it stands.
    room.meshes.extend(sides(low, high - low, false, [0; 6]).split_off(1));
    let around = |aside: f64| {
        let (before, behind) = (low - aside, high + aside);
        [(before.x, 0.55), (0.5, before.z), (behind.x, 0.5), (behind.x, behind.z), (before.x, low.z)]
            .map(|(x, z)| (dvec3(x, 0.0, z), DVec3::Y))
    };
    let points: Vec<_> = [0.001, 0.004, 0.01, 0.02].into_iter().flat_map(around).collect();
    let settings = SceneSettings { photons: 30_000, rounds: 32, radius: Some(0.1), part: Part::Indirect, ..by_rounds() };
    let result = render(gpu, &room, &settings, Receivers::Points(&points))?;
    for (place, (point, _)) in points.iter().enumerate() {
        let error = result.film.stated_error(place).x;
        estimate_check(&format!("beside the box at {point}"), result.film.mean(place).x, PI, error)?;
    }
    // The points lie within each other's discs, so that their mean is little better known than one of them.
    estimate_check("all around the box", mean_red(&result), PI, 0.02 * PI)
}
