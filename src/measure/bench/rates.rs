//! The device's peak rates, measured with the same engine as everything else: bandwidth, arithmetic, random reads,
//! atomics. The result of every measurement is checked, so that a driver cannot skip the work.

use std::time::{Duration, Instant};

use serde::Serialize;

use super::Size;
use crate::error::{Error, Result};
use crate::gpu::kernels::{MeasureAtomic, MeasureCopy, MeasureCounter, MeasureFloat, MeasureGather, MeasureInteger};
use crate::gpu::{Buffer, Commands, Constants, Extent, Gpu, Memory, clock};
use crate::records::MeasurePush;
use crate::rng::philox;
use crate::timings::{Clock, Spread};

/// Rates of a device, each a second.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Rates {
    /// Dispatches of one work group that wait for each other, in one submission.
    pub dispatches: Spread,
    /// Of the largest, far larger than caches, down to one that caches may hold.
    pub copies: [CopyRate; 3],
    /// Sums and products of 32-bit floats, each rounded by itself: nothing here is fused.
    pub float_operations: Spread,
    /// Products of 32-bit integers to 64 bits, as Philox has 20 of them in a block of four numbers.
    pub integer_products: Spread,
    /// Reads of 32 bytes at random places of a buffer far larger than caches.
    pub random_reads: Spread,
    /// Atomic additions whose answer is used, at 2^20 counters in random order.
    pub spread_atomics: Spread,
    /// The same at one counter.
    pub single_atomics: Spread,
    /// Additions to one counter, one per subgroup for all its invocations.
    pub counter_additions: Spread,
}

/// Bytes a second, read and written, of a copy that moves so many in all.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct CopyRate {
    pub moved_bytes: u64,
    #[serde(flatten)]
    pub rate: Spread,
}

impl Rates {
    /// The most bytes a second at which so many can be moved: a device that moves more of them as fast can do that.
    pub(crate) fn most_bytes(&self, moved: f64) -> f64 {
        let [largest, smaller @ ..] = &self.copies;
        let as_large = smaller.iter().filter(|copy| copy.moved_bytes as f64 >= moved);
        as_large.map(|copy| copy.rate.max).fold(largest.rate.max, f64::max)
    }
}

/// Products of integers in a block of Philox4x32-10.
pub(crate) const PHILOX_PRODUCTS: u32 = 20;
/// Sums and products of a step of `measure_float.comp`.
const FLOAT_OPERATIONS: u32 = 16;
const STEPS: u32 = 1024;
const PHILOX_STEPS: u32 = 512;
/// Reads or atomics of an invocation.
const ACCESSES: u32 = 16;
const COUNTERS: u32 = 1 << 20;
/// Dispatches of a chain.
const CHAIN: u32 = 256;
const GROUP_SIZE: u32 = 256;

/// How much is measured.
struct Amounts {
    /// Of 16 bytes.
    blocks: u32,
    /// Invocations that calculate, and that read or count at random places.
    items: u32,
    accesses: u32,
    warm_up: Duration,
}

impl Amounts {
    fn of(gpu: &Gpu, size: Size) -> Amounts {
        // lavapipe on two cores does a hundredth of what a card does.
        let (blocks, items, accesses, warm_up) = match (gpu.facts().kind, size) {
            ("cpu", Size::Small) => (1 << 21, 1 << 12, 1 << 14, 0),
            ("cpu", Size::Full) => (1 << 23, 1 << 14, 1 << 17, 0),
            (_, Size::Small) => (1 << 24, 1 << 20, 1 << 20, 500),
            (_, Size::Full) => (1 << 26, 1 << 22, 1 << 22, 2000),
        };
        let facts = gpu.facts();
        let largest = facts.storage_buffer_range_bytes.min(facts.allocation_bytes).min(facts.device_memory_bytes / 8);
        let most = 1 << (largest / 16).ilog2().min(31);
        Amounts { blocks: most.min(blocks), items, accesses, warm_up: Duration::from_millis(warm_up) }
    }
}

/// Runs of each measurement that count.
const REPEATS: usize = 11;

/// Measures a device. A card that idled is warmed up first, by time.
pub(crate) fn measure(gpu: &Gpu, size: Size) -> Result<Rates> {
    let Amounts { blocks: block_count, items, accesses, warm_up } = Amounts::of(gpu, size);
    let mut commands = Commands::new(gpu, Constants::new(GROUP_SIZE), Instant::now())?;
    let blocks = &gpu.buffer::<[u32; 4]>("blocks", u64::from(block_count), Memory::Device)?;
    let copies = &gpu.buffer::<[u32; 4]>("copies", u64::from(block_count), Memory::Device)?;
    let results = &gpu.buffer::<f32>("results", u64::from(items), Memory::Device)?;
    let sums = &gpu.buffer::<u32>("sums", u64::from(accesses), Memory::Device)?;
    let counts = &gpu.buffer::<u32>("counts", u64::from(COUNTERS), Memory::Device)?;
    // What a run before this one left in the same memory must not pass for a result.
    commands.clear(copies);
    commands.clear(results);
    commands.clear(sums);
    let mut bench = Bench { gpu, commands: &mut commands };
    clock::warm_up(gpu, warm_up)?;

    let float_operations = bench.rate("float", product([items, STEPS, FLOAT_OPERATIONS]), &mut |commands| {
        commands.dispatch(MeasureFloat { results }, &push(items, STEPS, 0), Extent::Items(u64::from(items)))
    })?;
    let found = bench.commands.read(results, items as usize)?;
    bench.check("sums and products", items, |index| found[index as usize].to_bits() == turned(index, STEPS).to_bits())?;

    let integer_products = bench.rate("integer", product([items, PHILOX_STEPS, PHILOX_PRODUCTS]), &mut |commands| {
        commands.dispatch(MeasureInteger { blocks }, &push(items, PHILOX_STEPS, 0), Extent::Items(u64::from(items)))
    })?;
    let found = bench.commands.read(blocks, items as usize)?;
    bench.check("products of integers", items, |index| found[index as usize] == block(index, PHILOX_STEPS))?;

    bench.commands.dispatch(MeasureInteger { blocks }, &push(block_count, 1, 0), Extent::Items(u64::from(block_count)))?;
    // The largest last, as what follows reads it.
    let [small, middle, large] = [6, 3, 0].map(|shift| bench.copy(blocks, copies, block_count >> shift));
    let copy_rates = [large?, middle?, small?];
    let dispatches = bench.rate("dispatches", u64::from(CHAIN), &mut |commands| {
        (0..CHAIN / 2).try_for_each(|_| {
            commands.dispatch(MeasureCopy { blocks, copies }, &push(1, 0, 0), Extent::Items(1))?;
            commands.dispatch(MeasureCopy { blocks: copies, copies: blocks }, &push(1, 0, 0), Extent::Items(1))
        })
    })?;
    let mask = block_count / 2 - 1;
    let random_reads = bench.rate("random reads", product([accesses, ACCESSES]), &mut |commands| {
        commands.dispatch(MeasureGather { blocks: copies, sums }, &push(accesses, ACCESSES, mask), Extent::Items(u64::from(accesses)))
    })?;
    let found = bench.commands.read(sums, accesses as usize)?;
    // The copy as a whole is checked against what it should be by this, at random places.
    bench.check("copied blocks", accesses, |index| found[index as usize] == read_sum(index, ACCESSES, mask))?;

    let spread_atomics = bench.atomics(counts, sums, accesses, COUNTERS - 1)?;
    let single_atomics = bench.atomics(counts, sums, accesses, 0)?;
    let counter_additions = bench.counter(counts, sums, accesses)?;
    gpu.check_validation()?;
    Ok(Rates {
        dispatches,
        copies: copy_rates,
        float_operations,
        integer_products,
        random_reads,
        spread_atomics,
        single_atomics,
        counter_additions,
    })
}

fn push(item_count: u32, step_count: u32, mask: u32) -> MeasurePush {
    MeasurePush { item_count, step_count, mask }
}

fn product<const COUNT: usize>(factors: [u32; COUNT]) -> u64 {
    factors.into_iter().map(u64::from).product()
}

struct Bench<'a, 'gpu> {
    gpu: &'gpu Gpu,
    commands: &'a mut Commands<'gpu>,
}

impl<'gpu> Bench<'_, 'gpu> {
    /// How much of `amount` a second, in each of several submissions after one that is dropped; on the device where it
    /// has a clock.
    fn rate(&mut self, name: &str, amount: u64, body: &mut dyn FnMut(&mut Commands<'gpu>) -> Result<()>) -> Result<Spread> {
        for _ in 0..=REPEATS {
            self.commands.scope(name, &mut *body)?;
            self.commands.submit()?;
        }
        let clock = if self.gpu.facts().timestamp_bits > 0 { Clock::Gpu } else { Clock::Wall };
        let spans = self.commands.timings().spans();
        let of_name = spans.iter().rev().filter(|span| *span.name == *name && span.clock == clock).take(REPEATS);
        let rates = of_name.map(|span| amount as f64 / span.duration.as_secs_f64().max(1e-9)).collect();
        Ok(Spread::of(rates).expect("something was measured"))
    }

    fn copy(&mut self, blocks: &Buffer<[u32; 4]>, copies: &Buffer<[u32; 4]>, block_count: u32) -> Result<CopyRate> {
        let moved_bytes = 2 * 16 * u64::from(block_count);
        let rate = self.rate("copy", moved_bytes, &mut |commands| {
            commands.dispatch(MeasureCopy { blocks, copies }, &push(block_count, 0, 0), Extent::Items(u64::from(block_count)))
        })?;
        let shown = block_count.min(1 << 12);
        let found = self.commands.read(copies, shown as usize)?;
        self.check("copied blocks", shown, |index| found[index as usize] == block(index, 1))?;
        Ok(CopyRate { moved_bytes, rate })
    }

    /// Every addition is answered by how many came before it, so that the answers of n at one counter are 0 to n - 1.
    fn atomics(&mut self, counts: &Buffer<u32>, sums: &Buffer<u32>, items: u32, mask: u32) -> Result<Spread> {
        let mut expected = vec![0u32; COUNTERS as usize];
        (0..items * ACCESSES).for_each(|number| expected[(place(number) & mask) as usize] += 1);
        self.additions("atomic additions", product([items, ACCESSES]), counts, sums, &expected, &mut |commands| {
            commands.dispatch(MeasureAtomic { counts, sums }, &push(items, ACCESSES, mask), Extent::Items(u64::from(items)))
        })
    }

    /// Every invocation of `items` gets places of its own, so that those of n are 0 to n - 1.
    fn counter(&mut self, counters: &Buffer<u32>, sums: &Buffer<u32>, items: u32) -> Result<Spread> {
        let subgroups = product([items, ACCESSES]) / u64::from(self.gpu.facts().subgroup_size);
        self.additions("additions to one counter", subgroups, counters, sums, &[items * ACCESSES], &mut |commands| {
            commands.dispatch(MeasureCounter { counters, sums }, &push(items, ACCESSES, 0), Extent::Items(u64::from(items)))
        })
    }

    /// The rate of `amount` additions, which leave these counts and sums of their answers.
    fn additions(
        &mut self,
        what: &str,
        amount: u64,
        counts: &Buffer<u32>,
        sums: &Buffer<u32>,
        expected: &[u32],
        add: &mut dyn FnMut(&mut Commands<'gpu>) -> Result<()>,
    ) -> Result<Spread> {
        let rate = self.rate(what, amount, add)?;
        self.commands.clear(counts);
        add(self.commands)?;
        let found = self.commands.read(sums, sums.count() as usize)?.into_iter().fold(0, u32::wrapping_add);
        let answers = expected.iter().map(|count| u64::from(*count) * u64::from(count.saturating_sub(1)) / 2).sum::<u64>();
        let is_right = self.commands.read(counts, expected.len())? == expected && found == answers as u32;
        if is_right { Ok(rate) } else { Err(self.wrong(what)) }
    }

    /// Fails unless all that are looked at are right: a few, from the first to the last.
    fn check(&self, what: &str, count: u32, is_right: impl Fn(u32) -> bool) -> Result<()> {
        const LOOKED_AT: u32 = 64;
        let mut looked_at = (0..LOOKED_AT).map(|k| (u64::from(k) * u64::from(count - 1) / u64::from(LOOKED_AT - 1)) as u32);
        if looked_at.all(is_right) { Ok(()) } else { Err(self.wrong(what)) }
    }

    fn wrong(&self, what: &str) -> Error {
        Error::Miscalculated { device: self.gpu.facts().name.clone(), what: what.to_owned() }
    }
}

/// Twin of `measure_float.comp`.
fn turned(index: u32, steps: u32) -> f32 {
    let start = (index & 1023) as f32;
    let mut x = [start, start + 1.0, start + 2.0, start + 3.0];
    let mut y = x.map(|x| x + 4.0);
    for _ in 0..steps {
        for (x, y) in x.iter_mut().zip(&mut y) {
            *x += *y * 0.125;
            *y -= *x * 0.125;
        }
    }
    ((x[0] + x[1]) + (x[2] + x[3])) + ((y[0] + y[1]) + (y[2] + y[3]))
}

/// Twin of `measure_integer.comp`.
fn block(index: u32, steps: u32) -> [u32; 4] {
    (0..steps).fold([index, 0, 0, 0], |block, _| philox(block, [0, 0]))
}

/// Twin of `glsl/check/measured_place.glsl`.
fn place(number: u32) -> u32 {
    let state = number.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// Twin of `measure_gather.comp` over blocks of one step.
fn read_sum(index: u32, steps: u32, mask: u32) -> u32 {
    let pairs = (0..steps).map(|step| place(index * steps + step) & mask);
    let words = pairs.flat_map(|pair| {
        let (even, odd) = (block(2 * pair, 1), block(2 * pair + 1, 1));
        [0, 1, 2, 3].map(|word| even[word] ^ odd[word])
    });
    words.fold(0, u32::wrapping_add)
}
