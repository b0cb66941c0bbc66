//! Finished points on disk, so that an interrupted study can be continued.

use std::collections::HashMap;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::StudyRequest;
use super::axes::Axis;
use super::point::Point;
use super::reference;
use crate::error::{Error, Result};
use crate::gpu::DeviceFacts;
use crate::output::destination::Folder;
use crate::scene::Scene;

pub(crate) struct Store {
    file: std::fs::File,
    /// Held for as long as this is.
    _lock: std::fs::File,
    path: PathBuf,
    points: HashMap<(Axis, String), Point>,
}

/// A point and its axis, if the line holds all runs of it.
fn parse_complete(line: &str, repeats: u32) -> Option<(Axis, Point)> {
    let (axis, point) = serde_json::from_str::<(Axis, Point)>(line).ok()?;
    let lengths = [point.gpu_ms.len(), point.wall_ms.len(), point.seconds.len(), point.squared_errors.len()];
    lengths.iter().all(|length| *length == repeats as usize).then_some((axis, point))
}

/// A head, then a point a line.
const NAME: &str = "points.jsonl";
/// Locked while a study runs, so that two do not write over each other.
const LOCK: &str = "study.lock";

impl Store {
    pub(crate) fn open(folder: &Folder, scene: &Scene, request: &StudyRequest, device: &DeviceFacts) -> Result<Store> {
        let path = folder.path().join(NAME);
        let refuse = |error: io::Error| refused(&path, error.kind().to_string());
        std::fs::create_dir_all(folder.path()).map_err(refuse)?;
        let lock = std::fs::File::create(folder.path().join(LOCK)).map_err(refuse)?;
        let unusable = |why: String| Error::setting("-o", folder.path().display(), format!("{why} choose another folder"));
        if lock.try_lock().is_err() {
            return Err(unusable("is in use by another study;".to_owned()));
        }
        // What points are of; those of another study are no use.
        let head = json!({
            "photonmill": env!("CARGO_PKG_VERSION"),
            "device": device.name,
            "driver": device.driver,
            "scene": reference::digest(format_args!("{scene:?}")),
            "request": request,
        });
        let mut points = HashMap::new();
        let mut kept = String::new();
        match std::fs::read_to_string(&path) {
            Ok(text) => {
                let mut lines = text.lines();
                if lines.next().and_then(|line| serde_json::from_str::<Value>(line).ok()).as_ref() != Some(&head) {
                    return Err(unusable(format!("holds the {NAME} of a different study or device; delete that file, or")));
                }
                // A last line that was cut off is measured again.
                for (line, (axis, point)) in lines.filter_map(|line| Some((line, parse_complete(line, request.repeats)?))) {
                    kept.push_str(line);
                    kept.push('\n');
                    points.insert((axis, point.command.clone()), point);
                }
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(refused(&path, format!("the existing file cannot be read: {}", error.kind()))),
        }
        let file = reference::replace_file(&path, format!("{head}\n{kept}").as_bytes()).map_err(refuse)?;
        Ok(Store { file, _lock: lock, path, points })
    }

    /// The point of a command, as it was measured along an axis.
    pub(crate) fn find(&self, axis: Axis, command: &str) -> Option<Point> {
        self.points.get(&(axis, command.to_owned())).cloned()
    }

    pub(crate) fn add(&mut self, axis: Axis, point: &Point) -> Result<()> {
        let line = serde_json::to_string(&(axis, point)).expect("a point is plain data") + "\n";
        let written = self.file.write_all(line.as_bytes()).and_then(|()| self.file.flush());
        written.map_err(|error| refused(&self.path, error.kind().to_string()))
    }
}

fn refused(path: &Path, reason: String) -> Error {
    Error::Output { option: "-o", path: path.to_owned(), reason }
}
