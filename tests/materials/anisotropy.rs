//! Anisotropic surfaces: in the sun by their formulas, under a sky by quadrature, and in pictures by the path tracer.

use crate::common::estimate_check;
use crate::common::layered::{SUNS, compare, in_the_sun, inputs, layered, metal, plastic, row_of_texels, straight};
use crate::common::plates::{COSINES, Plates};
use crate::common::prelude::*;
use photonmill::engine::scene::{self, Target};
use photonmill::scene::material::{Layers, NormalMap, TextureUse};
use photonmill::scene::texture::Filter;
use photonmill::verify::judge::Verdict;
use photonmill::verify::judge::lobes::{Frame, Inputs, Lobes};

/// A direction in red and green, and a strength in blue.
const TEXELS: [[u8; 4]; 2] = [[255, 128, 255, 255], [60, 220, 180, 255]];

/// Plates whose bases are rougher along a direction of the tangent, of the file's rotation, of a texture or of both; on either side of a
/// mirrored texture's seam, and seen from behind.
pub fn plates_in_the_sun(gpu: &Gpu) -> Check<Complaint> {
    let textures = TEXELS.map(|texel| row_of_texels(&[texel], Filter::Bilinear)).to_vec();
    let of = [
        Layers { anisotropy: 0.6, ..metal(0.3) },
        Layers { anisotropy: 1.0, anisotropy_rotation: 0.7, ..metal(0.2) },
        Layers { anisotropy: 0.5, anisotropy_rotation: -2.0, ..metal(0.7) },
        Layers { anisotropy: 0.8, anisotropy_rotation: 0.4, anisotropy_texture: Some(TextureUse::of(1, 0)), ..plastic(0.4) },
        Layers { anisotropy: 0.7, anisotropy_texture: Some(TextureUse::of(0, 0)), coat: 0.5, coat_roughness: 0.4, ..metal(0.5) },
        Layers { anisotropy: 0.7, iridescence: 0.8, film_ior: 1.7, film_thickness: [0.0, 300.0], ..metal(0.4) },
        Layers { anisotropy: 0.6, transmission: 0.7, ..plastic(0.4) },
        Layers { anisotropy: 0.6, transmission: 1.0, medium: Some(photonmill::scene::material::Medium::CLEAR), ..plastic(0.4) },
    ];
    let mut plates = Plates::new(4 * of.len(), Vec::new());
    plates.scene.textures = textures;
    let mut lobes = Vec::new();
    for row in 0..4 {
        for layers in &of {
            for (sign, is_back) in [(1.0, false), (-1.0, false), (1.0, true), (-1.0, true)] {
                // A solid seen from behind is seen from within.
                let is_back = is_back && layers.medium.is_none();
                let material = Material { two_sided: true, ..layered(Vec3::new(0.8, 0.5, 0.2), layers) };
                let (place, mesh) = plates.add(row, material.clone());
                mesh.tangents = vec![[place.x.extend(sign); 3]; 2];
                if is_back {
                    mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
                }
                let across = if is_back { -sign } else { sign } * place.y;
                let [red, green, blue] = layers.anisotropy_texture.map_or([1.0, 0.5, 1.0], |used| {
                    let [red, green, blue, _] = TEXELS[used.texture];
                    [red, green, blue].map(|code| f64::from(code) / 255.0)
                });
                let (sine, cosine) = f64::from(layers.anisotropy_rotation).sin_cos();
                let (x, y) = (2.0 * red - 1.0, 2.0 * green - 1.0);
                let tangent = ((cosine * x - sine * y) * place.x + (sine * x + cosine * y) * across).normalize();
                let alpha = f64::from(layers.roughness).powi(2);
                let along = alpha + (f64::from(layers.anisotropy) * blue).powi(2) * (1.0 - alpha);
                let inputs = Inputs { stretch: Some((tangent, along)), ..inputs(&material) };
                lobes.push(Lobes::new(inputs, Frame { wo: place.wo, ng: place.normal, n: place.normal, coat_n: place.normal }));
            }
        }
    }
    for way in SUNS {
        plates.scene.lights = vec![lamp(sun(-way))];
        let found = plates.seen(gpu, &straight()).0;
        let expected: Vec<DVec3> = lobes.iter().map(|lobes| in_the_sun(lobes, way.normalize())).collect();
        compare(&format!("anisotropy, the sun at {way}"), &found, &expected, 4e-3)?;
    }
    Ok(())
}

#[test]
fn plates_in_the_sun_are_as_bright_as_the_formula_says() {
    let Some(gpu) = device() else { return };
    assert_holds("in the sun", plates_in_the_sun(&gpu));
}

/// Roughness, strength, degrees between the stretch and the plane of the eye, and what a white metal of these sends back of an even sky
/// at each of [`COSINES`], by quadrature over half vectors.
const METALS: [(f32, f32, f32, [f64; 5]); 3] = [
    (0.3, 0.5, 0.0, [0.9227, 0.9003, 0.8639, 0.8769, 0.9517]),
    (0.3, 1.0, 90.0, [0.5301, 0.5293, 0.5264, 0.5153, 0.5964]),
    (0.6, 0.8, 45.0, [0.6002, 0.6105, 0.6511, 0.7653, 0.9021]),
];

/// White metals under a sky of 1, found by light samples and by paths.
pub fn metals_under_the_sky(gpu: &Gpu) -> Check<Complaint> {
    let mut plates = Plates::new(METALS.len(), vec![LightKind::Environment { radiance: Vec3::ONE }]);
    let mut expected = Vec::new();
    for row in 0..COSINES.len() {
        for (roughness, anisotropy, degrees, albedos) in METALS {
            // The eye is in the plane of the normal and y.
            let anisotropy_rotation = (90.0 - degrees).to_radians();
            let (place, mesh) = plates.add(row, layered(Vec3::ONE, &Layers { anisotropy, anisotropy_rotation, ..metal(roughness) }));
            mesh.tangents = vec![[place.x.extend(1.0); 3]; 2];
            expected.push(albedos[row]);
        }
    }
    let without = vec![Effect::Indirect, Effect::ReflectiveCaustics, Effect::RefractiveCaustics];
    let settings = SceneSettings { samples: 16, rounds: 64, shadow_rays: 4, without, ..by_rounds() };
    let (found, errors) = plates.seen(gpu, &settings);
    for (k, ((found, error), expected)) in pairs(pairs(found, errors), expected).enumerate() {
        println!("plate {k}: {} +- {}, {expected} expected", found.x, error.x);
        estimate_check(&format!("plate {k}"), found.x, expected, error.x.hypot(1e-4))?;
        require(error.x < 0.02 * expected, || format!("plate {k}: +- {}", error.x)).map_err(|text| Complaint::new(Kind::TooNoisy, text))?;
    }
    Ok(())
}

#[test]
fn metals_return_what_quadrature_says() {
    let Some(gpu) = device() else { return };
    assert_holds("under the sky", metals_under_the_sky(&gpu));
}

/// Around the axis y.
fn brushed_ball(x: f64, material: usize) -> Mesh {
    let centre = DVec3::new(x, 0.25, 0.1);
    let mut ball = Mesh::sphere("ball", centre, 0.22, 32, material);
    let around = |vertex: u32| DVec3::Y.cross(ball.positions[vertex as usize] - centre).normalize_or(DVec3::X).extend(1.0);
    ball.tangents = ball.triangles.iter().map(|corners| corners.map(around)).collect();
    ball.uvs[0] = ball.positions.iter().map(|position| DVec2::new(4.0 * position.x, 4.0 * position.y)).collect();
    ball
}

/// Metal, plastic and rough glass beside a lamp, and photons that they throw onto the floor.
#[test]
fn brushed_balls_agree_with_the_judge() {
    const SIZE: u32 = 24;
    let Some(gpu) = device() else { return };
    let lamp = Material { emission: Vec3::splat(12.0), ..matt(0.0) };
    let of = |layers: Layers| Material::layered("brushed", Vec3::new(0.8, 0.7, 0.6), layers);
    let anisotropy_texture = Some(TextureUse::of(0, 0));
    let bumpy = Some(NormalMap { texture: TextureUse::of(1, 0), scale: 1.0 });
    let materials = vec![
        matt(0.6),
        lamp,
        of(Layers { anisotropy: 0.8, anisotropy_texture, ..metal(0.5) }),
        Material { normal_map: bumpy, ..of(Layers { anisotropy: 0.9, anisotropy_rotation: 1.0, ..plastic(0.3) }) },
        of(Layers { anisotropy: 0.5, transmission: 1.0, medium: Some(photonmill::scene::material::Medium::CLEAR), ..plastic(0.3) }),
    ];
    let meshes = vec![
        level(0.0, [2.4, 2.4], true, 0),
        level(1.2, [0.6, 0.6], false, 1),
        brushed_ball(-0.5, 2),
        brushed_ball(0.0, 3),
        brushed_ball(0.5, 4),
    ];
    let mut scene = scene_of(meshes, materials, vec![LightKind::Environment { radiance: Vec3::splat(0.4) }]);
    scene.textures = vec![
        row_of_texels(&[[255, 128, 255, 255], [128, 255, 120, 255]], Filter::Nearest),
        row_of_texels(&[[150, 120, 250, 255], [110, 140, 240, 255]], Filter::Nearest),
    ];
    scene.cameras.push(Camera::looking_at("camera", DVec3::new(0.0, 0.5, 1.7), DVec3::new(0.0, 0.2, 0.0), DVec3::Y, 0.7));
    let settings = SceneSettings { photons: 20_000, caustic_photons: 20_000, samples: 4, rounds: 32, ..by_rounds() };
    let camera = scene.first_camera();
    let lit = scene::render(&gpu, &scene, &settings, Target::Picture(&camera, [SIZE; 2])).unwrap();
    let judged = Judge::new(&scene, 64).image(&camera, SIZE, SIZE, 512, 77);
    let verdict = Verdict::new(&means(&lit), &standard_errors(&lit), 32, &judged, None);
    println!("{verdict}");
    assert!(verdict.agrees(), "{verdict}");
}
