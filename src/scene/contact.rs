//! The rule for surfaces that touch: what lies in one plane and overlaps. Eye, photon, shadow ray and density estimate all see the scene
//! that it leaves, and so does the path tracer that judges pictures.
//!
//! - **Opaque surfaces** that some side shows both of count once: [`super::overlap`] cuts the others out.
//! - **An opaque surface and a solid**, as a table and the glass on it: the opaque one counts from both sides, and the solid has no face
//!   there. Light goes from the one into the other with nothing between.
//! - **A sheet that lets light through**, by gaps of alpha or as a thin wall, lies on the other: both count, the sheet first. It is moved
//!   slightly above ([`super::contact_offsets`]), so that a ray that passes it meets the other. Sheets of one material count once.
//! - **Two solids**: light goes from one to the other with no air between. They are moved slightly into each other; where both faces look the
//!   same way, the smaller lies inside the larger.

use std::collections::HashMap;

use super::material::{Coverage, Material, TextureUse};
use super::{Mesh, Scene};

/// What a surface is to others that touch it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Opaque,
    /// Light passes through it to the same medium.
    Sheet,
    /// It bounds a solid that light enters.
    Solid,
}

/// What becomes of two surfaces where they touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Contact {
    /// Each is seen from its own side.
    None,
    /// One counts, by [`super::overlap::ranks`].
    Once,
    /// Both count, and are moved slightly apart or into each other.
    Both,
}

/// A surface as others that touch it see it.
#[derive(Clone, Copy)]
pub(crate) struct Touching<'a> {
    pub kind: Kind,
    pub material: &'a Material,
}

impl Touching<'_> {
    /// Of two in one plane whose normals have this product.
    pub(crate) fn contact(&self, other: &Touching, cosine: f64) -> Contact {
        let shows_both = cosine > 0.0 || self.material.has_two_sides() || other.material.has_two_sides();
        match (self.kind, other.kind) {
            (Kind::Solid, Kind::Solid) if has_medium(self.material) && has_medium(other.material) => Contact::Both,
            (Kind::Solid, Kind::Solid) if cosine > 0.0 => Contact::Once,
            (Kind::Solid, Kind::Solid) => Contact::None,
            (Kind::Solid, Kind::Opaque) | (Kind::Opaque, Kind::Solid) => Contact::Once,
            _ if !shows_both => Contact::None,
            (Kind::Opaque, Kind::Opaque) => Contact::Once,
            (Kind::Sheet, Kind::Sheet) if std::ptr::eq(self.material, other.material) => Contact::Once,
            _ => Contact::Both,
        }
    }
}

/// Only of these a path knows which it is in.
fn has_medium(material: &Material) -> bool {
    material.enclosed_medium().is_some()
}

/// Each mesh's kind.
pub(crate) fn kinds(scene: &Scene) -> Vec<Kind> {
    // Looking through a large texture takes a while.
    let mut least_alphas = HashMap::new();
    let mut least_alpha = |used: Option<TextureUse>| {
        used.map_or(1.0, |of| *least_alphas.entry(of.texture).or_insert_with(|| scene.textures[of.texture].texels.range(3).0))
    };
    let mut kind = |mesh: &Mesh| {
        let material = &scene.materials[mesh.material];
        if material.is_entered() {
            return Kind::Solid;
        }
        if !material.lets_light_through() {
            return Kind::Opaque;
        }
        let of_vertices = mesh.alphas.iter().fold(1.0, |least: f64, alpha| least.min(*alpha)) as f32;
        let mut least = |factor: f32| factor * of_vertices * least_alpha(material.base_colour_texture);
        // What a file may blend, and does not, is opaque.
        let has_gaps = match material.coverage {
            Coverage::Whole => false,
            Coverage::Mask { alpha, cutoff } => least(alpha) < cutoff,
            Coverage::Blend { alpha } => least(alpha) < 1.0,
        };
        if has_gaps || material.transmits() { Kind::Sheet } else { Kind::Opaque }
    };
    scene.meshes.iter().map(&mut kind).collect()
}
