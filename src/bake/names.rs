//! What the files of a bake are called.

use std::collections::{HashMap, HashSet};

use super::Layout;
use crate::scene::Scene;

pub(crate) const GEOMETRY: &str = "scene.bin";
pub(crate) const RADIANCE_SCENE: &str = "scene.gltf";
pub(crate) const LIGHTMAP_SCENE: &str = "scene_lightmap.gltf";

pub(crate) const IRRADIANCE: &str = "_irradiance.exr";
pub(crate) const ERROR: &str = "_error.exr";
pub(crate) const PREVIEW: &str = ".png";
pub(crate) const RADIANCE: &str = "_radiance.png";
pub(crate) const LIGHTMAP: &str = "_lightmap.png";
pub(crate) const ENDINGS: [&str; 5] = [IRRADIANCE, ERROR, PREVIEW, RADIANCE, LIGHTMAP];

/// Endings of the two files of a page.
pub(crate) const PAGE_ENDINGS: [&str; 2] = [".exr", "_error.exr"];

/// File names, each once even where case does not count.
pub(crate) struct Names {
    /// One an object.
    stems: Vec<String>,
    /// The object of each mesh that has a map.
    of_meshes: Vec<usize>,
}

impl Names {
    /// Those of a built-in scene, one per object.
    pub(super) fn new(scene: &Scene, layout: &Layout) -> Names {
        let mut taken: HashSet<String> = [GEOMETRY, RADIANCE_SCENE, LIGHTMAP_SCENE].map(str::to_owned).into();
        taken.extend((0..scene.textures.len()).map(texture_name));
        let stems = stems(layout.objects.iter().map(|object| object.name.as_str()), &ENDINGS, taken);
        let mut of_meshes = vec![usize::MAX; scene.meshes.len()];
        for (index, object) in layout.objects.iter().enumerate() {
            object.meshes.iter().for_each(|mesh| of_meshes[*mesh] = index);
        }
        Names { stems, of_meshes }
    }

    /// Of an object.
    pub(super) fn stem(&self, object: usize) -> &str {
        &self.stems[object]
    }

    /// Of a mesh that has a map.
    pub(super) fn radiance(&self, mesh: usize) -> String {
        format!("{}{RADIANCE}", self.stem(self.of_meshes[mesh]))
    }

    pub(super) fn lightmap(&self, mesh: usize) -> String {
        format!("{}{LIGHTMAP}", self.stem(self.of_meshes[mesh]))
    }
}

/// Beginnings of file names, so that with each ending they are unlike all others and those taken, which are lower case.
pub(crate) fn stems<'a>(wanted: impl Iterator<Item = &'a str>, endings: &[&str], mut taken: HashSet<String>) -> Vec<String> {
    // Those of one name are distinguished by numbers that go on, so that many of them cost no search.
    let mut counts = HashMap::new();
    let mut unlike = |wanted: &str| {
        let wanted = sanitised(wanted);
        let count = counts.entry(wanted.to_lowercase()).or_insert(0);
        loop {
            *count += 1;
            let stem = if *count == 1 { wanted.clone() } else { format!("{wanted}_{count}") };
            let files: Vec<String> = endings.iter().map(|ending| format!("{stem}{ending}").to_lowercase()).collect();
            if files.iter().all(|file| !taken.contains(file)) {
                taken.extend(files);
                return stem;
            }
        }
    };
    wanted.map(&mut unlike).collect()
}

pub(crate) fn texture_name(texture: usize) -> String {
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
