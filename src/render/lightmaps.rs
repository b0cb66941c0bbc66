//! Lightmaps: irradiance of all surfaces, as arrays and as files.

use std::ops::DerefMut;

use glam::Vec3;

use super::checkpoints::Checkpoints;
use super::events::{Event, Observer};
use super::prepare::{Inputs, RequestedReceivers, Run};
use super::request::RenderRequest;
use super::scene::PreparedScene;
use crate::bake::pages::{Atlas, Pages};
use crate::bake::{self, IntoFile, Layout, Map, Written};
use crate::engine::error::bound::ErrorSource;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::output::destination::{Destination, Folder, check_distinct};
use crate::scene::gltf::source::File;
use crate::text::counted;

/// What is asked of a bake beside its light.
#[derive(Debug, Clone, Default)]
pub struct BakeRequest {
    /// `None`: about 65536 texels in all maps together.
    pub texels_per_metre: Option<f64>,
    /// Folder for the files that the command writes; `None`: no files.
    pub folder: Option<Folder>,
    /// Of the files of a scene from a file; `None`: one picture per object, or pages of more than 8 objects.
    pub atlas: Option<Atlas>,
    /// Also write a copy that shows the light in any viewer.
    pub preview: bool,
    /// Of that, and of the pictures of a built-in scene, stops; `None`: what makes the mean middle grey.
    pub exposure: Option<f32>,
}

/// The irradiance of an object's surface, row by row, W/m2; v = 0 is the uppermost row, as in glTF.
pub struct Lightmap {
    pub name: String,
    pub width: u32,
    pub height: u32,
    pub irradiance: Vec<Vec3>,
    /// Infinite where unknown.
    pub standard_error: Vec<Vec3>,
    /// The most that light which was not met may add to any channel.
    pub unseen: Vec<f32>,
    /// Of the errors: an interval follows.
    pub source: ErrorSource,
}

pub struct Lightmaps {
    pub run: Run,
    pub maps: Vec<Lightmap>,
    /// Of all maps, those that lie on a surface.
    pub texels: usize,
    /// Exposure of the pictures for the eye, stops; `None` where there are none.
    pub stops: Option<f32>,
    /// Names of the files that were written, in the folder that was asked for.
    pub files: Vec<String>,
}

impl PreparedScene {
    /// The irradiance of all surfaces that scatter light, texel by texel.
    pub fn bake(&self, gpus: &mut Vec<Gpu>, bake: &BakeRequest, request: &RenderRequest, observer: &Observer) -> Result<Lightmaps> {
        let inputs = Inputs::open(request)?;
        let mut checkpoints = Checkpoints::open(request, observer)?;
        let (lightmaps, written) = self.bake_on(|| Ok(gpus), bake, inputs, &mut checkpoints, &[], observer)?;
        written?;
        checkpoints.finish()?;
        Ok(lightmaps)
    }

    /// The same on devices that are opened once the scene's file is known to take lightmaps, with files that none of these may be. What came of
    /// the files stands beside the light, which is not lost with them.
    pub(crate) fn bake_on<Devices: DerefMut<Target = Vec<Gpu>>>(
        &self,
        devices: impl FnOnce() -> Result<Devices>,
        bake: &BakeRequest,
        inputs: Inputs,
        checkpoints: &mut Checkpoints,
        others: &[Destination],
        observer: &Observer,
    ) -> Result<(Lightmaps, Result<Vec<Written>>)> {
        let scene = &self.scene;
        let file = self.path().map(File::open).transpose()?;
        if let (Some(Atlas::Size(size)), None) = (bake.atlas, &file) {
            return Err(Error::setting("atlas", size, format!("is for scenes from a file, and {} is built in; leave it out", scene.name)));
        }
        let atlas = if file.is_none() { Atlas::Off } else { bake.atlas.unwrap_or(Atlas::Auto) };
        let density = bake::usual_density(scene, self.name())?;
        observer.report(Event::Status("laying out the lightmaps"));
        let layout = Layout::of_file(scene, file.as_ref(), bake.texels_per_metre.unwrap_or(density), atlas.max_side())?;
        layout.warnings.iter().for_each(|warning| observer.warn(warning));
        let pages = Pages::new(&layout, atlas);
        // Before the light, as it says what is wrong with the file.
        let into_file = bake.folder.as_ref().zip(file.as_ref());
        let into_file = into_file.map(|(folder, file)| IntoFile::new(folder, file, scene, &layout, &pages)).transpose()?;
        into_file.iter().flat_map(|into| &into.warnings).for_each(|warning| observer.warn(warning));
        if let Some(folder) = &bake.folder {
            let names = into_file.as_ref().map_or_else(|| bake::names(scene, &layout), |into| into.names(bake.preview));
            names.iter().try_for_each(|name| check_distinct(&[&[folder.file(name)], others].concat()))?;
        }
        let prepared = self.prepare(inputs, RequestedReceivers::Texels(&layout), observer)?;
        let run = prepared.run(&mut *devices()?, checkpoints, observer)?;

        let estimates = bake::estimates(&run);
        let maps = layout.maps(&estimates, run.film.error_source());
        let stops = bake.exposure.unwrap_or_else(|| bake::usual_exposure(&estimates));
        let (is_built_in, is_shown) = (into_file.is_none(), into_file.is_none() || bake.preview);
        let written = match (&bake.folder, into_file) {
            (Some(folder), Some(into)) => into.write(folder, &maps, bake.preview.then(|| stops.exp2())),
            (Some(folder), None) => bake::write(folder, scene, &layout, &maps, stops.exp2()).map(|()| built_in_files(&layout)),
            (None, _) => Ok(Vec::new()),
        };
        let lightmap = |map: Map| {
            let Map { object, width, height, irradiance, error, unseen, source } = map;
            let unseen = unseen.into_iter().map(|most| most.x).collect();
            Lightmap { name: layout.objects[object].name.clone(), width, height, irradiance, standard_error: error, unseen, source }
        };
        let files = match (&bake.folder, &written) {
            (Some(_), Ok(_)) if is_built_in => bake::names(scene, &layout),
            (Some(_), Ok(written)) => written.iter().map(|file| file.name.clone()).collect(),
            _ => Vec::new(),
        };
        let maps = maps.into_iter().map(lightmap).collect();
        Ok((Lightmaps { run, maps, texels: layout.texel_count(), stops: is_shown.then_some(stops), files }, written))
    }
}

/// What a built-in scene's files are for.
fn built_in_files(layout: &Layout) -> Vec<Written> {
    let maps = counted(layout.objects.len(), "lightmap");
    [
        ("scene.gltf", "the scene with its light in any viewer, as emission".to_owned()),
        ("scene_lightmap.gltf", "the scene with its materials and lightmaps (MOZ_lightmap), for engines".to_owned()),
        ("NAME_irradiance.exr, NAME_error.exr", format!("W/m2, linear, of {maps}")),
        ("NAME.png, NAME_lightmap.png, NAME_radiance.png", "the same for the eye, and for the two scenes".to_owned()),
    ]
    .map(|(name, purpose)| Written { name: name.to_owned(), purpose })
    .into()
}
