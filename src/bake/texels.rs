//! Which texels of a map the triangles of its mesh cover, and in which points of the surface each of
//! them is looked at.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::raster::{Lattice, Triangle};
use super::{PHASE_COUNT, TexelSample};
use crate::scene::Mesh;

/// A point of a mesh, by the weights of its triangle's second and third corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfacePoint {
    pub triangle: u32,
    pub weights: [f32; 2],
}

/// A texel that a triangle covers, and one point of it a phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CoveredTexel {
    pub x: u32,
    pub y: u32,
    pub points: [SurfacePoint; PHASE_COUNT],
}

/// Sub-positions along each side of a texel.
const SUB: u32 = 4;

/// Sub-positions (column, row) of a texel, quadrant by quadrant, so that every fourth one from the
/// third on makes a rotated grid: one in each quadrant, row and column, their mean the centre.
const ORDER: [(u32, u32); 16] =
    [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1), (3, 1), (3, 0), (1, 2), (1, 3), (0, 2), (0, 3), (3, 2), (3, 3), (2, 3), (2, 2)];

/// Rows of texels looked at together: what bounds memory, and one unit of parallel work.
const BAND: u32 = 32;

const NONE: u32 = u32::MAX;

/// Texels of the map that triangles cover, row by row. A texel is covered if one of its sub-positions
/// lies in a triangle; a triangle so small that it holds none covers the texel of its centroid. So
/// every triangle lies in some covered texel.
pub(crate) fn covered(mesh: &Mesh, uvs: &[DVec2], width: u32, height: u32) -> Vec<CoveredTexel> {
    let lattice = Lattice { columns: SUB * width, rows: SUB * height };
    let corners = |triangle: usize| mesh.triangles[triangle].map(|vertex| uvs[vertex as usize]);
    let triangles: Vec<Option<Triangle>> =
        (0..mesh.triangles.len()).into_par_iter().map(|triangle| lattice.triangle(corners(triangle)).filter(Triangle::is_caught)).collect();
    let mut bands = vec![Band::default(); height.div_ceil(BAND) as usize];
    for (index, triangle) in triangles.iter().enumerate() {
        if let Some(triangle) = triangle {
            let rows = triangle.rows();
            for band in &mut bands[(rows.start / (SUB * BAND)) as usize..=((rows.end - 1) / (SUB * BAND)) as usize] {
                band.triangles.push(index as u32);
            }
        } else {
            let centroid = corners(index).iter().sum::<DVec2>() / 3.0;
            let texel = |place: f64, count: u32| ((place * f64::from(count)) as u32).min(count - 1);
            let (x, y) = (texel(centroid.x, width), texel(centroid.y, height));
            bands[(y / BAND) as usize].strays.entry((y, x)).or_default().push(index as u32);
        }
    }
    let of_bands: Vec<Vec<CoveredTexel>> = bands
        .par_iter()
        .enumerate()
        .map(|(number, band)| band.covered(&triangles, lattice, number as u32 * BAND..height.min((number as u32 + 1) * BAND)))
        .collect();
    of_bands.concat()
}

/// Some rows of a map.
#[derive(Debug, Clone, Default)]
struct Band {
    triangles: Vec<u32>,
    /// Triangles without a sub-position, by the (row, column) of their centroid's texel.
    strays: BTreeMap<(u32, u32), Vec<u32>>,
}

impl Band {
    fn covered(&self, triangles: &[Option<Triangle>], lattice: Lattice, rows: std::ops::Range<u32>) -> Vec<CoveredTexel> {
        let width = lattice.columns / SUB;
        let of = |triangle: u32| triangles[triangle as usize].as_ref().expect("triangles of a band hold a sub-position");
        // The triangle at each sub-position; on an edge the first of those that share it.
        let mut owners = vec![NONE; (lattice.columns * (rows.len() as u32) * SUB) as usize];
        for index in &self.triangles {
            let triangle = of(*index);
            let own = triangle.rows();
            for row in own.start.max(rows.start * SUB)..own.end.min(rows.end * SUB) {
                let start = ((row - rows.start * SUB) * lattice.columns) as usize;
                for column in triangle.columns(row) {
                    let owner = &mut owners[start + column as usize];
                    if *owner == NONE {
                        *owner = *index;
                    }
                }
            }
        }
        let mut covered = Vec::new();
        let mut points = Vec::new();
        for y in rows.clone() {
            for x in 0..width {
                points.clear();
                for (column, row) in ORDER.map(|(column, row)| (x * SUB + column, y * SUB + row)) {
                    let owner = owners[((row - rows.start * SUB) * lattice.columns + column) as usize];
                    if owner != NONE {
                        points.push((owner, column, row));
                    }
                }
                let spread =
                    |count: usize| std::array::from_fn::<usize, PHASE_COUNT, _>(|phase| (2 * phase + 1) * count / (2 * PHASE_COUNT));
                if !points.is_empty() {
                    let points = spread(points.len()).map(|choice| {
                        let (triangle, column, row) = points[choice];
                        let weights = of(triangle).weights(column, row).as_vec3();
                        SurfacePoint { triangle, weights: [weights.y, weights.z] }
                    });
                    covered.push(CoveredTexel { x, y, points });
                } else if let Some(strays) = self.strays.get(&(y, x)) {
                    let points = spread(strays.len()).map(|choice| SurfacePoint { triangle: strays[choice], weights: [1.0 / 3.0; 2] });
                    covered.push(CoveredTexel { x, y, points });
                }
            }
        }
        covered
    }
}

impl SurfacePoint {
    /// A value of the vertices, interpolated.
    fn mix<T: std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T> + Copy>(&self, mesh: &Mesh, values: &[T]) -> T {
        let [a, b, c] = mesh.triangles[self.triangle as usize].map(|vertex| values[vertex as usize]);
        let [v, w] = self.weights.map(f64::from);
        a * (1.0 - v - w) + b * v + c * w
    }

    /// Texture coordinates; zero where the mesh has none.
    pub(crate) fn uv(&self, mesh: &Mesh, uv_set: usize) -> DVec2 {
        if mesh.uvs[uv_set].is_empty() { DVec2::ZERO } else { self.mix(mesh, &mesh.uvs[uv_set]) }
    }

    /// What multiplies the material's base colour.
    pub(crate) fn colour(&self, mesh: &Mesh) -> DVec3 {
        if mesh.colours.is_empty() { DVec3::ONE } else { self.mix(mesh, &mesh.colours) }
    }

    pub(crate) fn sample(&self, mesh: &Mesh) -> TexelSample {
        let geometric_normal = mesh.normal(self.triangle as usize);
        let shading_normal = match mesh.normals.is_empty() {
            true => geometric_normal,
            false => self.mix(mesh, &mesh.normals).normalize_or(geometric_normal),
        };
        // Vertex normals that look behind the triangle say nothing of its front.
        let faces_front = shading_normal.dot(geometric_normal) > 0.0;
        TexelSample {
            position: self.mix::<DVec3>(mesh, &mesh.positions),
            geometric_normal,
            shading_normal: if faces_front { shading_normal } else { geometric_normal },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_texel_is_looked_at_in_a_rotated_grid() {
        let mut sorted = ORDER;
        sorted.sort_unstable();
        assert_eq!(sorted.to_vec(), (0..4).flat_map(|column| (0..4).map(move |row| (column, row))).collect::<Vec<_>>());
        let chosen = [2, 6, 10, 14].map(|choice| ORDER[choice]);
        for line in 0..4 {
            assert_eq!(chosen.iter().filter(|(column, _)| *column == line).count(), 1, "{chosen:?}");
            assert_eq!(chosen.iter().filter(|(_, row)| *row == line).count(), 1, "{chosen:?}");
        }
        let wall = Mesh::parallelogram("wall", DVec3::ZERO, DVec3::X, DVec3::Y, 0);
        let covered = covered(&wall, &wall.uvs[0], 8, 4);
        assert_eq!(covered.len(), 32);
        for (place, texel) in covered.iter().enumerate() {
            assert_eq!((texel.x, texel.y), (place as u32 % 8, place as u32 / 8));
            let mean = texel.points.iter().map(|point| point.sample(&wall).position).sum::<DVec3>() / 4.0;
            let centre = DVec3::new((f64::from(texel.x) + 0.5) / 8.0, (f64::from(texel.y) + 0.5) / 4.0, 0.0);
            assert!((mean - centre).length() < 1e-6, "{mean} {centre}");
        }
    }

    #[test]
    fn small_triangles_cover_a_texel_and_long_maps_have_many_bands() {
        let mut dot = Mesh::parallelogram("dot", DVec3::ZERO, DVec3::X, DVec3::Y, 0);
        dot.uvs[0] = dot.uvs[0].iter().map(|uv| DVec2::new(0.3, 0.6) + *uv * 1e-9).collect();
        let [texel] = covered(&dot, &dot.uvs[0], 8, 200)[..] else { panic!("one texel") };
        assert_eq!((texel.x, texel.y), (2, 120));
        assert_eq!(texel.points.map(|point| point.triangle), [0, 0, 1, 1]);

        let wall = Mesh::parallelogram("wall", DVec3::ZERO, DVec3::X, DVec3::Y, 0);
        assert_eq!(covered(&wall, &wall.uvs[0], 5, 203).len(), 5 * 203);
    }
}
