//! Rooms with lamps of which only some are seen from a place, each as a check of a device.

use std::sync::Arc;

use glam::dvec3;

use super::known::of_any_room;
use super::prelude::*;
use crate::tests::engine::unseen_light::room_without_floor;
use photonmill::engine::scene::{Receivers, RunResult, Viewpoint, trial};

fn lamp_of(radiance: f32) -> Material {
    Material { emission: Vec3::splat(radiance), ..matt(0.0) }
}

/// A closed room of 4 x 4 x 3 m around a place, without a lamp.
pub fn dark_room(at: DVec3) -> Vec<Mesh> {
    let mut meshes = [room_without_floor(0.0), vec![level(0.0, [4.0, 4.0], true, 0)]].concat();
    meshes.iter_mut().flat_map(|mesh| &mut mesh.positions).for_each(|position| *position += at);
    meshes
}

fn square_lamp(at: DVec3, width: f64, material: usize) -> Mesh {
    let mut lamp = level(0.0, [width; 2], false, material);
    lamp.positions.iter_mut().for_each(|position| *position += at);
    lamp
}

/// From one room to the next.
pub const ROOM: DVec3 = DVec3::new(6.0, 0.0, 0.0);

/// Rooms side by side, each with a lamp of this radiance.
pub fn rooms(radiances: &[f32]) -> Scene {
    let mut scene = scene_of(Vec::new(), vec![matt(0.5)], vec![]);
    for (number, radiance) in radiances.iter().enumerate() {
        let at = number as f64 * ROOM;
        scene.meshes.extend(dark_room(at));
        scene.meshes.push(square_lamp(at + 2.9 * DVec3::Y, 1.0, number + 1));
        scene.materials.push(lamp_of(*radiance));
    }
    scene
}

/// Points on the floor and two walls of the first room.
pub fn points() -> Vec<(DVec3, DVec3)> {
    let places = [-1.9, -1.0, 0.1, 1.2, 1.9];
    let floor = places.iter().flat_map(|x| places.map(|z| (dvec3(*x, 0.0, z), DVec3::Y)));
    let right = places.iter().flat_map(|y| places.map(|z| (dvec3(2.0, 1.4 + 0.7 * y, z), DVec3::NEG_X)));
    let back = places.iter().flat_map(|x| [0.2, 1.6].map(|y| (dvec3(*x, y, -2.0), DVec3::Z)));
    floor.chain(right).chain(back).collect()
}

/// What a device would do for points: by what a trial sees of the lights, or without one.
pub fn planned(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, points: &[(DVec3, DVec3)], by_sight: bool) -> (Geometry, ScenePlan) {
    let receivers = Receivers::Points(points);
    if !by_sight {
        return scene_plan(gpu, scene, settings, receivers.sensor()).unwrap();
    }
    let geometry = Geometry::new(scene).unwrap();
    let viewpoint = Viewpoint { geometry: &geometry, camera: None, phases: &receivers.phases(&geometry) };
    let plan = trial::plan(gpu, scene, &viewpoint, settings, receivers.sensor()).unwrap();
    (geometry, plan)
}

/// Irradiance at points by such a plan.
pub fn result_of_plan(gpu: &Gpu, (geometry, plan): (Geometry, ScenePlan), points: &[(DVec3, DVec3)]) -> RunResult {
    super::rendered::light(
        gpu,
        &Viewpoint { geometry: &geometry, camera: None, phases: &Receivers::Points(points).phases(&geometry) },
        plan,
    )
}

pub fn result_of(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, points: &[(DVec3, DVec3)], by_sight: bool) -> RunResult {
    result_of_plan(gpu, planned(gpu, scene, settings, points, by_sight), points)
}

pub fn usual() -> SceneSettings {
    of_any_room(SceneSettings { paranoid: true, ..by_rounds() })
}

/// No photons, for which a trial would make kernels.
fn direct(rounds: u32) -> SceneSettings {
    SceneSettings { rounds, without: vec![Effect::Indirect], ..usual() }
}

/// Whether the first points of a run have the light of another run within both errors, and no more than so many times its variance,
/// relative to the light, on average.
pub fn same_light_and_noise(what: &str, found: &RunResult, expected: &RunResult, most: f64) -> Check<Complaint> {
    let mut family = Family::default();
    let (mut variance, mut allowed) = (0.0, 0.0);
    for point in 0..expected.film.pixels() {
        let ((mean, error), (other, other_error)) = (red(found, point), red(expected, point));
        family.expect(format!("{what}, point {point}"), mean, other, error.hypot(other_error));
        variance += (error / other).powi(2);
        allowed += (other_error / other).powi(2);
    }
    family.complaint()?;
    let ratio = variance / allowed;
    println!("{what}: {ratio:.3} times the variance");
    Kind::TooNoisy.unless(ratio <= most, || format!("{what}: {ratio} times the variance, {most} may be"))
}

/// Direct light of a room beside one whose lamp is so many times as strong, compared with that of the room alone.
pub fn dim_room(gpu: &Gpu, ratio: f32, by_sight: bool) -> Check<Complaint> {
    let alone = result_of(gpu, &rooms(&[1.0]), &direct(128), &points(), false);
    let both = [points(), points().into_iter().map(|(at, normal)| (at + ROOM, normal)).collect()].concat();
    let found = result_of(gpu, &rooms(&[1.0, ratio]), &direct(128), &both, by_sight);
    same_light_and_noise(&format!("a room beside one of {ratio:e}"), &found, &alone, 3.0)
}

/// A room under a lamp of 3 m that is cut into so many squares a side, each by itself.
pub fn cut_lamp(side: u32) -> Scene {
    let width = 3.0 / f64::from(side);
    let place = |k: u32| (f64::from(k) + 0.5) * width - 1.5;
    let mut lamps = Mesh { name: "lamps".into(), material: 1, ..Mesh::default() };
    for k in 0..side * side {
        let square = square_lamp(dvec3(place(k % side), 2.9, place(k / side)), width, 1);
        let first = lamps.positions.len() as u32;
        lamps.triangles.extend(square.triangles.iter().map(|triangle| triangle.map(|corner| corner + first)));
        lamps.positions.extend(square.positions);
        lamps.uvs[0].extend(&square.uvs[0]);
    }
    scene_of([dark_room(DVec3::ZERO), vec![lamps]].concat(), vec![matt(0.5), lamp_of(1.0)], vec![])
}

/// Direct light of a lamp of many pieces, compared with that of the lamp as one.
pub fn many_lamps(gpu: &Gpu, side: u32, by_sight: bool) -> Check<Complaint> {
    let whole = result_of(gpu, &cut_lamp(1), &direct(128), &points(), false);
    let found = result_of(gpu, &cut_lamp(side), &direct(128), &points(), by_sight);
    same_light_and_noise(&format!("{side} x {side} lamps"), &found, &whole, 2.0)
}

/// Two lamps in a room, one of which the trial is made to have missed: it lights as before.
pub fn missed_lamp(gpu: &Gpu) -> Check<Complaint> {
    let lamps = [-1.0, 1.0].map(|x| square_lamp(dvec3(x, 2.9, 0.5), 0.6, 1)).to_vec();
    let scene = scene_of([dark_room(DVec3::ZERO), lamps].concat(), vec![matt(0.5), lamp_of(1.0)], vec![]);
    let floor: Vec<_> = points().into_iter().take(25).collect();
    let by_power = result_of(gpu, &scene, &direct(256), &floor, false);
    let (geometry, mut plan) = planned(gpu, &scene, &direct(256), &floor, true);
    let lights = Arc::make_mut(plan.trial.as_mut().and_then(|trial| trial.lights.as_mut()).expect("a trial learned of lights"));
    assert_eq!(lights.clusters, 4);
    lights.shares = [0.5, 1.0, 1.0, 1.0, 0.0, 0.0, 0.5, 1.0].repeat(lights.shares.len() / 8);
    let missed = result_of_plan(gpu, (geometry, plan), &floor);
    // One place in four asks for it, so that it has far more noise.
    same_light_and_noise("a lamp that the trial missed", &missed, &by_power, f64::INFINITY)
}

/// The same rooms, in which a screen below the first lamp hides it from the floor.
pub fn screened(mut rooms: Scene) -> Scene {
    let material = rooms.materials.len();
    rooms.materials.push(Material { two_sided: true, ..matt(0.5) });
    rooms.meshes.push(level(2.6, [2.4; 2], true, material));
    rooms
}

/// All light of the first of these rooms, from defaults but for fewer photons, compared with that of the room alone.
pub fn scattered_light(gpu: &Gpu, ratio: f32, by_sight: bool) -> Check<Complaint> {
    let settings = SceneSettings { photons: 1 << 15, ..usual() };
    let all = |scene: &Scene| match by_sight {
        true => render(gpu, scene, &settings, Receivers::Points(&points())).unwrap(),
        false => result_of(gpu, scene, &settings, &points(), false),
    };
    let [alone, found] = [all(&rooms(&[1.0])), all(&rooms(&[1.0, ratio]))];
    let unknown = found.film.unknown(0.95);
    let is_known = unknown.unreached == 0 && unknown.absent.is_empty();
    Kind::TooDark.unless(is_known, || unknown.text("point", "W/m2", 0.95, found.film.rounds))?;
    let sums = |result: &RunResult, of: &dyn Fn(&RunResult, usize) -> f64| (0..points().len()).map(|point| of(result, point)).sum::<f64>();
    let means = [&alone, &found].map(|result| sums(result, &|result, point| red(result, point).0));
    let noise = [&alone, &found].map(|result| sums(result, &|result, point| (red(result, point).1 / red(&alone, point).0).powi(2)));
    println!("1:{ratio:e}: {:.4} of the light, {:.3} times the variance", means[1] / means[0], noise[1] / noise[0]);
    relative_check("all light", means[1], means[0], 0.03).map_err(|text| Complaint::new(Kind::TooDark, text))?;
    relative_check("variance", noise[1].max(noise[0]), noise[0], 2.0).map_err(|text| Complaint::new(Kind::TooNoisy, text))
}

/// A lamp that lights no point itself, but the ceiling that lights them, beside a room whose lamp is so many times as strong.
pub fn hidden_lamp(gpu: &Gpu, ratio: f32, by_sight: bool) -> Check<Complaint> {
    let floor: Vec<_> = points().into_iter().take(25).collect();
    let settings = SceneSettings { photons: 1 << 14, rounds: 24, radius: Some(0.4), part: Part::Indirect, ..usual() };
    let alone = result_of(gpu, &screened(rooms(&[1.0])), &settings, &floor, false);
    let found = result_of(gpu, &screened(rooms(&[1.0, ratio])), &settings, &floor, by_sight);
    same_light_and_noise(&format!("a hidden lamp beside one of {ratio:e}"), &found, &alone, 4.0)
}

/// A screen of 2 x 2 m, 1.5 m above a floor, that wears a picture of 256 x 256 texels twice along each side. Four texels are 6e4 times
/// as bright as the others and give four fifths of the light.
fn screen(wrap: Wrap) -> Scene {
    let mut texels = vec![Vec3::splat(1.0); 1 << 16];
    [(70, 201), (71, 201), (70, 202), (71, 202)].into_iter().for_each(|(i, j)| texels[j * 256 + i] = Vec3::splat(6e4));
    let mut mesh = level(1.5, [2.0; 2], false, 1);
    mesh.uvs[0].iter_mut().for_each(|uv| *uv = 2.0 * *uv - DVec2::splat(0.5));
    let lamp = Material { emission_texture: Some(TextureUse::of(0, 0)), ..lamp_of(1.0) };
    let mut scene = scene_of(vec![level(0.0, [4.0; 2], true, 0), mesh], vec![matt(0.0), lamp], vec![]);
    scene.textures = vec![texture(256, texels, [wrap; 2])];
    scene
}

/// Points under a screen with a small bright spot have its light, and the error is as small as the light is even there.
pub fn bright_spot(gpu: &Gpu, wrap: Wrap, illumination: Illumination) -> Check<Complaint> {
    let scene = screen(wrap);
    let (texture, mesh) = (&scene.textures[0], &scene.meshes[1]);
    let points: Vec<_> = [(0.1, 0.0), (-0.9, 0.4), (0.6, 0.8)].map(|(x, z)| (dvec3(x, 0.0, z), DVec3::Y)).into();
    let settings = SceneSettings { illumination, photons: 1 << 14, rounds: 64, radius: Some(0.1), alpha: 1.0, ..by_rounds() };
    let found = result_of(gpu, &scene, &settings, &points, false);
    // Between four places a texel samples are linear.
    let steps = 1024;
    let (origin, u, v) = (mesh.positions[0], mesh.positions[1] - mesh.positions[0], mesh.positions[3] - mesh.positions[0]);
    for (number, (point, _)) in points.iter().enumerate() {
        let of_place = |place: usize| {
            let at = DVec2::new((place % steps) as f64 + 0.5, (place / steps) as f64 + 0.5) / steps as f64;
            let (a, b, d) = (mesh.uvs[0][0], mesh.uvs[0][1], mesh.uvs[0][3]);
            let way = origin + at.x * u + at.y * v - *point;
            let radiance = texture.sample(a + at.x * (b - a) + at.y * (d - a));
            f64::from(radiance.x) * way.y * way.y / way.length_squared().powi(2)
        };
        let right = (0..steps * steps).map(of_place).sum::<f64>() * 4.0 / (steps * steps) as f64;
        let (mean, error) = (found.film.mean(number).x, found.film.stated_error(number).x);
        println!("{wrap:?}, {illumination:?}: {mean:.4} +- {error:.4}, {right:.4} is right");
        let is_right = (mean - right).abs() <= 4.0 * error && error < 0.1 * right;
        let kind = if mean < right { Kind::TooDark } else { Kind::TooBright };
        kind.unless(is_right, || format!("{wrap:?}, {illumination:?}: {mean} +- {error} at {point} instead of {right}"))?;
    }
    Ok(())
}
