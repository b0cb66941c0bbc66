//! What is to be said of a scene's geometry: places that single precision moves, and surfaces that overlap.

use std::cell::LazyCell;
use std::collections::BTreeSet;

use glam::DVec3;
use rayon::prelude::*;

use super::{Geometry, PLACE_ERROR, turns};
use crate::scene::{Light, LightKind, Mesh, Scene};
use crate::text::{counted, in_metres, some_of};

impl Geometry {
    /// How far single precision moves a place, metres.
    pub(crate) fn place_error(&self, position: DVec3) -> f64 {
        (self.to_world(self.to_local(position)) - position).abs().max_element()
    }

    /// That some places, of points or of a camera, are moved so far that it shows.
    pub(crate) fn place_warning(&self, what: &str, positions: impl IntoIterator<Item = DVec3>) -> Option<String> {
        let most = positions.into_iter().map(|position| self.place_error(position)).fold(0.0, f64::max);
        (most > PLACE_ERROR).then(|| {
            format!("{what}: off by up to {} in single precision, so far from the middle of the scene; go nearer to it", in_metres(most))
        })
    }

    /// Meshes whose vertices single precision moves so far that it shows, and how far at most; nothing of scenes that are not kilometres
    /// wide.
    fn rounded_meshes(&self, scene: &Scene) -> (Vec<u32>, f64) {
        // Half the step of the largest numbers.
        if self.unit * 0.5 * f64::from(f32::EPSILON) * 0.25 <= PLACE_ERROR {
            return (Vec::new(), 0.0);
        }
        let of_mesh = |mesh: &Mesh| mesh.positions.iter().map(|position| self.place_error(*position)).fold(0.0, f64::max);
        let errors: Vec<f64> = scene.meshes.par_iter().map(of_mesh).collect();
        let rounded = (0..).zip(&errors).filter(|(_, error)| **error > PLACE_ERROR).map(|(mesh, _)| mesh).collect();
        (rounded, errors.into_iter().fold(0.0, f64::max))
    }

    /// A line for triangles that are left out, for each pair of meshes that overlap in one plane, and for what is too many to be treated as it should.
    pub(crate) fn warnings(&self, scene: &Scene) -> Vec<String> {
        const MOST: usize = 5;
        let names = LazyCell::new(|| scene.mesh_names());
        let name = |mesh: u32| &names[mesh as usize];
        let line = |&(hidden, seen): &(u32, u32)| {
            if hidden == seen {
                return format!("mesh {:?} overlaps itself in one plane; what overlaps counts once", name(hidden));
            }
            format!("meshes {:?} and {:?} overlap in one plane; only {:?} counts there", name(hidden), name(seen), name(seen))
        };
        let mut lines: Vec<String> = Vec::new();
        if self.left_out > 0 {
            let count = counted(self.left_out, "triangle");
            lines.push(format!("{count} without area in single precision, or on others, left out"));
        }
        if let Some(mesh) = self.hidden_solid {
            lines.push(format!(
                "solids lie partly in one another, and light may be lost there: what is around mesh {} shares its material with smaller solids; \
                 give these a material of their own whose index of refraction differs by 0.001",
                name(mesh)
            ));
        }
        let (rounded, most) = self.rounded_meshes(scene);
        if !rounded.is_empty() {
            lines.push(format!(
                "the scene is {:.0} m wide, and single precision moves places in it by up to {} (mesh {}); leave out \
                 what stands far from the rest, or render parts on their own",
                2.0 * self.radius * self.unit / 1.001,
                in_metres(most),
                some_of(rounded.iter().map(|mesh| name(*mesh)))
            ));
        }
        let place_of = |light: &Light| match light.kind {
            LightKind::Point { position, .. } | LightKind::Spot { position, .. } | LightKind::Disc { centre: position, .. } => {
                Some(position)
            }
            LightKind::Directional { .. } | LightKind::Environment { .. } | LightKind::Sky(_) => None,
        };
        lines.extend(scene.lights.iter().filter_map(|light| self.place_warning(&light.name, place_of(light))));
        if let Some(warning) = turns::warning(scene) {
            lines.push(warning);
        }
        lines.extend(self.overlaps.iter().take(MOST).map(line));
        if self.uncut > 0 {
            lines.push(format!(
                "{} among more than 64 others that overlap each other in one plane; light there may count more than once",
                counted(self.uncut, "triangle")
            ));
        }
        if self.coarse_pieces > 0 {
            lines.push(format!(
                "{} of textured lamps have spots much brighter than their mean, more than can be told apart; their light is noisy, and may be missed in few rounds",
                counted(self.coarse_pieces, "part")
            ));
        }
        if self.overlaps.len() > MOST {
            lines.push(format!("{} more pairs of meshes overlap in one plane; one of each counts there", self.overlaps.len() - MOST));
        }
        // Names may be the same where they are not from a file.
        let mut said = BTreeSet::new();
        lines.retain(|line| said.insert(line.clone()));
        lines
    }
}
