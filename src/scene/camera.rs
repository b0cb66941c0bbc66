//! Pinhole cameras.

use glam::DVec3;

#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    pub name: String,
    /// Metres.
    pub eye: DVec3,
    /// Unit vectors: where it looks, and its picture's right and up.
    pub forward: DVec3,
    pub right: DVec3,
    pub up: DVec3,
    /// Angle between the picture's lower and upper edge, radians.
    pub vertical_view: f64,
    /// Width over height of the picture that it was set up for; `None` leaves that open.
    pub aspect: Option<f64>,
}

impl Camera {
    /// `up` need not be perpendicular to the view; where it is parallel another is taken.
    pub fn looking_at(name: &str, eye: DVec3, target: DVec3, up: DVec3, vertical_view: f64) -> Camera {
        let forward = (target - eye).normalize();
        let side = forward.cross(up);
        let side = if side.length_squared() < 1.0 / 1_048_576.0 { forward.cross(forward.any_orthonormal_vector()) } else { side };
        let right = side.normalize();
        Camera { name: name.to_owned(), eye, forward, right, up: right.cross(forward), vertical_view, aspect: None }
    }

    pub fn with_aspect(self, aspect: f64) -> Camera {
        Camera { aspect: Some(aspect), ..self }
    }

    /// A camera in front of the scene (towards +z) that sees all of a box.
    pub fn around(min: DVec3, max: DVec3) -> Camera {
        let vertical_view: f64 = 40f64.to_radians();
        let centre = 0.5 * (min + max);
        let radius = 0.5 * (max - min).length();
        let direction = DVec3::new(0.35, 0.3, 1.0).normalize();
        let distance = 1.05 * radius / (0.5 * vertical_view).sin();
        Camera::looking_at("default", centre + distance * direction, centre, DVec3::Y, vertical_view)
    }

    /// Unit direction through a point of the picture, both coordinates from -1 to 1, y up.
    pub fn direction(&self, x: f64, y: f64, aspect: f64) -> DVec3 {
        let half_height = (0.5 * self.vertical_view).tan();
        (self.forward + half_height * (x * aspect * self.right + y * self.up)).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_even_straight_down() {
        for target in [DVec3::X, DVec3::NEG_Y, DVec3::Y, DVec3::new(1.0, 2.0, 3.0)] {
            let camera = Camera::looking_at("c", DVec3::ZERO, target, DVec3::Y, 1.0);
            for (a, b) in [(camera.forward, camera.right), (camera.forward, camera.up), (camera.right, camera.up)] {
                assert!(a.dot(b).abs() < 1e-12 && (a.length() - 1.0).abs() < 1e-12, "{camera:?}");
            }
            // Right-handed: right x up points back to the viewer.
            assert!(camera.right.cross(camera.up).dot(camera.forward) < -0.999, "{camera:?}");
        }
    }

    #[test]
    fn the_default_camera_sees_every_corner() {
        let (min, max) = (DVec3::new(-1.0, 0.0, 2.0), DVec3::new(3.0, 1.0, 9.0));
        let camera = Camera::around(min, max);
        for corner in 0..8 {
            let side = |axis: usize| if corner >> axis & 1 == 1 { max[axis] } else { min[axis] };
            let to = (DVec3::new(side(0), side(1), side(2)) - camera.eye).normalize();
            assert!(to.dot(camera.forward).acos() < 0.5 * camera.vertical_view, "corner {corner}");
        }
    }
}
