//! Photon maps as files: the photons of independent rounds, so that pictures from them keep their errors.
//!
//! The photons stand first, round after round, as [`MapPhoton`]s; behind them a header in JSON that describes them, its length and its
//! SHA-256. Photons have checksums of their own (CRC-32), which are checked where they are used: a file may be larger than memory, and
//! is mapped into it.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::identity::scene_hash;
use crate::constants::{ARRIVED_CAUSTIC, ARRIVED_DIRECT, ARRIVED_INDIRECT, TALLY_ROWS};
use crate::engine::run::saved::read_header;
use crate::error::{Error, Result};
use crate::gpu::MappedFile;
use crate::ledger::{Fates, Ledger};
use crate::photon::MapPhoton;
use crate::plan::scene::{MapPlan, ScenePlan};
use crate::scene::geometry::Geometry;
use crate::settings::scene::{Illumination, SceneSettings};
use crate::text::{one_line, refusal};

/// The first bytes of a file, and the last.
const MAGIC: &[u8; 16] = b"photonmill map\r\n";
/// Of what stands between. A change that older programs cannot read makes it another one.
const FORMAT: u32 = 1;
/// Behind the header: its length, its hash, and the magic bytes again, without which a file is cut off.
const TAIL_BYTES: usize = 8 + 32 + MAGIC.len();
const PHOTON_BYTES: u64 = size_of::<MapPhoton>() as u64;
/// Of the photons of a round, by any count.
const MOST_COUNTED: u64 = 1 << 44;
/// Photons that have a checksum together.
const PIECE: usize = 1 << 20;

/// What a file holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Header {
    pub format: u32,
    /// The version of photonmill that wrote it.
    pub program: String,
    pub device: String,
    pub scene: String,
    /// Hash of the scene as the kernels read it, cameras left out.
    pub scene_hash: String,
    pub triangles: usize,
    pub settings: PhotonSettings,
    /// Positions are in units of so many metres around a centre in world coordinates.
    pub unit_metres: f64,
    pub centre: [f64; 3],
    pub maps: Vec<MapOfRound>,
    /// Of each round, what it has of each map.
    pub rounds: Vec<Vec<Photons>>,
    /// Of the photons, little-endian: name, type, first byte, meaning.
    pub record: Vec<(String, String, u32, String)>,
}

/// Settings that decide which photons there are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct PhotonSettings {
    pub seed: u64,
    pub photons: u32,
    pub caustic_photons: u32,
    pub bounces: u32,
    pub illumination: Illumination,
    pub aim: bool,
}

/// A map that each round has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct MapOfRound {
    pub name: String,
    /// Photons that a round emits.
    pub photons: u32,
    /// W of a photon of flux 1 in its round.
    pub watts: f64,
    pub flux_scale: f64,
    pub flux_gain: f64,
    /// Mask of the arrivals that are stored, and of the surfaces that make its caustics.
    pub stored: u32,
    pub caustic_surfaces: u32,
}

/// The photons that a round has left in a map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Photons {
    /// Of the first.
    pub byte: u64,
    pub count: u64,
    /// Of pieces of 2^20 of them each.
    pub crc32: Vec<u32>,
    pub fates: Fates,
}

impl MapOfRound {
    fn new(map: &MapPlan, plan: &ScenePlan, geometry: &Geometry) -> MapOfRound {
        MapOfRound {
            name: map.name.to_owned(),
            photons: map.photons,
            watts: map.photon_flux(geometry) * geometry.unit * geometry.unit,
            flux_scale: map.flux_scale,
            flux_gain: map.flux_gain,
            stored: map.stored,
            caustic_surfaces: if map.caustic_only { plan.caustic_surfaces } else { 0 },
        }
    }
}

impl Header {
    fn new(scene: &str, geometry: &Geometry, plan: &ScenePlan, device: &str) -> Header {
        let SceneSettings { seed, photons, caustic_photons, bounces, illumination, aim, .. } = plan.settings;
        let field = |name: &str, kind: &str, byte: usize, meaning: &str| (name.into(), kind.into(), byte as u32, meaning.into());
        Header {
            format: FORMAT,
            program: env!("CARGO_PKG_VERSION").to_owned(),
            device: device.to_owned(),
            scene: scene.to_owned(),
            scene_hash: scene_hash(geometry),
            triangles: geometry.triangles.len(),
            settings: PhotonSettings { seed, photons, caustic_photons, bounces, illumination, aim },
            unit_metres: geometry.unit,
            centre: geometry.centre.to_array(),
            maps: plan.maps().map(|map| MapOfRound::new(map, plan, geometry)).collect(),
            rounds: Vec::new(),
            record: vec![
                field("position", "f32 x 3", std::mem::offset_of!(MapPhoton, position), "centre + unit_metres * position, metres"),
                field(
                    "plane",
                    "u32",
                    std::mem::offset_of!(MapPhoton, plane),
                    "twice the number of the plane it arrived at, + 1 on its back",
                ),
                field("flux", "f32 x 3", std::mem::offset_of!(MapPhoton, flux), "red, green, blue; times watts of the map: W in its round"),
                field(
                    "wi",
                    "u32",
                    std::mem::offset_of!(MapPhoton, wi),
                    "where it came from: octahedral x and y, 15 bits each; then its arrival, 2 bits",
                ),
            ],
        }
    }

    /// Of the photons of all rounds, map by map.
    pub(crate) fn ledgers(&self) -> Vec<Ledger> {
        let of_map = |map: usize| self.rounds.iter().map(|maps| maps[map].fates.ledger()).fold(Ledger::default(), |sum, of| sum.plus(&of));
        (0..self.maps.len()).map(of_map).collect()
    }

    /// A photon's place, metres.
    pub(crate) fn position(&self, photon: &MapPhoton) -> DVec3 {
        DVec3::from(self.centre) + self.unit_metres * photon.position.as_dvec3()
    }

    /// What is wrong with it, if anything is, where the photons end at this byte.
    fn fault(&self, end: u64) -> Option<&'static str> {
        let rows = self.settings.bounces.min(TALLY_ROWS) as usize;
        let is_sound = |(map, photons): (&MapOfRound, &Photons)| {
            let Photons { byte, count, crc32, fates } = photons;
            let (ledger, starts) = (
                (fates.bounces.len() == rows && fates.is_sound(MOST_COUNTED)).then(|| fates.ledger()),
                *byte >= MAGIC.len() as u64 && byte.is_multiple_of(16),
            );
            let ends = count.checked_mul(PHOTON_BYTES).and_then(|bytes| bytes.checked_add(*byte)).is_some_and(|last| last <= end);
            let counts =
                ledger.is_some_and(|ledger| ledger.closes() && ledger.emitted == u64::from(map.photons) && ledger.stored == *count);
            starts && ends && counts && crc32.len() as u64 == count.div_ceil(PIECE as u64)
        };
        let numbers = |map: &MapOfRound| [map.watts, map.flux_scale, map.flux_gain].iter().all(|value| value.is_finite() && *value > 0.0);
        // A map is looked up by its name.
        let names: Vec<&str> = self.maps.iter().map(|map| map.name.as_str()).collect();
        let are_known = matches!(names[..], ["global" | "caustic"] | ["global", "caustic"]);
        if !are_known || !self.maps.iter().all(numbers) {
            return Some("its maps");
        }
        if self.rounds.is_empty() || self.rounds.iter().any(|maps| maps.len() != self.maps.len()) {
            return Some("its rounds");
        }
        self.rounds.iter().any(|maps| !self.maps.iter().zip(maps).all(is_sound)).then_some("where photons are, or their fates")
    }
}

/// Where light of each arrival came from, by the two bits of a photon.
pub(crate) const ARRIVALS: [(u32, &str); 3] = [(ARRIVED_DIRECT, "direct"), (ARRIVED_CAUSTIC, "caustic"), (ARRIVED_INDIRECT, "indirect")];

/// Writes a file, one round after the other.
pub(crate) struct MapWriter<'a> {
    file: &'a mut File,
    header: Header,
    /// Where the next photon goes.
    byte: u64,
    /// Of the round under way.
    maps: Vec<Photons>,
    /// Photons of the map under way that have no checksum yet: their bytes' state, and how many.
    open: (crc32fast::Hasher, usize),
}

impl<'a> MapWriter<'a> {
    pub(crate) fn new(
        file: &'a mut File,
        scene: &str,
        geometry: &Geometry,
        plan: &ScenePlan,
        device: &str,
    ) -> std::io::Result<MapWriter<'a>> {
        file.write_all(MAGIC)?;
        let header = Header::new(scene, geometry, plan, device);
        Ok(MapWriter { file, header, byte: MAGIC.len() as u64, maps: Vec::new(), open: Default::default() })
    }

    pub(crate) fn begin_map(&mut self) {
        self.open = Default::default();
        self.maps.push(Photons { byte: self.byte, count: 0, crc32: Vec::new(), fates: Fates::default() });
    }

    /// Photons of the map under way.
    pub(crate) fn add(&mut self, mut photons: &[MapPhoton]) -> std::io::Result<()> {
        let map = self.maps.last_mut().expect("a map is under way");
        while !photons.is_empty() {
            let (now, later) = photons.split_at(photons.len().min(PIECE - self.open.1));
            let bytes: &[u8] = bytemuck::cast_slice(now);
            self.file.write_all(bytes)?;
            self.open.0.update(bytes);
            self.open.1 += now.len();
            map.count += now.len() as u64;
            self.byte += bytes.len() as u64;
            if self.open.1 == PIECE {
                let (full, _) = std::mem::take(&mut self.open);
                map.crc32.push(full.finalize());
            }
            photons = later;
        }
        Ok(())
    }

    /// The map under way is whole.
    pub(crate) fn end_map(&mut self, fates: Fates) {
        let map = self.maps.last_mut().expect("a map is under way");
        map.fates = fates;
        if self.open.1 > 0 {
            map.crc32.push(std::mem::take(&mut self.open).0.finalize());
        }
    }

    /// The round under way is whole.
    pub(crate) fn end_round(&mut self) {
        self.header.rounds.push(std::mem::take(&mut self.maps));
    }

    /// Whole rounds.
    pub(crate) fn rounds(&self) -> u32 {
        self.header.rounds.len() as u32
    }

    /// Forgets what there is of the round under way.
    pub(crate) fn drop_open_round(&mut self) -> std::io::Result<()> {
        self.byte = self.maps.first().map_or(self.byte, |map| map.byte);
        self.maps.clear();
        self.file.set_len(self.byte)?;
        self.file.seek(SeekFrom::Start(self.byte)).map(|_| ())
    }

    /// Ends the file behind its last whole round.
    pub(crate) fn finish(mut self) -> std::io::Result<Header> {
        self.drop_open_round()?;
        let header = serde_json::to_vec(&self.header).expect("a header is plain data");
        self.file.write_all(&header)?;
        self.file.write_all(&(header.len() as u64).to_le_bytes())?;
        self.file.write_all(&Sha256::digest(&header))?;
        self.file.write_all(MAGIC)?;
        Ok(self.header)
    }
}

/// A file that is read.
#[derive(Debug)]
pub(crate) struct MapFile {
    option: &'static str,
    path: PathBuf,
    bytes: MappedFile,
    pub header: Header,
    /// Of its header, which has the checksums of all photons.
    pub hash: String,
}

impl MapFile {
    /// `option` names it.
    pub(crate) fn open(option: &'static str, path: &Path) -> Result<MapFile> {
        MapFile::read(option, path).map_err(|reason| Error::setting(option, path.display(), reason))
    }

    /// Fails with what is wrong with the file.
    fn read(option: &'static str, path: &Path) -> std::result::Result<MapFile, String> {
        let unreadable = |error: std::io::Error| format!("cannot be read ({}); name a file of photonmill map", refusal(&error));
        let file = File::open(path).map_err(unreadable)?;
        if !file.metadata().is_ok_and(|facts| facts.is_file()) {
            return Err("is no file; name a file of photonmill map".into());
        }
        let bytes = MappedFile::new(&file).map_err(unreadable)?;
        if !bytes.starts_with(MAGIC) {
            return Err("is no photon map of photonmill; name a file of photonmill map".into());
        }
        let cut_off = || "is cut off or was changed; use a copy, or make it again".to_owned();
        let tail = bytes.len().checked_sub(TAIL_BYTES).filter(|tail| *tail >= MAGIC.len()).ok_or_else(cut_off)?;
        let (length, rest) = bytes[tail..].split_at(8);
        let (hash, magic) = rest.split_at(32);
        let length = u64::from_le_bytes(length.try_into().expect("8 bytes were cut out"));
        let start = usize::try_from(length).ok().and_then(|length| tail.checked_sub(length)).filter(|start| *start >= MAGIC.len());
        let start = start.filter(|_| magic == MAGIC).ok_or_else(cut_off)?;
        let header = &bytes[start..tail];
        if Sha256::digest(header).as_slice() != hash {
            return Err(cut_off());
        }
        let hash = hash.iter().map(|byte| format!("{byte:02x}")).collect();
        let header: Header = read_header(header, FORMAT)?;
        // They are printed.
        let [program, device, scene] = [&header.program, &header.device, &header.scene].map(|text| one_line(text));
        let header = Header { program, device, scene, ..header };
        if let Some(fault) = header.fault(start as u64) {
            return Err(format!("contradicts itself: {fault}"));
        }
        Ok(MapFile { option, path: path.to_owned(), bytes, header, hash })
    }

    pub(crate) fn rounds(&self) -> u32 {
        self.header.rounds.len() as u32
    }

    /// Settings for a run that takes its photons from this file.
    pub(crate) fn settings(&self, settings: &SceneSettings) -> SceneSettings {
        let PhotonSettings { photons, caustic_photons, bounces, illumination, aim, .. } = self.header.settings;
        SceneSettings { photons, caustic_photons, bounces, illumination, aim, ..settings.clone() }
    }

    /// Makes a plan one whose photons are those of this file; refuses a plan that wants others.
    pub(crate) fn plan(&self, mut plan: ScenePlan, geometry: &Geometry) -> Result<ScenePlan> {
        if scene_hash(geometry) != self.header.scene_hash {
            return Err(self.refuse(format!(
                "holds photons of another scene ({}, {} triangles); give the file and the options that it was made with",
                self.header.scene, self.header.triangles
            )));
        }
        let surfaces = plan.caustic_surfaces;
        for map in plan.global.iter_mut().chain(&mut plan.caustic) {
            let own = self.header.maps.iter().find(|own| own.name == map.name);
            let wanted = if map.caustic_only { surfaces } else { 0 };
            let Some(own) = own.filter(|own| (own.stored, own.caustic_surfaces) == (map.stored, wanted)) else {
                let other = "make it again with the same `with` and `without`";
                return Err(self.refuse(format!("holds no {} map of the light that this run wants; {other}", map.name)));
            };
            (map.photons, map.flux_scale, map.flux_gain) = (own.photons, own.flux_scale, own.flux_gain);
        }
        Ok(plan)
    }

    fn refuse(&self, reason: String) -> Error {
        Error::setting(self.option, self.path.display(), reason)
    }

    fn number(&self, name: &str) -> usize {
        self.header.maps.iter().position(|map| map.name == name).expect("the plan's maps are the file's")
    }

    /// Fates of a round's photons in a map.
    pub(crate) fn fates(&self, round: u32, map: &str) -> &Fates {
        &self.header.rounds[round as usize][self.number(map)].fates
    }

    /// Hands over the photons of a round, at most so many at once, each once its checksum is known to be right.
    pub(crate) fn photons(
        &self,
        round: u32,
        map: &str,
        most: usize,
        planes: usize,
        take: &mut dyn FnMut(&[MapPhoton]) -> Result<()>,
    ) -> Result<()> {
        let Photons { byte, count, crc32, .. } = &self.header.rounds[round as usize][self.number(map)];
        let bytes = &self.bytes[*byte as usize..][..(count * PHOTON_BYTES) as usize];
        let photons: &[MapPhoton] = bytemuck::cast_slice(bytes);
        // As many pieces as are wanted at once, or a part of one.
        let step = if most >= PIECE { most / PIECE * PIECE } else { PIECE };
        for first in (0..photons.len()).step_by(step) {
            let now = &photons[first..photons.len().min(first + step)];
            let pieces: Range<usize> = first / PIECE..(first + now.len()).div_ceil(PIECE);
            let is_right = |(piece, expected): (&[MapPhoton], &u32)| {
                let is_sound =
                    |photon: &MapPhoton| (photon.plane as usize / 2) < planes && photon.position.is_finite() && photon.flux.is_finite();
                crc32fast::hash(bytemuck::cast_slice(piece)) == *expected && piece.iter().all(is_sound)
            };
            if !now.par_chunks(PIECE).zip(&crc32[pieces]).all(is_right) {
                return Err(self
                    .refuse(format!("is damaged: photons of round {round} in the {map} map were changed; use a copy, or make it again")));
            }
            now.chunks(most).try_for_each(&mut *take)?;
        }
        Ok(())
    }
}
