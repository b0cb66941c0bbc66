//! The start-up check: tests on the device what every run relies on.
//!
//! Some drivers fail silently: lavapipe ends the loops of an invocation after 65 535 iterations.

use std::time::Instant;

use glam::Vec2;

#[cfg(test)]
use super::kernels::CheckSampling;
use super::kernels::{CheckMath, StartUpTwoWords, StartUpU64};
use super::{Commands, Constants, Extent, Gpu, Memory, dispatch_by_sums};
use crate::constants::{LOOP_LIMIT, TALLY_COPIES};
use crate::error::{Error, Result};
use crate::records::{CheckPush, MathResults, Tally};
#[cfg(test)]
use crate::records::{Samples, SamplingCase};

/// What the check found beyond passing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LoopCount {
    pub wanted: u32,
    pub done: u32,
}

/// Fails unless the device counts, votes and adds right. Says whether lanes vote right in a loop in which they go different
/// ways: no version of Vulkan promises that, and only the persistent builder needs it.
pub(super) fn run(gpu: &Gpu) -> Result<bool> {
    let wrong = |what: String| Error::DeviceWrong { device: gpu.facts.name.clone(), what };
    let push = CheckPush {
        iteration_count: LOOP_LIMIT,
        addend_low: 0xC000_0001,
        addend_high: 3,
        add_count: 5,
        photon_count: PHOTONS,
        stride: GROUP_SIZE,
    };
    let ([iterations, chain, survivors, found_sum, subgroups], film_sum, entries) = ask(gpu, &push)?;

    let expected_chain = (0..LOOP_LIMIT).fold(1u32, |chain, _| chain.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    if iterations != LOOP_LIMIT || chain != expected_chain {
        return Err(wrong(format!("a loop of {LOOP_LIMIT} iterations ended after {iterations}")));
    }
    // Full subgroups of width w have w / 2 odd lanes each, whose exclusive counts are 0, 1, ...
    let odd_lanes = GROUP_SIZE / subgroups.max(1) / 2;
    let (half, order_sum) = (GROUP_SIZE / 2, subgroups * (odd_lanes * odd_lanes.saturating_sub(1) / 2));
    if survivors != half || found_sum != order_sum {
        return Err(wrong(format!(
            "a subgroup ballot of {half} lanes counted {survivors}, with prefix sums that total {found_sum} instead of {order_sum}"
        )));
    }
    let addend = u64::from(push.addend_low) | u64::from(push.addend_high) << 32;
    let expected_sum = addend * u64::from(push.add_count) * u64::from(GROUP_SIZE);
    if film_sum != expected_sum {
        return Err(wrong(format!("64-bit sums gave {film_sum} instead of {expected_sum}")));
    }
    Ok(entries == expected_entries())
}

/// Photons of the loop in which lanes vote: several an invocation.
const PHOTONS: u32 = 5 * GROUP_SIZE - 3;

/// The map that the photons of `glsl/check/photons.glsl` leave, sorted.
fn expected_entries() -> Vec<u32> {
    let bounces = |photon: u32| (photon.wrapping_mul(747_796_405).wrapping_add(2_891_336_453) >> 16) % 11;
    (0..PHOTONS).flat_map(|photon| (0..=bounces(photon)).step_by(2).map(move |bounce| 16 * photon + bounce)).collect()
}

/// How far a loop of `wanted` iterations really gets.
pub(crate) fn loop_count(gpu: &Gpu, wanted: u32) -> Result<LoopCount> {
    let push = CheckPush { iteration_count: wanted, addend_low: 0, addend_high: 0, add_count: 0, photon_count: 0, stride: 0 };
    Ok(LoopCount { wanted, done: ask(gpu, &push)?.0[0] })
}

/// What the strict functions of `glsl/math/math.glsl` make of each pair on the device.
pub(crate) fn math(gpu: &Gpu, operands: &[Vec2]) -> Result<Vec<MathResults>> {
    let constants = Constants::new(GROUP_SIZE).set("STRICT_MATH", 1);
    let mut commands = Commands::new(gpu, constants, Instant::now())?;
    let inputs = commands.uploaded("operands", operands)?;
    let results = gpu.buffer::<MathResults>("math results", operands.len() as u64, Memory::Device)?;
    commands.dispatch(CheckMath { operands: &inputs, results: &results }, &(), Extent::Items(operands.len() as u64))?;
    commands.read(&results, operands.len())
}

/// What the functions that sample make of each case on the device, under `constants` by name.
#[cfg(test)]
pub(crate) fn sampling(gpu: &Gpu, constants: &[(&'static str, u32)], cases: &[SamplingCase]) -> Result<Vec<Samples>> {
    let constants = constants.iter().fold(Constants::new(GROUP_SIZE), |constants, (name, value)| constants.set(name, *value));
    let mut commands = Commands::new(gpu, constants, Instant::now())?;
    let inputs = commands.uploaded("sampling cases", cases)?;
    let results = gpu.buffer::<Samples>("samples", cases.len() as u64, Memory::Device)?;
    commands.dispatch(CheckSampling { cases: &inputs, results: &results }, &(), Extent::Items(cases.len() as u64))?;
    commands.read(&results, cases.len())
}

/// Fails unless conversions of integers, sums, products, and the quotients and roots made from them are rounded to
/// nearest, each by itself: on that rests all of `--math strict`, and Vulkan leaves the direction to the device.
pub(crate) fn strict_math(gpu: &Gpu) -> Result<()> {
    let operands: Vec<Vec2> = (0..STRICT_SAMPLES).map(sample).collect();
    let results = math(gpu, &operands)?;
    let wrong = operands.iter().zip(&results).find_map(|(operand, result)| {
        let Vec2 { x: a, y: b } = *operand;
        let found = [result.converted, result.sum_of_product, result.quotient, result.root];
        let expected = [a.to_bits() as f32, a * b + a, a / b, a.sqrt()];
        (found.map(f32::to_bits) != expected.map(f32::to_bits))
            .then(|| format!("conversion, product plus sum, quotient and root of {a:e} and {b:e} gave {found:?} instead of {expected:?}"))
    });
    wrong.map_or(Ok(()), |what| Err(Error::DeviceWrong { device: gpu.facts.name.clone(), what: format!("{what}; use `math` fast") }))
}

const STRICT_SAMPLES: u32 = 4096;

/// Positive numbers over 32 binary orders of magnitude, far from where results are no normal numbers.
fn sample(k: u32) -> Vec2 {
    let number = |word: u32| f32::from_bits((word & 0x007f_ffff) | ((111 + (word >> 27)) << 23));
    Vec2::new(number(k.wrapping_mul(0x9e37_79b1) ^ k), number(k.wrapping_mul(0x85eb_ca77) ^ (k << 7)))
}

/// Invocations of the check's one work group: every device allows 128.
const GROUP_SIZE: u32 = 128;

/// Words, sum and photon map, which is sorted, of the check.
type Answers = ([u32; 5], u64, Vec<u32>);

fn ask(gpu: &Gpu, push: &CheckPush) -> Result<Answers> {
    let mut commands = Commands::new(gpu, Constants::new(GROUP_SIZE), Instant::now())?;
    let answers = gpu.buffer::<u32>("check answers", 5, Memory::Device)?;
    let film = gpu.buffer::<u64>("check film", 1, Memory::Device)?;
    commands.clear(&answers);
    commands.clear(&film);
    let entries = gpu.buffer::<u32>("check entries", 16 * u64::from(push.photon_count), Memory::Device)?;
    let counters = gpu.buffer::<u32>("check counters", 1, Memory::Device)?;
    let tallies = gpu.buffer::<Tally>("check tallies", u64::from(TALLY_COPIES), Memory::Device)?;
    commands.clear(&counters);
    dispatch_by_sums!(
        commands,
        gpu.facts.int64_atomics,
        [StartUpU64, StartUpTwoWords] { film: &film, answers: &answers, entries: &entries, counters: &counters, tallies: &tallies },
        push,
        Extent::Groups(1, 1)
    )?;
    let words = commands.read(&answers, 5)?;
    let film_sum = commands.read(&film, 1)?[0];
    let stored = commands.read::<u32>(&counters, 1)?[0].min(16 * push.photon_count);
    let mut entries = commands.read::<u32>(&entries, stored as usize)?;
    entries.sort_unstable();
    Ok((words.try_into().expect("five words were read"), film_sum, entries))
}
