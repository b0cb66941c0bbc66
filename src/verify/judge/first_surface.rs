//! What a camera sees first at each pixel, whatever light falls on it: for the layers of a picture.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::geometry::{Geometry, Ray};
use crate::scene::{Camera, Scene, Surface};

/// Rays of a pixel, in its widths from its centre: a turned square, so that edges along rows and columns have all four steps.
const OFFSETS: [[f64; 2]; 4] = [[-0.125, -0.375], [0.375, -0.125], [-0.375, 0.125], [0.125, 0.375]];
/// Gaps that a ray passes: many leaves behind each other.
const MOST_GAPS: u32 = 64;
/// What is left of a ray behind surfaces that are partly there, below which nothing behind them counts.
const LEAST_LEFT: f64 = 1e-3;

/// Means over a pixel; 0 where it sees nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FirstSurface {
    /// The colour that its material has there, before any light.
    pub albedo: DVec3,
    /// The shading normal on the camera's side, in the scene's axes.
    pub normal: DVec3,
    /// From the camera along the ray through the pixel's centre, metres; infinite where it sees nothing.
    pub depth: f64,
}

/// Row by row from the top. A lens is taken for a pinhole: what is out of focus stays sharp.
pub(crate) fn first_surfaces(scene: &Scene, camera: &Camera, (width, height): (u32, u32)) -> Vec<FirstSurface> {
    let geometry = Geometry::new(scene);
    let camera = Camera { lens: None, ..camera.clone() };
    let aspect = f64::from(width) / f64::from(height);
    let pixel = |number: u32| {
        let (column, row) = (f64::from(number % width) + 0.5, f64::from(number / width) + 0.5);
        let seen = |[right, down]: [f64; 2]| {
            let (x, y) = (2.0 * (column + right) / f64::from(width) - 1.0, 1.0 - 2.0 * (row + down) / f64::from(height));
            let (origin, direction) = camera.ray(x, y, aspect, DVec2::ZERO);
            geometry.first_surface(Ray { origin, direction })
        };
        let share = 1.0 / OFFSETS.len() as f64;
        let mut mean = FirstSurface { depth: seen([0.0; 2]).depth, ..FirstSurface::NONE };
        for of_ray in OFFSETS.map(seen) {
            mean.albedo += share * of_ray.albedo;
            mean.normal += share * of_ray.normal;
        }
        mean
    };
    (0..width * height).into_par_iter().map(pixel).collect()
}

impl FirstSurface {
    const NONE: FirstSurface = FirstSurface { albedo: DVec3::ZERO, normal: DVec3::ZERO, depth: f64::INFINITY };
}

impl Geometry<'_> {
    /// Along one ray. Surfaces that are partly there, as leaves cut out by alpha, count by their shares; the depth is that of the first
    /// one that hides half of what is behind it.
    fn first_surface(&self, ray: Ray) -> FirstSurface {
        let mut sum = FirstSurface::NONE;
        let (mut ray, mut passed, mut left) = (ray, 0.0, 1.0);
        for _ in 0..MOST_GAPS {
            let Some(hit) = self.closest_hit(&ray, f64::INFINITY) else { break };
            let vertex = self.vertex(&hit, -ray.direction);
            let triangle = &self.triangles[hit.triangle];
            // An eye does not see the back of a layered surface that has one side.
            let is_culled = vertex.surface == Surface::Layered && !vertex.scatters;
            let coverage = if is_culled { 0.0 } else { self.coverage(triangle, hit.weights) };
            if coverage > 0.0 {
                let share = left * coverage;
                sum.albedo += share * if vertex.scatters { vertex.base_colour } else { DVec3::ZERO };
                sum.normal += share * self.mapped_normal(&hit, &vertex);
            }
            if coverage >= 0.5 && sum.depth == f64::INFINITY {
                sum.depth = passed + hit.t;
            }
            left *= 1.0 - coverage;
            if left < LEAST_LEFT {
                break;
            }
            let next = self.leaving(vertex.position, vertex.ng, ray.direction);
            passed += (next.origin - ray.origin).dot(ray.direction);
            ray = next;
        }
        sum
    }
}
