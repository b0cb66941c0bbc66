//! Lightmaps: irradiance of all surfaces, as arrays and as files.

use glam::Vec3;

use super::{Looking, PreparedScene, Run};
use crate::bake::pages::{Atlas, Pages};
use crate::bake::{self, IntoFile, Layout, Map, Written};
use crate::engine::error::bound::ErrorSource;
use crate::engine::scene::View;
use crate::engine::watch::Control;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::output::destination::Folder;
use crate::plan::sensor::Sensor;
use crate::plan::work_division::Free;
use crate::scene::gltf::source::File;
use crate::settings::request::Request;

/// What is asked of a bake beside its light.
#[derive(Debug, Clone, Default)]
pub struct BakeRequest {
    /// `None`: about 65536 texels in all maps together.
    pub texels_per_metre: Option<f64>,
    /// Folder for the files that the command writes; `None`: no files.
    pub folder: Option<Folder>,
    /// Of the files of a scene from a file; `None`: one picture an object, or pages of more than 8 objects.
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
    /// Names of the files that were written, in the folder that was asked for.
    pub files: Vec<String>,
}

impl PreparedScene {
    /// The irradiance of all surfaces that scatter light, texel by texel.
    pub fn bake(&self, gpus: &mut Vec<Gpu>, bake: &BakeRequest, request: &Request, control: &mut Control) -> Result<Lightmaps> {
        let settings = request.settings(None);
        let (own, mut warnings) = self.geometry_of(&settings)?;
        let geometry = own.as_ref().unwrap_or(&self.geometry);
        let scene = &self.scene;
        let file = self.path.as_deref().map(File::open).transpose()?;
        if let (Some(Atlas::Size(size)), None) = (bake.atlas, &file) {
            return Err(Error::setting(
                "--atlas",
                size,
                format!("is for scenes from a file, and {} is built in; leave it out", scene.name),
            ));
        }
        let atlas = if file.is_none() { Atlas::Off } else { bake.atlas.unwrap_or(Atlas::Auto) };
        let density = bake::usual_density(scene, &self.name().to_string_lossy())?;
        let layout = Layout::of_file(scene, file.as_ref(), bake.texels_per_metre.unwrap_or(density), atlas.max_side())?;
        warnings.extend(layout.warnings.iter().cloned());
        let pages = Pages::new(&layout, atlas);
        let into_file = bake.folder.as_ref().zip(file.as_ref());
        let into_file = into_file.map(|(folder, file)| IntoFile::new(folder, file, scene, &layout, &pages)).transpose()?;
        warnings.extend(into_file.iter().flat_map(|into| into.warnings.clone()));

        let phases = layout.receivers(settings.rounds, geometry);
        let sensor = Sensor::Receivers { count: layout.texel_count() as u32 };
        let looking = Looking { view: View { geometry, camera: None, phases: &phases }, sensor, point: "texel" };
        let run = self.light(gpus, &looking, settings, Free { samples: false, ..Free::of(request) }, warnings, control)?;

        let estimates = bake::estimates(&run);
        let source = run.film.error_source();
        let maps = layout.maps(&estimates, source);
        let exposure = bake.exposure.unwrap_or_else(|| bake::usual_exposure(&estimates)).exp2();
        let files = match (&bake.folder, into_file) {
            (Some(folder), Some(into)) => {
                into.write(folder, &maps, bake.preview.then_some(exposure))?.into_iter().map(|Written { name, .. }| name).collect()
            }
            (Some(folder), None) => {
                bake::write(folder, scene, &layout, &maps, exposure)?;
                bake::names(scene, &layout)
            }
            (None, _) => Vec::new(),
        };
        let lightmap = |map: Map| {
            let Map { object, width, height, irradiance, error, unseen, source } = map;
            let unseen = unseen.into_iter().map(|most| most.x).collect();
            Lightmap { name: layout.objects[object].name.clone(), width, height, irradiance, standard_error: error, unseen, source }
        };
        Ok(Lightmaps { run, maps: maps.into_iter().map(lightmap).collect(), files })
    }
}
