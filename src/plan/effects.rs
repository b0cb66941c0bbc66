//! The table of effects: all that is particular to one stands in its row.
//!
//! A new effect is a name in [`Effect`], a row here, and its own code: in kernels behind its constant, which
//! `glsl/world/scene/effects.glsl` declares.

use std::borrow::Cow;

use glam::Vec3;

use super::evidence::{EffectDecision, Evidence, Facts, is_layered_with};
use super::scene::{MapPlan, ScenePlan};
use crate::constants::*;
use crate::photon::MapPhoton;
use crate::scene::geometry::Geometry;
use crate::scene::material::{Coverage, Layers, Medium};
use crate::scene::{LightKind, LobeKinds, Material, Scene, Surface};
use crate::settings::scene::{Effect, Part, SceneSettings};
use crate::text::counted;

struct Row {
    /// Specialization constant of kernels that have code for it.
    constant: Option<&'static str>,
    /// Whether the scene and the request need it, and why.
    needed: fn(&Facts) -> Evidence,
    /// Takes what needs it out of a scene: what `--without` does.
    remove: fn(&mut Scene),
    /// What a plan that keeps it has for it alone.
    cost: fn(&ScenePlan, &Geometry) -> Cost,
    measured: Option<Measured>,
}

#[derive(Default)]
struct Cost {
    /// Photons of a round that are traced for it.
    photons: u64,
    /// Device memory.
    bytes: u64,
    /// What became of it, behind its evidence.
    words: String,
}

/// What a run measures of one effect.
#[derive(Clone, Copy)]
pub(crate) struct Measured {
    /// The pass that exists for it.
    pub pass: Option<&'static str>,
    /// Its part of the light, among those that a film distinguishes.
    pub part: usize,
}

/// What most rows have.
const PLAIN: Row = Row {
    constant: None,
    needed: |_| unreachable!("every row says whether its effect is needed"),
    remove: |_| {},
    cost: |_, _| Cost { photons: 0, bytes: 0, words: String::new() },
    measured: None,
};

/// A photon in its map, sorted and unsorted, and its place in its bucket.
const MAP_ENTRY_BYTES: u64 = 2 * size_of::<MapPhoton>() as u64 + 4;
/// Triangles up to which a list is tested from end to end instead of a tree.
const LIST_TRIANGLES: usize = 24;

fn row(effect: Effect) -> Row {
    match effect {
        Effect::Direct => Row {
            needed: direct,
            cost: |plan, _| {
                plan.lights().map_or_else(Cost::default, |lights| Cost { bytes: lights.bytes(), words: lights.in_words(), photons: 0 })
            },
            measured: Some(Measured { pass: Some("round/visible points"), part: 0 }),
            ..PLAIN
        },
        Effect::Indirect => Row {
            needed: indirect,
            cost: |plan, _| of_map(plan.global.as_ref()),
            measured: Some(Measured { pass: Some("round/global"), part: 3 }),
            ..PLAIN
        },
        Effect::Glossy => Row {
            constant: Some("HAS_GLOSSY"),
            needed: |facts| facts.found("glossy", |material| is_glossy(material.surface), "no glossy material"),
            remove: |scene| make_lambert(scene, is_glossy),
            ..PLAIN
        },
        Effect::Layers => Row {
            constant: Some("HAS_LAYERS"),
            // A Lambertian surface of a file is layered where it is to have one side (see TwoSided).
            needed: |facts| {
                let is_layered = |of: &Material| of.surface == Surface::Layered || facts.has_one_sides && of.is_lambertian();
                facts.found("layered", is_layered, "no layered material")
            },
            remove: |scene| make_lambert(scene, |surface| surface == Surface::Layered),
            ..PLAIN
        },
        Effect::Transmission => Row {
            constant: Some("HAS_TRANSMISSION"),
            needed: |facts| facts.layered("transmissive", |of| of.transmission > 0.0, "no transmission"),
            remove: |scene| each_layers(scene, |of| of.transmission = 0.0),
            ..PLAIN
        },
        Effect::DiffuseTransmission => Row {
            constant: Some("HAS_DIFFUSE_TRANSMISSION"),
            needed: |facts| facts.layered("translucent", |of| of.diffuse_transmission > 0.0, "no diffuse transmission"),
            remove: |scene| each_layers(scene, |of| of.diffuse_transmission = 0.0),
            ..PLAIN
        },
        Effect::Iridescence => Row {
            constant: Some("HAS_IRIDESCENCE"),
            needed: |facts| facts.layered("iridescent", |of| of.iridescence > 0.0, "no iridescence"),
            remove: |scene| each_layers(scene, |of| of.iridescence = 0.0),
            ..PLAIN
        },
        Effect::Anisotropy => Row {
            constant: Some("HAS_ANISOTROPY"),
            needed: |facts| facts.layered("anisotropic", |of| of.anisotropy > 0.0, "no anisotropy"),
            remove: |scene| each_layers(scene, |of| of.anisotropy = 0.0),
            ..PLAIN
        },
        Effect::Media => Row {
            constant: Some("HAS_MEDIA"),
            needed: media,
            remove: |scene| each_layers(scene, |of| of.medium = of.medium.map(|_| Medium::CLEAR)),
            ..PLAIN
        },
        Effect::Dispersion => Row {
            constant: Some("HAS_DISPERSION"),
            needed: |facts| facts.found("dispersive", Material::is_dispersive, "no dispersion"),
            remove: |scene| each_layers(scene, |of| of.dispersion = 0.0),
            ..PLAIN
        },
        Effect::ClearCoat => Row {
            constant: Some("HAS_COATS"),
            needed: |facts| facts.layered("clear-coated", |of| of.coat > 0.0, "no clear coat"),
            remove: |scene| each_layers(scene, |of| of.coat = 0.0),
            ..PLAIN
        },
        Effect::Sheen => Row {
            constant: Some("HAS_SHEEN"),
            needed: |facts| facts.layered("with sheen", |of| of.sheen_colour != Vec3::ZERO, "no sheen"),
            remove: |scene| each_layers(scene, |of| of.sheen_colour = Vec3::ZERO),
            ..PLAIN
        },
        Effect::NormalMaps => Row {
            constant: Some("HAS_NORMAL_MAPS"),
            needed: |facts| facts.found("with normal maps", has_normal_map, "no normal map"),
            remove: |scene| {
                each_material(scene, |material| {
                    material.normal_map = None;
                    material.layers.coat_normal_map = None;
                });
            },
            ..PLAIN
        },
        Effect::Alpha => Row {
            needed: |facts| {
                let has_gaps = |material: &Material| is_layered_with(material, |_| material.coverage != Coverage::Whole);
                facts.found("with alpha", has_gaps, "no transparency by alpha")
            },
            remove: |scene| each_material(scene, |material| material.coverage = Coverage::Whole),
            ..PLAIN
        },
        Effect::ReflectiveCaustics => Row {
            needed: |facts| facts.caustic("mirror", is_mirror),
            cost: of_caustic_map,
            measured: Some(Measured { pass: Some("round/caustic"), part: 2 }),
            ..PLAIN
        },
        Effect::RefractiveCaustics => Row {
            needed: |facts| facts.caustic("dielectric", |_, kinds| kinds.sharp_transmission),
            cost: of_caustic_map,
            measured: Some(Measured { pass: Some("round/caustic"), part: 2 }),
            ..PLAIN
        },
        Effect::SpecularChains => Row {
            constant: Some("HAS_SPECULAR_CHAINS"),
            needed: |facts| match facts.named(|_, kinds| kinds.is_sharp()) {
                Some(names) => (true, format!("specular: {names}")),
                None => (false, "no mirror and no dielectric material".into()),
            },
            measured: Some(Measured { pass: None, part: 1 }),
            ..PLAIN
        },
        Effect::Textures => Row {
            constant: Some("HAS_TEXTURES"),
            needed: |facts| facts.found("textured", |material| material.textures().next().is_some(), "no textured material"),
            remove: |scene| {
                each_material(scene, |material| {
                    material.base_colour_texture = None;
                    material.emission_texture = None;
                    material.normal_map = None;
                    material.layers = material.layers.without_textures();
                });
            },
            cost: |_, geometry| of_bytes(size_of_val(geometry.uvs.as_slice()) + size_of_val(geometry.texels.as_slice())),
            ..PLAIN
        },
        Effect::VertexColours => Row {
            constant: Some("HAS_VERTEX_COLOURS"),
            needed: |facts| match facts.coloured {
                0 => (false, "no vertex colours".into()),
                count => (true, format!("vertex colours on {}", counted(count, "triangle"))),
            },
            remove: |scene| {
                scene.meshes.iter_mut().for_each(|mesh| {
                    mesh.colours.clear();
                    mesh.alphas.clear();
                });
            },
            cost: |_, geometry| of_bytes(size_of_val(geometry.colours.as_slice())),
            ..PLAIN
        },
        Effect::Environment => Row {
            constant: Some("HAS_ENVIRONMENT"),
            needed: |facts| facts.lights(&[EMITTER_ENVIRONMENT], "environment light"),
            remove: |scene| remove_lights(scene, LightKind::is_environment),
            cost: of_openings,
            ..PLAIN
        },
        Effect::MeshLights => Row {
            constant: Some("HAS_TRIANGLE_LIGHTS"),
            needed: |facts| facts.lights(&[EMITTER_TRIANGLE], "emissive triangle"),
            remove: |scene| each_material(scene, |material| material.emission = Vec3::ZERO),
            ..PLAIN
        },
        Effect::PointLights => Row {
            constant: Some("HAS_POINT_LIGHTS"),
            needed: |facts| facts.lights(&[EMITTER_POINT], "point light"),
            remove: |scene| remove_lights(scene, |kind| matches!(kind, LightKind::Point { .. })),
            ..PLAIN
        },
        Effect::SpotLights => Row {
            constant: Some("HAS_SPOT_LIGHTS"),
            needed: |facts| facts.lights(&[EMITTER_SPOT], "spot light"),
            remove: |scene| remove_lights(scene, |kind| matches!(kind, LightKind::Spot { .. })),
            ..PLAIN
        },
        Effect::DirectionalLights => Row {
            constant: Some("HAS_DIRECTIONAL_LIGHTS"),
            needed: |facts| facts.lights(&[EMITTER_DIRECTIONAL], "directional light"),
            remove: |scene| remove_lights(scene, |kind| matches!(kind, LightKind::Directional { .. })),
            cost: of_openings,
            ..PLAIN
        },
        Effect::DiscLights => Row {
            constant: Some("HAS_DISC_LIGHTS"),
            needed: |facts| facts.lights(&[EMITTER_DISC_COSINE, EMITTER_DISC_UNIFORM], "disc light"),
            remove: |scene| remove_lights(scene, |kind| matches!(kind, LightKind::Disc { .. })),
            ..PLAIN
        },
        Effect::Bvh => Row {
            constant: Some("HAS_BVH"),
            needed: |facts| match counted(facts.triangles, "triangle") {
                triangles if facts.triangles <= LIST_TRIANGLES => (false, format!("only {triangles}: testing each of them is as fast")),
                triangles => (true, triangles),
            },
            cost: |_, geometry| of_bytes(size_of_val(geometry.nodes.as_slice())),
            ..PLAIN
        },
        Effect::TwoSided => Row {
            constant: Some("HAS_TWO_SIDED"),
            needed: |facts| facts.found("two-sided", Material::has_two_sides, "no two-sided material"),
            remove: |scene| {
                each_material(scene, |material| {
                    // The eye sees no back of a file's surfaces, and a black one of built-in ones.
                    material.surface = if material.is_lambertian() { Surface::Layered } else { material.surface };
                    material.two_sided = false;
                });
            },
            ..PLAIN
        },
        Effect::SmoothNormals => Row {
            constant: Some("HAS_SMOOTH_NORMALS"),
            needed: |facts| match facts.smooth {
                // A mapped normal is none of the triangle's, as a smooth one.
                _ if (row(Effect::NormalMaps).needed)(facts).0 => (true, "normal maps".into()),
                0 => (false, "no smooth normals".into()),
                count => (true, format!("{} with smooth normals", counted(count, "triangle"))),
            },
            cost: |_, geometry| of_bytes(size_of_val(geometry.normals.as_slice())),
            ..PLAIN
        },
    }
}

fn direct(facts: &Facts) -> Evidence {
    match facts.part {
        _ if !facts.is_lit() => (false, "no light source".into()),
        _ if !facts.receives() && !facts.has_kind(|kinds| kinds.has_width) => (false, "no diffuse or glossy surface".into()),
        Part::Caustic => (false, "only caustics were asked for".into()),
        Part::Indirect if !facts.gathers => (false, "only indirect light was asked for".into()),
        Part::Indirect => (true, "final-gather rays need direct light where they end".into()),
        _ => (true, format!("{}, and diffuse or glossy surfaces", counted(facts.light_count(), "light source"))),
    }
}

fn indirect(facts: &Facts) -> Evidence {
    // What a layered surface reflects beside its colour is light, too.
    let is_bright = |material: &Material| {
        !material.is_not_there() && (material.surface == Surface::Layered || material.base_colour.max_element() > 0.0)
    };
    match facts.named(|material, kinds| kinds.rough && is_bright(material)) {
        _ if !facts.is_lit() => (false, "no light source".into()),
        _ if !facts.receives() => (false, "no diffuse or glossy surface".into()),
        _ if !facts.wants(Part::Indirect) => facts.only_another_part(),
        Some(names) => (true, format!("diffuse or glossy: {names}")),
        None => (false, "every diffuse or glossy surface is black".into()),
    }
}

fn media(facts: &Facts) -> Evidence {
    match facts.named(|material, _| material.enclosed_medium().is_some_and(|of| of.transmittance != Vec3::ONE)) {
        Some(names) => (true, format!("absorbing: {names}")),
        None if facts.nested_solids => (true, "solids that may lie in one another".into()),
        None => (false, "no medium that absorbs, and no solids in one another".into()),
    }
}

fn is_glossy(surface: Surface) -> bool {
    matches!(surface, Surface::Glossy { .. })
}

fn is_mirror(material: &Material, kinds: LobeKinds) -> bool {
    kinds.sharp_reflection && !matches!(material.surface, Surface::Dielectric { .. })
}

fn has_normal_map(material: &Material) -> bool {
    is_layered_with(material, |of| material.normal_map.is_some() || (of.coat > 0.0 && of.coat_normal_map.is_some()))
}

fn each_material(scene: &mut Scene, change: impl Fn(&mut Material)) {
    scene.materials.iter_mut().for_each(change);
}

fn each_layers(scene: &mut Scene, change: impl Fn(&mut Layers)) {
    each_material(scene, |material| change(&mut material.layers));
}

fn make_lambert(scene: &mut Scene, is: impl Fn(Surface) -> bool) {
    scene.materials.iter_mut().filter(|material| is(material.surface)).for_each(|material| material.surface = Surface::Lambert);
}

fn remove_lights(scene: &mut Scene, is: impl Fn(&LightKind) -> bool) {
    scene.lights.retain(|light| !is(&light.kind));
}

fn of_bytes(bytes: usize) -> Cost {
    Cost { bytes: bytes as u64, ..Cost::default() }
}

fn of_map(map: Option<&MapPlan>) -> Cost {
    map.map_or_else(Cost::default, |map| Cost {
        photons: map.photons.into(),
        bytes: u64::from(map.capacity) * MAP_ENTRY_BYTES + u64::from(map.bucket_count) * 4,
        words: String::new(),
    })
}

fn of_caustic_map(plan: &ScenePlan, _: &Geometry) -> Cost {
    let words = match (&plan.caustic, plan.targets.len()) {
        (None, _) => String::new(),
        (_, 0) => "; photons emitted in all directions".into(),
        (_, count) => format!("; photons aimed at {}", counted(count, "bounding sphere")),
    };
    Cost { words, ..of_map(plan.caustic.as_ref()) }
}

fn of_openings(plan: &ScenePlan, _: &Geometry) -> Cost {
    let words = match plan.trial.as_ref().map_or(0, |trial| trial.openings.len()) {
        0 => String::new(),
        count => format!("; rays and photons aimed at {}", counted(count, "opening")),
    };
    Cost { words, ..Cost::default() }
}

pub(super) fn decide(effect: Effect, facts: &Facts, settings: &SceneSettings) -> EffectDecision {
    let (needed, evidence) = (row(effect).needed)(facts);
    let kept = (needed || settings.forces(effect)) && !settings.leaves_out(effect);
    let evidence = match (needed, kept) {
        (true, false) => format!("left out by `without`, although the scene needs it: {evidence}"),
        (false, true) => format!("forced by `with`: {evidence}"),
        _ => evidence,
    };
    EffectDecision { effect, kept, needed, evidence, photons: 0, bytes: 0 }
}

/// A decision with what the plan has for its effect, and what became of it.
pub(super) fn with_cost(decision: &EffectDecision, plan: &ScenePlan, geometry: &Geometry) -> EffectDecision {
    let mut decision = decision.clone();
    if decision.kept {
        let Cost { photons, bytes, words } = (row(decision.effect).cost)(plan, geometry);
        decision.evidence.push_str(&words);
        (decision.photons, decision.bytes) = (photons, bytes);
    }
    decision
}

/// Specialization constants that say which effects are kept.
pub(super) fn constants(simulates: &dyn Fn(Effect) -> bool) -> Vec<(&'static str, u32)> {
    Effect::ALL.into_iter().filter_map(|effect| Some((row(effect).constant?, u32::from(simulates(effect))))).collect()
}

pub(crate) fn measured(effect: Effect) -> Option<Measured> {
    row(effect).measured
}

impl Scene {
    /// The scene without what some effects would need.
    pub fn without(&self, effects: &[Effect]) -> Cow<'_, Scene> {
        if effects.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut scene = self.clone();
        effects.iter().for_each(|effect| (row(*effect).remove)(&mut scene));
        Cow::Owned(scene)
    }
}
