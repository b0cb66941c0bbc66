//! A rectangle in space, its mesh of texels, and how much of a disc lies on it.

use glam::DVec3;

/// `origin` + s u + t v with s and t from 0 to 1; u and v are perpendicular. Metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rectangle {
    pub origin: DVec3,
    pub u: DVec3,
    pub v: DVec3,
}

impl Rectangle {
    pub(crate) fn at(&self, s: f64, t: f64) -> DVec3 {
        self.origin + s * self.u + t * self.v
    }

    pub(crate) fn centre(&self) -> DVec3 {
        self.at(0.5, 0.5)
    }

    /// Centres of `columns` x `rows` texels, row by row: column i lies at (i + 1/2) / columns.
    pub(crate) fn texel_centres(&self, columns: u32, rows: u32) -> impl Iterator<Item = DVec3> {
        (0..rows).flat_map(move |row| {
            (0..columns)
                .map(move |column| self.at((f64::from(column) + 0.5) / f64::from(columns), (f64::from(row) + 0.5) / f64::from(rows)))
        })
    }

    /// Area of the disc of `radius` around the point (s, t) that lies on the rectangle, square
    /// metres.
    pub(crate) fn covered_area(&self, s: f64, t: f64, radius: f64) -> f64 {
        let (width, height) = (self.u.length(), self.v.length());
        disc_rectangle_area(radius, [-s * width, (1.0 - s) * width], [-t * height, (1.0 - t) * height])
    }
}

/// Area that the disc of `radius` around the origin shares with the rectangle x by y.
///
/// The rectangle is split into its four quadrant parts, so that each has a corner at the origin; the
/// shared area of one of those is elementary.
pub(crate) fn disc_rectangle_area(radius: f64, x: [f64; 2], y: [f64; 2]) -> f64 {
    let corner = |a: f64, b: f64| a.signum() * b.signum() * quadrant_area(radius, a.abs(), b.abs());
    corner(x[1], y[1]) - corner(x[0], y[1]) - corner(x[1], y[0]) + corner(x[0], y[0])
}

/// Area of the disc within 0 <= x <= a, 0 <= y <= b.
fn quadrant_area(radius: f64, a: f64, b: f64) -> f64 {
    let (a, b) = (a.min(radius), b.min(radius));
    if a * a + b * b <= radius * radius {
        return a * b;
    }
    // Up to x0 the rectangle's upper side is the bound, from there to a the circle.
    let x0 = (radius * radius - b * b).sqrt();
    let under_circle = |x: f64| 0.5 * (x * (radius * radius - x * x).max(0.0).sqrt() + radius * radius * (x / radius).min(1.0).asin());
    b * x0 + under_circle(a) - under_circle(x0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Values of uniform flux at an edge and in a corner: share of the disc at t = distance / radius.
    #[test]
    fn disc_at_an_edge_and_in_a_corner() {
        let far = 10.0;
        let share = |x: f64, y: f64| disc_rectangle_area(1.0, [-x, far], [-y, far]) / PI;
        for (t, expected) in [(0.0, 0.5), (0.25, 0.6575), (0.5, 0.8045), (0.75, 0.9279), (1.0, 1.0)] {
            assert!((share(t, far) - expected).abs() < 5e-5, "edge {t}: {}", share(t, far));
        }
        for (t, expected) in [(0.0, 0.25), (0.5, 0.63408), (0.8, 0.89591)] {
            assert!((share(t, t) - expected).abs() < 5e-6, "corner {t}: {}", share(t, t));
        }
        // A disc that is larger covers the whole rectangle.
        assert!((disc_rectangle_area(9.0, [-0.25, 0.75], [-0.5, 0.5]) - 1.0).abs() < 1e-12);
    }

    /// Mean over the texels of a square, against a numerical integral over the disc (4001 x 4001
    /// offsets); the mean over all points, 1 - 8r / 3 pi L + r^2 / 2 pi L^2, is 0.91671 and 0.95796.
    #[test]
    fn mean_covered_share_of_a_square() {
        let wall = Rectangle { origin: DVec3::ZERO, u: DVec3::X * 0.5, v: DVec3::Y * 0.5 };
        for (radius, expected) in [(0.05, 0.91696), (0.025, 0.95830)] {
            let mean: f64 = (0..64 * 64)
                .map(|k| wall.covered_area((f64::from(k % 64) + 0.5) / 64.0, (f64::from(k / 64) + 0.5) / 64.0, radius))
                .sum::<f64>()
                / (4096.0 * PI * radius * radius);
            assert!((mean - expected).abs() < 2e-5, "radius {radius}: {mean}");
        }
    }
}
