//! Scenes from `.gltf` and `.glb` files (glTF 2.0).
//!
//! Read: meshes with node transforms and instances, skins in the pose of their nodes, smooth normals, two sets of texture coordinates,
//! base colour and emission with textures, metallic-roughness (mapped by
//! [`super::material::surface_of`]), KHR_materials_emissive_strength, _ior, _transmission,
//! KHR_lights_punctual, perspective cameras. Whatever else the file holds is named in a warning.

mod accessor;
mod malformed;

use std::borrow::Cow;
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use glam::{DMat3, DMat4, DVec2, DVec3, Vec3};
use gltf::khr_lights_punctual::Kind;
use gltf::mesh::Mode;
use gltf::{Document, Gltf, Semantic};
use image::{DynamicImage, ImageDecoder};
use rayon::prelude::*;

use super::light::{LUMENS_PER_WATT, Light, LightKind};
use super::material::{Material, TextureUse, surface_of};
use super::texture::{Texture, Wrap, linear_of_srgb};
use super::{Camera, Mesh, Progress, Scene};
use crate::error::{Error, Result};
use crate::text::{counted, refusal};
use accessor::Vertices;

/// Larger files are refused: their triangles would not fit a device's buffers either.
const MAX_FILE_BYTES: u64 = 4 << 30;
const READ_EXTENSIONS: [&str; 4] =
    ["KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_transmission"];
/// Of all instances together: as many as the GPU's buffers of 4 GiB hold.
const MAX_TRIANGLES: usize = 100_000_000;
/// Of all textures together: 1.5 GiB.
const MAX_TEXELS: u64 = 1 << 27;
/// Texture coordinates beyond that have no digits left for a place in the picture.
const MAX_UV: f64 = 1e6;
/// Nodes within nodes; deeper ones would be a cycle.
const MAX_DEPTH: usize = 512;

/// Names of meshes or materials in one warning.
const MAX_NAMES: usize = 5;

/// Reads a file.
pub fn load(path: &Path, radiometric: bool, progress: Progress) -> Result<Scene> {
    progress("reading the file", 0.0);
    let refuse = |reason: String| Error::Scene { path: path.to_owned(), object: "the file".into(), reason: one_line(&reason) };
    let content = read_file(path).map_err(refuse)?;
    // The mark that some editors write in front of a text.
    let content = content.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&content);
    malformed::binary_length(content).map_err(refuse)?;
    let Gltf { document, blob } =
        Gltf::from_slice_without_validation(content).map_err(|error| refuse(format!("is not valid glTF: {error}")))?;
    let root = document.into_json();
    let version = root.asset.version.as_str();
    if !version.starts_with("2.") {
        return Err(refuse(format!("is of glTF version {version}; 2.0 is read")));
    }
    // Before anything else: what a file needs an extension for may look missing without it.
    let unread: Vec<&str> = root.extensions_required.iter().map(String::as_str).filter(|name| !READ_EXTENSIONS.contains(name)).collect();
    if !unread.is_empty() {
        let remedies: BTreeSet<&str> = unread.iter().map(|name| remedy(name)).collect();
        let remedies: Vec<&str> = remedies.into_iter().collect();
        return Err(refuse(format!("needs {}, which is not supported; {}", unread.join(", "), remedies.join("; "))));
    }
    malformed::missing_members(&root).map_err(refuse)?;
    let document = Document::from_json(root).map_err(|error| refuse(error.to_string()))?;
    let mut loader = Loader {
        path: path.to_owned(),
        file_bytes: content.len(),
        buffers: Vec::new(),
        scene: Scene { name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(), ..Scene::default() },
        left_out: BTreeMap::new(),
        triangle_count: 0,
        texture_places: HashMap::new(),
        unit: if radiometric { 1.0 } else { 1.0 / LUMENS_PER_WATT },
    };
    loader.read_buffers(&document, blob)?;
    loader.read_textures(&document, progress)?;
    loader.read_materials(&document)?;
    loader.read_nodes(&document, progress)?;
    loader.name_what_is_left_out(&document);
    loader.finish()
}

/// How to write a file that does without an extension.
fn remedy(extension: &str) -> &'static str {
    match extension {
        "KHR_draco_mesh_compression" => "export it without compression (in Blender's glTF export: untick Data > Compression)",
        "EXT_meshopt_compression" | "KHR_meshopt_compression" => "write it without compression (gltfpack: without -c, -cc and -cz)",
        "KHR_mesh_quantization" => "write its vertices as floats (gltfpack: with -noq)",
        "KHR_texture_basisu" | "EXT_texture_webp" | "EXT_texture_avif" | "MSFT_texture_dds" => "export its textures as PNG or JPEG",
        _ => "export it without",
    }
}

/// A name without line breaks and other control characters.
fn printable(name: &str) -> String {
    name.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect()
}

/// What a file or a decoder says, without its line breaks.
fn one_line(text: &str) -> String {
    printable(&text.lines().map(str::trim).collect::<Vec<_>>().join(" "))
}

/// The content of a file, or what is wrong with it.
fn read_file(path: &Path) -> std::result::Result<Vec<u8>, String> {
    let unreadable = |error: std::io::Error| format!("cannot be read ({})", refusal(&error));
    let facts = std::fs::metadata(path).map_err(unreadable)?;
    if !facts.is_file() {
        return Err("is no file".into());
    }
    if facts.len() > MAX_FILE_BYTES {
        return Err(format!("has {} bytes, and at most {MAX_FILE_BYTES} are read", facts.len()));
    }
    std::fs::read(path).map_err(unreadable)
}

/// A file being read.
pub(super) struct Loader {
    path: PathBuf,
    file_bytes: usize,
    buffers: Vec<Vec<u8>>,
    scene: Scene,
    /// What the file holds and the scene does not, and which materials, meshes, ... have it.
    left_out: BTreeMap<String, BTreeSet<String>>,
    /// Triangles and vertices of all instances so far.
    triangle_count: usize,
    /// Where a texture of the file stands in the scene.
    texture_places: HashMap<usize, usize>,
    /// Watts in one unit of a punctual light.
    unit: f32,
}

impl Loader {
    /// An error that names the file and the object in it.
    fn refuse(&self, object: &str, reason: impl Into<String>) -> Error {
        Error::Scene { path: self.path.clone(), object: object.to_owned(), reason: one_line(&reason.into()) }
    }

    /// `owner`: what has it, as `material 'glow'`; empty for the file itself.
    fn leave_out(&mut self, what: impl Into<String>, owner: &str) {
        let owners = self.left_out.entry(one_line(&what.into())).or_default();
        if !owner.is_empty() {
            owners.insert(owner.to_owned());
        }
    }

    fn read_buffers(&mut self, document: &Document, mut blob: Option<Vec<u8>>) -> Result<()> {
        for buffer in document.buffers() {
            let what = format!("buffer {}", buffer.index());
            let bytes = match buffer.source() {
                gltf::buffer::Source::Bin => {
                    blob.take().ok_or_else(|| self.refuse(&what, "is the file's binary part, and there is none"))?
                }
                gltf::buffer::Source::Uri(uri) => self.read_uri(uri, &what)?,
            };
            if bytes.len() < buffer.length() {
                return Err(self.refuse(&what, format!("has {} bytes where {} are announced", bytes.len(), buffer.length())));
            }
            self.buffers.push(bytes);
        }
        Ok(())
    }

    /// A data URI, or a file beside this one.
    fn read_uri(&self, uri: &str, what: &str) -> Result<Vec<u8>> {
        if let Some(embedded) = uri.strip_prefix("data:") {
            let text = embedded.split_once(";base64,").map(|(_, text)| text);
            return text.and_then(|text| BASE64.decode(text).ok()).ok_or_else(|| self.refuse(what, "has a data URI that is not base64"));
        }
        if uri.contains(':') {
            return Err(self.refuse(what, format!("lies at {uri}; only files beside this one are read")));
        }
        let name = percent_decoded(uri).ok_or_else(|| self.refuse(what, format!("has a name that cannot be decoded: {uri}")))?;
        let folder = self.path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
        let place = folder.join(&name);
        // A link may lead out as well as a name.
        let leads_out = || matches!((place.canonicalize(), folder.canonicalize()), (Ok(place), Ok(folder)) if !place.starts_with(&folder));
        if leaves_folder(Path::new(&name)) || leads_out() {
            return Err(self.refuse(what, format!("lies at {uri}, outside the scene's folder, and is not read; copy it into that folder")));
        }
        read_file(&place).map_err(|reason| self.refuse(what, format!("lies at {uri}, which {reason}")))
    }

    fn read_textures(&mut self, document: &Document, progress: Progress) -> Result<()> {
        // Pictures that only normal or roughness maps use are not looked at.
        let mut used = BTreeSet::new();
        for material in document.materials() {
            used.extend(material.pbr_metallic_roughness().base_color_texture().map(|info| info.texture().index()));
            used.extend(material.emissive_texture().map(|info| info.texture().index()));
        }
        // Materials that use the same picture in the same way share it.
        let mut places: HashMap<(usize, Option<usize>), usize> = HashMap::new();
        let mut wanted = Vec::new();
        for texture in document.textures().filter(|texture| used.contains(&texture.index())) {
            let place = match places.entry((texture.source().index(), texture.sampler().index())) {
                Entry::Occupied(place) => *place.get(),
                Entry::Vacant(free) => {
                    wanted.push(texture.clone());
                    *free.insert(wanted.len() - 1)
                }
            };
            self.texture_places.insert(texture.index(), place);
        }
        // Asked before they are decoded: as numbers they take many times the memory.
        let mut texel_count = 0;
        let mut encoded = Vec::with_capacity(wanted.len());
        for texture in &wanted {
            let (what, bytes) = self.encoded_image(texture)?;
            let (width, height) = self.decoder(&what, &bytes)?.dimensions();
            texel_count += u64::from(width) * u64::from(height);
            if texel_count > MAX_TEXELS {
                return Err(
                    self.refuse(&what, format!("makes more than {MAX_TEXELS} texels, the most that are read; use smaller pictures"))
                );
            }
            encoded.push((texture, what, bytes));
        }
        let mut textures = Vec::with_capacity(encoded.len());
        for batch in encoded.chunks(2 * rayon::current_num_threads()) {
            progress("decoding textures", textures.len() as f64 / encoded.len() as f64);
            let read: Vec<Result<Texture>> =
                batch.par_iter().map(|(texture, what, bytes)| self.read_texture(texture, what, bytes)).collect();
            for texture in read {
                textures.push(texture?);
            }
        }
        drop(encoded);
        self.scene.textures = textures;
        Ok(())
    }

    /// Its name in complaints, and the bytes of the picture's file.
    fn encoded_image(&self, texture: &gltf::Texture) -> Result<(String, Cow<'_, [u8]>)> {
        let source = texture.source();
        let what = called("texture image", source.name(), source.index());
        let bytes = match source.source() {
            gltf::image::Source::View { view, .. } => Cow::Borrowed(accessor::view_bytes(self, &view, &what)?),
            gltf::image::Source::Uri { uri, .. } => Cow::Owned(self.read_uri(uri, &what)?),
        };
        Ok((what, bytes))
    }

    fn undecodable(&self, what: &str, error: &image::ImageError) -> Error {
        self.refuse(what, format!("cannot be decoded ({})", one_line(&error.to_string())))
    }

    /// Of a picture's file.
    fn decoder<'b>(&self, what: &str, bytes: &'b [u8]) -> Result<impl ImageDecoder + use<'b>> {
        let reader = image::ImageReader::new(std::io::Cursor::new(bytes)).with_guessed_format();
        let mut reader = reader.map_err(|error| self.refuse(what, error.to_string()))?;
        reader.limits(image_limits());
        reader.into_decoder().map_err(|error| self.undecodable(what, &error))
    }

    fn read_texture(&self, texture: &gltf::Texture, what: &str, bytes: &[u8]) -> Result<Texture> {
        let undecodable = |error: image::ImageError| self.undecodable(what, &error);
        let decoder = self.decoder(what, bytes)?;
        image_limits().reserve(decoder.total_bytes()).map_err(undecodable)?;
        let picture = DynamicImage::from_decoder(decoder).map_err(undecodable)?.into_rgb8();
        let wrap = |mode: gltf::texture::WrappingMode| match mode {
            gltf::texture::WrappingMode::ClampToEdge => Wrap::Clamp,
            gltf::texture::WrappingMode::MirroredRepeat => Wrap::MirroredRepeat,
            gltf::texture::WrappingMode::Repeat => Wrap::Repeat,
        };
        let linear: [f32; 256] = std::array::from_fn(|code| linear_of_srgb(code as u8));
        let texel = |rgb: &[u8]| Vec3::new(linear[usize::from(rgb[0])], linear[usize::from(rgb[1])], linear[usize::from(rgb[2])]);
        Ok(Texture {
            name: what.to_owned(),
            width: picture.width(),
            height: picture.height(),
            texels: picture.as_raw().par_chunks_exact(3).map(texel).collect(),
            wrap: [wrap(texture.sampler().wrap_s()), wrap(texture.sampler().wrap_t())],
        })
    }

    fn read_materials(&mut self, document: &Document) -> Result<()> {
        for material in document.materials() {
            let read = self.read_material(&material)?;
            self.scene.materials.push(read);
        }
        // The material of primitives that name none.
        self.scene.materials.push(Material::lambert("default", Vec3::ONE));
        Ok(())
    }

    fn read_material(&mut self, material: &gltf::Material) -> Result<Material> {
        let pbr = material.pbr_metallic_roughness();
        let name = material.name().map_or_else(|| format!("material {}", material.index().unwrap_or(0)), printable);
        let transmission = material.transmission();
        let factor = transmission.as_ref().map_or(0.0, gltf::material::Transmission::transmission_factor);
        let ior = material.ior().unwrap_or(1.5);
        let object = format!("material '{name}'");
        for (what, present) in [
            ("normal textures", material.normal_texture().is_some()),
            ("occlusion textures", material.occlusion_texture().is_some()),
            ("metallic-roughness textures", pbr.metallic_roughness_texture().is_some()),
            ("transmission textures", transmission.as_ref().is_some_and(|t| t.transmission_texture().is_some())),
            ("transparency by alpha", material.alpha_mode() != gltf::material::AlphaMode::Opaque),
            ("rough transmission (taken as smooth)", factor >= 0.5 && pbr.roughness_factor() > 0.05),
        ] {
            if present {
                self.leave_out(what, &object);
            }
        }
        for (what, share) in [("metallic", pbr.metallic_factor()), ("transmission", factor)] {
            if share > 0.0 && share < 1.0 {
                self.leave_out(format!("partly {what} surfaces (taken as the nearer of both)"), &object);
            }
        }
        let in_range = |value: f32, low: f32, high: f32| value.is_finite() && value >= low && value <= high;
        let [red, green, blue, _] = pbr.base_color_factor();
        let emission = Vec3::from(material.emissive_factor()) * material.emissive_strength().unwrap_or(1.0);
        if ![red, green, blue].iter().all(|channel| in_range(*channel, 0.0, 1.0)) {
            return Err(self.refuse(&object, format!("has the base colour {red} {green} {blue}; each must be from 0 to 1")));
        }
        if !emission.to_array().iter().all(|channel| in_range(*channel, 0.0, f32::MAX)) {
            return Err(self.refuse(&object, format!("emits {emission}; each channel must be 0 or more and finite")));
        }
        if !in_range(ior, 1.0, 100.0) {
            return Err(self.refuse(&object, format!("has the index of refraction {ior}; it must be from 1 to 100")));
        }
        if !in_range(pbr.metallic_factor(), 0.0, 1.0) || !in_range(pbr.roughness_factor(), 0.0, 1.0) || !in_range(factor, 0.0, 1.0) {
            return Err(self.refuse(&object, "has a metallic, roughness or transmission factor outside 0 to 1"));
        }
        let mut texture_use = |info: Option<gltf::texture::Info>| {
            info.map(|info| {
                if info.tex_coord() > 1 {
                    self.leave_out("texture coordinates beyond the second set (the first is used)", &object);
                }
                TextureUse { texture: self.texture_places[&info.texture().index()], uv_set: if info.tex_coord() == 1 { 1 } else { 0 } }
            })
        };
        Ok(Material {
            surface: surface_of(pbr.metallic_factor(), pbr.roughness_factor(), factor, ior),
            base_colour: Vec3::new(red, green, blue),
            base_colour_texture: texture_use(pbr.base_color_texture()),
            emission,
            emission_texture: texture_use(material.emissive_texture()),
            two_sided: material.double_sided(),
            name,
        })
    }

    fn read_nodes(&mut self, document: &Document, progress: Progress) -> Result<()> {
        let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) else {
            return Err(self.refuse("the file", "holds no scene"));
        };
        if document.scenes().len() > 1 {
            self.leave_out("scenes beside the default one", "");
        }
        let mut nodes = Vec::new();
        let mut to_world = HashMap::new();
        for node in scene.nodes() {
            self.place_node(node, DMat4::IDENTITY, 0, &mut nodes, &mut to_world)?;
        }
        let mut skins = HashMap::new();
        let mut parts = Vec::new();
        for node in &nodes {
            let what = node_name(node);
            let own = to_world[&node.index()];
            if let Some(mesh) = node.mesh() {
                let name = node.name().or(mesh.name()).map_or_else(|| format!("mesh {}", mesh.index()), printable);
                let skin = match node.skin() {
                    Some(skin) => Some(match skins.entry(skin.index()) {
                        Entry::Occupied(known) => Arc::clone(known.get()),
                        Entry::Vacant(free) => Arc::clone(free.insert(Arc::new(self.joint_matrices(&skin, &to_world)?))),
                    }),
                    None => None,
                };
                for primitive in mesh.primitives() {
                    self.list_primitive(Part { primitive, name: name.clone(), to_world: own, skin: skin.clone() }, &mut parts)?;
                }
            }
            if let Some(camera) = node.camera() {
                self.read_camera(&camera, node, own);
            }
            if let Some(light) = node.light() {
                self.read_light(&light, &what, own)?;
            }
        }
        for batch in parts.chunks((parts.len() / 100).max(16 * rayon::current_num_threads())) {
            progress("reading meshes", self.scene.meshes.len() as f64 / parts.len() as f64);
            let read: Vec<Result<Mesh>> = batch.par_iter().map(|part| self.read_primitive(part)).collect();
            for mesh in read {
                self.scene.meshes.push(mesh?);
            }
        }
        Ok(())
    }

    /// Lists a node and all below it, and where each stands in the world.
    fn place_node<'a>(
        &self,
        node: gltf::Node<'a>,
        parent: DMat4,
        depth: usize,
        nodes: &mut Vec<gltf::Node<'a>>,
        to_world: &mut HashMap<usize, DMat4>,
    ) -> Result<()> {
        if depth > MAX_DEPTH {
            return Err(self.refuse(&node_name(&node), format!("lies more than {MAX_DEPTH} nodes deep, or within itself")));
        }
        let matrix = DMat4::from_cols_array_2d(&node.transform().matrix().map(|column| column.map(f64::from)));
        let own = parent * matrix;
        if !own.is_finite() {
            return Err(self.refuse(&node_name(&node), "has a transform that is not finite"));
        }
        if to_world.insert(node.index(), own).is_some() {
            return Err(self.refuse(&node_name(&node), "has two parents; a node has one place in a scene"));
        }
        nodes.push(node.clone());
        node.children().try_for_each(|child| self.place_node(child, own, depth + 1, nodes, to_world))
    }

    /// What takes a vertex that follows one joint alone into the world. The transform of the node that has the mesh
    /// is none of it.
    fn joint_matrices(&self, skin: &gltf::Skin, to_world: &HashMap<usize, DMat4>) -> Result<Vec<DMat4>> {
        let what = called("skin", skin.name(), skin.index());
        let to_joint = match skin.inverse_bind_matrices() {
            Some(matrices) => {
                accessor::read(self, &matrices, &Vertices::All, &what, |matrix: [f32; 16]| DMat4::from_cols_array(&matrix.map(f64::from)))?
            }
            None => vec![DMat4::IDENTITY; skin.joints().len()],
        };
        if to_joint.len() < skin.joints().len() {
            return Err(self.refuse(&what, format!("has {} matrices for {} joints", to_joint.len(), skin.joints().len())));
        }
        let matrix = |(joint, to_joint): (gltf::Node, &DMat4)| match to_world.get(&joint.index()) {
            Some(to_world) => Ok(*to_world * *to_joint),
            None => Err(self.refuse(&what, format!("has the joint {}, which is not in the scene", node_name(&joint)))),
        };
        skin.joints().zip(&to_joint).map(matrix).collect()
    }

    /// Takes note of a primitive if it makes triangles, and of what it has that is not read.
    fn list_primitive<'a>(&mut self, part: Part<'a>, parts: &mut Vec<Part<'a>>) -> Result<()> {
        let owner = format!("mesh '{}'", part.name);
        let primitive = &part.primitive;
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.leave_out("points and lines", &owner);
            return Ok(());
        }
        if primitive.morph_targets().len() > 0 {
            self.leave_out("morph targets (meshes are taken in their base shape)", &owner);
        }
        if primitive.get(&Semantic::Colors(0)).is_some() {
            self.leave_out("vertex colours", &owner);
        }
        let Some(positions) = primitive.get(&Semantic::Positions) else {
            return Err(self.refuse(&part.what(), "has no positions"));
        };
        let corners = primitive.indices().map_or(positions.count(), |indices| indices.count());
        self.triangle_count = self.triangle_count.saturating_add(corners / 3).saturating_add(positions.count().min(corners) / 4);
        if self.triangle_count > MAX_TRIANGLES {
            return Err(self.refuse(&part.what(), format!("brings the scene over {MAX_TRIANGLES} triangles, the most that are read")));
        }
        parts.push(part);
        Ok(())
    }

    fn read_primitive(&self, part: &Part) -> Result<Mesh> {
        let Part { primitive, name, to_world, .. } = part;
        let what = part.what();
        let positions = primitive.get(&Semantic::Positions).expect("what is listed has positions");
        let vertex_count = positions.count();
        let of_vertices = |accessor: &gltf::Accessor, kind: &str| match accessor.count() {
            count if count == vertex_count => Ok(()),
            count => Err(self.refuse(&what, format!("has {count} {kind} for {vertex_count} vertices"))),
        };
        let (indices, vertices) = self.indices_and_vertices(primitive, vertex_count, &what)?;

        let vector = |numbers: [f32; 3]| Vec3::from(numbers).as_dvec3();
        let matrices = match &part.skin {
            Some(joints) => self.vertex_matrices(primitive, joints, vertex_count, &vertices, &what)?,
            None => None,
        };
        let positions: Vec<DVec3> = match &matrices {
            Some(matrices) => {
                let own = accessor::read(self, &positions, &vertices, &what, vector)?;
                own.par_iter().zip(matrices).map(|(position, matrix)| matrix.transform_point3(*position)).collect()
            }
            None => accessor::read(self, &positions, &vertices, &what, |numbers| to_world.transform_point3(vector(numbers)))?,
        };
        if positions.iter().any(|position| !position.is_finite()) {
            return Err(self.refuse(&what, "has a vertex that is not finite once transformed"));
        }
        let mut normals = Vec::new();
        if let Some(own) = primitive.get(&Semantic::Normals) {
            of_vertices(&own, "normals")?;
            let turned = |matrix: &DMat3, normal: DVec3| (*matrix * normal).normalize_or_zero();
            normals = match &matrices {
                Some(matrices) => {
                    let own = accessor::read(self, &own, &vertices, &what, vector)?;
                    own.par_iter().zip(matrices).map(|(normal, matrix)| turned(&normal_matrix(matrix), *normal)).collect()
                }
                None => {
                    let matrix = normal_matrix(to_world);
                    accessor::read(self, &own, &vertices, &what, |numbers| turned(&matrix, vector(numbers)))?
                }
            };
        }
        let mut uvs = [Vec::new(), Vec::new()];
        for (set, uvs) in uvs.iter_mut().enumerate() {
            if let Some(coordinates) = primitive.get(&Semantic::TexCoords(set as u32)) {
                of_vertices(&coordinates, "texture coordinates")?;
                *uvs = accessor::read(self, &coordinates, &vertices, &what, |[u, v]: [f32; 2]| DVec2::new(f64::from(u), f64::from(v)))?;
                if let Some(uv) = uvs.iter().find(|uv| uv.is_nan() || uv.abs().max_element() > MAX_UV) {
                    return Err(self.refuse(&what, format!("has the texture coordinates {uv}; they must be within {MAX_UV:e}")));
                }
            }
        }
        let indices = indices.unwrap_or_else(|| (0..positions.len() as u32).collect());
        let mut triangles = triangles_of(primitive.mode(), &indices);
        if matrices.as_ref().and_then(|matrices| matrices.first()).unwrap_or(to_world).determinant() < 0.0 {
            // A mirrored instance would show its back.
            triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        let material = primitive.material().index().unwrap_or(self.scene.materials.len() - 1);
        Ok(Mesh { name: name.clone(), positions, normals, uvs, triangles, material })
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
            if numbers.count() != vertex_count || weights.count() != vertex_count {
                return Err(self.refuse(what, format!("has joints or weights that are not as many as its {vertex_count} vertices")));
            }
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

    fn read_camera(&mut self, camera: &gltf::Camera, node: &gltf::Node, to_world: DMat4) {
        let name = node.name().or(camera.name()).map_or_else(|| format!("camera {}", camera.index()), printable);
        let gltf::camera::Projection::Perspective(perspective) = camera.projection() else {
            self.leave_out("orthographic cameras", &format!("camera '{name}'"));
            return;
        };
        let vertical_view = f64::from(perspective.yfov());
        // Within the angles for which a pinhole picture means something.
        if !(0.002..3.12).contains(&vertical_view) {
            self.leave_out(format!("a camera with a vertical view of {vertical_view} radians"), &format!("camera '{name}'"));
            return;
        }
        let eye = to_world.transform_point3(DVec3::ZERO);
        let target = eye + to_world.transform_vector3(DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
        let up = to_world.transform_vector3(DVec3::Y);
        // Where the file leaves the aspect open, so does the camera.
        let aspect = perspective.aspect_ratio().map(f64::from);
        let is_usable = |aspect: &f64| aspect.is_finite() && *aspect > 0.0;
        if let Some(aspect) = aspect.filter(|aspect| !is_usable(aspect)) {
            self.leave_out(format!("an aspect ratio of {aspect}"), &format!("camera '{name}'"));
        }
        let camera = Camera::looking_at(&name, eye, target, up, vertical_view);
        self.scene.cameras.push(Camera { aspect: aspect.filter(is_usable), ..camera });
    }

    fn read_light(&mut self, light: &gltf::khr_lights_punctual::Light, node: &str, to_world: DMat4) -> Result<()> {
        let what = format!("light {}", light.name().map(printable).map_or_else(|| format!("of {node}"), |name| format!("'{name}'")));
        let strength = Vec3::from(light.color()) * light.intensity() * self.unit;
        if !strength.is_finite() || strength.min_element() < 0.0 {
            return Err(self
                .refuse(&what, format!("has the intensity {} and colour {:?}; both must be 0 or more", light.intensity(), light.color())));
        }
        if light.range().is_some() {
            self.leave_out("ranges of lights (they reach as far as light does)", &what);
        }
        let position = to_world.transform_point3(DVec3::ZERO);
        let direction = to_world.transform_vector3(DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
        let kind = match light.kind() {
            Kind::Point => LightKind::Point { position, intensity: strength },
            Kind::Directional => LightKind::Directional { direction, irradiance: strength },
            Kind::Spot { inner_cone_angle, outer_cone_angle } => {
                if !(inner_cone_angle >= 0.0
                    && inner_cone_angle < outer_cone_angle
                    && outer_cone_angle <= std::f32::consts::FRAC_PI_2 + 1e-6)
                {
                    return Err(self.refuse(&what, format!("has cones of {inner_cone_angle} and {outer_cone_angle} radians; the inner must be smaller, the outer at most half pi")));
                }
                LightKind::Spot { position, direction, intensity: strength, inner_angle: inner_cone_angle, outer_angle: outer_cone_angle }
            }
        };
        if strength.max_element() > 0.0 {
            self.scene.lights.push(Light { name: what, kind });
        }
        Ok(())
    }

    fn name_what_is_left_out(&mut self, document: &Document) {
        if document.animations().len() > 0 {
            self.leave_out("animations", "");
        }
        for extension in document.extensions_used().filter(|extension| !READ_EXTENSIONS.contains(extension)) {
            self.leave_out(format!("the extension {extension}"), "");
        }
    }

    /// The scene, degenerate triangles gone, with its warnings.
    fn finish(mut self) -> Result<Scene> {
        let (min, max) = self.scene.bounds();
        let extent = (max - min).max_element();
        let dropped: Vec<usize> = self.scene.meshes.par_iter_mut().map(|mesh| mesh.drop_degenerate_triangles(extent)).collect();
        let with_flat = self.scene.meshes.iter().zip(&dropped).filter(|(_, dropped)| **dropped > 0);
        let flat: BTreeSet<String> = with_flat.map(|(mesh, _)| format!("mesh '{}'", mesh.name)).collect();
        self.scene.meshes.retain(|mesh| !mesh.triangles.is_empty());
        if self.scene.triangle_count() == 0 {
            return Err(self.refuse("the scene", "holds no triangle"));
        }
        if !flat.is_empty() {
            let count: usize = dropped.iter().sum();
            self.scene.warnings.push(format!("{} without area left out ({})", counted(count, "triangle"), some_of(&flat)));
        }
        if !self.left_out.is_empty() {
            let named = |(what, owners): (&String, &BTreeSet<String>)| match owners.is_empty() {
                true => what.clone(),
                false => format!("{what}: {}", some_of(owners)),
            };
            let list: Vec<String> = self.left_out.iter().map(named).collect();
            self.scene.warnings.push(format!("ignored: {}", list.join("; ")));
        }
        Ok(self.scene)
    }
}

/// A primitive of a node.
struct Part<'a> {
    primitive: gltf::Primitive<'a>,
    /// Of its node, or of its mesh.
    name: String,
    to_world: DMat4,
    /// Its joints' matrices.
    skin: Option<Arc<Vec<DMat4>>>,
}

impl Part<'_> {
    /// Its name in complaints.
    fn what(&self) -> String {
        format!("mesh '{}', primitive {}", self.name, self.primitive.index())
    }
}

fn node_name(node: &gltf::Node) -> String {
    called("node", node.name(), node.index())
}

/// An object in complaints: its name, or its number.
fn called(kind: &str, name: Option<&str>, number: usize) -> String {
    name.map_or_else(|| format!("{kind} {number}"), |name| format!("{kind} '{}'", printable(name)))
}

/// The first few of some names.
fn some_of(names: &BTreeSet<String>) -> String {
    let first: Vec<&str> = names.iter().map(String::as_str).take(MAX_NAMES).collect();
    let more = names.len() - first.len();
    first.join(", ") + &if more > 0 { format!(" and {more} more") } else { String::new() }
}

fn image_limits() -> image::Limits {
    let mut limits = image::Limits::default();
    // A picture of a few bytes must not unfold into gigabytes.
    limits.max_alloc = Some(1 << 30);
    limits
}

/// Whether a relative name leads out of the folder that it starts from.
fn leaves_folder(name: &Path) -> bool {
    let mut depth = 0;
    name.components().any(|component| {
        depth += match component {
            Component::Normal(_) => 1,
            Component::CurDir => 0,
            Component::ParentDir => -1,
            Component::RootDir | Component::Prefix(_) => i32::MIN / 2,
        };
        depth < 0
    })
}

/// What turns normals: the inverse transpose. The cofactors are that times the determinant, and stay finite where a
/// scale is zero.
fn normal_matrix(to_world: &DMat4) -> DMat3 {
    cofactor_matrix(DMat3::from_mat4(*to_world)) * to_world.determinant().signum()
}

/// Determinant times the inverse transpose.
fn cofactor_matrix(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

fn triangles_of(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
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

/// `%20` and the like turned into bytes; `None` if that gives no text.
fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut rest = uri.bytes();
    while let Some(byte) = rest.next() {
        if byte == b'%' {
            let digit = |byte: Option<u8>| byte.and_then(|byte| char::from(byte).to_digit(16));
            bytes.push((digit(rest.next())? * 16 + digit(rest.next())?) as u8);
        } else {
            bytes.push(byte);
        }
    }
    String::from_utf8(bytes).ok()
}
