//! Where a path leaves a convex room. Twin of `glsl/world/room/geometry.glsl`, which explains it.

use glam::{BVec3, Vec3};

use crate::records::Room;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hit {
    pub position: Vec3,
    pub wall: u32,
}

/// Without a branch or an index that depends on the path, so that loops over paths become vectors.
#[inline(always)]
pub(crate) fn intersect_room(room: &Room, position: Vec3, direction: Vec3, on_wall: u32) -> Hit {
    let forward = direction.cmpgt(Vec3::ZERO);
    let planes = Vec3::select(forward, room.max_corner, room.min_corner);
    let [x, y, z] = [u32::from(forward.x), 2 + u32::from(forward.y), 4 + u32::from(forward.z)];
    let leaves_own_wall = BVec3::new(on_wall == x, on_wall == y, on_wall == z);
    let meets = direction.cmpne(Vec3::ZERO) & !leaves_own_wall;
    let distances = Vec3::select(meets, (planes - position) / direction, Vec3::INFINITY);

    let y_is_nearer = distances.y < distances.x;
    let (nearest, wall) = if y_is_nearer { (distances.y, y) } else { (distances.x, x) };
    let z_is_nearest = distances.z < nearest;
    let (nearest, wall) = if z_is_nearest { (distances.z, z) } else { (nearest, wall) };

    let end = (position + nearest * direction).max(room.min_corner).min(room.max_corner);
    let on_plane = BVec3::new(!y_is_nearer & !z_is_nearest, y_is_nearer & !z_is_nearest, z_is_nearest);
    Hit { position: Vec3::select(on_plane, planes, end), wall }
}

/// Tangent, bitangent and normal of a wall, into the room: the two axes after its own, and that.
#[inline(always)]
pub(crate) fn wall_frame(wall: u32) -> [Vec3; 3] {
    let is_own = [wall / 2 == 0, wall / 2 == 1, wall / 2 == 2].map(|own| if own { 1.0 } else { 0.0 });
    let [x, y, z] = is_own;
    let inward = if wall % 2 == 1 { -1.0 } else { 1.0 };
    [Vec3::new(z, x, y), Vec3::new(y, z, x), Vec3::new(x, y, z) * inward]
}
