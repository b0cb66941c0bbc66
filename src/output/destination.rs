//! Files that appear whole or not at all. Destinations are checked before a run, so that a run never
//! ends in 'cannot be written'; afterwards everything is written under temporary names, and only when
//! all of it is there are the files renamed.

use std::collections::HashMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Result};

/// A file that will be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Destination {
    option: &'static str,
    /// As the user named it.
    path: PathBuf,
}

/// A folder that will hold files; made when they are written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folder {
    option: &'static str,
    path: PathBuf,
}

impl Destination {
    /// Fails now if `path` could not be written later. `option` is named in errors.
    pub fn open(option: &'static str, path: &Path) -> Result<Destination> {
        let destination = Destination { option, path: path.to_owned() };
        let ends_as_folder = path.as_os_str().as_encoded_bytes().last().is_none_or(|byte| std::path::is_separator(char::from(*byte)));
        if path.is_dir() || ends_as_folder {
            return Err(destination.refuse("it names a folder"));
        }
        let target = destination.target();
        if target.exists() && !target.is_file() {
            // A pipe or a device takes what is written; there is nothing to try.
            return Ok(destination);
        }
        let folder = parent(&target);
        if !folder.is_dir() {
            return Err(destination.refuse(format!("there is no folder {}", folder.display())));
        }
        temporary_in(folder).map_err(|error| destination.refuse(error.kind()))?;
        Ok(destination)
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    fn refuse(&self, reason: impl ToString) -> Error {
        Error::Output { option: self.option, path: self.path.clone(), reason: reason.to_string() }
    }

    /// The file itself, where the path is a link to it.
    fn target(&self) -> PathBuf {
        std::fs::canonicalize(&self.path).unwrap_or_else(|_| self.path.clone())
    }
}

impl Folder {
    /// Fails now if no file could be written into `path` later.
    pub fn open(option: &'static str, path: &Path) -> Result<Folder> {
        let folder = Folder { option, path: path.to_owned() };
        let refuse = |reason: String| Error::Output { option, path: path.to_owned(), reason };
        if path.exists() && !path.is_dir() {
            return Err(refuse("it is not a folder".into()));
        }
        if path.as_os_str().is_empty() {
            return Err(refuse("it names no folder".into()));
        }
        let nearest = path.ancestors().find(|ancestor| ancestor.is_dir()).unwrap_or(Path::new("."));
        if path.ancestors().any(|ancestor| ancestor.exists() && !ancestor.is_dir()) {
            return Err(refuse("a part of its path is a file".into()));
        }
        // Making a folder asks for the same right as making a file.
        temporary_in(nearest).map_err(|error| refuse(error.kind().to_string()))?;
        Ok(folder)
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A file in the folder.
    pub fn file(&self, name: &str) -> Destination {
        Destination { option: self.option, path: self.path.join(name) }
    }
}

/// Refuses two outputs in one file.
pub fn check_distinct(destinations: &[Destination]) -> Result<()> {
    let mut seen: HashMap<PathBuf, &Destination> = HashMap::new();
    for destination in destinations {
        let target = destination.target();
        let place = std::fs::canonicalize(parent(&target)).unwrap_or_else(|_| parent(&target).to_owned());
        let file = place.join(target.file_name().unwrap_or_default());
        if let Some(first) = seen.insert(file, destination) {
            return Err(destination.refuse(format!("{} writes it too", first.option)));
        }
    }
    Ok(())
}

/// Writes every file, or none: all are there under temporary names before the first gets its own.
pub fn write_all(files: impl IntoIterator<Item = (Destination, Vec<u8>)>) -> Result<()> {
    let mut staged = Vec::new();
    for (destination, content) in files {
        let target = destination.target();
        let refuse = |error: std::io::Error| destination.refuse(error.kind());
        if target.exists() && !target.is_file() {
            std::fs::OpenOptions::new().write(true).open(&target).and_then(|mut file| file.write_all(&content)).map_err(refuse)?;
            continue;
        }
        std::fs::create_dir_all(parent(&target)).map_err(refuse)?;
        let mut file = temporary_in(parent(&target)).map_err(refuse)?;
        file.write_all(&content).map_err(refuse)?;
        staged.push((destination, target, file));
    }
    for (destination, target, file) in staged {
        file.persist(&target).map_err(|error| destination.refuse(error.error.kind()))?;
    }
    Ok(())
}

fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A file that goes away unless it is renamed.
fn temporary_in(folder: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".photonmill-");
    // Readable by whom the user's umask allows, as any program's output is.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_appear_together_and_whole() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| Destination::open("-o", &folder.path().join(name)).unwrap();
        let (first, second) = (at("a.txt"), at("b.txt"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "checking leaves nothing");
        write_all(vec![(first.clone(), b"one".to_vec()), (second, b"two".to_vec())]).unwrap();
        assert_eq!(std::fs::read(first.path()).unwrap(), b"one");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);

        // The second cannot be written, so the first stays what it was.
        let lost = Destination { option: "-o", path: folder.path().join("a.txt/c.txt") };
        assert!(write_all(vec![(first.clone(), b"new".to_vec()), (lost, Vec::new())]).is_err());
        assert_eq!(std::fs::read(first.path()).unwrap(), b"one");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn what_cannot_be_written_is_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for path in [at("absent/a.txt"), folder.path().to_owned(), at("new/"), PathBuf::new()] {
            assert!(matches!(Destination::open("-o", &path), Err(Error::Output { option: "-o", .. })), "{path:?}");
        }
        std::fs::write(at("file"), "").unwrap();
        for path in [at("file"), at("file/below")] {
            assert!(matches!(Folder::open("--out", &path), Err(Error::Output { option: "--out", .. })), "{path:?}");
        }
    }

    #[test]
    fn folders_are_made_when_they_are_filled() {
        let parent = tempfile::tempdir().unwrap();
        let folder = Folder::open("--irradiance", &parent.path().join("a/b")).unwrap();
        assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 0);
        write_all(vec![(folder.file("c"), b"d".to_vec())]).unwrap();
        assert_eq!(std::fs::read(folder.path().join("c")).unwrap(), b"d");
    }

    #[test]
    fn two_outputs_may_not_share_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let at = |option, name: &str| Destination { option, path: folder.path().join(name) };
        assert!(check_distinct(&[at("--json", "a"), at("--trace", "b")]).is_ok());
        let error = check_distinct(&[at("--json", "a"), at("--trace", "./a")]).unwrap_err().to_string();
        assert!(error.contains("--json") && error.contains("--trace"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn links_and_pipes_stay_what_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let (target, link) = (folder.path().join("target"), folder.path().join("link"));
        std::fs::write(&target, "old").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        write_all(vec![(Destination::open("-o", &link).unwrap(), b"new".to_vec())]).unwrap();
        assert!(link.is_symlink());
        assert_eq!(std::fs::read(&target).unwrap(), b"new");
        write_all(vec![(Destination::open("-o", Path::new("/dev/null")).unwrap(), b"gone".to_vec())]).unwrap();
        assert!(!Path::new("/dev/null").is_file());
    }
}
