//! `src/settings.rs` under libFuzzer.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(init: photonmill::fuzz::panics_are_caught(), |request: photonmill::fuzz::settings::PlanRequest| photonmill::fuzz::settings::run(&request));
