//! Plates of many materials in one picture, each with a pixel of its own: they lie in faces of one convex body, so that none sees
//! another.

use super::prelude::*;
use super::rendered::{scene_of, seen};

/// Cosines between the normals of the plates of each row and the way to the eye.
pub const COSINES: [f64; 5] = [1.0, 0.8, 0.5, 0.2, 0.05];

/// From one row or column to the next, two pixels, of which a plate takes three quarters.
const PITCH: f64 = 1.0 / 16.0;
/// So far off that all of a plate is seen from one direction.
const EYE: DVec3 = DVec3::new(0.0, 0.0, 128.0);

/// Where a plate is. The plates of a row lie in one plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    row: usize,
    column: usize,
    middle: DVec3,
    /// Along its texture coordinates.
    pub x: DVec3,
    pub y: DVec3,
    pub normal: DVec3,
    /// Towards the eye.
    pub wo: DVec3,
}

impl Place {
    /// Somewhere else, with this normal.
    pub fn of_normal(normal: DVec3, wo: DVec3) -> Place {
        let (x, y) = normal.any_orthonormal_pair();
        Place { row: 0, column: 0, middle: DVec3::ZERO, x, y, normal, wo }
    }
}

pub struct Plates {
    pub scene: Scene,
    columns: usize,
    pub places: Vec<Place>,
}

impl Plates {
    /// With room for so many plates in each row.
    pub fn new(columns: usize, lights: Vec<LightKind>) -> Plates {
        Plates { scene: scene_of(Vec::new(), Vec::new(), lights), columns, places: Vec::new() }
    }

    /// A plate in the next free column of a row, and its mesh.
    pub fn add(&mut self, row: usize, material: Material) -> (Place, &mut Mesh) {
        let column = self.places.iter().filter(|place| place.row == row).count();
        assert!(column < self.columns, "there is room for {} plates", self.columns);
        let place = place(row, column as f64 + 0.5 - 0.5 * self.columns as f64, column);
        let width = 0.75 * PITCH * (1.0 - place.middle.z / EYE.z);
        let (u, v) = (width * place.x, width / place.normal.dot(place.wo) * place.y);
        self.scene.materials.push(material);
        self.scene.meshes.push(Mesh::parallelogram("plate", place.middle - 0.5 * (u + v), u, v, self.scene.materials.len() - 1));
        self.places.push(place);
        (place, self.scene.meshes.last_mut().expect("one was added"))
    }

    /// Means and standard errors of what is seen in the middle of each plate, in the order in which they were added.
    pub fn seen(&self, gpu: &Gpu, settings: &SceneSettings) -> (Vec<DVec3>, Vec<DVec3>) {
        let size = [2 * self.columns - 1, 2 * COSINES.len() - 1];
        let half_height = 0.25 * PITCH * size[1] as f64;
        let camera = Camera::looking_at("eye", EYE, DVec3::ZERO, DVec3::Y, 2.0 * (half_height / EYE.z).atan());
        let result = seen(gpu, &self.scene, settings, &camera, size.map(|pixels| pixels as u32));
        let pixels = || self.places.iter().map(|place| (size[1] - 1 - 2 * place.row) * size[0] + 2 * place.column);
        (pixels().map(|at| result.film.mean(at)).collect(), pixels().map(|at| result.film.standard_error(at)).collect())
    }
}

/// Each row leans further back than the one below it, and begins where that ends, as the eye sees it.
fn place(row: usize, aside: f64, column: usize) -> Place {
    let mut edge = DVec3::Y * (-0.5 * PITCH * COSINES.len() as f64);
    for (k, cosine) in COSINES.into_iter().enumerate() {
        let seen_at = |share: f64| PITCH * (k as f64 + share - 0.5 * COSINES.len() as f64);
        let (sin, cos) = (cosine.acos() + (-seen_at(0.5)).atan2(EYE.z)).sin_cos();
        let y = DVec3::new(0.0, cos, -sin);
        // Where the plane is seen at a height on the picture through the origin.
        let at = |height: f64| edge + y * ((height * (EYE.z - edge.z) - edge.y * EYE.z) / (EYE.z * cos - height * sin));
        if k == row {
            let middle = at(seen_at(0.5));
            let middle = middle + DVec3::X * (aside * PITCH * (1.0 - middle.z / EYE.z));
            return Place { row, column, middle, x: DVec3::X, y, normal: DVec3::new(0.0, sin, cos), wo: (EYE - middle).normalize() };
        }
        edge = at(seen_at(1.0));
    }
    panic!("there are {} rows", COSINES.len())
}
