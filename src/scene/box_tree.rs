//! A tree of boxes around triangles, for what is looked up on the host; who asks judges the triangles themselves.

use std::time::Duration;

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use rayon::prelude::*;

use super::bounds_of;

pub(crate) struct BoxTree(Bvh2);

impl BoxTree {
    /// Boxes are wider than their triangles by `slack` on all sides.
    pub(crate) fn new(triangles: impl IndexedParallelIterator<Item = [DVec3; 3]>, slack: f64) -> BoxTree {
        // One step out for the rounding to f32.
        let box_of = |corners: [DVec3; 3]| {
            let (low, high) = bounds_of(corners.into_iter());
            Aabb::new(Vec3A::from((low - slack).as_vec3().map(f32::next_down)), Vec3A::from((high + slack).as_vec3().map(f32::next_up)))
        };
        let boxes: Vec<Aabb> = triangles.map(box_of).collect();
        // The builder wants at least one box.
        BoxTree(match boxes.len() {
            0 => Bvh2::default(),
            _ => build_bvh2(&boxes, BvhBuildParams::fast_build(), &mut Duration::default()),
        })
    }

    /// Calls back for the triangles of leaves whose boxes meet something.
    pub(crate) fn visit(&self, meets: impl Fn(DVec3, DVec3) -> bool, mut look: impl FnMut(usize)) {
        let mut open = if self.0.nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(place) = open.pop() {
            let node = &self.0.nodes[place];
            let (bounds, first) = (node.aabb(), node.first_index as usize);
            if !meets(bounds.min.as_dvec3(), bounds.max.as_dvec3()) {
                continue;
            }
            if node.is_leaf() {
                let own = &self.0.primitive_indices[first..first + node.prim_count as usize];
                own.iter().for_each(|triangle| look(*triangle as usize));
            } else {
                open.extend([first, first + 1]);
            }
        }
    }
}
