//! Files that appear whole or not at all: written under a temporary name in their own folder, and
//! renamed at the end. Opened before a run, so that a run never ends in 'cannot be written'.

use std::io::Write;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Result};

/// A file that will be written.
pub struct Destination {
    option: &'static str,
    path: PathBuf,
    file: NamedTempFile,
}

impl Destination {
    /// Fails now if `path` could not be written later. `option` is named in errors.
    pub fn open(option: &'static str, path: &Path) -> Result<Destination> {
        let refuse = |reason: String| Error::Output { option, path: path.to_owned(), reason };
        if path.is_dir() {
            return Err(refuse("it is a folder".into()));
        }
        if path.file_name().is_none() {
            return Err(refuse("it names no file".into()));
        }
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        if !folder.is_dir() {
            return Err(refuse(format!("there is no folder {}", folder.display())));
        }
        let file = temporary_in(folder).map_err(|error| refuse(error.kind().to_string()))?;
        Ok(Destination { option, path: path.to_owned(), file })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the content and gives the file its name.
    pub fn write(mut self, content: &[u8]) -> Result<()> {
        let refuse = |reason: String| Error::Output { option: self.option, path: self.path.clone(), reason };
        self.file.write_all(content).map_err(|error| refuse(error.to_string()))?;
        self.file.persist(&self.path).map_err(|error| refuse(error.error.to_string()))?;
        Ok(())
    }
}

fn temporary_in(folder: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".photonmill-");
    // Readable by whom the user's umask allows, as any program's output is.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

/// A folder that will hold files; made if it is not there, and taken away again if nothing comes.
pub struct Folder {
    option: &'static str,
    path: PathBuf,
    made: bool,
}

impl Folder {
    pub fn open(option: &'static str, path: &Path) -> Result<Folder> {
        let refuse = |error: std::io::Error| Error::Output { option, path: path.to_owned(), reason: error.kind().to_string() };
        let made = !path.exists();
        std::fs::create_dir_all(path).map_err(refuse)?;
        let folder = Folder { option, path: path.to_owned(), made };
        temporary_in(path).map_err(refuse)?;
        Ok(folder)
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn write(&self, name: &str, content: &[u8]) -> Result<()> {
        Destination::open(self.option, &self.path.join(name))?.write(content)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if self.made {
            // Fails where files were written, which is as it should be.
            let _ = std::fs::remove_dir(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_appears_only_when_it_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let destination = Destination::open("-o", &path).unwrap();
        assert!(!path.exists());
        destination.write(b"whole").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"whole");
        drop(Destination::open("-o", &path).unwrap());
        assert_eq!(std::fs::read(&path).unwrap(), b"whole");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_cannot_be_written_is_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        for path in [folder.path().join("absent/a.txt"), folder.path().to_owned()] {
            assert!(matches!(Destination::open("-o", &path), Err(Error::Output { option: "-o", .. })));
        }
    }

    #[test]
    fn an_unused_folder_goes_away() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("made");
        drop(Folder::open("--irradiance", &path).unwrap());
        assert!(!path.exists());
        Folder::open("--irradiance", &path).unwrap().write("a", b"b").unwrap();
        assert!(path.join("a").exists());
    }
}
