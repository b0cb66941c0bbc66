//! The judge, judged: scenes whose light is known in closed form.

use crate::common::layered::{lobes_at, map_of, mapped_normal, metal, plastic, row_of_texels};
use crate::common::plates::Place;
use crate::common::prelude::*;
use crate::common::rendered::sides;
use photonmill::scene::material::{Coverage, Layers, Medium};
use photonmill::scene::texture::Filter;
use photonmill::verify::judge::{Estimate, Image, fresnel, lobes};

const NO_LIMIT: u32 = u32::MAX;

/// A base colour that differs between channels.
const COLOUR: Vec3 = Vec3::new(0.75, 0.5, 0.25);

fn material(surface: Surface, base_colour: Vec3) -> Material {
    Material { surface, ..Material::lambert("material", base_colour) }
}

fn lamp_of(emission: Vec3) -> Material {
    Material { emission, ..matt(0.0) }
}

fn environment() -> LightKind {
    LightKind::Environment { radiance: Vec3::new(1.0, 2.0, 4.0) }
}

const SKY: DVec3 = DVec3::new(1.0, 2.0, 4.0);

/// A horizontal square of side 2 `half` around the axis z, at this height; its front looks up, or down.
fn square(height: f64, half: f64, up: bool, material: usize) -> Mesh {
    let corner = DVec3::new(-half, -half, height);
    let (u, v) = (2.0 * half * DVec3::X, 2.0 * half * DVec3::Y);
    if up { Mesh::parallelogram("square", corner, u, v, material) } else { Mesh::parallelogram("square", corner, v, u, material) }
}

/// A square of 2 m under one light.
fn plate_under(material: Material, light: LightKind) -> Scene {
    scene_of(vec![square(0.0, 1.0, true, 0)], vec![material], vec![light])
}

/// A box from -half to half that faces outwards.
fn cuboid(half: DVec3, material: usize) -> Vec<Mesh> {
    sides(-half, 2.0 * half, false, [material; 6])
}

/// Whether an estimate meets what is expected, within 4.5 standard errors and a few roundings.
fn meets(mean: DVec3, standard_error: DVec3, expected: DVec3) -> bool {
    let allowed = 4.5 * standard_error + 1e-9 * expected.abs() + 1e-15;
    mean.is_finite() && (mean - expected).abs().cmple(allowed).all()
}

#[track_caller]
fn assert_meets(what: &str, mean: DVec3, standard_error: DVec3, expected: DVec3) {
    assert!(meets(mean, standard_error, expected), "{what}: {mean} +- {standard_error}, expected {expected}");
}

#[track_caller]
fn assert_total(what: &str, estimate: &Estimate, expected: DVec3) {
    assert_meets(what, estimate.mean.total(), estimate.total_standard_error, expected);
}

fn irradiance(scene: &Scene, point: DVec3, normal: DVec3, samples: u32) -> Estimate {
    Judge::new(scene, NO_LIMIT).irradiance_at(&[(point, normal)], samples, 1)[0]
}

/// Radiance towards `eye` from `target`: a picture of one pixel that is all but a single ray.
fn radiance(scene: &Scene, eye: DVec3, target: DVec3, samples: u32) -> Estimate {
    let camera = Camera::looking_at("ray", eye, target, DVec3::Z, 1e-9);
    Judge::new(scene, NO_LIMIT).image(&camera, 1, 1, samples, 1).pixels[0]
}

fn disc(height: f64, normal: DVec3, law: EmissionLaw) -> LightKind {
    LightKind::Disc { centre: DVec3::Z * height, normal, radius: 0.5, power: Vec3::new(1.0, 2.0, 3.0), law }
}

/// Irradiance of such a disc on its axis, facing it.
fn disc_irradiance(distance: f64, law: EmissionLaw) -> DVec3 {
    let power = DVec3::new(1.0, 2.0, 3.0);
    let slant_squared = 0.25 + distance * distance;
    match law {
        EmissionLaw::Cosine => power / (PI * slant_squared),
        EmissionLaw::Uniform => power / (PI * 0.25) * (1.0 - distance / slant_squared.sqrt()),
    }
}

#[test]
fn a_disc_lights_the_point_on_its_axis() {
    for (law, other) in [(EmissionLaw::Cosine, EmissionLaw::Uniform), (EmissionLaw::Uniform, EmissionLaw::Cosine)] {
        let scene = scene_of(vec![], vec![], vec![disc(1.5, -DVec3::Z, law)]);
        let estimate = irradiance(&scene, DVec3::ZERO, DVec3::Z, 20_000);
        assert_total("front", &estimate, disc_irradiance(1.5, law));
        assert_eq!(estimate.mean.total(), estimate.mean.direct);
        assert_eq!(irradiance(&scene, DVec3::Z * 3.0, -DVec3::Z, 100).mean.total(), DVec3::ZERO, "back");
        // The check complains about one per cent, about the other law, and about what is no number.
        let (mean, error) = (estimate.mean.total(), estimate.total_standard_error);
        assert!(!meets(1.01 * mean, error, disc_irradiance(1.5, law)) && !meets(mean, error, disc_irradiance(1.5, other)));
    }
    assert!(!meets(DVec3::NAN, DVec3::NAN, DVec3::ONE) && !meets(DVec3::INFINITY, DVec3::INFINITY, DVec3::ONE));
}

#[test]
fn point_lights_fall_off_with_distance_and_cosine_and_add_up() {
    let bulb = LightKind::Point { position: DVec3::new(3.0, 0.0, 4.0), intensity: Vec3::new(50.0, 25.0, 0.0) };
    let scene = scene_of(vec![], vec![], vec![bulb.clone()]);
    let expected = DVec3::new(50.0, 25.0, 0.0) / 25.0 * 0.8;
    assert_total("alone", &irradiance(&scene, DVec3::ZERO, DVec3::Z, 2), expected);
    // A plate blocks it from either side; the receiver itself, a surface, does not.
    let plates = |height| vec![square(0.0, 9.0, true, 0), square(height, 9.0, true, 0)];
    assert_total("lit", &irradiance(&scene_of(plates(5.0), vec![matt(0.0)], vec![bulb.clone()]), DVec3::ZERO, DVec3::Z, 2), expected);
    assert_total("shadow", &irradiance(&scene_of(plates(2.0), vec![matt(0.0)], vec![bulb]), DVec3::ZERO, DVec3::Z, 2), DVec3::ZERO);
    // Two, whatever their power.
    let bulb = |x: f64, intensity: f32| LightKind::Point { position: DVec3::new(x, 0.0, 1.0), intensity: Vec3::splat(intensity) };
    let both = irradiance(&scene_of(vec![], vec![], vec![bulb(0.0, 1.0), bulb(1.0, 30.0)]), DVec3::ZERO, DVec3::Z, 20_000);
    assert_total("both", &both, DVec3::splat(1.0 + 30.0 / 2f64.powf(1.5)));
}

#[test]
fn spots_fall_off_between_their_cones() {
    let (inner_angle, outer_angle) = (0.3f32, 0.9f32);
    let (inner, outer) = (f64::from(inner_angle).cos(), f64::from(outer_angle).cos());
    let spot = LightKind::Spot { position: DVec3::Z, direction: -DVec3::Z, intensity: Vec3::ONE, inner_angle, outer_angle };
    let scene = scene_of(vec![], vec![], vec![spot]);
    for (cosine, falloff) in [(1.0, 1.0), (0.999 * inner + 0.001, 1.0), (0.5 * (inner + outer), 0.25), (0.99 * outer, 0.0)] {
        let point = DVec3::new((1.0f64 / (cosine * cosine) - 1.0).sqrt(), 0.0, 0.0);
        let expected = DVec3::splat(falloff * cosine.powi(3));
        assert_meets("spot", irradiance(&scene, point, DVec3::Z, 2).mean.total(), DVec3::splat(1e-12), expected);
    }
}

#[test]
fn the_sun_lights_by_its_cosine() {
    let sun = LightKind::Directional { direction: DVec3::new(0.6, 0.0, -0.8), irradiance: COLOUR };
    let scene = plate_under(material(Surface::Lambert, COLOUR), sun);
    let expected = 0.8 * COLOUR.as_dvec3();
    assert_total("irradiance", &irradiance(&scene, DVec3::ZERO, DVec3::Z, 2), expected);
    let seen = expected * COLOUR.as_dvec3() / PI;
    assert_total("radiance", &radiance(&scene, DVec3::new(0.5, 0.2, 3.0), DVec3::new(0.1, 0.2, 0.0), 2), seen);
    assert_total("back", &radiance(&scene, DVec3::new(0.5, 0.2, -3.0), DVec3::new(0.1, 0.2, 0.0), 2), DVec3::ZERO);
}

#[test]
fn the_sky_lights_an_open_plane() {
    let mut scene = plate_under(material(Surface::Lambert, COLOUR), environment());
    assert_total("irradiance", &irradiance(&scene, DVec3::new(0.3, 0.2, 0.0), DVec3::Z, 100), PI * SKY);
    let (above, below, spot) = (DVec3::new(0.0, 1.0, 2.0), DVec3::new(0.0, 1.0, -2.0), DVec3::new(0.3, 0.2, 0.0));
    let seen = radiance(&scene, above, spot, 100);
    assert_total("plane", &seen, COLOUR.as_dvec3() * SKY);
    assert_eq!(seen.mean.direct, seen.mean.total());
    assert_total("sky", &radiance(&scene, above, DVec3::Z * 9.0, 2), SKY);
    assert_total("back", &radiance(&scene, below, spot, 2), DVec3::ZERO);
    scene.materials[0].two_sided = true;
    assert_total("both sides", &radiance(&scene, below, spot, 100), COLOUR.as_dvec3() * SKY);
}

/// A box of walls that all emit alike and are equal but for some of them, by their numbers: 2 is the floor, 3 the ceiling, 4 is on
/// the left.
fn furnace_of(wall: &Material, others: &[(usize, Material)]) -> Scene {
    let mut walls = vec![wall.clone(); 6];
    others.iter().for_each(|(number, material)| walls[*number] = material.clone());
    walls.iter_mut().for_each(|wall| wall.emission = EMITTED.as_vec3());
    let half = DVec3::new(1.0, 0.7, 0.5);
    scene_of(sides(-half, 2.0 * half, true, [0, 1, 2, 3, 4, 5]), walls, vec![])
}

const EMITTED: DVec3 = DVec3::new(1.0, 2.0, 3.0);

#[test]
fn furnaces_glow_evenly_and_in_the_right_parts() {
    let (eye, floor, ceiling) = (DVec3::new(0.2, 0.1, -0.1), DVec3::new(0.3, 0.5, -0.5), DVec3::new(0.3, 0.5, 0.5));
    let colour = COLOUR.as_dvec3();
    let expected = EMITTED / (1.0 - colour);
    let rough = material(Surface::Lambert, COLOUR);
    // To all but the eye the paper's Phong is Lambertian.
    for wall in [rough.clone(), plain(COLOUR), material(Surface::PaperPhong { exponent: 20.0 }, COLOUR)] {
        let scene = furnace_of(&wall, &[]);
        let on_floor = irradiance(&scene, floor, DVec3::Z, 20_000);
        assert_total("irradiance", &on_floor, PI * expected);
        assert_meets("direct", on_floor.mean.direct, on_floor.standard_error.direct, PI * EMITTED);
        if !matches!(wall.surface, Surface::PaperPhong { .. }) {
            let seen = radiance(&scene, eye, floor, 20_000);
            assert_total("rough", &seen, expected);
            assert_meets("direct", seen.mean.direct, seen.standard_error.direct, EMITTED * (1.0 + colour));
            assert_eq!((seen.mean.specular, seen.mean.caustic), (DVec3::ZERO, DVec3::ZERO));
        }
    }

    // With mirrors the same light comes in all parts, and none of it twice.
    let mirror = material(Surface::Mirror, COLOUR);
    let shiny = furnace_of(&rough, &[(3, mirror.clone()), (4, mirror)]);
    let seen = radiance(&shiny, eye, floor, 40_000);
    assert_total("floor", &seen, expected);
    let above = radiance(&shiny, eye, ceiling, 20_000);
    assert_total("mirror", &above, expected);
    assert_meets("specular", above.mean.specular, above.standard_error.specular, expected - EMITTED);
    assert_total("irradiance", &irradiance(&shiny, floor, DVec3::Z, 40_000), PI * expected);
    // Metal reflects its base colour along the normal alone: a smooth wall of F0 = F90 comes from an ior of 0.
    let layered_mirror = layered(Vec3::ZERO, &Layers { ior: 0.0, specular_colour: COLOUR, specular: 1.0, ..plastic(0.0) });
    let layered_shiny = furnace_of(&plain(COLOUR), &[(3, layered_mirror)]);
    for (seen, above) in [(seen, above), (radiance(&layered_shiny, eye, floor, 10_000), radiance(&layered_shiny, eye, ceiling, 2000))] {
        assert!(seen.mean.caustic.min_element() > 0.01 && seen.mean.indirect.min_element() > 0.01, "{seen:?}");
        assert_eq!((seen.mean.specular, above.mean.direct), (DVec3::ZERO, EMITTED));
        assert_eq!(above.mean.caustic + above.mean.indirect, DVec3::ZERO);
    }

    // Rough lobes of the same kinds: what is sharp and what is not.
    for (roughness, is_sharp) in [(0.499f32, true), (0.5, false)] {
        let scene = furnace_of(&plain(COLOUR), &[(2, layered(COLOUR, &metal(roughness)))]);
        let seen = radiance(&scene, eye, floor, 2000).mean;
        assert_eq!(seen.direct == EMITTED, is_sharp, "{seen:?}");
        assert_eq!(seen.specular == DVec3::ZERO, !is_sharp, "{seen:?}");
        assert_eq!(seen.indirect == DVec3::ZERO, is_sharp, "{seen:?}");
        let from_wall = radiance(&scene, eye, DVec3::new(0.3, 0.7, 0.1), 5000).mean;
        assert_eq!(from_wall.caustic == DVec3::ZERO, !is_sharp, "{from_wall:?}");
    }
}

#[test]
fn bounces_are_a_geometric_series() {
    let camera = Camera::looking_at("ray", DVec3::ZERO, DVec3::new(0.3, 0.5, -0.5), DVec3::Z, 1.0);
    for wall in [material(Surface::Lambert, COLOUR), plain(COLOUR)] {
        let scene = furnace_of(&wall, &[]);
        let (mut expected, mut term) = (DVec3::ZERO, EMITTED);
        for max_bounces in 0..6 {
            expected += term;
            term *= COLOUR.as_dvec3();
            let judge = Judge::new(&scene, max_bounces);
            assert_total("radiance", &judge.image(&camera, 1, 1, 10_000, 3).pixels[0], expected);
            let at_wall = judge.irradiance_at(&[(DVec3::Z * -0.5, DVec3::Z)], 10_000, 4)[0];
            assert_total("irradiance", &at_wall, PI * expected);
        }
    }
    // A thin pane scatters nothing.
    let meshes = vec![square(0.0, 1.0, true, 0), square(-1.0, 1.0, true, 1)];
    let scene = scene_of(meshes, vec![layered(COLOUR, &clear(0.0, 1.5)), lamp_of(Vec3::ONE)], vec![]);
    let camera = Camera::looking_at("down", DVec3::Z, DVec3::ZERO, DVec3::Y, 1e-9);
    let seen = Judge::new(&scene, 0).image(&camera, 1, 1, 10_000, 3).pixels[0];
    assert_total("pane", &seen, 0.96 * COLOUR.as_dvec3());
    assert_eq!(seen.mean.direct, seen.mean.total());
}

#[test]
fn a_lamp_is_seen_in_a_mirror_and_lights_through_it() {
    let materials = vec![material(Surface::Mirror, COLOUR), lamp_of(Vec3::new(1.0, 2.0, 3.0)), matt(0.0)];
    let scene = scene_of(vec![square(0.0, 5.0, true, 0), square(2.0, 1.0, false, 1)], materials.clone(), vec![]);
    let seen = radiance(&scene, DVec3::new(3.0, 0.0, 2.0), DVec3::new(1.5, 0.1, 0.0), 2);
    assert_total("lamp", &seen, COLOUR.as_dvec3() * EMITTED);
    assert_eq!(seen.mean.specular, seen.mean.total());

    for law in [EmissionLaw::Cosine, EmissionLaw::Uniform] {
        // It lies in the very plane of a black ceiling.
        let meshes = vec![square(0.0, 5.0, true, 0), square(1.0, 5.0, false, 2)];
        let scene = scene_of(meshes, materials.clone(), vec![disc(1.0, -DVec3::Z, law)]);
        assert_total("direct", &irradiance(&scene, DVec3::ZERO, DVec3::Z, 20_000), disc_irradiance(1.0, law));
        // From below its lamp a receiver sees the lamp's image only, as far below the mirror.
        let estimate = irradiance(&scene, DVec3::Z * 0.5, -DVec3::Z, 200_000);
        assert_total("image", &estimate, COLOUR.as_dvec3() * disc_irradiance(1.5, law));
        assert_eq!(estimate.mean.caustic, estimate.mean.total());
        // The eye sees a disc neither itself nor mirrored.
        assert_total("disc", &radiance(&scene, DVec3::Z * 0.5, DVec3::Z, 2), DVec3::ZERO);
        assert_total("mirrored disc", &radiance(&scene, DVec3::Z * 0.5, DVec3::X * 0.01, 2), DVec3::ZERO);
    }
}

#[test]
fn fresnel_meets_its_special_values() {
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} and {b}");
    near(fresnel(1.0, 1.0, 1.5), 0.04);
    near(fresnel(1.0, 1.5, 1.0), 0.04);
    near(fresnel(0.0, 1.0, 1.5), 1.0);
    near(fresnel(0.3, 1.0, 1.0), 0.0);
    // Brewster's angle: no parallel reflection.
    let brewster = 1.5f64.atan();
    near(fresnel(brewster.cos(), 1.0, 1.5), 0.5 * (1.25f64 / 3.25).powi(2));
    // The same from either side of the boundary.
    let (angle, refracted) = (0.7f64, (0.7f64.sin() / 1.5).asin());
    near(fresnel(angle.cos(), 1.0, 1.5), fresnel(refracted.cos(), 1.5, 1.0));
    let critical = (1.0f64 / 1.5).asin();
    assert_eq!(fresnel((critical + 1e-6).cos(), 1.5, 1.0), 1.0);
    assert!(fresnel((critical - 1e-2).cos(), 1.5, 1.0) < 0.6);
}

#[test]
fn refraction_obeys_snell() {
    // A lamp no wider than a pencil at the bottom of a pool, seen where Snell's law says.
    let water = material(Surface::Dielectric { ior: 1.25 }, Vec3::ONE);
    let scene = scene_of(vec![square(0.0, 5.0, true, 0), square(-1.0, 0.01, true, 1)], vec![water, lamp_of(Vec3::ONE)], vec![]);
    for sine in [0.1, 0.5, 0.9f64] {
        let cosine = (1.0 - sine * sine).sqrt();
        let surface = DVec3::X * (sine / 1.25 / (1.0 - (sine / 1.25).powi(2)).sqrt());
        let eye = surface + DVec3::new(sine, 0.0, cosine);
        let reflectance = fresnel(cosine, 1.0, f64::from(1.25f32));
        let expected = DVec3::splat((1.0 - reflectance) / (1.25 * 1.25));
        assert_total("lamp", &radiance(&scene, eye, surface, 20_000), expected);
        assert_total("beside", &radiance(&scene, eye, surface + DVec3::X * 0.05, 100), DVec3::ZERO);
    }
}

#[test]
fn lobes_weigh_the_light_of_a_point() {
    let position = DVec3::new(-1.0, 0.0, 1.0);
    let bulb = LightKind::Point { position, intensity: Vec3::ONE };
    let arriving = COLOUR.as_dvec3() * 0.5f64.sqrt() / 2.0;
    // 30 degrees off the mirror direction.
    let eye = DVec3::new(75f64.to_radians().sin(), 0.0, 75f64.to_radians().cos());
    let cosine = 30f64.to_radians().cos();
    for (surface, expected) in [
        (Surface::Lambert, 1.0 / PI),
        (Surface::PaperPhong { exponent: 10.0 }, cosine.powi(10) / PI),
        (Surface::PaperPhong { exponent: 0.0 }, 1.0 / PI),
        (Surface::Glossy { exponent: 10.0 }, 12.0 / (2.0 * PI) * cosine.powi(10)),
        (Surface::Mirror, 0.0),
    ] {
        let scene = plate_under(material(surface, COLOUR), bulb.clone());
        let seen = radiance(&scene, 3.0 * eye, DVec3::ZERO, 2);
        // The picture is a little wider than a ray.
        assert_meets("lobe", seen.mean.total(), DVec3::splat(1e-8), expected * arriving);
    }
}

/// Behind a pane of index 1 the sky is seen as it is, but no light sampling reaches it.
#[test]
fn sampling_lobes_and_sampling_lights_agree() {
    let open_and_closed = |surface, eye, samples| {
        let open = plate_under(material(surface, COLOUR), environment());
        let mut closed = open.clone();
        closed.meshes.extend(cuboid(DVec3::splat(2.0), 1));
        closed.materials.push(material(Surface::Dielectric { ior: 1.0 }, Vec3::ONE));
        [open, closed].map(|scene| radiance(&scene, eye, DVec3::ZERO, samples))
    };
    for (surface, weight) in [
        (Surface::Lambert, 1.0),
        (Surface::PaperPhong { exponent: 3.0 }, 2.0 / 5.0),
        (Surface::Glossy { exponent: 0.0 }, 1.0),
        (Surface::Glossy { exponent: 30.0 }, 1.0),
    ] {
        let expected = weight * COLOUR.as_dvec3() * SKY;
        let [of_lights, of_lobes] = open_and_closed(surface, DVec3::Z * 0.5, 40_000);
        assert_total("light", &of_lights, expected);
        assert_total("lobe", &of_lobes, expected);
        assert_eq!((of_lights.mean.direct, of_lobes.mean.caustic), (of_lights.mean.total(), of_lobes.mean.total()));
    }
    // At a slant part of a lobe lies below the surface.
    let [open, closed] = open_and_closed(Surface::Glossy { exponent: 5.0 }, DVec3::new(0.9, 0.0, 0.2), 100_000);
    let noise = (open.total_standard_error.powf(2.0) + closed.total_standard_error.powf(2.0)).map(f64::sqrt);
    assert_meets("slant", open.mean.total(), noise, closed.mean.total());
    assert!(open.mean.total().cmplt(0.9 * COLOUR.as_dvec3() * SKY).all());
}

#[test]
fn textures_shade_lamps_and_walls() {
    let ramp = || texture(2, vec![Vec3::ZERO, Vec3::ONE], [Wrap::Clamp; 2]);
    let textured = Some(TextureUse::of(0, 0));
    let plain = |material| scene_of(vec![square(0.0, 1.0, true, 0)], vec![material], vec![]);
    let mut scene = plain(Material { emission_texture: textured, ..lamp_of(Vec3::new(1.0, 2.0, 3.0)) });
    scene.textures.push(ramp());
    for (x, share) in [(-0.75, 0.0), (0.0, 0.5), (0.75, 1.0)] {
        let seen = radiance(&scene, DVec3::new(x, 0.3, 1.0), DVec3::new(x, 0.3, 0.0), 2);
        assert_meets("lamp", seen.mean.total(), DVec3::splat(1e-8), share * EMITTED);
    }
    // A ramp and its mirror image make a plain lamp, so that on the axis each gives half.
    let whole = irradiance(&plain(lamp_of(Vec3::new(1.0, 2.0, 3.0))), DVec3::Z, -DVec3::Z, 100_000);
    let form_factor = 4.0 / (2f64.sqrt() * PI) * (1.0 / 2f64.sqrt()).atan();
    assert_total("plain lamp", &whole, PI * form_factor * EMITTED);
    assert_total("ramp", &irradiance(&scene, DVec3::Z, -DVec3::Z, 100_000), 0.5 * PI * form_factor * EMITTED);

    // A wall with the same ramp, and one whose vertices are dark at one side.
    let wall = Material { base_colour_texture: textured, ..material(Surface::Lambert, COLOUR) };
    let mut of_texture = plate_under(wall, environment());
    of_texture.textures.push(ramp());
    let mut of_vertices = plate_under(material(Surface::Lambert, COLOUR), environment());
    of_vertices.meshes[0].colours = of_vertices.meshes[0].positions.iter().map(|at| DVec3::splat(at.x * 0.5 + 0.5)).collect();
    for (wall, error, dark) in [(of_texture, 1e-8, 0.0), (of_vertices, 1e-6, 0.125)] {
        for (x, share) in [(-0.75, dark), (0.0, 0.5), (0.75, 1.0 - dark)] {
            let seen = radiance(&wall, DVec3::new(x, 0.3, 1.0), DVec3::new(x, 0.3, 0.0), 20);
            assert_meets("wall", seen.mean.total(), DVec3::splat(error), share * COLOUR.as_dvec3() * SKY);
        }
    }
}

#[test]
fn shading_normals_bend_reflections() {
    // A flat mirror that is shaded as if it were tilted by 22.5 degrees turns a ray by 45.
    let (sin, cos) = (PI / 8.0).sin_cos();
    let mut mirror = square(0.0, 1.0, true, 0);
    mirror.normals = vec![DVec3::new(sin, 0.0, cos); 4];
    let side = Mesh::parallelogram("lamp", DVec3::new(2.0, -0.1, 1.9), DVec3::Z * 0.2, DVec3::Y * 0.2, 1);
    let scene = scene_of(vec![mirror, side], vec![material(Surface::Mirror, COLOUR), lamp_of(Vec3::ONE)], vec![]);
    assert_total("lamp", &radiance(&scene, DVec3::Z, DVec3::ZERO, 2), COLOUR.as_dvec3());
}

#[test]
fn pictures_stand_upright() {
    let top_left = Mesh::parallelogram("lamp", DVec3::new(-1.0, 0.0, 0.0), DVec3::X, DVec3::Y, 0);
    let scene = scene_of(vec![top_left], vec![lamp_of(Vec3::ONE)], vec![]);
    let camera = Camera::looking_at("front", DVec3::Z, DVec3::ZERO, DVec3::Y, PI / 2.0);
    let Image { width, height, pixels } = Judge::new(&scene, 0).image(&camera, 2, 2, 50, 1);
    assert_eq!((width, height, pixels.len()), (2, 2, 4));
    assert_eq!(pixels.iter().map(|pixel| pixel.mean.total().x).collect::<Vec<_>>(), [1.0, 0.0, 0.0, 0.0]);
    // Samples cover each pixel evenly: the lamp's edge is where it is.
    let edge = &Judge::new(&scene, 0).image(&camera, 1, 1, 20_000, 1).pixels[0];
    assert_total("quarter", edge, DVec3::splat(0.25));
}

fn picture(scene: &Scene, seed: u64, threads: usize) -> Image {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| Judge::new(scene, 10).image(&scene.cameras[0], 24, 16, 8, seed))
}

#[test]
fn results_depend_on_the_seed_and_not_on_threads() {
    let scene = built_in::by_name("cornell-spheres").unwrap();
    let one = picture(&scene, 7, 1);
    assert_eq!(one, picture(&scene, 7, 2));
    assert_ne!(one, picture(&scene, 8, 2));
    let parts = Part::EACH.map(|part| one.pixels.iter().map(|pixel| pixel.mean[part]).sum::<DVec3>());
    assert!(parts.iter().all(|part| part.min_element() > 0.0), "{parts:?}");
    assert_meets("total", parts.iter().sum(), DVec3::ZERO, one.pixels.iter().map(|pixel| pixel.mean.total()).sum());
}

#[test]
fn standard_errors_are_what_means_scatter_by() {
    let scene = scene_of(vec![], vec![], vec![disc(0.5, -DVec3::Z, EmissionLaw::Cosine)]);
    let estimates = Judge::new(&scene, 0).irradiance_at(&[(DVec3::ZERO, DVec3::Z); 2000], 100, 5);
    let scores = estimates.iter().map(|estimate| {
        assert_eq!(estimate.standard_error.direct, estimate.total_standard_error);
        (estimate.mean.total() - disc_irradiance(0.5, EmissionLaw::Cosine)) / estimate.total_standard_error
    });
    let squares = scores.map(|score| score * score).sum::<DVec3>() / 2000.0;
    assert!(squares.cmpgt(DVec3::splat(0.85)).all() && squares.cmplt(DVec3::splat(1.15)).all(), "{squares}");

    // Parts of a sample depend on each other: a lamp in front of a mirror under as bright a sky.
    let half = Mesh::parallelogram("lamp", DVec3::new(-1.0, -1.0, 0.5), DVec3::X, 2.0 * DVec3::Y, 0);
    let materials = vec![lamp_of(Vec3::ONE), material(Surface::Mirror, Vec3::ONE)];
    let scene = scene_of(vec![half, square(0.0, 1.0, true, 1)], materials, vec![LightKind::Environment { radiance: Vec3::ONE }]);
    let camera = Camera::looking_at("down", DVec3::Z, DVec3::ZERO, DVec3::Y, 0.5);
    let estimate = Judge::new(&scene, NO_LIMIT).image(&camera, 1, 1, 10_000, 1).pixels[0];
    let binomial = DVec3::splat(0.005);
    assert_meets("direct", estimate.mean.direct, binomial, DVec3::splat(0.5));
    assert!((estimate.standard_error.direct - binomial).abs().max_element() < 1e-5, "{estimate:?}");
    assert!((estimate.standard_error.specular - binomial).abs().max_element() < 1e-5, "{estimate:?}");
    assert!((estimate.mean.total() - 1.0).abs().max_element() < 1e-9 && estimate.total_standard_error.max_element() < 1e-9, "{estimate:?}");
    let single = Judge::new(&scene, NO_LIMIT).image(&camera, 1, 1, 1, 1).pixels[0];
    assert_eq!(single.total_standard_error, DVec3::INFINITY);
}

/// What scatters as Lambert does: a dielectric that reflects nothing.
fn plain(base_colour: Vec3) -> Material {
    layered(base_colour, &Layers { metallic: 0.0, specular: 0.0, ..Layers::default() })
}

fn layered(base_colour: Vec3, layers: &Layers) -> Material {
    Material { two_sided: true, ..Material::layered("layered", base_colour, *layers) }
}

fn clear(roughness: f32, ior: f32) -> Layers {
    Layers { transmission: 1.0, ior, ..plastic(roughness) }
}

fn solid(roughness: f32, ior: f32, transmittance: Vec3) -> Layers {
    Layers { medium: Some(Medium { transmittance, metres: 1.0 }), ..clear(roughness, ior) }
}

/// A plate under nothing but this light, seen at this cosine.
fn plate(material: Material, light: LightKind, cosine: f64, samples: u32) -> Estimate {
    let scene = plate_under(material, light);
    radiance(&scene, 0.5 * DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine), DVec3::ZERO, samples)
}

#[test]
fn layered_plates_return_their_albedo_of_the_sky() {
    // GGX with correlated Smith masking and F = 1; sharp lobes belong to the specular part.
    for (alpha, cosine, albedo) in [(0.05f32, 0.5, 0.9927), (0.1, 0.2, 0.9046), (0.5, 0.5, 0.6983), (0.5, 0.05, 0.9125), (1.0, 1.0, 0.3069)]
    {
        let seen = plate(layered(Vec3::ONE, &metal(alpha.sqrt())), environment(), cosine, 20_000);
        assert_meets("metal", seen.mean.total(), seen.total_standard_error + 5e-5, albedo * SKY);
        let part = if alpha < 0.25 { seen.mean.specular } else { seen.mean.direct };
        assert_eq!(seen.mean.total(), part);
    }
    // White plastic returns all of it, whatever its roughness; so does what is smoothly coated, and smooth glass.
    for layers in [plastic(0.0), plastic(0.3), plastic(1.0), Layers { coat: 1.0, ..plastic(0.0) }, clear(0.0, 1.5)] {
        for cosine in [0.9, 0.3] {
            let seen = plate(layered(Vec3::ONE, &layers), environment(), cosine, 40_000);
            assert_meets("white", seen.mean.total(), seen.total_standard_error + 1e-4, SKY);
        }
    }
    let smooth = plate(layered(Vec3::ONE, &plastic(0.0)), environment(), 1.0, 40_000);
    assert_meets("reflected", smooth.mean.specular, smooth.standard_error.specular, 0.04 * SKY);
    let tinted = plate(layered(COLOUR, &clear(0.0, 1.5)), environment(), 1.0, 40_000);
    // What passes a thin wall is seen as if nothing were there.
    assert_meets("passed", tinted.mean.direct, tinted.standard_error.direct, 0.96 * COLOUR.as_dvec3() * SKY);
    assert_meets("reflected", tinted.mean.specular, tinted.standard_error.specular, 0.04 * SKY);
}

/// A small lamp and a lobe that is much wider, and the other way round: sampling either alone would be noise.
#[test]
fn lamps_of_all_sizes_light_lobes_of_all_widths() {
    let (wo, emitted) = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(1.0, 2.0, 3.0));
    for roughness in [0.1f32, 0.3, 0.7] {
        for (half, samples, count) in [(0.02, 20_000, 40), (0.3, 40_000, 400), (2.0, 40_000, 1000)] {
            let centre = DVec3::new(-0.75, 0.0, 1.0);
            let corner = centre - DVec3::new(half, half, 0.0);
            let above = Mesh::parallelogram("lamp", corner, 2.0 * half * DVec3::Y, 2.0 * half * DVec3::X, 1);
            let plate = layered(COLOUR, &metal(roughness));
            let lobe = lobes_at(&plate, &Place::of_normal(DVec3::Z, wo), DVec3::Z);
            let scene = scene_of(vec![square(0.0, 0.1, true, 0), above], vec![plate, lamp_of(emitted.as_vec3())], vec![]);
            let seen = radiance(&scene, 0.5 * wo, DVec3::ZERO, samples);
            let mut sum = DVec3::ZERO;
            for place in 0..count * count {
                let [x, y] = [place % count, place / count].map(|at| (f64::from(at) + 0.5) / f64::from(count));
                let (wi, distance) = (corner + 2.0 * half * DVec3::new(x, y, 0.0)).normalize_and_length();
                sum += lobe.evaluate(lobes::Kind::Reflection, wi) * wi.z * wi.z / (distance * distance);
            }
            let expected = sum * emitted * (2.0 * half / f64::from(count)).powi(2);
            let what = format!("roughness {roughness}, lamp {half}");
            assert_meets(&what, seen.mean.total(), seen.total_standard_error + 1e-3 * expected, expected);
            let noise = (seen.total_standard_error / expected).max_element() * f64::from(samples).sqrt();
            assert!(noise < 3.0, "{what}: a sample scatters by {noise}");
        }
    }
}

#[test]
fn thin_walls_let_shadow_rays_pass() {
    let sun = LightKind::Directional { direction: DVec3::new(0.6, 0.0, -0.8), irradiance: Vec3::ONE };
    let pane = |layers| scene_of(vec![square(1.0, 5.0, true, 0)], vec![layered(COLOUR, &layers)], vec![sun.clone()]);
    let below = |layers| irradiance(&pane(layers), DVec3::ZERO, DVec3::Z, 2).mean;
    let schlick = 0.04 + 0.96 * 0.2f64.powi(5);
    let passed = 0.8 * (1.0 - schlick) * COLOUR.as_dvec3();
    let smooth = below(clear(0.0, 1.5));
    assert_meets("smooth", smooth.direct, DVec3::splat(1e-8), passed);
    assert_eq!(smooth.total(), smooth.direct);
    // A smooth coat takes its share on both sides of the light's way at once.
    assert_meets("coated", below(Layers { coat: 1.0, ..clear(0.0, 1.5) }).direct, DVec3::splat(1e-8), (1.0 - schlick) * passed);
    assert_meets("half", below(Layers { transmission: 0.5, ..clear(0.0, 1.5) }).direct, DVec3::splat(1e-8), 0.5 * passed);
    // Rough ones scatter it, and solids refract it.
    assert_eq!(below(clear(0.1, 1.5)).direct, DVec3::ZERO);
    assert_eq!(below(solid(0.0, 1.5, Vec3::ONE)).direct, DVec3::ZERO);

    // The sky behind a rough pane comes by its lobe, whose light is caustic; nothing is lost where nothing is reflected.
    let under = |layers| {
        let meshes = vec![square(0.01, 90.0, true, 0), square(-0.1, 90.0, true, 1)];
        let scene = scene_of(meshes, vec![layered(Vec3::ONE, &layers), plain(Vec3::ZERO)], vec![environment()]);
        irradiance(&scene, DVec3::ZERO, DVec3::Z, 40_000)
    };
    let rough = under(Layers { specular: 0.0, ..clear(0.3, 1.5) });
    assert_eq!(rough.mean.caustic, rough.mean.total());
    let ratio = rough.mean.total() / (PI * SKY);
    assert!(ratio.max_element() < 1.0 && ratio.min_element() > 0.96, "{ratio}");
}

fn slab(half_thickness: f64, material: usize) -> Vec<Mesh> {
    cuboid(DVec3::new(50.0, 50.0, half_thickness), material)
}

/// Above a lamp that fills the plane below, through what lies between, at this sine.
fn through(meshes: Vec<Mesh>, materials: Vec<Material>, sine: f64) -> Estimate {
    let mut meshes = meshes;
    meshes.push(square(-3.0, 90.0, true, materials.len()));
    let materials = materials.into_iter().chain([lamp_of(Vec3::ONE)]).collect();
    let scene = scene_of(meshes, materials, vec![]);
    let direction = DVec3::new(sine, 0.0, (1.0 - sine * sine).sqrt());
    radiance(&scene, DVec3::new(0.3, 0.2, 0.0) + 2.0 * direction, DVec3::new(0.3, 0.2, 0.0), 40_000)
}

/// Transmitted by a slab, `kept` of the light being left after one crossing.
fn slab_transmits(reflectance: f64, kept: DVec3) -> DVec3 {
    (1.0 - reflectance).powi(2) * kept / (1.0 - reflectance * reflectance * kept * kept)
}

#[test]
fn slabs_of_glass_reflect_and_absorb() {
    let clear = material(Surface::Dielectric { ior: 1.5 }, Vec3::ONE);
    let transmittance = Vec3::new(1.0, 0.3, 0.05);
    let tinted = |colour| layered(colour, &solid(0.0, 1.5, transmittance));
    for sine in [0.0, 0.5, 0.9f64] {
        let way = 0.2 / (1.0 - (sine / 1.5f64).powi(2)).sqrt();
        let kept = transmittance.as_dvec3().map(|share| share.powf(way));
        let reflectance = fresnel((1.0 - sine * sine).sqrt(), 1.0, 1.5);
        // The base colour tints at each surface.
        let colour = COLOUR.as_dvec3();
        for (material, expected) in [
            (clear.clone(), slab_transmits(reflectance, DVec3::ONE)),
            (tinted(Vec3::ONE), slab_transmits(reflectance, kept)),
            (tinted(COLOUR), colour * colour * (1.0 - reflectance).powi(2) * kept / (1.0 - (reflectance * kept).powf(2.0))),
        ] {
            let seen = through(slab(0.1, 0), vec![material], sine);
            assert_total(&format!("slab at {sine}"), &seen, expected);
            assert_eq!(seen.mean.specular, seen.mean.total());
        }
    }
    // Glass that is all but smooth, with lobes of its own instead of deltas.
    let rough = through(slab(0.1, 0), vec![layered(Vec3::ONE, &solid(0.03, 1.5, transmittance))], 0.0);
    let expected = slab_transmits(0.04, transmittance.as_dvec3().map(|share| share.powf(0.2)));
    assert_meets("rough", rough.mean.specular, rough.standard_error.specular + 1e-3, expected);
    // Nothing is lost: under an even sky glass is invisible, and inside radiance is n^2 times as high.
    for material in [clear, layered(Vec3::ONE, &solid(0.0, 1.5, Vec3::ONE))] {
        let scene = scene_of(slab(0.1, 0), vec![material], vec![environment()]);
        assert_total("slant", &radiance(&scene, DVec3::new(0.3, 0.2, 3.0), DVec3::new(1.0, 0.5, 0.0), 20_000), SKY);
        assert_total("inside", &radiance(&scene, DVec3::ZERO, DVec3::Z, 20_000), 2.25 * SKY);
    }
}

#[test]
fn nested_media_see_each_other() {
    let glass = |transmittance| layered(Vec3::ONE, &solid(0.0, 1.5, transmittance));
    let tinted = Vec3::new(1.0, 0.3, 0.05);
    let reflectance = 0.04;
    // A slab within a slab of the same index is its medium and nothing else, and so is one that reaches out of it.
    let nested = |materials: [Material; 2], [outer, inner]: [f64; 2]| {
        let mut meshes = slab(outer, 0);
        meshes.extend(slab(inner, 1));
        through(meshes, materials.into(), 0.0)
    };
    let kept = |way: f64| tinted.as_dvec3().map(|share| share.powf(way));
    assert_total("tinted within", &nested([glass(Vec3::ONE), glass(tinted)], [0.2, 0.1]), slab_transmits(reflectance, kept(0.2)));
    assert_total("clear within", &nested([glass(tinted), glass(Vec3::ONE)], [0.2, 0.1]), slab_transmits(reflectance, kept(0.2)));
    // Rough boundaries between media of one index vanish, too.
    let rough = layered(Vec3::ONE, &solid(0.6, 1.5, tinted));
    assert_total("rough within", &nested([glass(Vec3::ONE), rough], [0.2, 0.1]), slab_transmits(reflectance, kept(0.2)));
    // Where two lie partly in one another, the smaller one fills the place, on the way down and on the way up.
    let lifted = |slab: Vec<Mesh>, by: f64| moved(scene_of(slab, vec![], vec![]), |at| at + by * DVec3::Z).meshes;
    let meshes = [lifted(slab(0.15, 0), -0.05), lifted(slab(0.25, 1), 0.15)].concat();
    assert_total("overlapping", &through(meshes, vec![glass(tinted), glass(Vec3::ONE)], 0.0), slab_transmits(reflectance, kept(0.3)));
    // Glass of 1.5 in a liquid of 1.2: the outer and the inner boundaries reflect by the media on both sides.
    let liquid = layered(Vec3::ONE, &solid(0.0, 1.2, Vec3::ONE));
    let [outer, inner] = [(0.2f64 / 2.2).powi(2), (0.3f64 / 2.7).powi(2)];
    let incoherent = |layers: &[f64]| 1.0 / (1.0 + layers.iter().map(|reflectance| reflectance / (1.0 - reflectance)).sum::<f64>());
    let expected = incoherent(&[outer, inner, inner, outer]);
    assert_total("immersed", &nested([liquid, glass(Vec3::ONE)], [0.2, 0.1]), DVec3::splat(expected));
}

#[test]
fn eyes_and_receivers_know_what_they_are_in() {
    let tinted = Vec3::new(1.0, 0.3, 0.05);
    let kept = |way: f64| tinted.as_dvec3().map(|share| share.powf(way));
    // A lamp within the solid, and within another one of the same index in it.
    let mut meshes = cuboid(DVec3::splat(2.0), 0);
    meshes.push(square(-1.0, 0.5, true, 2));
    let glass = |transmittance| layered(Vec3::ONE, &solid(0.0, 1.5, transmittance));
    let materials = vec![glass(tinted), glass(Vec3::ONE), lamp_of(Vec3::ONE)];
    let scene = scene_of(meshes.clone(), materials.clone(), vec![]);
    assert_total("one", &radiance(&scene, DVec3::ZERO, -DVec3::Z, 2), kept(1.0));
    meshes.extend(cuboid(DVec3::splat(0.25), 1));
    let scene = scene_of(meshes, materials, vec![]);
    let seen = radiance(&scene, DVec3::new(0.01, 0.02, 0.0), DVec3::new(0.01, 0.02, -1.0), 2);
    assert_total("two", &seen, kept(0.75));

    // Shadow rays within a medium lose light on their way.
    let mut meshes = cuboid(DVec3::splat(2.0), 0);
    meshes.push(square(-1.0, 1.0, true, 1));
    let bulb = LightKind::Point { position: DVec3::Z * 0.5, intensity: Vec3::ONE };
    let scene = scene_of(meshes, vec![glass(tinted), plain(Vec3::ZERO)], vec![bulb]);
    let received = irradiance(&scene, DVec3::Z * -1.0, DVec3::Z, 2).mean.direct;
    assert_meets("bulb", received, DVec3::splat(1e-8), kept(1.5) / 2.25);
}

#[test]
fn alpha_covers_its_share() {
    let sheet = |coverage: Coverage| Material { coverage, two_sided: true, ..plain(Vec3::ZERO) };
    let stack = |coverage, count: u32| {
        let sheets = (0..count).map(|index| square(0.5 + 0.1 * f64::from(index), 5.0, index % 2 == 0, 0));
        let meshes = sheets.chain([square(-1.0, 5.0, true, 1)]).collect();
        let sun = LightKind::Directional { direction: -DVec3::Z, irradiance: Vec3::new(1.0, 2.0, 3.0) };
        scene_of(meshes, vec![sheet(coverage), lamp_of(Vec3::new(1.0, 2.0, 3.0))], vec![sun])
    };
    for count in [1, 3, 6] {
        for alpha in [0.0f32, 0.25, 0.5, 1.0] {
            let scene = stack(Coverage::Blend { alpha }, count);
            let expected = (1.0 - f64::from(alpha)).powi(count as i32) * EMITTED;
            let seen = radiance(&scene, DVec3::Z * 3.0, DVec3::ZERO, 20_000);
            assert_total("seen", &seen, expected);
            assert_eq!(seen.mean.direct, seen.mean.total());
            assert_total("shadow", &irradiance(&scene, DVec3::ZERO, DVec3::Z, 200), expected);
        }
    }
    for (alpha, expected) in [(0.49, EMITTED), (0.5, DVec3::ZERO)] {
        let scene = stack(Coverage::Mask { alpha, cutoff: 0.5 }, 2);
        assert_total("mask", &irradiance(&scene, DVec3::ZERO, DVec3::Z, 2), expected);
        assert_total("mask", &radiance(&scene, DVec3::Z * 3.0, DVec3::ZERO, 2), expected);
    }
    // Factors, textures and vertices multiply.
    let mut scene = stack(Coverage::Blend { alpha: 0.8 }, 1);
    scene.textures.push(row_of_texels(&[[255, 255, 255, 51]], Filter::Bilinear));
    scene.materials[0].base_colour_texture = Some(TextureUse::of(0, 0));
    scene.meshes[0].alphas = vec![0.5; 4];
    assert_total("all", &irradiance(&scene, DVec3::ZERO, DVec3::Z, 2), (1.0 - 0.8f32 as f64 * 0.2 * 0.5) * EMITTED);
    // A lamp that is half there gives half its light, to lobes and to shadow rays.
    let lamp = Material { emission: Vec3::new(1.0, 2.0, 3.0), ..sheet(Coverage::Blend { alpha: 0.5 }) };
    let scene = scene_of(vec![square(1.0, 1.0, false, 0), square(0.0, 1.0, true, 1)], vec![lamp, plain(COLOUR)], vec![]);
    let form_factor = 4.0 / (2f64.sqrt() * PI) * (1.0 / 2f64.sqrt()).atan();
    let expected = 0.5 * form_factor * EMITTED;
    assert_total("receiver", &irradiance(&scene, DVec3::ZERO, DVec3::Z, 100_000), PI * expected);
    let lobe = radiance(&scene, DVec3::new(0.0, 0.3, 0.5), DVec3::ZERO, 100_000);
    assert_meets("lobe", lobe.mean.direct, lobe.standard_error.direct, COLOUR.as_dvec3() * expected);
}

#[test]
fn backs_are_not_there_for_the_eye_alone() {
    let one_sided = Material { two_sided: false, emission: Vec3::ONE, ..plain(COLOUR) };
    // Seen from below, its back; a mirror below shows it to an eye above.
    let scene = scene_of(vec![square(0.0, 5.0, true, 0)], vec![one_sided.clone()], vec![environment()]);
    assert_eq!(radiance(&scene, -DVec3::Z, DVec3::ZERO, 2).mean.direct, SKY);
    assert_total("receiver", &irradiance(&scene, -DVec3::Z, DVec3::Z, 200), DVec3::ZERO);
    let meshes = vec![square(0.0, 500.0, true, 0), square(-1.0, 5.0, true, 1)];
    let mut scene = scene_of(meshes, vec![one_sided, layered(Vec3::ONE, &metal(0.0))], vec![environment()]);
    assert_total("mirrored", &radiance(&scene, DVec3::Z * -0.5, -DVec3::Z, 2), SKY);
    // The same for a lobe that is sampled by lamps and by itself: white metal loses nothing at such a roughness.
    scene.materials[1].layers.roughness = 0.1;
    let seen = radiance(&scene, DVec3::Z * -0.5, -DVec3::Z, 2000);
    assert_meets("rough", seen.mean.specular, seen.total_standard_error + 1e-3, SKY);
    // Rough lobes see the back, which is black.
    scene.materials[1].layers.roughness = 1.0;
    let seen = radiance(&scene, DVec3::Z * -0.5, -DVec3::Z, 200);
    assert!(seen.mean.total().max_element() < 0.01, "{seen:?}");
    // What transmits has two sides.
    let pane = Material { two_sided: false, ..layered(Vec3::ONE, &clear(0.0, 1.5)) };
    let scene = scene_of(vec![square(0.0, 5.0, true, 0)], vec![pane], vec![environment()]);
    let seen = radiance(&scene, -DVec3::Z, DVec3::ZERO, 20_000);
    assert_meets("pane", seen.mean.specular, seen.standard_error.specular, 0.04 * SKY);
}

#[test]
fn unlit_surfaces_are_seen_and_light_nothing() {
    let unlit = layered(COLOUR, &Layers { is_unlit: true, ..Layers::default() });
    let colour = COLOUR.as_dvec3();
    let meshes = || vec![square(1.0, 1.0, false, 0), square(0.0, 5.0, true, 1)];
    let with = |floor: Layers, lights| {
        scene_of(meshes(), vec![Material { emission: Vec3::ONE, ..unlit.clone() }, layered(Vec3::ONE, &floor)], lights)
    };
    let scene = with(metal(0.0), vec![]);
    assert_eq!(radiance(&scene, DVec3::Z * 0.5, DVec3::Z, 2).mean.direct, colour);
    assert_eq!(radiance(&scene, DVec3::Z * 0.5, DVec3::ZERO, 2).mean.specular, colour);
    assert_eq!(irradiance(&scene, DVec3::Z * 0.5, DVec3::Z, 2).mean.total(), DVec3::ZERO);
    // Sharp lobes show it, rough ones do not.
    let rough = radiance(&with(metal(0.1), vec![]), DVec3::Z * 0.5, DVec3::ZERO, 2000).mean;
    assert!(((rough.specular - colour) / colour).abs().max_element() < 2e-3, "{rough:?}");
    assert_eq!(radiance(&with(metal(1.0), vec![]), DVec3::Z * 0.5, DVec3::ZERO, 200).mean.total(), DVec3::ZERO);
    // Shadow rays end there.
    let sun = LightKind::Directional { direction: -DVec3::Z, irradiance: Vec3::ONE };
    assert_eq!(irradiance(&with(metal(1.0), vec![sun]), DVec3::Z * 0.5, DVec3::Z, 2).mean.total(), DVec3::ZERO);
}

#[test]
fn normal_maps_turn_the_light() {
    let sun = DVec3::new(0.48, -0.36, -0.8);
    let code = [204u8, 153, 230, 255];
    let tangents = |tangent: DVec3, sign: f64| vec![[tangent.extend(sign); 3]; 2];
    for (tangent, sign, scale) in [(DVec3::X, 1.0, 1.0f32), (DVec3::X, -1.0, 1.0), (DVec3::new(0.6, 0.8, 0.0), 1.0, 0.5)] {
        for above in [1.0, -1.0] {
            let plate = Material { normal_map: Some(map_of(0, scale)), ..plain(COLOUR) };
            let mut scene = plate_under(plate, LightKind::Directional { direction: above * sun, irradiance: Vec3::ONE });
            scene.meshes[0].tangents = tangents(tangent, sign);
            scene.textures.push(row_of_texels(&[code], Filter::Bilinear));
            let frame = (above * tangent, above * sign * DVec3::Z.cross(tangent), above * DVec3::Z);
            // Seen from behind, the plate has the same shape; seen from where its normal faces away, that is moved to the eye.
            for eye in [DVec3::Z, DVec3::new(-0.96, 0.0, 0.28), DVec3::new(0.0, 0.96, 0.28)] {
                let eye = eye * DVec3::new(1.0, 1.0, above);
                let n = mapped_normal(code, f64::from(scale), frame, eye);
                let expected = COLOUR.as_dvec3() / PI * (-above * sun).dot(n).max(0.0);
                let target = DVec3::new(0.1, 0.2, 0.0);
                let seen = radiance(&scene, target + 3.0 * eye, target, 2);
                assert_meets("turned", seen.mean.total(), DVec3::splat(1e-6), expected);
            }
        }
    }
    // A coat's map turns the coat alone, and the coat without one keeps the normals of the mesh.
    for coat_map in [true, false] {
        let coat_normal_map = coat_map.then(|| map_of(0, 1.0));
        let layers = Layers { coat: 1.0, specular: 0.0, coat_normal_map, ..plastic(0.0) };
        let plate = Material { normal_map: (!coat_map).then(|| map_of(0, 1.0)), ..Material::layered("coated", Vec3::ZERO, layers) };
        let mesh = Mesh { tangents: tangents(DVec3::X, 1.0), coat_tangents: tangents(DVec3::X, 1.0), ..square(0.0, 1.0, true, 0) };
        let n = if coat_map { mapped_normal(code, 1.0, (DVec3::X, DVec3::Y, DVec3::Z), DVec3::Z) } else { DVec3::Z };
        let wi = 2.0 * n.z * n - DVec3::Z;
        let (u, v) = wi.any_orthonormal_pair();
        let lamp_mesh = Mesh::parallelogram("lamp", 0.5 * wi - 0.01 * (u + v), 0.02 * u, 0.02 * v, 1);
        let mut scene = scene_of(vec![mesh, lamp_mesh], vec![plate, Material { two_sided: true, ..lamp_of(Vec3::ONE) }], vec![]);
        scene.textures.push(row_of_texels(&[code], Filter::Bilinear));
        let expected = 0.04 + 0.96 * (1.0 - n.z).powi(5);
        let eye = if coat_map { DVec3::Z } else { DVec3::Z * 0.4 };
        let seen = radiance(&scene, eye, DVec3::ZERO, 2).mean;
        // Texels are f32.
        assert_meets("coat", seen.specular, DVec3::splat(1e-7), DVec3::splat(expected));
    }
}

#[test]
fn textures_of_layers_have_their_channels() {
    // 51, 102 and 153 are 0.2, 0.4 and 0.6 of 255. A texture is the same as factors; channels that do not count are 255.
    const TINT: Vec3 = Vec3::new(0.2, 0.4, 0.6);
    let map = Some(TextureUse::of(0, 0));
    let all = Layers {
        metallic: 0.5,
        roughness: 0.9,
        specular_colour: Vec3::splat(2.0),
        transmission: 0.5,
        coat: 0.8,
        coat_roughness: 0.8,
        sheen_colour: Vec3::splat(0.7),
        sheen_roughness: 0.8,
        ..Layers::default()
    };
    let seen = |layers: Layers, texel: [u8; 4]| {
        let sun = LightKind::Directional { direction: DVec3::new(0.6, 0.0, -0.8), irradiance: Vec3::ONE };
        let mut scene = scene_of(vec![square(0.0, 1.0, true, 0)], vec![layered(COLOUR, &layers)], vec![environment(), sun]);
        scene.textures.push(row_of_texels(&[texel], Filter::Bilinear));
        radiance(&scene, DVec3::new(0.3, 0.0, 0.5), DVec3::ZERO, 4000).mean.total()
    };
    let plain = seen(all, [255; 4]);
    for (texel, textured, scaled) in [
        ([255, 102, 255, 255], Layers { metallic_roughness_texture: map, ..all }, Layers { roughness: 0.4 * 0.9, ..all }),
        ([255, 255, 51, 255], Layers { metallic_roughness_texture: map, ..all }, Layers { metallic: 0.2 * 0.5, ..all }),
        ([255, 255, 255, 51], Layers { specular_texture: map, ..all }, Layers { specular: 0.2, ..all }),
        ([51, 102, 153, 255], Layers { specular_colour_texture: map, ..all }, Layers { specular_colour: 2.0 * TINT, ..all }),
        ([51, 255, 255, 255], Layers { transmission_texture: map, ..all }, Layers { transmission: 0.2 * 0.5, ..all }),
        ([51, 255, 255, 255], Layers { coat_texture: map, ..all }, Layers { coat: 0.2 * 0.8, ..all }),
        ([255, 102, 255, 255], Layers { coat_roughness_texture: map, ..all }, Layers { coat_roughness: 0.4 * 0.8, ..all }),
        ([51, 102, 153, 255], Layers { sheen_colour_texture: map, ..all }, Layers { sheen_colour: 0.7 * TINT, ..all }),
        ([255, 255, 255, 102], Layers { sheen_roughness_texture: map, ..all }, Layers { sheen_roughness: 0.4 * 0.8, ..all }),
    ] {
        // The same random numbers make the same paths.
        let (by_texture, by_factor) = (seen(textured, texel), seen(scaled, texel));
        assert_meets(&format!("{textured:?}"), by_texture, 1e-5 * by_factor, by_factor);
        assert!((by_factor - plain).abs().max_element() >= 1e-3, "{scaled:?} changes nothing: {plain}, {by_factor}");
    }
}
