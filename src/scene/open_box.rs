//! The paper's scene (section 4.1): a cube open towards +z, with a disc of light flush in the centre
//! of the floor and of the left wall.

use glam::DVec3;

use super::room::{DiscLight, RoomScene, Wall};
use crate::settings::{HALF_WIDTH, RoomSettings, WALL_NAMES};

/// Face numbers of the two lit walls, in the order in which photons are dealt out.
const LIT_FACES: [usize; 2] = [2, 0];

pub(crate) fn open_box(settings: &RoomSettings) -> RoomScene {
    let wall = |face: usize| Wall { name: WALL_NAMES[face], albedo: settings.reflectance, shininess: settings.shininess[face] };
    RoomScene {
        name: "open-box",
        min_corner: DVec3::splat(-HALF_WIDTH),
        max_corner: DVec3::splat(HALF_WIDTH),
        faces: std::array::from_fn(|face| (face < WALL_NAMES.len()).then(|| wall(face))),
        lights: LIT_FACES
            .iter()
            .zip(settings.light_power)
            .map(|(&face, power)| DiscLight { face, radius: settings.light_radius, power })
            .collect(),
    }
}
