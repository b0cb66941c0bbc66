//! Files of arrays and of a header in JSON, under checksums. Bytes changed at random would test the checksums alone, so the header is
//! changed value by value, or as text, and the arrays byte by byte; lengths and checksums are mended.

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::change::{Random, change, pointers};
use super::mutation::{MutateBytes, grown};

/// What such a file looks like.
pub trait Format {
    const MAGIC: &[u8; 16];
    /// Header and arrays.
    fn parts(file: &[u8]) -> Option<(&[u8], &[u8])>;
    fn pack(header: &[u8], arrays: &[u8]) -> Vec<u8>;
    /// Sets what follows from other values, or from the arrays.
    fn mend(header: &mut Value, arrays: &[u8]);
}

/// A run: header, arrays, and the hash of all of it.
pub struct Run;

/// Photons: arrays, header, and the header's hash.
pub struct Map;

fn length(bytes: &[u8]) -> Option<usize> {
    usize::try_from(u64::from_le_bytes(bytes.try_into().ok()?)).ok()
}

impl Format for Run {
    const MAGIC: &[u8; 16] = b"photonmill run\r\n";

    fn parts(file: &[u8]) -> Option<(&[u8], &[u8])> {
        let rest = file.strip_prefix(Self::MAGIC)?.split_last_chunk::<32>()?.0;
        let (header_length, rest) = rest.split_at_checked(8)?;
        rest.split_at_checked(length(header_length)?)
    }

    fn pack(header: &[u8], arrays: &[u8]) -> Vec<u8> {
        let content = [Self::MAGIC, (header.len() as u64).to_le_bytes().as_slice(), header, arrays].concat();
        [content.as_slice(), &Sha256::digest(&content)].concat()
    }

    /// Rounds are those of the blocks.
    fn mend(header: &mut Value, _: &[u8]) {
        let number = |value: &Value| value.as_u64().unwrap_or_default();
        let ranges = header["done"].as_array().into_iter().flatten();
        let blocks = ranges.map(|range| number(&range["end"]).saturating_sub(number(&range["start"]))).fold(0, u64::saturating_add);
        let rounds_per_block = header.pointer("/film/Scene/plan/rounds_per_block").map_or(1, number);
        if let Some(rounds) = header.get_mut("rounds") {
            *rounds = json!(blocks.saturating_mul(rounds_per_block));
        }
    }
}

impl Format for Map {
    const MAGIC: &[u8; 16] = b"photonmill map\r\n";

    fn parts(file: &[u8]) -> Option<(&[u8], &[u8])> {
        let rest = file.strip_prefix(Self::MAGIC)?.strip_suffix(Self::MAGIC)?.split_last_chunk::<32>()?.0;
        let (rest, header_length) = rest.split_last_chunk::<8>()?;
        let (arrays, header) = rest.split_at_checked(rest.len().checked_sub(length(header_length)?)?)?;
        Some((header, arrays))
    }

    fn pack(header: &[u8], arrays: &[u8]) -> Vec<u8> {
        let (header_length, hash) = ((header.len() as u64).to_le_bytes(), Sha256::digest(header));
        [Self::MAGIC, arrays, header, &header_length, &hash, Self::MAGIC].concat()
    }

    /// Checksums of photons are right.
    fn mend(header: &mut Value, arrays: &[u8]) {
        let rounds = header.get_mut("rounds").and_then(Value::as_array_mut);
        for photons in rounds.into_iter().flatten().filter_map(Value::as_array_mut).flatten() {
            let number = |name: &str| photons[name].as_u64().and_then(|number| usize::try_from(number).ok());
            let own = number("byte").zip(number("count")).and_then(|(byte, count)| {
                let first = byte.checked_sub(Self::MAGIC.len())?;
                arrays.get(first..first.checked_add(count.checked_mul(32)?)?)
            });
            if let Some((own, sums)) = own.zip(photons.get_mut("crc32")) {
                *sums = own.chunks(32 << 20).map(crc32fast::hash).collect();
            }
        }
    }
}

/// Two files, one behind the other; mostly there is no second one.
pub fn two_files<F: Format>(input: &[u8]) -> [&[u8]; 2] {
    let second = input.windows(16).skip(1).position(|bytes| bytes == F::MAGIC).map_or(input.len(), |place| place + 1);
    input.split_at(second).into()
}

/// Words and counts that a header may hold in other places.
const WORDS: [&str; 12] =
    ["", "two\nlines", "\u{1b}[31m\r", "global", "caustic", "u32", "u128", "sums", "NoMap", "Blocks", "relmse", "photons"];
const COUNTS: [u64; 8] = [0, 1, 3, 1 << 31, u32::MAX as u64 - 1, u32::MAX as u64, 1 << 60, u64::MAX];
/// Bits of elements of arrays: counts, infinity, and what is no number.
const EXTREMES: [u32; 6] = [0, 1 << 31, u32::MAX, 0x7f7f_ffff, 0x7f80_0000, 0x7fc0_0000];

/// The changed file; a seed in place of what is none; `None` now and then.
pub fn mutate<F: Format>(file: &[u8], seeds: &[Vec<u8>], random: &mut Random, mutate_bytes: MutateBytes) -> Option<Vec<u8>> {
    let Some((header, arrays)) = F::parts(file) else { return Some(random.pick(seeds)) };
    let mut arrays = arrays.to_vec();
    let header = match random.below(16) {
        0 => return None,
        1 => grown(header.to_vec(), mutate_bytes),
        kind => {
            let mut value = serde_json::from_slice(header).ok()?;
            match kind {
                2..=4 => arrays = changed(arrays, random, mutate_bytes),
                5 => replace(&mut value, Value::is_string, &WORDS, random),
                6 => replace(&mut value, Value::is_u64, &COUNTS, random),
                7 => take(&mut value, F::parts(&random.pick(seeds))?.0, random)?,
                _ => (0..=random.below(3)).for_each(|_| change(&mut value, random)),
            }
            if random.below(4) > 0 {
                F::mend(&mut value, &arrays);
            }
            value.to_string().into_bytes()
        }
    };
    Some(F::pack(&header, &arrays))
}

/// Mostly of the same length, without which they fit no header: words of extreme values, or libFuzzer's own changes.
fn changed(mut arrays: Vec<u8>, random: &mut Random, mutate_bytes: MutateBytes) -> Vec<u8> {
    let length = arrays.len();
    match random.below(4) {
        kind if kind == 0 || length < 4 => arrays = grown(arrays, mutate_bytes),
        1 => _ = mutate_bytes(&mut arrays, length, length),
        _ => {
            let (first, word) = (random.below(length / 4) * 4, random.pick(&EXTREMES).to_le_bytes());
            arrays[first..].chunks_exact_mut(4).take(1 << random.below(5)).for_each(|old| old.copy_from_slice(&word));
        }
    }
    arrays
}

/// Puts another in the place of one that is not deep in a header, where there is most of what counts.
fn replace<T: Clone + Into<Value>>(value: &mut Value, is_one: fn(&Value) -> bool, others: &[T], random: &mut Random) {
    let is_place = |place: &String| value.pointer(place).is_some_and(is_one) && place.matches('/').count() <= 4;
    let places: Vec<String> = pointers(value).into_iter().filter(is_place).collect();
    if let Some(old) = places.get(random.below(places.len())).and_then(|place| value.pointer_mut(place)) {
        *old = random.pick(others).into();
    }
}

/// Takes a value, or all of a member, from another header.
fn take(value: &mut Value, other: &[u8], random: &mut Random) -> Option<()> {
    let other = serde_json::from_slice::<Value>(other).ok()?;
    let place = random.pick(&pointers(&other));
    let member = place.match_indices('/').nth(1).map_or(place.as_str(), |(end, _)| &place[..end]);
    let place = if random.below(2) == 0 { member } else { &place };
    *value.pointer_mut(place)? = other.pointer(place)?.clone();
    Some(())
}
