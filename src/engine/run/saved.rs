//! Runs as files: the sums of whole blocks, with which a run can go on, or be added to others of the same identity.

use bytemuck::Pod;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::blocks::{Blocks, Share};
use super::identity::Identity;
use crate::engine::error::differences::Differences;
use crate::engine::film::{BlockSums, KeptBlock, LatestBlocks, TooLarge};
use crate::engine::room::film::RoomFilm;
use crate::engine::scene::film::SceneFilm;
use crate::ledger::Fates;
use crate::plan::buffers::PART_VALUES;
use crate::plan::differences::difference_count;
use crate::plan::film::{BiasPlan, FilmPlan};
use crate::plan::sensor::Sensor;
use crate::settings::{MOST_ROUNDS, Sums};
use crate::text::one_line;

/// A run as far as whole blocks of it are done.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SavedRun {
    pub identity: Identity,
    /// Which part of the run it is; all of it after a merge.
    pub share: Share,
    /// The blocks that the run was to have, and those that are done.
    pub wanted: u32,
    pub done: Blocks,
    pub sensor: Option<Sensor>,
    /// Of the photons of each map.
    pub fates: Vec<Fates>,
    pub film: SavedFilm,
}

/// Of either world.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum SavedFilm {
    Room(RoomFilm),
    Scene(Box<SceneFilm>),
}

/// Why two saved runs are no parts of one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NotMerged {
    /// Both hold this block.
    Twice(u32),
    /// Their sums are not of the same things.
    OtherShape,
    /// Together they hold more than any run does.
    TooLarge,
}

/// Of one of the two.
pub(crate) trait WorldFilm: Clone + Into<SavedFilm> + Send + 'static {
    /// Of what a run saved whose identity is this world's.
    fn of(saved: &SavedFilm) -> &Self;
}

impl WorldFilm for RoomFilm {
    fn of(saved: &SavedFilm) -> &RoomFilm {
        let SavedFilm::Room(film) = saved else { unreachable!("identities of two worlds differ") };
        film
    }
}

impl WorldFilm for SceneFilm {
    fn of(saved: &SavedFilm) -> &SceneFilm {
        let SavedFilm::Scene(film) = saved else { unreachable!("identities of two worlds differ") };
        film
    }
}

impl From<RoomFilm> for SavedFilm {
    fn from(film: RoomFilm) -> SavedFilm {
        SavedFilm::Room(film)
    }
}

impl From<SceneFilm> for SavedFilm {
    fn from(film: SceneFilm) -> SavedFilm {
        SavedFilm::Scene(Box::new(film))
    }
}

impl SavedFilm {
    fn blocks(&self) -> &BlockSums {
        match self {
            SavedFilm::Room(film) => film,
            SavedFilm::Scene(film) => film,
        }
    }

    pub(crate) fn latest(&self) -> &LatestBlocks {
        match self {
            SavedFilm::Room(film) => &film.latest,
            SavedFilm::Scene(film) => &film.latest,
        }
    }
}

impl SavedRun {
    /// Adds the blocks of another part of the same run. Where that fails, what is here is of no use any more.
    pub(crate) fn merge(&mut self, other: &SavedRun) -> Result<(), NotMerged> {
        if self.shape() != other.shape() {
            return Err(NotMerged::OtherShape);
        }
        self.done.merge(&other.done).map_err(NotMerged::Twice)?;
        self.wanted = self.wanted.max(other.wanted);
        self.share = Share::default();
        self.fates.iter_mut().zip(&other.fates).for_each(|(fates, others)| fates.add(others));
        let added = match (&mut self.film, &other.film) {
            (SavedFilm::Room(film), SavedFilm::Room(others)) => film.merge(others),
            (SavedFilm::Scene(film), SavedFilm::Scene(others)) => film.merge(others),
            _ => unreachable!("films of two worlds have other shapes"),
        };
        added.map_err(|TooLarge| NotMerged::TooLarge)?;
        let is_sound = self.fates.iter().all(|fates| fates.is_sound(MOST_COUNTED)) && self.film.blocks().is_sound();
        if is_sound { Ok(()) } else { Err(NotMerged::TooLarge) }
    }

    /// What parts of a run have in common: the world, bounces counted of each map, and lengths of sums.
    fn shape(&self) -> (bool, Vec<usize>, Vec<usize>) {
        let bounces = self.fates.iter().map(|fates| fates.bounces.len()).collect();
        let film = match &self.film {
            SavedFilm::Room(film) => vec![film.channel_count as usize],
            SavedFilm::Scene(film) => vec![film.part_totals.len(), film.class_counts.len(), film.differences.0.len()],
        };
        let sums = self.film.blocks();
        (matches!(self.film, SavedFilm::Room(_)), bounces, [film, vec![sums.sums.len(), sums.squares.len()]].concat())
    }

    /// Whether the parts of each pixel's light are kept apart.
    pub(crate) fn has_parts(&self) -> bool {
        matches!(&self.film, SavedFilm::Scene(film) if film.parts.is_some())
    }

    /// Whether it holds as much as a run with these fates, sums of its film, and values kept of a block.
    pub(crate) fn has_lengths(&self, fates: &[Fates], sums: usize, kept: usize) -> bool {
        let bounces = |fates: &Fates| fates.bounces.len();
        self.fates.iter().map(bounces).eq(fates.iter().map(bounces))
            && self.film.blocks().sums.len() == sums
            && self.film.latest().iter().all(|block| block.values.len() == kept)
    }

    /// Photons of its blocks, of all maps.
    pub(crate) fn emitted(&self) -> u64 {
        self.fates.iter().map(|fates| fates.emitted).sum()
    }

    /// Blocks that it should have and does not.
    #[cfg(any(test, fuzzing))]
    pub(crate) fn missing(&self) -> u32 {
        self.share.missing(&self.done, self.wanted)
    }
}

/// The first bytes of a file.
const MAGIC: &[u8; 16] = b"photonmill run\r\n";
/// Of what follows them. A change that older programs cannot read makes it another one.
const FORMAT: u32 = 3;
/// Of the photons of a run, by any count: a year of the fastest device is a millionth of it.
const MOST_COUNTED: u64 = 1 << 60;
/// Name of an array that not every film has.
const PARTS: &str = "parts";
/// Of the checksum at the end.
const CHECKSUM_BYTES: usize = 32;

/// What stands before the sums, as JSON.
#[derive(Serialize, Deserialize)]
struct Header {
    format: u32,
    program: String,
    identity: Identity,
    share: Share,
    wanted: u32,
    done: Blocks,
    sensor: Option<Sensor>,
    fates: Vec<Fates>,
    film: FilmHeader,
    rounds: u32,
    /// Arrays behind it in this order, little-endian: name, type of the elements, how many.
    arrays: Vec<(String, String, u64)>,
}

#[derive(Serialize, Deserialize)]
enum FilmHeader {
    Room { channel_count: u32, scale: f64, emitted: u64, photons_per_round: u32 },
    Scene { plan: FilmPlan, anomalies: Vec<u32>, stored: Vec<u64> },
}

/// Arrays of a file that is written.
#[derive(Default)]
struct Arrays {
    list: Vec<(String, String, u64)>,
    bytes: Vec<u8>,
}

/// What files hold arrays of.
trait Element: Pod {
    const NAME: &'static str;
}

macro_rules! elements {
    ($($kind:ident),*) => { $(impl Element for $kind {
        const NAME: &'static str = stringify!($kind);
    })* };
}

elements!(u32, u64, u128, f32);

impl Arrays {
    fn add<T: Element>(&mut self, name: &str, values: &[T]) {
        self.list.push((name.to_owned(), T::NAME.to_owned(), values.len() as u64));
        self.bytes.extend_from_slice(bytemuck::cast_slice(values));
    }

    fn add_sums(&mut self, name: &str, sums: &BlockSums) {
        self.add(name, &sums.sums);
        self.add(&format!("{name} squares"), &sums.squares);
    }
}

/// Arrays of a file that is read, one after the other.
struct Reader<'a> {
    list: std::slice::Iter<'a, (String, String, u64)>,
    bytes: &'a [u8],
}

impl Reader<'_> {
    /// Whether these come next.
    fn has(&self, name: &str) -> bool {
        self.list.as_slice().first().is_some_and(|(found, ..)| found == name)
    }

    fn next<T: Element>(&mut self, name: &str) -> Result<Vec<T>, String> {
        let (_, _, count) = self
            .list
            .next()
            .filter(|(found, kind, _)| found == name && kind == T::NAME)
            .ok_or_else(|| format!("holds no {name} where they should be"))?;
        let bytes =
            usize::try_from(*count).ok().and_then(|count| count.checked_mul(size_of::<T>())).filter(|bytes| *bytes <= self.bytes.len());
        let (own, rest) = self.bytes.split_at(bytes.ok_or_else(|| format!("ends in its {name}"))?);
        self.bytes = rest;
        Ok(bytemuck::pod_collect_to_vec(own))
    }

    fn next_sums(&mut self, name: &str, rounds: u32, blocks: u32) -> Result<BlockSums, String> {
        let (sums, squares) = (self.next(name)?, self.next(&format!("{name} squares"))?);
        Ok(BlockSums { rounds, blocks, sums, squares })
    }
}

impl SavedRun {
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut arrays = Arrays::default();
        arrays.add_sums("sums", self.film.blocks());
        let latest = self.film.latest();
        arrays.add("kept blocks", &latest.iter().map(|block| block.number).collect::<Vec<u32>>());
        arrays.add("kept values", &latest.iter().flat_map(|block| block.values.iter().copied()).collect::<Vec<f32>>());
        let film = match &self.film {
            SavedFilm::Room(film) => FilmHeader::Room {
                channel_count: film.channel_count,
                scale: film.scale,
                emitted: film.emitted,
                photons_per_round: film.photons_per_round,
            },
            SavedFilm::Scene(film) => {
                arrays.add_sums("surfaces", film.of_surfaces.as_ref().unwrap_or(&BlockSums::default()));
                arrays.add("one hits", &film.single_hits);
                arrays.add("part totals", &film.part_totals);
                arrays.add("class counts", &film.class_counts);
                arrays.add("differences", &film.differences.0);
                film.parts.iter().for_each(|parts| arrays.add(PARTS, parts));
                FilmHeader::Scene { plan: film.plan.clone(), anomalies: film.anomalies.to_vec(), stored: film.stored.to_vec() }
            }
        };
        let header = Header {
            format: FORMAT,
            program: env!("CARGO_PKG_VERSION").to_owned(),
            identity: self.identity.clone(),
            share: self.share,
            wanted: self.wanted,
            done: self.done.clone(),
            sensor: self.sensor,
            fates: self.fates.clone(),
            film,
            rounds: self.film.blocks().rounds,
            arrays: arrays.list,
        };
        let header = serde_json::to_vec(&header).expect("a header is plain data");
        let mut bytes = Vec::with_capacity(MAGIC.len() + 8 + header.len() + arrays.bytes.len() + CHECKSUM_BYTES);
        bytes.extend_from_slice(MAGIC);
        bytes.extend_from_slice(&(header.len() as u64).to_le_bytes());
        bytes.extend_from_slice(&header);
        bytes.extend_from_slice(&arrays.bytes);
        let checksum = Sha256::digest(&bytes);
        bytes.extend_from_slice(&checksum);
        bytes
    }

    /// Fails with what is wrong with the file.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<SavedRun, String> {
        let rest = bytes.strip_prefix(MAGIC).ok_or("is no saved run of photonmill; give a file that `checkpoint` wrote")?;
        let damaged = || "is cut off or was changed, as its checksum shows; use an older copy, or begin the run anew".to_owned();
        let (content, checksum) = bytes.split_at_checked(bytes.len().saturating_sub(CHECKSUM_BYTES)).ok_or_else(damaged)?;
        if content.len() < MAGIC.len() + 8 || Sha256::digest(content).as_slice() != checksum {
            return Err(damaged());
        }
        let rest = &rest[..rest.len() - CHECKSUM_BYTES];
        let (length, rest) = rest.split_at(8);
        let length = u64::from_le_bytes(length.try_into().expect("8 bytes were cut out"));
        let (header, arrays) = usize::try_from(length).ok().and_then(|length| rest.split_at_checked(length)).ok_or_else(damaged)?;
        SavedRun::from_parts(read_header(header, FORMAT)?, arrays)
    }

    fn from_parts(header: Header, bytes: &[u8]) -> Result<SavedRun, String> {
        let Header { identity, share, wanted, done, sensor, fates, film, rounds, arrays, .. } = header;
        let wrong = |what: &str| Err(format!("contradicts itself: {what}"));
        // No run has more rounds than this, and a block has one at least.
        let most = wanted.max(done.end());
        if !done.is_valid() || share.of == 0 || share.number >= share.of || most > MOST_ROUNDS {
            return wrong("its blocks or its share");
        }
        if !fates.iter().all(|fates| fates.is_sound(MOST_COUNTED) && fates.ledger().closes()) {
            return wrong("the fates of its photons");
        }
        // It is printed.
        let identity = Identity { scene: one_line(&identity.scene), ..identity };
        let mut reader = Reader { list: arrays.iter(), bytes };
        let of_blocks = reader.next_sums("sums", rounds, done.count())?;
        let (numbers, values): (Vec<u32>, Vec<f32>) = (reader.next("kept blocks")?, reader.next("kept values")?);
        if numbers.is_empty() != values.is_empty() || (!numbers.is_empty() && !values.len().is_multiple_of(numbers.len())) {
            return wrong("its kept blocks");
        }
        let mut latest = LatestBlocks::default();
        let size = values.len() / numbers.len().max(1);
        numbers.iter().zip(values.chunks_exact(size.max(1))).for_each(|(number, values)| {
            latest.push(KeptBlock { number: *number, values: values.to_vec() });
        });
        let (film, rounds_per_block, values) = match film {
            FilmHeader::Room { channel_count, scale, emitted, photons_per_round } => {
                let values = channel_count as usize;
                (RoomFilm { of_blocks, latest, kind: Sums::Integer, channel_count, scale, emitted, photons_per_round }.into(), 1, values)
            }
            FilmHeader::Scene { plan, anomalies, stored } => {
                if !plan.is_sound() {
                    return wrong("its film's plan");
                }
                let of_surfaces = reader.next_sums("surfaces", rounds, done.count())?;
                let rounds_per_block = plan.rounds_per_block;
                let seen = if plan.sees_light { of_blocks.sums.len() } else { 0 };
                if [of_surfaces.sums.len(), of_surfaces.squares.len()] != [seen; 2] || !of_surfaces.is_sound() {
                    return wrong("its sums of surfaces");
                }
                let film = SceneFilm {
                    of_surfaces: plan.sees_light.then_some(of_surfaces),
                    plan,
                    of_blocks,
                    latest,
                    single_hits: reader.next("one hits")?,
                    part_totals: reader.next("part totals")?,
                    anomalies: anomalies.try_into().or(Err("holds other counts than this program knows"))?,
                    class_counts: reader.next("class counts")?,
                    differences: Differences(reader.next("differences")?),
                    parts: if reader.has(PARTS) { Some(reader.next(PARTS)?) } else { None },
                    stored: stored.try_into().or(Err("holds other counts than this program knows"))?,
                };
                if film.single_hits.len() != film.pixels() * crate::constants::HIT_KINDS as usize {
                    return wrong("what one hit would add");
                }
                if film.parts.as_ref().is_some_and(|parts| parts.len() != film.pixels() * (PART_VALUES as usize - 3)) {
                    return wrong("its parts of light");
                }
                let measured = if film.plan.bias == BiasPlan::Blocks { difference_count(film.pixels()) } else { 0 };
                if film.differences.0.len() != measured {
                    return wrong("what tells its bias");
                }
                (film.into(), rounds_per_block, 3)
            }
        };
        let saved = SavedRun { identity, share, wanted, done, sensor, fates, film };
        let sums: &BlockSums = saved.film.blocks();
        let places = sums.sums.len();
        if values == 0 || places == 0 || !places.is_multiple_of(values) || sums.squares.len() != places || !sums.is_sound() {
            return wrong("its sums");
        }
        if saved.done.count().checked_mul(rounds_per_block) != Some(rounds) {
            return wrong("its rounds");
        }
        let pixels = saved.sensor.map(|sensor| sensor.pixels() as usize);
        if pixels.is_some_and(|pixels| pixels * 3 != places) {
            return wrong("its size");
        }
        Ok(saved)
    }
}

/// The header of a file. Before anything else of it is read, its format, as it may look otherwise in another one.
pub(crate) fn read_header<T: DeserializeOwned>(bytes: &[u8], known: u32) -> Result<T, String> {
    let header: serde_json::Value = serde_json::from_slice(bytes).map_err(|_| "has no header".to_owned())?;
    let (format, program) = (&header["format"], one_line(header["program"].as_str().unwrap_or("unknown")));
    if format.as_u64() != Some(known.into()) {
        let own = env!("CARGO_PKG_VERSION");
        return Err(format!("is of format {format} (photonmill {program}), and this is photonmill {own}, which reads format {known}"));
    }
    serde_json::from_slice(bytes).map_err(|error| format!("has a header that is not understood ({})", one_line(&error.to_string())))
}
