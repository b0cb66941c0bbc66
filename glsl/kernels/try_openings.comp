// Rays from points of a trial and from what these see, which tell where light from beyond the scene comes in
// (src/scene/openings.rs).
// Dispatched by src/engine/scene/opening_trial.rs before a run. One thread = two rays.
#extension GL_EXT_control_flow_attributes : require
#include "records.glsl"

layout(push_constant, scalar) uniform Push { TryOpeningsPush push; };
layout(set = 1, binding = 12, scalar) readonly buffer Receivers { Receiver receivers[]; };
layout(set = 1, binding = 0, scalar) writeonly buffer OpeningRays { OpeningRay opening_rays[]; };

#include "world/scene/rays.glsl"

void main()
{
    uint index = push.first_ray + invocation_index();
    if (index >= push.end_ray) {
        return;
    }
    Receiver receiver = receivers[index / push.rays_of_point];
    vec4 u = philox_floats(uvec4(index, 0, 0, DOMAIN_LIGHTS), push.seed);
    vec3 size = abs(receiver.position);
    // It may lie on a triangle whose corners are known no better than the point.
    float error = max(max(size.x, 0.25), max(size.y, size.z)) * (4.0 / 1048576.0);
    vec3 direction = to_frame(sample_cosine_hemisphere(u.x, u.y), receiver.normal);
    vec3 start = offset_origin(receiver.position, error, receiver.normal, direction);
    Hit hit = closest_hit(start, direction);
    bool escapes = hit.triangle == NONE;
    opening_rays[2 * index] = OpeningRay(start, direction, uint(escapes));
    if (!escapes) {
        Triangle triangle = triangles[hit.triangle];
        vec3 normal = triangle_normal(triangle);
        normal = dot(normal, direction) > 0.0 ? -normal : normal;
        direction = to_frame(sample_cosine_hemisphere(u.z, u.w), normal);
        start = offset_origin(triangle_point(triangle, hit.u, hit.v), triangle_error(triangle), normal, direction);
        escapes = closest_hit(start, direction).triangle == NONE;
    }
    opening_rays[2 * index + 1] = OpeningRay(start, direction, uint(escapes));
}
