// Rays from points of a trial and from what these see: they show where light from beyond the scene comes in
// (src/scene/openings.rs), and which places light the points (src/engine/scene/light_trial.rs).
// Dispatched by src/engine/scene/trial_rays.rs before a run. One thread = two rays.
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

#include "world/scene/receiver.glsl"

// A ray of a trial, and the place that it meets with the normal of its side.
struct TrialRay {
    vec3 origin;
    vec3 direction;
    vec3 met;
    vec3 normal;
    // 1: it leaves the scene, and meets nothing.
    uint escapes;
};

struct TrialRaysPush {
    uvec2 seed;
    uint first_ray;
    uint end_ray;
    uint rays_of_point;
};

layout(push_constant, scalar) uniform Push { TrialRaysPush push; };
layout(set = 1, binding = 12, scalar) readonly buffer Receivers { Receiver receivers[]; };
layout(set = 1, binding = 0, scalar) writeonly buffer TrialRays { TrialRay trial_rays[]; };

#include "world/scene/rays.glsl"

void main()
{
    uint index = push.first_ray + invocation_index();
    if (index >= push.end_ray) {
        return;
    }
    Receiver receiver = receivers[index / push.rays_of_point];
    vec4 u = philox_floats(uvec4(index, 0, 0, DOMAIN_LIGHTS), push.seed);
    vec3 position = receiver.position;
    vec3 normal = receiver.normal;
    vec3 size = abs(position);
    // It may lie on a triangle whose corners are known no better than the point.
    float error = max(max(size.x, 0.25), max(size.y, size.z)) * (4.0 / 1048576.0);
    for (uint bounce = 0; bounce < 2; bounce++) {
        vec3 direction = bounce == 0 ? to_frame(sample_cosine_hemisphere(u.x, u.y), normal)
                                     : to_frame(sample_cosine_hemisphere(u.z, u.w), normal);
        vec3 start = offset_origin(position, error, normal, direction);
        Hit hit = closest_hit(start, direction);
        bool escapes = hit.triangle == NONE;
        if (!escapes) {
            Triangle triangle = triangles[hit.triangle];
            normal = triangle_normal(triangle);
            normal = dot(normal, direction) > 0.0 ? -normal : normal;
            position = triangle_point(triangle, hit.u, hit.v);
            error = triangle_error(triangle);
        }
        // A ray that leaves counts for the one that would begin where it ends.
        for (uint place = bounce; place < (escapes ? 2 : bounce + 1); place++) {
            trial_rays[2 * index + place] = TrialRay(start, direction, position, normal, uint(escapes));
        }
        if (escapes) {
            return;
        }
    }
}
