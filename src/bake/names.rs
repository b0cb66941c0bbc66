//! What the files of a bake are called.

use std::collections::{HashMap, HashSet};

use super::Layout;
use crate::scene::Scene;

pub const GEOMETRY: &str = "scene.bin";
pub const RADIANCE_SCENE: &str = "scene.gltf";
pub const LIGHTMAP_SCENE: &str = "scene_lightmap.gltf";

pub const IRRADIANCE: &str = "_irradiance.exr";
pub const ERROR: &str = "_error.exr";
pub const PREVIEW: &str = ".png";
pub const RADIANCE: &str = "_radiance.png";
pub const LIGHTMAP: &str = "_lightmap.png";
pub const ENDINGS: [&str; 5] = [IRRADIANCE, ERROR, PREVIEW, RADIANCE, LIGHTMAP];

/// File names, each once even where case does not count.
pub struct Names {
    /// One a mesh of the scene; empty where it has no map.
    stems: Vec<String>,
}

impl Names {
    pub fn new(scene: &Scene, layout: &Layout) -> Names {
        let mut taken: HashSet<String> = [GEOMETRY, RADIANCE_SCENE, LIGHTMAP_SCENE].map(str::to_owned).into();
        taken.extend((0..scene.textures.len()).map(texture_name));
        let mut stems = vec![String::new(); scene.meshes.len()];
        // Meshes of one name are told apart by numbers that go on, so that many of them cost no search.
        let mut counts = HashMap::new();
        for (mesh, lightmap) in layout.lightmaps() {
            let wanted = sanitised(&lightmap.mesh.name);
            let count = counts.entry(wanted.to_lowercase()).or_insert(0);
            stems[mesh] = loop {
                *count += 1;
                let stem = if *count == 1 { wanted.clone() } else { format!("{wanted}_{count}") };
                let files = ENDINGS.map(|ending| format!("{stem}{ending}").to_lowercase());
                if files.iter().all(|file| !taken.contains(file)) {
                    taken.extend(files);
                    break stem;
                }
            };
        }
        Names { stems }
    }

    pub fn stem(&self, mesh: usize) -> &str {
        &self.stems[mesh]
    }

    pub fn radiance(&self, mesh: usize) -> String {
        format!("{}{RADIANCE}", self.stem(mesh))
    }

    pub fn lightmap(&self, mesh: usize) -> String {
        format!("{}{LIGHTMAP}", self.stem(mesh))
    }

    pub fn texture(&self, texture: usize) -> String {
        texture_name(texture)
    }
}

fn texture_name(texture: usize) -> String {
    format!("texture_{texture}.png")
}

/// A name that every file system takes and that needs no escapes in a URI's path: letters, digits, `-`
/// and `_`.
fn sanitised(name: &str) -> String {
    const LONGEST: usize = 60;
    // Names of devices on Windows, whatever their extension.
    const RESERVED: [&str; 4] = ["con", "prn", "aux", "nul"];
    let kept = |letter: char| if letter.is_alphanumeric() || letter == '-' { letter } else { '_' };
    let text: String = name.trim().chars().take(LONGEST).map(kept).collect();
    let is_port = |text: &str| text.len() == 4 && (text.starts_with("com") || text.starts_with("lpt"));
    let lower = text.to_lowercase();
    match text.is_empty() || RESERVED.contains(&lower.as_str()) || is_port(&lower) {
        true => format!("mesh_{text}"),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_suit_every_file_system() {
        let names = ["tall block", "../../etc/passwd", "a:b*c?", "Würfel", "", "NUL", "com1", ".hidden"];
        let sane = ["tall_block", "______etc_passwd", "a_b_c_", "Würfel", "mesh_", "mesh_NUL", "mesh_com1", "_hidden"];
        assert_eq!(names.map(sanitised), sane);
        assert!(sanitised(&"x".repeat(500)).len() < 100);
    }
}
