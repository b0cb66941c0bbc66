//! Triangle meshes in world space.

use std::collections::HashMap;

use glam::{DVec2, DVec3, DVec4};
use rayon::prelude::*;

use super::bounds_of;

/// One primitive of one node: vertices, triangles, one material.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Name of its node, or of its mesh.
    pub name: String,
    /// Metres, world.
    pub positions: Vec<DVec3>,
    /// Unit shading normals, one per vertex; empty where the mesh is flat.
    pub normals: Vec<DVec3>,
    /// Texture coordinates, one per vertex, of up to two sets; empty where there are none.
    pub uvs: [Vec<DVec2>; 2],
    /// Linear, one per vertex, each channel from 0 to 1; they multiply the material's base colour. Empty where there are none.
    pub colours: Vec<DVec3>,
    /// Alpha, one per vertex, which multiplies the material's. Empty where all are 1.
    pub alphas: Vec<f64>,
    /// Of each triangle's corners, for the texture of the material's normal map: a unit tangent and the sign of the bitangent,
    /// sign * (normal x tangent). Empty where the material has no normal map.
    pub tangents: Vec<[DVec4; 3]>,
    /// The same for the normal map of its coat.
    pub coat_tangents: Vec<[DVec4; 3]>,
    /// Counter-clockwise from the front.
    pub triangles: Vec<[u32; 3]>,
    pub material: usize,
    /// `None` where it is not from a file.
    pub source: Option<Source>,
}

/// Which part of a glTF file a mesh was made of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    pub node: usize,
    pub mesh: usize,
    pub primitive: usize,
    /// The vertex of the primitive that each vertex was; empty where they are the same.
    pub vertices: Vec<u32>,
}

impl Source {
    /// The vertex of the primitive that a vertex of the mesh was.
    pub fn vertex(&self, vertex: u32) -> u32 {
        if self.vertices.is_empty() { vertex } else { self.vertices[vertex as usize] }
    }
}

/// Triangles whose area is below this share of the scene's squared extent are lines: rounding of their corners
/// alone gives so much. What single precision cannot distinguish from a line goes when the scene is normalised.
const MIN_AREA_SHARE: f64 = 1.0 / (1u128 << 80) as f64;

/// Triangles that are not worth sharing among threads.
const MIN_PIECE: usize = 4096;

/// Corners of a seam that are this share of a mesh's extent apart are one: half a unit of single precision.
const SEAM_SHARE: f64 = 1.0 / (1 << 24) as f64;

impl Mesh {
    /// Corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|vertex| self.positions[vertex as usize])
    }

    /// Twice the area, along the front's normal.
    fn doubled_area([a, b, c]: [DVec3; 3]) -> DVec3 {
        (b - a).cross(c - a)
    }

    pub fn area(&self, triangle: usize) -> f64 {
        0.5 * Mesh::doubled_area(self.corners(triangle)).length()
    }

    /// Of all triangles.
    pub fn whole_area(&self) -> f64 {
        (0..self.triangles.len()).map(|triangle| self.area(triangle)).sum()
    }

    /// Unit normal of a triangle's front.
    pub fn normal(&self, triangle: usize) -> DVec3 {
        Mesh::doubled_area(self.corners(triangle)).normalize()
    }

    /// Brings vertex colours and alphas into 0 to 1, and says whether any was outside. Alphas that are all 1 are none.
    pub fn clamp_colours(&mut self) -> bool {
        let colours = self.colours.iter_mut().flat_map(DVec3::as_mut);
        let mut is_cut = false;
        for value in colours.chain(&mut self.alphas) {
            is_cut |= !(0.0..=1.0).contains(value);
            *value = value.clamp(0.0, 1.0);
        }
        if self.alphas.iter().all(|alpha| *alpha == 1.0) {
            self.alphas = Vec::new();
        }
        is_cut
    }

    /// Whether the triangles of meshes bound a volume together: as many have an edge in one direction as in the other. Corners at one
    /// place are one corner, also where a sine of a whole turn has put them 1e-16 apart.
    pub fn are_closed<'m>(meshes: impl IntoIterator<Item = &'m Mesh> + Clone) -> bool {
        let (min, max) = bounds_of(meshes.clone().into_iter().flat_map(|mesh| &mesh.positions).copied());
        let cell = (max - min).max_element() * SEAM_SHARE;
        let place = |corner: DVec3| ((corner - min) / cell).to_array().map(|cells| cells.round() as u64);
        let mut surplus: HashMap<_, i64> = HashMap::new();
        for mesh in meshes {
            for [a, b, c] in (0..mesh.triangles.len()).map(|triangle| mesh.corners(triangle).map(place)) {
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    *surplus.entry((from.min(to), from.max(to))).or_default() += i64::from(from < to) - i64::from(from > to);
                }
            }
        }
        surplus.values().all(|surplus| *surplus == 0)
    }

    /// Takes away triangles without area and returns their number.
    pub fn drop_degenerate_triangles(&mut self, scene_extent: f64) -> usize {
        let before = self.triangles.len();
        let least = MIN_AREA_SHARE * scene_extent * scene_extent;
        let positions = &self.positions;
        let has_area = |vertices: &[u32; 3]| {
            let corners = vertices.map(|vertex| positions[vertex as usize]);
            0.5 * Mesh::doubled_area(corners).length() > least
        };
        // On all cores, as there seldom is one.
        if !self.triangles.par_iter().with_min_len(MIN_PIECE).all(has_area) {
            let kept: Vec<bool> = self.triangles.par_iter().map(has_area).collect();
            fn retain<T>(of_triangles: &mut Vec<T>, kept: &[bool]) {
                let mut kept = kept.iter();
                of_triangles.retain(|_| *kept.next().expect("one for each"));
            }
            retain(&mut self.triangles, &kept);
            for tangents in [&mut self.tangents, &mut self.coat_tangents].into_iter().filter(|tangents| !tangents.is_empty()) {
                retain(tangents, &kept);
            }
        }
        before - self.triangles.len()
    }

    /// A parallelogram of two triangles: `origin`, `origin` + u, `origin` + u + v, `origin` + v; its
    /// front faces along u x v.
    pub fn parallelogram(name: &str, origin: DVec3, u: DVec3, v: DVec3, material: usize) -> Mesh {
        Mesh {
            name: name.to_owned(),
            positions: vec![origin, origin + u, origin + u + v, origin + v],
            uvs: [vec![DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y], Vec::new()],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            material,
            ..Mesh::default()
        }
    }

    /// A sphere with smooth normals, of `segments` meridians and half as many parallels.
    pub fn sphere(name: &str, centre: DVec3, radius: f64, segments: u32, material: usize) -> Mesh {
        let rings = segments / 2;
        let mut mesh = Mesh { name: name.to_owned(), material, ..Mesh::default() };
        for ring in 0..=rings {
            let polar = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
            for segment in 0..=segments {
                let azimuth = std::f64::consts::TAU * f64::from(segment) / f64::from(segments);
                let normal = DVec3::new(polar.sin() * azimuth.cos(), polar.cos(), polar.sin() * azimuth.sin());
                mesh.positions.push(centre + radius * normal);
                mesh.normals.push(normal);
                mesh.uvs[0].push(DVec2::new(f64::from(segment) / f64::from(segments), f64::from(ring) / f64::from(rings)));
            }
        }
        let vertex = |ring: u32, segment: u32| ring * (segments + 1) + segment;
        for ring in 0..rings {
            for segment in 0..segments {
                let [a, b, c, d] =
                    [vertex(ring, segment), vertex(ring, segment + 1), vertex(ring + 1, segment + 1), vertex(ring + 1, segment)];
                // At the poles one side of the quadrilateral has no length.
                if ring > 0 {
                    mesh.triangles.push([a, b, c]);
                }
                if ring + 1 < rings {
                    mesh.triangles.push([a, c, d]);
                }
            }
        }
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_with_holes_are_not_closed() {
        let tetrahedron = || Mesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
            ..Mesh::default()
        };
        assert!(Mesh::are_closed([&tetrahedron()]));
        // A vertex for each triangle's corner, and zeros of both signs.
        let split = tetrahedron().triangles.concat();
        let corner = |vertex: &u32| tetrahedron().positions[*vertex as usize];
        let mut seams = Mesh {
            positions: split.iter().map(corner).collect(),
            triangles: (0..4).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
            ..Mesh::default()
        };
        seams.positions[0] = -DVec3::ZERO;
        assert!(Mesh::are_closed([&seams]));
        // The sine of a whole turn.
        seams.positions[0] = DVec3::new(-2.4e-16, 0.0, 2.4e-16);
        assert!(Mesh::are_closed([&seams]));
        seams.positions[0] = DVec3::new(-1e-6, 0.0, 0.0);
        assert!(!Mesh::are_closed([&seams]));
        // A triangle without area between others.
        let mut halved = tetrahedron();
        halved.positions.push(DVec3::new(0.5, 0.5, 0.0));
        halved.triangles[3] = [1, 4, 3];
        halved.triangles.extend([[4, 2, 3], [1, 2, 4]]);
        assert!(Mesh::are_closed([&halved]));
        let change = |change: fn(&mut Mesh)| {
            let mut mesh = tetrahedron();
            change(&mut mesh);
            Mesh::are_closed([&mesh])
        };
        assert!(!change(|mesh| mesh.triangles.truncate(3)));
        assert!(!change(|mesh| mesh.triangles[0].swap(0, 1)));
        assert!(!change(|mesh| mesh.triangles[0][1] = 3));
        // Halves are open, and closed together.
        let half = |triangles: &[[u32; 3]]| Mesh { triangles: triangles.to_vec(), ..tetrahedron() };
        let halves = tetrahedron().triangles;
        let halves = [half(&halves[..2]), half(&halves[2..])];
        assert!(halves.iter().all(|half| !Mesh::are_closed([half])) && Mesh::are_closed(&halves));
    }

    #[test]
    fn spheres_face_outwards_and_have_their_area() {
        let centre = DVec3::new(1.0, 2.0, 3.0);
        let sphere = Mesh::sphere("ball", centre, 0.5, 64, 0);
        let mut area = 0.0;
        for triangle in 0..sphere.triangles.len() {
            let [a, b, c] = sphere.corners(triangle);
            assert!(sphere.normal(triangle).dot((a + b + c) / 3.0 - centre) > 0.0, "triangle {triangle}");
            area += sphere.area(triangle);
        }
        let exact = std::f64::consts::PI;
        assert!(area < exact && area > 0.995 * exact, "{area}");
    }

    #[test]
    fn triangles_without_area_go() {
        let mut mesh = Mesh::parallelogram("wall", DVec3::ZERO, DVec3::X, DVec3::Y, 0);
        mesh.positions.push(DVec3::new(0.5, 1e-25, 0.0));
        mesh.triangles.extend([[0, 1, 4], [2, 2, 3]]);
        assert_eq!(mesh.drop_degenerate_triangles(1.0), 2);
        assert_eq!(mesh.triangles.len(), 2);
    }
}
