//! The bounding volume hierarchy: triangles in, nodes of a compressed wide BVH and the order of its
//! leaves out. `glsl/world/scene/bvh.glsl` traverses it.

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::bvh2::{Bvh2, DEFAULT_MAX_STACK_DEPTH};
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use rayon::prelude::*;

use super::work;
use crate::constants::BVH_STACK;
use crate::records::BvhNode;

/// Levels of nodes that the kernels can traverse.
const MAX_LEVELS: usize = BVH_STACK as usize;
/// Most triangles of a leaf.
const LEAF: u32 = 3;
/// Triangles of a sample.
const SAMPLE: usize = 4096;

pub(crate) struct Bvh {
    pub nodes: Vec<BvhNode>,
    /// Triangles in the order of the leaves.
    pub order: Vec<u32>,
}

impl Bvh {
    pub(crate) fn build(corners: &[[Vec3; 3]]) -> Bvh {
        let boxes: Vec<Aabb> = corners.par_iter().map(|corners| Aabb::from_points(&corners.map(Vec3A::from))).collect();
        let tree = build_tree(&boxes);
        Bvh { nodes: tree.nodes.iter().map(record).collect(), order: tree.primitive_indices }
    }
}

fn build_tree(boxes: &[Aabb]) -> CwBvh {
    cluster_and_optimise(boxes).unwrap_or_else(|| wide(&split_from_the_top(boxes)))
}

/// The tree of parallel locally-ordered clustering (Meister and Bittner 2018), with reinsertion; `None` where it is too
/// deep, as where many triangles lie within each other's boxes.
fn cluster_and_optimise(boxes: &[Aabb]) -> Option<CwBvh> {
    // Boxes within boxes join one at a time, in quadratic time; a sample shows it.
    if boxes.len() > SAMPLE {
        let sample: Vec<Aabb> = boxes.iter().step_by(boxes.len().div_ceil(SAMPLE)).copied().collect();
        cluster(&sample)?;
    }
    let mut tree = cluster(boxes)?;
    ReinsertionOptimizer::default().run(&mut tree, 0.02, None);
    // A node of eight children takes the place of seven binary levels at most.
    if levels_of_binary(&tree) > 7 * MAX_LEVELS {
        return None;
    }
    Some(wide(&tree)).filter(|tree| levels(tree) <= MAX_LEVELS)
}

/// The surface area heuristic's tree, but that no side gets more triangles than the levels left can hold.
fn split_from_the_top(boxes: &[Aabb]) -> Bvh2 {
    let mut tree = Bvh2::zeroed(boxes.len());
    tree.primitive_indices = (0..boxes.len() as u32).collect();
    let mut own = tree.primitive_indices.clone();
    let (root, below) = tree.nodes.split_first_mut().expect("there is a triangle");
    split(boxes, &mut own, root, Below { nodes: below, first: 1 }, MAX_LEVELS);
    tree
}

/// Room for all nodes below one, the first of which has the number `first`.
struct Below<'a> {
    nodes: &'a mut [Bvh2Node],
    first: u32,
}

/// Makes the node of the triangles `own`, and all below it on at most `levels` levels.
fn split(boxes: &[Aabb], own: &mut [u32], node: &mut Bvh2Node, below: Below, levels: usize) {
    let box_of = |triangle: &u32| &boxes[*triangle as usize];
    let bounds = own.iter().fold(Aabb::empty(), |all, triangle| all.union(box_of(triangle)));
    if let [triangle] = own {
        *node = Bvh2Node::new(bounds, 1, *triangle);
        return;
    }
    *node = Bvh2Node::new(bounds, 0, below.first);
    let middle = |triangle: &u32| box_of(triangle).center();
    let axis = own.iter().fold(Aabb::empty(), |all, triangle| all.union(&Aabb::from_point(middle(triangle)))).largest_axis();
    own.par_sort_unstable_by(|a, b| middle(a)[axis].total_cmp(&middle(b)[axis]).then(a.cmp(b)));
    let count = best_split(boxes, own, levels - 1);

    let (left_own, right_own) = own.split_at_mut(count);
    let (children, rest) = below.nodes.split_at_mut(2);
    let (left, right) = children.split_at_mut(1);
    let (left_rest, right_rest) = rest.split_at_mut(2 * count - 2);
    let left_below = Below { nodes: left_rest, first: below.first + 2 };
    let right_below = Below { nodes: right_rest, first: below.first + 2 * count as u32 };
    rayon::join(
        || split(boxes, left_own, &mut left[0], left_below, levels - 1),
        || split(boxes, right_own, &mut right[0], right_below, levels - 1),
    );
}

/// How many of the triangles, in their order, go to the left: at the least cost by the surface area heuristic, and
/// nearest to the half where that is the same.
fn best_split(boxes: &[Aabb], own: &[u32], levels: usize) -> usize {
    let areas = |triangles: &mut dyn Iterator<Item = &u32>| -> Vec<f32> {
        let grow = |all: &mut Aabb, triangle: &u32| {
            *all = all.union(&boxes[*triangle as usize]);
            Some(all.half_area())
        };
        triangles.scan(Aabb::empty(), grow).collect()
    };
    let (from_left, from_right) = (areas(&mut own.iter()), areas(&mut own.iter().rev()));
    let cost = |left: usize| {
        let right = own.len() - left;
        from_left[left - 1] * left as f32 + from_right[right - 1] * right as f32
    };
    let most = (1 << levels).min(own.len() - 1);
    let by_cost = |a: &usize, b: &usize| cost(*a).total_cmp(&cost(*b)).then(own.len().abs_diff(2 * a).cmp(&own.len().abs_diff(2 * b)));
    (own.len() - most..=most).min_by(by_cost).expect("a half is allowed")
}

/// `None` beyond the levels for which reinsertion has stacks, doubled.
fn cluster(boxes: &[Aabb]) -> Option<Bvh2> {
    let order = (0..boxes.len() as u32).collect();
    work::add(|| boxes.len());
    let tree = PlocBuilder::with_capacity(boxes.len()).build(PlocSearchDistance::Low, boxes, order, SortPrecision::U64, 2);
    (levels_of_binary(&tree) <= DEFAULT_MAX_STACK_DEPTH).then_some(tree)
}

fn wide(tree: &Bvh2) -> CwBvh {
    bvh2_to_cwbvh(tree, LEAF, true, false)
}

/// Levels of nodes that hold others.
fn levels_of_binary(tree: &Bvh2) -> usize {
    let mut deepest = 0;
    let mut open = vec![(0u32, 0)];
    while let Some((index, above)) = open.pop() {
        deepest = deepest.max(above);
        let node = &tree.nodes[index as usize];
        if !node.is_leaf() {
            open.extend([node.first_index, node.first_index + 1].map(|child| (child, above + 1)));
        }
    }
    deepest
}

/// Levels of nodes.
fn levels(tree: &CwBvh) -> usize {
    let mut deepest = 0;
    let mut open = vec![(0usize, 1usize)];
    while let Some((index, level)) = open.pop() {
        deepest = deepest.max(level);
        let node = &tree.nodes[index];
        open.extend((0..8).filter(|child| !node.is_leaf(*child)).map(|child| (node.child_node_index(child) as usize, level + 1)));
    }
    deepest
}

/// The node as kernels read it: the same bytes.
pub(crate) fn record(node: &CwBvhNode) -> BvhNode {
    bytemuck::cast(*node)
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: usize = 20_000;

    fn triangles(at_and_size: impl Fn(f32) -> (Vec3, f32)) -> Vec<[Vec3; 3]> {
        let triangle = |k: usize| {
            let (at, size) = at_and_size(k as f32 / COUNT as f32);
            [at, at + Vec3::X * size, at + Vec3::new(0.3, 1.0, 0.2) * size]
        };
        (0..COUNT).map(triangle).collect()
    }

    /// Between 0 and 1, as if at random.
    fn scattered(share: f32, k: f32) -> f32 {
        (share * COUNT as f32 * 0.618_034 * k).fract()
    }

    /// Meshes of which clustering makes one level or more for each triangle, or more levels than can be traversed.
    fn hard_meshes() -> Vec<(&'static str, Vec<[Vec3; 3]>)> {
        let place = |share| Vec3::new(scattered(share, 1.0), scattered(share, 7.0), scattered(share, 31.0));
        let small = |share: f32| (-60.0 * share).exp2();
        let equal_boxes = (0..COUNT).map(|k| [Vec3::ZERO, Vec3::ONE, place(k as f32 / COUNT as f32)]).collect();
        vec![
            ("nested about one middle", triangles(|share| (Vec3::new(-0.5, -0.5, -0.1) * small(share), small(share)))),
            ("nested at a corner", triangles(|share| (Vec3::ZERO, 1.0 - share))),
            ("in a row, ever smaller", triangles(|share| (Vec3::X * small(1.6 * share), small(1.6 * share)))),
            (
                "of all sizes around a point",
                triangles(|share| (place(share) * small(scattered(share, 13.0)), small(scattered(share, 13.0)))),
            ),
            ("in equal boxes", equal_boxes),
        ]
    }

    /// In a time that is not quadratic, as clustering all of them is: a sample of each shows it.
    #[test]
    fn every_mesh_has_a_tree_that_can_be_traversed() {
        for (name, corners) in hard_meshes() {
            let boxes: Vec<Aabb> = corners.iter().map(|corners| Aabb::from_points(&corners.map(Vec3A::from))).collect();
            let (tree, clustered) = work::of(|| build_tree(&boxes));
            println!("{name}: {} levels, {clustered} boxes clustered", levels(&tree));
            assert!(levels(&tree) <= MAX_LEVELS, "{name}: {} levels", levels(&tree));
            assert!(clustered <= SAMPLE, "{name}: {clustered} boxes clustered");
            // Every triangle once, every box around what is in it.
            tree.validate(&boxes, false);
            let mut order = tree.primitive_indices;
            order.sort_unstable();
            assert!(order.iter().enumerate().all(|(place, triangle)| place == *triangle as usize), "{name}");
        }
    }

    #[test]
    fn no_split_goes_deeper_than_allowed() {
        // To split off one triangle at a time costs least.
        let size = |k: i32| 8f32.powi(k);
        let ever_larger = (-22..20).map(|k| [Vec3::ZERO, Vec3::X * size(k), Vec3::ONE * size(k)]).collect();
        for (name, corners) in hard_meshes().into_iter().chain([("each eight times as large as the one before", ever_larger)]) {
            let boxes: Vec<Aabb> = corners.iter().take(1 << 9).map(|corners| Aabb::from_points(&corners.map(Vec3A::from))).collect();
            let tree = split_from_the_top(&boxes);
            assert!(levels_of_binary(&tree) <= MAX_LEVELS, "{name}");
            tree.validate(&boxes, false, false);
        }
    }
}
