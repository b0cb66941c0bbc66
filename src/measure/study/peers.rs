//! Curves of other programs, from a file that `tools/bench_peers --json` wrote.

use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use crate::error::{Error, Result};

/// Error against time of one program.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Peer {
    pub name: String,
    /// Milliseconds of computing, and relative RMS error.
    pub points: Vec<(f64, f64)>,
}

/// The programs of a file that were run on a scene: on the paper's box, or on the scene of pictures that has the name of the scene's file.
pub(crate) fn read(path: &Path, scene: &str) -> Result<Vec<Peer>> {
    let refuse = |why: String| Error::setting("--peers", path.display(), why);
    let text = std::fs::read_to_string(path).map_err(|error| refuse(format!("cannot be read: {}", error.kind())))?;
    let found: Value = serde_json::from_str(&text).map_err(|error| refuse(format!("is not JSON: {error}")))?;
    let own = |name: &str| name.starts_with("photonmill");
    let peers: Vec<Peer> = match (&found["contestants"], &found["scenes"]) {
        (Value::Array(programs), _) if scene == "open-box" => {
            programs.iter().filter_map(|program| of(program, &program["points"])).collect()
        }
        (_, Value::Array(scenes)) => {
            let stem = Path::new(scene).file_stem().and_then(|stem| stem.to_str()).unwrap_or(scene);
            let own_scene = scenes.iter().find(|one| one["name"] == stem);
            let programs = own_scene.and_then(Value::as_object).into_iter().flatten();
            programs.filter_map(|(name, points)| of(&serde_json::json!({ "name": name }), points)).collect()
        }
        _ => Vec::new(),
    };
    let peers: Vec<Peer> = peers.into_iter().filter(|peer| !own(&peer.name) && !peer.points.is_empty()).collect();
    if peers.is_empty() {
        let which = "holds no other program's points on this scene; give a file of `tools/bench_peers --json` for open-box, or of its --pictures for a scene of that name";
        return Err(refuse(which.to_owned()));
    }
    Ok(peers)
}

fn of(program: &Value, points: &Value) -> Option<Peer> {
    let points =
        points.as_array()?.iter().filter_map(|point| Some((1e3 * middle(&point["computing_s"])?, middle(&point["error"])?))).collect();
    Some(Peer { name: program["name"].as_str()?.to_owned(), points })
}

/// The median of several, or the only one.
fn middle(value: &Value) -> Option<f64> {
    let Value::Array(all) = value else { return value.as_f64() };
    let mut all: Vec<f64> = all.iter().filter_map(Value::as_f64).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_kinds_of_files_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let write = |text: &str| {
            let path = folder.path().join("peers.json");
            std::fs::write(&path, text).unwrap();
            path
        };
        let of_box = write(
            r#"{"contestants":[{"name":"photonmill","points":[{"error":[0.1],"computing_s":[1]}]},
               {"name":"radiance-gather","points":[{"error":[0.3,0.1,0.2],"computing_s":[3,1,2]}]}]}"#,
        );
        assert_eq!(read(&of_box, "open-box").unwrap(), [Peer { name: "radiance-gather".to_owned(), points: vec![(2000.0, 0.2)] }]);
        assert!(read(&of_box, "cornell").unwrap_err().to_string().contains("no other program's points"));
        let pictures = write(
            r#"{"scenes":[{"name":"ball","reference":{},"photonmill":[{"error":0.1,"computing_s":1}],"mitsuba-path":[{"error":0.5,"computing_s":0.25}]}]}"#,
        );
        assert_eq!(read(&pictures, "scenes/ball.glb").unwrap()[0].points, [(250.0, 0.5)]);
        assert!(read(&write("{"), "open-box").unwrap_err().to_string().contains("is not JSON"));
        assert!(read(Path::new("no such file"), "open-box").is_err());
    }
}
