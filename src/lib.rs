//! Photon mapping on any Vulkan GPU: GLSL compute kernels on raw Vulkan, results that are the same to the bit however
//! the work is split, and a ledger of every photon.
//!
//! A scene to an image ([`render`] has points, lightmaps, photon maps and the paper's box, too):
//!
//! ```
//! use photonmill::gpu::{Gpu, Options};
//! use photonmill::render::{Observer, PreparedScene, RenderRequest};
//! use photonmill::scene::image_size::ImageSize;
//! # let folder = tempfile::tempdir().unwrap();
//! # std::env::set_current_dir(folder.path()).unwrap();
//!
//! let mut gpus = vec![Gpu::open(&Options::default())?];
//! let scene = PreparedScene::open("cornell-spheres")?;
//! let size = Some(ImageSize::WidthAndHeight(32, 32));
//! let request = RenderRequest { size, rounds: Some(32), photons: Some(4096), ..RenderRequest::default() };
//! let image = scene.render(&mut gpus, None, &request, &Observer::default())?;
//! image.save("picture.png", &Observer::default())?;
//! println!("{:.1} %", 100.0 * image.run.error().noise);
//! # assert!(image.run.error().noise < 1.0 && std::path::Path::new("picture.png").is_file());
//! # Ok::<(), photonmill::error::Error>(())
//! ```
//!
//! # Versions
//!
//! Versions follow [semantic versioning](https://semver.org). The public API is [`render`] with the types that it takes and gives back
//! ([`gpu::Gpu`] and its options, [`scene::Scene`], the settings, [`engine::scene::RunResult`], [`error::Error`]), the
//! program's commands and options, the files that it writes, and the Python module. `tests/program/promised.txt` lists all that is public.
//!
//! As long as the version is 0.x, a release that raises x may change all of that, and the changelog says what; one that raises the last
//! number breaks nothing. The same version gives the same bits for the same seed on the same device and driver; another version need not. The
//! oldest Rust that builds it is that of `rust-version`; raising it raises x.
//!
//! # The straight line
//!
//! ```text
//! scene -> plan -> resources -> trace -> index -> estimate -> film -> output
//! what     which   bytes on     photons  cells or flux per    sums    images,
//! is lit   effects the device   of hits  kd-tree  point               report
//! ```
//!
//! One loop, [`engine::run`], walks that line for two worlds: [`engine::room`], the paper's box, and [`engine::scene`],
//! triangles. A file uses only what stands to its left:
//!
//! ```text
//! constants, error, text, records, rng, ledger, timings < settings, photon_state, photon < scene < plan < cpu, gpu, oidn < engine < output
//! output < bake < render < measure, window < cli;  scene < verify::judge;  render < verify::selfcheck;  output < verify::compare < cli
//! ```
//!
//! `tests/program/architecture.rs` checks it.

#![allow(rustdoc::private_intra_doc_links, reason = "the guide names parts of the program")]
#![cfg_attr(
    not(all(feature = "program", feature = "window", feature = "lab")),
    allow(dead_code, unused_imports, reason = "what only the program, the window or the lab uses")
)]
// What nobody outside can reach is `pub(crate)`. With fewer features, less can be reached.
#![cfg_attr(all(not(test), not(fuzzing), feature = "program", feature = "window", feature = "lab"), warn(unreachable_pub))]

// Tests and fuzzing name what they use as a user of the library does.
#[cfg(any(test, fuzzing))]
extern crate self as photonmill;

pub mod bake;
#[cfg(feature = "program")]
pub mod cli;
pub(crate) mod constants;
pub(crate) mod cpu;
pub mod engine;
pub mod error;
#[expect(unsafe_code, reason = "Vulkan's functions are unsafe, and so are mapped files")]
pub mod gpu;
#[cfg(doc)]
pub mod guide;
pub mod ledger;
#[cfg(feature = "lab")]
pub mod measure;
#[expect(unsafe_code, reason = "the functions of Open Image Denoise, which is loaded at run time, are unsafe")]
pub(crate) mod oidn;
pub mod output;
pub(crate) mod photon;
pub(crate) mod photon_state;
pub mod plan;
pub(crate) mod records;
pub mod render;
pub mod rng;
pub mod scene;
pub mod settings;
pub mod text;
pub mod timings;
pub(crate) mod verify;
#[cfg(feature = "window")]
pub(crate) mod window;

#[cfg(any(test, fuzzing))]
#[doc(hidden)]
#[path = "../tools/fuzz/src/mod.rs"]
pub mod fuzz;
#[cfg(test)]
#[path = "../tests/main.rs"]
mod tests;

#[cfg(test)]
use tests::common;
