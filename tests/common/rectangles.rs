//! Irradiance in closed rooms of rectangles, in f64 by radiosity: a second opinion on scenes of triangles that shares no code
//! with them and knows no photon.
//!
//! Every form factor is that of a point and of the part of a rectangle that it sees, exact to rounding: what stands in between
//! is cut away as polygons, and the rest is summed by Lambert's formula over its edges. So the form factors from a point of a
//! closed room add up to 1, and a cavity is evenly lit, which a test asks for. Surfaces are cut into patches of constant radiosity, finer near what is small,
//! and irradiance is gathered from them at the points that are asked about.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

/// A rectangle that faces along u x v, with what it scatters and what it emits, W/m2/sr. Its back is black.
#[derive(Debug, Clone, Copy)]
pub struct Rectangle {
    pub origin: DVec3,
    pub u: DVec3,
    pub v: DVec3,
    pub albedo: DVec3,
    pub emission: DVec3,
    /// Whether it stands between others; the walls of a convex room do not.
    pub blocks: bool,
}

impl Rectangle {
    pub fn normal(&self) -> DVec3 {
        self.u.cross(self.v).normalize()
    }

    pub fn at(&self, place: DVec2) -> DVec3 {
        self.origin + place.x * self.u + place.y * self.v
    }

    pub fn area(&self) -> f64 {
        self.u.cross(self.v).length()
    }

    fn corners(&self) -> [DVec3; 4] {
        [self.origin, self.origin + self.u, self.origin + self.u + self.v, self.origin + self.v]
    }

    fn diagonal(&self) -> f64 {
        (self.u + self.v).length()
    }

    /// Whether it meets the plane of a surface.
    pub fn reaches(&self, at: DVec3, normal: DVec3) -> bool {
        let heights = self.corners().map(|corner| normal.dot(corner - at));
        heights.iter().any(|height| *height < 1e-9) && heights.iter().any(|height| *height > -1e-9)
    }

    pub fn distance(&self, to: DVec3) -> f64 {
        let way = to - self.origin;
        let share = |edge: DVec3| (way.dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
        self.at(DVec2::new(share(self.u), share(self.v))).distance(to)
    }

    fn part(&self, from: DVec2, size: DVec2) -> Rectangle {
        Rectangle { origin: self.at(from), u: size.x * self.u, v: size.y * self.v, ..*self }
    }

    /// The two halves across its longer edge.
    fn halves(&self) -> [Rectangle; 2] {
        self.parts(self.u.length() >= self.v.length(), 0.5)
    }

    /// Cut across u, or across v, at this share of its length.
    fn parts(&self, across_u: bool, share: f64) -> [Rectangle; 2] {
        let size = |share: f64| if across_u { DVec2::new(share, 1.0) } else { DVec2::new(1.0, share) };
        [self.part(DVec2::ZERO, size(share)), self.part(size(share) - size(0.0), size(1.0 - share))]
    }

    /// What of it lies on either side of a plane across one of its edges.
    pub fn cut_at(&self, axis: DVec3, at: f64) -> Vec<Rectangle> {
        let share = |edge: DVec3| (at - self.origin.dot(axis)) / edge.dot(axis);
        let crossed = [(true, share(self.u)), (false, share(self.v))].into_iter().find(|(_, share)| *share > 1e-9 && *share < 1.0 - 1e-9);
        crossed.map_or(vec![*self], |(across_u, share)| self.parts(across_u, share).into())
    }
}

/// A convex polygon as a point sees it that lies in the origin.
type Polygon = Vec<DVec3>;

/// The parts of a polygon on the positive and on the negative side of a plane.
fn cut(polygon: &[DVec3], side: impl Fn(DVec3) -> f64) -> (Polygon, Polygon) {
    let (mut above, mut below) = (Vec::with_capacity(polygon.len() + 1), Vec::with_capacity(polygon.len() + 1));
    for (k, &corner) in polygon.iter().enumerate() {
        let next = polygon[(k + 1) % polygon.len()];
        let (here, there) = (side(corner), side(next));
        if here >= 0.0 {
            above.push(corner);
        }
        if here <= 0.0 {
            below.push(corner);
        }
        if here * there < 0.0 {
            let crossing = corner + here / (here - there) * (next - corner);
            above.push(crossing);
            below.push(crossing);
        }
    }
    (above, below)
}

/// What a rectangle hides from a point in the origin: all that lies within these planes, of which the last is its own.
struct Shadow {
    planes: [(DVec3, f64); 5],
}

impl Shadow {
    fn new(corners: [DVec3; 4], normal: DVec3) -> Shadow {
        let own = (-normal, normal.dot(corners[0]));
        let side = |k: usize| (corners[(k + 1) % 4].cross(corners[k]).normalize(), 0.0);
        Shadow { planes: [side(0), side(1), side(2), side(3), own] }
    }

    fn side(&self, plane: usize, at: DVec3) -> f64 {
        self.planes[plane].0.dot(at) + self.planes[plane].1
    }

    /// Whether it surely hides nothing of a polygon.
    fn spares(&self, polygon: &[DVec3]) -> bool {
        (0..5).any(|plane| polygon.iter().all(|at| self.side(plane, *at) <= 0.0))
    }

    /// Adds what is left of a polygon.
    fn cast(&self, polygon: Polygon, left: &mut Vec<Polygon>) {
        if self.spares(&polygon) {
            left.push(polygon);
            return;
        }
        let mut hidden = polygon;
        for k in 0..5 {
            let (inside, outside) = cut(&hidden, |at| self.side(k, at));
            if outside.len() > 2 {
                left.push(outside);
            }
            if inside.len() < 3 {
                return;
            }
            hidden = inside;
        }
    }
}

/// Share of what leaves a small surface in the origin evenly that meets a polygon, by the sum over its edges (Lambert 1760).
fn form_factor(polygon: &[DVec3], normal: DVec3) -> f64 {
    let cut_off;
    let above = if polygon.iter().all(|at| normal.dot(*at) >= 0.0) {
        polygon
    } else {
        cut_off = cut(polygon, |at| normal.dot(at)).0;
        &cut_off
    };
    let edge = |k: usize| {
        let (a, b) = (above[k], above[(k + 1) % above.len()]);
        let cross = a.cross(b);
        let sine = cross.length();
        if sine > 0.0 { normal.dot(cross) / sine * sine.atan2(a.dot(b)) } else { 0.0 }
    };
    (0..above.len()).map(edge).sum::<f64>().abs() / TAU
}

/// A point of a surface and what stands before others as it sees them.
struct GatherPoint {
    at: DVec3,
    normal: DVec3,
    shadows: Vec<Shadow>,
}

impl GatherPoint {
    fn new(room: &[Rectangle], at: DVec3, normal: DVec3) -> GatherPoint {
        let shadow = |rectangle: &Rectangle| {
            let facing = rectangle.normal();
            let corners = rectangle.corners().map(|corner| corner - at);
            // Nothing is behind the surface's own plane.
            let is_above = corners.iter().any(|corner| normal.dot(*corner) > 1e-12 * rectangle.diagonal());
            let is_seen = rectangle.blocks && is_above && -facing.dot(corners[0]) > 1e-12 * rectangle.diagonal();
            is_seen.then(|| Shadow::new(corners, facing))
        };
        GatherPoint { at, normal, shadows: room.iter().filter_map(shadow).collect() }
    }

    /// Of what it sees of a rectangle's front.
    fn form_factor(&self, of: &Rectangle) -> f64 {
        let corners = of.corners().map(|corner| corner - self.at);
        let least = 1e-12 * of.diagonal();
        if -of.normal().dot(corners[0]) <= least || corners.iter().all(|corner| self.normal.dot(*corner) <= least) {
            return 0.0;
        }
        // Most of a room is not hidden, and needs no polygons of its own.
        if self.shadows.iter().all(|shadow| shadow.spares(&corners)) {
            return form_factor(&corners, self.normal);
        }
        let mut seen = vec![corners.to_vec()];
        let mut left = Vec::new();
        for shadow in &self.shadows {
            seen.drain(..).for_each(|polygon| shadow.cast(polygon, &mut left));
            std::mem::swap(&mut seen, &mut left);
        }
        seen.iter().map(|polygon| form_factor(polygon, self.normal)).sum()
    }
}

/// A patch of constant light.
struct Patch {
    of: Rectangle,
    /// Irradiance from lamps, W/m2.
    direct: DVec3,
    /// Irradiance from other patches, W/m2.
    indirect: DVec3,
}

/// A room that is solved.
pub struct Radiosity {
    room: Vec<Rectangle>,
    patches: Vec<Patch>,
}

/// Places of a patch along each edge at which lamps are looked at.
const PLACES: u32 = 3;
/// Relative change of a bounce that is the last.
const SETTLED: f64 = 1e-9;
/// Of patches with a larger form factor lamps are looked at by parts.
const FAR: f64 = 0.004;

impl Radiosity {
    /// Of patches whose diagonals are this share of the room's, and of the size and distance of what is smaller.
    pub fn solve(room: &[Rectangle], fineness: f64) -> Radiosity {
        let mut patches = patches(room, fineness);
        let row = |patch: &Patch| -> Vec<f64> {
            let gather_point = GatherPoint::new(room, patch.of.at(DVec2::splat(0.5)), patch.of.normal());
            patches.iter().map(|other| gather_point.form_factor(&other.of)).collect()
        };
        let factors: Vec<Vec<f64>> = patches.iter().map(row).collect();
        let mut before = 0.0;
        loop {
            let scattered: Vec<DVec3> = patches.iter().map(|patch| patch.of.albedo * (patch.direct + patch.indirect)).collect();
            for (patch, factors) in patches.iter_mut().zip(&factors) {
                patch.indirect = factors.iter().zip(&scattered).map(|(factor, light)| *factor * *light).sum();
            }
            let sum = scattered.iter().sum::<DVec3>().element_sum();
            if sum - before <= SETTLED * sum {
                return Radiosity { room: room.to_vec(), patches };
            }
            before = sum;
        }
    }

    /// Irradiance at a point of a surface, W/m2.
    pub fn irradiance(&self, at: DVec3, normal: DVec3) -> DVec3 {
        let gather_point = GatherPoint::new(&self.room, at, normal);
        let of_patch = |patch: &Patch| patch.of.albedo * self.gather(&gather_point, &patch.of, patch);
        direct(&self.room, at, normal) + self.patches.iter().map(of_patch).sum::<DVec3>()
    }

    /// Irradiance of a part of a patch times its form factor: near the point that asks lamps are looked at from smaller parts.
    fn gather(&self, gather_point: &GatherPoint, part: &Rectangle, patch: &Patch) -> DVec3 {
        let factor = gather_point.form_factor(part);
        if factor == 0.0 {
            return DVec3::ZERO;
        }
        let is_whole = part.diagonal() == patch.of.diagonal();
        if factor > FAR && part.diagonal() > patch.of.diagonal() / 16.0 {
            return part.halves().iter().map(|half| self.gather(gather_point, half, patch)).sum();
        }
        let irradiance = if is_whole { patch.direct } else { direct(&self.room, part.at(DVec2::splat(0.5)), part.normal()) };
        factor * (irradiance + patch.indirect)
    }
}

/// Irradiance straight from what emits light.
pub fn direct(room: &[Rectangle], at: DVec3, normal: DVec3) -> DVec3 {
    let gather_point = GatherPoint::new(room, at, normal);
    let lamps = room.iter().filter(|lamp| lamp.emission != DVec3::ZERO);
    lamps.map(|lamp| PI * gather_point.form_factor(lamp) * lamp.emission).sum()
}

/// Patches with their direct light, as fine near small things as these call for, and wherever much light differs within a patch.
fn patches(room: &[Rectangle], fineness: f64) -> Vec<Patch> {
    let corners = || room.iter().flat_map(Rectangle::corners);
    let (min, max) = corners().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), at| (min.min(at), max.max(at)));
    let largest = fineness * (max - min).length();
    let power: f64 = room.iter().map(|lamp| PI * lamp.emission.max_element() * lamp.area()).sum();
    let mut patches = Vec::new();
    for (k, rectangle) in room.iter().enumerate().filter(|(_, rectangle)| rectangle.albedo != DVec3::ZERO) {
        let mut open = vec![*rectangle];
        while let Some(patch) = open.pop() {
            let middle = patch.at(DVec2::splat(0.5));
            let is_fine = |(other, small): (usize, &Rectangle)| {
                let distance = (small.distance(middle) - 0.5 * patch.diagonal()).max(0.0);
                other == k || !small.blocks || patch.diagonal() <= 2.0 * fineness * (distance + small.diagonal())
            };
            let most = largest.min(2.0 * fineness * rectangle.diagonal());
            if patch.diagonal() > most || !room.iter().enumerate().all(is_fine) {
                open.extend(patch.halves());
                continue;
            }
            let place = |i: u32| (f64::from(i) + 0.5) / f64::from(PLACES);
            let places = (0..PLACES * PLACES).map(|k| DVec2::new(place(k % PLACES), place(k / PLACES)));
            let irradiance: Vec<DVec3> = places.map(|place| direct(room, patch.at(place), patch.normal())).collect();
            let (least, most) =
                irradiance.iter().fold((irradiance[0], irradiance[0]), |(least, most), light| (least.min(*light), most.max(*light)));
            let differing = (patch.albedo * (most - least)).max_element() * patch.area();
            if differing > DIFFERING * fineness * fineness * power {
                open.extend(patch.halves());
                continue;
            }
            let direct = irradiance.iter().sum::<DVec3>() / f64::from(PLACES * PLACES);
            patches.push(Patch { of: patch, direct, indirect: DVec3::ZERO });
        }
    }
    patches
}

/// Most light of all that may differ within a patch, over the squared fineness.
const DIFFERING: f64 = 0.004;
