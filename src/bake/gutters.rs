//! The covered texel nearest to every texel of a map.

use rayon::prelude::*;

const NONE: u32 = u32::MAX;

/// For every texel, row by row, the index in `texels` (columns and rows) of the nearest one: exact Euclidean distances
/// between centres, by the lower envelope of parabolas (Felzenszwalb and Huttenlocher 2012).
pub(crate) fn nearest(width: u32, height: u32, texels: impl IntoIterator<Item = (u32, u32)>) -> Vec<u32> {
    let (columns, rows) = (width as usize, height as usize);
    let mut covered = vec![NONE; columns * rows];
    for (index, (x, y)) in texels.into_iter().enumerate() {
        covered[y as usize * columns + x as usize] = index as u32;
    }
    // Row of the nearest covered texel in the same column; of two equally near ones the upper.
    let mut in_column = vec![NONE; columns * rows];
    for column in 0..columns {
        let mut above = NONE;
        for row in 0..rows {
            if covered[row * columns + column] != NONE {
                above = row as u32;
            }
            in_column[row * columns + column] = above;
        }
        let mut below = NONE;
        for row in (0..rows).rev() {
            if covered[row * columns + column] != NONE {
                below = row as u32;
            }
            let above = &mut in_column[row * columns + column];
            if below != NONE && (*above == NONE || below - (row as u32) < row as u32 - *above) {
                *above = below;
            }
        }
    }
    let mut nearest = vec![NONE; columns * rows];
    nearest.par_chunks_mut(columns).enumerate().for_each_init(Vec::new, |envelope, (row, nearest)| {
        let in_column = &in_column[row * columns..(row + 1) * columns];
        // Columns whose texel is the nearest of the row from some place on, with that place.
        envelope.clear();
        for (column, covered_row) in in_column.iter().enumerate().filter(|(_, covered_row)| **covered_row != NONE) {
            let height = square(row as f64 - f64::from(*covered_row)) + square(column as f64);
            let mut from = f64::NEG_INFINITY;
            while let Some((start, other, other_height)) = envelope.last() {
                from = (height - other_height) / (2.0 * (column as f64 - *other as f64));
                if from > *start {
                    break;
                }
                envelope.pop();
                from = f64::NEG_INFINITY;
            }
            envelope.push((from, column, height));
        }
        let mut place = 0;
        for (column, nearest) in nearest.iter_mut().enumerate() {
            while envelope.get(place + 1).is_some_and(|(start, ..)| *start < column as f64) {
                place += 1;
            }
            if let Some((_, source, _)) = envelope.get(place) {
                *nearest = covered[in_column[*source] as usize * columns + source];
            }
        }
    });
    nearest
}

fn square(x: f64) -> f64 {
    x * x
}
