//! Scenes from `.gltf` and `.glb` files (glTF 2.0).
//!
//! Read: meshes with node transforms and instances, skins and morph targets in the pose at rest or at a time of the first animation,
//! quantized or compressed or not, smooth normals, tangents, two sets of texture coordinates and their transforms, vertex colours,
//! materials as [`super::Surface::Layered`] (plain diffuse ones as Lambertian) with all that [`super::material::Layers`] has, KHR_lights_punctual, cameras in perspective
//! and orthographic ones. Whatever else the file holds is named in a warning.

mod accessor;
mod animation;
mod compressed;
mod draco;
mod image_light;
mod ktx2;
mod lights;
mod malformed;
mod materials;
mod members;
pub(crate) mod meshes;
pub(crate) mod source;
mod tangents;
mod textures;
mod transforms;
mod unread;
mod uri;
pub(crate) mod writer;

use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};
use gltf::Document;
use rayon::prelude::*;
use serde_json::{Value, json};

use super::file::read as read_file;
use super::geometry::PLACE_ERROR;
use super::layers::PARAMETERS;
use super::light::LUMENS_PER_WATT;
use super::{Material, Mesh, Progress, Reading, Scene, solids};
use crate::error::{Error, Result};
use crate::text::{counted, in_metres, some_of};
use accessor::Vertices;
use animation::Pose;
use meshes::{Part, ReadPrimitive};
use textures::Wanted;
use transforms::Transform;

/// Hides nodes and all below them.
const VISIBILITY: &str = "KHR_node_visibility";
/// Beside those of materials that [`PARAMETERS`] lists.
const READ_EXTENSIONS: [&str; 13] = [
    "EXT_lights_image_based",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    VISIBILITY,
    "KHR_texture_basisu",
    "KHR_texture_transform",
];
/// A file that needs one of these is read without it, and a warning says so: each adds to a scene that has a meaning without it, as other
/// materials to choose from, other looks of a surface, facts, sounds, what moves or may be touched.
const OPTIONAL_EXTENSIONS: [&str; 27] = [
    "ADOBE_materials_clearcoat_specular",
    "ADOBE_materials_clearcoat_tint",
    "ADOBE_materials_thin_transparency",
    "AGI_articulations",
    "AGI_stk_metadata",
    "CESIUM_primitive_outline",
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_structural_metadata",
    "KHR_animation_pointer",
    "KHR_audio_emitter",
    "KHR_implicit_shapes",
    "KHR_interactivity",
    "KHR_materials_diffuse_roughness",
    "KHR_materials_variants",
    "KHR_materials_volume_scatter",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_physics_rigid_bodies",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_audio_emitter",
    "MSFT_lod",
    "NV_materials_mdl",
    "VRMC_materials_mtoon",
    "VRMC_vrm",
];
/// Of all textures together: half a GiB.
const MAX_TEXELS: u64 = super::geometry::MAX_TEXELS as u64 - 256;
/// Nodes within nodes; deeper ones would be a cycle.
const MAX_DEPTH: usize = 512;

/// Reads a file.
pub(crate) fn load(path: &Path, reading: Reading, progress: Progress) -> Result<Scene> {
    progress("reading the file", 0.0);
    let refuse = |reason: String| Error::Scene { path: path.to_owned(), object: "the file".into(), reason: one_line(&reason) };
    let content = read_file(path).map_err(refuse)?;
    let malformed::Parts { json: text, binary } = malformed::parts(&content).map_err(refuse)?;
    let mut json = malformed::json(&text).map_err(refuse)?;
    malformed::version(&json).map_err(refuse)?;
    let mut left_out = LeftOut::default();
    let shown = unread::take_out(&mut json, reading.at.is_some(), &mut left_out);
    let image_light = image_light::of(&json);
    let buffer_count = json["buffers"].as_array().map_or(0, Vec::len);
    let unpacked = compressed::unpack(path, &mut json, binary.as_deref(), (buffer_count, 0))?;
    if let (false, Some(buffers)) = (unpacked.is_empty(), json.get_mut("buffers").and_then(Value::as_array_mut)) {
        buffers.push(json!({"byteLength": unpacked.len()}));
    }
    let transforms = transforms::of_nodes(&json);
    let material_values = json["materials"].as_array().cloned().unwrap_or_default();
    let mut root = malformed::root(json).map_err(refuse)?;
    // Before anything else: what a file needs an extension for may look missing without it.
    let is_unread = |name: &&str| !is_read(name) && !OPTIONAL_EXTENSIONS.contains(name);
    let unread: Vec<&str> = root.extensions_required.iter().map(String::as_str).filter(is_unread).collect();
    if !unread.is_empty() {
        let remedies: BTreeSet<&str> = unread.iter().map(|name| remedy(name)).collect();
        let remedies: Vec<&str> = remedies.into_iter().collect();
        return Err(refuse(format!("needs {}, which is not supported; {}", unread.join(", "), remedies.join("; "))));
    }
    // The crate knows fewer of them.
    root.extensions_required.clear();
    malformed::missing_members(&root).map_err(refuse)?;
    malformed::faults(&root, &text).map_err(refuse)?;
    let document = Document::from_json_without_validation(root);
    let mut loader = Loader {
        path: path.to_owned(),
        file_bytes: content.len(),
        buffers: Vec::new(),
        scene: Scene {
            name: printable(&path.file_stem().unwrap_or_default().to_string_lossy()),
            extensions: document.extensions_used().map(printable).collect(),
            ..Scene::default()
        },
        left_out,
        transforms,
        rounded: BTreeMap::new(),
        triangle_count: 0,
        wanted_textures: Vec::new(),
        texture_places: HashMap::new(),
        material_values,
        materials: HashMap::new(),
        material_places: HashMap::new(),
        is_quantized: document.extensions_used().any(|extension| extension == "KHR_mesh_quantization"),
        unit: if reading.radiometric { 1.0 } else { 1.0 / LUMENS_PER_WATT },
    };
    loader.read_buffers(&document, binary, (buffer_count, unpacked))?;
    let poses = match reading.at {
        Some(time) => loader.read_poses(&document, time)?,
        None => HashMap::new(),
    };
    let parts = loader.read_nodes(&document, &poses, &shown)?;
    loader.read_textures(&document, progress)?;
    loader.read_meshes(&parts, progress)?;
    if let Some(light) = image_light {
        loader.read_image_light(&document, light)?;
    }
    for extension in document.extensions_used().filter(|extension| !is_read(extension)) {
        loader.leave_out(format!("the extension {extension}"), "");
    }
    loader.finish()
}

fn is_read(extension: &str) -> bool {
    READ_EXTENSIONS.contains(&extension) || PARAMETERS.iter().any(|(name, _)| *name == extension)
}

/// How to write a file that does without an extension.
fn remedy(extension: &str) -> &'static str {
    match extension {
        "EXT_texture_avif" => "convert its textures, as `gltf-transform png IN.glb OUT.glb` does, or export them as PNG or JPEG",
        "MSFT_texture_dds" => "export its textures as PNG or JPEG",
        "KHR_techniques_webgl" | "KHR_materials_common" | "KHR_materials_cmnBlinnPhong" => {
            "export its materials as metallic-roughness ones"
        }
        name if name.starts_with("KHR_gaussian_splatting") => "export it as triangles; splats are not read",
        name if name.contains("compression") => "export it uncompressed, or compressed by Draco or meshoptimizer",
        name if name.starts_with("EXT_lights") || name.starts_with("KHR_lights") => {
            "export its lights as KHR_lights_punctual, or as surfaces that emit"
        }
        name if name.contains("_materials_") => "export its materials without it, by the settings of the program that wrote it",
        _ => "switch it off in the export settings of the program that wrote it",
    }
}

/// A name without line breaks and other control characters, nor those that are not seen and change the order of what is.
fn printable(name: &str) -> String {
    let is_unseen = |letter: char| {
        letter.is_control()
            || matches!(letter, '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
    };
    name.chars().map(|letter| if is_unseen(letter) { ' ' } else { letter }).collect()
}

/// What a file or a decoder says, without its line breaks.
fn one_line(text: &str) -> String {
    printable(&text.lines().map(str::trim).collect::<Vec<_>>().join(" "))
}

/// What the file holds and the scene does not, and which materials, meshes, ... have it.
#[derive(Default)]
struct LeftOut(BTreeMap<String, BTreeSet<String>>);

impl LeftOut {
    /// `owner`: what has it, as `material 'glow'`; empty for the file itself.
    fn add(&mut self, what: impl Into<String>, owner: &str) {
        let owners = self.0.entry(one_line(&what.into())).or_default();
        if !owner.is_empty() {
            owners.insert(owner.to_owned());
        }
    }

    /// All of it in one line.
    fn listed(&self) -> Option<String> {
        let named = |(what, owners): (&String, &BTreeSet<String>)| match owners.is_empty() {
            true => what.clone(),
            false => format!("{what}: {}", some_of(owners.iter())),
        };
        let list: Vec<String> = self.0.iter().map(named).collect();
        (!list.is_empty()).then(|| format!("ignored: {}", list.join("; ")))
    }
}

/// A file being read.
pub(super) struct Loader {
    path: PathBuf,
    file_bytes: usize,
    buffers: Vec<Vec<u8>>,
    scene: Scene,
    left_out: LeftOut,
    /// Of all nodes.
    transforms: Vec<Transform>,
    /// What has places that single precision moved, and how far at most, metres.
    rounded: BTreeMap<String, f64>,
    /// Triangles and vertices of all instances so far.
    triangle_count: usize,
    /// The scene's textures, in order.
    wanted_textures: Vec<Wanted>,
    texture_places: HashMap<Wanted, usize>,
    /// All materials as the file has them.
    material_values: Vec<Value>,
    /// Materials that meshes use, by their number in the file; `None`: that of primitives that name none.
    materials: HashMap<Option<usize>, Material>,
    /// Their places in the scene, by what they are without: normal map, that of the coat, anisotropy.
    material_places: HashMap<(Option<usize>, [bool; 3]), usize>,
    /// Whether the file says that vertices may be whole numbers.
    is_quantized: bool,
    /// Watts in one unit of a punctual light.
    unit: f32,
}

impl Loader {
    /// An error that names the file and the object in it.
    fn refuse(&self, object: &str, reason: impl Into<String>) -> Error {
        Error::Scene { path: self.path.clone(), object: object.to_owned(), reason: one_line(&reason.into()) }
    }

    /// Refuses an object unless `is_so`.
    fn require(&self, is_so: bool, object: &str, reason: impl FnOnce() -> String) -> Result<()> {
        if is_so { Ok(()) } else { Err(self.refuse(object, reason())) }
    }

    fn leave_out(&mut self, what: impl Into<String>, owner: &str) {
        self.left_out.add(what, owner);
    }

    /// Takes note of what single precision has moved by up to so many metres.
    fn note_rounding(&mut self, owner: &str, metres: f64) {
        if metres > PLACE_ERROR {
            let most = self.rounded.entry(owner.to_owned()).or_default();
            *most = most.max(metres);
        }
    }

    /// `unpacked`: the number of the buffer that holds what was compressed, and its bytes.
    fn read_buffers(&mut self, document: &Document, mut blob: Option<Vec<u8>>, mut unpacked: (usize, Vec<u8>)) -> Result<()> {
        for buffer in document.buffers() {
            if buffer.index() == unpacked.0 {
                self.buffers.push(std::mem::take(&mut unpacked.1));
                continue;
            }
            let what = format!("buffer {}", buffer.index());
            let bytes = match buffer.source() {
                gltf::buffer::Source::Bin => {
                    blob.take().ok_or_else(|| self.refuse(&what, "is the file's binary part, and there is none"))?
                }
                gltf::buffer::Source::Uri(uri) => self.read_uri(uri, &what)?,
            };
            // What is asked for and is not there is refused where it is read.
            if bytes.len() < buffer.length() {
                self.leave_out(format!("{} bytes that are announced and not there", buffer.length() - bytes.len()), &what);
            }
            self.buffers.push(bytes);
        }
        Ok(())
    }

    fn read_uri(&self, uri: &str, what: &str) -> Result<Vec<u8>> {
        uri::read(&self.path, uri).map_err(|reason| self.refuse(what, reason))
    }

    /// Reads cameras, lights and the materials of the primitives that it lists, of the nodes `shown`.
    fn read_nodes<'a>(&mut self, document: &'a Document, poses: &HashMap<usize, Pose>, shown: &BTreeSet<usize>) -> Result<Vec<Part<'a>>> {
        let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) else {
            return Err(self.refuse("the file", "holds neither a scene nor a node"));
        };
        if document.scenes().len() > 1 {
            self.leave_out("scenes beside the default one", "");
        }
        let mut nodes = Vec::new();
        let mut to_world = HashMap::new();
        for node in scene.nodes() {
            self.place_node(node, poses, DMat4::IDENTITY, 0, &mut nodes, &mut to_world)?;
        }
        // Where hidden ones stand may move joints.
        nodes.retain(|node| shown.contains(&node.index()));
        self.require_few_parts(document, &nodes)?;
        let mut skins = HashMap::new();
        let mut parts = Vec::new();
        for node in &nodes {
            let what = node_name(node);
            let own = to_world[&node.index()];
            if let Some(mesh) = node.mesh() {
                let name: Arc<str> = named("mesh", node.name().or(mesh.name()), mesh.index()).into();
                let skin = match node.skin() {
                    Some(skin) => Some(match skins.entry(skin.index()) {
                        Entry::Occupied(known) => Arc::clone(known.get()),
                        Entry::Vacant(free) => Arc::clone(free.insert(Arc::new(self.joint_matrices(&skin, &to_world)?))),
                    }),
                    None => None,
                };
                let posed = poses.get(&node.index()).and_then(|pose| pose.weights.as_deref());
                let weights: Arc<[f32]> = posed.or(node.weights()).or(mesh.weights()).unwrap_or_default().into();
                for to_node in self.instances(document, node, &what, &own)? {
                    for primitive in mesh.primitives() {
                        let (name, skin, weights) = (name.clone(), skin.clone(), weights.clone());
                        let (node, mesh, to_world) = (node.index(), mesh.index(), own * to_node);
                        let part = Part { primitive, name, node, mesh, to_world, skin, weights, material: 0 };
                        self.list_primitive(document, part, &mut parts)?;
                    }
                }
            }
            if let Some(camera) = node.camera() {
                self.read_camera(&camera, node, own);
            }
            if let Some(light) = node.light() {
                self.read_light(&light, &what, own)?;
            }
        }
        Ok(parts)
    }

    fn read_meshes(&mut self, parts: &[Part], progress: Progress) -> Result<()> {
        for batch in parts.chunks((parts.len() / 100).max(16 * rayon::current_num_threads())) {
            progress("reading meshes", self.scene.meshes.len() as f64 / parts.len() as f64);
            let read: Vec<Result<ReadPrimitive>> = batch.par_iter().map(|part| self.read_primitive(part)).collect();
            for read in read {
                let ReadPrimitive { mesh, is_turned_anyhow, lacks_unused_uvs, rounding } = read?;
                self.note_rounding(&format!("mesh '{}'", mesh.name), rounding);
                if lacks_unused_uvs {
                    let owner = format!("mesh '{}'", mesh.name);
                    self.leave_out("texture coordinates that no texture uses and that cannot be read", &owner);
                }
                if is_turned_anyhow {
                    let owner = format!("material '{}' on mesh '{}'", self.scene.materials[mesh.material].name, mesh.name);
                    self.leave_out(
                        "that normal maps or anisotropy lie on meshes without tangents (they have arbitrary directions)",
                        &owner,
                    );
                }
                self.scene.meshes.push(mesh);
            }
        }
        Ok(())
    }

    /// Lists a node and all below it, and where each stands in the world.
    fn place_node<'a>(
        &mut self,
        node: gltf::Node<'a>,
        poses: &HashMap<usize, Pose>,
        parent: DMat4,
        depth: usize,
        nodes: &mut Vec<gltf::Node<'a>>,
        to_world: &mut HashMap<usize, DMat4>,
    ) -> Result<()> {
        let what = node_name(&node);
        self.require(depth <= MAX_DEPTH, &what, || format!("lies more than {MAX_DEPTH} nodes deep, or within itself"))?;
        let rest = self.transforms[node.index()];
        let pose = poses.get(&node.index());
        if let Some(pose) = pose {
            self.note_rounding(&format!("the animation of {what}"), transforms::moved(&parent, pose.rounding));
        }
        let matrix = pose.map_or_else(|| rest.matrix(), |pose| pose.matrix(&rest));
        let own = parent * matrix;
        let is_finite = own.to_cols_array().iter().all(|number| number.abs() <= f64::from(f32::MAX));
        self.require(is_finite, &what, || "has a transform that is not finite in single precision".into())?;
        let is_new = to_world.insert(node.index(), own).is_none();
        self.require(is_new, &what, || "has two parents; a node has one place in a scene".into())?;
        nodes.push(node.clone());
        node.children().try_for_each(|child| self.place_node(child, poses, own, depth + 1, nodes, to_world))
    }

    /// TRANSLATION, ROTATION and SCALE of a node's instances (EXT_mesh_gpu_instancing); `None` of a node without instances.
    fn instance_accessors<'a>(
        &self,
        document: &'a Document,
        node: &gltf::Node,
        what: &str,
    ) -> Result<Option<[Option<gltf::Accessor<'a>>; 3]>> {
        let Some(attributes) = node.extension_value("EXT_mesh_gpu_instancing").map(|extension| &extension["attributes"]) else {
            return Ok(None);
        };
        let accessor = |name: &str| -> Result<Option<gltf::Accessor<'a>>> {
            let Some(number) = attributes.get(name) else { return Ok(None) };
            let found = number.as_u64().and_then(|number| document.accessors().nth(usize::try_from(number).ok()?));
            found.map(Some).ok_or_else(|| self.refuse(what, format!("has instances with {name} in accessor {number}, which is not there")))
        };
        Ok(Some([accessor("TRANSLATION")?, accessor("ROTATION")?, accessor("SCALE")?]))
    }

    /// Transforms of the instances of a node, whose own is `to_world`; of a node without them, one that does nothing.
    fn instances(&mut self, document: &Document, node: &gltf::Node, what: &str, to_world: &DMat4) -> Result<Vec<DMat4>> {
        let Some([translations, rotations, scales]) = self.instance_accessors(document, node, what)? else {
            return Ok(vec![DMat4::IDENTITY]);
        };
        let rows = |accessor: gltf::Accessor| {
            accessor::read(self, &accessor, &Vertices::All, what, |row: [f32; 3]| DVec3::from(row.map(f64::from)))
        };
        let stored = translations.clone();
        let (translations, scales) = (translations.map(rows).transpose()?, scales.map(rows).transpose()?);
        let turn = |of: [f32; 4]| DQuat::from_array(of.map(f64::from)).normalize();
        let rotations = rotations.map(|of| accessor::read(self, &of, &Vertices::All, what, turn)).transpose()?;
        let counts: BTreeSet<usize> =
            [translations.as_ref().map(Vec::len), scales.as_ref().map(Vec::len), rotations.as_ref().map(Vec::len)]
                .into_iter()
                .flatten()
                .collect();
        let (Some(count), true) = (counts.first().copied(), counts.len() <= 1) else {
            return Err(
                self.refuse(what, format!("has instances with {counts:?} values; TRANSLATION, ROTATION and SCALE must have as many each"))
            );
        };
        if let Some(place) = rotations.iter().flatten().position(|turn| !turn.is_finite()) {
            return Err(self.refuse(what, format!("has an instance {place} with a rotation of length 0")));
        }
        if let (Some(stored), Some(translations)) = (stored, &translations) {
            let by = transforms::most_rounding(&stored, translations);
            self.note_rounding(&format!("instances of {what}"), transforms::moved(to_world, by));
        }
        let of = |place: usize| {
            DMat4::from_scale_rotation_translation(
                scales.as_ref().map_or(DVec3::ONE, |all| all[place]),
                rotations.as_ref().map_or(DQuat::IDENTITY, |all| all[place]),
                translations.as_ref().map_or(DVec3::ZERO, |all| all[place]),
            )
        };
        Ok((0..count).map(of).collect())
    }

    /// Meshes that bound a medium and are not closed, alone or with others of their material.
    fn solids_with_holes(&self) -> BTreeSet<String> {
        let is_open = |mesh: &&Mesh| self.scene.materials[mesh.material].is_entered() && !Mesh::are_closed([*mesh]);
        let open: Vec<&Mesh> = self.scene.meshes.par_iter().filter(is_open).collect();
        let mut by_material: BTreeMap<usize, Vec<&Mesh>> = BTreeMap::new();
        for mesh in open {
            by_material.entry(mesh.material).or_default().push(mesh);
        }
        by_material.retain(|_, meshes| !Mesh::are_closed(meshes.iter().copied()));
        by_material.values().flatten().map(|mesh| format!("mesh '{}'", mesh.name)).collect()
    }

    /// That places far from 0 stand in the file in single precision.
    fn rounding_warning(&self) -> Option<String> {
        let most = self.rounded.values().copied().reduce(f64::max)?;
        Some(format!(
            "places far from 0 are off by up to {}: glTF's buffers hold them in single precision ({}); export with the site's offset in the \
             translation of a node, which is read in double precision, and the rest near 0",
            in_metres(most),
            some_of(self.rounded.keys())
        ))
    }

    /// The scene, degenerate triangles gone, with its warnings.
    fn finish(mut self) -> Result<Scene> {
        let cut: Vec<bool> = self.scene.meshes.par_iter_mut().map(Mesh::clamp_colours).collect();
        let with_cut: Vec<String> =
            self.scene.meshes.iter().zip(cut).filter(|(_, cut)| *cut).map(|(mesh, _)| format!("mesh '{}'", mesh.name)).collect();
        for name in with_cut {
            self.leave_out("what vertex colours have below 0 or above 1", &name);
        }
        // Before triangles without area go, which may stand between others.
        let turned = solids::turn_outwards(&mut self.scene);
        if !turned.is_empty() {
            self.scene
                .warnings
                .push(format!("solids whose faces look inwards ({}): turned, so that they look outwards", some_of(turned.iter())));
        }
        let open = self.solids_with_holes();
        if !open.is_empty() {
            self.scene.warnings.push(format!(
                "solids with holes ({}): light that enters one may never leave it; close it, or set its material's thicknessFactor to 0 for a \
                 thin wall",
                some_of(open.iter())
            ));
        }
        let (min, max) = self.scene.bounds();
        let extent = (max - min).max_element();
        let dropped: Vec<usize> = self.scene.meshes.par_iter_mut().map(|mesh| mesh.drop_degenerate_triangles(extent)).collect();
        let with_flat = self.scene.meshes.iter().zip(&dropped).filter(|(_, dropped)| **dropped > 0);
        let flat: BTreeSet<String> = with_flat.map(|(mesh, _)| format!("mesh '{}'", mesh.name)).collect();
        self.scene.meshes.retain(|mesh| !mesh.triangles.is_empty());
        if !flat.is_empty() {
            let count: usize = dropped.iter().sum();
            self.scene.warnings.push(format!("{} without area left out ({})", counted(count, "triangle"), some_of(flat.iter())));
        }
        self.scene.warnings.extend(self.left_out.listed());
        self.scene.warnings.extend(self.rounding_warning());
        self.require(self.scene.triangle_count() > 0, "the scene", || {
            let left_out = self.scene.warnings.iter().map(|warning| format!("; {warning}"));
            "holds no triangle".to_owned() + &left_out.collect::<String>()
        })?;
        Ok(self.scene)
    }
}

fn node_name(node: &gltf::Node) -> String {
    called("node", node.name(), node.index())
}

/// An object's name, or its kind and number.
fn named(kind: &str, name: Option<&str>, number: usize) -> String {
    name.map_or_else(|| format!("{kind} {number}"), printable)
}

/// An object in complaints: its name, or its number.
fn called(kind: &str, name: Option<&str>, number: usize) -> String {
    name.map_or_else(|| format!("{kind} {number}"), |name| format!("{kind} '{}'", printable(name)))
}
