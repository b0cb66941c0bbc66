//! What is lit: triangle meshes with materials, lights and cameras ([`Scene`]), read from glTF or
//! built in; and the paper's box, a convex room ([`room::RoomScene`]).

pub(crate) mod albedo;
pub(crate) mod box_tree;
pub mod built_in;
pub(crate) mod bvh;
pub mod camera;
mod choices;
pub(crate) mod closed_forms;
pub(crate) mod connected;
pub(crate) mod contact;
pub(crate) mod contact_offsets;
pub(crate) mod coplanar;
pub(crate) mod daylight;
pub(crate) mod file;
pub(crate) mod film;
pub(crate) mod frame;
pub(crate) mod geometry;
pub(crate) mod gltf;
pub mod image_size;
pub mod layers;
pub mod light;
pub(crate) mod light_tree;
pub(crate) mod linear_image;
pub mod material;
pub mod mesh;
pub(crate) mod open_box;
pub(crate) mod openings;
pub(crate) mod overlap;
mod planes;
pub(crate) mod rectangle;
pub(crate) mod room;
pub(crate) mod sensors;
pub(crate) mod showcase;
pub mod sky;
pub(crate) mod sky_table;
pub(crate) mod solids;
pub mod surroundings;
pub(crate) mod targets;
pub mod texture;
mod work;

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;

pub use camera::{Camera, Lens, Projection};
pub use light::{Light, LightKind};
pub(crate) use material::LobeKinds;
pub use material::{Material, Surface};
pub use mesh::Mesh;
pub use texture::Texture;

use crate::error::{Error, Result};

/// Called with what is being done while a scene is opened, and the share of it that is done.
pub(crate) type Progress<'a> = &'a mut dyn FnMut(&'static str, f64);

/// How a file is read.
#[derive(Debug, Clone, Copy, Default)]
pub struct Reading {
    /// Punctual lights are given in W/sr and W/m2 instead of candela and lux.
    pub radiometric: bool,
    /// Seconds into the first animation, for the pose of its nodes; `None`: the pose at rest.
    pub at: Option<f64>,
}

/// A built-in scene: its name, and what makes it but for that.
type Named = (&'static str, fn() -> Scene);

/// Meshes in world space, metres, y up, with what they are made of and what lights them.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    pub name: String,
    pub meshes: Vec<Mesh>,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    /// Lights that are no mesh; meshes of an emissive material emit light as well.
    pub lights: Vec<Light>,
    pub cameras: Vec<Camera>,
    /// Extensions that the file uses.
    pub extensions: Vec<String>,
    /// What the file holds and this program leaves out, each once.
    pub warnings: Vec<String>,
}

impl Scene {
    /// A built-in scene by name, else a `.gltf` or `.glb` file. `radiometric`: punctual lights are
    /// given in W/sr and W/m2 instead of candela and lux.
    pub fn open(name: &str, radiometric: bool) -> Result<Scene> {
        Scene::open_with(name, Reading { radiometric, at: None }, &mut |_, _| {})
    }

    /// The same, with reports of how far it has come.
    pub fn open_with(name: &str, reading: Reading, progress: Progress) -> Result<Scene> {
        if let Some(scene) = built_in::by_name(name) {
            if let Some(time) = reading.at {
                return Err(Error::setting("at", time, "is a time of a file's animation; built-in scenes have none"));
            }
            return Ok(scene);
        }
        let path = Path::new(name);
        match path.extension().and_then(|extension| extension.to_str()).map(str::to_lowercase).as_deref() {
            Some("gltf" | "glb") => {
                let mut scene = gltf::load(path, reading, progress)?;
                contact_offsets::apply(&mut scene);
                Ok(scene)
            }
            _ if path.is_file() => {
                let remedy = "must be a .gltf or .glb file; export it as glTF 2.0, in Blender by File > Export";
                Err(Error::setting("SCENE", name, remedy))
            }
            _ => {
                let names = built_in::names();
                let likeness = |known: &&str| strsim::jaro(known, name);
                let meant = names.iter().copied().max_by(|a, b| likeness(a).total_cmp(&likeness(b))).filter(|best| likeness(best) > 0.8);
                let meant = meant.map_or_else(String::new, |meant| format!("did you mean {meant}? "));
                Err(Error::setting("SCENE", name, format!("{meant}must be a .gltf or .glb file, or one of {}", names.join(", "))))
            }
        }
    }

    /// Which lobes each material may have.
    pub fn lobe_kinds(&self) -> Vec<LobeKinds> {
        // Materials share textures, and looking through a large one takes a while.
        let mut known = HashMap::new();
        let mut range = |texture: usize, channel: usize| {
            *known.entry((texture, channel)).or_insert_with(|| self.textures[texture].texels.range(channel))
        };
        self.materials.iter().map(|material| LobeKinds::of(material, &mut range)).collect()
    }

    /// Its first camera, or one that sees all of it.
    pub fn first_camera(&self) -> Camera {
        self.cameras.first().cloned().unwrap_or_else(|| self.camera_around(1.0))
    }

    /// The camera of this name.
    pub fn camera(&self, name: &str) -> Result<Camera> {
        self.cameras.iter().find(|camera| camera.name == name).cloned().ok_or_else(|| {
            let names: Vec<&str> = self.cameras.iter().map(|camera| camera.name.as_str()).collect();
            let there = if names.is_empty() {
                "no such camera: the scene has none; leave `camera` out".to_owned()
            } else {
                format!("must be one of {}", names.join(", "))
            };
            Error::setting("camera", name, there)
        })
    }

    /// A camera that sees all of it in a picture of this width over height.
    pub fn camera_around(&self, aspect: f64) -> Camera {
        let (min, max) = self.bounds();
        Camera::around(min, max, aspect)
    }

    pub fn triangle_count(&self) -> usize {
        self.meshes.iter().map(|mesh| mesh.triangles.len()).sum()
    }

    /// What distinguishes the meshes in messages: their names, with node, primitive and instance where several have one name.
    pub fn mesh_names(&self) -> Vec<String> {
        type Place = (Option<usize>, usize);
        let places = |mesh: &Mesh| -> Place { mesh.source.as_ref().map_or((None, 0), |source| (Some(source.node), source.primitive)) };
        // Of the first mesh of a name, and whether others of the name differ from it in node and primitive.
        let mut alike: HashMap<&str, (Place, [bool; 2])> = HashMap::new();
        for mesh in &self.meshes {
            let (first, differs) = alike.entry(&mesh.name).or_insert((places(mesh), [false; 2]));
            *differs = [differs[0] || first.0 != places(mesh).0, differs[1] || first.1 != places(mesh).1];
        }
        let mut seen: HashMap<(&str, Place), usize> = HashMap::new();
        let mut names = Vec::with_capacity(self.meshes.len());
        for mesh in &self.meshes {
            let (node, primitive) = places(mesh);
            let mut name = mesh.name.clone();
            if let (Some(node), [true, _]) = (node, alike[mesh.name.as_str()].1) {
                name += &format!(", node {node}");
            }
            if alike[mesh.name.as_str()].1[1] {
                name += &format!(", primitive {primitive}");
            }
            let instance = seen.entry((&mesh.name, (node, primitive))).or_default();
            if *instance > 0 {
                name += &format!(", instance {instance}");
            }
            *instance += 1;
            names.push(name);
        }
        names
    }

    /// Smallest box around all triangles: (lower corner, upper corner).
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let grown = |(min, max): (DVec3, DVec3), corner: DVec3| (min.min(corner), max.max(corner));
        let joined = |a: (DVec3, DVec3), b: (DVec3, DVec3)| (a.0.min(b.0), a.1.max(b.1));
        let of_mesh = |mesh: &Mesh| {
            let with = |bounds, triangle| mesh.corners(triangle).into_iter().fold(bounds, grown);
            (0..mesh.triangles.len()).into_par_iter().with_min_len(1 << 12).fold(|| nothing, with).reduce(|| nothing, joined)
        };
        let (min, max) = self.meshes.par_iter().map(of_mesh).reduce(|| nothing, joined);
        // Threads decide which of 0 and -0 comes first; the sum turns both into 0.
        (min + DVec3::ZERO, max + DVec3::ZERO)
    }

    /// Metres from a place to the nearest triangle in a unit direction, if there is one.
    pub fn distance_along(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let of_triangle = |mesh: &Mesh, triangle| distance_to(mesh.corners(triangle), origin, direction);
        let of_mesh = |mesh: &Mesh| (0..mesh.triangles.len()).filter_map(|triangle| of_triangle(mesh, triangle)).min_by(f64::total_cmp);
        self.meshes.par_iter().filter_map(of_mesh).min_by(f64::total_cmp)
    }

    /// Whether anything emits light.
    pub fn is_lit(&self) -> bool {
        !self.lights.is_empty() || self.meshes.iter().any(|mesh| self.materials[mesh.material].is_emissive())
    }
}

/// Along a ray to a triangle, which one in the triangle's plane misses (Moeller and Trumbore 1997).
pub(crate) fn distance_to([a, b, c]: [DVec3; 3], origin: DVec3, direction: DVec3) -> Option<f64> {
    let (ab, ac, from) = (b - a, c - a, origin - a);
    let p = direction.cross(ac);
    let scale = 1.0 / ab.dot(p);
    let q = from.cross(ab);
    let (u, v, t) = (scale * from.dot(p), scale * direction.dot(q), scale * ac.dot(q));
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}

/// Smallest box around points: (lower corner, upper corner).
pub(crate) fn bounds_of(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), point| (low.min(point), high.max(point)))
}
