//! A mesh with the coordinates of its map.

use glam::DVec2;

use crate::scene::Mesh;

/// One mesh of an object with lightmap coordinates.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    /// The vertex that each vertex was before vertices were doubled along seams; empty where none was.
    pub vertices: Vec<u32>,
    /// The same triangles in the same order.
    pub triangles: Vec<[u32; 3]>,
    /// Coordinates of the map, from 0 to 1, one per vertex.
    pub uvs: Vec<DVec2>,
}

impl Part {
    /// A mesh with vertices doubled.
    pub(crate) fn of(&self, mesh: &Mesh) -> Mesh {
        if self.vertices.is_empty() {
            return mesh.clone();
        }
        fn kept<T: Copy>(of_vertices: &[T], vertices: &[u32]) -> Vec<T> {
            if of_vertices.is_empty() { Vec::new() } else { vertices.iter().map(|vertex| of_vertices[*vertex as usize]).collect() }
        }
        let vertices = &self.vertices;
        Mesh {
            name: mesh.name.clone(),
            positions: kept(&mesh.positions, vertices),
            normals: kept(&mesh.normals, vertices),
            uvs: mesh.uvs.each_ref().map(|set| kept(set, vertices)),
            colours: kept(&mesh.colours, vertices),
            alphas: kept(&mesh.alphas, vertices),
            // Triangles keep their order.
            tangents: mesh.tangents.clone(),
            coat_tangents: mesh.coat_tangents.clone(),
            triangles: self.triangles.clone(),
            material: mesh.material,
            source: None,
        }
    }
}
