//! Lighting scenes of triangles: bits that no split, builder or unused effect may change, parts that add
//! up, effects that are missed, and plans that the device's work is counted against.

use crate::common::layered::{self, map_of, row_of_texels};
use crate::common::pairwise::pairwise;
use crate::common::prelude::*;
use crate::common::rendered::{Viewed, light};
use photonmill::constants::GATHER_SLICE;
use photonmill::engine::scene::{self, Receivers, RunResult, Viewpoint};
use photonmill::scene::Projection;
use photonmill::scene::material::{Coverage, Layers, Medium};
use photonmill::scene::texture::Filter;
use photonmill::verify::judge::Verdict;
use photonmill::verify::selfcheck::Estimate;

const SIZE: u32 = 24;

fn small() -> SceneSettings {
    SceneSettings { photons: 3000, caustic_photons: 3000, rounds: 3, shadow_rays: 2, ..by_rounds() }
}

fn picture(gpu: &Gpu, scene: &Scene, settings: &SceneSettings) -> RunResult {
    result_of(gpu, scene, settings, Receivers::Image(&scene.first_camera(), [SIZE; 2]))
}

/// A run of a scene without what the settings leave out.
fn result_of(gpu: &Gpu, scene: &Scene, settings: &SceneSettings, receivers: Receivers) -> RunResult {
    let (geometry, plan) = scene_plan(gpu, scene, settings, receivers.sensor()).unwrap();
    light(gpu, &Viewpoint { geometry: &geometry, camera: receivers.camera(), phases: &receivers.phases(&geometry) }, plan)
}

fn same_film(what: &str, found: &RunResult, expected: &RunResult) -> Check<Complaint> {
    same_sums(what, &found.film.sums, &expected.film.sums)?;
    if found.film == expected.film { Ok(()) } else { Err(Complaint::new(Kind::OtherSums, format!("{what}: squares of sums differ"))) }
}

/// Lists of survivors in any order give the same picture. What a list without a survivor shows may be odd in any way.
pub fn appends_agree(gpu: &Gpu, scene: &Scene, settings: &SceneSettings) -> Check<Complaint> {
    let viewed = Viewed::new(scene.clone());
    let of = |builder| {
        let settings = SceneSettings { builder: Some(builder), ..settings.clone() };
        viewed.run(gpu, viewed.planned(gpu, &settings, square_picture(SIZE)))
    };
    let ballot = of(Builder::Ballot);
    let mut others = Builder::ON_GPU.into_iter().filter(|builder| *builder != Builder::Ballot);
    others.try_for_each(|builder| same_film(builder.name(), &of(builder), &ballot))
}

fn sampled() -> SceneSettings {
    SceneSettings { samples: 2, ..small() }
}

/// Nor does a scale by a power of two, for a camera that goes with it.
#[test]
fn no_split_and_no_builder_changes_a_bit() {
    let Some(gpu) = device() else { return };
    let chunks = SceneSettings { chunk: Some(701), ..sampled() };
    let ballot = SceneSettings { builder: Some(Builder::Ballot), ..sampled() };
    let groups = SceneSettings { group_size: 32, ..sampled() };
    let ways = [("again", sampled()), ("chunks of 701", chunks), ("ballot builder", ballot), ("work groups of 32", groups)];
    let spheres = scene("cornell-spheres");
    let reference = picture(&gpu, &spheres, &sampled());
    for (what, settings) in &ways[..of_run(2, 4)] {
        assert_holds(what, same_film(what, &picture(&gpu, &spheres, settings), &reference));
    }
    let mut scaled = moved(spheres.clone(), |at| at * 2f64.powi(-20));
    scaled.cameras[0].eye *= 2f64.powi(-20);
    assert_holds("scaled", same_film("scaled by 2^-20", &picture(&gpu, &scaled, &sampled()), &reference));
    let other = picture(&gpu, &spheres, &SceneSettings { seed: 2, ..sampled() });
    assert_complains("another seed", same_film("another seed", &other, &reference));

    // A device without 64-bit atomics makes its kernels anew, as do another builder and other work groups: those of a map alone will do,
    // all at once.
    let (room, of_map) = (scene("furnace"), SceneSettings { illumination: Illumination::Photons, ..sampled() });
    let reference = picture(&gpu, &room, &of_map);
    drop(gpu);
    let Some(gpu) = device_with(Options { without_int64_atomics: true, ..Options::default() }) else { return };
    let otherwise = SceneSettings { builder: Some(Builder::Ballot), group_size: 32, ..of_map };
    let what = "two words, ballot builder, work groups of 32";
    assert_holds(what, same_film(what, &picture(&gpu, &room, &otherwise), &reference));
}

/// Points near which more photons lie than an invocation tests: others share them, as small chunks do.
pub fn dense_points_check(gpu: &Gpu) -> Check<Complaint> {
    let scene = scene("cornell");
    let dense = SceneSettings { photons: 20_000, radius: Some(1.0), rounds: 1, ..small() };
    let few = SceneSettings { chunk: Some(700), ..dense.clone() };
    let [whole, parts] = [&dense, &few].map(|settings| picture(gpu, &scene, settings));
    // Few enough photons in a chunk that no point has more candidates than one slice.
    let stored = whole.fates[0].ledger().stored;
    assert!(stored > 3 * u64::from(GATHER_SLICE) && 2 * stored * 700 / 20_000 < u64::from(GATHER_SLICE), "{stored} stored");
    same_film("dense points", &whole, &parts)
}

/// Cameras and lookups take pixels in tiles, which no picture need be a multiple of. Where walls only emit, all pixels are the same to
/// the bit: none is left out, and none is taken twice.
#[test]
fn every_pixel_is_lit_whatever_the_size_of_the_picture() {
    let Some(gpu) = device() else { return };
    let furnace = scene("furnace");
    let mut emitting_room = furnace.clone();
    emitting_room.materials.iter_mut().for_each(|material| *material = emissive(0.0));
    let (similar, same) = (0.4..1.6, 1.0 - 1e-12..1.0 + 1e-12);
    for (room, size, range) in [
        (&furnace, [1, 1], &similar),
        (&furnace, [13, 7], &similar),
        (&furnace, [21, 9], &similar),
        (&emitting_room, [13, 7], &same),
        (&emitting_room, [64, 64], &same),
        (&emitting_room, [5, 67], &same),
        (&emitting_room, [131, 70], &same),
    ] {
        let sums = seen(&gpu, room, &small(), &room.first_camera(), size).film.of_blocks.sums;
        assert_eq!(sums.len() as u32, 3 * size[0] * size[1]);
        let mean = sums.iter().sum::<u64>() as f64 / sums.len() as f64;
        for (place, sum) in sums.iter().enumerate() {
            assert!(range.contains(&(*sum as f64 / mean)), "{size:?}: pixel {} has {sum}, and {mean} is the mean", place / 3);
        }
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

/// Parts that are kept apart are each what they are alone, and add up to the whole.
fn parts_add_up(gpu: &Gpu, settings: &SceneSettings, alone: &[Part]) {
    let scene = scene("cornell-spheres");
    let whole = picture(gpu, &scene, settings);
    let apart = picture(gpu, &scene, &SceneSettings { keeps_parts: true, ..settings.clone() });
    assert!(apart.film == whole.film && whole.film.parts.is_none(), "parts change the whole");
    let of_part = |number| (0..whole.film.pixels()).flat_map(|pixel| apart.film.sum_of_part(number, pixel).unwrap()).collect();
    let kept: [Vec<u64>; 4] = [0, 1, 2, 3].map(of_part);
    for (place, sum) in whole.film.sums.iter().enumerate() {
        assert_eq!(*sum, kept.iter().map(|part| part[place]).sum::<u64>(), "sum {place}, {:?}", settings.illumination);
    }
    for (number, part) in Part::EACH.into_iter().enumerate() {
        assert!(kept[number].iter().any(|sum| *sum > 0), "{part:?} light is dark");
        assert_eq!(kept[number].iter().sum::<u64>(), whole.film.part_totals[number], "total of {part:?} light");
        if alone.contains(&part) {
            let found = picture(gpu, &scene, &SceneSettings { part, ..settings.clone() });
            assert!(kept[number] == found.film.sums, "{part:?} light, {:?}, is not what it is alone", settings.illumination);
            assert_eq!(found.film.part_totals.iter().sum::<u64>(), whole.film.part_totals[number]);
        }
    }
}

/// Each part alone has kernels of its own.
#[test]
fn the_four_parts_add_up_to_the_whole_to_the_bit() {
    let Some(gpu) = device() else { return };
    parts_add_up(&gpu, &SceneSettings { samples: 4, ..small() }, &[Part::Specular]);
    if is_long_run() {
        parts_add_up(&gpu, &SceneSettings { samples: 4, ..small() }, &Part::EACH);
        parts_add_up(&gpu, &SceneSettings { samples: 4, final_gather: true, ..small() }, &[Part::Indirect]);
        parts_add_up(&gpu, &SceneSettings { illumination: Illumination::Photons, ..small() }, &Part::EACH);
    }
}

/// Effects that a scene does not need change nothing where some of them are forced on, in each of these ways.
fn unneeded_effects_change_no_bit(gpu: &Gpu, name: &str, ways: impl Fn(&[Effect]) -> Vec<Vec<Effect>>) {
    let scene = scene(name);
    let reference = picture(gpu, &scene, &small());
    let unneeded: Vec<Effect> =
        reference.plan.decisions.iter().filter(|decision| !decision.needed).map(|decision| decision.effect).collect();
    assert!(unneeded.len() > 5, "{name}: {unneeded:?}");
    for with in ways(&unneeded) {
        let forced = picture(gpu, &scene, &SceneSettings { with: with.clone(), ..small() });
        assert!(with.iter().all(|effect| forced.plan.simulates(*effect)), "{with:?}");
        assert_holds(format!("{with:?}"), same_film(&format!("{name} with {with:?}"), &forced, &reference));
    }
}

/// Each combination has kernels of its own, and making them is what takes time. This scene lacks what the other has, and more.
#[test]
fn an_effect_that_the_scene_lacks_changes_no_bit() {
    let Some(gpu) = device() else { return };
    // Effects of layered materials, which stand together, are the larger part of any kernel that has them.
    let plain = |effect: &Effect| !(Effect::Layers..=Effect::NormalMaps).contains(effect);
    unneeded_effects_change_no_bit(&gpu, "cornell", |all| vec![all.iter().copied().filter(plain).collect()]);
    if is_long_run() {
        // All at once, and each with and without each other.
        let ways = |all: &[Effect]| -> Vec<Vec<Effect>> {
            let forced = |row: Vec<usize>| pairs(all, row).filter(|(_, forced)| *forced == 1).map(|(effect, _)| *effect).collect();
            [vec![1; all.len()]].into_iter().chain(pairwise(&vec![2; all.len()])).map(forced).collect()
        };
        for name in ["cornell", "cornell-spheres"] {
            unneeded_effects_change_no_bit(&gpu, name, ways);
        }
        // A list instead of a tree finds the same.
        let cornell = scene("cornell");
        let [tree, list] = [vec![], vec![Effect::Bvh]].map(|without| picture(&gpu, &cornell, &SceneSettings { without, ..small() }));
        assert_holds("list", same_film("list", &list, &tree));
    }
}

/// Plates of 1 m in rows of five before a wall and under a sun: each shows an effect, and a pixel sees it alone.
fn plates() -> (Scene, Vec<Effect>) {
    let plastic = layered::plastic(0.7);
    let pane = Layers { roughness: 0.0, transmission: 1.0, ior: 1.0, ..plastic };
    let layered = |albedo: f32, layers| Material::layered("plate", Vec3::splat(albedo), layers);
    let plates = [
        (Effect::Glossy, Material { surface: Surface::Glossy { exponent: 20.0 }, ..matt(0.5) }),
        (Effect::Textures, Material { base_colour_texture: Some(TextureUse::of(0, 0)), ..matt(1.0) }),
        (Effect::VertexColours, matt(0.5)),
        (Effect::TwoSided, Material { two_sided: true, ..matt(0.5) }),
        (Effect::SmoothNormals, matt(0.5)),
        // Over black: what coat and sheen reflect is about what they take from a surface under them.
        (Effect::ClearCoat, layered(0.0, Layers { coat: 1.0, coat_roughness: 0.6, specular: 0.0, ..plastic })),
        (Effect::Sheen, layered(0.0, Layers { sheen_colour: Vec3::ONE, sheen_roughness: 0.6, specular: 0.0, ..plastic })),
        (Effect::Alpha, Material { coverage: Coverage::Blend { alpha: 0.3 }, ..layered(0.6, plastic) }),
        (Effect::NormalMaps, Material { normal_map: Some(map_of(1, 1.0)), ..layered(0.6, plastic) }),
        (Effect::DiffuseTransmission, layered(0.6, Layers { diffuse_transmission: 1.0, specular: 0.0, ..plastic })),
        (Effect::Iridescence, layered(0.0, Layers { iridescence: 1.0, film_ior: 2.0, film_thickness: [0.0, 300.0], ..plastic })),
        (Effect::Anisotropy, layered(1.0, Layers { metallic: 1.0, anisotropy: 1.0, ..plastic })),
        (Effect::Transmission, layered(0.6, pane)),
        (Effect::Media, layered(0.6, Layers { medium: Some(Medium { transmittance: Vec3::splat(1e-3), metres: 1.0 }), ..pane })),
        (Effect::Dispersion, layered(0.6, Layers { ior: 1.5, dispersion: 20.0, medium: Some(Medium::CLEAR), ..pane })),
        (Effect::SpecularChains, mirror(0.9)),
        (Effect::Layers, layered(0.6, Layers { metallic: 1.0, ..plastic })),
        (Effect::Direct, matt(0.5)),
    ];
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    // The wall ends behind the middle of the wedge, so that colours which this parts go different ways.
    let wall = Mesh::parallelogram("wall", DVec3::new(-3.0, -3.0, -1.0), 5.0 * x, 6.0 * y, 0);
    let below_the_mirror = Mesh::parallelogram("floor", DVec3::new(-2.6, -2.5, -0.5), 2.0 * z, 1.2 * x, 1);
    let unlit = layered(1.0, Layers { is_unlit: true, ..Layers::default() });
    let mut scene = scene_of(vec![wall, below_the_mirror], vec![unlit, matt(1.0)], vec![sun(DVec3::new(0.0, -0.6, -0.8))]);
    scene.textures = [[80, 80, 80, 255], [230, 128, 190, 255]].map(|texel| row_of_texels(&[texel], Filter::Bilinear)).into();
    for (place, (effect, material)) in plates.iter().enumerate() {
        let number = scene.materials.len();
        let corner = DVec3::new((place % 5) as f64 - 2.5, 1.0 - (place / 5) as f64, 0.0);
        let (u, v) = match effect {
            Effect::TwoSided => (y, x),
            // It leans towards the eye.
            Effect::SpecularChains => (x, y + z),
            _ => (x, y),
        };
        let mut plate = Mesh::parallelogram("plate", corner, u, v, number);
        match effect {
            Effect::VertexColours => plate.colours = vec![DVec3::splat(0.3); 4],
            Effect::SmoothNormals => plate.normals = vec![DVec3::new(0.0, 0.6, 0.8); 4],
            Effect::NormalMaps | Effect::Anisotropy => plate.tangents = vec![[x.extend(1.0); 3]; 2],
            Effect::Media => scene.meshes.push(Mesh::parallelogram("back", corner - 0.3 * z, y, x, number)),
            Effect::Dispersion => scene.meshes.push(Mesh::parallelogram("back", corner - 0.6 * z, y, x + 0.5 * z, number)),
            _ => {}
        }
        scene.meshes.push(plate);
        scene.materials.push(material.clone());
    }
    (scene, plates.iter().map(|(effect, _)| *effect).collect())
}

/// Red mean of all pixels.
fn estimate(result: &RunResult) -> Estimate {
    let squares: f64 = standard_errors(result).iter().map(|error| error.x.powi(2)).sum();
    Estimate { mean: mean_red(result), standard_error: squares.sqrt() / result.film.pixels() as f64 }
}

/// Whether an estimate differs by more than both errors and two per cent of what it was.
fn differs(before: &RunResult, after: &RunResult, place: usize) -> bool {
    let errors = before.film.standard_error(place) + after.film.standard_error(place);
    let allowed = 4.0 * errors + 0.02 * before.film.mean(place).max_element();
    (before.film.mean(place) - after.film.mean(place)).abs().cmpgt(allowed).any()
}

/// A run without some effects more, which its plan says that the scene needs.
fn without(effects: &[Effect], settings: &SceneSettings, run: impl Fn(&SceneSettings) -> RunResult) -> RunResult {
    let found = run(&SceneSettings { without: [effects, &settings.without].concat(), ..settings.clone() });
    let missing: HashSet<Effect> = found.plan.missing().into_iter().collect();
    assert_eq!(missing, found.plan.settings.without.iter().copied().collect());
    found
}

/// Each plate is another without its effect, and a plain one as before.
fn plates_are_missed(gpu: &Gpu, groups: &[&[Effect]]) {
    let (scene, effects) = plates();
    let eye = Camera::looking_at("eye", 2.0 * DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0);
    let eye = Camera { projection: Projection::Orthographic { half_height: 2.0 }, ..eye };
    // What photons bring is missed elsewhere.
    let no_photons = vec![Effect::Indirect, Effect::ReflectiveCaustics, Effect::RefractiveCaustics];
    let settings = SceneSettings { samples: 64, rounds: 128, without: no_photons, ..small() };
    let run = |settings: &SceneSettings| result_of(gpu, &scene, settings, Receivers::Image(&eye, [5, 4]));
    let reference = run(&settings);
    for group in groups {
        let without = without(group, &settings, run);
        for (place, effect) in effects.iter().enumerate().filter(|(_, effect)| group.contains(effect) || **effect == Effect::Direct) {
            println!("{effect:?}, without {group:?}: {} and {}", reference.film.mean(place), without.film.mean(place));
            assert_eq!(differs(&reference, &without, place), group.contains(effect), "{effect:?}, without {group:?}");
        }
    }
}

/// A point with its normal, the kind of light that alone lights it, and its irradiance.
type LitPoint = (Effect, (DVec3, DVec3), f64);

/// Points that are lit by a kind of light each.
fn lit_points() -> (Scene, [LitPoint; 6]) {
    let (above, down) = (|x: f64| DVec3::new(x, 1.0, 0.0), DVec3::NEG_Y);
    let [intensity, power] = [400.0, 200.0].map(Vec3::splat);
    let lamp = Mesh::parallelogram("lamp", DVec3::new(11.75, 1.0, -0.25), DVec3::X * 0.5, DVec3::Z * 0.5, 0);
    let lights = vec![
        LightKind::Point { position: above(0.0), intensity: 0.25 * intensity },
        LightKind::Spot { position: above(4.0), direction: down, intensity, inner_angle: 0.3, outer_angle: 0.4 },
        LightKind::Disc { centre: above(8.0), normal: down, radius: 0.1, power, law: EmissionLaw::Cosine },
        LightKind::Directional { direction: DVec3::NEG_X, irradiance: Vec3::splat(10.0) },
        LightKind::Environment { radiance: Vec3::ONE },
    ];
    // Rays choose the sun and the sky by the size of the scene.
    let floor = Mesh::parallelogram("floor", DVec3::new(-1.0, -0.5, -1.0), DVec3::Z * 2.0, DVec3::X * 15.0, 1);
    let emissive = Material { emission: Vec3::splat(100.0), ..matt(0.0) };
    let scene = scene_of(vec![lamp, floor], vec![emissive, matt(0.0)], lights);
    let below = |x: f64| (DVec3::X * x, DVec3::Y);
    // Configuration factors of a disc and of a square.
    let points = [
        (Effect::PointLights, below(0.0), 100.0),
        (Effect::SpotLights, below(4.0), 400.0),
        (Effect::DiscLights, below(8.0), 63.0),
        (Effect::MeshLights, below(12.0), 23.1),
        // Over the bulb nothing else comes from the side.
        (Effect::DirectionalLights, (4.0 * DVec3::Y, DVec3::X), 10.0),
        (Effect::Environment, (4.0 * DVec3::Y, DVec3::NEG_X), PI),
    ];
    (scene, points)
}

/// They are dark without it, and not without others.
fn lights_are_missed(gpu: &Gpu, groups: &[&[Effect]]) {
    let (scene, points) = lit_points();
    let settings = SceneSettings { part: Part::Direct, shadow_rays: 64, rounds: 64, ..small() };
    let places = points.map(|(_, point, _)| point);
    let run = |settings: &SceneSettings| result_of(gpu, &scene, settings, Receivers::Points(&places));
    for group in groups {
        let without = without(group, &settings, run);
        for (place, (effect, _, before)) in points.iter().enumerate() {
            let after = red(&without, place).0;
            println!("{effect:?}, without {group:?}: {before} and {after}");
            assert_eq!(after < 0.5 * before, group.contains(effect), "{effect:?}, without {group:?}: {before} and {after}");
        }
    }
}

/// Each way to leave out effects has kernels of its own, so that some lights are left out at once here, and all else in the long run.
/// Without any effect a plan has other constants.
#[test]
fn an_effect_that_the_scene_needs_is_missed_when_it_is_left_out() {
    use Effect::*;
    let Some(gpu) = device() else { return };
    lights_are_missed(&gpu, &[&[DirectionalLights, DiscLights, Environment]]);
    let spheres = scene("cornell-spheres");
    // So many triangles cannot be a list; of few the bits are the same, as the pairs above show.
    let no_tree = SceneSettings { without: vec![Bvh], ..small() };
    let refused = scene_plan(&gpu, &spheres, &no_tree, square_picture(SIZE)).unwrap_err().to_string();
    assert!(refused.starts_with("`without` bvh"), "{refused}");

    let mut planned: HashSet<Effect> = HashSet::new();
    for scene in [plates().0, lit_points().0, spheres] {
        let plan = |without| {
            let settings = SceneSettings { without, ..small() };
            scene_plan_within(&Limits::of_host(), &scene, &settings, square_picture(4))
        };
        let whole = plan(vec![]).unwrap();
        for effect in whole.decisions.iter().filter(|decision| decision.kept && decision.effect != Bvh).map(|decision| decision.effect) {
            let other = plan(vec![effect]).unwrap();
            let of = |plan: &ScenePlan| (plan.constants.clone(), plan.caustic_surfaces, plan.global.is_some());
            let changed = of(&other) != of(&whole);
            // Gaps of alpha are closed in the scene itself.
            assert!(!other.simulates(effect) && (effect == Alpha || changed), "{effect:?}");
            planned.insert(effect);
        }
    }
    assert_eq!(planned, Effect::ALL.into_iter().filter(|effect| *effect != Bvh).collect());
}

#[test]
#[ignore = "long: minutes on a software device"]
fn each_effect_that_the_scene_needs_is_missed_by_itself() {
    use Effect::*;
    let Some(gpu) = device() else { return };
    plates_are_missed(&gpu, &plates().1.chunks(1).collect::<Vec<_>>());
    // Of a group none takes part in what shows another, but layers in most.
    plates_are_missed(&gpu, &[&[Glossy, Textures, VertexColours, TwoSided, SmoothNormals, ClearCoat, Sheen, Iridescence, Transmission]]);
    lights_are_missed(&gpu, &[&[PointLights], &[SpotLights], &[DiscLights], &[MeshLights], &[DirectionalLights], &[Environment]]);
    // Without what makes photons of a kind the spheres look otherwise: over the whole picture, or somewhere.
    let spheres = scene("cornell-spheres");
    for (part, effect) in [(Part::Indirect, Indirect), (Part::Caustic, ReflectiveCaustics), (Part::Caustic, RefractiveCaustics)] {
        let settings = SceneSettings { part, rounds: 24, caustic_photons: 30_000, ..small() };
        let run = |settings: &SceneSettings| picture(&gpu, &spheres, settings);
        let (before, after) = (run(&settings), without(&[effect], &settings, run));
        let of_all = same_light(effect.name(), estimate(&after), estimate(&before)).is_err();
        assert!(of_all || (0..before.film.pixels()).any(|place| differs(&before, &after, place)), "{}", effect.name());
    }
}

/// Passes, buffers and pipelines are those of the plan.
#[test]
fn what_is_dropped_is_not_there() {
    let Some(gpu) = device() else { return };
    let cornell = scene("cornell");
    // So few bounces are one segment, whatever the device.
    let small = || SceneSettings { bounces: 8, ..small() };
    let all = picture(&gpu, &cornell, &SceneSettings { with: vec![Effect::RefractiveCaustics], ..small() });
    let needed = picture(&gpu, &cornell, &small());
    let fresh = device_with(Options { by_plan: true, ..Options::default() }).unwrap();
    let before = fresh.work().pipelines;
    let direct = picture(&fresh, &cornell, &SceneSettings { part: Part::Direct, ..small() });
    let count = |result: &RunResult, pass: &str| result.timings.row(pass).map_or(0, |row| row.count);
    for (result, global, caustic) in [(&all, 3, 3), (&needed, 3, 0), (&direct, 0, 0)] {
        assert_eq!(count(result, "round/global"), global);
        assert_eq!(count(result, "round/caustic"), caustic);
        assert_eq!(count(result, "round/visible points"), 3);
    }
    // Two dispatches a round to see and resolve, one to turn the flux of maps into radiance and one to end a block of what gives their bias; a map has one to emit, flights with their
    // sizes, the index and the lookup.
    assert_eq!(direct.dispatches, 2 * 3);
    let map = (needed.dispatches - direct.dispatches) / 3 - 2;
    assert_eq!((all.dispatches - needed.dispatches) / 3, map);
    // Both maps of a round use the same buffers in turn, so that the second takes nothing.
    assert!(needed.plan.bytes <= all.plan.bytes && direct.plan.bytes < needed.plan.bytes);
    // Of pipelines only those of the plan, each made once.
    assert_eq!(direct.pipelines, scene::modules(&direct.plan, fresh.facts()).len());
    assert_eq!(fresh.work().pipelines - before, direct.pipelines);
    assert_eq!(direct.pipelines, 2);
}

/// Samples of a pixel are strata of it, of the lamps and of what glass mirrors: noise falls faster than by their number.
#[test]
fn samples_of_a_pixel_leave_little_noise() {
    let Some(gpu) = device() else { return };
    let error = |samples, shadow_rays, rounds| {
        let settings = SceneSettings { part: Part::Direct, samples, shadow_rays, rounds, ..small() };
        let result = picture(&gpu, &scene("cornell-spheres"), &settings);
        (result.film.relative_error(), estimate(&result))
    };
    let ((by_chance, light), (even, same)) = (error(1, 1, 64), error(16, 1, 4));
    assert_holds("samples", same_light("samples", same, light));
    println!("64 paths a pixel: {:.2} % of error by rounds, {:.2} % by samples", 100.0 * by_chance, 100.0 * even);
    assert!(2.0 * even < by_chance, "{even} and {by_chance}");
}

#[test]
fn a_scene_without_light_is_black_and_costs_no_photon() {
    let Some(gpu) = device() else { return };
    let mut scene = scene("cornell");
    scene.materials.iter_mut().for_each(|material| material.emission = Vec3::ZERO);
    let result = picture(&gpu, &scene, &small());
    assert!(result.film.sums.iter().all(|sum| *sum == 0));
    assert_eq!(result.plan.maps().count(), 0);
    assert_eq!(result.fates[0].emitted, 0);
}

/// The stated error is that of many runs: the spread of means over seeds, pixel by pixel. A tenth more or less is noticed.
#[test]
#[ignore = "long: half a minute on a software device"]
fn stated_errors_are_the_spread_over_seeds() {
    let Some(gpu) = device() else { return };
    let scene = scene("cornell");
    let runs: Vec<RunResult> = (0..60).map(|seed| picture(&gpu, &scene, &SceneSettings { seed, rounds: 8, ..small() })).collect();
    let pixels = runs[0].film.pixels();
    let (mut stated, mut spread) = (0.0, 0.0);
    for pixel in 0..pixels {
        let means: Vec<DVec3> = runs.iter().map(|result| result.film.mean(pixel)).collect();
        let mean = means.iter().sum::<DVec3>() / means.len() as f64;
        spread += means.iter().map(|value| (*value - mean).length_squared()).sum::<f64>() / (means.len() - 1) as f64;
        stated += runs.iter().map(|result| result.film.standard_error(pixel).length_squared()).sum::<f64>() / runs.len() as f64;
    }
    let ratio = (stated / spread).sqrt();
    assert!((0.9..1.1).contains(&ratio), "stated errors are {ratio} of the spread");
}

/// Pictures of `SIZE` pixels a side against the path tracer, within what both state. Paths from the eye seldom find caustics, and of few
/// samples do not know how seldom.
fn agrees_with_the_judge(gpu: &Gpu, scene: &Scene, [photons, rounds]: [u32; 2], samples: u32) {
    let settings = SceneSettings { photons, caustic_photons: photons, rounds, ..by_rounds() };
    let result = picture(gpu, scene, &settings);
    let judged = Judge::new(scene, settings.bounces).image(&scene.first_camera(), SIZE, SIZE, samples, 77);
    let verdict = |share: f64| {
        let means: Vec<DVec3> = result.film.means().map(|mean| share * mean).collect();
        Verdict::new(&means, &standard_errors(&result), rounds, &judged, None)
    };
    assert!(verdict(1.0).agrees(), "{}: {}", scene.name, verdict(1.0));
    assert!(!verdict(1.3).agrees(), "{}, a third brighter, is not noticed", scene.name);
}

/// In the short run `tests/light/skies.rs` compares points with the path tracer.
#[test]
#[ignore = "long: half a minute on a software device"]
fn pictures_agree_with_the_judge() {
    let Some(gpu) = device() else { return };
    agrees_with_the_judge(&gpu, &scene("cornell"), [5000, 48], 192);
    agrees_with_the_judge(&gpu, &scene("open-box-phong"), [5000, 48], 192);
    agrees_with_the_judge(&gpu, &scene("cornell-spheres"), [10_000, 64], 1536);
    agrees_with_the_judge(&gpu, &scene("caustic-sphere"), [20_000, 64], 768);
}
