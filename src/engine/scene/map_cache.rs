//! Photon maps of a run that stay on the device, so that whoever looks from somewhere else need not trace them again. A photon
//! follows from the seed, its round and its number, so a picture of kept maps is, to the bit, that of traced ones.

use std::collections::HashMap;

use super::Round;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Commands, Memory};
use crate::ledger::Fates;
use crate::photon::MapPhoton;
use crate::plan::scene::MapPlan;

pub(crate) struct MapCache {
    /// By round, and whether it is the caustic map.
    maps: HashMap<(u32, bool), CachedMap>,
    /// Maps for which there is no room are traced again.
    most_bytes: u64,
    /// The round under way, and which of its maps nobody has counted yet: the global and the caustic one.
    round: u32,
    open: [bool; 2],
}

#[derive(Default)]
struct CachedMap {
    /// A map that has no room for all photons of a round comes in parts.
    parts: Vec<Buffer<MapPhoton>>,
    /// Known once the round has run; those emitted are not among them.
    fates: Option<Fates>,
    /// Some part found no room.
    is_partial: bool,
}

impl MapCache {
    pub(super) fn new(most_bytes: u64) -> MapCache {
        MapCache { maps: HashMap::new(), most_bytes, round: 0, open: [false; 2] }
    }

    /// Begins a map of a round; whether its photons are kept, and need not be traced.
    pub(super) fn begin(&mut self, round: u32, map: &MapPlan) -> bool {
        self.round = round;
        self.open[usize::from(map.caustic_only)] = true;
        let cached = self.maps.entry((round, map.caustic_only)).or_default();
        let is_whole = cached.fates.is_some() && !cached.is_partial;
        if !is_whole {
            *cached = CachedMap { is_partial: cached.is_partial, ..CachedMap::default() };
        }
        is_whole
    }

    /// Keeps the photons that are in the map, if there is room.
    pub(super) fn store(&mut self, commands: &mut Commands, round: Round, map: &MapPlan) -> Result<()> {
        let held = self.bytes();
        let cached = self.maps.get_mut(&(self.round, map.caustic_only)).expect("the map was begun");
        let count = u64::from(commands.read(&round.photons().counters, 1)?[0].min(map.capacity));
        if cached.is_partial || count == 0 {
            return Ok(());
        }
        let has_room = held + count * size_of::<MapPhoton>() as u64 <= self.most_bytes;
        let part = has_room.then(|| commands.gpu().buffer("kept photons", count, Memory::Device));
        match part {
            Some(Ok(part)) => {
                commands.copy(&round.photons().map, &part, count);
                cached.parts.push(part);
            }
            Some(Err(error)) if !matches!(error, Error::OutOfMemory { .. }) => return Err(error),
            _ => *cached = CachedMap { is_partial: true, ..CachedMap::default() },
        }
        Ok(())
    }

    /// Photons of the round under way.
    pub(super) fn parts(&self, map: &MapPlan) -> impl Iterator<Item = &Buffer<MapPhoton>> {
        self.maps.get(&(self.round, map.caustic_only)).into_iter().flat_map(|map| &map.parts)
    }

    /// The fates of a map in the round that has run, as counted, or as they were when its photons were traced. Both numbers are of
    /// this round alone: of all its photons, and of those in whole blocks.
    pub(super) fn fates(&mut self, which: usize, counted: [Fates; 2]) -> [Fates; 2] {
        if !std::mem::take(&mut self.open[which]) {
            return counted;
        }
        let cached = self.maps.get_mut(&(self.round, which == 1)).expect("the map was begun");
        match &cached.fates {
            Some(fates) => [fates.clone(), fates.clone()],
            None => {
                cached.fates = Some(counted[0].clone());
                counted
            }
        }
    }

    /// Of which all photons are kept.
    pub(super) fn rounds(&self) -> usize {
        self.maps.iter().filter(|((_, caustic_only), map)| !caustic_only && !map.is_partial).count()
    }

    /// Of the photons that are kept.
    pub(super) fn bytes(&self) -> u64 {
        let photons: u64 = self.maps.values().flat_map(|map| &map.parts).map(Buffer::count).sum();
        photons * size_of::<MapPhoton>() as u64
    }
}
