// How far it is from each visible point, along its surface, to what stands on it or ends it, in the direction of a rank among 8.
// A density estimate of a larger radius would look past walls and over edges. Sheets that lie on the surface do not count.
// Dispatched by src/engine/scene/trial.rs once, before a run, and by src/engine/scene/radius_class.rs in its first round.
// One thread = one visible point.
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

#include "world/scene/visible_point.glsl"

struct ClearancePush {
    uint first_point;
    uint end_point;
    // Which of the distances in 8 directions is taken, in ascending order from 0.
    uint rank;
};

layout(push_constant, scalar) uniform Push { ClearancePush push; };
layout(set = 1, binding = 1, scalar) readonly buffer VisiblePoints { VisiblePoint visible_points[]; };
layout(set = 1, binding = 2, scalar) writeonly buffer Clearances { float clearances[]; };

#include "math/math.glsl"
#include "dispatch/dispatch.glsl"
#include "world/scene/effects.glsl"
#include "math/directions.glsl"
#include "world/scene/bvh.glsl"
#include "gather/belongs.glsl"

// Cosines of eighths of a circle; the sine of each is the cosine six further.
const float COSINES[8] = float[](1.0, 0.70710678, 0.0, -0.70710678, -1.0, -0.70710678, 0.0, 0.70710678);
// Of a ray's rise above the surface: low steps and a mesh's facets do not count as walls.
const float RISE = 0.1;
// Sheets that touch a surface lie no higher above it, and are no more (src/scene/contact_offsets.rs).
const float TOUCHING = 1.0 / 16384.0;
const uint TOUCHING_SHEETS = 16;
// Least cosine between the normals of two in one plane.
const float PARALLEL = 0.9999;

// How far a ray from a visible point goes to what is no sheet on its surface.
float clear_distance(VisiblePoint point, vec3 normal, float error, vec3 direction)
{
    float distance = 0.0;
    vec3 start = offset_origin(point.position, error, normal, direction);
    for (uint sheet = 0; sheet <= TOUCHING_SHEETS; sheet++) {
        Hit hit = closest_hit(start, direction);
        distance += hit.t;
        bool touches = false;
        if (HAS_LAYERS && hit.triangle != NONE) {
            uint plane = 2 * (triangles[hit.triangle].plane & ~HIDDEN);
            vec3 other = plane_normal(plane);
            touches = abs(dot(other, normal)) >= PARALLEL && abs(plane_height(plane, point.position)) <= TOUCHING;
            start = offset_origin(start + hit.t * direction, error, other, direction);
        }
        if (!touches) {
            break;
        }
    }
    return distance;
}

void main()
{
    uint index = push.first_point + invocation_index();
    if (index >= push.end_point) {
        return;
    }
    VisiblePoint point = visible_points[index];
    vec3 normal = plane_normal(point.plane);
    vec3 size = abs(point.position);
    float error = max(size.x, max(size.y, size.z)) * (1.0 / 1048576.0);
    // Ascending.
    float distances[8];
    for (uint k = 0; k < 8; k++) {
        vec3 direction = normalize(to_frame(vec3(COSINES[k], COSINES[(k + 6) % 8], RISE), normal));
        float distance = 0.0;
        if (point.arrivals != 0) {
            distance = clear_distance(point, normal, error, direction);
        }
        uint place = k;
        while (place > 0 && distances[place - 1] > distance) {
            distances[place] = distances[place - 1];
            place--;
        }
        distances[place] = distance;
    }
    clearances[index] = distances[push.rank];
}
