//! Cameras: pinholes and thin lenses, in perspective or orthographic.

use glam::{DVec2, DVec3};

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Angle between the picture's lower and upper edge, radians.
    Perspective { vertical_view: f64 },
    /// Rays are parallel; metres from the picture's middle to its upper edge.
    Orthographic { half_height: f64 },
}

/// What lies further or nearer than the plane in focus is blurred.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Metres.
    pub radius: f64,
    /// Distance of that plane along the view, metres.
    pub focus: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    pub name: String,
    /// Metres.
    pub eye: DVec3,
    /// Unit vectors: where it looks, and its picture's right and up.
    pub forward: DVec3,
    pub right: DVec3,
    pub up: DVec3,
    pub projection: Projection,
    pub lens: Option<Lens>,
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
        let projection = Projection::Perspective { vertical_view };
        Camera { name: name.to_owned(), eye, forward, right, up: right.cross(forward), projection, lens: None, aspect: None }
    }

    pub fn with_aspect(self, aspect: f64) -> Camera {
        Camera { aspect: Some(aspect), ..self }
    }

    /// A camera in front of the scene (towards +z) that sees all of a box in a picture of this width over height.
    pub fn around(min: DVec3, max: DVec3, aspect: f64) -> Camera {
        let vertical_view: f64 = 40f64.to_radians();
        let centre = 0.5 * (min + max);
        let radius = 0.5 * (max - min).length();
        let direction = DVec3::new(0.35, 0.3, 1.0).normalize();
        // The lesser half of the angles that the picture shows.
        let half_view = ((0.5 * vertical_view).tan() * aspect.min(1.0)).atan();
        let distance = 1.05 * radius / half_view.sin();
        Camera::looking_at("default", centre + distance * direction, centre, DVec3::Y, vertical_view)
    }

    /// Half the picture's height: metres at a distance of 1 m, or of all rays where they are parallel.
    pub fn half_height(&self) -> f64 {
        match self.projection {
            Projection::Perspective { vertical_view } => (0.5 * vertical_view).tan(),
            Projection::Orthographic { half_height } => half_height,
        }
    }

    /// Start and unit direction of the ray through a point of the picture, both coordinates from -1 to 1, y up, and through a point
    /// of the lens, in parts of its radius.
    pub fn ray(&self, x: f64, y: f64, aspect: f64, on_lens: DVec2) -> (DVec3, DVec3) {
        let across = self.half_height() * (x * aspect * self.right + y * self.up);
        let (origin, way) = match self.projection {
            Projection::Perspective { .. } => (self.eye, self.forward + across),
            Projection::Orthographic { .. } => (self.eye + across, self.forward),
        };
        let Some(lens) = self.lens else { return (origin, way.normalize()) };
        let start = lens.radius * (on_lens.x * self.right + on_lens.y * self.up);
        (origin + start, (lens.focus * way - start).normalize())
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
        for (aspect, corner) in [0.1, 0.5, 1.0, 3.0].into_iter().flat_map(|aspect| (0..8).map(move |corner| (aspect, corner))) {
            let camera = Camera::around(min, max, aspect);
            let side = |axis: usize| if corner >> axis & 1 == 1 { max[axis] } else { min[axis] };
            let to = DVec3::new(side(0), side(1), side(2)) - camera.eye;
            let place = DVec2::new(to.dot(camera.right) / aspect, to.dot(camera.up)) / to.dot(camera.forward) / camera.half_height();
            assert!(place.abs().max_element() < 1.0, "aspect {aspect}, corner {corner}: {place}");
        }
    }

    /// All rays through one point of the picture meet in the plane in focus.
    #[test]
    fn lenses_focus_on_a_plane() {
        for projection in [Projection::Perspective { vertical_view: 1.0 }, Projection::Orthographic { half_height: 2.0 }] {
            let camera = Camera::looking_at("c", DVec3::ONE, DVec3::new(4.0, 2.0, -1.0), DVec3::Y, 1.0);
            let camera = Camera { projection, lens: Some(Lens { radius: 0.2, focus: 3.0 }), ..camera };
            let meets = |on_lens: DVec2| {
                let (origin, direction) = camera.ray(0.4, -0.7, 1.5, on_lens);
                origin + direction * ((3.0 - (origin - camera.eye).dot(camera.forward)) / direction.dot(camera.forward))
            };
            let through_middle = meets(DVec2::ZERO);
            for on_lens in [DVec2::X, DVec2::NEG_Y, DVec2::new(0.5, 0.5)] {
                assert!(meets(on_lens).distance(through_middle) < 1e-12, "{projection:?}");
            }
            let pinhole = Camera { lens: None, ..camera.clone() };
            let (origin, direction) = pinhole.ray(0.4, -0.7, 1.5, DVec2::ONE);
            assert!((through_middle - origin).normalize().distance(direction) < 1e-12);
        }
    }
}
