// What belongs to a density estimate, and how much it weighs.
//
// Only planes decide what belongs: that of the visible point, and that of a photon or a triangle. So photons are counted
// on the very surfaces whose area is.

// Unit normal n of the front, and what makes n . p + offset = 0: one load each. The last one has, as bits, the number of the first plane
// that only sheets of points in the air lie in (src/scene/sensors.rs).
layout(set = 0, binding = 9, scalar) readonly buffer Planes { vec4 planes[]; };

// Least cosine between normals: 41 degrees take in the facets of a curved surface, no box's corner.
const float MIN_NORMAL_COSINE = 0.75;

// What rounding adds to the height of a point over its own plane: 8 units in the last place of a coordinate of 0.5, where
// scenes end. Sheets twice as close are one surface (src/scene/overlap.rs).
const float HEIGHT_ERROR = 1.0 / 4194304.0;

// Unit normal on the side that is meant.
vec3 plane_normal(uint plane)
{
    vec3 normal = planes[plane >> 1].xyz;
    return (plane & 1u) != 0 ? -normal : normal;
}

// Height of a point over a plane's front.
float plane_height(uint plane, vec3 position)
{
    vec4 front = planes[plane >> 1];
    return front.x * position.x + front.y * position.y + front.z * position.z + front.w;
}

// Whether a plane at height `height` below the middle of an estimate, with normal `other`, may carry photons that count.
// On a smooth surface heights grow with the sine of the angle between the normals; a parallel plane further off is another
// surface (a thin wall's other side, a rug's floor).
bool belongs(vec3 normal, vec3 other, float height, float radius)
{
    return dot(normal, other) >= MIN_NORMAL_COSINE && abs(height) <= radius * norm(cross(normal, other)) + HEIGHT_ERROR;
}

// Whether one of two planes, with their sides, is that of points in the air: such a sheet goes over into no other surface.
bool are_apart(uint plane, uint other)
{
    if (HAS_PASSING) {
        uint first = floatBitsToUint(planes[planes.length() - 1].x);
        return plane != other && max(plane, other) >> 1 >= first;
    }
    return false;
}

// Weight of a photon at the squared share `s` of the radius.
float kernel_weight(float s)
{
    if (KERNEL == KERNEL_BOX) {
        return 1.0;
    }
    if (KERNEL == KERNEL_CONE) {
        return 1.0 - sqrt(s);
    }
    return 1.0 - s;
}
