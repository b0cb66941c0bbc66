//! Width and height of a picture: from the camera's aspect ratio unless both are given.

use super::Camera;
use crate::error::{Error, Result};

/// `--size`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageSize {
    Width(u32),
    WidthAndHeight(u32, u32),
}

/// Along each side.
pub(crate) const MAX_SIDE: u32 = 65_535;
/// Pixel numbers are 32-bit, with sums over them.
const MAX_PIXELS: u32 = 1 << 28;
/// Pixels of a picture whose size is not given.
const DEFAULT_PIXELS: f64 = 640.0 * 480.0;
/// Where the camera leaves it open.
const DEFAULT_ASPECT: f64 = 4.0 / 3.0;

fn is_allowed(width: u32, height: u32) -> bool {
    (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height) && width * height <= MAX_PIXELS
}

/// `1280`, `1280x720`.
pub fn parse_size(text: &str) -> std::result::Result<ImageSize, String> {
    let size = match text.split_once('x') {
        Some((width, height)) => {
            width.parse().ok().zip(height.parse().ok()).map(|(width, height)| ImageSize::WidthAndHeight(width, height))
        }
        None => text.parse().ok().map(ImageSize::Width),
    };
    size.filter(|size| match *size {
        ImageSize::Width(width) => is_allowed(width, 1),
        ImageSize::WidthAndHeight(width, height) => is_allowed(width, height),
    })
    .ok_or_else(|| format!("must be WIDTH or WIDTHxHEIGHT in pixels, each from 1 to {MAX_SIDE}, and {MAX_PIXELS} pixels at most"))
}

impl ImageSize {
    /// Width and height in pixels, and a remark if they change what the camera sees.
    pub fn of(size: Option<ImageSize>, camera: &Camera) -> Result<(u32, u32, Option<String>)> {
        let aspect = camera.aspect.unwrap_or(DEFAULT_ASPECT);
        // A float that is cut to the range of u32.
        let rounded = |side: f64| (side.round() as u32).max(1);
        match size {
            None => {
                let width = rounded((DEFAULT_PIXELS * aspect).sqrt()).min(MAX_SIDE);
                Ok((width, rounded(f64::from(width) / aspect).min(MAX_SIDE), None))
            }
            Some(ImageSize::Width(width)) => {
                let height = rounded(f64::from(width) / aspect);
                if height > MAX_SIDE || !is_allowed(width, height) {
                    let allowed = format!(
                        "gives {width}x{height} pixels by the camera's aspect ratio {aspect:.4}, which is too large; give WIDTHxHEIGHT"
                    );
                    return Err(Error::setting("size", width, allowed));
                }
                Ok((width, height, None))
            }
            Some(ImageSize::WidthAndHeight(width, height)) => {
                let by_aspect = f64::from(height) * aspect;
                // Sides are whole pixels.
                let is_same = (f64::from(width) - by_aspect).abs() <= 1.0 || (f64::from(width) / aspect - f64::from(height)).abs() <= 1.0;
                let change = if f64::from(width) > by_aspect { "wider" } else { "narrower" };
                let remark = (camera.aspect.is_some() && !is_same).then(|| {
                    format!(
                        "`size` {width}x{height} is {change} than the camera's aspect ratio {aspect:.4}: the vertical field of view is kept, so the picture shows {} at the sides",
                        if change == "wider" { "more" } else { "less" }
                    )
                });
                Ok((width, height, remark))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_picture_has_the_aspect_of_its_camera_unless_both_sides_are_given() {
        let camera = |aspect| Camera { aspect, ..Camera::around(DVec3::ZERO, DVec3::ONE, 1.0) };
        let of = |text: &str, aspect| ImageSize::of(Some(parse_size(text).unwrap()), &camera(aspect)).unwrap();
        let default = |aspect| ImageSize::of(None, &camera(aspect)).unwrap();
        assert_eq!(default(None), (640, 480, None));
        assert_eq!(default(Some(4.0 / 3.0)), (640, 480, None));
        assert_eq!(default(Some(1.0)), (554, 554, None));
        assert_eq!(default(Some(16.0 / 9.0)), (739, 416, None));
        assert_eq!(of("1280", None), (1280, 960, None));
        assert_eq!(of("1280", Some(16.0 / 9.0)), (1280, 720, None));
        assert_eq!(of("1280x720", Some(16.0 / 9.0)), (1280, 720, None));
        // 1366 / 768 is not quite 16 : 9.
        assert_eq!(of("1366x768", Some(16.0 / 9.0)).2, None);
        assert_eq!(of("3x7", None), (3, 7, None));
        let (width, height, remark) = of("800x600", Some(16.0 / 9.0));
        assert_eq!((width, height), (800, 600));
        assert!(remark.is_some_and(|remark| remark.contains("narrower") && remark.contains("vertical field of view is kept")));
        assert!(of("800x600", Some(1.0)).2.is_some_and(|remark| remark.contains("wider")));
    }

    #[test]
    fn extreme_aspects_give_a_picture_or_a_refusal() {
        for aspect in [1e-30, 1e-4, 1e4, 1e30] {
            let camera = Camera { aspect: Some(aspect), ..Camera::around(DVec3::ZERO, DVec3::ONE, 1.0) };
            let (width, height, _) = ImageSize::of(None, &camera).unwrap();
            assert!(is_allowed(width, height), "{width} x {height}");
            let given = ImageSize::of(Some(ImageSize::Width(65_535)), &camera);
            assert!(given.is_err() == (aspect < 1.0), "{aspect}");
        }
    }
}
