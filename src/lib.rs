//! Photon mapping on any Vulkan GPU: GLSL compute kernels on raw Vulkan, results that are the same to the bit however
//! the work is split, and a ledger of every photon.
//!
//! The [`guide`] holds what a user needs: [the paper's box](guide::paper), [scenes](guide::scenes),
//! [accuracy](guide::accuracy), a [study](guide::study) of what accuracy costs, [performance](guide::performance),
//! [hard cases](guide::hard_cases) and [file formats](guide::formats). [Architecture](guide::architecture) explains how
//! the program is built, why its results repeat, and how it is tested.
//!
//! # The straight line
//!
//! ```text
//! scene -> plan -> resources -> trace -> index -> estimate -> film -> output
//! what     which   bytes on     photons  cells or flux per    sums    images,
//! is lit   effects the device   of hits  kd-tree  point               report
//! ```
//!
//! [`render`] is that line on one page for the paper's box; [`transport`] is the same line for scenes of triangles. A module
//! uses only what stands to its left:
//!
//! ```text
//! text, constants, records, path, photon, error, bias, unknown, ledger, rng, settings, timings < scene < plan < cpu
//! scene < judge
//! text, constants, records, error, ledger, timings < gpu
//! gpu < nonfinite_values, tallies, totals; plan, gpu < prefix_sum
//! plan, nonfinite_values, tallies, totals, prefix_sum < resources < trace < index < estimate < film < render < transport < selfcheck < output
//! output < bake < paper < compaction < study < bench < cli
//! ```
//!
//! `tests/architecture.rs` checks it.

pub mod bake;
pub mod bench;
pub mod bias;
pub mod cli;
pub mod compaction;
pub mod constants;
pub mod cpu;
pub mod error;
pub mod estimate;
pub mod film;
#[expect(unsafe_code, reason = "Vulkan's functions are unsafe; nothing outside this module is")]
pub mod gpu;
#[cfg(doc)]
pub mod guide;
pub mod index;
pub mod judge;
pub mod ledger;
pub mod nonfinite_values;
pub mod output;
pub mod paper;
pub mod path;
pub mod photon;
pub mod plan;
pub mod prefix_sum;
pub mod records;
pub mod render;
pub mod resources;
pub mod rng;
pub mod scene;
pub mod selfcheck;
pub mod settings;
pub mod study;
pub mod tallies;
pub mod text;
pub mod timings;
pub mod totals;
pub mod trace;
pub mod transport;
pub mod unknown;
