//! Layered materials: pictures against the path tracer, and the closed forms that no question of `tests/engine/planted_faults.rs` has.

use crate::common::layered::{
    self, CLEAR, Returns, SHEEN, film, in_each_sun, inputs, layered, lobes_at, metal, mixtures_of, plastic, row_of_texels,
};
use crate::common::plates::{Place, Plates};
use crate::common::prelude::*;
use crate::common::{estimate_check, known, planted, sheets};
use crate::tests::materials::media;
use photonmill::engine::scene::{Receivers, RunResult};
use photonmill::scene::material::{Coverage, Layers, Medium, NormalMap};
use photonmill::scene::texture::Filter;
use photonmill::verify::judge::lobes::{Frame, Inputs, Lobes};
use photonmill::verify::judge::{Image, Verdict};

/// Things of a radius over a grey floor, before a red wall, under a dim sky and a lamp of which three tenths are gaps.
fn stage(things: Vec<(Material, DVec3, f64)>) -> Scene {
    let mut meshes = vec![
        level(0.0, [3.0, 3.0], true, 0),
        Mesh::parallelogram("wall", DVec3::new(-1.5, 0.0, -0.8), 3.0 * DVec3::X, 2.4 * DVec3::Y, 1),
        level(2.1, [0.7, 0.7], false, 2),
    ];
    let lamp = Material { emission: Vec3::splat(24.0), coverage: Coverage::Blend { alpha: 0.7 }, ..layered::dull(0.0) };
    let mut materials = vec![matt(0.5), Material::lambert("red", Vec3::new(0.7, 0.2, 0.1)), lamp];
    for (material, middle, radius) in things {
        let mut ball = Mesh::sphere("ball", middle, radius, 32, materials.len());
        let around = |vertex: u32| DVec3::Y.cross(ball.positions[vertex as usize] - middle).normalize_or(DVec3::X).extend(1.0);
        ball.tangents = ball.triangles.iter().map(|corners| corners.map(around)).collect();
        ball.uvs[0] = ball.positions.iter().map(|at| DVec2::new(4.0 * at.x, 4.0 * at.y)).collect();
        meshes.push(ball);
        materials.push(material);
    }
    let mut scene = scene_of(meshes, materials, vec![LightKind::Environment { radiance: Vec3::splat(0.2) }]);
    // Directions of a stretch, and normals.
    scene.textures = vec![
        row_of_texels(&[[255, 128, 255, 255], [128, 255, 120, 255]], Filter::Nearest),
        row_of_texels(&[[150, 120, 250, 255], [110, 140, 240, 255]], Filter::Nearest),
    ];
    scene
}

/// Several runs of few rounds each: the mean picture, its errors, and each part of the light with its own.
struct Runs {
    means: Vec<DVec3>,
    errors: Vec<DVec3>,
    /// Mean over pixels, all channels together.
    parts: [(f64, f64); 4],
    rounds: u32,
}

const SEEDS: u32 = 4;

fn runs(gpu: &Gpu, scene: &Scene, rounds: u32, camera: &Camera, size: [u32; 2]) -> Runs {
    let of = |seed: u32| {
        let settings = SceneSettings { seed: seed.into(), photons: 10_000, caustic_photons: 10_000, rounds, ..by_rounds() };
        render(gpu, scene, &settings, Receivers::Image(camera, size)).unwrap()
    };
    let all: Vec<RunResult> = (1..=SEEDS).map(of).collect();
    let pixels = all[0].film.pixels();
    let share = 1.0 / f64::from(SEEDS);
    let means = (0..pixels).map(|place| all.iter().map(|result| share * result.film.mean(place)).sum()).collect();
    let squared = |place: usize| all.iter().map(|result| result.film.standard_error(place).powf(2.0)).sum::<DVec3>();
    let errors = (0..pixels).map(|place| share * squared(place).map(f64::sqrt)).collect();
    let parts = std::array::from_fn(|part| {
        let of_run = |result: &RunResult| {
            result.film.part_totals[part] as f64 / (result.plan.film.scale * f64::from(result.film.rounds) * pixels as f64)
        };
        mean_and_error(&all.iter().map(of_run).collect::<Vec<f64>>())
    });
    Runs { means, errors, parts, rounds: SEEDS * rounds }
}

/// Whether a picture is the path tracer's, as a whole and part by part.
fn compare(name: &str, runs: &Runs, judged: &Image) -> Check {
    let verdict = Verdict::new(&runs.means, &runs.errors, runs.rounds, judged, None);
    println!("{name}: {verdict}");
    let mut text = String::new();
    for (place, part) in Part::EACH.into_iter().enumerate() {
        let pixels = judged.pixels.len() as f64;
        let expected = judged.pixels.iter().map(|pixel| pixel.mean[part].element_sum()).sum::<f64>() / pixels;
        let variance =
            judged.pixels.iter().map(|pixel| pixel.standard_error[part].powf(2.0).element_sum()).sum::<f64>() / (pixels * pixels);
        let (found, error) = runs.parts[place];
        let z = (found - expected) / (error * error + variance + 1e-12).sqrt();
        println!("  {part:?}: {found:.5} +- {error:.5}, judge {expected:.5} +- {:.5}, z {z:.2}", variance.sqrt());
        if z.abs() > 6.0 && (found - expected).abs() > 0.003 * expected {
            text += &format!("{part:?}: {found} instead of {expected}; ");
        }
    }
    if !verdict.agrees() {
        text += &verdict.to_string();
    }
    require(text.is_empty(), || format!("{name}: {text}"))
}

fn judged(scene: &Scene, camera: &Camera, [width, height]: [u32; 2], samples: u32) -> Image {
    Judge::new(scene, 64).image(camera, width, height, samples, 77)
}

fn coloured(layers: &Layers) -> Material {
    layered(Vec3::new(0.8, 0.5, 0.2), layers)
}

fn glass(roughness: f32) -> Layers {
    Layers { transmission: 1.0, medium: CLEAR, ..plastic(roughness) }
}

/// Each lobe by itself.
fn lobes() -> Vec<(&'static str, Material)> {
    let tinted = Some(Medium { transmittance: Vec3::new(0.9, 0.3, 0.5), metres: 1.0 });
    vec![
        ("rough plastic", coloured(&plastic(0.6))),
        ("plastic", coloured(&plastic(0.3))),
        ("polished plastic", coloured(&plastic(0.0))),
        ("rough metal", coloured(&metal(0.7))),
        ("metal", coloured(&metal(0.3))),
        ("polished metal", coloured(&metal(0.0))),
        ("half metal", coloured(&Layers { metallic: 0.5, ..plastic(0.4) })),
        ("tinted reflection", coloured(&Layers { specular: 0.7, specular_colour: Vec3::new(1.0, 3.0, 0.4), ior: 2.0, ..plastic(0.6) })),
        ("sheen", coloured(&Layers { sheen_colour: SHEEN, sheen_roughness: 0.5, ..plastic(0.6) })),
        ("smooth thin wall", coloured(&Layers { medium: None, ..glass(0.0) })),
        ("rough thin wall", coloured(&Layers { medium: None, ..glass(0.4) })),
        ("glass", coloured(&glass(0.0))),
        ("rough glass", coloured(&glass(0.4))),
        ("tinted glass", coloured(&Layers { medium: tinted, ..glass(0.0) })),
        ("blended", Material { coverage: Coverage::Blend { alpha: 0.4 }, ..coloured(&plastic(0.6)) }),
        ("unlit", coloured(&Layers { is_unlit: true, ..plastic(0.6) })),
    ]
}

/// Each pair of lobes, one over or beside the other; then what has a direction, a film, paper and wax, and glass that disperses.
fn mixtures() -> Vec<(&'static str, Material)> {
    let (coat, coat_roughness) = (1.0, 0.55);
    let (sheen_colour, sheen_roughness) = (SHEEN, 0.5);
    let paper = |share, diffuse_transmission_colour, medium| Layers {
        diffuse_transmission: share,
        diffuse_transmission_colour,
        medium,
        ..plastic(0.7)
    };
    let tint = |transmittance| Some(Medium { transmittance, metres: 0.3 });
    let dispersive = |layers| Layers { ior: 1.6, dispersion: 4.0, ..layers };
    let bumpy = Some(NormalMap { texture: TextureUse::of(1, 0), scale: 1.0 });
    vec![
        ("coat over plastic", coloured(&Layers { coat: 0.8, coat_roughness: 0.1, ..plastic(0.6) })),
        ("rough coat over metal", coloured(&Layers { coat, coat_roughness, ..metal(0.4) })),
        ("sheen over half metal", coloured(&Layers { sheen_colour, sheen_roughness, metallic: 0.5, ..plastic(0.3) })),
        ("sheen over a coat", coloured(&Layers { sheen_colour, sheen_roughness, coat, coat_roughness, ..plastic(0.6) })),
        ("a pane under sheen", coloured(&Layers { sheen_colour, sheen_roughness, medium: None, ..glass(0.0) })),
        ("half a rough wall", coloured(&Layers { transmission: 0.5, coat: 0.6, metallic: 0.3, ..plastic(0.5) })),
        ("coated rough glass", coloured(&Layers { coat, coat_roughness, ..glass(0.4) })),
        ("glass under sheen", coloured(&Layers { sheen_colour, sheen_roughness, transmission: 0.7, ..glass(0.0) })),
        ("blended metal", Material { coverage: Coverage::Blend { alpha: 0.6 }, ..coloured(&Layers { coat, ..metal(0.2) }) }),
        ("coated glass", layered(Vec3::ONE, &Layers { ior: 2.4, coat, ..glass(0.0) })),
        ("brushed metal", coloured(&Layers { anisotropy: 0.8, anisotropy_texture: Some(TextureUse::of(0, 0)), ..metal(0.5) })),
        (
            "brushed bumpy plastic",
            Material { normal_map: bumpy, ..coloured(&Layers { anisotropy: 0.9, anisotropy_rotation: 1.0, ..plastic(0.3) }) },
        ),
        ("brushed glass", coloured(&Layers { anisotropy: 0.5, ..glass(0.3) })),
        ("a film on metal", coloured(&film(1.8, 300.0, &metal(0.6)))),
        ("a film on plastic", coloured(&film(1.4, 420.0, &plastic(0.4)))),
        ("a bubble", coloured(&film(1.33, 350.0, &glass(0.0)))),
        ("paper", coloured(&paper(0.6, Vec3::new(0.5, 0.9, 0.2), None))),
        ("wax", coloured(&paper(0.8, Vec3::ONE, tint(Vec3::new(0.9, 0.4, 0.1))))),
        ("a dispersive ball", layered(Vec3::ONE, &dispersive(Layers { medium: tint(Vec3::new(0.3, 0.6, 0.9)), ..glass(0.0) }))),
        ("a rough dispersive ball", layered(Vec3::ONE, &dispersive(glass(0.4)))),
    ]
}

/// All mixtures in rows that light each other, and beside the camera a tank of water with a lamp, a matt ball and one of glass in it.
fn all_mixtures() -> Scene {
    let place = |k: usize| {
        let (column, row) = ((k % 5) as f64, (k / 5) as f64);
        DVec3::new(0.42 * column - 0.94 + 0.21 * (row % 2.0), 0.2 + 0.42 * row, 0.3 - 0.25 * row)
    };
    let in_rows = mixtures().into_iter().enumerate().map(|(k, (_, material))| (material, place(k), 0.2));
    let in_water = [
        (matt(0.6), DVec3::new(-1.1, 0.25, 0.9), 0.15),
        (media::solid("glass", 1.5, Vec3::new(0.9, 0.2, 0.3)), DVec3::new(-0.75, 0.25, 0.9), 0.15),
    ];
    let mut scene = stage(in_rows.chain(in_water).collect());
    let water = Layers { medium: Some(Medium { transmittance: Vec3::new(0.4, 0.7, 0.9), metres: 0.3 }), ior: 1.33, ..glass(0.0) };
    scene.materials.extend([layered(Vec3::ONE, &water), Material { emission: Vec3::splat(5.0), ..matt(0.0) }]);
    let [water, lamp] = [2, 1].map(|before| scene.materials.len() - before);
    scene.meshes.extend(media::cuboid("water", DVec3::new(-1.4, 0.03, 0.6), DVec3::new(-0.5, 0.8, 1.5), water));
    scene.meshes.push(Mesh::parallelogram("bulb", DVec3::new(-1.0, 0.7, 0.85), DVec3::X * 0.1, DVec3::Z * 0.1, lamp));
    scene
}

/// From before the stage, and from within the water.
fn cameras() -> [Camera; 2] {
    [
        Camera::looking_at("air", DVec3::new(0.3, 1.0, 2.6), DVec3::new(0.0, 0.75, 0.0), DVec3::Y, 0.8),
        Camera::looking_at("water", DVec3::new(-0.95, 0.4, 1.4), DVec3::new(-0.92, 0.3, 0.9), DVec3::Y, 0.9),
    ]
}

type Lacking = (&'static str, fn(&mut Layers));

/// Effects whose absence the picture from before the stage shows; plates show those of a coat and of a stretch.
const LACKING: [Lacking; 5] = [
    ("no coat and no sheen", |layers| (layers.coat, layers.sheen_colour) = (0.0, Vec3::ZERO)),
    ("no sheen", |layers| layers.sheen_colour = Vec3::ZERO),
    ("no films", |layers| layers.iridescence = 0.0),
    ("paper that lets nothing through", |layers| layers.diffuse_transmission = 0.0),
    ("clear media", |layers| layers.medium = layers.medium.map(|_| Medium::CLEAR)),
];

#[test]
#[ignore = "long: each lobe and mixture by itself, all in one picture, and each effect left out"]
fn pictures_of_each_lobe_agree_with_the_judge() {
    let Some(gpu) = device() else { return };
    let (all, [in_air, in_water]) = (all_mixtures(), cameras());
    // Paths that meet the lamp in the water are few and bright.
    for (camera, size, samples) in [(&in_air, [96, 72], 256), (&in_water, [48, 36], 1024)] {
        assert_holds(&camera.name, compare(&camera.name, &runs(&gpu, &all, 8, camera, size), &judged(&all, camera, size, samples)));
    }
    let found = runs(&gpu, &all, 32, &in_air, [64, 48]);
    for (what, change) in LACKING {
        let mut other = all.clone();
        other.materials.iter_mut().for_each(|material| change(&mut material.layers));
        assert_complains(what, compare(what, &found, &judged(&other, &in_air, [64, 48], 256)));
    }
    let mut wrong = Vec::new();
    for (name, material) in lobes().into_iter().chain(mixtures()) {
        let ball = stage(vec![(material, DVec3::new(0.0, 0.45, 0.1), 0.4)]);
        wrong.extend(compare(name, &runs(&gpu, &ball, 16, &in_air, [24; 2]), &judged(&ball, &in_air, [24; 2], 512)).err());
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Rays towards lamps count for each lobe that has a width, also where no surface keeps photons.
#[test]
fn a_sharp_metal_alone_has_highlights() {
    let Some(gpu) = device() else { return };
    let camera = Camera::looking_at("above", DVec3::Y * 3.0, DVec3::ZERO, DVec3::NEG_Z, 0.01);
    let settings = SceneSettings { photons: 1000, caustic_photons: 1000, rounds: 8, ..by_rounds() };
    let seen = |roughness| {
        let plate = layered(Vec3::ONE, &metal(roughness));
        let scene = scene_of(vec![level(0.0, [1.0; 2], true, 0)], vec![plate], vec![sun(DVec3::NEG_Y)]);
        mean_red(&seen(&gpu, &scene, &settings, &camera, [4, 4]))
    };
    // GGX along the normal is 1 / (4 pi alpha^2), at a roughness of .4 (Walter et al. 2007).
    let expected = 1.0 / (4.0 * PI * 0.16f64.powi(2));
    assert!((seen(0.4) / expected - 1.0).abs() < 0.02, "{}, {expected}", seen(0.4));
    assert_eq!(seen(0.0), 0.0);
}

/// What normal maps clamp of photons that meet nothing afterwards is next to nothing.
#[test]
fn light_that_is_clamped_at_a_plate_alone_is_little() {
    let Some(gpu) = device() else { return };
    let normal_map = Some(layered::map_of(0, 1.0));
    let plate = Material { normal_map, ..layered(Vec3::ONE, &plastic(0.6)) };
    let mut scene = scene_of(vec![level(0.0, [1.0; 2], true, 0)], vec![plate], vec![LightKind::Environment { radiance: Vec3::ONE }]);
    scene.textures = vec![row_of_texels(&[layered::LEANS[1]], Filter::Nearest)];
    scene.meshes[0].tangents = vec![[DVec3::X.extend(1.0); 3]; 2];
    let camera = Camera::looking_at("aside", DVec3::new(3.0, 1.0, 0.0), DVec3::ZERO, DVec3::Y, 0.1);
    let settings = SceneSettings { photons: 4000, caustic_photons: 1000, rounds: 8, ..by_rounds() };
    let result = seen(&gpu, &scene, &settings, &camera, [4, 4]);
    assert!(result.losses.clamped > 0.0 && result.losses.relative < 1e-3, "{:?}", result.losses);
}

/// A direction in red and green, and a strength in blue.
const TEXELS: [[u8; 4]; 2] = [[255, 128, 255, 255], [60, 220, 180, 255]];

/// Plates whose bases are rougher along a direction of the tangent, of the file's rotation, of a texture or of both; on either side of a
/// mirrored texture's seam, and seen from behind. Then coats and sheen over what lets light through, and a back that is not there for
/// the eye: what lies behind it is seen.
#[test]
fn plates_in_the_sun_have_the_lobes_of_the_guide() {
    let Some(gpu) = device() else { return };
    let of = [
        Layers { anisotropy: 0.6, ..metal(0.3) },
        Layers { anisotropy: 1.0, anisotropy_rotation: 0.7, ..metal(0.2) },
        Layers { anisotropy: 0.5, anisotropy_rotation: -2.0, ..metal(0.7) },
        Layers { anisotropy: 0.8, anisotropy_rotation: 0.4, anisotropy_texture: Some(TextureUse::of(1, 0)), ..plastic(0.4) },
        Layers { anisotropy: 0.7, anisotropy_texture: Some(TextureUse::of(0, 0)), coat: 0.5, coat_roughness: 0.4, ..metal(0.5) },
        Layers { anisotropy: 0.7, iridescence: 0.8, ..film(1.7, 300.0, &metal(0.4)) },
        Layers { anisotropy: 0.6, transmission: 0.7, ..plastic(0.4) },
        Layers { anisotropy: 0.6, ..glass(0.4) },
    ];
    let covered = mixtures_of(true, true);
    let mut plates = Plates::new(4 * of.len() + covered.len() + 1, Vec::new());
    plates.scene.textures = TEXELS.map(|texel| row_of_texels(&[texel], Filter::Bilinear)).to_vec();
    let mut expected = Vec::new();
    for row in 0..4 {
        let from_all = |layers| [(layers, 1.0, false), (layers, -1.0, false), (layers, 1.0, true), (layers, -1.0, true)];
        for (layers, sign, is_back) in of.iter().flat_map(from_all) {
            // A solid seen from behind is seen from within.
            let is_back = is_back && layers.medium.is_none();
            let material = Material { two_sided: true, ..coloured(layers) };
            let (place, mesh) = plates.add(row, material.clone());
            mesh.tangents = vec![[place.x.extend(sign); 3]; 2];
            if is_back {
                mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
            }
            let across = if is_back { -sign } else { sign } * place.y;
            let [red, green, blue, _] =
                layers.anisotropy_texture.map_or([1.0, 0.5, 1.0, 1.0], |used| TEXELS[used.texture].map(|code| f64::from(code) / 255.0));
            let way = DVec2::from_angle(layers.anisotropy_rotation.into()).rotate(DVec2::new(2.0 * red - 1.0, 2.0 * green - 1.0));
            let tangent = (way.x * place.x + way.y * across).normalize();
            let alpha = f64::from(layers.roughness).powi(2);
            let along = alpha + (f64::from(layers.anisotropy) * blue).powi(2) * (1.0 - alpha);
            let inputs = Inputs { stretch: Some((tangent, along)), ..inputs(&material) };
            let frame = Frame { wo: place.wo, ng: place.normal, n: place.normal, coat_n: place.normal };
            expected.push((Lobes::new(&inputs, frame), DVec3::ZERO));
        }
        for material in &covered {
            let place = plates.add(row, material.clone()).0;
            expected.push((lobes_at(material, &place, place.normal), DVec3::ZERO));
        }
        let (place, mesh) = plates.add(row, layered::dull(0.7));
        mesh.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
        let mut behind = mesh.clone();
        behind.positions.iter_mut().for_each(|at| *at -= 0.01 * place.wo);
        behind.material = plates.scene.materials.len();
        plates.scene.materials.push(Material { two_sided: true, ..layered(Vec3::splat(0.3), &Layers { is_unlit: true, ..metal(1.0) }) });
        plates.scene.meshes.push(behind);
        expected.push((lobes_at(&layered::dull(0.0), &place, place.normal), DVec3::splat(0.3)));
    }
    assert_holds("in the sun", in_each_sun(&gpu, "plates", plates, &expected, 5e-3));
}

/// A ball of one leaning normal, mirrored or not, at places of its front and its rim: from straight before it, and aslant.
#[test]
fn balls_have_the_normals_of_their_maps() {
    let Some(gpu) = device() else { return };
    let mut ball = Mesh::sphere("ball", DVec3::ZERO, 1.0, 256, 0);
    // Along the parallels.
    let tangent = |normal: DVec3| DVec3::new(-normal.z, 0.0, normal.x).try_normalize().unwrap_or(DVec3::X);
    let way = DVec3::new(0.5, 0.7, 0.6).normalize();
    let material = Material { normal_map: Some(layered::map_of(0, 1.0)), ..layered::dull(0.6) };
    for (sign, at, aslant) in
        [(1.0, DVec3::new(0.6, 0.3, 0.8), 0.0), (-1.0, DVec3::new(-0.3, 0.7, 0.6), 1.2), (-1.0, DVec3::new(0.9, 0.1, 0.1), 1.2)]
    {
        ball.tangents = ball.triangles.iter().map(|corners| corners.map(|k| tangent(ball.normals[k as usize]).extend(sign))).collect();
        let mut scene = scene_of(vec![ball.clone()], vec![material.clone()], vec![sun(-way)]);
        scene.textures = vec![row_of_texels(&[layered::LEANS[1]], Filter::Bilinear)];
        let normal = at.normalize();
        let x = tangent(normal);
        let wo = (normal + aslant * x).normalize();
        let camera = Camera::looking_at("eye", normal + 3.0 * wo, normal, DVec3::Y, 1e-4);
        let found = means(&seen(&gpu, &scene, &layered::straight(), &camera, [1, 1]))[0].x;
        let n = layered::mapped_normal(layered::LEANS[1], 1.0, (x, sign * normal.cross(x), normal), wo);
        let expected = layered::in_the_sun(&lobes_at(&material, &Place::of_normal(normal, wo), n), way).x;
        // The mesh is a polyhedron of 256 meridians.
        assert_holds("a ball", estimate_check(&format!("the ball at {at}, sign {sign}"), found, expected, 1e-4));
    }
}

#[test]
fn alphas_of_vertices_are_looked_up_without_colours() {
    let sheet = Mesh { alphas: vec![0.5; 4], ..level(0.0, [1.0; 2], true, 0) };
    let scene = scene_of(vec![sheet], vec![layered::dull(0.5)], vec![sun(DVec3::NEG_Y)]);
    let plan = scene_plan_within(&Limits::of_host(), &scene, &by_rounds(), square_picture(1)).unwrap();
    assert!(plan.simulates(Effect::VertexColours));
    assert!(scene.without(&[Effect::VertexColours]).meshes[0].alphas.is_empty());
}

#[test]
fn sheets_let_their_share_pass() {
    let Some(gpu) = device() else { return };
    assert_holds("a lamp", sheets::lamp_between_sheets(&gpu));
    if is_long_run() {
        for illumination in BOTH {
            assert_holds("the sun", sheets::sun_through_sheets(&gpu, illumination));
        }
    }
}

/// Roughness, strength, degrees between the stretch and the plane of the eye, and what a white metal of these sends back of an even sky
/// at each cosine, by quadrature over half vectors.
const BRUSHED_METALS: [(f32, f32, f32, [f64; 5]); 3] = [
    (0.3, 0.5, 0.0, [0.9227, 0.9003, 0.8639, 0.8769, 0.9517]),
    (0.3, 1.0, 90.0, [0.5301, 0.5293, 0.5264, 0.5153, 0.5964]),
    (0.6, 0.8, 45.0, [0.6002, 0.6105, 0.6511, 0.7653, 0.9021]),
];

/// Mixtures of opaque lobes and films by the path tracer's lobes, white dielectrics, which send all of it back, and white metals.
#[test]
fn plates_return_what_the_sky_sends() {
    let Some(gpu) = device() else { return };
    let white = [plastic(0.0), plastic(0.3), plastic(0.6), plastic(1.0), Layers { coat: 1.0, ..plastic(0.0) }];
    let films =
        [film(1.4, 380.0, &plastic(0.2)), film(2.0, 250.0, &plastic(0.8)), film(1.8, 300.0, &Layers { metallic: 0.5, ..plastic(0.4) })];
    let mixed = mixtures_of(false, false).into_iter().filter(|material| material.layers.metallic == 0.5);
    let unknown = mixed.chain(mixtures_of(true, false)).chain(films.map(|layers| layered(Vec3::ONE, &layers)));
    let mut materials: Vec<Returns> = unknown.map(|material| (material, None)).collect();
    materials.extend(white.map(|layers| (layered(Vec3::ONE, &layers), Some([1.0; 5]))));
    materials.extend(layered::white_metals());
    materials.extend(BRUSHED_METALS.map(|(roughness, anisotropy, degrees, albedos)| {
        // The eye is in the plane of the normal and y.
        let anisotropy_rotation = (90.0 - degrees).to_radians();
        (layered(Vec3::ONE, &Layers { anisotropy, anisotropy_rotation, ..metal(roughness) }), Some(albedos))
    }));
    assert_holds("the sky", layered::furnace(&gpu, &materials, true));
}

/// In the short run `tests/engine/planted_faults.rs` has paper in half a dome.
#[test]
#[ignore = "long: kernels of their own"]
fn white_paper_is_not_seen_in_a_furnace() {
    let Some(gpu) = device() else { return };
    assert_holds("paper", layered::clear_furnace(&gpu, false));
}

/// As `SURFACE_DIELECTRIC` has it: smooth normals alone reflect totally for ever. To the eye such a ball is one of those of
/// `common::layered::clear_furnace`.
#[test]
fn coarse_layered_glass_loses_no_light() {
    let Some(gpu) = device() else { return };
    assert_holds("glass", known::coarse_sphere_in_the_sun(&gpu, layered(Vec3::ONE, &glass(0.0)), 8));
}

/// A photon of a caustic lands on a sheet with gaps, and again on what lies below it, whichever builder keeps it.
#[test]
fn caustics_are_kept_at_every_sheet_that_they_pass() {
    let Some(mut gpu) = device() else { return };
    let mut meshes = media::cuboid("pane", DVec3::new(-2.0, 2.0, -2.0), DVec3::new(2.0, 2.1, 2.0), 1);
    meshes.extend([level(0.0, [4.0, 4.0], true, 0), level(0.5, [4.0, 4.0], true, 2)]);
    let sheet = Material { coverage: Coverage::Blend { alpha: 0.25 }, ..layered::dull(0.5) };
    let scene = scene_of(meshes, vec![matt(0.5), crate::common::rendered::glass(1.5), sheet], vec![sun(DVec3::NEG_Y)]);
    let points = [0.5, 0.0].map(|y| (DVec3::new(0.3, y, 0.2), DVec3::Y));
    let result_by = |gpu: &Gpu, builder: Builder| {
        let settings = SceneSettings { builder: Some(builder), caustic_photons: 3001, part: Part::Caustic, rounds: 2, ..by_rounds() };
        received(gpu, &scene, &settings, &points)
    };
    let expected = result_by(&gpu, Builder::Persistent);
    // Of the irradiance of 1 glass lets 0.92 through, and the sheet three quarters of that.
    for (place, right) in [(0, 0.923), (1, 0.692)] {
        let found = expected.film.mean(place).x;
        assert!((found / right - 1.0).abs() < 0.3, "point {place}: {found}, {right} expected");
    }
    let naive = result_by(&gpu, Builder::Naive);
    assert_holds("the naive builder", equal_sums("light", &naive.film.sums, &expected.film.sums));
    assert_eq!(naive.fates, expected.fates);
    let one_slot = [("push.map.lands_once != 0 ? index", "push.map.caustic_only != 0 ? index")];
    gpu.replace(planted::kernels(&["trace_scene_naive"], "world/scene/bounce.glsl", &one_slot));
    let spoiled = result_by(&gpu, Builder::Naive);
    assert_complains("one slot for all landings", equal_sums("light", &spoiled.film.sums, &expected.film.sums));
}
