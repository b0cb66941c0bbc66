//! `src/gltf.rs` under libFuzzer.

#![no_main]

use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

fuzz_target!(init: photonmill::fuzz::panics_are_caught(), |bytes: &[u8]| photonmill::fuzz::gltf::run(bytes));

fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    photonmill::fuzz::gltf::change(data, size, max_size, seed, fuzzer_mutate)
});
