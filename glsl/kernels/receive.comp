// The light that arrives at given points: direct light, and a visible point for the photon maps; a point
// that lies on no surface looks around by a ray instead.
// Dispatched by src/engine/scene/points.rs once a round. One thread = one receiver.
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_EXT_scalar_block_layout : require

#include "world/scene/receiver.glsl"
#include "world/scene/work.glsl"
#include "rng/draws.glsl"

struct ReceivePush {
    Draws draws;
    WorkDivision work;
    // Hash of the seed and the round that decides what is rounded up.
    uint rounding;
    uint first_point;
    uint end_point;
    uint point_count;
    uint emitter_count;
    float film_scale;
    float film_limit;
    // Within which a surface makes a point one of its own.
    float radius;
};

layout(push_constant, scalar) uniform Push { ReceivePush push; };
layout(set = 1, binding = 12, scalar) readonly buffer Receivers { Receiver receivers[]; };

// Paths may start at receivers.
const bool HAS_RECEIVERS = true;
#include "world/scene/camera_kernel.glsl"
#include "world/scene/box_walk.glsl"
#include "world/scene/off_walls.glsl"
#include "gather/belongs.glsl"
#include "gather/cuts.glsl"
#include "gather/cover.glsl"

void main()
{
    uint index = push.first_point + invocation_index();
    if (index >= push.end_point) {
        return;
    }
    work = push.work;
    own = Sample(index, index, 0, 1);
    Receiver receiver = receivers[index];
    vec3 ng = receiver.normal;
    vec3 ns = receiver.shading_normal;
    vec3 position = off_the_walls(receiver.position, ng);
    ShadingPoint here = receiver_at(position, position_error(position), ng, ns);
    start_chain(position, ns, vec3(1.0));
    if (HAS_MEDIA) {
        chain.media = media_at(position, ng);
        here.media = chain.media;
    }
    if (HAS_SHADOW_RAYS) {
        add_light(direct_light(here, push.emitter_count, push.draws, index, 0, RECEIVER_BLOCK));
        note_shadow_rays(index, vec3(1.0));
    }
    // Photons only ever land on surfaces, and give the irradiance of those: any other point, or direction, looks
    // around.
    uint plane = plane_below(receiver.position, ng, push.radius);
    bool on_surface = plane != NONE;
    if (!on_surface) {
        note_hit(index, HIT_OFF_SURFACE);
    }
    bool gathers = GATHER_RAYS == GATHER_ALL || !on_surface;
    if (on_surface) {
        uint arrivals = arrivals_wanted(gathers);
        vec3 on_plane = receiver.position - plane_height(plane, receiver.position) * planes[plane >> 1].xyz;
        visible_points[place_of_point(chain.point_count++, own.place, push.point_count)] =
            VisiblePoint(on_plane, plane, vec3(1.0), ns == ng ? NONE : pack_normal(ns), 0, 0.0, SURFACE_RECEIVER, arrivals | SEEN);
    }
    if (gathers) {
        // Irradiance is pi times the radiance that arrives from cosine-weighted directions.
        vec3 u = philox_floats(uvec4(index, push.draws.round, 0, push.draws.domain), push.draws.seed).xyz;
        chain.direction = to_frame(sample_cosine_hemisphere(u.y, u.z), ns);
        chain.position = offset_origin(position, here.surface.error, ng, chain.direction);
        chain.weight = vec3(3.14159265358979324);
        chain.role = on_surface ? ROLE_GATHER : ROLE_GATHER_IN_AIR;
        // Neither shadow rays nor photons know what light arrives at a point in the air, where the maps are to hold it.
        chain.sees_emission = HAS_ALL_ARRIVALS && !on_surface;
        follow(push.point_count, push.draws, push.emitter_count, 0);
    }
    note_unless(is_finite(chain.light[0]) && is_finite(chain.light[1]) && is_finite(chain.light[2]), NONFINITE_LIGHT, push.draws.domain,
                push.draws.round, index);
    write_pass_sum(index, index, push.point_count, chain.light, chain.seen, push.film_scale, push.film_limit, push.rounding, false);
    note_nodes();
    write_missing_points(push.point_count);
}
