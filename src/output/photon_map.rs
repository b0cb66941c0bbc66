//! What a file of photons holds: in words, as JSON, and its photons as a point cloud.
//!
//! The point cloud is written here and not by a library, as those that there are hold all points in memory.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write};

use serde::Serialize;

use crate::engine::scene::map_file::{ARRIVALS, Header, MapFile, MapOfRound, PhotonSettings};
use crate::error::{Error, Result};
use crate::ledger::Ledger;
use crate::photon::MapPhoton;
use crate::text::counted;

/// A map over all rounds.
#[derive(Serialize)]
struct Map<'a> {
    #[serde(flatten)]
    of_round: &'a MapOfRound,
    /// Ways in which the light that it holds arrived.
    light: Vec<&'static str>,
    #[serde(rename = "photons_stored")]
    stored: u64,
    bytes: u64,
    ledger: Ledger,
}

#[derive(Serialize)]
struct Summary<'a> {
    format: u32,
    photonmill: &'a str,
    device: &'a str,
    scene: &'a str,
    scene_hash: &'a str,
    triangles: usize,
    settings: &'a PhotonSettings,
    unit_metres: f64,
    centre: [f64; 3],
    rounds: usize,
    maps: Vec<Map<'a>>,
    record: &'a [(String, String, u32, String)],
}

fn maps(header: &Header) -> Vec<Map<'_>> {
    let of_map = |(map, ledger): (&'_ MapOfRound, Ledger)| {
        let light = ARRIVALS.iter().filter(|(arrival, _)| map.stored & arrival != 0).map(|(_, name)| *name).collect();
        (light, ledger.stored, ledger.stored * size_of::<MapPhoton>() as u64, ledger)
    };
    let with = |map| move |(light, stored, bytes, ledger)| Map { of_round: map, light, stored, bytes, ledger };
    header.maps.iter().zip(header.ledgers()).map(|(map, ledger)| with(map)(of_map((map, ledger)))).collect()
}

pub(crate) fn json(header: &Header) -> Vec<u8> {
    let Header { format, program, device, scene, scene_hash, triangles, settings, unit_metres, centre, rounds, record, .. } = header;
    let summary = Summary {
        format: *format,
        photonmill: program,
        device,
        scene,
        scene_hash,
        triangles: *triangles,
        settings,
        unit_metres: *unit_metres,
        centre: *centre,
        rounds: rounds.len(),
        maps: maps(header),
        record,
    };
    let mut json = serde_json::to_vec_pretty(&summary).expect("a summary is plain data");
    json.push(b'\n');
    json
}

pub(crate) fn text(header: &Header) -> String {
    let Header { program, device, scene, triangles, settings, rounds, .. } = header;
    let maps = maps(header);
    let mebibytes = maps.iter().map(|map| map.bytes).sum::<u64>() as f64 / f64::from(1 << 20);
    let mut text = format!("photons of {scene}, {}; photonmill {program} on {device}\n", counted(*triangles, "triangle"));
    writeln!(text, "{} with seed {}; {mebibytes:.1} MiB", counted(rounds.len(), "independent round"), settings.seed).unwrap();
    for Map { of_round, light, stored, ledger, .. } in maps {
        let per_photon = stored as f64 / ledger.emitted.max(1) as f64;
        let MapOfRound { name, photons, watts, .. } = of_round;
        writeln!(text, "{name} map: {} light; {} a round, of at most {watts:.4e} W", light.join(" and "), counted(*photons, "photon"))
            .unwrap();
        writeln!(text, "    {stored} stored, {per_photon:.3} per photon; {ledger}").unwrap();
    }
    text
}

/// Properties of a photon: type and name.
const PROPERTIES: [(&str, &str); 17] = [
    ("double", "x"),
    ("double", "y"),
    ("double", "z"),
    ("uchar", "red"),
    ("uchar", "green"),
    ("uchar", "blue"),
    ("float", "flux_red"),
    ("float", "flux_green"),
    ("float", "flux_blue"),
    ("float", "from_x"),
    ("float", "from_y"),
    ("float", "from_z"),
    ("uint", "plane"),
    ("uchar", "back"),
    ("uchar", "arrival"),
    ("uchar", "map"),
    ("uint", "round"),
];

/// Writes photons of the first rounds of some maps, and says how many.
pub(crate) fn write_ply(
    map: &MapFile,
    rounds: u32,
    names: &[&str],
    file: &mut File,
    unwritten: &dyn Fn(std::io::Error) -> Error,
) -> Result<u64> {
    let header = &map.header;
    let numbers: Vec<usize> = (0..header.maps.len()).filter(|number| names.contains(&header.maps[*number].name.as_str())).collect();
    let all = || (0..rounds).flat_map(|round| numbers.iter().map(move |number| (round, *number)));
    let count: u64 = all().map(|(round, number)| header.rounds[round as usize][number].count).sum();
    let mut file = BufWriter::with_capacity(1 << 20, file);
    file.write_all(ply_header(header, rounds, count).as_bytes()).map_err(unwritten)?;
    for (round, number) in all() {
        let of_round = &header.maps[number];
        map.photons(round, &of_round.name, 1 << 16, usize::MAX, &mut |photons| {
            let mut bytes = Vec::with_capacity(photons.len() * 64);
            photons.iter().for_each(|photon| put(&mut bytes, header, photon, round, number));
            file.write_all(&bytes).map_err(unwritten)
        })?;
    }
    file.flush().map_err(unwritten)?;
    Ok(count)
}

fn ply_header(header: &Header, rounds: u32, count: u64) -> String {
    let maps: Vec<String> = header.maps.iter().enumerate().map(|(number, map)| format!("{number} {}", map.name)).collect();
    let mut text = String::from("ply\nformat binary_little_endian 1.0\n");
    writeln!(text, "comment photons of {} by photonmill {}", header.scene, header.program).unwrap();
    writeln!(text, "comment x y z in metres; flux in W of a photon in its round, of {rounds} independent rounds: divide by {rounds}")
        .unwrap();
    writeln!(text, "comment red green blue: the flux over its largest channel; from: unit vector towards where it came from").unwrap();
    writeln!(text, "comment plane of the scene, and whether on its back; arrival 1 direct, 2 caustic, 4 indirect; map {}", maps.join(", "))
        .unwrap();
    writeln!(text, "element vertex {count}").unwrap();
    PROPERTIES.iter().for_each(|(kind, name)| writeln!(text, "property {kind} {name}").unwrap());
    text.push_str("end_header\n");
    text
}

fn put(bytes: &mut Vec<u8>, header: &Header, photon: &MapPhoton, round: u32, map: usize) {
    let largest = photon.flux.max_element().max(f32::MIN_POSITIVE);
    let flux = (photon.flux.as_dvec3() * header.maps[map].watts).as_vec3();
    header.position(photon).to_array().iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    bytes.extend((photon.flux / largest * 255.0).to_array().map(|value| value.round() as u8));
    [flux, photon.came_from()].iter().flat_map(glam::Vec3::to_array).for_each(|value| bytes.extend(value.to_le_bytes()));
    bytes.extend((photon.plane / 2).to_le_bytes());
    bytes.extend([(photon.plane % 2) as u8, photon.arrival() as u8, map as u8]);
    bytes.extend(round.to_le_bytes());
}
