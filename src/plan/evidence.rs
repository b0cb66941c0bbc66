//! The effects that a scene of triangles needs: each with the evidence for keeping or dropping it.

use glam::{DVec3, Vec3};
use serde::Serialize;

use super::sensor::Sensor;
use crate::constants::*;
use crate::scene::geometry::Geometry;
use crate::scene::material::{Coverage, Layers};
use crate::scene::{LobeKinds, Material, Mesh, Scene, Surface};
use crate::settings::scene::{Effect, Illumination, Part, SceneSettings};
use crate::text::counted;

/// One effect, kept or dropped, with the evidence.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct EffectDecision {
    pub effect: Effect,
    pub kept: bool,
    /// What the scene and the request say, whatever was forced.
    pub needed: bool,
    pub evidence: String,
    /// Photons of a round that are traced for it.
    pub photons: u64,
    /// Device memory that exists for it alone.
    pub bytes: u64,
}

/// Triangles up to which a list is tested from end to end instead of a tree.
const LIST_TRIANGLES: usize = 24;
/// What the scene holds and the request asks for.
pub(super) struct Facts<'a> {
    /// Those that some triangle has.
    materials: Vec<(&'a Material, LobeKinds)>,
    emitters: [usize; 7],
    triangles: usize,
    smooth: usize,
    coloured: usize,
    /// Bounds of transmissive solids overlap.
    nested_solids: bool,
    part: Part,
    is_picture: bool,
    /// Some indirect light comes by a gather ray, at whose end there is light of all kinds.
    gathers: bool,
}

impl<'a> Facts<'a> {
    pub(super) fn new(scene: &'a Scene, geometry: &Geometry, settings: &SceneSettings, sensor: Sensor) -> Facts<'a> {
        let mut used = vec![false; scene.materials.len()];
        geometry.triangles.iter().for_each(|triangle| used[triangle.material as usize] = true);
        let mut emitters = [0; 7];
        let shining = scene.meshes.iter().filter(|mesh| scene.materials[mesh.material].is_emissive());
        emitters[EMITTER_TRIANGLE as usize] = shining.map(|mesh| mesh.triangles.len()).sum();
        scene.lights.iter().for_each(|light| emitters[light.kind.code() as usize] += 1);
        let glossy = scene.materials.iter().zip(&used).any(|(material, used)| *used && matches!(material.surface, Surface::Glossy { .. }));
        Facts {
            materials: scene.materials.iter().zip(scene.lobe_kinds()).zip(used).filter(|(_, used)| *used).map(|(of, _)| of).collect(),
            emitters,
            triangles: geometry.triangles.len(),
            smooth: geometry.normals.iter().filter(|normals| normals.a != NONE).count(),
            coloured: scene
                .meshes
                .iter()
                .filter(|mesh| !mesh.colours.is_empty() || !mesh.alphas.is_empty())
                .map(|mesh| mesh.triangles.len())
                .sum(),
            nested_solids: has_nested_solids(scene),
            part: settings.part,
            is_picture: matches!(sensor, Sensor::Picture { .. }),
            gathers: settings.final_gather || glossy && settings.illumination == Illumination::Split,
        }
    }

    pub(super) fn has(&self, is: impl Fn(Surface) -> bool) -> bool {
        self.materials.iter().any(|(material, _)| is(material.surface))
    }

    pub(super) fn has_layer_textures(&self) -> bool {
        self.materials.iter().any(|(material, _)| material.has_layer_textures())
    }

    pub(super) fn has_kind(&self, is: impl Fn(LobeKinds) -> bool) -> bool {
        self.materials.iter().any(|(_, kinds)| is(*kinds))
    }

    /// Names of the materials that `is` holds for, at most three of them.
    fn named(&self, is: impl Fn(&Material, LobeKinds) -> bool) -> Option<String> {
        let found = self.materials.iter().filter(|(material, kinds)| is(material, *kinds));
        let names: Vec<&str> = found.map(|(material, _)| material.name.as_str()).collect();
        match names.as_slice() {
            [] => None,
            [first, second, _, _, ..] => Some(format!("{first}, {second} and {} more", names.len() - 2)),
            few => Some(few.join(", ")),
        }
    }

    pub(super) fn decide(&self, effect: Effect, settings: &SceneSettings) -> EffectDecision {
        let (needed, evidence) = self.evidence(effect);
        let kept = (needed || settings.forces(effect)) && !settings.leaves_out(effect);
        let evidence = match (needed, kept) {
            (true, false) => format!("left out by `without`, although the scene needs it: {evidence}"),
            (false, true) => format!("forced by `with`: {evidence}"),
            _ => evidence,
        };
        EffectDecision { effect, kept, needed, evidence, photons: 0, bytes: 0 }
    }

    fn evidence(&self, effect: Effect) -> (bool, String) {
        let lit = self.emitters.iter().sum::<usize>() > 0;
        let wants = |part: Part| self.part == Part::All || self.part == part || (self.is_picture && self.part == Part::Specular);
        let mirrors = self.named(|material, kinds| kinds.sharp_reflection && !matches!(material.surface, Surface::Dielectric { .. }));
        let glass = self.named(|_, kinds| kinds.sharp_transmission);
        // Photons are of use where something scatters them to a sensor.
        let receives = !self.is_picture || self.has_kind(|kinds| kinds.matt);
        let some = |count: usize, what: &str| match count {
            0 => (false, format!("no {what}")),
            count => (true, counted(count, what)),
        };
        let lights = |kind: u32, what: &str| some(self.emitters[kind as usize], &format!("{what} light"));
        let found = |what: &str, is: &dyn Fn(&Material) -> bool, absent: &str| match self.named(|material, _| is(material)) {
            Some(names) => (true, format!("{what}: {names}")),
            None => (false, absent.to_owned()),
        };
        let caustic = |found: &Option<String>, what: &str| match found {
            None => (false, format!("no {what} material")),
            Some(_) if !lit => (false, "no light source".into()),
            Some(_) if !receives => (false, "no diffuse or glossy surface to show a caustic".into()),
            Some(_) if !(wants(Part::Caustic) || (self.part == Part::Indirect && self.gathers)) => {
                (false, format!("only {:?} light was asked for", self.part).to_lowercase())
            }
            Some(names) => (true, format!("{what}: {names}")),
        };
        match effect {
            Effect::Direct if !lit => (false, "no light source".into()),
            Effect::Direct if !receives && !self.has_kind(|kinds| kinds.has_width) => (false, "no diffuse or glossy surface".into()),
            Effect::Direct if self.part == Part::Caustic => (false, "only caustics were asked for".into()),
            Effect::Direct if self.part == Part::Indirect && !self.gathers => (false, "only indirect light was asked for".into()),
            Effect::Direct if self.part == Part::Indirect => (true, "final-gather rays need direct light where they end".into()),
            Effect::Direct => {
                (true, format!("{}, and diffuse or glossy surfaces", counted(self.emitters.iter().sum::<usize>(), "light source")))
            }
            Effect::Indirect if !lit => (false, "no light source".into()),
            Effect::Indirect if !receives => (false, "no diffuse or glossy surface".into()),
            Effect::Indirect if !wants(Part::Indirect) => (false, format!("only {:?} light was asked for", self.part).to_lowercase()),
            Effect::Indirect => {
                // What a layered surface reflects beside its colour is light, too.
                let is_bright = |material: &Material| {
                    !material.is_not_there() && (material.surface == Surface::Layered || material.base_colour.max_element() > 0.0)
                };
                match self.named(|material, kinds| kinds.matt && is_bright(material)) {
                    Some(names) => (true, format!("diffuse or glossy: {names}")),
                    None => (false, "every diffuse or glossy surface is black".into()),
                }
            }
            Effect::Glossy => found("glossy", &|material| matches!(material.surface, Surface::Glossy { .. }), "no glossy material"),
            Effect::ReflectiveCaustics => caustic(&mirrors, "mirror"),
            Effect::RefractiveCaustics => caustic(&glass, "dielectric"),
            Effect::Layers => found("layered", &|material| material.surface == Surface::Layered, "no glTF material"),
            Effect::Transmission => {
                found("transmissive", &|material| is_layered_with(material, |of| of.transmission > 0.0), "no transmission")
            }
            Effect::Media => match self.named(|material, _| material.enclosed_medium().is_some_and(|of| of.transmittance != Vec3::ONE)) {
                Some(names) => (true, format!("absorbing: {names}")),
                None if self.nested_solids => (true, "solids that may lie in one another".into()),
                None => (false, "no medium that absorbs, and no solids in one another".into()),
            },
            Effect::DiffuseTransmission => {
                let is_found = |material: &Material| is_layered_with(material, |of| of.diffuse_transmission > 0.0);
                found("translucent", &is_found, "no diffuse transmission")
            }
            Effect::Anisotropy => found("anisotropic", &|material| is_layered_with(material, |of| of.anisotropy > 0.0), "no anisotropy"),
            Effect::Iridescence => found("iridescent", &|material| is_layered_with(material, |of| of.iridescence > 0.0), "no iridescence"),
            Effect::Dispersion => found("dispersive", &Material::is_dispersive, "no dispersion"),
            Effect::ClearCoat => found("clear-coated", &|material| is_layered_with(material, |of| of.coat > 0.0), "no clear coat"),
            Effect::Sheen => found("with sheen", &|material| is_layered_with(material, |of| of.sheen_colour != Vec3::ZERO), "no sheen"),
            Effect::NormalMaps => {
                let has_map = |material: &Material| {
                    is_layered_with(material, |of| material.normal_map.is_some() || (of.coat > 0.0 && of.coat_normal_map.is_some()))
                };
                found("with normal maps", &has_map, "no normal map")
            }
            Effect::Alpha => {
                let has_gaps = |material: &Material| is_layered_with(material, |_| material.coverage != Coverage::Whole);
                found("with alpha", &has_gaps, "no transparency by alpha")
            }
            Effect::SpecularChains => match self.named(|_, kinds| kinds.is_sharp()) {
                Some(names) => (true, format!("specular: {names}")),
                None => (false, "no mirror and no dielectric material".into()),
            },
            Effect::Textures => found("textured", &|material| material.textures().next().is_some(), "no textured material"),
            Effect::VertexColours => match self.coloured {
                0 => (false, "no vertex colours".into()),
                count => (true, format!("vertex colours on {}", counted(count, "triangle"))),
            },
            Effect::Environment => lights(EMITTER_ENVIRONMENT, "environment"),
            Effect::MeshLights => some(self.emitters[EMITTER_TRIANGLE as usize], "emissive triangle"),
            Effect::PointLights => lights(EMITTER_POINT, "point"),
            Effect::SpotLights => lights(EMITTER_SPOT, "spot"),
            Effect::DirectionalLights => lights(EMITTER_DIRECTIONAL, "directional"),
            Effect::DiscLights => {
                some(self.emitters[EMITTER_DISC_COSINE as usize] + self.emitters[EMITTER_DISC_UNIFORM as usize], "disc light")
            }
            Effect::Bvh if self.triangles <= LIST_TRIANGLES => {
                (false, format!("only {}: testing each of them is as fast", counted(self.triangles, "triangle")))
            }
            Effect::Bvh => (true, counted(self.triangles, "triangle")),
            Effect::TwoSided => found("two-sided", &Material::has_two_sides, "no two-sided material"),
            // A mapped normal is none of the triangle's, as a smooth one.
            Effect::SmoothNormals if self.evidence(Effect::NormalMaps).0 => (true, "normal maps".into()),
            Effect::SmoothNormals if self.smooth == 0 => (false, "no smooth normals".into()),
            Effect::SmoothNormals => (true, format!("{} with smooth normals", counted(self.smooth, "triangle"))),
        }
    }
}

/// Whether the bounds of two meshes that enclose media overlap.
fn has_nested_solids(scene: &Scene) -> bool {
    let solids = scene.meshes.iter().filter(|mesh| scene.materials[mesh.material].enclosed_medium().is_some());
    let bounds = |mesh: &Mesh| {
        let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        mesh.positions.iter().fold(nothing, |(min, max), at| (min.min(*at), max.max(*at)))
    };
    let mut bounds: Vec<(DVec3, DVec3)> = solids.map(bounds).collect();
    // Along one axis, those that begin before another ends.
    bounds.sort_by(|a, b| a.0.x.total_cmp(&b.0.x));
    bounds.iter().enumerate().any(|(place, (_, max))| {
        let after = bounds[place + 1..].iter().take_while(|other| other.0.x <= max.x);
        after.into_iter().any(|other| other.0.cmple(*max).all() && bounds[place].0.cmple(other.1).all())
    })
}

fn is_layered_with(material: &Material, has: impl Fn(&Layers) -> bool) -> bool {
    material.surface == Surface::Layered && !material.layers.is_unlit && has(&material.layers)
}
