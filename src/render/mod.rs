//! From a request to an image, to the light at points, to lightmaps or to a file of photons, for everyone who asks: the program, Python and
//! Rust. All of them get the same defaults and the same bits.
//!
//! The crate's page makes an image. This is the irradiance at a point, to an error of 20 %, whatever rounds that takes:
//!
//! ```
//! use glam::DVec3;
//! use photonmill::gpu::{Gpu, Options};
//! use photonmill::render::{Observer, Percent, PreparedScene, RenderRequest};
//!
//! let mut gpus = vec![Gpu::open(&Options::default())?];
//! let scene = PreparedScene::open("cornell")?;
//! let request = RenderRequest { error: Some(Percent::new(20.0)), photons: Some(4096), ..RenderRequest::default() };
//! let points = [(DVec3::new(0.5, 0.001, 0.5), DVec3::Y)];
//! let run = scene.probe(&mut gpus, &points, &request, &Observer::default())?;
//! println!("{} W/m2, with an error of {}", run.film.mean(0), run.film.stated_error(0));
//! # assert!(run.film.mean(0).x > 0.0 && run.film.stated_error(0).x < run.film.mean(0).x);
//! # Ok::<(), photonmill::error::Error>(())
//! ```
//!
//! Lightmaps, as values and as the files of `photonmill bake`:
//!
//! ```
//! # use photonmill::gpu::{Gpu, Options};
//! # use photonmill::render::{BakeRequest, Observer, PreparedScene, RenderRequest};
//! use photonmill::output::destination::Folder;
//! # let folder = tempfile::tempdir().unwrap();
//! # std::env::set_current_dir(folder.path()).unwrap();
//!
//! # let mut gpus = vec![Gpu::open(&Options::default())?];
//! let scene = PreparedScene::open("cornell")?;
//! let folder = Some(Folder::open("output", "baked".as_ref())?);
//! let bake = BakeRequest { folder, texels_per_metre: Some(2.0), ..BakeRequest::default() };
//! let request = RenderRequest { rounds: Some(8), photons: Some(4096), ..RenderRequest::default() };
//! let lightmaps = scene.bake(&mut gpus, &bake, &request, &Observer::default())?;
//! let floor = &lightmaps.maps[0];
//! println!("{}: {} x {} texels, the first of {} W/m2", floor.name, floor.width, floor.height, floor.irradiance[0]);
//! # assert!(lightmaps.files.iter().all(|file| std::path::Path::new("baked").join(file).is_file()) && floor.irradiance[0].x > 0.0);
//! # Ok::<(), photonmill::error::Error>(())
//! ```
//!
//! Photons of a file, and the paper's box:
//!
//! ```
//! # use photonmill::gpu::{Gpu, Options};
//! # use photonmill::render::{Observer, PreparedScene, RenderRequest, room};
//! # let folder = tempfile::tempdir().unwrap();
//! # std::env::set_current_dir(folder.path()).unwrap();
//! # let mut gpus = vec![Gpu::open(&Options::default())?];
//! let (scene, observer) = (PreparedScene::open("cornell")?, Observer::default());
//! let request = RenderRequest { rounds: Some(2), photons: Some(4096), ..RenderRequest::default() };
//! let map = scene.write_map(&mut gpus[0], "photons.pm", &request, &observer)?;
//! println!("{} photons of {} rounds", map.photons(), map.rounds());
//!
//! let request = RenderRequest { photons: Some(1000), ..RenderRequest::default() };
//! let image = room::render(&mut gpus, &request, &observer)?;
//! image.save("box.png")?;
//! let ledger = image.result.ledger();
//! println!("{} of {} photons were absorbed", ledger.absorbed, ledger.emitted);
//! # assert!(map.photons() > 0 && map.rounds() == 2 && ledger.emitted == 1000 && image.result.timings.row("run").is_some());
//! # Ok::<(), photonmill::error::Error>(())
//! ```

pub(crate) mod bias;
pub(crate) mod checkpoints;
mod denoise;
mod events;
pub mod image;
mod lightmaps;
pub mod map;
pub mod names;
pub mod options;
pub mod points;
pub mod prepare;
pub mod repeat;
mod request;
pub mod room;
pub mod scene;
pub mod tuned_settings;
pub mod values;
pub(crate) mod viewpoint;

pub use events::{Event, Observer, Report};
pub use image::Image;
pub use lightmaps::{BakeRequest, Lightmap, Lightmaps};
pub use prepare::Run;
pub(crate) use prepare::{Inputs, Prepared, RequestedReceivers, prepare};
pub use request::RenderRequest;
pub use scene::PreparedScene;
pub use values::{Percent, Seconds, Stops};
