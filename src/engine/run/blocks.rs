//! Which blocks of a run are done, and which of them are whose to do.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};

/// Numbers of blocks, as ranges in order that do not touch.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct Blocks(Vec<Range<u32>>);

/// Every so many-th block of a run, from block `number` on: all of them, where nothing is shared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Share {
    pub number: u32,
    pub of: u32,
}

impl Default for Share {
    fn default() -> Share {
        Share { number: 0, of: 1 }
    }
}

impl Share {
    /// How many of the blocks below `end` it has.
    pub(crate) fn count(self, end: u32) -> u32 {
        end.saturating_sub(self.number).div_ceil(self.of)
    }

    /// Its first block from `from` on that is not done and lies below `end`.
    pub(crate) fn next(self, from: u32, done: &Blocks, end: u32) -> Option<u32> {
        let first = self.number + from.saturating_sub(self.number).next_multiple_of(self.of);
        (first..end).step_by(self.of as usize).find(|block| !done.contains(*block))
    }

    /// Those below `end` that are not done.
    pub(crate) fn missing(self, done: &Blocks, end: u32) -> u32 {
        (self.number..end).step_by(self.of as usize).filter(|block| !done.contains(*block)).count() as u32
    }
}

/// As the command line counts them, from 1.
impl std::fmt::Display for Share {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}/{}", self.number + 1, self.of)
    }
}

impl Blocks {
    pub(crate) fn count(&self) -> u32 {
        self.0.iter().map(|range| range.end - range.start).sum()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn contains(&self, block: u32) -> bool {
        let place = self.0.partition_point(|range| range.end <= block);
        self.0.get(place).is_some_and(|range| range.contains(&block))
    }

    pub(crate) fn ranges(&self) -> impl Iterator<Item = Range<u32>> {
        self.0.iter().cloned()
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = u32> {
        self.ranges().flatten()
    }

    /// The one behind the last.
    pub(crate) fn end(&self) -> u32 {
        self.0.last().map_or(0, |range| range.end)
    }

    /// Adds one that is not among them.
    pub(crate) fn insert(&mut self, block: u32) {
        assert!(!self.contains(block), "block {block} is done twice");
        let place = self.0.partition_point(|range| range.end < block);
        match self.0.get_mut(place) {
            Some(range) if range.end == block => range.end += 1,
            Some(range) if range.start == block + 1 => range.start = block,
            _ => self.0.insert(place, block..block + 1),
        }
        if self.0.get(place + 1).is_some_and(|next| next.start == self.0[place].end) {
            self.0[place].end = self.0.remove(place + 1).end;
        }
    }

    /// Adds others; fails with one that is among both.
    pub(crate) fn merge(&mut self, others: &Blocks) -> Result<(), u32> {
        if let Some(block) = others.iter().find(|block| self.contains(*block)) {
            return Err(block);
        }
        others.iter().for_each(|block| self.insert(block));
        Ok(())
    }

    /// Whether they are what files may hold: ranges in order that do not touch.
    pub(crate) fn is_valid(&self) -> bool {
        self.0.iter().all(|range| range.start < range.end) && self.0.windows(2).all(|pair| pair[0].end < pair[1].start)
    }
}

/// Deals the blocks of a run to several devices: the next one to whichever asks.
#[derive(Debug)]
pub(crate) struct Dealer(Mutex<Dealing>);

#[derive(Debug)]
struct Dealing {
    blocks: Vec<u32>,
    dealt: u32,
    /// Before so many blocks are passed, in this order, a device hands over what it has done.
    looks: Vec<u32>,
    /// Of each device, how many of these it has come past, and how many blocks were dealt before its first one.
    behind: Vec<usize>,
    first: Vec<Option<u32>>,
}

impl Dealer {
    /// `looks` come after so many of the blocks, in rising order.
    pub(crate) fn new(blocks: Vec<u32>, devices: usize, looks: impl Iterator<Item = u32>) -> Dealer {
        let count = blocks.len() as u32;
        Dealer(Mutex::new(Dealing {
            blocks,
            dealt: 0,
            looks: looks.take_while(|look| *look < count).collect(),
            behind: vec![0; devices],
            first: vec![None; devices],
        }))
    }

    fn lock(&self) -> MutexGuard<'_, Dealing> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A block for a device, and whether it must hand over before that what it has done.
    pub(crate) fn next(&self, device: usize) -> Option<(u32, bool)> {
        let mut dealing = self.lock();
        let Dealing { blocks, dealt, looks, behind, first } = &mut *dealing;
        let block = *blocks.get(*dealt as usize)?;
        let passed = looks.partition_point(|look| *look <= *dealt);
        let hands_over = passed > behind[device];
        behind[device] = passed;
        first[device].get_or_insert(*dealt);
        *dealt += 1;
        Some((block, hands_over))
    }

    /// Looks that a device has come past.
    pub(crate) fn looks_behind(&self, device: usize) -> usize {
        self.lock().behind[device]
    }

    /// Whether a device has no block before a look, and will have none.
    pub(crate) fn has_none_before(&self, device: usize, look: usize) -> bool {
        let dealing = self.lock();
        let Some(look) = dealing.looks.get(look).filter(|look| **look <= dealing.dealt) else { return false };
        dealing.first[device].is_none_or(|first| first >= *look)
    }

    /// Blocks that were dealt.
    pub(crate) fn dealt(&self) -> u32 {
        self.lock().dealt
    }

    /// Looks before which all blocks are dealt.
    pub(crate) fn looks_dealt(&self) -> usize {
        let dealing = self.lock();
        dealing.looks.partition_point(|look| *look <= dealing.dealt)
    }

    /// Has all devices hand over before the next block that each takes.
    pub(crate) fn look_now(&self) {
        let mut dealing = self.lock();
        let (dealt, place) = (dealing.dealt, dealing.looks.partition_point(|look| *look <= dealing.dealt));
        dealing.looks.insert(place, dealt);
    }

    /// Deals no more.
    pub(crate) fn close(&self) {
        let mut dealing = self.lock();
        let dealt = dealing.dealt as usize;
        dealing.blocks.truncate(dealt);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Between two looks devices may take what they will; each hands over before its first block behind a look.
    #[test]
    fn devices_hand_over_before_they_pass_a_look() {
        let dealer = Dealer::new((10..20).collect(), 3, [2, 5, 40].into_iter());
        assert_eq!([0, 0, 1].map(|device| dealer.next(device)), [Some((10, false)), Some((11, false)), Some((12, true))]);
        assert_eq!((dealer.looks_behind(0), dealer.looks_behind(1), dealer.looks_dealt()), (0, 1, 1));
        assert_eq!([0, 1, 2].map(|device| dealer.has_none_before(device, 0)), [false, true, true]);
        assert!(!dealer.has_none_before(2, 1));
        assert_eq!([1, 0].map(|device| dealer.next(device)), [Some((13, false)), Some((14, true))]);
        // Two looks at once, for one that took long; and one that was not foreseen.
        assert_eq!((dealer.next(2), dealer.looks_behind(2)), (Some((15, true)), 2));
        dealer.look_now();
        assert_eq!([2, 2, 0].map(|device| dealer.next(device)), [Some((16, true)), Some((17, false)), Some((18, true))]);
        dealer.close();
        assert_eq!((dealer.next(0), dealer.looks_behind(0), dealer.looks_behind(1)), (None, 3, 1));
    }

    fn blocks(numbers: impl IntoIterator<Item = u32>) -> Blocks {
        let mut blocks = Blocks::default();
        numbers.into_iter().for_each(|number| blocks.insert(number));
        blocks
    }

    #[test]
    fn blocks_in_any_order_are_the_same_set() {
        for (numbers, ranges) in [(vec![3, 1, 2, 0, 6], vec![0..4, 6..7]), (vec![5, 0, 2, 1, 7], vec![0..3, 5..6, 7..8])] {
            let found = blocks(numbers.clone());
            assert_eq!(found, Blocks(ranges));
            assert!(found.is_valid() && found.count() as usize == numbers.len());
            assert!((0..9).all(|block| found.contains(block) == numbers.contains(&block)));
        }
        assert!(!Blocks(vec![0..2, 2..3]).is_valid() && !Blocks(vec![3..3, 4..5]).is_valid());
    }

    #[test]
    fn shares_partition_the_blocks() {
        for of in [1, 2, 3, 8] {
            let shares = || (0..of).map(|number| Share { number, of });
            let of_share = |share: Share| -> Vec<u32> {
                let mut done = Blocks::default();
                while let Some(block) = share.next(0, &done, 21) {
                    done.insert(block);
                }
                done.iter().collect()
            };
            let mut all = Blocks::default();
            for share in shares() {
                let own = of_share(share);
                assert_eq!((own.len() as u32, share.missing(&Blocks::default(), 21)), (share.count(21), share.count(21)));
                assert!(all.merge(&blocks(own)).is_ok());
            }
            assert_eq!(all, blocks(0..21));
            assert_eq!(all.merge(&blocks([4])), Err(4));
        }
        assert_eq!(Share { number: 1, of: 4 }.next(6, &Blocks::default(), 21), Some(9));
    }
}
