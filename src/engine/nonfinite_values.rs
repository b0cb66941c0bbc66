//! `--paranoid`: nonfinite values (NaN and infinity) that kernels recorded (`glsl/ledger/nonfinite_values.glsl`).

use serde::Serialize;

use crate::constants::*;
use crate::error::Result;
use crate::gpu::{Buffer, Commands};
use crate::plan::buffers::NONFINITE_KIND_WORDS;

/// One nonfinite value, and the photon or pixel it belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(crate) struct NonfiniteValue {
    pub what: What,
    pub round: u32,
    /// Photon, pixel or receiver.
    pub item: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum What {
    /// A photon of the global map (or of the paper's one map), leaving its light or at a surface.
    Photon,
    CausticPhoton,
    /// Light that reaches a pixel or receiver without the help of photons.
    SeenLight,
    /// A density estimate at a pixel or receiver.
    Estimate,
}

/// Their number, about 2^32 at most, and the first of them: photons first, because other nonfinite values may follow
/// from those.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub(crate) struct NonfiniteValues {
    pub count: u32,
    pub first: Vec<NonfiniteValue>,
}

impl NonfiniteValues {
    /// What a run with `--paranoid` found; `None` without it.
    pub(crate) fn found(commands: &mut Commands, buffer: &Buffer<u32>, paranoid: bool) -> Result<Option<NonfiniteValues>> {
        if !paranoid {
            return Ok(None);
        }
        let words = commands.read(buffer, buffer.count() as usize)?;
        let mut nonfinite_values = NonfiniteValues::default();
        for (kind, words) in words.chunks_exact(NONFINITE_KIND_WORDS).enumerate() {
            nonfinite_values.count = nonfinite_values.count.saturating_add(words[0]);
            for note in words[1..].chunks_exact(3).take(words[0] as usize) {
                let what = match (kind as u32, note[0]) {
                    (NONFINITE_PHOTON, DOMAIN_CAUSTIC_PHOTONS) => What::CausticPhoton,
                    (NONFINITE_PHOTON, _) => What::Photon,
                    (NONFINITE_LIGHT, _) => What::SeenLight,
                    _ => What::Estimate,
                };
                nonfinite_values.first.push(NonfiniteValue { what, round: note[1], item: note[2] });
            }
        }
        // Devices note in any order.
        nonfinite_values.first.sort_by_key(|nonfinite_value| (nonfinite_value.what as u32, nonfinite_value.round, nonfinite_value.item));
        nonfinite_values.first.dedup();
        Ok(Some(nonfinite_values))
    }

    /// Of two devices that shared a run.
    pub(crate) fn both(one: Option<NonfiniteValues>, other: Option<NonfiniteValues>) -> Option<NonfiniteValues> {
        let (Some(mut one), Some(other)) = (one, other) else { return None };
        one.count = one.count.saturating_add(other.count);
        one.first.extend(other.first);
        Some(one)
    }

    pub(crate) fn add(&mut self, what: What, round: u32, item: u32) {
        self.count = self.count.saturating_add(1);
        if self.first.len() < MAX_NONFINITE_VALUES as usize {
            self.first.push(NonfiniteValue { what, round, item });
        }
    }

    /// One line of the report.
    pub(crate) fn text(&self) -> String {
        let Some(first) = self.first.first() else {
            return "nonfinite values: none; `paranoid` checked all positions, directions, flux and radiance".to_owned();
        };
        let NonfiniteValue { round, item, .. } = first;
        let whose = match first.what {
            What::Photon => format!("photon {item} of round {round}; trace it alone with `replay` {round}:{item} (render or the main job)"),
            What::CausticPhoton => {
                format!("caustic photon {item} of round {round}; trace it alone with render `replay` {round}:{item}:caustic")
            }
            What::SeenLight => format!("directly sampled light at pixel, texel or point {item} in round {round}"),
            What::Estimate => format!("the density estimate at pixel, texel or point {item} in round {round}"),
        };
        format!("nonfinite values: {} (NaN or infinity), the first: {whose}", self.count)
    }
}
