//! Which solids a path is inside of.

use std::sync::Arc;

use glam::DVec3;

use super::geometry::{Geometry, Ray};
use crate::scene::solids::{self, Order};
use crate::scene::{Material, Scene, Surface};

/// Towards what a point looks for the solids around it: no axis of a scene.
const OUTWARDS: DVec3 = DVec3::new(0.290_380_3, 0.829_658_1, 0.476_861_2);

/// The solids around a point, the one that fills the place at the end: the one entered last, or the smallest where solids lie partly in
/// one another.
#[derive(Clone, Default)]
pub(crate) struct Media<'a> {
    solids: Vec<&'a Material>,
    by_size: Option<BySize<'a>>,
}

/// Materials of solids, the largest first.
pub(crate) type BySize<'a> = Arc<[&'a Material]>;

/// Those of a scene in which solids of different media lie partly in one another.
pub(crate) fn by_size(scene: &Scene) -> Option<BySize<'_>> {
    match solids::order(scene) {
        Order::Size(order) => Some(order.into_iter().map(|material| &scene.materials[material]).collect()),
        Order::Entry | Order::Unclear(_) => None,
    }
}

/// Whether a material encloses a medium.
pub(crate) fn is_solid(material: &Material) -> bool {
    let layers = &material.layers;
    let lets_in = layers.transmission > 0.0 || layers.diffuse_transmission > 0.0;
    material.surface == Surface::Layered && lets_in && layers.medium.is_some() && !layers.is_unlit
}

/// Index of refraction for a channel: blue has most (KHR_materials_dispersion); without one that of yellow.
fn index_of(solid: &Material, channel: Option<usize>) -> f64 {
    let ior = f64::from(solid.layers.ior);
    match channel {
        Some(channel) if is_dispersive(solid) => {
            let abbe_number = 20.0 / f64::from(solid.layers.dispersion);
            let between_red_and_blue = (ior - 1.0) / abbe_number;
            (ior + (channel as f64 - 1.0) * 0.5 * between_red_and_blue).clamp(1.0, 100.0)
        }
        _ => ior,
    }
}

fn is_dispersive(solid: &Material) -> bool {
    solid.layers.dispersion > 0.0 && solid.layers.ior > 1.0
}

impl<'a> Media<'a> {
    /// Index of refraction.
    pub(super) fn index(&self, channel: Option<usize>) -> f64 {
        self.solids.last().map_or(1.0, |solid| index_of(solid, channel))
    }

    /// Whether colours have different ones.
    pub(super) fn is_dispersive(&self) -> bool {
        self.solids.last().is_some_and(|solid| is_dispersive(solid))
    }

    /// Share of light that is left after a way.
    pub(super) fn transmittance(&self, metres: f64) -> DVec3 {
        let medium = self.solids.last().and_then(|solid| solid.layers.medium);
        medium.map_or(DVec3::ONE, |medium| medium.transmittance.as_dvec3().map(|share| share.powf(metres / f64::from(medium.metres))))
    }

    fn place(&self, solid: &Material) -> Option<usize> {
        self.solids.iter().rposition(|known| std::ptr::eq(*known, solid))
    }

    /// On the side from which a solid's surface is seen: whoever sees its back is inside.
    pub(super) fn before(mut self, solid: &'a Material, is_front: bool) -> Media<'a> {
        if !is_front && self.place(solid).is_none() {
            self.enter(solid);
        }
        self
    }

    /// On its other side.
    pub(super) fn beyond(&self, solid: &'a Material, is_front: bool) -> Media<'a> {
        let mut media = self.clone();
        if is_front {
            media.enter(solid);
        } else if let Some(place) = media.place(solid) {
            media.solids.remove(place);
        }
        media
    }

    fn enter(&mut self, solid: &'a Material) {
        let place = self.by_size.as_ref().and_then(|order| {
            let size = |of: &Material| order.iter().position(|known| std::ptr::eq(*known, of));
            self.solids.iter().position(|known| size(known) > size(solid))
        });
        self.solids.insert(place.unwrap_or(self.solids.len()), solid);
    }

    /// Around a point: the solids that a ray from there leaves without having entered them.
    pub(super) fn around(geometry: &Geometry<'a>, by_size: Option<BySize<'a>>, position: DVec3) -> Media<'a> {
        let (mut entered, mut left) = (Media::default(), Vec::new());
        let mut ray = Ray { origin: position, direction: OUTWARDS.normalize() };
        while let Some(hit) = geometry.closest_hit(&ray, f64::INFINITY) {
            let triangle = &geometry.triangles[hit.triangle];
            let is_front = ray.direction.dot(triangle.normal) < 0.0;
            if is_solid(triangle.material) {
                if is_front || entered.place(triangle.material).is_some() {
                    entered = entered.beyond(triangle.material, is_front);
                } else {
                    left.push(triangle.material);
                }
            }
            ray = geometry.leaving(triangle.point(hit.weights), triangle.normal, ray.direction);
        }
        // The one left first is the innermost.
        left.reverse();
        let mut media = Media { solids: Vec::new(), by_size };
        left.into_iter().for_each(|solid| media.enter(solid));
        media
    }
}
