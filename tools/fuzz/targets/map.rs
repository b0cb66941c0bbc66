//! `src/map.rs` under libFuzzer.

#![no_main]

use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

fuzz_target!(|bytes: &[u8]| photonmill::fuzz::map::run(bytes));

fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    photonmill::fuzz::map::change(data, size, max_size, seed, fuzzer_mutate)
});
