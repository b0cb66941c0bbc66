//! The film on the device: sums and squares of blocks, what gives the errors of these, and what a block that is cut short must not change.

use rayon::prelude::*;

use super::film::SceneFilm;
use crate::constants::{HIT_CAUSTIC_PHOTON, HIT_GLOBAL_PHOTON, HIT_KINDS, KEPT_BLOCKS, PART_COUNT, RADIUS_CLASSES};
use crate::engine::error::differences::Differences;
use crate::engine::film::{BlockSums, KeptBlock, LatestBlocks, halves, wide};
use crate::engine::planned::{Planned, buffers};
use crate::engine::run::RunState;
use crate::engine::run::watch::Lazy;
use crate::error::Result;
use crate::gpu::{Buffer, Commands};
use crate::plan::buffers::{ANOMALY_WORDS, PART_VALUES, scene};
use crate::plan::differences::difference_count;
use crate::plan::film::BiasPlan;
use crate::plan::latest_blocks::kept_count;
use crate::plan::scene::ScenePlan;

buffers! {
    /// Light of pixels in fixed point, and counts.
    pub(crate) struct FilmBuffers(planned: &Planned, commands: &mut Commands) {
        /// Of the block under way, of all whole blocks, and the squares of these in two halves.
        sums_of_block: Buffer<u64> = planned.zeroed(commands, scene::SUMS_OF_BLOCK)?,
        film_sums: Buffer<u64> = planned.zeroed(commands, scene::FILM_SUMS)?,
        film_squares: Buffer<u64> = planned.zeroed(commands, scene::FILM_SQUARES)?,
        /// The same of light that surfaces scatter; of a picture.
        surface_sums_of_block: Buffer<u64> = planned.zeroed(commands, scene::SURFACE_SUMS_OF_BLOCK)?,
        surface_sums: Buffer<u64> = planned.zeroed(commands, scene::SURFACE_SUMS)?,
        surface_squares: Buffer<u64> = planned.zeroed(commands, scene::SURFACE_SQUARES)?,
        /// What a smaller radius would change.
        differences: Buffer<u64> = planned.zeroed(commands, scene::DIFFERENCES)?,
        latest_blocks: Buffer<f32> = planned.zeroed(commands, scene::LATEST_BLOCKS)?,
        /// What is known of pixels that some kind of light has not reached; see `glsl/world/scene/single_hit.glsl`.
        single_hits: Buffer<u32> = planned.zeroed(commands, scene::SINGLE_HITS)?,
        part_totals: Buffer<u64> = planned.zeroed(commands, scene::PART_TOTALS)?,
        part_sums: Buffer<u64> = planned.zeroed(commands, scene::PART_SUMS)?,
        anomalies: Buffer<u32> = planned.zeroed(commands, scene::ANOMALIES)?,
        class_counts: Buffer<u32> = planned.zeroed(commands, scene::CLASS_COUNTS)?,
        /// Counts as the latest whole block left them: a block that is cut short leaves nothing in the result.
        single_hits_of_blocks: Buffer<u32> = planned.one(scene::SINGLE_HITS_OF_BLOCKS)?,
        part_totals_of_blocks: Buffer<u64> = planned.one(scene::PART_TOTALS_OF_BLOCKS)?,
        anomalies_of_blocks: Buffer<u32> = planned.one(scene::ANOMALIES_OF_BLOCKS)?,
    }
}

impl FilmBuffers {
    /// Empties the film.
    pub(super) fn clear(&self, commands: &mut Commands) {
        let FilmBuffers { sums_of_block, film_sums, film_squares, .. } = self;
        let FilmBuffers { surface_sums_of_block, surface_sums, surface_squares, differences, part_sums, .. } = self;
        for sums in [sums_of_block, film_sums, film_squares, surface_sums_of_block, surface_sums, surface_squares, differences, part_sums] {
            commands.clear(sums);
        }
        commands.clear(&self.latest_blocks);
        commands.clear(&self.class_counts);
        self.forget_seen(commands);
    }

    /// Forgets what was counted while points were seen.
    pub(super) fn forget_seen(&self, commands: &mut Commands) {
        commands.clear(&self.single_hits);
        commands.clear(&self.part_totals);
        commands.clear(&self.anomalies);
    }

    /// Notes what the block that ends leaves of the counts.
    pub(super) fn end_block(&self, commands: &mut Commands) {
        commands.copy(&self.single_hits, &self.single_hits_of_blocks, self.single_hits.count());
        commands.copy(&self.part_totals, &self.part_totals_of_blocks, PART_COUNT.into());
        commands.copy(&self.anomalies, &self.anomalies_of_blocks, self.anomalies.count());
    }

    /// Goes on with a film.
    pub(super) fn restore(&self, commands: &mut Commands, film: &SceneFilm) -> Result<()> {
        let FilmBuffers { film_sums, film_squares, surface_sums, surface_squares, latest_blocks, .. } = self;
        commands.upload(&self.differences, &film.differences.0)?;
        let of_surfaces = film.of_surfaces.iter().map(|found| (surface_sums, surface_squares, found));
        for (sums, squares, found) in of_surfaces.chain([(film_sums, film_squares, &film.of_blocks)]) {
            commands.upload(sums, &found.sums)?;
            commands.upload(squares, &halves(&found.squares))?;
        }
        let kept = PART_VALUES as usize * kept_count(film.pixels());
        let mut values = vec![0.0; latest_blocks.count() as usize];
        for block in film.latest.iter() {
            values[(block.number % KEPT_BLOCKS) as usize * kept..][..kept].copy_from_slice(&block.values);
        }
        commands.upload(latest_blocks, &values)?;
        for single_hits in [&self.single_hits, &self.single_hits_of_blocks] {
            commands.upload(single_hits, &film.single_hits)?;
        }
        if let Some(parts) = &film.parts {
            commands.upload(&self.part_sums, parts)?;
        }
        for part_totals in [&self.part_totals, &self.part_totals_of_blocks] {
            commands.upload(part_totals, &film.part_totals)?;
        }
        for anomalies in [&self.anomalies, &self.anomalies_of_blocks] {
            commands.upload(anomalies, &film.anomalies)?;
        }
        commands.submit()
    }

    /// Copies the film to the host, which makes it of the copies when it is wanted: that of whole blocks, or where there is none, of all
    /// rounds; `is_cut` where the latest of these was cut short.
    pub(super) fn read(
        &self,
        commands: &mut Commands,
        plan: &ScenePlan,
        state: &RunState<SceneFilm>,
        is_cut: bool,
    ) -> Result<Lazy<SceneFilm>> {
        let pixels = plan.sensor.pixels() as usize;
        // Where a block is whole, nothing counts of the one under way.
        let is_whole = state.blocks() > 0;
        // Those of the block under way stand behind all else of their buffer.
        let parts = match (plan.part_sums() as usize, is_whole) {
            (0, _) => None,
            (count, true) => Some((commands.copy_out(&self.part_sums, count)?, 0)),
            (_, false) if is_cut => None,
            (count, false) => {
                let all = self.part_totals.count() as usize;
                Some((commands.copy_out(&self.part_totals, all)?, all - count))
            }
        };
        let FilmBuffers { sums_of_block, film_sums, film_squares, surface_sums_of_block, surface_sums, surface_squares, .. } = self;
        let (film_sums, surface_sums) = if is_whole { (film_sums, surface_sums) } else { (sums_of_block, surface_sums_of_block) };
        let (single_hits, part_totals, anomalies) = match is_whole {
            true => (&self.single_hits_of_blocks, &self.part_totals_of_blocks, &self.anomalies_of_blocks),
            false => (&self.single_hits, &self.part_totals, &self.anomalies),
        };
        let seen = if plan.film.sees_light { pixels } else { 0 };
        let all = (commands.copy_out(film_sums, 3 * pixels)?, commands.copy_out(film_squares, 6 * pixels)?);
        let surfaces = (commands.copy_out(surface_sums, 3 * seen)?, commands.copy_out(surface_squares, 6 * seen)?);
        let kept = PART_VALUES as usize * kept_count(pixels);
        let latest = commands.copy_out(&self.latest_blocks, self.latest_blocks.count() as usize)?;
        let single_hits = commands.copy_out(single_hits, HIT_KINDS as usize * pixels)?;
        let part_totals = commands.copy_out(part_totals, PART_COUNT as usize)?;
        let anomalies = commands.copy_out(anomalies, ANOMALY_WORDS)?;
        let class_counts = commands.copy_out(&self.class_counts, 2 * RADIUS_CLASSES as usize)?;
        let measured = if plan.film.bias == BiasPlan::Blocks { difference_count(pixels) } else { 0 };
        let differences = commands.copy_out(&self.differences, measured)?;
        commands.submit()?;
        let mut stored = [0; 3];
        for map in plan.maps() {
            let fates = &state.fates()[usize::from(map.caustic_only)];
            stored[if map.caustic_only { HIT_CAUSTIC_PHOTON } else { HIT_GLOBAL_PHOTON } as usize] = fates.ledger().stored;
        }
        let (blocks, numbers, plan) = (state.blocks(), state.kept.clone(), plan.film.clone());
        let rounds = if is_whole { blocks * plan.rounds_per_block } else { state.rounds() };
        Ok(Box::new(move || {
            let of_blocks = |sums: Vec<u64>, squares: Vec<u64>| BlockSums {
                rounds,
                blocks,
                sums,
                squares: squares.par_chunks_exact(2).map(|words| wide(words[0], words[1])).collect(),
            };
            let values = latest.take();
            let mut latest = LatestBlocks::default();
            for (slot, number) in numbers {
                latest.push(KeptBlock { number, values: values[slot as usize * kept..][..kept].to_vec() });
            }
            SceneFilm {
                of_blocks: of_blocks(all.0.take(), all.1.take()),
                of_surfaces: plan.sees_light.then(|| of_blocks(surfaces.0.take(), surfaces.1.take())),
                plan,
                latest,
                differences: Differences(differences.take()),
                single_hits: single_hits.take(),
                part_totals: part_totals.take(),
                parts: parts.map(|(values, first)| values.take().split_off(first)),
                anomalies: anomalies.take().try_into().expect("so many words were read"),
                class_counts: class_counts.take(),
                stored,
            }
        }))
    }
}
