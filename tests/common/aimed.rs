//! Small scenes with a caustic under each kind of light, and whether aimed photons light them as others do.

use super::known::kept;
use super::prelude::*;
use photonmill::verify::selfcheck::Estimate;
use photonmill::verify::selfcheck::measure::estimate_of;

const BALL: DVec3 = DVec3::new(0.0, 0.5, 0.0);

/// A ball of glass over a black floor.
fn bench(lights: Vec<LightKind>) -> Scene {
    let ball = Mesh::sphere("ball", BALL, 0.25, 24, 1);
    scene_of(vec![level(0.0, [2.0; 2], true, 0), ball], vec![matt(0.0), glass(1.5), mirror(0.9)], lights)
}

fn bulb(position: DVec3) -> LightKind {
    LightKind::Point { position, intensity: Vec3::new(1.0, 0.5, 0.2) }
}

/// A half sphere, open downwards, that reflects on both sides.
fn bowl(centre: DVec3, radius: f64) -> Mesh {
    let mut bowl = Mesh::sphere("bowl", centre, radius, 24, 3);
    bowl.triangles.retain(|triangle| triangle.iter().all(|vertex| bowl.positions[*vertex as usize].y > centre.y - 1e-9));
    bowl
}

fn tilted_disc(normal: DVec3, law: EmissionLaw) -> LightKind {
    disc(DVec3::new(0.3, 1.5, 0.1), normal.normalize(), 0.1, law)
}

/// Two more balls, which from a light lie before one another.
fn balls_in_a_row(light: LightKind) -> Scene {
    let mut scene = bench(vec![light]);
    scene.meshes.push(Mesh::sphere("small ball", DVec3::new(0.1, 0.95, 0.02), 0.12, 24, 1));
    scene.meshes.push(Mesh::sphere("smaller ball", DVec3::new(0.35, 0.8, 0.0), 0.08, 24, 1));
    scene
}

type Named = (&'static str, fn() -> Scene);

pub const SCENES: [Named; 11] = [
    ("point", || bench(vec![bulb(DVec3::new(0.5, 1.4, 0.2))])),
    ("spot", || {
        // Its falloff crosses the ball.
        let position = DVec3::new(0.4, 1.5, 0.0);
        let direction = (DVec3::X * 0.2 + BALL - position).normalize();
        bench(vec![LightKind::Spot { position, direction, intensity: Vec3::ONE, inner_angle: 0.1, outer_angle: 0.35 }])
    }),
    ("cosine disc", || bench(vec![tilted_disc(DVec3::new(0.3, -1.0, 0.0), EmissionLaw::Cosine)])),
    // Its plane cuts the ball.
    ("grazing disc", || bench(vec![tilted_disc(DVec3::new(0.9, -0.25, 0.0), EmissionLaw::Uniform)])),
    ("sun", || bench(vec![sun(DVec3::new(-0.3, -1.0, 0.2))])),
    ("sky", || bench(vec![LightKind::Environment { radiance: Vec3::ONE }])),
    // A textured panel that faces the ball with one side, and two panels that emit from one side only or from none.
    ("two-sided triangles", || {
        let mut scene = bench(vec![]);
        let emission_texture = Some(TextureUse::of(0, 0));
        scene.materials.push(Material { two_sided: true, emission_texture, ..emissive(0.0) });
        scene.materials.push(emissive(0.0));
        scene.textures = vec![texture(2, vec![Vec3::ONE, Vec3::new(0.1, 0.4, 0.2)], [Wrap::Clamp; 2])];
        let (y, z) = (DVec3::Y * 0.4, DVec3::Z * 0.4);
        scene.meshes.push(Mesh::parallelogram("panel", DVec3::new(0.6, 0.8, -0.2), y, z, 3));
        scene.meshes.push(Mesh::parallelogram("towards", DVec3::new(-0.7, 0.8, -0.2), y, z, 4));
        scene.meshes.push(Mesh::parallelogram("away", DVec3::new(-0.2, 0.8, -0.7), DVec3::X * 0.4, y, 4));
        scene
    }),
    ("overlapping cones", || balls_in_a_row(bulb(DVec3::new(0.2, 1.5, 0.0)))),
    ("overlapping discs", || balls_in_a_row(sun(DVec3::new(-0.2, -1.0, 0.0)))),
    // Of the light of one, all directions are kept.
    ("lamps in and out of a bowl", || {
        let mut scene = bench(vec![bulb(DVec3::new(-0.5, 1.4, 0.0)), bulb(DVec3::new(0.45, 1.42, 0.1))]);
        scene.materials.push(Material { two_sided: true, ..mirror(0.9) });
        scene.meshes.push(bowl(DVec3::new(0.5, 1.4, 0.1), 0.12));
        scene
    }),
    // The wall's sphere is so large that it holds the ball and nearly the lamp.
    ("a ball before a mirror wall", || {
        let mut scene = bench(vec![bulb(DVec3::new(0.4, 1.6, 0.0))]);
        scene.meshes.push(Mesh::parallelogram("wall", DVec3::new(-0.4, 0.0, -0.4), DVec3::Y * 0.9, DVec3::Z * 0.8, 2));
        scene
    }),
];

pub fn scene(kind: &str) -> Scene {
    let (_, made) = SCENES.iter().find(|(known, _)| *known == kind).unwrap_or_else(|| panic!("there is no {kind}"));
    made()
}

/// What some of these scenes need, all have: one set of kernels serves them all.
pub fn settings(photons: u32, aim: bool) -> SceneSettings {
    let caustic = SceneSettings { part: Part::Caustic, caustic_radius: Some(0.2), alpha: 1.0, ..by_rounds() };
    let with = vec![Effect::SmoothNormals, Effect::SpecularChains, Effect::Textures];
    kept(SceneSettings { caustic_photons: photons, aim, bounces: 12, rounds: 1, with, ..caustic })
}

/// Runs of other seeds on either side.
const RUNS: u64 = 32;

/// Mean of independent values and its standard error.
pub fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let Estimate { mean, standard_error } = estimate_of(values);
    (mean, standard_error)
}

/// The same of each channel.
pub fn mean_of_all(values: &[DVec3]) -> (DVec3, DVec3) {
    let of = [0, 1, 2].map(|channel| mean_and_error(&values.iter().map(|value| value[channel]).collect::<Vec<_>>()));
    (of.map(|(mean, _)| mean).into(), of.map(|(_, error)| error).into())
}

/// Adds the light of all photons and that of aimed ones: over the floor, in each channel that differs, and at each point
/// that has more than a fifth of the brightest. The runs have so many photons of all directions and so many aimed ones each. Returns
/// how many times as large the error of the whole would be by as many photons that are not aimed.
pub fn compare(gpu: &Gpu, kind: &str, photons: [u32; 2], family: &mut Family) -> f64 {
    let (scene, points) = (scene(kind), grid(0.0, DVec3::Y, 4));
    let of = |photons, aim, first| irradiances(gpu, &scene, &settings(photons, aim), &points, first..first + RUNS);
    let (all, aimed) = (of(photons[0], false, 1), of(photons[1], true, 100));
    let mut expect = |what: String, value: &dyn Fn(&[DVec3]) -> f64| {
        let [(expected, expected_error), (found, error)] =
            [&all, &aimed].map(|runs| mean_and_error(&runs.iter().map(|run| value(run)).collect::<Vec<_>>()));
        family.expect_estimate(what, found, error.hypot(expected_error), RUNS as u32, expected);
        expected_error / error * f64::from(photons[0]).sqrt() / f64::from(photons[1]).sqrt()
    };
    let gain = expect(format!("{kind}: whole"), &|run| run.iter().map(|light| light.x).sum());
    expect(format!("{kind}: blue"), &|run| run.iter().map(|light| light.z).sum());
    let brightness = |place: usize| all.iter().map(|run| run[place].x).sum::<f64>();
    let brightest = (0..points.len()).map(brightness).fold(0.0, f64::max);
    for place in (0..points.len()).filter(|place| brightness(*place) > 0.2 * brightest) {
        expect(format!("{kind}: point {place}"), &|run| run[place].x);
    }
    gain
}

/// Whether aimed photons bring as much light, to some per cent.
pub fn same_light(gpu: &Gpu, kind: &str) -> Check<Complaint> {
    let mut family = Family::default();
    compare(gpu, kind, [16_000, 4_000], &mut family);
    family.complaint()
}

/// A light beyond everything, of which a millionth meets the ball, lights as a sun does that is as strong at the ball.
pub fn far_lamp() -> [Scene; 2] {
    let way = DVec3::new(30.0, 100.0, 20.0);
    let far = LightKind::Point { position: BALL + way, intensity: Vec3::splat(way.length_squared() as f32) };
    [far, sun(-way)].map(|kind| bench(vec![kind]))
}
