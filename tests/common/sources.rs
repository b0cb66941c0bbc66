//! Files of the repository, for tests that read them.

use super::prelude::*;
use super::program::entries;

pub fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

pub fn read(path: &str) -> String {
    std::fs::read_to_string(root(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Paths and contents of the files below a folder whose names end so.
pub fn files(folder: &str, ends: &[&str]) -> Vec<(String, String)> {
    let below = |name: String| {
        let path = format!("{folder}/{name}");
        match ends.iter().any(|end| name.ends_with(end)) {
            _ if root(&path).is_dir() => files(&path, ends),
            true => vec![(path.clone(), read(&path))],
            false => Vec::new(),
        }
    };
    entries(&root(folder)).into_iter().flat_map(below).collect()
}

/// Their contents alone.
pub fn texts(folder: &str, ends: &[&str]) -> Vec<String> {
    files(folder, ends).into_iter().map(|(_, text)| text).collect()
}
