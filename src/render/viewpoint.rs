//! The camera of a request: which one of the scene, or where it stands, its lens and the size of its image.

use glam::{DVec2, DVec3};

use super::events::{Event, Observer};
use super::request::RenderRequest;
use crate::error::{Error, Result, require};
use crate::scene::image_size::ImageSize;
use crate::scene::{Camera, Lens, Projection, Scene};

/// Metres. Rays through a lens are computed in 24 bits.
const MOST_APERTURE: f64 = 1e6;
const MOST_FOCUS: f64 = 1e12;
/// Degrees.
const MOST_FOV: f64 = 179.0;
/// Metres; far more than rays are computed with.
const MAX_COORDINATE: f64 = 1e12;

impl RenderRequest {
    /// Before a scene is read, which may take long.
    pub fn check_camera(&self) -> Result<()> {
        if let Some(aperture) = self.aperture {
            require((0.0..=MOST_APERTURE).contains(&aperture), "aperture", aperture, format!("must be 0 to {MOST_APERTURE:e} metres"))?;
        }
        if let Some(focus) = self.focus {
            let allowed = || format!("must be above 0 and at most {MOST_FOCUS:e} metres, which is as good as infinity");
            require(focus > 0.0 && focus <= MOST_FOCUS, "focus", focus, allowed())?;
        }
        if let Some(fov) = self.fov {
            require(fov > 0.0 && fov <= MOST_FOV, "fov", fov, format!("must be above 0 and at most {MOST_FOV} degrees"))?;
        }
        if let Some(height) = self.orthographic {
            require(
                height > 0.0 && height <= MAX_COORDINATE,
                "orthographic",
                height,
                format!("must be above 0 and at most {MAX_COORDINATE:e} metres"),
            )?;
        }
        for (field, point) in [("eye", self.eye), ("look_at", self.look_at), ("up", self.up)] {
            let Some(point) = point else { continue };
            let is_near = point.is_finite() && point.abs().max_element() <= MAX_COORDINATE;
            let allowed = format!("must be three numbers with commas between them, each from -{MAX_COORDINATE:e} to {MAX_COORDINATE:e}");
            require(is_near, field, text(point), allowed)?;
        }
        let is_direction = |point: DVec3| point.length() > 0.0;
        if let Some(up) = self.up {
            require(is_direction(up), "up", text(up), "must be a direction, not 0,0,0")?;
        }
        if let (Some(eye), Some(look_at)) = (self.eye, self.look_at) {
            require(is_direction(look_at - eye), "look_at", text(look_at), "must not be where `eye` is")?;
        }
        Ok(())
    }

    /// The camera, or another one that is given, and the size of its image.
    pub fn viewpoint(&self, scene: &Scene, given: Option<&Camera>, observer: &Observer) -> Result<(Camera, [u32; 2])> {
        let own = given.map_or_else(|| named(scene, self.camera.as_deref()), |camera| Ok(camera.clone()))?;
        let (width, height) = size_of(self.size, &own, observer)?;
        let is_around = given.is_none() && scene.cameras.is_empty();
        let own = if is_around { scene.camera_around(f64::from(width) / f64::from(height)) } else { own };
        let mut camera = self.placed(own)?;
        if self.aperture.is_some() || given.is_none() {
            camera.lens = self.lens(scene, &camera, observer)?;
        }
        Ok((camera, [width, height]))
    }

    fn placed(&self, own: Camera) -> Result<Camera> {
        let eye = self.eye.unwrap_or(own.eye);
        let target = self.look_at.unwrap_or(eye + own.forward);
        require((target - eye).length() > 0.0, "look_at", text(target), "must not be where the camera stands; give `eye`")?;
        // Without a new direction the camera keeps its own roll.
        let up = self.up.unwrap_or(if self.look_at.is_some() { DVec3::Y } else { own.up });
        let turned = Camera::looking_at(&own.name, eye, target, up, 1.0);
        let projection = match (self.fov, self.orthographic) {
            (Some(fov), _) => Projection::Perspective { vertical_view: fov.to_radians() },
            (_, Some(height)) => Projection::Orthographic { half_height: 0.5 * height },
            _ => own.projection,
        };
        let is_moved = self.eye.is_some() || self.look_at.is_some() || self.up.is_some();
        Ok(if is_moved { Camera { projection, aspect: own.aspect, ..turned } } else { Camera { projection, ..own } })
    }

    fn lens(&self, scene: &Scene, camera: &Camera, observer: &Observer) -> Result<Option<Lens>> {
        let Some(aperture) = self.aperture.filter(|aperture| *aperture > 0.0) else { return Ok(None) };
        let in_the_middle = || {
            let (origin, direction) = camera.ray(0.0, 0.0, 1.0, DVec2::ZERO);
            let focus = scene.distance_along(origin, direction).ok_or_else(|| {
                Error::setting("aperture", aperture, "needs `focus`: the middle of the picture shows nothing to focus on")
            })?;
            observer.report(Event::Status(&format!("focus at {focus:.4} m, on what the middle of the picture shows")));
            Ok(focus)
        };
        Ok(Some(Lens { radius: 0.5 * aperture, focus: self.focus.map_or_else(in_the_middle, Ok)? }))
    }
}

fn text(point: DVec3) -> String {
    point.to_array().map(|value| value.to_string()).join(",")
}

/// Width and height in pixels; says so if they change what the camera sees.
pub(crate) fn size_of(size: Option<ImageSize>, camera: &Camera, observer: &Observer) -> Result<(u32, u32)> {
    let (width, height, remark) = ImageSize::of(size, camera)?;
    remark.iter().for_each(|remark| observer.report(Event::Note(&format!("note: {remark}"))));
    Ok((width, height))
}

/// The camera by name, else the scene's first, else one that sees all of it.
pub(crate) fn named(scene: &Scene, name: Option<&str>) -> Result<Camera> {
    name.map_or_else(|| Ok(scene.first_camera()), |name| scene.camera(name))
}
