//! Cameras of a scene, and of one's own.

use glam::DVec3;
use photonmill::scene::{self, Lens, Projection};
use pyo3::prelude::*;

use crate::error;

#[doc = doc!("Camera")]
#[pyclass(module = "photonmill", frozen)]
pub struct Camera {
    pub camera: scene::Camera,
}

type Vector = [f64; 3];

#[pymethods]
impl Camera {
    #[new]
    #[pyo3(signature = (position, target, up=[0.0, 1.0, 0.0], fov=40.0, *, aspect=None, aperture=0.0, focus=None, name="camera"))]
    #[pyo3(text_signature = "(position, target, up=(0.0, 1.0, 0.0), fov=40.0, *, aspect=None, aperture=0.0, focus=None, name='camera')")]
    #[expect(clippy::too_many_arguments, reason = "they have names in Python")]
    fn new(
        py: Python<'_>,
        position: Vector,
        target: Vector,
        up: Vector,
        fov: f64,
        aspect: Option<f64>,
        aperture: f64,
        focus: Option<f64>,
        name: &str,
    ) -> PyResult<Camera> {
        let check = |is_allowed: bool, name: &str, value: String, allowed: &str| {
            if is_allowed { Ok(()) } else { Err(error::argument(py, format!("{name}={value}: {allowed}"))) }
        };
        for (name, vector) in [("position", position), ("target", target), ("up", up)] {
            check(vector.iter().all(|value| value.abs() <= 1e15), name, format!("{vector:?}"), "must be three finite numbers, metres")?;
        }
        let [eye, to, up] = [position, target, up].map(DVec3::from);
        check(eye != to, "target", format!("{target:?}"), "must not be the position of the camera")?;
        check(up != DVec3::ZERO, "up", format!("{:?}", up.to_array()), "must have a length")?;
        check(
            fov > 0.0 && fov < 180.0,
            "fov",
            fov.to_string(),
            "must be above 0 and below 180 (degrees, from the lower to the upper edge)",
        )?;
        if let Some(aspect) = aspect {
            check((1e-4..=1e4).contains(&aspect), "aspect", aspect.to_string(), "must be from 0.0001 to 10000 (width over height)")?;
        }
        check((0.0..=1e6).contains(&aperture), "aperture", aperture.to_string(), "must be from 0 to 1e6 (diameter of the lens, metres)")?;
        if let Some(focus) = focus {
            check(focus > 0.0 && focus <= 1e12, "focus", focus.to_string(), "must be above 0 and at most 1e12 (metres)")?;
        }
        // The target is what one means to see.
        let lens = (aperture > 0.0).then(|| Lens { radius: 0.5 * aperture, focus: focus.unwrap_or_else(|| eye.distance(to)) });
        let camera = scene::Camera { lens, aspect, ..scene::Camera::looking_at(name, eye, to, up.normalize(), fov.to_radians()) };
        Ok(Camera { camera })
    }

    #[doc = doc!("Camera.name")]
    #[getter]
    fn name(&self) -> &str {
        &self.camera.name
    }

    #[doc = doc!("Camera.position")]
    #[getter]
    fn position(&self) -> (f64, f64, f64) {
        self.camera.eye.into()
    }

    #[doc = doc!("Camera.forward")]
    #[getter]
    fn forward(&self) -> (f64, f64, f64) {
        self.camera.forward.into()
    }

    #[doc = doc!("Camera.up")]
    #[getter]
    fn up(&self) -> (f64, f64, f64) {
        self.camera.up.into()
    }

    #[doc = doc!("Camera.fov")]
    #[getter]
    fn fov(&self) -> Option<f64> {
        match self.camera.projection {
            Projection::Perspective { vertical_view } => Some(vertical_view.to_degrees()),
            Projection::Orthographic { .. } => None,
        }
    }

    #[doc = doc!("Camera.aspect")]
    #[getter]
    fn aspect(&self) -> Option<f64> {
        self.camera.aspect
    }

    fn __repr__(&self) -> String {
        let ((x, y, z), (fx, fy, fz)) = (self.position(), self.forward());
        format!("Camera('{}', position=({x:.4}, {y:.4}, {z:.4}), forward=({fx:.4}, {fy:.4}, {fz:.4}))", self.camera.name)
    }
}
