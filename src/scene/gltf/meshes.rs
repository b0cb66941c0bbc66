//! Primitives of meshes where nodes or skins put them.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat3, DMat4, DVec2, DVec3, DVec4, Vec3, Vec4};
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use gltf::{Document, Semantic};
use rayon::prelude::*;

use super::accessor::{self, Vertices};
use super::tangents::{self, Surface};
use super::transforms;
use super::{Loader, called, node_name};
use crate::error::Result;
use crate::scene::Mesh;
use crate::scene::material::{TextureUse, UvTransform};
use crate::scene::mesh::Source;

/// Of all instances together: as many as the GPU's buffers of 4 GiB hold.
const MAX_TRIANGLES: usize = 100_000_000;
/// Of all instances together: each takes a kilobyte, however small it is.
const MAX_PARTS: usize = 2_000_000;

/// A primitive of a node.
pub(super) struct Part<'a> {
    pub(super) primitive: gltf::Primitive<'a>,
    /// Of its node, or of its mesh.
    pub(super) name: Arc<str>,
    pub(super) node: usize,
    pub(super) mesh: usize,
    pub(super) to_world: DMat4,
    /// Its joints' matrices.
    pub(super) skin: Option<Arc<Vec<DMat4>>>,
    /// By how much each morph target shifts it at rest.
    pub(super) weights: Arc<[f32]>,
    /// Its place in the scene.
    pub(super) material: usize,
}

/// A mesh, and what is to be said of it.
pub(super) struct ReadPrimitive {
    pub(super) mesh: Mesh,
    /// Whether it has a normal map, or anisotropy, and nothing says in which directions.
    pub(super) is_turned_anyhow: bool,
    /// Whether texture coordinates that nothing uses cannot be read.
    pub(super) lacks_unused_uvs: bool,
    /// How far at most single precision has moved its vertices, metres.
    pub(super) rounding: f64,
}

impl Part<'_> {
    /// Its name in complaints.
    fn what(&self) -> String {
        format!("mesh '{}', primitive {}", self.name, self.primitive.index())
    }
}

impl Loader {
    /// What takes a vertex that follows one joint alone into the world. The transform of the node that has the mesh
    /// is none of it.
    pub(super) fn joint_matrices(&mut self, skin: &gltf::Skin, to_world: &HashMap<usize, DMat4>) -> Result<Vec<DMat4>> {
        let what = called("skin", skin.name(), skin.index());
        let to_joint = match skin.inverse_bind_matrices() {
            Some(matrices) => {
                accessor::read(self, &matrices, &Vertices::All, &what, |matrix: [f32; 16]| DMat4::from_cols_array(&matrix.map(f64::from)))?
            }
            None => vec![DMat4::IDENTITY; skin.joints().len()],
        };
        let reason = || format!("has {} matrices for {} joints", to_joint.len(), skin.joints().len());
        self.require(to_joint.len() >= skin.joints().len(), &what, reason)?;
        let matrix = |(joint, to_joint): (gltf::Node, &DMat4)| match to_world.get(&joint.index()) {
            Some(to_world) => Ok(*to_world * *to_joint),
            None => Err(self.refuse(&what, format!("has the joint {}, which is not in the scene", node_name(&joint)))),
        };
        let joints: Vec<DMat4> = skin.joints().zip(&to_joint).map(matrix).collect::<Result<_>>()?;
        if let Some(stored) = skin.inverse_bind_matrices() {
            let rounding = |(joint, to_joint): (gltf::Node, &DMat4)| {
                transforms::moved(&to_world[&joint.index()], transforms::most_rounding(&stored, [&to_joint.w_axis.truncate()]))
            };
            let most = skin.joints().zip(&to_joint).map(rounding).fold(0.0, f64::max);
            self.note_rounding(&what, most);
        }
        Ok(joints)
    }

    /// Refuses more primitives, once for each node and instance, than are read, before any is listed.
    pub(super) fn require_few_parts(&self, document: &Document, nodes: &[gltf::Node]) -> Result<()> {
        let mut count = 0usize;
        for node in nodes {
            let Some(mesh) = node.mesh() else { continue };
            let what = node_name(node);
            let instances = self
                .instance_accessors(document, node, &what)?
                .map_or(1, |accessors| accessors.iter().flatten().map(gltf::Accessor::count).max().unwrap_or(0));
            count = count.saturating_add(mesh.primitives().len().saturating_mul(instances));
            let reason = || format!("brings the scene over {MAX_PARTS} primitives, counted for each node and instance; join meshes");
            self.require(count <= MAX_PARTS, &what, reason)?;
        }
        Ok(())
    }

    /// Takes note of a primitive if it makes triangles, and of what it has that is not read.
    pub(super) fn list_primitive<'a>(&mut self, document: &Document, mut part: Part<'a>, parts: &mut Vec<Part<'a>>) -> Result<()> {
        let owner = format!("mesh '{}'", part.name);
        let primitive = &part.primitive;
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.leave_out("points and lines", &owner);
            return Ok(());
        }
        if primitive.get(&Semantic::Colors(1)).is_some() {
            self.leave_out("second sets of vertex colours", &owner);
        }
        let Some(positions) = primitive.get(&Semantic::Positions) else {
            self.leave_out("primitives without positions", &owner);
            return Ok(());
        };
        if positions.data_type() != DataType::F32 && !self.is_quantized {
            self.leave_out("that KHR_mesh_quantization is not named (positions of whole numbers are read all the same)", &owner);
        }
        if part.weights.len() != primitive.morph_targets().len() && !part.weights.is_empty() {
            self.leave_out("weights that are not as many as morph targets (those that are missing are 0)", &owner);
        }
        let corners = primitive.indices().map_or(positions.count(), |indices| indices.count());
        self.triangle_count = self.triangle_count.saturating_add(corners / 3).saturating_add(positions.count().min(corners) / 4);
        let reason = || format!("brings the scene over {MAX_TRIANGLES} triangles, the most that are read");
        self.require(self.triangle_count <= MAX_TRIANGLES, &part.what(), reason)?;
        part.material = self.material_of(document, primitive, &owner)?;
        parts.push(part);
        Ok(())
    }

    /// The place of a primitive's material; of one without those normal maps, and the anisotropy, that it has no texture coordinates for.
    fn material_of(&mut self, document: &Document, primitive: &gltf::Primitive, owner: &str) -> Result<usize> {
        let number = primitive.material().index();
        let mut material = match self.materials.get(&number) {
            Some(material) => material.clone(),
            None => {
                let material = self.read_material(document, number)?;
                self.materials.insert(number, material.clone());
                material
            }
        };
        let lacks = |used: TextureUse| primitive.get(&Semantic::TexCoords(used.uv_set as u32)).is_none();
        let named = format!("material '{}' on {owner}", material.name);
        let maps = [&mut material.normal_map, &mut material.layers.coat_normal_map];
        let is_useless = maps.map(|map| map.take_if(|map| lacks(map.texture)).is_some());
        if material.textures().any(lacks) {
            self.leave_out("texture coordinates that a mesh has not (its textures have their value at 0 0)", &named);
        }
        if is_useless != [false; 2] {
            self.leave_out("normal maps on meshes without texture coordinates", &named);
        }
        // Of the file, or by texture coordinates.
        let has_tangents = primitive.get(&Semantic::Normals).is_some() && primitive.get(&Semantic::Tangents).is_some();
        let lacks_tangents = material.layers.anisotropy > 0.0
            && !has_tangents
            && material.tangent_coordinates().is_some_and(|(set, _)| primitive.get(&Semantic::TexCoords(set as u32)).is_none());
        if lacks_tangents {
            material.layers.anisotropy = 0.0;
            self.leave_out("anisotropy on meshes without tangents and texture coordinates", &named);
        }
        let [of_base, of_coat] = is_useless;
        let materials = &mut self.scene.materials;
        Ok(*self.material_places.entry((number, [of_base, of_coat, lacks_tangents])).or_insert_with(|| {
            materials.push(material);
            materials.len() - 1
        }))
    }

    pub(super) fn read_primitive(&self, part: &Part) -> Result<ReadPrimitive> {
        let Part { primitive, name, to_world, .. } = part;
        let what = part.what();
        let positions = primitive.get(&Semantic::Positions).expect("what is listed has positions");
        let vertex_count = positions.count();
        let of_vertices = |accessor: &gltf::Accessor, kind: &str| {
            let count = accessor.count();
            self.require(count == vertex_count, &what, || format!("has {count} {kind} for {vertex_count} vertices"))
        };
        let (indices, vertices) = self.indices_and_vertices(primitive, vertex_count, &what)?;

        let vector = |numbers: [f32; 3]| Vec3::from(numbers).as_dvec3();
        let matrices = match &part.skin {
            Some(joints) => self.vertex_matrices(primitive, joints, vertex_count, &vertices, &what)?,
            None => None,
        };
        let matrix = |vertex: usize| matrices.as_ref().map_or(to_world, |matrices| &matrices[vertex]);
        let read_vectors = |accessor: &gltf::Accessor, kind: &str| {
            of_vertices(accessor, kind)?;
            accessor::read(self, accessor, &vertices, &what, vector)
        };
        // Morph targets shift vertices before joints and nodes move them.
        let shifted = |mut own: Vec<DVec3>, shifts: Vec<(gltf::Accessor, f64)>, kind: &str| {
            for (shift, weight) in shifts {
                own.par_iter_mut().zip(read_vectors(&shift, kind)?).for_each(|(own, shift)| *own += weight * shift);
            }
            Ok(own)
        };
        let targets = || primitive.morph_targets().zip(part.weights.iter().map(|weight| f64::from(*weight))).filter(|(_, w)| *w != 0.0);
        let shifts = targets().filter_map(|(target, weight)| Some((target.positions()?, weight))).collect();
        let own = read_vectors(&positions, "positions")?;
        let by = transforms::most_rounding(&positions, &own);
        let mut positions = shifted(own, shifts, "positions in a morph target")?;
        let rounding = match &part.skin {
            Some(joints) if matrices.is_some() => joints.iter().map(|joint| transforms::moved(joint, by)).fold(0.0, f64::max),
            _ => transforms::moved(to_world, by),
        };
        let mut normals = Vec::new();
        if let Some(own) = primitive.get(&Semantic::Normals) {
            let shifts = targets().filter_map(|(target, weight)| Some((target.normals()?, weight))).collect();
            normals = shifted(read_vectors(&own, "normals")?, shifts, "normals in a morph target")?;
        }
        let material = &self.scene.materials[part.material];
        let mut uvs = [Vec::new(), Vec::new()];
        let mut lacks_unused_uvs = false;
        for (set, uvs) in uvs.iter_mut().enumerate() {
            let Some(coordinates) = primitive.get(&Semantic::TexCoords(set as u32)) else { continue };
            let read = of_vertices(&coordinates, "texture coordinates").and_then(|()| {
                accessor::read(self, &coordinates, &vertices, &what, |[u, v]: [f32; 2]| DVec2::new(f64::from(u), f64::from(v)))
            });
            let is_used = material.textures().any(|used| used.uv_set == set)
                || material.tangent_coordinates().is_some_and(|(of_tangents, _)| of_tangents == set);
            match read {
                Err(fault) if is_used => return Err(fault),
                Err(_) => lacks_unused_uvs = true,
                Ok(read) => *uvs = read,
            }
        }
        let indices = indices.unwrap_or_else(|| (0..positions.len() as u32).collect());
        let mut triangles = triangles_of(primitive.mode(), &indices);

        // Tangents belong to the mesh's own space, as normal maps were made there.
        let of_coat = material.layers.coat_normal_map.map(|map| (map.texture.uv_set, map.texture.transform));
        let maps = [material.tangent_coordinates(), of_coat];
        let mut of_file: Option<Vec<DVec4>> = None;
        // Those of a mesh without normals are to be ignored.
        if let Some(own) = primitive.get(&Semantic::Tangents).filter(|_| maps != [None; 2] && !normals.is_empty()) {
            of_vertices(&own, "tangents")?;
            let own = accessor::read(self, &own, &vertices, &what, |tangent: [f32; 4]| Vec4::from(tangent).as_dvec4())?;
            let shifts = targets().filter_map(|(target, weight)| Some((target.tangents()?, weight))).collect();
            let directions = shifted(own.iter().map(|tangent| tangent.truncate()).collect(), shifts, "tangents in a morph target")?;
            of_file = Some(directions.iter().zip(&own).map(|(direction, own)| direction.extend(own.w)).collect());
        }
        let surface = Surface { positions: &positions, normals: &normals, triangles: &triangles };
        let mut is_turned_anyhow = false;
        let tangents = |map: Option<(usize, UvTransform)>| match (map, &of_file) {
            (None, _) => Vec::new(),
            // The file's are those of the first map.
            (Some(map), Some(tangents)) if maps[0].is_none_or(|first| first == map) => {
                triangles.iter().map(|triangle| triangle.map(|vertex| tangents[vertex as usize])).collect()
            }
            (Some((set, transform)), _) => {
                is_turned_anyhow |= !surface.has_directions(&uvs[set], transform);
                surface.tangents(&uvs[set], transform)
            }
        };
        let mut tangents = maps.map(tangents);

        positions.par_iter_mut().enumerate().for_each(|(vertex, position)| *position = matrix(vertex).transform_point3(*position));
        let are_finite = positions.iter().all(|position| position.is_finite());
        self.require(are_finite, &what, || "has a vertex that is not finite once transformed".into())?;
        let of_node = normal_matrix(to_world);
        let turn = |vertex: usize| matrices.as_ref().map_or(of_node, |matrices| normal_matrix(&matrices[vertex]));
        normals.par_iter_mut().enumerate().for_each(|(vertex, normal)| *normal = (turn(vertex) * *normal).normalize_or_zero());
        let is_mirrored = matrices.as_ref().and_then(|matrices| matrices.first()).unwrap_or(to_world).determinant() < 0.0;
        if is_mirrored {
            // A mirrored instance would show its back.
            triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
            tangents.iter_mut().flatten().for_each(|triangle| triangle.swap(1, 2));
        }
        let surface = Surface { positions: &positions, normals: &normals, triangles: &triangles };
        let turned = |vertex: usize, tangent: DVec3| matrix(vertex).transform_vector3(tangent);
        let [tangents, coat_tangents] = tangents.map(|tangents| tangents::in_world(&tangents, &surface, is_mirrored, turned));

        let (mut colours, mut alphas) = (Vec::new(), Vec::new());
        if let Some(own) = primitive.get(&Semantic::Colors(0)) {
            of_vertices(&own, "vertex colours")?;
            (colours, alphas) = match own.dimensions() {
                Dimensions::Vec3 => (accessor::read(self, &own, &vertices, &what, vector)?, Vec::new()),
                _ => accessor::read(self, &own, &vertices, &what, |[r, g, b, a]: [f32; 4]| (vector([r, g, b]), f64::from(a)))?
                    .into_iter()
                    .unzip(),
            };
        }
        let (name, material) = (name.to_string(), part.material);
        let vertices = if let Vertices::Some(vertices) = vertices { vertices } else { Vec::new() };
        let source = Some(Source { node: part.node, mesh: part.mesh, primitive: primitive.index(), vertices });
        let mesh = Mesh { name, positions, normals, uvs, colours, alphas, tangents, coat_tangents, triangles, material, source };
        Ok(ReadPrimitive { mesh, is_turned_anyhow, lacks_unused_uvs, rounding })
    }

    /// Indices into those of the vertices that the primitive uses, as many primitives may share one list of vertices;
    /// `None`: all vertices, in their order.
    fn indices_and_vertices(&self, primitive: &gltf::Primitive, vertex_count: usize, what: &str) -> Result<(Option<Vec<u32>>, Vertices)> {
        let Some(indices) = primitive.indices() else {
            return Ok((None, Vertices::All));
        };
        let indices = accessor::read_indices(self, &indices, what)?;
        if let Some(index) = indices.iter().find(|index| **index as usize >= vertex_count) {
            return Err(self.refuse(what, format!("uses vertex {index} of {vertex_count}")));
        }
        if indices.len() >= vertex_count {
            return Ok((Some(indices), Vertices::All));
        }
        let mut used = indices.clone();
        used.sort_unstable();
        used.dedup();
        let place = |index: &u32| used.binary_search(index).expect("every index is there") as u32;
        Ok((Some(indices.iter().map(place).collect()), Vertices::Some(used)))
    }

    /// Of each vertex, the mean of its joints' matrices by their weights; `None` where vertices follow no joints.
    fn vertex_matrices(
        &self,
        primitive: &gltf::Primitive,
        joints: &[DMat4],
        vertex_count: usize,
        vertices: &Vertices,
        what: &str,
    ) -> Result<Option<Vec<DMat4>>> {
        let mut sums: Option<Vec<(DMat4, f64)>> = None;
        for set in 0.. {
            let (Some(numbers), Some(weights)) = (primitive.get(&Semantic::Joints(set)), primitive.get(&Semantic::Weights(set))) else {
                break;
            };
            let reason = || format!("has joints or weights that are not as many as its {vertex_count} vertices");
            self.require(numbers.count() == vertex_count && weights.count() == vertex_count, what, reason)?;
            let numbers = accessor::read_joints(self, &numbers, vertices, what)?;
            let weights: Vec<[f32; 4]> = accessor::read(self, &weights, vertices, what, |weights| weights)?;
            let sums = sums.get_or_insert_with(|| vec![(DMat4::ZERO, 0.0); numbers.len()]);
            for (sum, (numbers, weights)) in sums.iter_mut().zip(numbers.iter().zip(&weights)) {
                for (number, weight) in numbers.iter().zip(weights.map(f64::from)).filter(|(_, weight)| *weight > 0.0) {
                    let Some(matrix) = joints.get(usize::from(*number)) else {
                        return Err(self.refuse(what, format!("uses joint {number} of {}", joints.len())));
                    };
                    *sum = (sum.0 + *matrix * weight, sum.1 + weight);
                }
            }
        }
        let mean = |(sum, weight): &(DMat4, f64)| if *weight > 0.0 { *sum * (1.0 / weight) } else { DMat4::IDENTITY };
        Ok(sums.map(|sums| sums.iter().map(mean).collect()))
    }
}

/// What turns normals: the inverse transpose. The cofactors are that times the determinant, and stay finite where a
/// scale is zero.
fn normal_matrix(to_world: &DMat4) -> DMat3 {
    let DMat3 { x_axis, y_axis, z_axis } = DMat3::from_mat4(*to_world);
    DMat3::from_cols(y_axis.cross(z_axis), z_axis.cross(x_axis), x_axis.cross(y_axis)) * to_world.determinant().signum()
}

/// Of the triangles that vertices make in their order.
pub(crate) fn triangles_of(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let turned = |(k, window): (usize, &[u32])| {
                if k % 2 == 0 { [window[0], window[1], window[2]] } else { [window[1], window[0], window[2]] }
            };
            indices.windows(3).enumerate().map(turned).collect()
        }
        Mode::TriangleFan => indices.get(1..).unwrap_or_default().windows(2).map(|pair| [indices[0], pair[0], pair[1]]).collect(),
        _ => indices.par_chunks_exact(3).with_min_len(accessor::MIN_PIECE).map(|of| [of[0], of[1], of[2]]).collect(),
    }
}
