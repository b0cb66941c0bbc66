//! Options of a camera: which one of the scene, or where it stands, its lens and the size of its picture.

use clap::Args;
use glam::{DVec2, DVec3};

use super::progress::ProgressReporter;
use super::values::{parse_number, parse_numbers};
use crate::error::{Error, Result, require};
use crate::scene::picture_size::{PictureSize, parse_size};
use crate::scene::{Camera, Lens, Projection, Scene};

#[derive(Args)]
pub(super) struct CameraArgs {
    /// Camera by name [default: the first one; one that sees the whole scene if it has none]
    #[arg(long, value_name = "NAME", help_heading = "Scene")]
    camera: Option<String>,
    /// Where the camera stands, metres, in place of where the scene has it
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true, help_heading = "Scene")]
    eye: Option<DVec3>,
    /// What it looks at, metres [default: straight on, as the scene's camera does]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true, help_heading = "Scene")]
    look_at: Option<DVec3>,
    /// What is up in its picture, as a direction [default: 0,1,0 with --look-at]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true, help_heading = "Scene")]
    up: Option<DVec3>,
    /// Angle between the picture's lower and upper edge, degrees [default: that of the scene's camera]
    #[arg(long, value_name = "DEGREES", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Scene")]
    fov: Option<f64>,
    /// Height of what the picture shows by parallel rays, metres
    #[arg(long, value_name = "METRES", value_parser = parse_number::<f64>, allow_hyphen_values = true, conflicts_with = "fov", help_heading = "Scene")]
    orthographic: Option<f64>,
    /// Size of the picture in pixels; a width alone takes its height from the camera's aspect ratio [default: about 307200
    /// pixels in the camera's aspect ratio, 640x480 if it has none]
    #[arg(long, value_name = "WIDTH[xHEIGHT]", value_parser = parse_size, allow_hyphen_values = true, help_heading = "Scene")]
    pub(super) size: Option<PictureSize>,
    /// Diameter of the camera's lens, metres: what is not in focus is blurred [default: 0, a pinhole]
    #[arg(long, value_name = "METRES", value_parser = parse_number::<f64>, allow_hyphen_values = true, help_heading = "Scene")]
    aperture: Option<f64>,
    /// Distance of the plane in focus, metres [default: that of what the middle of the picture shows]
    #[arg(long, value_name = "METRES", value_parser = parse_number::<f64>, allow_hyphen_values = true, requires = "aperture", help_heading = "Scene")]
    focus: Option<f64>,
}

/// Metres. Rays through a lens are computed in 24 bits.
const MOST_APERTURE: f64 = 1e6;
const MOST_FOCUS: f64 = 1e12;
/// Degrees.
const MOST_FOV: f64 = 179.0;
const MOST_METRES: f64 = 1e12;

fn parse_point(text: &str) -> std::result::Result<DVec3, String> {
    let point = parse_numbers::<f64, 3>(text).map(DVec3::from_array);
    let is_allowed = |point: &DVec3| point.is_finite() && point.abs().max_element() <= MOST_METRES;
    point
        .ok()
        .filter(is_allowed)
        .ok_or_else(|| format!("must be three numbers with commas between them, each from -{MOST_METRES:e} to {MOST_METRES:e}"))
}

impl CameraArgs {
    /// Before a scene is read, which may take long.
    pub(super) fn check(&self) -> Result<()> {
        if let Some(aperture) = self.aperture {
            require((0.0..=MOST_APERTURE).contains(&aperture), "--aperture", aperture, format!("must be 0 to {MOST_APERTURE:e} metres"))?;
        }
        if let Some(focus) = self.focus {
            let allowed = || format!("must be above 0 and at most {MOST_FOCUS:e} metres, which is as good as infinity");
            require(focus > 0.0 && focus <= MOST_FOCUS, "--focus", focus, allowed())?;
        }
        if let Some(fov) = self.fov {
            require(fov > 0.0 && fov <= MOST_FOV, "--fov", fov, format!("must be above 0 and at most {MOST_FOV} degrees"))?;
        }
        if let Some(height) = self.orthographic {
            require(
                height > 0.0 && height <= MOST_METRES,
                "--orthographic",
                height,
                format!("must be above 0 and at most {MOST_METRES:e} metres"),
            )?;
        }
        let is_direction = |point: DVec3| point.length() > 0.0;
        if let Some(up) = self.up {
            require(is_direction(up), "--up", text(up), "must be a direction, not 0,0,0")?;
        }
        if let (Some(eye), Some(look_at)) = (self.eye, self.look_at) {
            require(is_direction(look_at - eye), "--look-at", text(look_at), "must not be where --eye is")?;
        }
        Ok(())
    }

    /// The camera, and the size of its picture.
    pub(super) fn resolve(&self, scene: &Scene, reporter: &ProgressReporter) -> Result<(Camera, [u32; 2])> {
        let own = named(scene, self.camera.as_deref())?;
        let (width, height) = resolve(self.size, &own, reporter)?;
        let own = if scene.cameras.is_empty() { scene.camera_around(f64::from(width) / f64::from(height)) } else { own };
        let mut camera = self.placed(own)?;
        camera.lens = self.lens(scene, &camera, reporter)?;
        Ok((camera, [width, height]))
    }

    /// Of the paper's box, whose camera is not one of a scene; `None` where nobody has asked for a size.
    pub(super) fn size_of_box(&self, reporter: &ProgressReporter) -> Result<Option<[u32; 2]>> {
        let camera = Camera::looking_at("box", DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0);
        self.size.map(|_| resolve(self.size, &camera, reporter).map(<[u32; 2]>::from)).transpose()
    }

    fn placed(&self, own: Camera) -> Result<Camera> {
        let eye = self.eye.unwrap_or(own.eye);
        let target = self.look_at.unwrap_or(eye + own.forward);
        require((target - eye).length() > 0.0, "--look-at", text(target), "must not be where the camera stands; give --eye")?;
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

    fn lens(&self, scene: &Scene, camera: &Camera, reporter: &ProgressReporter) -> Result<Option<Lens>> {
        let Some(aperture) = self.aperture.filter(|aperture| *aperture > 0.0) else { return Ok(None) };
        let in_the_middle = || {
            let (origin, direction) = camera.ray(0.0, 0.0, 1.0, DVec2::ZERO);
            let focus = scene.distance_along(origin, direction).ok_or_else(|| {
                Error::setting("--aperture", aperture, "needs --focus: the middle of the picture shows nothing to focus on")
            })?;
            reporter.status(&format!("focus at {focus:.4} m, on what the middle of the picture shows"));
            Ok(focus)
        };
        Ok(Some(Lens { radius: 0.5 * aperture, focus: self.focus.map_or_else(in_the_middle, Ok)? }))
    }
}

fn text(point: DVec3) -> String {
    point.to_array().map(|value| value.to_string()).join(",")
}

/// Width and height in pixels; prints a note if they change what the camera sees.
pub(super) fn resolve(size: Option<PictureSize>, camera: &Camera, reporter: &ProgressReporter) -> Result<(u32, u32)> {
    let (width, height, remark) = PictureSize::of(size, camera)?;
    remark.iter().for_each(|remark| reporter.note(&format!("note: {remark}")));
    Ok((width, height))
}

/// The camera by name, else the scene's first, else one that sees all of it.
pub(super) fn named(scene: &Scene, name: Option<&str>) -> Result<Camera> {
    name.map_or_else(|| Ok(scene.first_camera()), |name| scene.camera(name))
}
