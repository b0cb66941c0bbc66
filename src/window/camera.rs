//! A camera that a person moves: around what it looks at, or as if flying.

use glam::DVec3;

use crate::scene::{Camera, Lens, Projection};

/// What moves the camera in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Motion {
    /// Around the pivot, in radians: to the right and up.
    pub orbit: [f64; 2],
    /// About the eye.
    pub turn: [f64; 2],
    /// Along the picture, in heights of it: to the right and up.
    pub shift: [f64; 2],
    /// Towards the pivot: the logarithm of the factor by which it comes nearer.
    pub approach: f64,
    /// To the right, up and forward, in metres.
    pub flight: [f64; 3],
}

/// Of a scene whose vertical is y.
#[derive(Debug, Clone)]
pub(crate) struct MovingCamera {
    pub camera: Camera,
    /// Distance of what it turns around, along the view.
    pub pivot: f64,
}

/// Of the angle between the view and the vertical: nearer, right and left would change places.
const LEAST_ANGLE: f64 = 0.02;

impl MovingCamera {
    /// Whether anything has changed.
    pub(super) fn apply(&mut self, motion: &Motion) -> bool {
        if *motion == Motion::default() {
            return false;
        }
        let Motion { orbit, turn, shift, approach, flight } = *motion;
        let target = self.camera.eye + self.pivot * self.camera.forward;
        self.rotate(orbit);
        self.camera.eye = target - self.pivot * self.camera.forward;
        self.rotate(turn);
        // What is as far away as the pivot stays under the pointer.
        let distance = if matches!(self.camera.projection, Projection::Perspective { .. }) { self.pivot } else { 1.0 };
        let height = 2.0 * self.camera.half_height() * distance;
        let Camera { right, up, forward, .. } = self.camera;
        self.camera.eye += height * (shift[0] * right + shift[1] * up);
        self.camera.eye += flight[0] * right + flight[1] * DVec3::Y + flight[2] * forward;
        let nearer = self.pivot * (-approach).exp();
        match &mut self.camera.projection {
            Projection::Perspective { .. } => self.camera.eye += (self.pivot - nearer) * forward,
            Projection::Orthographic { half_height } => *half_height *= (-approach).exp(),
        }
        if let Some(Lens { focus, .. }) = &mut self.camera.lens {
            // The plane in focus stays where it is.
            *focus = (*focus - (self.pivot - nearer)).max(1e-6 * self.pivot);
        }
        self.pivot = nearer;
        true
    }

    /// About the vertical, and up or down.
    fn rotate(&mut self, [to_right, up]: [f64; 2]) {
        if to_right == 0.0 && up == 0.0 {
            return;
        }
        let Camera { forward, right, .. } = self.camera;
        let angle = forward.angle_between(DVec3::Y);
        let up = up.clamp((angle - std::f64::consts::PI + LEAST_ANGLE).min(0.0), (angle - LEAST_ANGLE).max(0.0));
        let turned = glam::DQuat::from_axis_angle(DVec3::Y, -to_right) * glam::DQuat::from_axis_angle(right, up) * forward;
        let Camera { right, up, forward, .. } = Camera::looking_at("", DVec3::ZERO, turned, DVec3::Y, 1.0);
        (self.camera.right, self.camera.up, self.camera.forward) = (right, up, forward);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> MovingCamera {
        let camera = Camera::looking_at("c", DVec3::new(1.0, 2.0, 5.0), DVec3::new(0.0, 1.0, 0.0), DVec3::Y, 0.7);
        MovingCamera { camera, pivot: 3.0 }
    }

    fn target(moving: &MovingCamera) -> DVec3 {
        moving.camera.eye + moving.pivot * moving.camera.forward
    }

    #[test]
    fn an_orbit_keeps_the_pivot_and_its_distance() {
        let (before, mut after) = (camera(), camera());
        for orbit in [[0.3, 0.0], [0.0, 0.4], [-1.0, -0.2], [0.0, 9.0], [0.2, -9.0]] {
            assert!(after.apply(&Motion { orbit, ..Motion::default() }));
            assert!(target(&after).distance(target(&before)) < 1e-9, "{orbit:?}");
            let Camera { forward, right, up, .. } = after.camera;
            assert!(forward.dot(right).abs() < 1e-9 && forward.dot(up).abs() < 1e-9 && up.y > 0.0, "{orbit:?}");
        }
        assert!(!after.apply(&Motion::default()));
    }

    #[test]
    fn approach_and_flight_go_where_they_say() {
        let mut moving = camera();
        let before = moving.clone();
        moving.apply(&Motion { approach: 2f64.ln(), ..Motion::default() });
        assert!((moving.pivot - 1.5).abs() < 1e-12 && target(&moving).distance(target(&before)) < 1e-9);
        moving.apply(&Motion { flight: [0.0, 0.0, 0.5], ..Motion::default() });
        assert!(moving.camera.eye.distance(before.camera.eye + 2.0 * before.camera.forward) < 1e-9);
        // A shift by a whole picture brings what was at the right edge to the left one.
        let mut shifted = before.clone();
        shifted.apply(&Motion { shift: [1.0, 0.0], ..Motion::default() });
        let height = 2.0 * 3.0 * (0.35f64).tan();
        assert!(shifted.camera.eye.distance(before.camera.eye + height * before.camera.right) < 1e-9);
    }
}
