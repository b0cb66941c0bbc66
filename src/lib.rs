//! Photon mapping on any Vulkan GPU.
pub mod constants;
pub mod cpu;
pub mod error;
pub mod estimate;
pub mod film;
pub mod gpu;
pub mod index;
pub mod ledger;
pub mod plan;
pub mod records;
pub mod render;
pub mod resources;
pub mod rng;
pub mod scene;
pub mod settings;
pub mod timings;
pub mod trace;
