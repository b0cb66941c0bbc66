//! Bytes of a file of photons -> opened -> used as `map info`, `map export` and `--map` do: photons, or one line that says why not.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use super::change::Random;
use super::mutation::{self, MutateBytes};
use super::sealed::{Map, mutate};
use super::{file, refused, seeds};
use photonmill::engine::scene::map_file::MapFile;
use photonmill::error::{Error, Result};
use photonmill::output::photon_map;
use photonmill::plan::Limits;
use photonmill::plan::scene::ScenePlan;
use photonmill::plan::sensor::Sensor;
use photonmill::scene::Scene;
use photonmill::scene::geometry::Geometry;
use photonmill::settings::scene::SceneSettings;

static FILE: LazyLock<PathBuf> = LazyLock::new(|| file("a.pm"));
static SEEDS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| vec![seeds::photon_map(&file("seed.pm"))]);
/// What the seed's photons are of.
static SCENE: LazyLock<(Scene, Geometry)> = LazyLock::new(seeds::scene);

pub fn run(bytes: &[u8]) {
    std::fs::write(&*FILE, bytes).expect("the file can be written");
    if let Err(error) = use_map(&FILE) {
        refused(&error);
    }
}

pub fn use_map(path: &Path) -> Result<()> {
    let map = MapFile::open("--map", path)?;
    assert!(!photon_map::text(&map.header).is_empty() && !photon_map::json(&map.header).is_empty());
    // Photons may have been changed, and be of no use to this scene.
    for error in [export(&map, &path.with_extension("ply")), gather(&map)].into_iter().filter_map(Result::err) {
        refused(&error);
    }
    Ok(())
}

/// A cloud has as many points as it says.
fn export(map: &MapFile, path: &Path) -> Result<()> {
    let names: Vec<&str> = map.header.maps.iter().map(|map| map.name.as_str()).collect();
    let mut cloud = std::fs::File::create(path).expect("the cloud can be written");
    let unwritten = |error: std::io::Error| -> Error { panic!("the cloud cannot be written: {error}") };
    let count = photon_map::write_ply(map, map.rounds(), &names, &mut cloud, &unwritten)?;
    let cloud = std::fs::read(path).expect("the cloud can be read");
    let end = b"\nend_header\n";
    let header_length = cloud.windows(end.len()).position(|bytes| bytes == end).expect("the header ends") + end.len();
    let (header, points) = (String::from_utf8_lossy(&cloud[..header_length]), &cloud[header_length..]);
    let words = ["ply", "format ", "comment ", "element ", "property ", "end_header"];
    assert!(header.lines().all(|line| words.iter().any(|word| line.starts_with(word))), "{header}");
    assert_eq!(points.len() as u64, 62 * count, "{header}");
    Ok(())
}

/// Hands over all photons that a picture of the scene needs.
fn gather(map: &MapFile) -> Result<()> {
    let (scene, geometry) = &*SCENE;
    let settings = map.settings(&SceneSettings { rounds: map.rounds(), ..SceneSettings::default() });
    settings.validate()?;
    let plan = ScenePlan::new(scene, geometry, &settings, Sensor::Picture { width: 2, height: 2 }, &Limits::of_host())?;
    let plan = map.plan(plan, geometry)?;
    for round in 0..map.rounds() {
        for of_plan in plan.maps() {
            assert_eq!(map.fates(round, of_plan.name).emitted, u64::from(of_plan.photons));
            let mut stored = 0;
            map.photons(round, of_plan.name, 2, geometry.planes.len(), &mut |photons| {
                stored += photons.len() as u64;
                Ok(())
            })?;
            assert_eq!(stored, map.fates(round, of_plan.name).ledger().stored);
        }
    }
    Ok(())
}

pub fn change(data: &mut [u8], size: usize, max_size: usize, seed: u32, mutate_bytes: MutateBytes) -> usize {
    let new = mutate::<Map>(&data[..size], &SEEDS, &mut Random(u64::from(seed)), mutate_bytes);
    mutation::put(new, data, size, max_size, mutate_bytes)
}
