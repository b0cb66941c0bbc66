//! What hangs together, by places or edges that it shares.

use std::collections::HashMap;
use std::hash::Hash;

use glam::DVec3;

/// Groups of triangles, by numbers: those that have a key in common are of one group, and so are all that hang together by others. Groups
/// and their members are in ascending order.
pub(crate) fn connected<K: Eq + Hash>(keys_of_triangles: impl IntoIterator<Item = [K; 3]>) -> Vec<Vec<usize>> {
    fn root(parents: &mut [usize], mut place: usize) -> usize {
        while parents[place] != place {
            parents[place] = parents[parents[place]];
            place = parents[place];
        }
        place
    }
    let mut parents: Vec<usize> = Vec::new();
    let mut first_with = HashMap::new();
    for (triangle, keys) in keys_of_triangles.into_iter().enumerate() {
        parents.push(triangle);
        for key in keys {
            let other = *first_with.entry(key).or_insert(triangle);
            let (a, b) = (root(&mut parents, triangle), root(&mut parents, other));
            parents[a.max(b)] = a.min(b);
        }
    }
    let mut groups: Vec<Vec<usize>> = vec![Vec::new(); parents.len()];
    for triangle in 0..parents.len() {
        groups[root(&mut parents, triangle)].push(triangle);
    }
    groups.retain(|group| !group.is_empty());
    groups
}

/// A place as a key. The sum turns -0 into 0.
pub(crate) fn bits(place: DVec3) -> [u64; 3] {
    (place + DVec3::ZERO).to_array().map(f64::to_bits)
}
