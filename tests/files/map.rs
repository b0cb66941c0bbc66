//! Photon maps as files: pictures from them have the bits of a run that traces the photons itself, and files that are damaged, foreign or
//! cut off are refused.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::common::prelude::*;
use crate::common::rendered::Viewed;
use photonmill::engine::run::watch::Checkpointing;
use photonmill::engine::scene::fill_map::{Filled, fill};
use photonmill::engine::scene::map_file::{MapFile, MapWriter};
use photonmill::engine::scene::{self, RunResult};
use photonmill::settings::scene::Kernel;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};
use tempfile::NamedTempFile;

fn small() -> SceneSettings {
    SceneSettings { photons: 3000, caustic_photons: 2000, rounds: 6, shadow_rays: 2, block: Some(2), ..SceneSettings::default() }
}

impl Viewed {
    /// A file of the photons of these settings; cancelled once so many rounds are done.
    fn write(&self, gpu: &Gpu, settings: &SceneSettings, most_rounds: u64) -> (NamedTempFile, Filled) {
        let plan = self.tried(gpu, settings, square_picture(8));
        let mut file = NamedTempFile::new().unwrap();
        let mut writer = MapWriter::new(file.as_file_mut(), &self.scene.name, &self.geometry, &plan, "a device").unwrap();
        let cancelled = AtomicBool::new(false);
        let mut progress = |progress: &engine::Progress| cancelled.store(progress.done >= most_rounds, Ordering::Relaxed);
        let mut control = Control { cancelled: &cancelled, progress: &mut progress, checkpointing: Checkpointing::default() };
        let filled = fill(gpu, &self.geometry, &plan, &mut writer, &|error| panic!("{error}"), &mut control).unwrap();
        writer.finish().unwrap();
        (file, filled)
    }

    /// A picture from a file.
    fn result_from_map(&self, gpu: &Gpu, settings: &SceneSettings, path: &Path) -> Result<RunResult, Error> {
        let map = MapFile::open("--map", path)?;
        let settings = map.settings(settings);
        // A plan whose own photons would carry otherwise, as another camera's do: what counts is what those of the file carry.
        let mut plan = self.tried(gpu, &settings, square_picture(8));
        for of_run in plan.global.iter_mut().chain(&mut plan.caustic) {
            (of_run.flux_scale, of_run.flux_gain) = (7.0 * of_run.flux_scale, 2.0 * of_run.flux_gain);
        }
        let plan = map.plan(plan, &self.geometry)?;
        scene::light_from(gpu, &self.viewpoint(), plan, Some(&map), &mut Control::default())
    }

    fn traced(&self, gpu: &Gpu, settings: &SceneSettings) -> RunResult {
        self.run(gpu, self.tried(gpu, settings, square_picture(8)))
    }
}

/// All photons of a map in one round.
fn photons_of(map: &MapFile, round: u32, name: &str, planes: usize) -> Vec<MapPhoton> {
    let mut found = Vec::new();
    map.photons(round, name, 10, planes, &mut |photons| {
        found.extend_from_slice(photons);
        Ok(())
    })
    .unwrap();
    found
}

fn line_of(error: &Error) -> String {
    let line = error.to_string();
    assert_eq!((error.exit_code(), line.lines().count()), (2, 1), "{line}");
    line
}

#[test]
fn pictures_from_a_file_have_the_bits_of_a_run() {
    let settings = SceneSettings { chunk: Some(500), samples: 2, ..small() };
    compare_pictures(vec![(scene("cornell-spheres"), settings, SceneSettings { chunk: Some(700), ..small() })]);
}

#[test]
#[ignore = "long: kernels of a map alone, of a cone and of many lamps"]
fn pictures_from_all_files_have_the_bits_of_a_run() {
    let cone = SceneSettings { kernel: Kernel::Cone, chunk: Some(500), samples: 2, ..small() };
    let many_lamps = Scene { lights: every_kind_of_light(1.0, 1.0, EmissionLaw::Cosine), ..scene("cornell") };
    compare_pictures(vec![
        (scene("cornell-spheres"), cone, SceneSettings { builder: Some(Builder::Naive), chunk: Some(700), ..small() }),
        // Every part from one map, with photons that are cut off.
        (scene("cornell-spheres"), SceneSettings { illumination: Illumination::Photons, bounces: 5, ..small() }, small()),
        // Many lamps, among which photons choose by what a trial found.
        (many_lamps, SceneSettings { chunk: Some(500), ..small() }, small()),
    ]);
}

/// Scenes, settings of a picture, and those of its file.
fn compare_pictures(layouts: Vec<(Scene, SceneSettings, SceneSettings)>) {
    let Some(gpu) = device() else { return };
    for (scene, settings, of_file) in layouts {
        let name = scene.name.clone();
        let room = Viewed::new(scene);
        let SceneSettings { illumination, bounces, .. } = settings;
        let (file, filled) = room.write(&gpu, &SceneSettings { illumination, bounces, ..of_file }, u64::MAX);
        assert_eq!((filled.rounds, filled.is_cancelled), (6, false));
        let whole = room.traced(&gpu, &settings);
        let found = room.result_from_map(&gpu, &settings, file.path()).unwrap();
        assert!(whole.ledger().stored > 0 && found.fates == whole.fates, "{name}: {}, not {}", found.ledger(), whole.ledger());
        assert!(found.film == whole.film, "{name}: another film");
        assert_eq!(found.losses, whole.losses);
        // Other paths from the camera, and the same photons.
        let other = room.result_from_map(&gpu, &SceneSettings { seed: 77, ..settings.clone() }, file.path()).unwrap();
        assert!(other.fates == whole.fates && other.film != whole.film);
    }
}

#[test]
fn a_file_that_ends_early_holds_whole_rounds() {
    let Some(gpu) = device() else { return };
    let room = Viewed::new(scene("cornell"));
    let (file, filled) = room.write(&gpu, &small(), 4);
    assert!(filled.is_cancelled && filled.rounds == 4);
    let found = room.result_from_map(&gpu, &SceneSettings { rounds: 4, ..small() }, file.path()).unwrap();
    assert!(found.film == room.traced(&gpu, &SceneSettings { rounds: 4, ..small() }).film);
}

/// Whichever byte is changed and wherever it ends: a file is refused, when it is opened or when the photons are used.
#[test]
fn damaged_files_are_refused() {
    let Some(gpu) = device() else { return };
    let room = Viewed::new(scene("cornell"));
    let settings = SceneSettings { photons: 300, caustic_photons: 300, ..small() };
    let (file, _) = room.write(&gpu, &settings, u64::MAX);
    let whole = std::fs::read(file.path()).unwrap();
    let damaged = NamedTempFile::new().unwrap();
    let outcome = |bytes: &[u8]| -> Result<(), Error> {
        std::fs::write(damaged.path(), bytes).unwrap();
        let map = MapFile::open("--map", damaged.path())?;
        (0..map.rounds()).try_for_each(|round| {
            let planes = room.geometry.planes.len();
            map.header.maps.iter().try_for_each(|of_map| map.photons(round, &of_map.name, 100, planes, &mut |_| Ok(())))
        })
    };
    outcome(&whole).unwrap();
    let step = whole.len() / 997 + 1;
    for place in (0..whole.len()).step_by(step).chain(whole.len() - 60..whole.len()).chain(0..20) {
        let mut bytes = whole.clone();
        bytes[place] ^= 1 << (place % 8);
        let line = line_of(&outcome(&bytes).expect_err("a changed byte is taken"));
        assert!(line.starts_with("--map "), "{line}");
        line_of(&outcome(&whole[..place]).expect_err("a file that is cut off is taken"));
    }
    // And before any picture is made of it.
    let mut bytes = whole.clone();
    bytes[100] ^= 1;
    std::fs::write(damaged.path(), bytes).unwrap();
    let line = line_of(&room.result_from_map(&gpu, &settings, damaged.path()).unwrap_err());
    assert!(line.contains("is damaged: photons of round 0 in the global map"), "{line}");
}

/// A header that says something else, with a hash that is right.
#[test]
fn headers_that_contradict_themselves_are_refused() {
    let Some(gpu) = device() else { return };
    use sha2::{Digest, Sha256};
    let room = Viewed::new(scene("cornell"));
    let (file, _) = room.write(&gpu, &SceneSettings { photons: 300, rounds: 2, ..small() }, u64::MAX);
    let whole = std::fs::read(file.path()).unwrap();
    let tail = whole.len() - 56;
    let start = tail - u64::from_le_bytes(whole[tail..tail + 8].try_into().unwrap()) as usize;
    let header: serde_json::Value = serde_json::from_slice(&whole[start..tail]).unwrap();
    let with = |pointer: &str, value: serde_json::Value| {
        let mut header = header.clone();
        *header.pointer_mut(pointer).unwrap_or_else(|| panic!("no {pointer}")) = value;
        let header = serde_json::to_vec(&header).unwrap();
        let tail = [(header.len() as u64).to_le_bytes().as_slice(), &Sha256::digest(&header), b"photonmill map\r\n"].concat();
        std::fs::write(file.path(), [&whole[..start], &header, &tail].concat()).unwrap();
        MapFile::open("--map", file.path())
    };
    assert!(with("/scene", "another name".into()).is_ok());
    assert_eq!(with("/program", "two\nlines".into()).unwrap().header.program, "two lines");
    let cases = [
        ("/format", 2.into(), "is of format 2"),
        ("/rounds/0/0/count", 1.into(), "contradicts itself"),
        ("/rounds/1/0/count", u64::MAX.into(), "contradicts itself"),
        ("/rounds/0/0/byte", 17.into(), "contradicts itself"),
        ("/rounds/0/0/byte", u64::MAX.into(), "contradicts itself"),
        ("/rounds/0/0/fates/emitted", 7.into(), "contradicts itself"),
        ("/rounds/0/0/fates/bounces", serde_json::json!([]), "contradicts itself"),
        ("/rounds/0/0/crc32", serde_json::json!([]), "contradicts itself"),
        ("/rounds/0", serde_json::json!([]), "contradicts itself"),
        ("/rounds", serde_json::json!([]), "contradicts itself"),
        ("/maps", serde_json::json!([]), "contradicts itself"),
        ("/maps/0/name", "other".into(), "contradicts itself"),
        ("/maps/0/watts", 0.into(), "contradicts itself"),
        ("/maps/0/flux_gain", (-1).into(), "contradicts itself"),
        ("/unit_metres", "wide".into(), "has a header that is not understood"),
    ];
    for (pointer, value, expected) in cases {
        let line = line_of(&with(pointer, value).expect_err(pointer));
        assert!(line.contains(expected), "{pointer}: {line}");
    }
}

#[test]
fn files_of_other_light_are_refused() {
    let Some(gpu) = device() else { return };
    let room = Viewed::new(scene("cornell-spheres"));
    let few = SceneSettings { photons: 300, caustic_photons: 300, rounds: 2, ..small() };
    let (file, _) = room.write(&gpu, &few, u64::MAX);
    let other = Viewed::new(scene("cornell"));
    let line = line_of(&other.result_from_map(&gpu, &few, file.path()).unwrap_err());
    assert!(line.contains("of another scene (cornell-spheres"), "{line}");
    // Less is wanted than there is.
    let less = SceneSettings { without: vec![Effect::ReflectiveCaustics, Effect::RefractiveCaustics], ..few.clone() };
    if is_long_run() {
        let found = room.result_from_map(&gpu, &less, file.path()).unwrap();
        assert!(found.film == room.traced(&gpu, &less).film && found.plan.caustic.is_none());
    }
    // More is wanted.
    let (file, _) = room.write(&gpu, &less, u64::MAX);
    let line = line_of(&room.result_from_map(&gpu, &few, file.path()).unwrap_err());
    assert!(line.contains("holds no caustic map of the light that this run wants"), "{line}");
}

/// Photons that leave a lamp at a point and scatter nowhere before they land lie in the direction that they say they came from.
#[test]
fn photons_know_where_they_came_from() {
    let Some(gpu) = device() else { return };
    let place = DVec3::new(0.31, 0.62, 0.44);
    let mut closed = scene("furnace");
    (closed.materials[0], closed.lights) = (matt(0.0), vec![lamp(point(place))]);
    let room = Viewed::new(closed);
    let settings = SceneSettings { illumination: Illumination::Photons, ..small() };
    let (file, _) = room.write(&gpu, &settings, u64::MAX);
    let map = MapFile::open("--map", file.path()).unwrap();
    let photons: Vec<MapPhoton> =
        (0..map.rounds()).flat_map(|round| photons_of(&map, round, "global", room.geometry.planes.len())).collect();
    for photon in &photons {
        let expected = (place - map.header.position(photon)).normalize();
        assert!(photon.came_from().as_dvec3().distance(expected) < 2e-4, "{photon:?}: {expected}");
        assert_eq!(photon.arrival(), photonmill::constants::ARRIVED_DIRECT);
    }
    // All of them land, with 1 W/sr into all directions.
    assert_eq!(photons.len(), 6 * 3000);
    let flux: f64 = photons.iter().map(|photon| f64::from(photon.flux.x)).sum();
    let watts = flux * map.header.maps[0].watts / f64::from(map.rounds());
    assert!((watts / (4.0 * PI) - 1.0).abs() < 1e-5, "{watts} W");
}

/// The program: a file made, read, exported for another reader, and used by all commands.
#[test]
fn the_program_makes_reads_and_exports_files() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let (made, _) = place.succeed("map cornell-spheres -o map.pm --photons 3000 --caustic-photons 2000 --rounds 5 -q");
    assert!(made.contains("5 independent rounds with seed 1") && made.contains("wrote map.pm"), "{made}");
    assert!(place.succeed("map info map.pm").0.trim_end() == made.trim_end().trim_end_matches("wrote map.pm").trim_end());
    let info: serde_json::Value = serde_json::from_str(&place.succeed("map info map.pm --json").0).unwrap();
    assert_eq!((&info["rounds"], &info["maps"][1]["name"]), (&5.into(), &"caustic".into()));

    let common = "--rounds 4 --block 1 --size 8x8 -q";
    place.succeed(&format!("render cornell-spheres --map map.pm -o a.exr {common}"));
    place.succeed(&format!("render cornell-spheres --photons 3000 --caustic-photons 2000 -o b.exr {common}"));
    assert!(place.pixels("a.exr") == place.pixels("b.exr"));

    place.succeed("map export map.pm -o some.ply --rounds 2 --only caustic");
    let mut reader = std::io::BufReader::new(std::fs::File::open(place.at("some.ply")).unwrap());
    let ply = Parser::<DefaultElement>::new().read_ply(&mut reader).unwrap();
    let vertices = &ply.payload["vertex"];
    let map = MapFile::open("FILE", &place.at("map.pm")).unwrap();
    let expected: Vec<MapPhoton> = (0..2).flat_map(|round| photons_of(&map, round, "caustic", usize::MAX)).collect();
    assert!(vertices.len() == expected.len() && vertices.len() > 500);
    for (vertex, photon) in pairs(vertices, &expected) {
        let Property::Double(x) = vertex["x"] else { panic!("{vertex:?}") };
        let Property::Float(flux) = vertex["flux_green"] else { panic!("{vertex:?}") };
        assert_eq!(x, map.header.position(photon).x);
        assert_eq!(flux, (f64::from(photon.flux.y) * map.header.maps[1].watts) as f32);
        assert!(vertex["arrival"] == Property::UChar(2) && vertex["map"] == Property::UChar(1));
    }
    place.assert_refused([
        ("map cornell", ["required", "-o", "photonmill map"]),
        ("map cornell -o -", ["-o", "-", "name a file"]),
        ("map cornell -o map.pm --rounds 0", ["--rounds", "0", "from 1"]),
        ("map cornell -o none/map.pm", ["-o", "none/map.pm", "no folder"]),
        (
            "map caustic-sphere -q -o new.pm --without indirect,reflective-caustics,refractive-caustics",
            ["SCENE", "caustic-sphere", "no photons"],
        ),
        ("map info none.pm", ["FILE", "none.pm", "cannot be read"]),
        ("map info b.exr", ["FILE", "b.exr", "no photon map"]),
        ("map export map.pm -o some.obj", ["-o", "some.obj", ".ply"]),
        ("map export map.pm -o some.ply --rounds 6", ["--rounds", "6", "from 1 to 5"]),
        ("render cornell-spheres --map map.pm -o a.exr --rounds 6", ["--rounds", "6", "at most 5"]),
        ("render cornell-spheres --map map.pm -o a.exr --photons 9", ["--map", "--photons", "cannot be used with"]),
        ("render cornell -q --map map.pm -o a.exr", ["--map", "map.pm", "another scene"]),
        ("render cornell-spheres --map b.exr -o a.exr", ["--map", "b.exr", "no photon map"]),
    ]);
}

#[test]
fn the_program_lights_points_and_texels_from_a_file() {
    let scene = of_run("cornell", "cornell-spheres");
    let Some(_) = device() else { return };
    let place = Place::new();
    place.succeed(&format!("map {scene} -o map.pm --photons 500 --rounds 5 -q"));
    place.write("points.txt", "0.5 0 0.5 0 1 0\n");
    place.succeed(&format!("probe {scene} --points points.txt --map map.pm -o e.csv -q"));
    place.succeed(&format!("bake {scene} -o baked --texels-per-metre 2 --map map.pm --rounds 2 -q"));
}
