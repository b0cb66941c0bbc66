//! What a scene of triangles holds and a request asks for, as evidence for keeping or dropping effects.

use glam::DVec3;
use serde::Serialize;

use super::sensor::Sensor;
use crate::constants::*;
use crate::scene::geometry::Geometry;
use crate::scene::material::Layers;
use crate::scene::{LobeKinds, Material, Mesh, Scene, Surface};
use crate::settings::scene::{Effect, Illumination, Part, SceneSettings};
use crate::text::counted;

/// One effect, kept or dropped, with the evidence.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct EffectDecision {
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

/// Whether an effect is needed, and why.
pub(super) type Evidence = (bool, String);

/// What the scene holds and the request asks for.
pub(super) struct Facts<'a> {
    /// Those that some triangle has.
    materials: Vec<(&'a Material, LobeKinds)>,
    emitters: [usize; 7],
    pub(super) triangles: usize,
    pub(super) smooth: usize,
    pub(super) coloured: usize,
    /// Bounds of transmissive solids overlap.
    pub(super) nested_solids: bool,
    pub(super) part: Part,
    is_picture: bool,
    /// Some indirect light comes by a gather ray, at whose end there is light of all kinds.
    pub(super) gathers: bool,
    /// Surfaces with two sides are asked to have one.
    pub(super) has_one_sides: bool,
}

impl<'a> Facts<'a> {
    pub(super) fn new(scene: &'a Scene, geometry: &Geometry, settings: &SceneSettings, sensor: Sensor) -> Facts<'a> {
        let mut used = vec![false; scene.materials.len()];
        geometry.triangles.iter().for_each(|triangle| used[triangle.material as usize] = true);
        let mut emitters = [0; 7];
        let emissive = scene.meshes.iter().filter(|mesh| scene.materials[mesh.material].is_emissive());
        emitters[EMITTER_TRIANGLE as usize] = emissive.map(|mesh| mesh.triangles.len()).sum();
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
            has_one_sides: settings.without.contains(&Effect::TwoSided),
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
    pub(super) fn named(&self, is: impl Fn(&Material, LobeKinds) -> bool) -> Option<String> {
        let found = self.materials.iter().filter(|(material, kinds)| is(material, *kinds));
        let names: Vec<&str> = found.map(|(material, _)| material.name.as_str()).collect();
        match names.as_slice() {
            [] => None,
            [first, second, _, _, ..] => Some(format!("{first}, {second} and {} more", names.len() - 2)),
            few => Some(few.join(", ")),
        }
    }

    pub(super) fn is_lit(&self) -> bool {
        self.light_count() > 0
    }

    pub(super) fn light_count(&self) -> usize {
        self.emitters.iter().sum()
    }

    /// Whether a part is asked for, or seen in mirrors and through glass.
    pub(super) fn wants(&self, part: Part) -> bool {
        self.part == Part::All || self.part == part || (self.is_picture && self.part == Part::Specular)
    }

    /// Photons are of use where something scatters them to a sensor.
    pub(super) fn receives(&self) -> bool {
        !self.is_picture || self.has_kind(|kinds| kinds.rough)
    }

    /// Needed if some material is so.
    pub(super) fn found(&self, what: &str, is: impl Fn(&Material) -> bool, absent: &str) -> Evidence {
        match self.named(|material, _| is(material)) {
            Some(names) => (true, format!("{what}: {names}")),
            None => (false, absent.to_owned()),
        }
    }

    /// Needed if some layered material is so.
    pub(super) fn layered(&self, what: &str, is: impl Fn(&Layers) -> bool, absent: &str) -> Evidence {
        self.found(what, |material| is_layered_with(material, &is), absent)
    }

    /// Needed if there are emitters of these kinds.
    pub(super) fn lights(&self, kinds: &[u32], what: &str) -> Evidence {
        let count: usize = kinds.iter().map(|kind| self.emitters[*kind as usize]).sum();
        if count == 0 { (false, format!("no {what}")) } else { (true, counted(count, what)) }
    }

    /// Needed if these materials make caustics that are asked for.
    pub(super) fn caustic(&self, what: &str, makes: impl Fn(&Material, LobeKinds) -> bool) -> Evidence {
        match self.named(makes) {
            None => (false, format!("no {what} material")),
            Some(_) if !self.is_lit() => (false, "no light source".into()),
            Some(_) if !self.receives() => (false, "no diffuse or glossy surface to show a caustic".into()),
            Some(_) if !(self.wants(Part::Caustic) || (self.part == Part::Indirect && self.gathers)) => self.only_another_part(),
            Some(names) => (true, format!("{what}: {names}")),
        }
    }

    pub(super) fn only_another_part(&self) -> Evidence {
        (false, format!("only {:?} light was asked for", self.part).to_lowercase())
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

pub(super) fn is_layered_with(material: &Material, has: impl Fn(&Layers) -> bool) -> bool {
    material.surface == Surface::Layered && !material.layers.is_unlit && has(&material.layers)
}
