// Camera paths, or paths from receivers, that an earlier dispatch left on their way over mirrors and glass.
// Dispatched by src/engine/scene/points.rs until none is left. One thread = one path.
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_EXT_scalar_block_layout : require

#include "world/scene/work.glsl"
#include "rng/draws.glsl"

struct GoOnPush {
    Draws draws;
    WorkDivision work;
    // That a pixel has.
    uint most_samples;
    uint path_count;
    uint pixel_count;
    uint emitter_count;
    float film_scale;
    float film_limit;
    uint rounding;
};

layout(push_constant, scalar) uniform Push { GoOnPush push; };

#include "world/scene/camera_kernel.glsl"

layout(set = 1, binding = 11, scalar) readonly buffer CameraPaths { CameraPath camera_paths[]; };

void main()
{
    uint item = invocation_index();
    if (item >= push.path_count) {
        return;
    }
    CameraPath path = camera_paths[item];
    work = push.work;
    own = path.own;
    uint index = own.pixel;
    uint depth = path.state >> 8;
    start_chain(path.position, path.direction, path.weight);
    chain.chance = path.chance;
    chain.saw_specular = (path.state & 1u) != 0;
    chain.gathers = (path.state & 2u) != 0;
    chain.starts_nowhere = (path.state & 4u) != 0;
    chain.sees_emission = (path.state & 8u) != 0;
    chain.ends_at_light = (path.state & 64u) != 0;
    bool met_surface = (path.state & 128u) != 0;
    chain.met_surface = met_surface;
    chain.media = path.media;
    chain.density = path.density;
    chain.from = path.from;
    chain.from_normal = path.from_normal;
    chain.point_count = (path.state >> 4) & 3u;
    follow(push.pixel_count, push.draws, push.emitter_count, depth);
    note_unless(is_finite(chain.light[0]) && is_finite(chain.light[1]) && is_finite(chain.light[2]), NONFINITE_LIGHT, push.draws.domain,
                push.draws.round, index);
    note_surface(chain.met_surface && !met_surface, push.most_samples / own.count);
    float share = divide(1.0, float(own.count));
    write_pass_sum(own.place, index, push.pixel_count, chain.light, chain.seen, share * push.film_scale, share * push.film_limit, mix32(push.rounding + depth), true);
    note_nodes();
    write_missing_points(push.pixel_count);
}
