//! Files that appear whole or not at all. Destinations are checked before a run, so that few runs end in
//! 'cannot be written'; afterwards everything is written under temporary names, and only when all of it is
//! there are the files renamed. Where that fails all the same (a full disk), everything is saved in another
//! folder. `-` is standard output.

use std::collections::HashMap;
use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use tempfile::NamedTempFile;

use crate::error::{Error, Result, named};
use crate::text;

/// A file that will be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Destination {
    option: &'static str,
    /// As the user named it.
    path: PathBuf,
}

/// A folder that will hold files; made when they are written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folder(Destination);

impl Destination {
    /// Fails now if `path` could not be written later. `option` is named in errors.
    pub(crate) fn open(option: &'static str, path: &Path) -> Result<Destination> {
        let destination = Destination { option, path: path.to_owned() };
        if destination.is_standard_output() {
            return Ok(destination);
        }
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
        check_name(&target).map_err(|error| destination.refuse(refusal(&error)))?;
        temporary_in(folder).map_err(|error| destination.refuse(refusal(&error)))?;
        Ok(destination)
    }

    /// The same of a file that is replaced as a whole, piece by piece or again and again: a pipe or a device cannot be.
    pub(crate) fn open_file(option: &'static str, path: &Path) -> Result<Destination> {
        let destination = Destination::open(option, path)?;
        let target = destination.target();
        let is_file = !destination.is_standard_output() && (!target.exists() || target.is_file());
        if is_file { Ok(destination) } else { Err(destination.refuse("it is no file that could be replaced as a whole; name a file")) }
    }

    /// Begins a file that is written piece by piece, and appears once it is whole.
    pub(crate) fn stage(&self) -> Result<Staged> {
        let file = temporary_in(parent(&self.target())).map_err(|error| self.refuse(refusal(&error)))?;
        *STAGED.lock().unwrap_or_else(PoisonError::into_inner) = Some(file.path().to_owned());
        Ok(Staged { destination: self.clone(), file })
    }

    /// Why it could not be written.
    pub(crate) fn failed(&self, error: &std::io::Error) -> Error {
        self.refuse(refusal(error))
    }

    pub(crate) fn is_standard_output(&self) -> bool {
        self.path == Path::new("-")
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    fn refuse(&self, reason: impl ToString) -> Error {
        Error::Output { option: self.option, path: self.path.clone(), reason: reason.to_string() }
    }

    /// The same of a file that is in another folder now.
    fn saved(&self, error: &std::io::Error, folder: PathBuf) -> Error {
        Error::Saved { option: self.option, path: self.path.clone(), reason: refusal(error), folder }
    }

    /// Where it stands in a folder that takes what could not be written.
    fn place_elsewhere(&self) -> PathBuf {
        let option = if self.option == "-o" { "output" } else { self.option.trim_start_matches('-') };
        Path::new(option).join(self.path.file_name().unwrap_or_default())
    }

    /// The file by the one name that all of its names lead to.
    fn file(&self) -> PathBuf {
        let target = self.target();
        let place = std::fs::canonicalize(parent(&target)).unwrap_or_else(|_| parent(&target).to_owned());
        place.join(target.file_name().unwrap_or_default())
    }

    /// The file itself, where the path is a link to it.
    fn target(&self) -> PathBuf {
        std::fs::canonicalize(&self.path).unwrap_or_else(|_| self.path.clone())
    }
}

impl Folder {
    /// Fails now if no file could be written into `path` later.
    pub fn open(option: &'static str, path: &Path) -> Result<Folder> {
        let itself = Destination { option, path: path.to_owned() };
        let is_file = |path: &Path| path.exists() && !path.is_dir();
        let faults = [
            (is_file(path), "it is not a folder"),
            (path == Path::new("-"), "it is standard output, and several files are written"),
            (path.as_os_str().is_empty(), "it names no folder"),
            (path.ancestors().any(is_file), "a part of its path is a file"),
        ];
        if let Some((_, fault)) = faults.iter().find(|(is_so, _)| *is_so) {
            return Err(itself.refuse(fault));
        }
        let nearest = path.ancestors().find(|ancestor| ancestor.is_dir()).unwrap_or(Path::new("."));
        // A name that is too long is refused only by the folder that is to hold it, which may not be there yet.
        for name in path.iter().filter(|_| !path.exists()) {
            check_name(&nearest.join(name)).map_err(|error| itself.failed(&error))?;
        }
        // Making a folder asks for the same right as making a file.
        temporary_in(nearest).map_err(|error| itself.failed(&error))?;
        Ok(Folder(itself))
    }

    pub fn path(&self) -> &Path {
        &self.0.path
    }

    /// The folder itself, which no file may be.
    pub(crate) fn itself(&self) -> Destination {
        self.0.clone()
    }

    /// A file in the folder.
    pub(crate) fn file(&self, name: &str) -> Destination {
        Destination { option: self.0.option, path: self.0.path.join(name) }
    }
}

/// Refuses two outputs in one file.
pub(crate) fn check_distinct(destinations: &[Destination]) -> Result<()> {
    let mut seen: HashMap<PathBuf, &Destination> = HashMap::new();
    for destination in destinations {
        if let Some(first) = seen.insert(destination.file(), destination) {
            return Err(if destination.is_standard_output() {
                let allowed = format!("{} - already is standard output; name a file for one of the two", named(first.option));
                Error::setting(destination.option, "-", allowed)
            } else {
                destination.refuse(format!("{} writes it too", named(first.option)))
            });
        }
    }
    Ok(())
}

/// Refuses an output in a file that is read.
pub(crate) fn check_not_read<'a>(destinations: &[Destination], inputs: impl IntoIterator<Item = &'a Path>) -> Result<()> {
    let inputs: Vec<PathBuf> = inputs.into_iter().filter_map(|input| std::fs::canonicalize(input).ok()).collect();
    match destinations.iter().find(|destination| !destination.is_standard_output() && inputs.contains(&destination.file())) {
        Some(destination) => Err(destination.refuse("it is also read")),
        None => Ok(()),
    }
}

/// Writes a file that must survive whatever happens next: under another name first, and on the disk before it takes the place of the
/// one before it.
pub(crate) fn write_synced(destination: &Destination, content: &[u8]) -> Result<()> {
    let mut staged = destination.stage()?;
    staged.file().write_all(content).map_err(|error| destination.failed(&error))?;
    // Written again and again: what cannot be written now may be later.
    staged.end(false)
}

/// A file under another name.
pub(crate) struct Staged {
    destination: Destination,
    file: NamedTempFile,
}

/// The latest of them, for a program that ends at once.
static STAGED: Mutex<Option<PathBuf>> = Mutex::new(None);

/// Removes what is half-written, before the program ends at once.
pub(crate) fn remove_staged() {
    if let Some(path) = STAGED.lock().unwrap_or_else(PoisonError::into_inner).take() {
        let _ = std::fs::remove_file(path);
    }
}

impl Staged {
    pub(crate) fn file(&mut self) -> &mut File {
        self.file.as_file_mut()
    }

    /// On the disk, and then by its own name; where its folder is gone, in another.
    pub(crate) fn finish(self) -> Result<()> {
        self.end(true)
    }

    fn end(self, saves: bool) -> Result<()> {
        let Staged { destination, file } = self;
        let target = destination.target();
        let finish = || {
            file.as_file().sync_all().map_err(|error| (error, None))?;
            file.persist(&target).map_err(|refused| (refused.error, Some(refused.file)))?;
            // The new name too.
            sync_folder(parent(&target)).map_err(|error| (error, None))
        };
        let finished = finish().map_err(|(error, file)| match file.filter(|_| saves).map(|file| elsewhere(&destination, file)) {
            Some(Ok(folder)) => destination.saved(&error, folder),
            _ => destination.refuse(refusal(&error)),
        });
        STAGED.lock().unwrap_or_else(PoisonError::into_inner).take();
        finished
    }
}

/// Why the system makes no file: where none is there, none can be made.
fn refusal(error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => "no file can be made there; name another folder".to_owned(),
        _ => text::refusal(error),
    }
}

/// Names on the disk; Windows opens no folders, and writes them with the file.
fn sync_folder(folder: &Path) -> std::io::Result<()> {
    if cfg!(windows) { Ok(()) } else { File::open(folder)?.sync_all() }
}

/// Copies a file that is whole, and whose folder is gone, into a new folder.
fn elsewhere(destination: &Destination, mut file: NamedTempFile) -> std::io::Result<PathBuf> {
    let folder = tempfile::Builder::new().prefix("photonmill-").tempdir()?;
    let path = folder.path().join(destination.place_elsewhere());
    std::fs::create_dir_all(parent(&path))?;
    file.seek(SeekFrom::Start(0))?;
    std::io::copy(file.as_file_mut(), &mut File::create(&path)?)?;
    Ok(folder.keep())
}

/// Writes every file, or none: all are there under temporary names before the first gets its own. If one cannot be
/// written, all go to a new folder elsewhere, which the error names.
pub(crate) fn write_all(files: impl IntoIterator<Item = (Destination, Vec<u8>)>) -> Result<()> {
    let cache = directories::BaseDirs::new().map(|folders| folders.cache_dir().to_owned());
    write_or_save(files, &[Some(std::env::temp_dir()), cache].into_iter().flatten().collect::<Vec<_>>())
}

/// The same with the folders that may hold results in an emergency, the best first. Contents are asked for one by one, as
/// all of them may be too large for memory.
fn write_or_save(files: impl IntoIterator<Item = (Destination, Vec<u8>)>, places: &[PathBuf]) -> Result<()> {
    let mut files = files.into_iter();
    let (mut staged, mut streams) = (Vec::new(), Vec::new());
    let mut failed = None;
    for (destination, content) in files.by_ref() {
        if destination.is_standard_output() {
            streams.push((destination, content));
            continue;
        }
        match stage(&destination, &content) {
            Ok(Some(file)) => staged.push((destination, file)),
            Ok(None) => {}
            Err(error) => {
                failed = Some((destination, content, error));
                break;
            }
        }
    }
    let mut staged = staged.into_iter();
    let mut written = Ok(());
    if failed.is_none() {
        for (destination, file) in staged.by_ref() {
            let target = destination.target();
            if let Err(refused) = file.persist(&target) {
                let content = std::fs::read(refused.file.path()).unwrap_or_default();
                failed = Some((destination, content, refused.error));
                break;
            }
        }
    }
    if let Some((destination, content, error)) = failed {
        let refused = destination.refuse(refusal(&error));
        let staged = staged.map(|(destination, file)| (destination, std::fs::read(file.path()).unwrap_or_default()));
        written = Err(save(staged.chain([(destination, content)]).chain(files), places, refused));
    }
    for (destination, content) in streams {
        match std::io::stdout().write_all(&content) {
            // A reader that has gone away, as `head` does, has seen enough.
            Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => return Err(destination.refuse(refusal(&error))),
            _ => {}
        }
    }
    written
}

/// Writes a file under a temporary name; a pipe or a device at once.
fn stage(destination: &Destination, content: &[u8]) -> std::io::Result<Option<NamedTempFile>> {
    let target = destination.target();
    if target.exists() && !target.is_file() {
        std::fs::OpenOptions::new().write(true).open(&target)?.write_all(content)?;
        return Ok(None);
    }
    std::fs::create_dir_all(parent(&target))?;
    let mut file = temporary_in(parent(&target))?;
    file.write_all(content)?;
    Ok(Some(file))
}

/// Saves what could not be written in the first place that takes all of it, a folder for each option; the error says where.
fn save(files: impl Iterator<Item = (Destination, Vec<u8>)>, places: &[PathBuf], error: Error) -> Error {
    let mut places = places.iter();
    let mut folder: Option<PathBuf> = None;
    for (destination, content) in files {
        let name = destination.place_elsewhere();
        let put = |folder: &Path| {
            let path = folder.join(&name);
            std::fs::create_dir_all(parent(&path)).and_then(|()| std::fs::write(&path, &content))
        };
        // Only the first file may still choose another place.
        let done = match &folder {
            Some(folder) => put(folder).is_ok(),
            None => {
                folder = places.find_map(|place| {
                    let made = tempfile::Builder::new().prefix("photonmill-").tempdir_in(place).ok()?;
                    put(made.path()).is_ok().then(|| made.keep())
                });
                folder.is_some()
            }
        };
        if !done {
            return error;
        }
    }
    match (error, folder) {
        (Error::Output { option, path, reason }, Some(folder)) => Error::Saved { option, path, reason, folder },
        (error, _) => error,
    }
}

/// Whether the file system takes this name; a file need not be there.
fn check_name(path: &Path) -> std::io::Result<()> {
    match std::fs::symlink_metadata(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
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
        let saved = tempfile::tempdir().unwrap();
        let both = || vec![(first.clone(), b"new".to_vec()), (lost.clone(), b"two".to_vec())];
        assert!(matches!(write_or_save(both(), &[]), Err(Error::Output { .. })));
        let places = [folder.path().join("absent"), saved.path().to_owned()];
        let Err(Error::Saved { folder: elsewhere, .. }) = write_or_save(both(), &places) else { panic!("nothing was saved") };
        assert!(elsewhere.starts_with(saved.path()));
        for (name, content) in [("a.txt", "new"), ("c.txt", "two")] {
            assert_eq!(std::fs::read_to_string(elsewhere.join("output").join(name)).unwrap(), content);
        }
        assert_eq!(std::fs::read(first.path()).unwrap(), b"one");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn what_cannot_be_written_is_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        // Longer than any file system allows.
        let long = "n".repeat(300);
        for path in [at("absent/a.txt"), folder.path().to_owned(), at("new/"), PathBuf::new(), at(&long)] {
            assert!(matches!(Destination::open("-o", &path), Err(Error::Output { option: "-o", .. })), "{path:?}");
        }
        std::fs::write(at("file"), "").unwrap();
        for path in [at("file"), at("file/below"), at(&long), at("new").join(&long), PathBuf::from("-")] {
            assert!(matches!(Folder::open("--out", &path), Err(Error::Output { option: "--out", .. })), "{path:?}");
        }
    }

    #[test]
    fn a_file_whose_folder_goes_away_is_saved_in_another() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("a");
        std::fs::create_dir(&folder).unwrap();
        let destination = Destination::open_file("-o", &folder.join("photons.pm")).unwrap();
        let mut staged = destination.stage().unwrap();
        staged.file().write_all(b"photons").unwrap();
        std::fs::rename(&folder, parent.path().join("b")).unwrap();
        let Err(Error::Saved { folder, .. }) = staged.finish() else { panic!("nothing was saved") };
        assert_eq!(std::fs::read(folder.join("output/photons.pm")).unwrap(), b"photons");
        std::fs::remove_dir_all(folder).unwrap();
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
