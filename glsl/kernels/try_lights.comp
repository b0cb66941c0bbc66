// What each cluster of lights adds at points of a trial: the root of the mean square of some shadow rays, from which their shares
// follow (src/plan/light_choice.rs).
// Dispatched by src/engine/scene/light_trial.rs before a run. One thread = a point and a cluster.
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

#include "world/scene/receiver.glsl"
#include "rng/draws.glsl"

// What each cluster of lights adds at some points.
struct TryLightsPush {
    Draws draws;
    // Pairs of a point and a cluster, cluster by cluster of each point.
    uint first_pair;
    uint end_pair;
    uint cluster_count;
    // Shadow rays of each.
    uint ray_count;
};

layout(push_constant, scalar) uniform Push { TryLightsPush push; };
layout(set = 1, binding = 12, scalar) readonly buffer Receivers { Receiver receivers[]; };
layout(set = 1, binding = 0, scalar) writeonly buffer Found { float found[]; };

#include "world/scene/rays.glsl"
#include "rng/hash.glsl"
#include "rng/sobol.glsl"
#include "world/scene/sample_places.glsl"
#include "world/scene/samples.glsl"
#include "material/bsdf.glsl"
#include "world/scene/areas.glsl"
#include "world/scene/lights.glsl"
#include "world/scene/light_choice.glsl"
#include "world/scene/direct.glsl"

void main()
{
    uint pair = push.first_pair + invocation_index();
    if (pair >= push.end_pair) {
        return;
    }
    uint cluster = pair % push.cluster_count;
    Receiver receiver = receivers[pair / push.cluster_count];
    // It may lie on a triangle whose corners are known no better than the point.
    ShadingPoint here = receiver_at(receiver.position, 4.0 * position_error(receiver.position), receiver.normal, receiver.shading_normal);
    uvec4 words = words_of(pair, 0, push.draws);
    // Of the squares, in units of the largest.
    float largest = 0.0;
    float sum = 0.0;
    for (uint ray = 0; ray < push.ray_count; ray++) {
        vec3 u = stratified(ray, push.ray_count, words);
        ChosenLight chosen = choose_within(cluster, 1.0, here.surface.position, mix32(words.w + ray));
        Emitter light = emitters[chosen.emitter];
        light.probability = chosen.probability;
        ShadowRay shadow_ray = cast_shadow_ray(here, sample_light(light, here.surface.position, here.surface.ns, u.xy), push.draws, pair);
        float added = shadow_ray.light.x + shadow_ray.light.y + shadow_ray.light.z;
        if (shadow_ray.is_asked && !shadow_ray.is_hidden && added > 0.0) {
            float ratio = divide(min(added, largest), max(added, largest));
            sum = added > largest ? sum * ratio * ratio + 1.0 : sum + ratio * ratio;
            largest = max(largest, added);
        }
    }
    found[pair] = largest * sqrt(divide(sum, float(push.ray_count)));
}
