//! The photons of a scene as a file.

use std::path::Path;

use super::events::{Event, Observer};
use super::prepare::{Inputs, Prepared, RequestedReceivers};
use super::request::RenderRequest;
use super::scene::PreparedScene;
use crate::engine::run::retry::until_done;
use crate::engine::run::watch::Checkpointing;
use crate::engine::scene::fill_map::{Filled, fill};
use crate::engine::scene::map_file::{Header, MapWriter};
use crate::engine::scene::trial;
use crate::engine::{self, Control};
use crate::error::{Error, Result, require};
use crate::gpu::Gpu;
use crate::output::destination::Destination;
use crate::plan::scene::ScenePlan;
use crate::plan::sensor::Sensor;
use crate::settings::stop::LEAST_BLOCKS;
use crate::text::counted;

/// Rounds of a file where nobody says how many: each is a block, and so many give the error of an image well.
pub(crate) const USUAL_ROUNDS: u32 = 2 * LEAST_BLOCKS;

/// The same with rounds of a block each: rounds of a file know nothing of each other.
pub(crate) fn by_blocks(request: RenderRequest) -> RenderRequest {
    RenderRequest { rounds: Some(request.rounds.unwrap_or(USUAL_ROUNDS)), block: Some(1), ..request }
}

/// A file that was written.
pub struct WrittenMap {
    pub(crate) header: Header,
    pub(crate) filled: Filled,
    /// Why it holds fewer rounds, where the device is gone for good.
    pub failed: Option<Error>,
}

impl WrittenMap {
    /// Rounds that the file holds.
    pub fn rounds(&self) -> u32 {
        self.filled.rounds
    }

    /// Photons of all rounds and maps.
    pub fn photons(&self) -> u64 {
        self.header.rounds.iter().flatten().map(|photons| photons.count).sum()
    }
}

impl PreparedScene {
    /// Traces the photons of a request's rounds, 16 unless it says how many, into a file, which [`RenderRequest::map`] takes.
    pub fn write_map(&self, gpu: &mut Gpu, path: impl AsRef<Path>, request: &RenderRequest, observer: &Observer) -> Result<WrittenMap> {
        let output = Destination::open_file("output", path.as_ref())?;
        let inputs = Inputs::open(&by_blocks(request.clone()))?;
        self.prepare(inputs, RequestedReceivers::Image(None), observer)?.write_map(gpu, &output, observer)
    }
}

impl Prepared {
    /// Traces the photons of all rounds into a file. The rounds should be of a block each ([`by_blocks`]).
    pub(crate) fn write_map(&self, gpu: &mut Gpu, output: &Destination, observer: &Observer) -> Result<WrittenMap> {
        let (scene, geometry, settings) = (&*self.scene, &*self.geometry, &self.inputs.settings);
        let find = |gpu: &Gpu| trial::find(gpu, scene, &self.viewpoint(), settings, self.sensor);
        let trial = until_done(gpu, &observer.failed(), find)?;
        // No picture is made, so that its buffers need no room.
        let sensor = Sensor::Picture { width: 1, height: 1 };
        let plan_of = |gpu: &Gpu| ScenePlan::with_trial(scene, geometry, settings, sensor, &engine::limits(gpu.facts()), trial.clone());
        let plan = plan_of(gpu)?;
        let maps: Vec<String> = plan.maps().map(|map| counted(map.photons, &format!("{} photon", map.name))).collect();
        let no_photons = "calls for no photons: nothing scatters light a second time, and nothing makes caustics";
        require(!maps.is_empty(), "SCENE", &self.inputs.request.scene, no_photons)?;
        let rounds = counted(settings.rounds, "round");
        observer.report(Event::Note(&format!("plan: {}, {rounds} of {}", scene.name, maps.join(" and "))));

        observer.report(Event::Status("making the pipelines"));
        let mut file = output.stage()?;
        let unwritten = |error: std::io::Error| output.failed(&error);
        let mut writer = MapWriter::new(file.file(), &scene.name, geometry, &plan, &gpu.facts().label()).map_err(unwritten)?;
        let mut progress = |progress: &engine::Progress| observer.report(Event::Progress(progress, "round"));
        let mut control = Control { cancelled: observer.cancelled, progress: &mut progress, checkpointing: Checkpointing::default() };
        let mut once = |gpu: &Gpu| fill(gpu, geometry, &plan_of(gpu)?, &mut writer, &unwritten, &mut control);
        let filled = observer.interruptible(|| until_done(gpu, &observer.failed(), &mut once));
        // A device that is gone for good leaves whole rounds too.
        let (filled, failed) = match filled {
            Err(error @ (Error::DeviceLost { .. } | Error::OutOfMemory { .. })) if writer.rounds() > 0 => {
                (Filled { rounds: writer.rounds(), is_cancelled: true, nonfinite_values: None }, Some(error))
            }
            filled => (filled?, None),
        };
        let header = writer.finish().map_err(unwritten)?;
        file.finish()?;
        if filled.is_cancelled {
            let done = counted(filled.rounds, "round");
            observer.report(Event::Remark(&format!("ended early: the file holds {done} of {}", settings.rounds)));
        }
        Ok(WrittenMap { header, filled, failed })
    }
}
