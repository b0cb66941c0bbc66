//! The bounding volume hierarchy: triangles in, nodes of a compressed wide BVH and the order of its
//! leaves out. `glsl/scene/bvh.glsl` traverses it.

use std::time::Duration;

use glam::{UVec2, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::triangle::Triangle;

use crate::constants::BVH_STACK;
use crate::error::{Error, Result};
use crate::records::BvhNode;

/// Of the thread that builds: a thousand levels and more.
const STACK_BYTES: usize = 256 << 20;

pub struct Bvh {
    pub nodes: Vec<BvhNode>,
    /// Triangles in the order of the leaves.
    pub order: Vec<u32>,
}

impl Bvh {
    pub fn build(corners: &[[Vec3; 3]]) -> Result<Bvh> {
        let triangles: Vec<Triangle> =
            corners.iter().map(|[a, b, c]| Triangle { v0: Vec3A::from(*a), v1: Vec3A::from(*b), v2: Vec3A::from(*c) }).collect();
        // Splitting triangles would put some into several leaves, and an area asked of the leaves would count
        // them twice.
        let parameters = BvhBuildParams { pre_split: false, ..BvhBuildParams::fast_build() };
        // The builder recurses as deep as the tree is, and asserts that it is not too deep.
        let build = move || build_cwbvh_from_tris(&triangles, parameters, &mut Duration::default());
        let built = std::thread::Builder::new().stack_size(STACK_BYTES).spawn(build).map(std::thread::JoinHandle::join);
        let Ok(Ok(tree)) = built else {
            return Err(Error::Scene {
                path: "the scene".into(),
                object: "the triangles' hierarchy".into(),
                reason: "cannot be built; remove triangles that lie on one another".into(),
            });
        };
        let depth = depth(&tree);
        if depth > BVH_STACK as usize {
            return Err(Error::Scene {
                path: "the scene".into(),
                object: "the triangles' hierarchy".into(),
                reason: format!("is {depth} levels deep, at most {BVH_STACK} are traversed; remove triangles that lie on one another"),
            });
        }
        Ok(Bvh { nodes: tree.nodes.iter().map(record).collect(), order: tree.primitive_indices.clone() })
    }
}

/// Levels of nodes.
fn depth(tree: &CwBvh) -> usize {
    let mut deepest = 0;
    let mut open = vec![(0usize, 1usize)];
    while let Some((index, level)) = open.pop() {
        deepest = deepest.max(level);
        let node = &tree.nodes[index];
        open.extend((0..8).filter(|child| !node.is_leaf(*child)).map(|child| (node.child_node_index(child) as usize, level + 1)));
    }
    deepest
}

fn record(node: &CwBvhNode) -> BvhNode {
    let words = |bytes: [u8; 8]| {
        let word = |first: usize| u32::from_le_bytes([bytes[first], bytes[first + 1], bytes[first + 2], bytes[first + 3]]);
        UVec2::new(word(0), word(4))
    };
    BvhNode {
        origin: node.p,
        spacing: u32::from_le_bytes([node.e[0], node.e[1], node.e[2], node.imask]),
        first_child: node.child_base_idx,
        first_triangle: node.primitive_base_idx,
        meta: words(node.child_meta),
        min_x: words(node.child_min_x),
        max_x: words(node.child_max_x),
        min_y: words(node.child_min_y),
        max_y: words(node.child_max_y),
        min_z: words(node.child_min_z),
        max_z: words(node.child_max_z),
    }
}
