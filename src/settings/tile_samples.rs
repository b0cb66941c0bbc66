//! Pixels whose paths vary more have more of them: tiles of a picture, each with a power of two of the samples that all pixels have.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// A pixel's paths are summed by one invocation.
pub(crate) const MAX_SAMPLES: u32 = 1024;
/// Pixels along the side of a tile.
pub(crate) const TILE: u32 = 4;

/// Of each tile by how often its samples are twice those of all pixels: a row of digits for each row of tiles.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct TileSamples {
    rows: Vec<String>,
}

impl TileSamples {
    /// Row by row.
    pub fn new(doublings: &[u32], (width, _): (u32, u32)) -> TileSamples {
        let digit = |doublings: &u32| char::from_digit(*doublings, 10).expect("samples double at most 9 times");
        let rows = doublings.chunks(width.div_ceil(TILE) as usize).map(|row| row.iter().map(digit).collect());
        TileSamples { rows: rows.collect() }
    }

    pub fn doublings(&self, x: u32, y: u32) -> u32 {
        let digit = self.rows[(y / TILE) as usize].as_bytes()[(x / TILE) as usize];
        u32::from(digit - b'0')
    }

    /// Most doublings of all.
    pub fn most(&self) -> u32 {
        self.rows.iter().flat_map(|row| row.bytes()).map(|digit| u32::from(digit - b'0')).max().unwrap_or(0)
    }

    /// Tiles with so many doublings, from 0.
    pub fn counts(&self) -> Vec<u32> {
        let mut counts = vec![0; self.most() as usize + 1];
        self.rows.iter().flat_map(|row| row.bytes()).for_each(|digit| counts[(digit - b'0') as usize] += 1);
        counts
    }

    /// Refuses those of another picture, and more samples than a pixel may have.
    pub fn check(&self, samples: u32, (width, height): (u32, u32)) -> Result<()> {
        let (columns, rows) = (width.div_ceil(TILE) as usize, height.div_ceil(TILE) as usize);
        let is_row = |row: &String| row.len() == columns && row.bytes().all(|digit| digit.is_ascii_digit());
        if self.rows.len() != rows || !self.rows.iter().all(is_row) {
            let allowed = format!("holds tiles of another picture than one of {width} x {height} pixels; leave it out, or make a new one");
            return Err(Error::setting("settings", "tiles", allowed));
        }
        if u64::from(samples) << self.most() > u64::from(MAX_SAMPLES) {
            let allowed = format!("gives a pixel more than {MAX_SAMPLES} samples; make a new one");
            return Err(Error::setting("settings", "tiles", allowed));
        }
        Ok(())
    }
}
