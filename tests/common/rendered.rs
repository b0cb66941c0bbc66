//! Scenes of triangles, lit to the end: irradiance at points, radiance along a ray.

use std::ops::Range;

use super::estimate_check;
use super::prelude::*;
use photonmill::engine::scene::{self, Receivers, RunResult, Viewpoint, trial};
use photonmill::render::PreparedScene;
use photonmill::verify::selfcheck::Estimate;

/// The default settings with blocks of one round: few rounds give the error well.
pub fn by_rounds() -> SceneSettings {
    SceneSettings { rounds: 16, block: Some(1), ..SceneSettings::default() }
}

/// Builders of a scene that trace in ways of their own.
const SCENE_BUILDERS: [Builder; 2] = [Builder::Ballot, Builder::Persistent];
pub const BOTH: [Illumination; 2] = [Illumination::Split, Illumination::Photons];

/// Lights a scene to the end of the run, with default radii from a trial round.
pub fn render(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, receivers: Receivers) -> Result<RunResult, Error> {
    let prepared = PreparedScene::new(scene.clone()).prepare_with(settings, receivers)?;
    prepared.light(gpu, prepared.plan_on(gpu, settings)?, &mut Control::default())
}

/// The geometry of a scene and what a device would do with it, or why not.
pub fn scene_plan(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, sensor: Sensor) -> Result<(Geometry, ScenePlan), Error> {
    let geometry = Geometry::new(&scene.without(&settings.without))?;
    let plan = ScenePlan::new(scene, &geometry, settings, sensor, &engine::limits(gpu.facts()))?;
    Ok((geometry, plan))
}

/// What devices within these limits would do, or why not.
pub fn scene_plan_within(limits: &Limits, scene: &Scene, settings: &SceneSettings, sensor: Sensor) -> Result<ScenePlan, Error> {
    ScenePlan::new(scene, &Geometry::new(scene)?, settings, sensor, limits)
}

/// A picture of a square of so many pixels.
pub fn square_picture(side: u32) -> Sensor {
    Sensor::Picture { width: side, height: side }
}

/// Runs to the end, whatever comes out.
pub fn run(gpu: &Gpu, viewpoint: &Viewpoint, plan: ScenePlan) -> RunResult {
    scene::light(gpu, viewpoint, plan, &mut Control::default()).unwrap()
}

/// Runs to the end, with nothing odd.
pub fn light(gpu: &Gpu, viewpoint: &Viewpoint, plan: ScenePlan) -> RunResult {
    let result = run(gpu, viewpoint, plan);
    assert_eq!(result.film.anomalies[..3], [0, 0, 0], "values that are no number, or too large for the film");
    if let Some(nonfinite_values) = &result.nonfinite_values {
        assert_eq!(nonfinite_values.count, 0, "{}", nonfinite_values.text());
    }
    result
}

/// What arrives at points (position, normal) of a scene of triangles.
pub fn received(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, points: &[(DVec3, DVec3)]) -> RunResult {
    received_within(gpu, scene, settings, points, &engine::limits(gpu.facts()))
}

/// The same within other limits than the device's own.
pub fn received_within(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, points: &[(DVec3, DVec3)], limits: &Limits) -> RunResult {
    result_for(gpu, (scene, &Geometry::new(scene).unwrap()), settings, Receivers::Points(points), limits)
}

/// With radii by the scene's area, and the device looking for values that are no finite number.
fn result_for(gpu: &Gpu, scene: (&Scene, &Geometry), settings: &SceneSettings, receivers: Receivers, limits: &Limits) -> RunResult {
    let (scene, geometry) = scene;
    // Values of tiles with more samples have no names.
    let settings = SceneSettings { paranoid: settings.tiles.is_none(), ..settings.clone() };
    let plan = ScenePlan::new(scene, geometry, &settings, receivers.sensor(), limits).unwrap();
    light(gpu, &Viewpoint { geometry, camera: receivers.camera(), phases: &receivers.phases(geometry) }, plan)
}

/// Fails unless every builder comes to the same fates and sums in a short run: what one of them shows of these settings then
/// holds for all.
pub fn assert_builders_agree(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, points: &[(DVec3, DVec3)]) {
    let [photons, caustic_photons] = [settings.photons, settings.caustic_photons].map(|photons| photons.min(3001));
    let found = SCENE_BUILDERS.map(|builder| {
        received(gpu, scene, &SceneSettings { builder: Some(builder), photons, caustic_photons, rounds: 1, ..settings.clone() }, points)
    });
    assert!(found[0].film.sums.iter().any(|sum| *sum > 0), "nothing is lit: {settings:?}");
    for other in &found[1..] {
        assert_holds(format!("{:?}", other.plan.settings), equal_sums("light", &other.film.sums, &found[0].film.sums));
        assert_eq!(other.fates, found[0].fates, "{:?}", other.plan.settings);
    }
}

/// What a camera sees of a scene of triangles.
pub fn seen(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, camera: &Camera, size: [u32; 2]) -> RunResult {
    let (geometry, receivers) = (Geometry::new(scene).unwrap(), Receivers::Image(camera, size));
    result_for(gpu, (scene, &geometry), settings, receivers, &engine::limits(gpu.facts()))
}

/// Red mean and standard error of a pixel or point.
pub fn red(result: &RunResult, place: usize) -> (f64, f64) {
    (result.film.mean(place).x, result.film.standard_error(place).x)
}

/// Fails unless the red channel of a pixel or point is known to some share of what is right; it must be right to its error, or to another
/// share if that is more.
pub fn red_check(what: &str, result: &RunResult, place: usize, expected: f64, [known_to, right_to]: [f64; 2]) -> Check<Complaint> {
    let (found, error) = red(result, place);
    println!("{what}: {found} +- {error}, {expected} expected");
    assert!(error < known_to * expected, "{what}: {found} +- {error}");
    estimate_check(what, found, expected, error.max(right_to * expected))
}

/// Mean of the red channel over all pixels or points.
pub fn mean_red(result: &RunResult) -> f64 {
    result.film.means().map(|mean| mean.x).sum::<f64>() / result.film.pixels() as f64
}

/// Standard error of every pixel or point.
pub fn standard_errors(result: &RunResult) -> Vec<DVec3> {
    (0..result.film.pixels()).map(|place| result.film.standard_error(place)).collect()
}

/// Mean of every pixel or point.
pub fn means(result: &RunResult) -> Vec<DVec3> {
    result.film.means().collect()
}

/// Irradiance at points, W/m2, of each of several runs of other seeds.
pub fn irradiances(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, points: &[(DVec3, DVec3)], seeds: Range<u64>) -> Vec<Vec<DVec3>> {
    let (geometry, limits) = (Geometry::new(scene).unwrap(), engine::limits(gpu.facts()));
    let settings_of = |seed| SceneSettings { seed, ..settings.clone() };
    seeds.map(|seed| means(&result_for(gpu, (scene, &geometry), &settings_of(seed), Receivers::Points(points), &limits))).collect()
}

/// Radiance along one ray, W/m2/sr, once for each pixel of a picture so narrow that they are all but the same ray;
/// pixels draw random numbers of their own. The red channel of a grey scene.
pub fn radiances(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, eye: DVec3, receivers: DVec3, side: u32) -> Vec<f64> {
    let up = if (receivers - eye).normalize().y.abs() > 0.9 { DVec3::X } else { DVec3::Y };
    let camera = Camera::looking_at("ray", eye, receivers, up, 2e-4);
    means(&seen(gpu, scene, settings, &camera, [side, side])).into_iter().map(|mean| mean.x).collect()
}

pub fn scene_of(meshes: Vec<Mesh>, materials: Vec<Material>, lights: Vec<LightKind>) -> Scene {
    Scene { meshes, materials, lights: lights.into_iter().map(lamp).collect(), ..Scene::default() }
}

/// Scatters this share evenly.
pub fn matt(albedo: f32) -> Material {
    Material::lambert("matt", Vec3::splat(albedo))
}

/// Scatters this share, and emits 1 W/m2/sr.
pub fn emissive(albedo: f32) -> Material {
    Material { emission: Vec3::ONE, ..matt(albedo) }
}

pub fn mirror(reflectance: f32) -> Material {
    Material { surface: Surface::Mirror, ..matt(reflectance) }
}

pub fn glass(ior: f32) -> Material {
    Material { surface: Surface::Dielectric { ior }, ..matt(1.0) }
}

/// A horizontal rectangle around the y axis, `width` along x and `depth` along z, that faces up or down.
pub fn level(height: f64, [width, depth]: [f64; 2], faces_up: bool, material: usize) -> Mesh {
    let corner = DVec3::new(-0.5 * width, height, -0.5 * depth);
    let (x, z) = (DVec3::X * width, DVec3::Z * depth);
    if faces_up { Mesh::parallelogram("level", corner, z, x, material) } else { Mesh::parallelogram("level", corner, x, z, material) }
}

/// The four sides of a square shaft of 1 m around the y axis, that face its inside.
pub fn shaft(bottom: f64, top: f64, material: usize) -> Vec<Mesh> {
    let (x, z, y) = (DVec3::X, DVec3::Z, DVec3::Y * (top - bottom));
    let corner = DVec3::new(-0.5, bottom, -0.5);
    let sides = [(corner, x, y), (corner, y, z), (corner + x, z, y), (corner + z, y, x)];
    sides.into_iter().map(|(origin, u, v)| Mesh::parallelogram("side", origin, u, v, material)).collect()
}

/// Middles of n x n squares of a horizontal square of 1 m around the y axis.
pub fn grid(height: f64, normal: DVec3, n: usize) -> Vec<(DVec3, DVec3)> {
    let place = |i: usize| (i as f64 + 0.5) / n as f64 - 0.5;
    (0..n * n).map(|k| (DVec3::new(place(k % n), height, place(k / n)), normal)).collect()
}

/// A built-in scene.
pub fn scene(name: &str) -> Scene {
    built_in::by_name(name).unwrap_or_else(|| panic!("there is no scene {name}"))
}

/// A light of every kind above the floor of a room of this size, m: intensities and watts go with its square.
pub fn every_kind_of_light(size: f64, of_sun: f32, law: EmissionLaw) -> Vec<Light> {
    let (position, strength) = (DVec3::new(0.5, 0.6, 0.5) * size, (size * size) as f32);
    let [bulb, spot, watts] = [0.5, 6.0, 2.0].map(|share| Vec3::splat(share) * strength);
    let sun = LightKind::Directional { direction: DVec3::new(0.0, -0.3, -1.0).normalize(), irradiance: Vec3::splat(of_sun) };
    let centre = DVec3::new(0.5, 0.0, 0.8) * size;
    let kinds = [
        LightKind::Point { position, intensity: bulb },
        LightKind::Spot { position, direction: DVec3::NEG_Y, intensity: spot, inner_angle: 0.3, outer_angle: 0.6 },
        sun,
        LightKind::Disc { centre, normal: DVec3::Y, radius: 0.05 * size, power: watts, law },
        LightKind::Environment { radiance: Vec3::splat(0.1) },
    ];
    kinds.map(lamp).into()
}

/// A light without a name of its own.
pub fn lamp(kind: LightKind) -> Light {
    Light { name: "light".into(), kind }
}

/// Maps alone, of a radius so small that looking them up takes no time.
pub fn flights(photons: u32, bounces: u32) -> SceneSettings {
    mapped(photons, 1, bounces, 1.0 / 1024.0)
}

/// All light from photons within a fixed radius.
pub fn mapped(photons: u32, rounds: u32, bounces: u32, radius: f64) -> SceneSettings {
    let radius = Some(radius);
    SceneSettings { illumination: Illumination::Photons, photons, rounds, bounces, radius, alpha: 1.0, ..by_rounds() }
}

/// A fixed radius for both maps, which have as many photons.
pub fn fixed_radius(illumination: Illumination, photons: u32, rounds: u32, bounces: u32, radius: f64) -> SceneSettings {
    let caustic = SceneSettings { caustic_photons: photons, caustic_radius: Some(radius), shadow_rays: 1, ..by_rounds() };
    SceneSettings { illumination, photons, rounds, bounces, radius: Some(radius), alpha: 1.0, ..caustic }
}

/// A sun of 1 W/m2, whatever the length of its direction.
pub fn sun(direction: DVec3) -> LightKind {
    LightKind::Directional { direction: direction.normalize(), irradiance: Vec3::ONE }
}

/// A point light of 1 W/sr.
pub fn point(position: DVec3) -> LightKind {
    LightKind::Point { position, intensity: Vec3::ONE }
}

/// The same light within a cone.
pub fn cone(position: DVec3, direction: DVec3, angle: f32) -> LightKind {
    LightKind::Spot { position, direction, intensity: Vec3::ONE, inner_angle: angle, outer_angle: angle }
}

/// 10 MW/sr in a cone so narrow that all of its directions are nearly one, and its watts.
pub fn beam(position: DVec3, direction: DVec3) -> (LightKind, f64) {
    let (angle, intensity) = (3.5e-4f32, 1e7);
    let kind = LightKind::Spot { position, direction, intensity: Vec3::splat(intensity), inner_angle: angle, outer_angle: angle };
    (kind, TAU * (1.0 - f64::from(angle).cos()) * f64::from(intensity))
}

/// A disc of 1 W.
pub fn disc(centre: DVec3, normal: DVec3, radius: f64, law: EmissionLaw) -> LightKind {
    LightKind::Disc { centre, normal, radius, power: Vec3::ONE, law }
}

/// A picture of so many texels a row, linear between them.
pub fn texture(width: u32, texels: impl Into<Texels>, wrap: [Wrap; 2]) -> Texture {
    let texels = texels.into();
    Texture { name: "picture".into(), width, height: texels.count() as u32 / width, texels, wrap, filter: Default::default() }
}

/// A scene with all its points moved.
pub fn moved(mut scene: Scene, way: impl Fn(DVec3) -> DVec3) -> Scene {
    scene.meshes.iter_mut().flat_map(|mesh| &mut mesh.positions).for_each(|at| *at = way(*at));
    scene
}

/// A parallelogram of `n` x `n` x 2 triangles.
pub fn tessellated(name: &str, origin: DVec3, u: DVec3, v: DVec3, n: u32) -> Mesh {
    let place = |i: u32, j: u32| origin + u * (f64::from(i) / f64::from(n)) + v * (f64::from(j) / f64::from(n));
    let corners = move |i: u32, j: u32| [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| j * (n + 1) + i);
    let halves = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    Mesh {
        name: name.into(),
        positions: (0..=n).flat_map(|j| (0..=n).map(move |i| place(i, j))).collect(),
        triangles: (0..n).flat_map(|j| (0..n).flat_map(move |i| halves(corners(i, j)))).collect(),
        ..Mesh::default()
    }
}

/// Two independent estimates of one light.
pub fn same_light(what: &str, found: Estimate, expected: Estimate) -> Check {
    z_check(what, found.mean, expected.mean, found.standard_error.hypot(expected.standard_error).max(1e-5 * expected.mean.abs()))
}

/// A scene as its first camera sees it.
pub struct Viewed {
    pub scene: Scene,
    pub geometry: Geometry,
    pub camera: Camera,
}

impl Viewed {
    pub fn new(scene: Scene) -> Viewed {
        Viewed { geometry: Geometry::new(&scene).unwrap(), camera: scene.first_camera(), scene }
    }

    pub fn viewpoint(&self) -> Viewpoint<'_> {
        Viewpoint { geometry: &self.geometry, camera: Some(&self.camera), phases: &[] }
    }

    /// With radii by a trial round.
    pub fn tried(&self, gpu: &Gpu, settings: &SceneSettings, sensor: Sensor) -> ScenePlan {
        trial::plan(gpu, &self.scene, &self.viewpoint(), settings, sensor).unwrap()
    }

    /// With radii by the scene's area.
    pub fn planned(&self, gpu: &Gpu, settings: &SceneSettings, sensor: Sensor) -> ScenePlan {
        ScenePlan::new(&self.scene, &self.geometry, settings, sensor, &engine::limits(gpu.facts())).unwrap()
    }

    /// Runs to the end, whatever comes out.
    pub fn run(&self, gpu: &Gpu, plan: ScenePlan) -> RunResult {
        run(gpu, &self.viewpoint(), plan)
    }
}

/// The sides of a box, of a material each: below and above, back and front, left and right.
pub fn sides(corner: DVec3, size: DVec3, faces_in: bool, materials: [usize; 6]) -> Vec<Mesh> {
    let [x, y, z] = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    let far = corner + size;
    let faces = [(corner, z, x), (far, -x, -z), (corner, x, y), (far, -y, -x), (corner, y, z), (far, -z, -y)];
    let side = |((origin, u, v), material)| {
        let (u, v) = if faces_in { (u, v) } else { (v, u) };
        Mesh::parallelogram("side", origin, u, v, material)
    };
    faces.into_iter().zip(materials).map(side).collect()
}

/// A rectangle about a hole from `low` to `high`, as shares of its edges.
pub fn around_hole(origin: DVec3, u: DVec3, v: DVec3, [low, high]: [DVec2; 2], material: usize) -> Vec<Mesh> {
    let part = |[from_u, to_u]: [f64; 2], [from_v, to_v]: [f64; 2]| {
        Mesh::parallelogram("around a hole", origin + from_u * u + from_v * v, (to_u - from_u) * u, (to_v - from_v) * v, material)
    };
    let beside = [low.y, high.y];
    vec![part([0.0, 1.0], [0.0, low.y]), part([0.0, 1.0], [high.y, 1.0]), part([0.0, low.x], beside), part([high.x, 1.0], beside)]
}
