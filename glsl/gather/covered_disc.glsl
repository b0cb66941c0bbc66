// How much of a disc lies on its wall, edges and corners counted out. Twin of src/cpu/nearest.rs; in f64 it is
// src/scene/rectangle.rs.

#include "world/room/walls.glsl"

// Area of the unit disc within 0 <= x <= a, 0 <= y <= b, for a and b up to 1: a rectangle; or, where the circle
// cuts its corner off, the triangles and the sector of the circle that are left.
float quadrant_area(float a, float b)
{
    if (a * a + b * b <= 1.0) {
        return a * b;
    }
    float x = sqrt(max(1.0 - b * b, 0.0));
    float y = sqrt(max(1.0 - a * a, 0.0));
    return 0.5 * (a * y + b * x + atan(b, x) - atan(y, a));
}

// Area on its wall of the disc around a point of the room's wall, in squares of the radius: pi where all of it is.
float covered_disc(vec3 position, uint wall, float radius, Room room)
{
    uint s = (wall / 2 + 1) % 3, t = (wall / 2 + 2) % 3;
    float scale = divide(1.0, radius);
    float left = min((position[s] - room.min_corner[s]) * scale, 1.0);
    float right = min((room.max_corner[s] - position[s]) * scale, 1.0);
    float below = min((position[t] - room.min_corner[t]) * scale, 1.0);
    float above = min((room.max_corner[t] - position[t]) * scale, 1.0);
    return quadrant_area(left, below) + quadrant_area(left, above) + quadrant_area(right, below) + quadrant_area(right, above);
}
