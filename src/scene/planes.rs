//! Planes that several triangles lie in, and what else is the same of several of them, found by hashes.

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use crate::constants::IN_PLANE_INVERSE;

/// Corners that are no further from a plane lie in it.
pub(crate) const IN_PLANE: f64 = 1.0 / IN_PLANE_INVERSE as f64;

/// Bits of a triangle's number in what is sorted, below those of its class, hash or cell.
pub(crate) const NUMBER_BITS: u32 = 28;
pub(crate) const NUMBER: u64 = (1 << NUMBER_BITS) - 1;

/// Planes of triangles, those that agree to a few units in the last place as one.
pub(crate) struct Planes {
    /// Unit normal n of the front, then what makes n . p + offset = 0.
    pub planes: Vec<Vec4>,
    /// Each triangle's number among them.
    pub of_triangles: Vec<u32>,
}

impl Planes {
    /// Of the fronts of normalised triangles, in the order of the first triangle of each.
    pub(super) fn of(corners: &[[Vec3; 3]]) -> Planes {
        // A quarter of what two surfaces must be apart.
        const STEP: f64 = 0.25 * IN_PLANE;
        let plane = |corners: &[Vec3; 3]| {
            let [a, b, c] = corners.map(Vec3::as_dvec3);
            // Of the very normal that is stored, so that the plane goes through the triangle's middle.
            let normal = (b - a).cross(c - a).normalize().as_vec3();
            (normal, -normal.as_dvec3().dot((a + b + c) / 3.0))
        };
        let planes: Vec<(Vec3, f64)> = corners.par_iter().map(plane).collect();
        // To the nearest, halves away from 0, as `round` does, which is a call for each.
        let rounded = |value: f64| (value + 0.5f64.next_down().copysign(value)) as i32;
        let words = |triangle: u32| {
            let (normal, offset) = planes[triangle as usize];
            (normal.as_dvec3().extend(offset) / STEP).to_array().map(|value| rounded(value) as u32)
        };
        let mut first: Vec<u32> = (0..corners.len() as u32).collect();
        for_equals(
            corners.len(),
            |triangle| hash_of(&words(triangle)),
            words,
            |alike| alike.iter().for_each(|triangle| first[*triangle as usize] = alike[0]),
        );
        let mut of_triangles = first;
        let mut firsts = Vec::with_capacity(corners.len());
        for triangle in 0..corners.len() {
            let first = of_triangles[triangle] as usize;
            if first == triangle {
                of_triangles[triangle] = firsts.len() as u32;
                firsts.push(triangle as u32);
            } else {
                of_triangles[triangle] = of_triangles[first];
            }
        }
        let record = |triangle: &u32| {
            let (normal, offset) = planes[*triangle as usize];
            normal.extend(offset as f32)
        };
        Planes { planes: firsts.par_iter().map(record).collect(), of_triangles }
    }
}

/// Of a few words, for [`for_equals`].
pub(crate) fn hash_of(words: &[u32]) -> u64 {
    words.iter().fold(0u64, |hash, word| {
        let mixed = (hash ^ u64::from(*word)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        mixed ^ mixed >> 32
    })
}

/// Calls `each` with the numbers, ascending, of every two or more things below `count` whose words, and so their hashes, are
/// the same.
pub(crate) fn for_equals<const N: usize>(
    count: usize,
    hash: impl Fn(u32) -> u64 + Sync,
    words: impl Fn(u32) -> [u32; N] + Sync,
    mut each: impl FnMut(&[u32]),
) {
    // Sorting numbers below a hash takes a quarter of the time that sorting the words themselves would.
    let numbered = |number: u32| hash(number) << NUMBER_BITS | u64::from(number);
    let mut sorted: Vec<u64> = (0..count as u32).into_par_iter().map(numbered).collect();
    sorted.par_sort_unstable();
    for alike in sorted.chunk_by(|a, b| a >> NUMBER_BITS == b >> NUMBER_BITS).filter(|alike| alike.len() > 1) {
        let mut numbers: Vec<u32> = alike.iter().map(|of| (of & NUMBER) as u32).collect();
        let first = words(numbers[0]);
        if numbers.iter().all(|number| words(*number) == first) {
            each(&numbers);
            continue;
        }
        // Different words with the same hash.
        numbers.sort_by_key(|number| words(*number));
        numbers.chunk_by(|a, b| words(*a) == words(*b)).filter(|equals| equals.len() > 1).for_each(&mut each);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of so many, some that differ have the same hash: single ones, and pairs whose numbers then alternate.
    #[test]
    fn equals_are_distinguished_from_those_with_the_same_hash() {
        const COUNT: u32 = 1 << 21;
        const PAIRS: u32 = COUNT / 4;
        let mut found = Vec::new();
        let words = |number| [number % (COUNT - PAIRS), 7];
        for_equals(COUNT as usize, |number| hash_of(&words(number)), words, |alike| found.push(alike.to_vec()));
        found.sort_unstable();
        assert_eq!(found.len(), PAIRS as usize);
        for (first, alike) in (0..).zip(found) {
            assert_eq!(alike, [first, first + COUNT - PAIRS]);
        }
    }
}
