//! Photon mapping on any Vulkan GPU: GLSL compute kernels on raw Vulkan, results that are the same to the bit however
//! the work is split, and a ledger of every photon.
//!
//! The [`guide`] holds what a user needs: [the paper's box](guide::paper), [scenes](guide::scenes),
//! [materials](guide::materials), [accuracy](guide::accuracy), a [study](guide::study) of what accuracy costs,
//! [performance](guide::performance), [scale](guide::scale), [hard cases](guide::hard_cases) and [file formats](guide::formats).
//! [Architecture](guide::architecture) explains how the program is built, why its results repeat, and how it is tested.
//!
//! ```no_run
//! use photonmill::engine::scene::{Target, render};
//! use photonmill::gpu::{Gpu, Options};
//! use photonmill::scene::Scene;
//! use photonmill::settings::scene::SceneSettings;
//!
//! let gpu = Gpu::open(&Options::default())?;
//! let scene = Scene::open("cornell", false)?;
//! let camera = scene.first_camera();
//! let run = render(&gpu, &scene, &SceneSettings::default(), Target::Picture(&camera, [320, 240]))?;
//! let radiance: Vec<glam::DVec3> = run.film.means().collect();
//! println!("{} pixels; {}", radiance.len(), run.ledger());
//! # Ok::<(), photonmill::error::Error>(())
//! ```
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
//! constants, error, text, records, rng, ledger, timings < settings, path, photon < scene < plan < cpu, gpu, oidn < engine < output
//! output < bake < measure < cli;  scene < verify::judge;  engine < verify::selfcheck;  output < verify::compare < cli
//! ```
//!
//! `tests/architecture.rs` checks it.

pub mod bake;
pub mod cli;
pub mod constants;
pub mod cpu;
pub mod engine;
pub mod error;
#[expect(unsafe_code, reason = "Vulkan's functions are unsafe, and so are mapped files")]
pub mod gpu;
#[cfg(doc)]
pub mod guide;
pub mod ledger;
pub mod measure;
#[expect(unsafe_code, reason = "the functions of Open Image Denoise, which is loaded at run time, are unsafe")]
pub mod oidn;
pub mod output;
pub mod path;
pub mod photon;
pub mod plan;
pub mod records;
pub mod rng;
pub mod scene;
pub mod settings;
pub mod text;
pub mod timings;
pub mod verify;
