//! Photon mapping on any Vulkan GPU: GLSL compute kernels on raw Vulkan, results that are the same to
//! the bit however the work is split, and a ledger of every photon.
//!
//! # The straight line
//!
//! ```text
//! scene -> plan -> resources -> trace -> index -> estimate -> film -> output
//! what     which   bytes on     photons  cells or flux per    sums    images,
//! is lit   effects the device   of hits  kd-tree  point               report
//! ```
//!
//! [`render`] is that line on one page; each stage hands a value to the next and none calls back. A
//! module uses only what stands to its left:
//!
//! ```text
//! constants, records, path, photon, error, bias, unknown, ledger, rng, settings, timings < scene < plan < cpu
//! scene < judge
//! constants, records, error, ledger, timings < gpu
//! gpu < oddities, tallies; plan, gpu < prefix_sum
//! plan, oddities, tallies, prefix_sum < resources < trace < index < estimate < film < render < transport < selfcheck < output
//! output < bake < paper < compaction < study < bench < cli
//! ```
//!
//! [`gpu`] knows no photon; [`scene`] and [`plan`] know no Vulkan; `tests/architecture.rs` checks it.
//!
//! # Two kinds of scene, two lines
//!
//! The paper's box is a convex room ([`scene::room`]); its line is the one above, as small as the paper's.
//! A scene of triangles ([`scene::Scene`], from glTF or built in) goes by [`scene::geometry`] and
//! [`plan::transport`] to [`transport`], the same line with rays in it: points that a camera or a lightmap asks
//! about, a global and a caustic map, density estimates, film. The two share the engine, prefix sums, random
//! numbers, the ledger and the way photons take places in a map.
//!
//! [`plan::transport`] decides which effects a scene calls for; what it drops is in no buffer, no pass and, by
//! specialization constants (`glsl/scene/effects.glsl`), in no pipeline. [`judge`] is a path tracer on the CPU
//! that shares nothing with it but the scene; [`selfcheck`] holds a device against closed forms, and
//! [`study`] measures what accuracy costs in time on it, and [`mod@bench`] how near its limits every pass comes.
//!
//! # What never changes by accident
//!
//! - **A photon is (seed, round, number).** Its random numbers ([`rng`]) follow from these alone, so
//!   every builder, thread count and split traces the same photons.
//! - **Sums are integers.** The film ([`film`]) is 64-bit fixed point with a scale that cannot
//!   overflow ([`plan`]), so the order of additions does not matter. `--sums` takes floats instead, to
//!   show what they cost.
//! - **Errors are known.** Films keep sums of squares over rounds, so each texel and pixel has its standard error
//!   ([`render::stop`] ends a run by it); what the radius adds is measured apart ([`bias`]).
//! - **The ledger closes.** emitted = absorbed + escaped + cut off + dropped, and nothing is ever
//!   dropped ([`ledger`]): the plan splits what does not fit.
//! - **Nothing in world units.** A path leaves its own wall by the wall's number ([`cpu::room`]), and a
//!   triangle by what its position may be wrong (`offset_origin` in `glsl/scene/bvh.glsl`); lengths are
//!   normalised by a power of two ([`scene::geometry`]).
//! - **Every operation is rounded by itself** (`glsl/compile.rs`): a driver may not fuse two in one pipeline and
//!   not in another, so an effect that is forced on changes no bit of a scene that lacks it.
//! - **What devices round as they like stands in one file** (`glsl/math.glsl`), beside functions that are the same to
//!   the bit everywhere: `--math strict` takes those.
//! - **Nothing that is no number passes unseen**: `--paranoid` names its photon ([`oddities`]), and
//!   [`transport::replay`] traces that one alone.
//!
//! # What is estimated
//!
//! In the paper's box, as in the paper, a photon is stored where a wall *reflects* it. So the density of
//! stored photons estimates the reflected flux, the radiosity; the irradiance is that over the wall's albedo.
//! In a scene of triangles it is stored where it *arrives*, so the density is the irradiance itself.
//!
//! # Rust and GLSL in step
//!
//! `build.rs` compiles each kernel of `glsl/kernels`, reflects it, and writes a struct whose fields
//! are its buffers ([`gpu::kernels`]), so that a dispatch names every buffer. Records stand in
//! [`records`] and `glsl/records.glsl`; `tests/layout.rs` compares them. Numbers that both languages
//! need stand in [`constants`] only. Every GLSL function of the paper's line has a Rust twin under
//! [`cpu`], but for the grid, in whose place [`cpu::splat`] comes to the same sums; that of triangles is judged by
//! [`judge`].

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
pub mod index;
pub mod judge;
pub mod ledger;
pub mod oddities;
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
pub mod timings;
pub mod trace;
pub mod transport;
pub mod unknown;
