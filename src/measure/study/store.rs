//! Finished points on disk, so that an interrupted study can be continued.

use std::collections::HashMap;
use std::io::Write;

use serde::{Deserialize, Serialize};

use super::Request;
use super::axes::Axis;
use super::point::Point;
use super::reference;
use crate::error::{Error, Result};
use crate::gpu::DeviceFacts;
use crate::output::destination::Folder;
use crate::scene::Scene;

/// What points are of; those of another study are no use.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Head {
    photonmill: String,
    device: String,
    driver: String,
    /// Digest of all that the scene holds.
    scene: String,
    request: serde_json::Value,
}

pub struct Store {
    file: std::fs::File,
    /// Held for as long as this is.
    _lock: std::fs::File,
    path: std::path::PathBuf,
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
    pub fn open(folder: &Folder, scene: &Scene, request: &Request, device: &DeviceFacts) -> Result<Store> {
        let path = folder.path().join(NAME);
        let refuse = |reason: String| Error::Output { option: "-o", path: path.clone(), reason };
        std::fs::create_dir_all(folder.path()).map_err(|error| refuse(error.kind().to_string()))?;
        let lock = std::fs::File::create(folder.path().join(LOCK)).map_err(|error| refuse(error.kind().to_string()))?;
        if lock.try_lock().is_err() {
            return Err(Error::setting("-o", folder.path().display(), "is in use by another study; choose another folder"));
        }
        let head = Head {
            photonmill: env!("CARGO_PKG_VERSION").to_owned(),
            device: device.name.clone(),
            driver: device.driver.clone(),
            scene: reference::digest(scene),
            request: serde_json::to_value(request).expect("a request is plain data"),
        };
        let mut points = HashMap::new();
        let mut kept = String::new();
        match std::fs::read_to_string(&path) {
            Ok(text) => {
                let mut lines = text.lines();
                if lines.next().and_then(|line| serde_json::from_str(line).ok()).as_ref() != Some(&head) {
                    return Err(Error::setting(
                        "-o",
                        folder.path().display(),
                        format!("holds the {NAME} of a different study or device; choose another folder, or delete that file"),
                    ));
                }
                // A last line that was cut off is measured again.
                for (line, (axis, point)) in lines.filter_map(|line| Some((line, parse_complete(line, request.repeats)?))) {
                    kept.push_str(line);
                    kept.push('\n');
                    points.insert((axis, point.command.clone()), point);
                }
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(error) => return Err(refuse(format!("the existing file cannot be read: {}", error.kind()))),
        }
        let head = serde_json::to_string(&head).expect("a head is plain data");
        // The file as it was stands until the new one is whole.
        let file = tempfile::NamedTempFile::new_in(folder.path())
            .and_then(|mut file| file.write_all(format!("{head}\n{kept}").as_bytes()).map(|()| file))
            .and_then(|file| file.persist(&path).map_err(|error| error.error))
            .map_err(|error| refuse(error.kind().to_string()))?;
        Ok(Store { file, _lock: lock, path, points })
    }

    /// The point of a command, as it was measured along an axis.
    pub fn find(&self, axis: Axis, command: &str) -> Option<Point> {
        self.points.get(&(axis, command.to_owned())).cloned()
    }

    pub fn keep(&mut self, axis: Axis, point: &Point) -> Result<()> {
        let line = serde_json::to_string(&(axis, point)).expect("a point is plain data") + "\n";
        self.file.write_all(line.as_bytes()).and_then(|()| self.file.flush()).map_err(|error| Error::Output {
            option: "-o",
            path: self.path.clone(),
            reason: error.kind().to_string(),
        })
    }
}
