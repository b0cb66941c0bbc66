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

// Paths may start at receivers.
const bool HAS_RECEIVERS = true;
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
    uint depth = take_up(path);
    uint index = own.pixel;
    bool met_surface = chain.met_surface;
    follow(push.pixel_count, push.draws, push.emitter_count, depth);
    note_unless(is_finite(chain.light[0]) && is_finite(chain.light[1]) && is_finite(chain.light[2]), NONFINITE_LIGHT, push.draws.domain,
                push.draws.round, index);
    note_surface(chain.met_surface && !met_surface, push.most_samples / own.count);
    float share = divide(1.0, float(own.count));
    write_pass_sum(own.place, index, push.pixel_count, chain.light, chain.seen, share * push.film_scale, share * push.film_limit, mix32(push.rounding + depth), true);
    note_nodes();
    write_missing_points(push.pixel_count);
}
