//! Where a path leaves a convex room. Twin of `glsl/room.glsl`, which explains it.

use glam::Vec3;

use crate::records::Room;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    pub position: Vec3,
    pub wall: u32,
}

pub fn intersect_room(room: &Room, position: Vec3, direction: Vec3, on_wall: u32) -> Hit {
    let mut distances = [f32::INFINITY; 3];
    for axis in 0..3 {
        let d = direction[axis];
        let plane = if d > 0.0 { room.max_corner[axis] } else { room.min_corner[axis] };
        let leaves_own_wall = on_wall == 2 * axis as u32 + u32::from(d > 0.0);
        if d != 0.0 && !leaves_own_wall {
            distances[axis] = (plane - position[axis]) / d;
        }
    }
    let axis = if distances[1] < distances[0] { 1 } else { 0 };
    let axis = if distances[2] < distances[axis] { 2 } else { axis };
    let positive = direction[axis] > 0.0;

    let mut end = (position + distances[axis] * direction).max(room.min_corner).min(room.max_corner);
    end[axis] = if positive { room.max_corner[axis] } else { room.min_corner[axis] };
    Hit { position: end, wall: 2 * axis as u32 + u32::from(positive) }
}
