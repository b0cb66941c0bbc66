//! The media of a scene's solids: a number for each, and how a path keeps those of all solids that it is in.

use crate::error::Result;
use crate::scene::contact_offsets::Offsets;
use crate::scene::layers::Medium;
use crate::scene::{Scene, solids};

use super::refuse;

/// Most media: a path keeps their numbers in eight bits each.
const MAX_MEDIA: usize = 255;

pub(super) struct Media {
    /// Index of refraction, its spread over colours, and what is absorbed, of the media from number 1 on.
    pub all: Vec<(f32, f32, Medium)>,
    /// One a material; 0: it encloses none.
    pub numbers: Vec<u32>,
    /// Of a number.
    pub bits: u32,
    /// Solids of different media lie partly in one another: media are numbered by size, and the smallest solid counts.
    pub are_by_size: bool,
    /// Some do, and by size this mesh would not count where it lies within another.
    pub hidden_solid: Option<u32>,
}

impl Media {
    pub(super) fn of(scene: &Scene, offsets: &Offsets) -> Result<Media> {
        let (by_size, hidden_solid) = match solids::order(scene) {
            solids::Order::Entry => (None, None),
            solids::Order::Size(order) => (Some(order), None),
            solids::Order::Unclear(mesh) => (None, Some(mesh)),
        };
        let are_by_size = by_size.is_some();
        // Solids of equal media share a number.
        let mut all: Vec<(f32, f32, Medium)> = Vec::new();
        let mut numbers = vec![0; scene.materials.len()];
        for material in by_size.unwrap_or_else(|| (0..scene.materials.len()).collect()) {
            let Some(own) = solids::medium(&scene.materials[material]) else { continue };
            let known = all.iter().position(|of| *of == own).unwrap_or_else(|| {
                all.push(own);
                all.len() - 1
            });
            numbers[material] = known as u32 + 1;
        }
        if all.len() > MAX_MEDIA {
            let reason = format!("has solids of {} different media; at most {MAX_MEDIA} can be told apart", all.len());
            return Err(refuse(scene, "the scene", reason));
        }
        let bits = bits(scene, all.len() as u32, offsets)?;
        Ok(Media { all, numbers, bits, are_by_size, hidden_solid })
    }
}

/// How many each medium gets: so many that all solids that lie in one another have room in a word.
fn bits(scene: &Scene, media: u32, offsets: &Offsets) -> Result<u32> {
    const USUAL: u32 = 8;
    let few = 32 / USUAL;
    let Some((depth, mesh)) = solids::most_nested(scene, few as usize, |mesh, triangle| offsets.corners(scene, mesh, triangle)) else {
        return Ok(USUAL);
    };
    let bits = 32 - media.leading_zeros();
    let most = 32 / bits.max(1);
    if depth > most as usize {
        let name = &scene.meshes[mesh as usize].name;
        let reason = format!(
            "is one of {depth} solids that lie in one another; of {media} different media in the scene, at most {most} may: give some of them \
             equal indices of refraction and attenuation, or take some out"
        );
        return Err(refuse(scene, &format!("mesh '{name}'"), reason));
    }
    Ok(bits)
}
