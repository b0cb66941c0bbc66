//! The effects that a scene of triangles needs: each with the evidence for keeping or dropping it.

use serde::Serialize;

use super::sensor::Sensor;
use crate::constants::*;
use crate::scene::geometry::Geometry;
use crate::scene::{Material, Scene, Surface};
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
    materials: Vec<&'a Material>,
    emitters: [usize; 7],
    triangles: usize,
    smooth: usize,
    coloured: usize,
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
            materials: scene.materials.iter().zip(used).filter(|(_, used)| *used).map(|(material, _)| material).collect(),
            emitters,
            triangles: geometry.triangles.len(),
            smooth: geometry.normals.iter().filter(|normals| normals.a != NONE).count(),
            coloured: scene.meshes.iter().filter(|mesh| !mesh.colours.is_empty()).map(|mesh| mesh.triangles.len()).sum(),
            part: settings.part,
            is_picture: matches!(sensor, Sensor::Picture { .. }),
            gathers: settings.final_gather || glossy && settings.illumination == Illumination::Split,
        }
    }

    pub(super) fn has(&self, is: impl Fn(Surface) -> bool) -> bool {
        self.materials.iter().any(|material| is(material.surface))
    }

    /// Names of the materials that `is` holds for, at most three of them.
    fn named(&self, is: impl Fn(&Material) -> bool) -> Option<String> {
        let names: Vec<&str> = self.materials.iter().filter(|material| is(material)).map(|material| material.name.as_str()).collect();
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
            (true, false) => format!("left out by --without, although the scene needs it: {evidence}"),
            (false, true) => format!("forced by --with: {evidence}"),
            _ => evidence,
        };
        EffectDecision { effect, kept, needed, evidence, photons: 0, bytes: 0 }
    }

    fn evidence(&self, effect: Effect) -> (bool, String) {
        let lit = self.emitters.iter().sum::<usize>() > 0;
        let wants = |part: Part| self.part == Part::All || self.part == part || (self.is_picture && self.part == Part::Specular);
        let mirrors = self.named(|material| material.surface == Surface::Mirror);
        let glass = self.named(|material| matches!(material.surface, Surface::Dielectric { .. }));
        // Photons are of use where something scatters them to a sensor.
        let receives = !self.is_picture || self.has(|surface| !surface.is_specular());
        let some = |count: usize, what: &str| match count {
            0 => (false, format!("no {what}")),
            count => (true, counted(count, what)),
        };
        let lights = |kind: u32, what: &str| some(self.emitters[kind as usize], &format!("{what} light"));
        let found = |what: &str, is: &dyn Fn(&Material) -> bool, absent: &str| match self.named(is) {
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
            Effect::Direct if !receives => (false, "no diffuse or glossy surface".into()),
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
                let is_bright = |material: &Material| !material.surface.is_specular() && material.base_colour.max_element() > 0.0;
                found("diffuse or glossy", &is_bright, "every diffuse or glossy surface is black")
            }
            Effect::Glossy => found("glossy", &|material| matches!(material.surface, Surface::Glossy { .. }), "no glossy material"),
            Effect::ReflectiveCaustics => caustic(&mirrors, "mirror"),
            Effect::RefractiveCaustics => caustic(&glass, "dielectric"),
            Effect::SpecularChains => found("specular", &|material| material.surface.is_specular(), "no mirror and no dielectric material"),
            Effect::Textures => {
                let is_textured = |of: &Material| of.base_colour_texture.is_some() || of.emission_texture.is_some();
                found("textured", &is_textured, "no textured material")
            }
            Effect::VertexColours => some(self.coloured, "triangle with vertex colours"),
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
            Effect::TwoSided => found("two-sided", &|material| material.two_sided, "no two-sided material"),
            Effect::SmoothNormals if self.smooth == 0 => (false, "no smooth normals".into()),
            Effect::SmoothNormals => (true, format!("{} with smooth normals", counted(self.smooth, "triangle"))),
        }
    }
}
