//! Lights without geometry, and cameras.

use std::f32::consts::FRAC_PI_2;

use glam::{DMat4, DVec3, Vec3};
use gltf::khr_lights_punctual::Kind;

use super::{Loader, named, printable};
use crate::error::Result;
use crate::scene::light::{Light, LightKind};
use crate::scene::{Camera, Projection};

/// What angles in radians that were written as decimals are off.
const ROUNDED: f32 = 1e-4;

/// Share of a sharp cone that is fully lit.
const SHARP: f32 = 0.999;

impl Loader {
    pub(super) fn read_camera(&mut self, camera: &gltf::Camera, node: &gltf::Node, to_world: DMat4) {
        let name = named("camera", node.name().or(camera.name()), camera.index());
        let owner = format!("camera '{name}'");
        let (projection, aspect) = match camera.projection() {
            gltf::camera::Projection::Perspective(perspective) => {
                let vertical_view = perspective.yfov();
                // Within the angles for which a pinhole picture means something.
                if !(0.002..3.12).contains(&vertical_view) {
                    self.leave_out(format!("a camera with a vertical view of {vertical_view} radians"), &owner);
                    return;
                }
                (Projection::Perspective { vertical_view: vertical_view.into() }, perspective.aspect_ratio())
            }
            gltf::camera::Projection::Orthographic(orthographic) => {
                // A sign turns the picture over, and means no more than its size to most writers.
                let (x, y) = (orthographic.xmag().abs(), orthographic.ymag().abs());
                if !(x.is_normal() && y.is_normal()) {
                    self.leave_out(format!("an orthographic camera of {x} by {y} metres"), &owner);
                    return;
                }
                // Nodes scale what it sees.
                let scale = to_world.transform_vector3(DVec3::Y).length();
                (Projection::Orthographic { half_height: f64::from(y) * scale }, Some(x / y))
            }
        };
        let eye = to_world.transform_point3(DVec3::ZERO);
        // Added to a place that is far away it would be lost.
        let forward = to_world.transform_vector3(DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
        let up = to_world.transform_vector3(DVec3::Y);
        // Where the file leaves the aspect open, so does the camera.
        let is_usable = |aspect: &f32| aspect.is_finite() && *aspect > 0.0;
        if let Some(aspect) = aspect.filter(|aspect| !is_usable(aspect)) {
            self.leave_out(format!("an aspect ratio of {aspect}"), &owner);
        }
        let camera = Camera::looking_at(&name, DVec3::ZERO, forward, up, 1.0);
        self.scene.cameras.push(Camera { eye, projection, aspect: aspect.filter(is_usable).map(f64::from), ..camera });
    }

    pub(super) fn read_light(&mut self, light: &gltf::khr_lights_punctual::Light, node: &str, to_world: DMat4) -> Result<()> {
        let what = format!("light {}", light.name().map(printable).map_or_else(|| format!("of {node}"), |name| format!("'{name}'")));
        let strength = Vec3::from(light.color()) * light.intensity() * self.unit;
        let reason = || format!("has the intensity {} and colour {:?}; both must be 0 or more", light.intensity(), light.color());
        self.require(strength.is_finite() && strength.min_element() >= 0.0, &what, reason)?;
        if light.range().is_some() {
            self.leave_out("ranges of lights (they reach as far as light does)", &what);
        }
        let position = to_world.transform_point3(DVec3::ZERO);
        let direction = to_world.transform_vector3(DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
        let kind = match light.kind() {
            Kind::Point => LightKind::Point { position, intensity: strength },
            Kind::Directional => LightKind::Directional { direction, irradiance: strength },
            Kind::Spot { inner_cone_angle, outer_cone_angle } => {
                let are_angles = inner_cone_angle >= 0.0 && outer_cone_angle >= 0.0;
                self.require(are_angles, &what, || {
                    format!("has cones of {inner_cone_angle} and {outer_cone_angle} radians; both must be 0 or more")
                })?;
                let outer_angle = outer_cone_angle.min(FRAC_PI_2);
                if outer_cone_angle > FRAC_PI_2 + ROUNDED {
                    self.leave_out("what is wider than half pi of the outer cones of spot lights", &what);
                }
                if outer_angle == 0.0 {
                    self.leave_out("spot lights whose outer cone is 0 (they light nothing)", &what);
                    return Ok(());
                }
                // glTF wants the inner one smaller; Blender writes both alike for a sharp edge.
                let inner_angle = if inner_cone_angle < outer_angle { inner_cone_angle } else { SHARP * outer_angle };
                LightKind::Spot { position, direction, intensity: strength, inner_angle, outer_angle }
            }
        };
        if strength.max_element() > 0.0 {
            self.scene.lights.push(Light { name: what, kind });
        }
        Ok(())
    }
}
