//! The kd-tree over the photons of each wall, on the CPU. Twin of `glsl/index/tree.glsl`, which explains its layout, and
//! of `glsl/gather/tree_walk.glsl`.

use std::ops::Range;

use crate::constants::{FACE_COUNT, TREE_LEAF};
use crate::photon::Photon;
use crate::records::Point;

const LEAF: usize = TREE_LEAF as usize;
const WALLS: usize = FACE_COUNT as usize;

/// Photons in the order of the leaves.
pub(crate) struct Tree {
    /// First photon of each wall, and the number of all.
    wall_begins: [usize; WALLS + 1],
    planes: Vec<f32>,
    pub sorted_photons: Vec<Photon>,
}

/// Axis that nodes of a height are split along: one of the wall's two.
fn tree_axis(wall: usize, height: u32) -> usize {
    (wall / 2 + 1 + height as usize % 2) % 3
}

fn plane_place(begin: usize, boundary: usize) -> usize {
    (begin + boundary * LEAF) / LEAF
}

impl Tree {
    pub(crate) fn build(photons: &[Photon]) -> Tree {
        let mut photons = photons.to_vec();
        photons.sort_by_key(|photon| photon.wall);
        let wall_begins: [usize; WALLS + 1] = std::array::from_fn(|wall| photons.partition_point(|photon| (photon.wall as usize) < wall));
        let mut planes = vec![0.0; photons.len() / LEAF + 1];
        for wall in 0..WALLS {
            let (begin, end) = (wall_begins[wall], wall_begins[wall + 1]);
            let height = (end - begin).div_ceil(LEAF).max(1).next_power_of_two().ilog2();
            split(&mut photons[begin..end], wall, height, begin, &mut planes);
        }
        Tree { wall_begins, planes, sorted_photons: photons }
    }

    /// The leaves of a point's wall.
    pub(crate) fn walk(&self, point: &Point) -> Walk<'_> {
        let wall = point.wall as usize;
        let places = self.wall_begins[wall]..self.wall_begins[wall + 1];
        let end = places.len().div_ceil(LEAF);
        Walk { tree: self, point: *point, places, leaf: 0, end, height: end.max(1).next_power_of_two().ilog2(), from_left: false }
    }
}

/// Splits a node whose first photon has the place `begin`.
fn split(photons: &mut [Photon], wall: usize, height: u32, begin: usize, planes: &mut [f32]) {
    if height == 0 {
        return;
    }
    let middle = LEAF << (height - 1);
    if middle < photons.len() {
        let axis = tree_axis(wall, height);
        photons.select_nth_unstable_by(middle, |a, b| a.position[axis].total_cmp(&b.position[axis]));
        planes[(begin + middle) / LEAF] = photons[middle].position[axis];
        let (left, right) = photons.split_at_mut(middle);
        split(left, wall, height - 1, begin, planes);
        split(right, wall, height - 1, begin + middle, planes);
    } else {
        split(photons, wall, height - 1, begin, planes);
    }
}

/// The leaves that may hold a photon within a distance of a point, from left to right.
pub(crate) struct Walk<'a> {
    tree: &'a Tree,
    point: Point,
    places: Range<usize>,
    /// Leaves before it are done.
    leaf: usize,
    end: usize,
    /// Of the node that begins at `leaf`.
    height: u32,
    /// All before the node is done, and whether its half is in reach not yet known.
    from_left: bool,
}

impl Walk<'_> {
    /// How far the point lies behind the plane of a boundary; below 0 in front of it.
    fn beyond_plane(&self, boundary: usize) -> f32 {
        let axis = tree_axis(self.point.wall as usize, boundary.trailing_zeros() + 1);
        self.point.position[axis] - self.tree.planes[plane_place(self.places.start, boundary)]
    }

    /// Places of the photons of the next leaf.
    pub(crate) fn next_leaf(&mut self, limit: f32) -> Option<Range<usize>> {
        while self.leaf < self.end {
            if self.from_left {
                self.height = self.leaf.trailing_zeros();
                let beyond = self.beyond_plane(self.leaf);
                if beyond < 0.0 && beyond * beyond > limit {
                    self.leaf += 1 << self.height;
                    continue;
                }
                self.from_left = false;
            }
            if self.height == 0 {
                let begin = self.places.start + self.leaf * LEAF;
                self.leaf += 1;
                self.from_left = true;
                return Some(begin..self.places.end.min(begin + LEAF));
            }
            self.height -= 1;
            let boundary = self.leaf + (1 << self.height);
            if boundary < self.end {
                let beyond = self.beyond_plane(boundary);
                if beyond > 0.0 && beyond * beyond > limit {
                    self.leaf = boundary;
                }
            }
        }
        None
    }
}
