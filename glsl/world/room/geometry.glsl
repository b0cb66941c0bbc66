// The wall that a path meets next. Twin of src/cpu/room.rs.

struct Hit {
    vec3 position;
    uint wall;
};

// No epsilon, in any unit: the face that the path stands on is left out by its number when the path
// points out of it, the hit coordinate is set to the plane and the others are clamped to the room,
// so that no path can leak or hit its own wall.
Hit intersect_room(Room room, vec3 position, vec3 direction, uint on_wall)
{
    const float infinity = uintBitsToFloat(0x7f800000u);
    precise vec3 distances;
    for (uint axis = 0; axis < 3; axis++) {
        float d = direction[axis];
        float plane = d > 0.0 ? room.max_corner[axis] : room.min_corner[axis];
        bool leaves_own_wall = on_wall == 2 * axis + (d > 0.0 ? 1 : 0);
        distances[axis] = d == 0.0 || leaves_own_wall ? infinity : divide(plane - position[axis], d);
    }
    uint axis = distances.y < distances.x ? 1 : 0;
    axis = distances.z < distances[axis] ? 2 : axis;
    bool positive = direction[axis] > 0.0;

    precise vec3 end = position + distances[axis] * direction;
    end = min(max(end, room.min_corner), room.max_corner);
    end[axis] = positive ? room.max_corner[axis] : room.min_corner[axis];
    return Hit(end, 2 * axis + (positive ? 1 : 0));
}
