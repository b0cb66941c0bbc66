//! The paper's kind of scene: a convex room of walls, and discs of light flush with them. Such a room
//! needs no search for the nearest surface.

use glam::{DVec3, Vec3};

use crate::constants::{FACE_COUNT, NO_WALL};
use crate::records;
use crate::scene::rectangle::Rectangle;

/// An axis-aligned convex room whose faces are walls or openings, with lights in its walls.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RoomScene {
    pub name: &'static str,
    pub min_corner: DVec3,
    pub max_corner: DVec3,
    /// Face 2 * axis + (1 on the positive side); `None` is an opening.
    pub faces: [Option<Wall>; FACE_COUNT as usize],
    pub lights: Vec<DiscLight>,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Wall {
    pub name: &'static str,
    /// Share of arriving light that is reflected.
    pub albedo: f32,
    /// Phong exponent; `None` is Lambertian.
    pub shininess: Option<f32>,
}

/// A disc of light that neither blocks nor changes its wall.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DiscLight {
    /// Face in whose centre the disc lies.
    pub face: usize,
    /// Metres.
    pub radius: f64,
    /// Watts.
    pub power: f64,
}

/// Axis (0 to 2) of a face and the sign of its side.
pub(crate) fn face_axis(face: usize) -> (usize, f64) {
    (face / 2, if face % 2 == 1 { 1.0 } else { -1.0 })
}

impl RoomScene {
    /// The walls with their face numbers, openings left out.
    pub(crate) fn walls(&self) -> impl Iterator<Item = (usize, &Wall)> {
        self.faces.iter().enumerate().filter_map(|(face, wall)| wall.as_ref().map(|wall| (face, wall)))
    }

    /// A face as a rectangle: u and v follow the two axes after the face's own, cyclically.
    pub(crate) fn rectangle(&self, face: usize) -> Rectangle {
        let (axis, sign) = face_axis(face);
        let extent = self.max_corner - self.min_corner;
        let mut origin = self.min_corner;
        if sign > 0.0 {
            origin[axis] = self.max_corner[axis];
        }
        let along = |axis: usize| DVec3::AXES[axis] * extent[axis];
        Rectangle { origin, u: along((axis + 1) % 3), v: along((axis + 2) % 3) }
    }

    pub(crate) fn room_record(&self) -> records::Room {
        records::Room { min_corner: self.min_corner.as_vec3(), max_corner: self.max_corner.as_vec3() }
    }

    pub(crate) fn wall_records(&self) -> Vec<records::Wall> {
        self.faces
            .iter()
            .enumerate()
            .map(|(face, wall)| {
                let (axis, sign) = face_axis(face);
                records::Wall {
                    normal: Vec3::AXES[axis] * -sign as f32,
                    tangent: Vec3::AXES[(axis + 1) % 3],
                    bitangent: Vec3::AXES[(axis + 2) % 3],
                    albedo: wall.as_ref().map_or(0.0, |wall| wall.albedo),
                    shininess: wall.as_ref().and_then(|wall| wall.shininess).unwrap_or(-1.0),
                    is_open: u32::from(wall.is_none()),
                }
            })
            .collect()
    }

    /// One record a light; `relative_flux` is that of each of its photons.
    pub(crate) fn light_records(&self, relative_flux: &[f32]) -> Vec<records::DiscLight> {
        self.lights
            .iter()
            .zip(relative_flux)
            .map(|(light, flux)| records::DiscLight {
                centre: self.rectangle(light.face).centre().as_vec3(),
                radius: light.radius as f32,
                wall: light.face as u32,
                flux: *flux,
            })
            .collect()
    }
}

const _: () = assert!(NO_WALL > FACE_COUNT);
