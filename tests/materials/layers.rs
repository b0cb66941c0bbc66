//! Layered materials: pictures against the path tracer, and the closed forms that they have.

use crate::common::prelude::*;
use photonmill::engine::scene::{self, RunResult, Target};
use photonmill::scene::material::{Coverage, Layers, Medium};
use photonmill::verify::judge::{Image, Verdict};

/// Balls over a grey floor, before a red wall, under a lamp and a dim sky.
fn stage(balls: Vec<(Material, DVec3, f64)>) -> Scene {
    let mut meshes = vec![
        level(0.0, [3.0, 3.0], true, 0),
        Mesh::parallelogram("wall", DVec3::new(-1.5, 0.0, -0.8), 3.0 * DVec3::X, 2.0 * DVec3::Y, 1),
        level(1.8, [0.7, 0.7], false, 2),
    ];
    let lamp = Material { emission: Vec3::splat(12.0), ..matt(0.0) };
    let mut materials = vec![matt(0.5), Material::lambert("red", Vec3::new(0.7, 0.2, 0.1)), lamp];
    for (material, middle, radius) in balls {
        meshes.push(Mesh::sphere("ball", middle, radius, 32, materials.len()));
        materials.push(material);
    }
    let mut scene = scene_of(meshes, materials, vec![LightKind::Environment { radiance: Vec3::splat(0.2) }]);
    scene.cameras.push(Camera::looking_at("camera", DVec3::new(0.3, 1.0, 2.2), DVec3::new(0.0, 0.4, 0.0), DVec3::Y, 0.8));
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

fn runs(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, size: [u32; 2]) -> Runs {
    let camera = scene.first_camera();
    let of = |seed: u32| {
        let settings = SceneSettings { seed: u64::from(seed), ..settings.clone() };
        scene::render(gpu, scene, &settings, Target::Picture(&camera, size)).unwrap()
    };
    let all: Vec<RunResult> = (1..=SEEDS).map(of).collect();
    let pixels = all[0].film.pixels();
    let share = 1.0 / f64::from(SEEDS);
    let means = (0..pixels).map(|place| all.iter().map(|lit| share * lit.film.mean(place)).sum()).collect();
    let squared = |place: usize| all.iter().map(|lit| lit.film.standard_error(place).powf(2.0)).sum::<DVec3>();
    let errors = (0..pixels).map(|place| share * squared(place).map(f64::sqrt)).collect();
    let parts = std::array::from_fn(|part| {
        let of_run =
            |lit: &RunResult| lit.film.part_totals[part] as f64 / (lit.plan.film.scale * f64::from(lit.film.rounds) * pixels as f64);
        let values: Vec<f64> = all.iter().map(of_run).collect();
        mean_and_error(&values)
    });
    Runs { means, errors, parts, rounds: SEEDS * settings.rounds }
}

/// Whether a picture is the path tracer's, as a whole and part by part.
fn compare(name: &str, runs: &Runs, judged: &Image) -> Result<(), String> {
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
    if text.is_empty() { Ok(()) } else { Err(format!("{name}: {text}")) }
}

fn plastic() -> Layers {
    Layers { metallic: 0.0, roughness: 0.6, ..Layers::default() }
}

fn coloured(layers: &Layers) -> Material {
    Material::layered("ball", Vec3::new(0.8, 0.5, 0.2), *layers)
}

fn balls() -> Vec<(&'static str, Material)> {
    let clear = Some(Medium::CLEAR);
    let tinted = Some(Medium { transmittance: Vec3::new(0.9, 0.3, 0.5), metres: 1.0 });
    let blend = |alpha| Coverage::Blend { alpha };
    vec![
        ("rough plastic", coloured(&plastic())),
        ("plastic", coloured(&Layers { roughness: 0.3, ..plastic() })),
        ("polished plastic", coloured(&Layers { roughness: 0.0, ..plastic() })),
        ("rough metal", coloured(&Layers { roughness: 0.7, ..Layers::default() })),
        ("metal", coloured(&Layers { roughness: 0.3, ..Layers::default() })),
        ("polished metal", coloured(&Layers { roughness: 0.0, ..Layers::default() })),
        ("half metal", coloured(&Layers { metallic: 0.5, roughness: 0.4, ..Layers::default() })),
        ("tinted reflection", coloured(&Layers { specular: 0.7, specular_colour: Vec3::new(1.0, 3.0, 0.4), ior: 2.0, ..plastic() })),
        ("coat over plastic", coloured(&Layers { coat: 0.8, coat_roughness: 0.1, ..plastic() })),
        ("rough coat over metal", coloured(&Layers { coat: 1.0, coat_roughness: 0.6, roughness: 0.4, ..Layers::default() })),
        ("sheen", coloured(&Layers { sheen_colour: Vec3::new(0.2, 0.4, 0.9), sheen_roughness: 0.5, ..plastic() })),
        ("smooth thin wall", coloured(&Layers { transmission: 1.0, roughness: 0.0, ..plastic() })),
        ("rough thin wall", coloured(&Layers { transmission: 1.0, roughness: 0.4, ..plastic() })),
        ("half a thin wall", coloured(&Layers { transmission: 0.5, roughness: 0.5, ..plastic() })),
        ("glass", coloured(&Layers { transmission: 1.0, roughness: 0.0, medium: clear, ..plastic() })),
        ("rough glass", coloured(&Layers { transmission: 1.0, roughness: 0.4, medium: clear, ..plastic() })),
        ("tinted glass", coloured(&Layers { transmission: 1.0, roughness: 0.0, medium: tinted, ..plastic() })),
        ("blended", Material { coverage: blend(0.4), ..coloured(&plastic()) }),
        ("blended metal", Material { coverage: blend(0.7), ..coloured(&Layers { roughness: 0.2, ..Layers::default() }) }),
        ("unlit", coloured(&Layers { is_unlit: true, ..plastic() })),
    ]
}

/// Each by itself: more than four minutes of two cores.
#[test]
#[ignore = "the next test has all lobes in one picture"]
fn pictures_of_each_lobe_agree_with_the_judge() {
    let Some(gpu) = device() else { return };
    let only = std::env::var("BALL").ok();
    let mut wrong = Vec::new();
    for (name, material) in balls().into_iter().filter(|(name, _)| only.as_ref().is_none_or(|only| only == name)) {
        let scene = stage(vec![(material, DVec3::new(0.0, 0.45, 0.1), 0.4)]);
        let settings = SceneSettings { photons: 10_000, caustic_photons: 10_000, rounds: 16, ..by_rounds() };
        let size = [24, 24];
        let found = runs(&gpu, &scene, &settings, size);
        let judged = Judge::new(&scene, 64).image(&scene.first_camera(), size[0], size[1], 512, 77);
        wrong.extend(compare(name, &found, &judged).err());
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Each pair of lobes, one over or beside the other.
fn pairs_of_lobes() -> Vec<Material> {
    let clear = Some(Medium::CLEAR);
    let (coat, coat_roughness) = (1.0, 0.55);
    let (sheen_colour, sheen_roughness) = (Vec3::new(0.2, 0.4, 0.9), 0.5);
    let of = [
        Layers { coat: 0.8, coat_roughness: 0.1, ..plastic() },
        Layers { coat, coat_roughness, roughness: 0.4, ..Layers::default() },
        Layers { sheen_colour, sheen_roughness, metallic: 0.5, roughness: 0.3, ..plastic() },
        Layers { sheen_colour, sheen_roughness, coat, coat_roughness, ..plastic() },
        Layers { transmission: 1.0, roughness: 0.0, sheen_colour, sheen_roughness, ..plastic() },
        Layers { transmission: 0.5, roughness: 0.5, coat: 0.6, metallic: 0.3, ..plastic() },
        Layers { transmission: 1.0, roughness: 0.4, medium: clear, coat, coat_roughness, ..plastic() },
        Layers { transmission: 0.7, roughness: 0.0, medium: clear, sheen_colour, sheen_roughness, ..plastic() },
    ];
    let blended = Material { coverage: Coverage::Blend { alpha: 0.6 }, ..coloured(&Layers { coat, roughness: 0.2, ..Layers::default() }) };
    of.into_iter().map(|layers| coloured(&layers)).chain([blended]).collect()
}

#[test]
fn a_picture_of_all_lobes_agrees_with_the_judge() {
    let Some(gpu) = device() else { return };
    // Two rows, so that they light each other.
    let place = |k: usize| {
        DVec3::new(0.42 * (k % 5) as f64 - 0.84 + 0.21 * (k / 5) as f64, 0.2 + 0.42 * (k / 5) as f64, 0.3 - 0.3 * (k / 5) as f64)
    };
    let scene = stage(pairs_of_lobes().into_iter().enumerate().map(|(k, material)| (material, place(k), 0.2)).collect());
    let settings = SceneSettings { photons: 10_000, caustic_photons: 10_000, rounds: 8, ..by_rounds() };
    let size = [32, 24];
    let found = runs(&gpu, &scene, &settings, size);
    let judged = Judge::new(&scene, 64).image(&scene.first_camera(), size[0], size[1], 256, 77);
    assert_holds("a picture", compare("all lobes", &found, &judged));
    // The check can fail.
    let mut bare = scene.clone();
    bare.materials.iter_mut().for_each(|Material { layers, .. }| *layers = Layers { coat: 0.0, sheen_colour: Vec3::ZERO, ..*layers });
    let judged = Judge::new(&bare, 64).image(&scene.first_camera(), size[0], size[1], 256, 77);
    assert_complains("balls without coat and sheen", compare("fault", &found, &judged));
}
