//! A scene, read once, of which any number of things may be asked.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use super::events::{Event, Observer};
use super::options::row;
use super::request::RenderRequest;
use crate::error::{Error, Result, require};
use crate::scene::geometry::Geometry;
use crate::scene::{Scene, built_in};
use crate::settings::scene::Effect;
use crate::text::counted;

/// A scene, and the geometry that is made of it when it is first asked for.
pub struct PreparedScene {
    pub scene: Arc<Scene>,
    geometry: OnceLock<Arc<Geometry>>,
    /// What it was read from, and as what; `None` where it was made otherwise.
    read_as: Option<RenderRequest>,
}

impl PreparedScene {
    /// A built-in scene by name, else a `.gltf` or `.glb` file. A scene that nothing lights gets an even sky.
    pub fn open(name: &str) -> Result<PreparedScene> {
        PreparedScene::read(&RenderRequest::of(name), &Observer::default())
    }

    /// The scene of a request, read and lit as it asks for.
    pub fn read(request: &RenderRequest, observer: &Observer) -> Result<PreparedScene> {
        if let Some(time) = request.at {
            require(time.is_finite(), "at", time, "must be finite")?;
        }
        let surroundings = request.surroundings();
        surroundings.validate()?;
        let mut scene = Scene::open_with(&request.scene, request.reading(), &mut stages(&request.scene, observer))?;
        let remark = surroundings.light(&mut scene)?;
        scene.warnings.iter().for_each(|warning| observer.warn(warning));
        remark.iter().for_each(|remark| observer.report(Event::Remark(&format!("note: {remark}"))));
        Ok(PreparedScene { read_as: Some(request.clone()), ..PreparedScene::new(scene) })
    }

    /// A scene as it is.
    pub fn new(scene: Scene) -> PreparedScene {
        PreparedScene { scene: Arc::new(scene), geometry: OnceLock::new(), read_as: None }
    }

    /// Its geometry, made once; with what is to be said of it the first time.
    pub(crate) fn geometry(&self, observer: &Observer) -> Result<Arc<Geometry>> {
        if let Some(geometry) = self.geometry.get() {
            return Ok(geometry.clone());
        }
        let geometry = Arc::new(geometry(&self.scene, &[], observer)?);
        Ok(self.geometry.get_or_init(|| geometry).clone())
    }

    /// Makes the geometry that the first run would make, so that its warnings and its refusals come now.
    pub fn make_geometry(&self, observer: &Observer) -> Result<()> {
        self.geometry(observer).map(|_| ())
    }

    /// The file that it was read from, which may hold other things, too; `None` of a built-in one.
    pub fn path(&self) -> Option<&Path> {
        self.read_as.as_ref().map(|request| Path::new(&request.scene)).filter(|_| built_in::by_name(self.name()).is_none())
    }

    /// Where the scene comes from.
    pub(super) fn name(&self) -> &str {
        self.read_as.as_ref().map_or(&self.scene.name, |request| &request.scene)
    }

    /// A request with the scene as this one was read; `None` where no request reads it.
    pub(super) fn asked(&self, request: &RenderRequest) -> Option<RenderRequest> {
        let read_as = self.read_as.as_ref()?;
        let mut asked = RenderRequest { scene: read_as.scene.clone(), ..request.clone() };
        for row in READ_WITH.iter().filter_map(|field| row(field)) {
            if let Some(text) = row.text(read_as) {
                (row.of)(&mut asked).read(&text).expect("a value is read as it is written");
            }
        }
        Some(asked)
    }

    /// Refuses what only a scene that is read anew can have.
    pub(super) fn check_read_as(&self, request: &RenderRequest) -> Result<()> {
        for row in READ_WITH.iter().filter_map(|field| row(field)) {
            let (asked, own) = (row.text(request), self.read_as.as_ref().and_then(|read_as| row.text(read_as)));
            if let Some(value) = asked.filter(|_| row.text(request) != own) {
                return Err(Error::setting(row.field, value, "is not what this scene was read with; read it anew with this request"));
            }
        }
        Ok(())
    }
}

/// Fields that a scene is read with.
pub const READ_WITH: [&str; 6] = ["radiometric", "at", "environment", "sun", "environment_rotate", "environment_strength"];

/// The geometry that is left of a scene without some effects.
pub(super) fn geometry(scene: &Scene, without: &[Effect], observer: &Observer) -> Result<Geometry> {
    let what = format!("{} ({})", scene.name, counted(scene.triangle_count(), "triangle"));
    let geometry = Geometry::new_with(&scene.without(without), &mut stages(&what, observer))?;
    geometry.warnings(scene).iter().for_each(|line| observer.warn(line));
    Ok(geometry)
}

/// Reports the stages of loading `what`, each at its start and at every tenth of it.
pub(crate) fn stages<'a>(what: &'a str, observer: &'a Observer) -> impl FnMut(&'static str, f64) + 'a {
    let mut reported = None;
    move |stage, done| {
        let step = (stage, (10.0 * done) as u32);
        if reported.replace(step) != Some(step) {
            observer.report(Event::Status(&format!("{what}: {stage}, {} %", 10 * step.1)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{Inputs, RequestedReceivers};
    use crate::scene::surroundings::Environment;

    /// It would be as if it had not been asked for.
    #[test]
    fn a_scene_is_not_lit_anew_by_a_later_request() {
        let scene = PreparedScene::open("sky-over-plane").unwrap();
        let prepared = |request: &RenderRequest| {
            let inputs = Inputs::open(request).unwrap();
            scene.prepare(inputs, RequestedReceivers::Image(None), &Observer::default()).map(|prepared| prepared.size())
        };
        assert_eq!(prepared(&RenderRequest::default()).unwrap(), (640, 480));
        let other = RenderRequest { environment: Some(Environment::Colour([2.0; 3])), ..RenderRequest::default() };
        let refused = prepared(&other).unwrap_err().to_string();
        assert!(refused.starts_with("`environment` 2,2,2: is not what this scene was read with"), "{refused}");
    }
}
