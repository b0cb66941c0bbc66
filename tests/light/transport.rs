//! Lighting scenes of triangles: bits that no split, builder or unused effect may change, parts that add
//! up, radiometry, leaks, and plans that the device's work is counted against.

use std::collections::HashMap;

use crate::common::known;
use crate::common::lit::{light, run};
use crate::common::pairwise::pairwise;
use crate::common::prelude::*;
use photonmill::constants::GATHER_SLICE;
use photonmill::engine::scene::{self, RunResult, View};
use photonmill::scene::material::{Coverage, Layers, Medium, NormalMap};
use photonmill::settings::scene::Kernel;
use photonmill::verify::judge::Verdict;

const SIZE: u32 = 24;

fn small() -> SceneSettings {
    SceneSettings { photons: 3000, caustic_photons: 3000, rounds: 3, shadow_rays: 2, ..by_rounds() }
}

pub fn picture(gpu: &Gpu, scene: &Scene, settings: &SceneSettings) -> RunResult {
    let (geometry, plan) = scene_plan(gpu, scene, settings, square_picture(SIZE)).unwrap();
    light(gpu, &View { geometry: &geometry, camera: Some(&scene.first_camera()), phases: &[] }, plan)
}

/// Mean and standard error of the irradiance at points, W/m2.
fn irradiance(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, points: &[(DVec3, DVec3)]) -> Vec<(DVec3, DVec3)> {
    let lit = received(gpu, scene, settings, points);
    pairs(means(&lit), standard_errors(&lit)).collect()
}

fn same_film(what: &str, found: &RunResult, expected: &RunResult) -> Check<Complaint> {
    same_sums(what, &found.film.sums, &expected.film.sums)?;
    if found.film == expected.film { Ok(()) } else { Err(Complaint::new(Kind::OtherSums, format!("{what}: squares of sums differ"))) }
}

/// Lists of survivors in any order give the same picture. What a list without a survivor shows may be odd in any way.
pub fn appends_agree(gpu: &Gpu, scene: &Scene, settings: &SceneSettings) -> Check<Complaint> {
    let camera = scene.first_camera();
    let of = |builder| {
        let settings = SceneSettings { builder: Some(builder), ..settings.clone() };
        let (geometry, plan) = scene_plan(gpu, scene, &settings, square_picture(SIZE)).unwrap();
        run(gpu, &View { geometry: &geometry, camera: Some(&camera), phases: &[] }, plan)
    };
    let ballot = of(Builder::Ballot);
    let mut others = Builder::ON_GPU.into_iter().filter(|builder| *builder != Builder::Ballot);
    others.try_for_each(|builder| same_film(builder.name(), &of(builder), &ballot))
}

#[test]
fn no_split_and_no_builder_changes_a_bit() {
    let Some(gpu) = device() else { return };
    let scene = scene("cornell-spheres");
    let usual = || SceneSettings { samples: 2, ..small() };
    let reference = picture(&gpu, &scene, &usual());
    let builders = [
        ("ballot builder", SceneSettings { builder: Some(Builder::Ballot), ..usual() }),
        ("chunks of 701", SceneSettings { chunk: Some(701), ..usual() }),
        ("work groups of 32", SceneSettings { group_size: 32, ..usual() }),
    ];
    for (what, settings) in builders {
        assert_holds(what, same_film(what, &picture(&gpu, &scene, &settings), &reference));
    }
    assert_holds("all builders", appends_agree(&gpu, &scene, &usual()));
    assert_holds("again", same_film("again", &picture(&gpu, &scene, &usual()), &reference));
    let other = picture(&gpu, &scene, &SceneSettings { seed: 2, ..usual() });
    assert_complains("another seed", same_film("another seed", &other, &reference));
    drop(gpu);

    let Some(gpu) = device_with(Options { without_int64_atomics: true, ..Options::default() }) else { return };
    assert_holds("two words", same_film("two words", &picture(&gpu, &scene, &usual()), &reference));
}

#[test]
fn crowded_points_miss_no_photon() {
    let Some(gpu) = device() else { return };
    assert_holds("crowded points", crowd_check(&gpu));
}

/// Points near which more photons lie than an invocation tests: others share them, as small chunks do.
pub fn crowd_check(gpu: &Gpu) -> Check<Complaint> {
    let scene = scene("cornell");
    let crowded = SceneSettings { photons: 20_000, radius: Some(1.0), rounds: 1, ..small() };
    let few = SceneSettings { chunk: Some(700), ..crowded.clone() };
    let [whole, parts] = [&crowded, &few].map(|settings| picture(gpu, &scene, settings));
    // Few enough photons in a chunk that no point has more candidates than one slice.
    let stored = whole.fates[0].ledger().stored;
    assert!(stored > 3 * u64::from(GATHER_SLICE) && 2 * stored * 700 / 20_000 < u64::from(GATHER_SLICE), "{stored} stored");
    same_film("crowded points", &whole, &parts)
}

/// Cameras and lookups take pixels in tiles, which no picture need be a multiple of.
#[test]
fn every_pixel_is_lit_whatever_the_size_of_the_picture() {
    let Some(gpu) = device() else { return };
    let scene = scene("furnace");
    for (width, height) in [(1, 1), (3, 2), (8, 4), (13, 7), (21, 9)] {
        let lit = seen(&gpu, &scene, &small(), &scene.first_camera(), [width, height]);
        let pixels: Vec<u64> = lit.film.sums.chunks(3).map(|sums| sums[0]).collect();
        let mean = pixels.iter().sum::<u64>() as f64 / pixels.len() as f64;
        for (pixel, sum) in pixels.iter().enumerate() {
            let share = *sum as f64 / mean;
            assert!((0.4..1.6).contains(&share), "{width} x {height}: pixel {pixel} has {share} of the mean");
        }
    }
}

/// Where walls only shine, all pixels are the same to the bit: none is left out, and none is taken twice.
#[test]
fn every_pixel_of_walls_that_shine_is_the_same() {
    let Some(gpu) = device() else { return };
    let mut room = scene("furnace");
    for material in &mut room.materials {
        material.base_colour = Vec3::ZERO;
        material.emission = Vec3::ONE;
    }
    for (width, height) in [(1, 1), (13, 7), (64, 64), (67, 9), (5, 67), (131, 70)] {
        let sums = seen(&gpu, &room, &small(), &room.first_camera(), [width, height]).film.of_blocks.sums;
        assert_eq!(sums.len() as u32, 3 * width * height);
        assert!(sums[0] > 0 && sums.iter().all(|sum| *sum == sums[0]), "{width} x {height}");
    }
}

/// More photons than a dispatch flies to their end on a software device.
#[test]
fn persistent_photons_are_the_same_in_several_dispatches() {
    let Some(gpu) = device() else { return };
    let scene = scene("cornell");
    let of = |builder| picture(&gpu, &scene, &SceneSettings { builder: Some(builder), photons: 70_001, rounds: 1, ..small() });
    let what = "70 001 photons";
    assert_holds(what, same_film(what, &of(Builder::Persistent), &of(Builder::Ballot)));
}

/// With the paper's way too, where one map holds everything, and with a final gather.
#[test]
fn the_four_parts_add_up_to_the_whole_to_the_bit() {
    let Some(gpu) = device() else { return };
    let scene = scene("cornell-spheres");
    for settings in [
        small(),
        SceneSettings { samples: 4, ..small() },
        SceneSettings { samples: 4, final_gather: true, ..small() },
        SceneSettings { illumination: Illumination::Photons, ..small() },
    ] {
        let whole = picture(&gpu, &scene, &settings);
        let apart = picture(&gpu, &scene, &SceneSettings { keeps_parts: true, ..settings.clone() });
        assert!(apart.film == whole.film && whole.film.parts.is_none(), "parts change the whole");
        let parts: Vec<RunResult> = Part::EACH.map(|part| picture(&gpu, &scene, &SceneSettings { part, ..settings.clone() })).into();
        for (sum, place) in whole.film.sums.iter().zip(0..) {
            let of_parts: u64 = parts.iter().map(|part| part.film.sums[place]).sum();
            assert_eq!(*sum, of_parts, "sum {place}, {:?}", settings.illumination);
        }
        for (number, part) in parts.iter().enumerate() {
            assert!(part.film.sums.iter().any(|sum| *sum > 0), "part {number} is dark");
            let own: u64 = part.film.part_totals.iter().sum();
            assert_eq!(own, whole.film.part_totals[number], "total of part {number}");
            let pixels = 0..whole.film.pixels();
            let kept: Vec<u64> = pixels.flat_map(|pixel| apart.film.sum_of_part(number, pixel).unwrap()).collect();
            assert!(kept == part.film.sums, "part {number} of {:?} is not what it is alone", settings.illumination);
        }
    }
}

/// Effects that a scene does not need change nothing where they are forced on: all of them at once, or each with and without each
/// other.
fn unneeded_effects_change_no_bit(gpu: &Gpu, name: &str, each: bool) {
    let scene = scene(name);
    let reference = picture(gpu, &scene, &small());
    let unneeded: Vec<Effect> =
        reference.plan.decisions.iter().filter(|decision| !decision.needed).map(|decision| decision.effect).collect();
    assert!(unneeded.len() > 5, "{name}: {unneeded:?}");
    let rows = if each { pairwise(&vec![2; unneeded.len()]) } else { vec![vec![1; unneeded.len()]] };
    for row in rows {
        let with: Vec<Effect> = unneeded.iter().zip(row).filter(|(_, forced)| *forced == 1).map(|(effect, _)| *effect).collect();
        let forced = picture(gpu, &scene, &SceneSettings { with: with.clone(), ..small() });
        assert!(with.iter().all(|effect| forced.plan.keeps(*effect)), "{with:?}");
        assert_holds(format!("{with:?}"), same_film(&format!("{name} with {with:?}"), &forced, &reference));
    }
    // A list instead of a tree finds the same.
    if name == "cornell" {
        let list = picture(gpu, &scene, &SceneSettings { without: vec![Effect::Bvh], ..small() });
        assert_holds("list", same_film("list", &list, &reference));
    }
}

/// Each combination has kernels of its own, and making them is what takes time.
#[test]
fn an_effect_that_the_scene_lacks_changes_no_bit() {
    let Some(gpu) = device() else { return };
    for name in ["cornell", "cornell-spheres"] {
        unneeded_effects_change_no_bit(&gpu, name, false);
    }
}

#[test]
#[ignore = "minutes on a software device"]
fn pairs_of_effects_that_the_scene_lacks_change_no_bit() {
    let Some(gpu) = device() else { return };
    for name in ["cornell", "cornell-spheres"] {
        unneeded_effects_change_no_bit(&gpu, name, true);
    }
}

/// A scene in which every effect shows but those of layered materials.
fn rich_scene() -> Scene {
    let mut scene = scene("cornell-spheres");
    scene.materials[0].surface = Surface::Glossy { exponent: 20.0 };
    scene.materials[1].two_sided = true;
    scene.materials.push(Material {
        base_colour_texture: Some(TextureUse::of(0, 0)),
        two_sided: true,
        ..Material::lambert("tiles", Vec3::ONE)
    });
    let texels = vec![Vec3::splat(0.9), Vec3::splat(0.05), Vec3::splat(0.05), Vec3::splat(0.9)];
    let wrap = [Wrap::Repeat; 2];
    scene.textures.push(Texture { name: "tiles".into(), width: 2, height: 2, texels: texels.into(), wrap, filter: Default::default() });
    let tiles = scene.materials.len() - 1;
    scene.meshes[2].material = tiles;
    scene.meshes[3].colours = [0.0, 0.3, 0.6, 0.1].map(DVec3::splat).to_vec();
    // Coarse enough for its smooth normals to matter.
    let mirror = scene.meshes.iter_mut().find(|mesh| mesh.name == "mirror sphere").unwrap();
    *mirror = Mesh::sphere("mirror sphere", DVec3::new(0.3, 0.19, 0.34), 0.18, 10, mirror.material);
    // Turned away from the camera: only its second side is seen.
    scene.meshes.push(Mesh::parallelogram("screen", DVec3::new(0.4, 0.5, 0.6), DVec3::Y * 0.3, DVec3::X * 0.3, tiles));
    scene.lights = every_kind_of_light(1.0, 2.0, EmissionLaw::Cosine);
    scene
}

/// Plates before the camera in a box, each with something that no other has.
fn layered_scene() -> Scene {
    let mut scene = scene("cornell");
    let plastic = Layers { metallic: 0.0, roughness: 0.7, ..Layers::default() };
    let bump = Texels::Linear(vec![[230, 128, 190, 255]]);
    scene.textures.push(Texture {
        name: "bump".into(),
        width: 1,
        height: 1,
        texels: bump,
        wrap: [Wrap::Repeat; 2],
        filter: Default::default(),
    });
    let map = NormalMap { texture: TextureUse::of(scene.textures.len() - 1, 0), scale: 1.0 };
    let glass = Layers {
        roughness: 0.0,
        transmission: 1.0,
        ior: 1.0,
        medium: Some(Medium { transmittance: Vec3::splat(1e-3), metres: 1.0 }),
        ..plastic
    };
    let grey = |layers| Material::layered("plate", Vec3::splat(0.6), layers);
    let materials = [
        // Over black: what coat and sheen reflect is about what they take from a surface under them.
        Material::layered("plate", Vec3::ZERO, Layers { coat: 1.0, coat_roughness: 0.6, specular: 0.0, ..plastic }),
        Material::layered("plate", Vec3::ZERO, Layers { sheen_colour: Vec3::ONE, sheen_roughness: 0.6, specular: 0.0, ..plastic }),
        Material { coverage: Coverage::Blend { alpha: 0.3 }, ..grey(plastic) },
        Material { normal_map: Some(map), ..grey(plastic) },
        grey(glass),
        grey(Layers { diffuse_transmission: 1.0, specular: 0.0, ..plastic }),
        Material::layered("plate", Vec3::ZERO, Layers { iridescence: 1.0, film_ior: 2.0, film_thickness: [0.0, 300.0], ..plastic }),
        Material::layered("plate", Vec3::ONE, Layers { metallic: 1.0, anisotropy: 1.0, ..plastic }),
        grey(Layers { ior: 1.5, dispersion: 20.0, medium: Some(Medium::CLEAR), ..glass }),
    ];
    for (place, material) in materials.into_iter().enumerate() {
        // A large wedge, where colours part.
        let is_wedge = material.layers.dispersion > 0.0;
        let (size, tilt) = if is_wedge { (0.42, DVec3::Z * 0.15) } else { (0.15, DVec3::ZERO) };
        let y = if is_wedge { 0.2 } else { 0.7 - 0.2 * (place / 5) as f64 };
        let corner = DVec3::new(0.08 + 0.17 * (place % 5) as f64, y, 0.6);
        let number = scene.materials.len();
        let plate = Mesh::parallelogram("plate", corner, DVec3::X * size, DVec3::Y * size, number);
        let behind = Mesh::parallelogram("plate", corner - DVec3::Z * 0.3, DVec3::Y * size, DVec3::X * size + tilt, number);
        let tangents = vec![[DVec4::new(1.0, 0.0, 0.0, 1.0); 3]; 2];
        scene.meshes.push(Mesh { tangents: if material.tangent_coordinates().is_some() { tangents } else { Vec::new() }, ..plate });
        // The back of the slab.
        scene.meshes.extend(material.enclosed_medium().map(|_| behind));
        scene.materials.push(material);
    }
    scene
}

/// The part of a picture in which an effect shows by itself. A part needs fewer kernels than all light, and the same error has less
/// light to hide in.
fn part_that_shows(effect: Effect) -> Part {
    match effect {
        Effect::ReflectiveCaustics | Effect::RefractiveCaustics => Part::Caustic,
        // The sky is not seen from the camera but in the mirror.
        Effect::SpecularChains
        | Effect::SmoothNormals
        | Effect::Environment
        | Effect::Transmission
        | Effect::Media
        | Effect::Dispersion => Part::Specular,
        Effect::Indirect => Part::Indirect,
        _ => Part::Direct,
    }
}

/// Each way to leave out an effect has kernels of its own: scenes with all of them would make these large.
#[test]
fn an_effect_that_the_scene_needs_is_missed_when_it_is_left_out() {
    let Some(gpu) = device() else { return };
    let (of_layers, others): (Vec<Effect>, Vec<Effect>) = Effect::ALL.into_iter().partition(|effect| OF_LAYERS.contains(effect));
    effects_are_missed(&gpu, &rich_scene(), &others);
    effects_are_missed(&gpu, &layered_scene(), &of_layers);
}

const OF_LAYERS: [Effect; 11] = [
    Effect::Layers,
    Effect::Transmission,
    Effect::DiffuseTransmission,
    Effect::Iridescence,
    Effect::Anisotropy,
    Effect::Media,
    Effect::Dispersion,
    Effect::ClearCoat,
    Effect::Sheen,
    Effect::NormalMaps,
    Effect::Alpha,
];

fn effects_are_missed(gpu: &Gpu, scene: &Scene, effects: &[Effect]) {
    let settings = SceneSettings { rounds: 12, ..small() };
    let (_, whole) = scene_plan(gpu, scene, &settings, square_picture(SIZE)).unwrap();
    // Direct light flies no photons, so that rounds of it are cheap, and a spot lights few pixels.
    let of = |part| SceneSettings { part, rounds: if part == Part::Direct { 96 } else { 12 }, ..settings.clone() };
    let mut references = HashMap::new();
    for &effect in effects {
        let decision = whole.decisions.iter().find(|decision| decision.effect == effect).unwrap();
        assert!(decision.needed && decision.kept, "{}: {}", effect.name(), decision.evidence);
        if effect == Effect::Bvh {
            // So many triangles cannot be a list; of few the bits are the same, as the test above shows.
            let settings = SceneSettings { without: vec![effect], ..settings.clone() };
            assert!(scene_plan(gpu, scene, &settings, whole.sensor).unwrap_err().to_string().starts_with("--without bvh"));
            continue;
        }
        let part = part_that_shows(effect);
        let reference = references.entry(part as u32).or_insert_with(|| picture(gpu, scene, &of(part)));
        let without = picture(gpu, scene, &SceneSettings { without: vec![effect], ..of(part) });
        assert_eq!(without.plan.missing(), [effect]);
        // Somewhere, or over the whole picture, the two differ by more than their errors.
        let (mut worst, mut sum, mut variance) = (0.0f64, 0.0, 0.0);
        for pixel in 0..reference.film.pixels() {
            let difference = reference.film.mean(pixel) - without.film.mean(pixel);
            let error = reference.film.standard_error(pixel) + without.film.standard_error(pixel);
            worst = worst.max((difference.abs() / error.max(DVec3::splat(1e-9))).max_element());
            sum += difference.element_sum();
            variance += error.length_squared();
        }
        let whole = sum.abs() / variance.sqrt();
        println!("without {}: {worst:.2} and {whole:.2} errors apart", effect.name());
        assert!(worst > 3.0 || whole > 3.0, "without {}: {worst:.2} and {whole:.2} errors apart", effect.name());
    }
}

/// Passes, buffers and pipelines are those of the plan.
#[test]
fn what_is_dropped_is_not_there() {
    let Some(gpu) = counting_device() else { return };
    let cornell = scene("cornell");
    // So few bounces are one segment, whatever the device.
    let small = || SceneSettings { bounces: 8, ..small() };
    let all = picture(&gpu, &cornell, &SceneSettings { with: vec![Effect::RefractiveCaustics], ..small() });
    let needed = picture(&gpu, &cornell, &small());
    let direct = picture(&gpu, &cornell, &SceneSettings { part: Part::Direct, ..small() });
    let count = |lit: &RunResult, pass: &str| lit.timings.row(pass).map_or(0, |row| row.count);
    for (lit, global, caustic) in [(&all, 3, 3), (&needed, 3, 0), (&direct, 0, 0)] {
        assert_eq!(count(lit, "round/global"), global);
        assert_eq!(count(lit, "round/caustic"), caustic);
        assert_eq!(count(lit, "round/visible points"), 3);
    }
    // Two dispatches a round to see and resolve, one to weigh what maps hold and one to end a block of what tells their bias; a map has one to shine, flights with their
    // sizes, the index and the lookup.
    assert_eq!(direct.dispatches, 2 * 3);
    let map = (needed.dispatches - direct.dispatches) / 3 - 2;
    assert_eq!((all.dispatches - needed.dispatches) / 3, map);
    // Both maps of a round use the same buffers in turn, so that the second takes nothing.
    assert!(needed.plan.bytes <= all.plan.bytes && direct.plan.bytes < needed.plan.bytes);
    // Of pipelines only those of the plan, each made once.
    let fresh = fresh_device().unwrap();
    let before = fresh.pipeline_count();
    let lit = picture(&fresh, &cornell, &SceneSettings { part: Part::Direct, ..small() });
    assert_eq!(lit.pipelines, scene::modules(&lit.plan, fresh.facts()).len());
    assert_eq!(fresh.pipeline_count() - before, lit.pipelines);
    assert_eq!(lit.pipelines, 2);
}

/// Scaled and moved by powers of two, and seen by a camera that goes with it, a scene is the same picture.
#[test]
fn scaling_by_a_power_of_two_changes_no_bit() {
    let Some(gpu) = device() else { return };
    let reference = picture(&gpu, &scene("cornell-spheres"), &small());
    for k in [-20, 13] {
        let factor = 2f64.powi(k);
        let mut scaled = scene("cornell-spheres");
        scaled.meshes.iter_mut().flat_map(|mesh| &mut mesh.positions).for_each(|position| *position *= factor);
        scaled.cameras.iter_mut().for_each(|camera| camera.eye *= factor);
        let found = picture(&gpu, &scaled, &small());
        assert_holds(k, same_film(&format!("scaled by 2^{k}"), &found, &reference));
    }
}

#[test]
fn no_number_of_samples_changes_the_light() {
    let Some(gpu) = device() else { return };
    for (samples, final_gather) in [(1, false), (4, false), (16, false), (4, true)] {
        assert_holds("a furnace with glass", known::glass_in_a_furnace(&gpu, samples, final_gather));
    }
}

/// Samples of a pixel are strata of it, of the lamps and of what glass mirrors: noise falls faster than by their number.
#[test]
fn samples_of_a_pixel_leave_little_noise() {
    let Some(gpu) = device() else { return };
    let error = |samples, shadow_rays, rounds| {
        let settings = SceneSettings { part: Part::Direct, samples, shadow_rays, rounds, ..small() };
        let lit = picture(&gpu, &scene("cornell"), &settings);
        lit.film.relative_error()
    };
    let (by_chance, even) = (error(1, 1, 64), error(16, 1, 4));
    println!("64 paths a pixel: {:.2} % of error by rounds, {:.2} % by samples", 100.0 * by_chance, 100.0 * even);
    assert!(2.0 * even < by_chance, "{even} and {by_chance}");
}

#[test]
fn a_furnace_is_equally_bright_everywhere() {
    let Some(gpu) = device() else { return };
    let points = [
        (DVec3::new(0.5, 0.0, 0.5), DVec3::Y),
        (DVec3::new(0.002, 0.0, 0.5), DVec3::Y),
        (DVec3::new(0.001, 0.0, 0.002), DVec3::Y),
        (DVec3::new(0.0, 0.37, 0.998), DVec3::X),
        (DVec3::new(0.31, 0.44, 0.52), DVec3::new(0.6, 0.0, 0.8)),
    ];
    let settings = SceneSettings { rounds: 40, photons: 20_000, bounces: 200, ..by_rounds() };
    for kernel in [Kernel::Box, Kernel::Cone, Kernel::Epanechnikov] {
        for illumination in [Illumination::Split, Illumination::Photons] {
            let settings = SceneSettings { kernel, illumination, ..settings.clone() };
            let exact = PI / (1.0 - 0.5);
            let found = irradiance(&gpu, &scene("furnace"), &settings, &points);
            for ((point, _), (mean, error)) in pairs(&points, &found) {
                let what = format!("{kernel:?}, {illumination:?}, {point}");
                assert!(error.x < 0.1 * exact, "{what}: error {error}");
                assert_holds(&what, z_check("irradiance", mean.x, exact, error.x));
            }
        }
    }
    let uncorrected = SceneSettings { edge_correction: false, illumination: Illumination::Photons, ..settings };
    let edge = irradiance(&gpu, &scene("furnace"), &uncorrected, &points)[1];
    assert_complains("an edge without correction", z_check("edge", edge.0.x, PI / 0.5, edge.1.x));
}

/// L = rho E / pi on one wall, by camera and by receiver.
#[test]
fn radiance_and_irradiance_of_a_wall_agree() {
    let Some(gpu) = device() else { return };
    let mut scene = scene("cornell");
    let albedo = scene.materials[0].base_colour.as_dvec3();
    // One pixel that looks at a small patch of the back wall.
    let target = DVec3::new(0.8, 0.75, 0.0);
    scene.cameras = vec![Camera::looking_at("patch", DVec3::new(0.6, 0.5, 2.0), target, DVec3::Y, 0.002)];
    let settings = SceneSettings { rounds: 60, photons: 4000, shadow_rays: 8, ..by_rounds() };
    for final_gather in [false, true] {
        let settings = SceneSettings { final_gather, ..settings.clone() };
        let lit = seen(&gpu, &scene, &settings, &scene.cameras[0], [1, 1]);
        let (radiance, radiance_error) = (lit.film.mean(0), lit.film.standard_error(0));
        let other = SceneSettings { seed: 9, ..settings };
        let (irradiance, irradiance_error) = irradiance(&gpu, &scene, &other, &[(target, DVec3::Z)])[0];
        for channel in 0..3 {
            let share = albedo[channel] / PI;
            let error = radiance_error[channel].hypot(share * irradiance_error[channel]);
            assert!(error < 0.08 * radiance[channel], "error {error} of {radiance}");
            let what = format!("channel {channel}, final gather {final_gather}");
            assert_holds(&what, z_check(&what, radiance[channel], share * irradiance[channel], error));
            let doubled = z_check(&what, radiance[channel], 2.0 * share * irradiance[channel], error);
            assert_complains("twice the irradiance", doubled);
        }
    }
}

/// A dark room beside a lit one, a thin wall of two sides between: no light comes through, whatever the
/// radius.
#[test]
fn no_light_leaks_through_thin_walls() {
    let Some(gpu) = device() else { return };
    let mut scene = scene("furnace");
    scene.materials = vec![matt(0.7), Material { emission: Vec3::splat(10.0), ..matt(0.5) }];
    let (y, z) = (DVec3::Y, DVec3::Z);
    // The wall is a fiftieth of the radius thick and faces both rooms.
    scene.meshes.push(Mesh::parallelogram("thin, lit side", DVec3::X * 0.5, z, y, 0));
    scene.meshes.push(Mesh::parallelogram("thin, dark side", DVec3::X * 0.502, y, z, 0));
    scene.meshes.push(Mesh::parallelogram("lamp", DVec3::new(0.1, 0.9, 0.3), DVec3::X * 0.2, z * 0.2, 1));
    let settings = SceneSettings { radius: Some(0.1), photons: 20_000, rounds: 6, ..by_rounds() };
    let lit_side = (DVec3::new(0.5, 0.5, 0.5), DVec3::NEG_X);
    let dark = [
        (DVec3::new(0.502, 0.5, 0.5), DVec3::X),
        (DVec3::new(0.51, 0.0, 0.5), DVec3::Y),
        (DVec3::new(0.75, 0.0, 0.5), DVec3::Y),
        (DVec3::new(1.0, 0.5, 0.5), DVec3::NEG_X),
    ];
    let points: Vec<_> = std::iter::once(lit_side).chain(dark).collect();
    let found = irradiance(&gpu, &scene, &settings, &points);
    assert!(found[0].0.x > 0.1, "the lit side has {}", found[0].0);
    for ((point, _), (mean, _)) in pairs(&points, &found).skip(1) {
        assert_eq!(*mean, DVec3::ZERO, "{point}");
    }
}

#[test]
fn no_light_leaks_from_one_shelf_to_the_next() {
    let Some(gpu) = device() else { return };
    assert_holds("the shelf", known::shelf(&gpu));
}

/// The radii of Knaus and Zwicker's schedule, and their mean over a million passes where it is known.
#[test]
fn radii_shrink_as_published() {
    let settings = SceneSettings { radius: Some(0.25), ..small() };
    let planned = |settings: &SceneSettings| scene_plan_within(&Limits::of_host(), &scene("cornell"), settings, square_picture(4)).unwrap();
    let plan = planned(&settings);
    let map = plan.global.as_ref().unwrap();
    let mut squared = map.radius * map.radius;
    for round in 0..40 {
        let found = plan.radius(map, round);
        assert!((found * found / squared - 1.0).abs() < 1e-9, "round {round}");
        let i = f64::from(round + 1);
        squared *= (i + 2.0 / 3.0) / (i + 1.0);
    }
    assert_eq!(planned(&SceneSettings { alpha: 1.0, ..settings }).radius(map, 39), map.radius);
}

#[test]
fn a_scene_without_light_is_black_and_costs_no_photon() {
    let Some(gpu) = device() else { return };
    let mut scene = scene("cornell");
    scene.materials.iter_mut().for_each(|material| material.emission = Vec3::ZERO);
    let lit = picture(&gpu, &scene, &small());
    assert!(lit.film.sums.iter().all(|sum| *sum == 0));
    assert_eq!(lit.plan.maps().count(), 0);
    assert_eq!(lit.fates[0].emitted, 0);
}

/// The stated error is that of many runs: the spread of means over seeds, pixel by pixel.
#[test]
fn stated_errors_are_the_spread_over_seeds() {
    let Some(gpu) = device() else { return };
    let scene = scene("cornell");
    let runs: Vec<RunResult> = (0..120).map(|seed| picture(&gpu, &scene, &SceneSettings { seed, rounds: 8, ..small() })).collect();
    let pixels = runs[0].film.pixels();
    let (mut stated, mut spread) = (0.0, 0.0);
    for pixel in 0..pixels {
        let means: Vec<DVec3> = runs.iter().map(|lit| lit.film.mean(pixel)).collect();
        let mean = means.iter().sum::<DVec3>() / means.len() as f64;
        spread += means.iter().map(|value| (*value - mean).length_squared()).sum::<f64>() / (means.len() - 1) as f64;
        stated += runs.iter().map(|lit| lit.film.standard_error(pixel).length_squared()).sum::<f64>() / runs.len() as f64;
    }
    let ratio = (stated / spread).sqrt();
    assert!((0.9..1.1).contains(&ratio), "stated errors are {ratio} of the spread");
}

/// Pictures against the path tracer, within what both state.
#[test]
fn pictures_agree_with_the_judge() {
    let Some(gpu) = device() else { return };
    for (name, photons, rounds, samples) in [
        ("cornell", 5000, 48, 192),
        ("open-box-phong", 5000, 48, 192),
        // Paths from the eye seldom find caustics, and of few samples do not know how seldom.
        ("cornell-spheres", 10_000, 64, 1536),
        ("caustic-sphere", 20_000, 64, 768),
    ] {
        let scene = scene(name);
        let settings = SceneSettings { photons, caustic_photons: photons, rounds, ..by_rounds() };
        let lit = picture(&gpu, &scene, &settings);
        let judged = Judge::new(&scene, settings.bounces).image(&scene.first_camera(), SIZE, SIZE, samples, 77);
        let (means, errors) = (means(&lit), standard_errors(&lit));
        let verdict = Verdict::new(&means, &errors, rounds, &judged, None);
        assert!(verdict.agrees(), "{name}: {verdict}");
        let brighter: Vec<DVec3> = means.iter().map(|mean| 1.3 * *mean).collect();
        assert!(!Verdict::new(&brighter, &errors, rounds, &judged, None).agrees(), "{name}, a third brighter, is not noticed");
    }
}
