//! The paper's box, solved by radiosity in f64: irradiance of its walls by order of reflection. It shares no code
//! with the rest and knows no photon.
//!
//! The walls are cut into n x n cells of constant radiosity. What a cell receives directly is found by quadrature
//! over the lamp's disc, with the exact share of each of its points' light that a rectangle takes; what cells
//! exchange, by exact form factors between rectangles, so that no light is lost or made up.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Half the edge of the cube, metres.
const HALF_EDGE: f64 = 0.25;
const EDGE: f64 = 2.0 * HALF_EDGE;
const LIGHT_RADIUS: f64 = 0.05;
/// Left, right, floor, ceiling, back: the wall 2 * axis + (1 on the positive side). The sixth is open.
pub(crate) const WALLS: usize = 5;
/// Walls in whose middle the lamps lie, in the order of their photons.
const LIT_WALLS: [usize; 2] = [2, 0];

/// Radiant intensity over the hemisphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Law {
    Uniform,
    Cosine,
}

/// Flux from each of the two lamps, of 1 W, or what it makes.
pub(crate) type ByLamp = [f64; 2];

fn side(wall: usize) -> f64 {
    if wall.is_multiple_of(2) { -1.0 } else { 1.0 }
}

/// Normal of a wall, into the box.
pub(crate) fn inward(wall: usize) -> DVec3 {
    -side(wall) * DVec3::AXES[wall / 2]
}

/// The point of a wall at coordinates s and t, from -1/4 to 1/4 m along the two axes after the wall's own.
pub(crate) fn on_wall(wall: usize, s: f64, t: f64) -> DVec3 {
    let axis = wall / 2;
    side(wall) * HALF_EDGE * DVec3::AXES[axis] + s * DVec3::AXES[(axis + 1) % 3] + t * DVec3::AXES[(axis + 2) % 3]
}

/// A rectangle of a wall.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cell {
    pub wall: usize,
    pub s: [f64; 2],
    pub t: [f64; 2],
}

impl Cell {
    /// Counter-clockwise as the wall's axis sees it, whichever side is inside.
    fn corners(&self) -> [DVec3; 4] {
        let [s, t] = [self.s, self.t];
        [(s[0], t[0]), (s[1], t[0]), (s[1], t[1]), (s[0], t[1])].map(|(s, t)| on_wall(self.wall, s, t))
    }

    fn parts(&self, n: usize) -> impl Iterator<Item = Cell> + use<> {
        let cut = move |x: [f64; 2], i: usize| [i, i + 1].map(|i| x[0] + (x[1] - x[0]) * i as f64 / n as f64);
        let Cell { wall, s, t } = *self;
        (0..n * n).map(move |k| Cell { wall, s: cut(s, k % n), t: cut(t, k / n) })
    }

    /// Share of the light that leaves this cell evenly and arrives at the other.
    #[cfg(test)]
    pub(crate) fn form_factor(&self, other: &Cell) -> f64 {
        exchange(self, other) / ((self.s[1] - self.s[0]) * (self.t[1] - self.t[0]))
    }
}

/// Cells of a wall, row by row.
pub(crate) fn cells_of(wall: usize, n: usize) -> impl Iterator<Item = Cell> {
    Cell { wall, s: [-HALF_EDGE, HALF_EDGE], t: [-HALF_EDGE, HALF_EDGE] }.parts(n)
}

/// Form factor of a cell seen from a point of a surface with this normal, the cell wholly before it: Lambert's sum
/// over the edges of the angle each takes up, times the cosine of the plane through it and the point.
pub(crate) fn form_factor_from(point: DVec3, normal: DVec3, cell: &Cell) -> f64 {
    let corners = cell.corners().map(|corner| corner - point);
    let sum: f64 = (0..4)
        .map(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % 4]);
            let cross = a.cross(b);
            let sine = cross.length();
            // An edge that runs to the point itself takes up no angle off its plane.
            if sine > 0.0 { sine.atan2(a.dot(b)) * cross.dot(normal) / sine } else { 0.0 }
        })
        .sum();
    sum.abs() / TAU
}

/// Solid angle of a cell from a point off its plane: of the four rectangles between the foot of the perpendicular and
/// a corner, atan(x y / d r) each.
fn solid_angle_from(point: DVec3, cell: &Cell) -> f64 {
    let axis = cell.wall / 2;
    let distance = (side(cell.wall) * HALF_EDGE - point[axis]).abs();
    let corner = |s: f64, t: f64| {
        let [x, y] = [s - point[(axis + 1) % 3], t - point[(axis + 2) % 3]];
        (x * y / (distance * (x * x + y * y + distance * distance).sqrt())).atan()
    };
    let [s, t] = [cell.s, cell.t];
    corner(s[1], t[1]) - corner(s[0], t[1]) - corner(s[1], t[0]) + corner(s[0], t[0])
}

/// Area times form factor between two cells of different walls: the double contour integral
/// 1 / 2 pi of ln r along both outlines (Sparrow 1963), to which edges at a right angle add nothing.
pub(crate) fn exchange(one: &Cell, other: &Cell) -> f64 {
    let (a, b) = (one.corners(), other.corners());
    let mut sum = 0.0;
    for i in 0..4 {
        for j in 0..4 {
            let (from, to) = (a[i], a[(i + 1) % 4]);
            let (other_from, other_to) = (b[j], b[(j + 1) % 4]);
            let direction = (to - from).normalize();
            let other_direction = (other_to - other_from).normalize();
            let cosine = direction.dot(other_direction);
            if cosine.abs() < 0.5 {
                continue;
            }
            let way = other_from - from;
            let squared = (way - way.dot(direction) * direction).length_squared();
            let [s0, s1, t0, t1] = [from, to, other_from, other_to].map(|corner| corner.dot(direction));
            // Integral over s and t of ln sqrt(squared + (s - t)^2), by its double antiderivative in s - t; where
            // an edge runs backwards so does the integral, which its sign in the contour undoes.
            let h = |length: f64| double_antiderivative(squared, length);
            sum += h(s1 - t0) + h(s0 - t1) - h(s1 - t1) - h(s0 - t0);
        }
    }
    sum.abs() / TAU
}

/// H with H'' = ln sqrt(a^2 + t^2): (t^2 - a^2) / 4 ln(a^2 + t^2) + a t atan(t / a) - 3/4 t^2.
fn double_antiderivative(squared: f64, t: f64) -> f64 {
    let sum = squared + t * t;
    if sum == 0.0 {
        return 0.0;
    }
    let a = squared.sqrt();
    0.25 * (t * t - squared) * sum.ln() + if a > 0.0 { a * t * (t / a).atan() } else { 0.0 } - 0.75 * t * t
}

/// Points of a disc of radius 1 and their shares of its area: Gauss's three in the squared radius, evenly around; exact for
/// polynomials up to degree five.
fn disc_points() -> impl Iterator<Item = (f64, f64, f64)> {
    const SPOKES: u32 = 12;
    let offset = 0.15f64.sqrt();
    [(0.5 - offset, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + offset, 5.0 / 18.0)].into_iter().flat_map(|(squared, share)| {
        (0..SPOKES).map(move |spoke| {
            let (sin, cos) = (TAU * (f64::from(spoke) + 0.5) / f64::from(SPOKES)).sin_cos();
            (squared.sqrt() * cos, squared.sqrt() * sin, share / f64::from(SPOKES))
        })
    })
}

fn lamp_points(lit_wall: usize) -> impl Iterator<Item = (DVec3, f64)> {
    disc_points().map(move |(x, y, share)| (on_wall(lit_wall, LIGHT_RADIUS * x, LIGHT_RADIUS * y), share))
}

/// Flux that a cell receives straight from a lamp of 1 W.
fn direct_flux(law: Law, lit_wall: usize, cell: &Cell) -> f64 {
    if lit_wall == cell.wall {
        return 0.0;
    }
    lamp_points(lit_wall)
        .map(|(point, share)| match law {
            Law::Uniform => share * solid_angle_from(point, cell) / TAU,
            Law::Cosine => share * form_factor_from(point, inward(lit_wall), cell),
        })
        .sum()
}

/// What cells of equal size exchange, over their area, by how they lie to each other.
struct FormFactors {
    n: usize,
    /// Of opposite walls: steps along both axes.
    facing: Vec<f64>,
    /// Of walls with a common edge: steps of each from it and steps along it.
    beside: Vec<f64>,
}

impl FormFactors {
    fn new(n: usize) -> FormFactors {
        let area = (EDGE / n as f64).powi(2);
        let first: Vec<Vec<Cell>> = (0..4).map(|wall| cells_of(wall, n).collect()).collect();
        // Left and right: s runs along y, t along z. Left and floor, whose axes are z and x: the common edge is z.
        let facing = (0..n * n).map(|k| exchange(&first[0][0], &first[1][k]) / area).collect();
        let beside = (0..n * n * n)
            .map(|k| {
                let (along, from_left, from_floor) = (k % n, k / n % n, k / n / n);
                exchange(&first[0][from_floor], &first[2][from_left * n + along]) / area
            })
            .collect();
        FormFactors { n, facing, beside }
    }

    /// Between cells at (s, t) of two different walls, in steps.
    fn between(&self, wall: usize, at: [usize; 2], other: usize, other_at: [usize; 2]) -> f64 {
        let n = self.n;
        let (axis, other_axis) = (wall / 2, other / 2);
        if axis == other_axis {
            return self.facing[at[1].abs_diff(other_at[1]) * n + at[0].abs_diff(other_at[0])];
        }
        // Steps along an axis from the wall that is perpendicular to it.
        let place = |axis: usize, at: [usize; 2], along: usize| at[(along + 3 - axis - 1) % 3];
        let from = |steps: usize, wall: usize| if wall.is_multiple_of(2) { steps } else { n - 1 - steps };
        let common = 3 - axis - other_axis;
        let along = place(axis, at, common).abs_diff(place(other_axis, other_at, common));
        let own = from(place(axis, at, other_axis), other);
        let others = from(place(other_axis, other_at, axis), wall);
        self.beside[(own * n + others) * n + along]
    }
}

/// Irradiance of the cells of all walls, wall by wall and row by row, W/m2 from each lamp.
pub(crate) struct Radiosity {
    pub n: usize,
    pub law: Law,
    pub albedo: f64,
    /// Light that arrives after 0, 1, 2, ... reflections.
    pub orders: Vec<Vec<ByLamp>>,
}

impl Radiosity {
    /// On n x n cells a wall, n even, by Richardson's extrapolation from these and twice as wide ones: cells of constant
    /// radiosity err with the square of their width.
    pub(crate) fn solve(law: Law, albedo: f64, n: usize, orders: usize) -> Radiosity {
        let coarse = Radiosity::on_cells(law, albedo, n / 2, orders);
        let mut solution = Radiosity::on_cells(law, albedo, n, orders);
        for (values, coarse) in solution.orders.iter_mut().zip(&coarse.orders) {
            for (k, coarse) in coarse.iter().enumerate() {
                let (wall_row, column) = (k / (n / 2), k % (n / 2));
                let four = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(i, j)| (2 * wall_row + i) * n + 2 * column + j);
                for lamp in 0..2 {
                    let mean = 0.25 * four.iter().map(|cell| values[*cell][lamp]).sum::<f64>();
                    four.iter().for_each(|cell| values[*cell][lamp] += (mean - coarse[lamp]) / 3.0);
                }
            }
        }
        solution
    }

    fn on_cells(law: Law, albedo: f64, n: usize, orders: usize) -> Radiosity {
        let factors = FormFactors::new(n);
        let cell_area = (EDGE / n as f64).powi(2);
        let direct = (0..WALLS)
            .flat_map(|wall| cells_of(wall, n))
            .map(|cell| LIT_WALLS.map(|lit_wall| direct_flux(law, lit_wall, &cell) / cell_area))
            .collect();
        let mut solution = vec![direct];
        while solution.len() < orders {
            let last: &Vec<ByLamp> = solution.last().expect("there is direct light");
            let place = |k: usize| (k / (n * n), [k % n, k / n % n]);
            let next = (0..WALLS * n * n)
                .map(|k| {
                    let (wall, at) = place(k);
                    let mut sum = [0.0; 2];
                    for (other, before) in last.iter().enumerate() {
                        let (other_wall, other_at) = place(other);
                        if other_wall != wall {
                            let factor = albedo * factors.between(wall, at, other_wall, other_at);
                            sum[0] += factor * before[0];
                            sum[1] += factor * before[1];
                        }
                    }
                    sum
                })
                .collect();
            solution.push(next);
        }
        Radiosity { n, law, albedo, orders: solution }
    }

    /// Flux that a photon of each lamp brings to the cells of an order, as a mean over its photons: the chance that it
    /// arrives there.
    #[cfg(test)]
    pub(crate) fn arrives(&self, order: usize, cells: impl Iterator<Item = usize>) -> ByLamp {
        let cell_area = (EDGE / self.n as f64).powi(2);
        let mut sum = [0.0; 2];
        for cell in cells {
            (0..2).for_each(|lamp| sum[lamp] += cell_area * self.orders[order][cell][lamp]);
        }
        sum
    }

    /// Cells of a wall.
    pub(crate) fn wall(&self, wall: usize) -> std::ops::Range<usize> {
        let n = self.n * self.n;
        wall * n..(wall + 1) * n
    }

    /// Irradiance straight from both lamps at a point of a wall: intensity times cosine over squared distance.
    pub(crate) fn direct_at(&self, wall: usize, point: DVec3) -> f64 {
        let mut sum = 0.0;
        for lit_wall in LIT_WALLS.into_iter().filter(|lit_wall| *lit_wall != wall) {
            for (from, share) in lamp_points(lit_wall) {
                let way = point - from;
                let squared = way.length_squared();
                let cosine = |normal: DVec3| way.dot(normal) / squared.sqrt();
                let intensity = match self.law {
                    Law::Uniform => 1.0 / TAU,
                    Law::Cosine => cosine(inward(lit_wall)) / PI,
                };
                sum += share * intensity * -cosine(inward(wall)) / squared;
            }
        }
        sum
    }

    /// Irradiance of a cell from both lamps, of all orders but the last: what makes up the orders after the first.
    fn all_orders(&self, cell: usize) -> f64 {
        self.orders[..self.orders.len() - 1].iter().map(|order| order[cell][0] + order[cell][1]).sum()
    }

    /// The same between the middles of cells, linearly along both axes; beyond the
    /// outermost ones the line goes on.
    fn between_cells(&self, wall: usize, s: f64, t: f64) -> f64 {
        let n = self.n;
        let place = |x: f64| {
            let x = (x + HALF_EDGE) / EDGE * n as f64 - 0.5;
            let cell = x.floor().clamp(0.0, n as f64 - 2.0);
            (cell as usize, x - cell)
        };
        let ((column, x), (row, y)) = (place(s), place(t));
        let at = |i: usize, j: usize| self.all_orders((wall * n + row + i) * n + column + j);
        (1.0 - y) * ((1.0 - x) * at(0, 0) + x * at(0, 1)) + y * ((1.0 - x) * at(1, 0) + x * at(1, 1))
    }

    /// What all walls reflect to a point of one, from both lamps and of all orders, with the exact form factors of the
    /// point. Cells around the edge next to it are cut finer, since it sees how
    /// light changes across them.
    pub(crate) fn reflected_at(&self, wall: usize, point: DVec3) -> f64 {
        const CUTS: usize = 6;
        let near = 3.0 * EDGE / self.n as f64;
        let mut sum = 0.0;
        for other in (0..WALLS).filter(|other| *other != wall) {
            for (cell, k) in cells_of(other, self.n).zip(self.wall(other)) {
                let seen = |part: &Cell| form_factor_from(point, inward(wall), part);
                let middle = |x: [f64; 2]| 0.5 * (x[0] + x[1]);
                if (on_wall(other, middle(cell.s), middle(cell.t)) - point).length() < near {
                    for part in cell.parts(CUTS) {
                        sum += self.between_cells(other, middle(part.s), middle(part.t)) * seen(&part);
                    }
                } else {
                    sum += self.all_orders(k) * seen(&cell);
                }
            }
        }
        self.albedo * sum
    }

    /// Mean of all light over a disc that lies on its wall.
    #[cfg(test)]
    pub(crate) fn over_disc(&self, wall: usize, [s, t]: [f64; 2], radius: f64) -> f64 {
        let direct: f64 =
            disc_points().map(|(x, y, share)| share * self.direct_at(wall, on_wall(wall, s + radius * x, t + radius * y))).sum();
        direct + self.reflected_over_disc(wall, [s, t], radius)
    }

    /// The same of reflected light, which is smoother: seven points, exact for polynomials up to degree five
    /// (Stroud 1971, S2 5-1).
    #[cfg(test)]
    pub(crate) fn reflected_over_disc(&self, wall: usize, [s, t]: [f64; 2], radius: f64) -> f64 {
        let ring = radius * (2.0f64 / 3.0).sqrt();
        let around = (0..6).map(|k| {
            let (sin, cos) = (TAU * f64::from(k) / 6.0).sin_cos();
            0.125 * self.reflected_at(wall, on_wall(wall, s + ring * cos, t + ring * sin))
        });
        0.25 * self.reflected_at(wall, on_wall(wall, s, t)) + around.sum::<f64>()
    }
}
