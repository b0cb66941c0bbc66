//! Intersection of rays with all triangles of a scene.

use std::time::Duration;

use glam::{DMat2, DVec2, DVec3, DVec4, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use crate::scene::contact_offsets::Offsets;
use crate::scene::material::{TextureUse, UvTransform};
use crate::scene::{Material, Mesh, Scene, Surface, contact, overlap};

/// Rays start this share of the scene's largest coordinate off the surface that they leave: some 10^5
/// roundings of f64, and less than a nanometre in a room.
const OFFSET_SHARE: f64 = 1.0 / (1u64 << 36) as f64;

/// Triangles reach over their edges by this share of themselves, so that no ray slips through between
/// two of them.
const EDGE_SHARE: f64 = 1.0 / (1u64 << 40) as f64;

#[derive(Clone, Copy)]
pub(crate) struct Ray {
    pub origin: DVec3,
    pub direction: DVec3,
}

pub(crate) struct Triangle<'a> {
    pub mesh: &'a Mesh,
    /// Among the mesh's triangles.
    pub index: usize,
    vertices: [usize; 3],
    /// Weights of the vertices at the corners of a triangle of which others hide a part.
    part: Option<[DVec3; 3]>,
    pub corners: [DVec3; 3],
    /// Unit, of the front.
    pub normal: DVec3,
    pub area: f64,
    pub material: &'a Material,
}

#[derive(Clone, Copy)]
pub(crate) struct Hit {
    /// Along the ray, in lengths of its direction.
    pub t: f64,
    pub triangle: usize,
    /// Barycentric, of the three corners.
    pub weights: DVec3,
}

/// A point of a surface, as it is seen from `wo`.
pub(crate) struct Vertex {
    pub position: DVec3,
    /// Geometric and shading normal, unit, both on the side of `wo`.
    pub ng: DVec3,
    pub ns: DVec3,
    pub wo: DVec3,
    pub is_front: bool,
    pub surface: Surface,
    /// Whether this side scatters light at all.
    pub scatters: bool,
    pub base_colour: DVec3,
    /// Radiance towards `wo`.
    pub emission: DVec3,
}

pub(crate) struct Geometry<'a> {
    scene: &'a Scene,
    pub triangles: Vec<Triangle<'a>>,
    bvh: Bvh2,
    /// Of each material ([`crate::scene::material::Layers::film_bound`]).
    pub film_bounds: Vec<f64>,
    /// How far off a surface its rays start, metres.
    pub offset: f64,
}

fn mix<T: std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T>>([a, b, c]: [T; 3], weights: DVec3) -> T {
    a * weights.x + b * weights.y + c * weights.z
}

/// A box of f32 around a triangle, wider by `slack` on all sides.
fn bounds([a, b, c]: [DVec3; 3], slack: f64) -> Aabb {
    let (min, max) = (a.min(b).min(c) - slack, a.max(b).max(c) + slack);
    // One step out for the rounding to f32.
    Aabb::new(Vec3A::from(min.as_vec3().map(f32::next_down)), Vec3A::from(max.as_vec3().map(f32::next_up)))
}

impl Triangle<'_> {
    /// The part of a whole triangle between points with these weights of its corners.
    fn part(&self, weights: [DVec3; 3]) -> Self {
        let corners = weights.map(|weights| mix(self.corners, weights));
        let area = 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
        Triangle { part: Some(weights), corners, area, ..*self }
    }

    /// Weights of the mesh's vertices.
    fn of_vertices(&self, weights: DVec3) -> DVec3 {
        self.part.map_or(weights, |part| mix(part, weights))
    }

    /// What a place has of the values of the triangle's own corners.
    pub(super) fn mixed<T: std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T>>(&self, of_corners: [T; 3], weights: DVec3) -> T {
        mix(of_corners, self.of_vertices(weights))
    }

    /// The same of the values of the mesh's vertices, if it has some.
    fn of_mesh<T: Copy + std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T>>(&self, values: &[T], weights: DVec3) -> Option<T> {
        (!values.is_empty()).then(|| self.mixed(self.vertices.map(|vertex| values[vertex]), weights))
    }

    /// Of the vertices' colours.
    pub(crate) fn alpha(&self, weights: DVec3) -> f64 {
        self.of_mesh(&self.mesh.alphas, weights).unwrap_or(1.0)
    }

    pub(super) fn point(&self, weights: DVec3) -> DVec3 {
        mix(self.corners, weights)
    }

    /// Moeller and Trumbore 1997.
    fn intersect(&self, ray: &Ray) -> Option<(f64, DVec3)> {
        let [a, b, c] = self.corners;
        let (ab, ac) = (b - a, c - a);
        let p = ray.direction.cross(ac);
        let determinant = ab.dot(p);
        if determinant == 0.0 {
            return None;
        }
        let from_a = ray.origin - a;
        let q = from_a.cross(ab);
        let (u, v) = (from_a.dot(p) / determinant, ray.direction.dot(q) / determinant);
        let weights = DVec3::new(1.0 - u - v, u, v);
        (weights.min_element() >= -EDGE_SHARE).then(|| (ac.dot(q) / determinant, weights))
    }
}

impl<'a> Geometry<'a> {
    pub(super) fn new(scene: &'a Scene) -> Geometry<'a> {
        let mut triangles = Vec::new();
        let kinds = contact::kinds(scene);
        let offsets = Offsets::of(scene, &kinds);
        let corners_of = |mesh: u32, triangle: u32| offsets.corners(scene, mesh, triangle);
        let overlaps = overlap::of_scene(scene, &kinds, corners_of);
        for (number, mesh) in (0u32..).zip(&scene.meshes) {
            for index in (0..mesh.triangles.len()).filter(|index| mesh.area(*index) > 0.0) {
                let whole = Triangle {
                    mesh,
                    index,
                    vertices: mesh.triangles[index].map(|vertex| vertex as usize),
                    part: None,
                    corners: corners_of(number, index as u32),
                    normal: mesh.normal(index),
                    area: mesh.area(index),
                    material: &scene.materials[mesh.material],
                };
                match overlaps.get(&(number, index as u32)) {
                    None => triangles.push(whole),
                    Some(pieces) => triangles.extend(pieces.iter().map(|piece| whole.part(*piece))),
                }
            }
        }
        let corners = triangles.iter().flat_map(|triangle| triangle.corners);
        let offset = OFFSET_SHARE * corners.fold(0.0, |size: f64, corner| size.max(corner.abs().max_element()));
        let boxes: Vec<Aabb> = triangles.iter().map(|triangle| bounds(triangle.corners, offset)).collect();
        // The builder wants at least one box.
        let bvh = match boxes.len() {
            0 => Bvh2::default(),
            _ => build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut Duration::default()),
        };
        let film_bounds = scene.materials.iter().map(|material| material.layers.film_bound()).collect();
        Geometry { scene, triangles, bvh, film_bounds, offset }
    }

    /// A ray that leaves a surface with this normal, on the side that it points to.
    pub(super) fn leaving(&self, position: DVec3, normal: DVec3, direction: DVec3) -> Ray {
        let side = direction.dot(normal).signum();
        Ray { origin: position + side * self.offset * normal, direction }
    }

    /// The nearest hit with 0 < t < `t_max`.
    pub(super) fn closest_hit(&self, ray: &Ray, t_max: f64) -> Option<Hit> {
        let (mut nearest, mut t_max) = (None, t_max);
        // An axis along which the ray does not move gets a huge slope: an infinite one would turn a box
        // that begins at the origin into no number.
        let inverse = ray.direction.map(|d| if d == 0.0 { 1e300 } else { 1.0 / d });
        let entered = |place: usize| {
            let bounds = self.bvh.nodes[place].aabb();
            let to_min = (bounds.min.as_dvec3() - ray.origin) * inverse;
            let to_max = (bounds.max.as_dvec3() - ray.origin) * inverse;
            let (enter, leave) = (to_min.min(to_max).max_element().max(0.0), to_min.max(to_max).min_element());
            (if enter <= leave { enter } else { f64::INFINITY }, place)
        };
        let mut to_visit = Vec::with_capacity(64);
        to_visit.extend((!self.bvh.nodes.is_empty()).then(|| entered(0)));
        while let Some((enter, place)) = to_visit.pop() {
            if enter >= t_max {
                continue;
            }
            let node = &self.bvh.nodes[place];
            let first = node.first_index as usize;
            if !node.is_leaf() {
                let (a, b) = (entered(first), entered(first + 1));
                // The nearer one on top.
                to_visit.extend(if a.0 < b.0 { [b, a] } else { [a, b] });
                continue;
            }
            for primitive in &self.bvh.primitive_indices[first..first + node.prim_count as usize] {
                let triangle = *primitive as usize;
                match self.triangles[triangle].intersect(ray) {
                    Some((t, weights)) if t > 0.0 && t < t_max => {
                        t_max = t;
                        nearest = Some(Hit { t, triangle, weights });
                    }
                    _ => {}
                }
            }
        }
        nearest
    }

    /// A texture at a point of a triangle; 1 without one.
    pub(super) fn texel(&self, texture: Option<TextureUse>, triangle: &Triangle, weights: DVec3) -> DVec4 {
        let Some(TextureUse { texture, uv_set, transform: UvTransform { scale, rotation, offset } }) = texture else { return DVec4::ONE };
        let uv = triangle.of_mesh(&triangle.mesh.uvs[uv_set], weights).unwrap_or(DVec2::ZERO);
        // A turn of the plane's points by minus the angle, v being its second axis.
        let turned = DMat2::from_angle(-rotation) * DMat2::from_diagonal(scale);
        self.scene.textures[texture].sample(turned * uv + offset).as_dvec4()
    }

    /// Radiance that leaves a triangle's emissive side.
    pub(super) fn emission(&self, triangle: &Triangle, weights: DVec3) -> DVec3 {
        let material = triangle.material;
        material.emission.as_dvec3() * self.texel(material.emission_texture, triangle, weights).truncate()
    }

    pub(super) fn vertex(&self, hit: &Hit, wo: DVec3) -> Vertex {
        let triangle = &self.triangles[hit.triangle];
        let material = triangle.material;
        let is_front = wo.dot(triangle.normal) > 0.0;
        let ng = if is_front { triangle.normal } else { -triangle.normal };
        let shown = is_front || material.has_two_sides();
        Vertex {
            position: triangle.point(hit.weights),
            ng,
            ns: shading_normal(triangle, hit.weights, ng, wo),
            wo,
            is_front,
            surface: material.surface,
            scatters: shown || matches!(material.surface, Surface::Dielectric { .. }),
            base_colour: material.base_colour.as_dvec3()
                * self.texel(material.base_colour_texture, triangle, hit.weights).truncate()
                * triangle.of_mesh(&triangle.mesh.colours, hit.weights).unwrap_or(DVec3::ONE),
            emission: if shown && !material.layers.is_unlit { self.emission(triangle, hit.weights) } else { DVec3::ZERO },
        }
    }
}

/// On the side of `ng`; `ng` itself where there is no other, or where it would be seen from below.
fn shading_normal(triangle: &Triangle, weights: DVec3, ng: DVec3, wo: DVec3) -> DVec3 {
    let Some(normal) = triangle.of_mesh(&triangle.mesh.normals, weights) else { return ng };
    let normal = normal.normalize_or(ng);
    let ns = if normal.dot(ng) < 0.0 { -normal } else { normal };
    if ns.dot(wo) > 0.0 { ns } else { ng }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::built_in;
    use crate::verify::judge::{random, uniform};

    #[test]
    fn the_tree_finds_what_all_triangles_say() {
        let scene = built_in::by_name("cornell-spheres").unwrap();
        let geometry = Geometry::new(&scene);
        let mut rng = random(1, 0);
        let mut hit_count = 0;
        for _ in 0..500 {
            let mut point = || DVec3::from_array([(); 3].map(|()| 1.5 * uniform(&mut rng) - 0.25));
            let (origin, target) = (point(), point());
            // Some along an axis, from the planes of walls.
            let ray = if hit_count % 3 == 0 {
                Ray { origin: origin.with_y(0.0), direction: DVec3::X }
            } else {
                Ray { origin, direction: target - origin }
            };
            let all = geometry.triangles.iter().filter_map(|triangle| triangle.intersect(&ray)).map(|(t, _)| t);
            let nearest = all.filter(|t| *t > 0.0).fold(f64::INFINITY, f64::min);
            assert_eq!(geometry.closest_hit(&ray, f64::INFINITY).map_or(f64::INFINITY, |hit| hit.t), nearest);
            assert!(geometry.closest_hit(&ray, nearest).is_none());
            hit_count += usize::from(nearest.is_finite());
        }
        assert!(hit_count > 100, "{hit_count} hits");
    }
}
