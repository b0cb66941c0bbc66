//! Which points of a lattice over [0, 1]^2 lie in a triangle.

use std::ops::Range;

use glam::{DVec2, DVec3};

/// Point (column, row) of a lattice lies at ((column + 1/2) / columns, (row + 1/2) / rows).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lattice {
    pub columns: u32,
    pub rows: u32,
}

/// A triangle in lattice units, its barycentric weights linear in x and y.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Triangle {
    along_x: DVec3,
    along_y: DVec3,
    at_origin: DVec3,
    low: DVec2,
    high: DVec2,
    lattice: Lattice,
}

/// Points this far outside (in lattice units) still count, so that rounding leaves no crack along an
/// edge that two triangles share.
const EDGE: f64 = 1e-6;

impl Lattice {
    /// `None` for a triangle that rounding leaves no area.
    pub(super) fn triangle(self, corners: [DVec2; 3]) -> Option<Triangle> {
        let [a, b, c] = corners.map(|corner| corner * DVec2::new(self.columns.into(), self.rows.into()) - 0.5);
        let doubled_area = (b - a).perp_dot(c - a);
        let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
        if doubled_area.is_nan() || doubled_area.abs() <= 1e-12 * longest {
            return None;
        }
        // Twice the area of (p, from, to), over that of the whole.
        let weight = |from: DVec2, to: DVec2| {
            let side = to - from;
            DVec3::new(-side.y, side.x, side.y * from.x - side.x * from.y) / doubled_area
        };
        let [of_a, of_b, of_c] = [weight(b, c), weight(c, a), weight(a, b)];
        Some(Triangle {
            along_x: DVec3::new(of_a.x, of_b.x, of_c.x),
            along_y: DVec3::new(of_a.y, of_b.y, of_c.y),
            at_origin: DVec3::new(of_a.z, of_b.z, of_c.z),
            low: a.min(b).min(c),
            high: a.max(b).max(c),
            lattice: self,
        })
    }
}

impl Triangle {
    /// Rows that may hold points of the triangle.
    pub(super) fn rows(&self) -> Range<u32> {
        integers_within(self.low.y, self.high.y, self.lattice.rows)
    }

    /// Columns of the row's points within the triangle.
    pub(super) fn columns(&self, row: u32) -> Range<u32> {
        let (mut low, mut high) = (self.low.x, self.high.x);
        let at_row = self.along_y * f64::from(row) + self.at_origin;
        for corner in 0..3 {
            let (slope, start) = (self.along_x[corner], at_row[corner]);
            // The weight grows by the gradient's length over one lattice unit.
            let start = start + EDGE * slope.hypot(self.along_y[corner]);
            if slope > 0.0 {
                low = low.max(-start / slope);
            } else if slope < 0.0 {
                high = high.min(-start / slope);
            } else if start < 0.0 {
                return 0..0;
            }
        }
        integers_within(low, high, self.lattice.columns)
    }

    /// Whether any point of the lattice lies within.
    pub(super) fn is_caught(&self) -> bool {
        self.rows().any(|row| !self.columns(row).is_empty())
    }

    /// Barycentric weights of a point; they sum to one and none is negative.
    pub(super) fn weights(&self, column: u32, row: u32) -> DVec3 {
        let weights = (self.along_x * f64::from(column) + self.along_y * f64::from(row) + self.at_origin).max(DVec3::ZERO);
        weights / weights.element_sum()
    }
}

/// Whole numbers from `low` to `high`, both within `EDGE`, that are below `count`.
fn integers_within(low: f64, high: f64, count: u32) -> Range<u32> {
    // Casts of floats saturate, so what lies outside becomes an empty range.
    let start = (low - EDGE).ceil().max(0.0) as u32;
    let end = ((high + EDGE).floor() + 1.0).clamp(0.0, f64::from(count)) as u32;
    start..end.max(start)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_halves_of_a_square_meet_without_a_crack() {
        let lattice = Lattice { columns: 37, rows: 23 };
        let square = [DVec2::new(0.1, 0.2), DVec2::new(0.9, 0.25), DVec2::new(0.8, 0.95), DVec2::new(0.15, 0.7)];
        let inside = |p: DVec2| (0..4).all(|k| (square[(k + 1) % 4] - square[k]).perp_dot(p - square[k]) > 0.0);
        let halves = [[0, 1, 2], [0, 2, 3]].map(|corners| lattice.triangle(corners.map(|k: usize| square[k])).unwrap());
        let mut caught = 0;
        for row in 0..lattice.rows {
            for column in 0..lattice.columns {
                let place = DVec2::new((f64::from(column) + 0.5) / 37.0, (f64::from(row) + 0.5) / 23.0);
                let covered = halves.iter().filter(|half| half.rows().contains(&row) && half.columns(row).contains(&column)).count();
                assert_eq!(covered > 0, inside(place), "{column} {row}");
                caught += covered;
            }
        }
        assert!(caught > 300, "{caught}");
    }

    #[test]
    fn weights_name_the_point() {
        let corners = [DVec2::new(0.9, 0.1), DVec2::new(0.5, 0.9), DVec2::new(0.1, 0.2)];
        let triangle = Lattice { columns: 8, rows: 16 }.triangle(corners).unwrap();
        let weights = triangle.weights(4, 6);
        let place = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
        assert!((place - DVec2::new(4.5 / 8.0, 6.5 / 16.0)).length() < 1e-12, "{place}");
    }

    #[test]
    fn lines_and_far_triangles_catch_nothing() {
        let lattice = Lattice { columns: 8, rows: 8 };
        assert!(lattice.triangle([DVec2::ZERO, DVec2::ONE, DVec2::splat(0.5)]).is_none());
        assert!(lattice.triangle([DVec2::splat(f64::NAN), DVec2::ONE, DVec2::X]).is_none());
        let far = lattice.triangle([DVec2::splat(5.0), DVec2::new(6.0, 5.0), DVec2::splat(6.0)]).unwrap();
        assert!(!far.is_caught());
    }
}
