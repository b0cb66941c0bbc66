// The light that arrives at given points: direct light, and a visible point for the photon maps; a point
// that lies on no surface looks around by a ray instead.
// Dispatched by src/transport/points.rs once a pass. One thread = one receiver.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "records.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { ReceivePush push; };
layout(set = 0, binding = 8, scalar) readonly buffer Receivers { Receiver receivers[]; };

#include "math.glsl"
#include "oddities.glsl"
#include "dispatch.glsl"
#include "philox.glsl"
#include "sobol.glsl"
#include "sampling.glsl"
#include "scene/effects.glsl"
#include "scene/samples.glsl"
#include "scene/directions.glsl"
#include "scene/bvh.glsl"
#include "scene/surface.glsl"
#include "scene/lobes.glsl"
#include "scene/scatter.glsl"
#include "scene/areas.glsl"
#include "scene/lights.glsl"
#include "scene/direct.glsl"
#include "scene/belongs.glsl"
#include "scene/cover.glsl"
#include "film/wide.glsl"
#include "scene/film.glsl"
#include "scene/no_point.glsl"
#include "scene/one_hit.glsl"
#include "stages/visible_point.glsl"
#include "stages/chain.glsl"

// A degree: what single precision and the facets of a fine mesh may turn a normal by.
const float RECEIVER_NORMAL_COSINE = 0.99985;

void main()
{
    uint index = push.first_point + invocation_index();
    if (index >= push.end_point) {
        return;
    }
    Receiver receiver = receivers[index];
    vec3 ng = receiver.normal;
    vec3 ns = receiver.shading_normal;
    Target here = Target(receiver.position, position_error(receiver.position), ng, ns, ns, SURFACE_RECEIVER, 0.0);
    Chain chain = new_chain(receiver.position, ns, vec3(1.0), vec2(0.0));
    if (SHADOW_RAYS != 0) {
        add_light(chain, direct_light(here, push.emitter_count, push.draws, index, 0, 1 + VERTEX_BLOCKS * MAX_CHAIN));
        note_shadow_rays(index, vec3(1.0));
    }
    // Photons only ever land on surfaces, and tell the irradiance of those: any other point, or direction, looks
    // around.
    bool whole;
    float covered = covered_area(receiver.position, ng, push.radius, RECEIVER_NORMAL_COSINE, whole);
    note_unless(is_finite(covered), ODD_LIGHT, push.draws.domain, push.draws.round, index);
    bool on_surface = covered > 0.0;
    bool gathers = GATHER_RAYS == GATHER_ALL || !on_surface;
    if (on_surface) {
        uint arrivals = arrivals_wanted(chain, gathers);
        chain.points[chain.point_count++] =
            VisiblePoint(receiver.position, pack_normal(ng), vec3(1.0), pack_normal(ns), 0, 0.0, SURFACE_RECEIVER, arrivals);
    }
    if (gathers) {
        // Irradiance is pi times the radiance that arrives from cosine-weighted directions.
        vec3 u = philox_floats(uvec4(index, push.draws.round, 0, push.draws.domain), push.draws.seed).xyz;
        chain.direction = to_frame(sample_cosine_hemisphere(u.y, u.z), ns);
        chain.position = offset_origin(receiver.position, here.error, ng, chain.direction);
        chain.weight = vec3(3.14159265358979324);
        chain.gathers = true;
        chain.starts_nowhere = !on_surface;
        // Neither shadow rays nor photons know what shines on a point in the air, where the maps are to hold it.
        chain.sees_emission = false;
        if (HAS_ALL_ARRIVALS) {
            chain.sees_emission = !on_surface;
        }
        follow(chain, index, 0, push.draws, push.emitter_count);
    }
    note_unless(is_finite(chain.light[0]) && is_finite(chain.light[1]) && is_finite(chain.light[2]), ODD_LIGHT, push.draws.domain,
                push.draws.round, index);
    write_pass_sum(index, chain.light, push.film_scale, push.film_limit);
    write_points(chain, index, 0, push.point_count);
}
