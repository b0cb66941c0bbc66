//! Sheets that let some light pass straight: gaps of alpha and thin smooth walls.

use super::layered::{dull, layered, metal, plastic, row_of_texels};
use super::prelude::*;
use super::{colour_check, estimate_check};
use photonmill::engine::scene::RunResult;
use photonmill::scene::material::{Coverage, Layers};
use photonmill::scene::texture::Filter;

/// Where the sun stands.
const SUN: DVec3 = DVec3::new(0.3, 1.0, 0.15);
/// From one stack to the next; a sheet takes half of it.
const PITCH: f64 = 2.0;

/// What a sheet is made of, and what is done to its mesh.
type Sheet = (Material, fn(&mut Mesh));

/// Sheets above one another, and the share of light of this cosine that gets through all of them.
struct Stack {
    what: &'static str,
    sheets: Vec<Sheet>,
    share: fn(f64) -> DVec3,
}

fn blended(alpha: f32, material: Material) -> Material {
    Material { coverage: Coverage::Blend { alpha }, ..material }
}

fn masked(alpha: f32, material: Material) -> Material {
    Material { coverage: Coverage::Mask { alpha, cutoff: 0.5 }, ..material }
}

fn pane() -> Material {
    layered(TINT, &Layers { transmission: 1.0, ..plastic(0.0) })
}

const TINT: Vec3 = Vec3::new(0.9, 0.6, 0.3);

/// What a smooth pane lets through: all but what it reflects, tinted.
fn through_a_pane(cosine: f64) -> DVec3 {
    (1.0 - schlick(cosine)) * TINT.as_dvec3()
}

fn schlick(cosine: f64) -> f64 {
    0.04 + 0.96 * (1.0 - cosine).powi(5)
}

fn as_it_is(_: &mut Mesh) {}

/// The first texture has alpha 0.25 in one half and 0.75 in the other.
fn stacks() -> Vec<Stack> {
    let black = || dull(0.0);
    let textured = |material: Material| Material { base_colour_texture: Some(TextureUse::of(0, 0)), ..material };
    let of = |count: usize, material: Material| vec![(material, as_it_is as fn(&mut Mesh)); count];
    let stack = |what, sheets, share| Stack { what, sheets, share };
    let at_64: fn(&mut Mesh) = |mesh| mesh.uvs[0] = vec![DVec2::new(0.3, 0.5); 4];
    let at_191: fn(&mut Mesh) = |mesh| mesh.uvs[0] = vec![DVec2::new(0.7, 0.5); 4];
    vec![
        stack("nothing", Vec::new(), |_| DVec3::ONE),
        stack("alpha 0", of(3, blended(0.0, black())), |_| DVec3::ONE),
        stack("alpha 1", of(1, blended(1.0, black())), |_| DVec3::ZERO),
        stack("half", of(1, blended(0.5, black())), |_| DVec3::splat(0.5)),
        stack("three halves", of(3, blended(0.5, black())), |_| DVec3::splat(0.125)),
        stack("two of 0.3, of metal", of(2, blended(0.3, layered(TINT, &metal(0.0)))), |_| DVec3::splat(0.49)),
        stack("a hole", of(2, masked(0.49, black())), |_| DVec3::ONE),
        stack("no hole", of(1, masked(0.5, black())), |_| DVec3::ZERO),
        stack("no gap", of(1, Material { coverage: Coverage::Whole, ..black() }), |_| DVec3::ZERO),
        stack(
            "alpha of the corners",
            vec![(blended(0.8, black()), |mesh| (mesh.alphas, mesh.colours) = (vec![0.25; 4], vec![DVec3::ONE; 4]))],
            |_| DVec3::splat(0.8),
        ),
        stack("alpha of a texture", vec![(textured(blended(0.8, black())), at_191)], |_| DVec3::splat(1.0 - 0.8 * 191.0 / 255.0)),
        stack("a masked texture", vec![(textured(masked(1.0, black())), at_64)], |_| DVec3::ONE),
        stack("a pane", of(1, pane()), through_a_pane),
        stack("three panes", of(3, pane()), |cosine| through_a_pane(cosine).powf(3.0)),
        stack("a pane with gaps", of(1, blended(0.25, pane())), |cosine| 0.75 + 0.25 * through_a_pane(cosine)),
        stack(
            "a coated pane of which half is metal",
            of(1, Material { layers: Layers { coat: 0.7, metallic: 0.5, ..pane().layers }, ..pane() }),
            |cosine| 0.5 * (1.0 - 0.7 * schlick(cosine)) * through_a_pane(cosine),
        ),
        stack(
            "a pane of which half is opaque",
            of(1, Material { layers: Layers { transmission: 0.5, ..pane().layers }, ..pane() }),
            |cosine| 0.5 * through_a_pane(cosine),
        ),
    ]
}

/// Stacks in a row.
const COLUMNS: usize = 5;

/// Middles of the floors of the stacks.
fn points(stacks: &[Stack]) -> Vec<(DVec3, DVec3)> {
    (0..stacks.len()).map(|k| (PITCH * DVec3::new((k % COLUMNS) as f64, 0.0, (k / COLUMNS) as f64), DVec3::Y)).collect()
}

/// Stacks on their floors, each for itself, so that the sheets' middles are in line with a direction through the floor's.
fn scene_with(stacks: &[Stack], floor: Material, towards: DVec3, lights: Vec<LightKind>) -> Scene {
    let mut scene = scene_of(Vec::new(), vec![floor], lights);
    scene.textures = vec![row_of_texels(&[[255, 255, 255, 64], [255, 255, 255, 191]], Filter::Nearest)];
    for (k, (stack, (middle, _))) in pairs(stacks, points(stacks)).enumerate() {
        let floor = level(0.0, [0.8 * PITCH; 2], true, 0);
        scene.meshes.push(Mesh { positions: floor.positions.iter().map(|at| *at + middle).collect(), ..floor });
        for (number, (material, change)) in stack.sheets.iter().enumerate() {
            let height = 0.1 + 0.05 * number as f64;
            // Every other one is seen from behind.
            let mut sheet = level(height, [0.5 * PITCH; 2], (k + number) % 2 == 0, scene.materials.len());
            sheet.positions.iter_mut().for_each(|at| *at += middle + towards.with_y(0.0) * (height / towards.y));
            change(&mut sheet);
            scene.materials.push(Material { two_sided: true, ..material.clone() });
            scene.meshes.push(sheet);
        }
    }
    scene
}

/// The sun through every stack: by shadow rays, of which nothing is random, or by photons. What lands on the floors does not ask what
/// becomes of it: they are black, and the one without a sheet is a smooth metal up to its middle.
pub fn sun_through_sheets(gpu: &Gpu, illumination: Illumination) -> Check<Complaint> {
    let stacks = stacks();
    let cosine = SUN.normalize().y;
    let irradiance = Vec3::splat((1.0 / cosine) as f32);
    let sun = LightKind::Directional { direction: -SUN.normalize(), irradiance };
    let mut scene = scene_with(&stacks, dull(0.0), SUN, vec![sun]);
    scene.textures.push(row_of_texels(&[[0, 0, 255, 255], [0, 255, 0, 255]], Filter::Nearest));
    let metallic_roughness_texture = Some(TextureUse::of(1, 0));
    scene.materials.push(layered(Vec3::ONE, &Layers { metallic_roughness_texture, ..metal(1.0) }));
    let edge = &mut scene.meshes[0];
    edge.material = scene.materials.len() - 1;
    edge.uvs[0] = edge.positions.iter().map(|at| DVec2::new(0.51 + at.x / (0.8 * PITCH), 0.5)).collect();
    let settings = SceneSettings { shadow_rays: 1, illumination, part: Part::Direct, ..mapped(100_000, 8, 8, 0.35) };
    let result = received(gpu, &scene, &settings, &points(&stacks));
    compare(&format!("{illumination:?}"), &stacks, &result, &(0..stacks.len()).collect::<Vec<_>>(), cosine)
}

/// A lamp of 1 W/sr, 1 m above a floor, through two sheets, with a third one above it.
pub fn lamp_between_sheets(gpu: &Gpu) -> Check<Complaint> {
    let meshes = [0.0, 0.3, 0.6, 1.2].map(|height| level(height, [1.0; 2], true, usize::from(height > 0.0)));
    let half = Material { two_sided: true, ..blended(0.5, dull(0.0)) };
    let scene = scene_of(meshes.into(), vec![matt(0.0), half], vec![point(DVec3::Y)]);
    let settings = SceneSettings { rounds: 1, part: Part::Direct, ..by_rounds() };
    let found = means(&received(gpu, &scene, &settings, &[(DVec3::ZERO, DVec3::Y)]))[0].x;
    // Nothing is random.
    estimate_check("a lamp between sheets", found, 0.25, 1e-5)
}

/// Photons of a sun from below, mirrored onto a floor by a pane of which half is metal and half lets them pass.
pub fn photons_off_a_pane(gpu: &Gpu) -> Check<Complaint> {
    let pane = Material { two_sided: true, layers: Layers { metallic: 0.5, ..pane().layers }, base_colour: Vec3::ONE, ..pane() };
    let direction = DVec3::new(1.0, 1.0, 0.0);
    // What reaches the floor passed 2 m beside it on the way up.
    let scene = scene_of(vec![level(0.0, [1.0; 2], true, 0), level(1.0, [3.0; 2], true, 1)], vec![matt(0.0), pane], vec![sun(direction)]);
    let result = received(gpu, &scene, &mapped(20_000, 32, 4, 0.3), &[(DVec3::ZERO, DVec3::Y)]);
    let cosine = direction.normalize().y;
    red_check("photons off a pane", &result, 0, cosine * (0.5 + 0.5 * schlick(cosine)), [0.02, 0.0])
}

/// A lamp with gaps of alpha emits what is there of it.
pub fn blended_lamp(gpu: &Gpu, illumination: Illumination) -> Check<Complaint> {
    let lamp = Material { emission: Vec3::ONE, ..blended(0.5, dull(0.0)) };
    let scene = scene_of(vec![level(0.0, [1.0; 2], true, 0), level(1.0, [0.1; 2], false, 1)], vec![matt(0.0), lamp], vec![]);
    let settings = SceneSettings { shadow_rays: 4, illumination, part: Part::Direct, ..mapped(20_000, 32, 1, 0.05) };
    let result = received(gpu, &scene, &settings, &[(DVec3::ZERO, DVec3::Y)]);
    // It is small and far away, and what is within the radius sees all but the same.
    red_check(&format!("a lamp with gaps, {illumination:?}"), &result, 0, 0.5 * 0.01, [0.04, 1e-3])
}

/// An emissive floor through every stack, seen straight from above.
pub fn floor_through_sheets(gpu: &Gpu) -> Check<Complaint> {
    let stacks = stacks();
    let scene = scene_with(&stacks, Material { emission: Vec3::ONE, ..matt(0.0) }, DVec3::Y, vec![]);
    // Every fourth pixel sees the middle of a stack.
    let rows = stacks.len().div_ceil(COLUMNS);
    let size = [COLUMNS, rows].map(|count| 4 * count - 3);
    let middle = 0.5 * PITCH * DVec3::new((COLUMNS - 1) as f64, 0.0, (rows - 1) as f64);
    let half_height = 0.125 * PITCH * size[1] as f64;
    let camera = Camera::looking_at("above", middle + DVec3::Y * 1e3, middle, DVec3::NEG_Z, 2.0 * (half_height / 1e3).atan());
    let without = vec![Effect::Direct];
    let settings = SceneSettings { samples: 64, rounds: 32, part: Part::Direct, without, ..by_rounds() };
    let result = seen(gpu, &scene, &settings, &camera, size.map(|pixels| pixels as u32));
    let pixels: Vec<usize> = (0..stacks.len()).map(|k| 4 * (k / COLUMNS) * size[0] + 4 * (k % COLUMNS)).collect();
    compare("the floor", &stacks, &result, &pixels, 1.0)
}

/// All of it is direct light.
fn compare(what: &str, stacks: &[Stack], result: &RunResult, places: &[usize], cosine: f64) -> Check<Complaint> {
    for (stack, &place) in pairs(stacks, places) {
        let (found, error) = (result.film.mean(place), result.film.standard_error(place));
        let expected = (stack.share)(cosine);
        println!("{what}, {}: {found} +- {error}, {expected} expected", stack.what);
        assert!(error.max_element() < 0.04, "{error}");
        colour_check(&format!("{what}, {}", stack.what), found, expected, error.max(DVec3::splat(2e-5)))?;
    }
    Ok(())
}
