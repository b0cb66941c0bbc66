// Camera paths, or paths from receivers, that an earlier dispatch left on their way over mirrors and glass.
// Dispatched by src/engine/scene/points.rs until none is left. One thread = one path.
#version 460
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "records.glsl"

layout(push_constant, scalar) uniform Push { GoOnPush push; };
layout(set = 1, binding = 11, scalar) readonly buffer CameraPaths { CameraPath camera_paths[]; };

#include "math/math.glsl"
#include "ledger/nonfinite_values.glsl"
#include "dispatch/dispatch.glsl"
#include "rng/philox.glsl"
#include "rng/sobol.glsl"
#include "rng/sampling.glsl"
#include "world/scene/effects.glsl"
#include "world/scene/samples.glsl"
#include "math/directions.glsl"
#include "world/scene/bvh.glsl"
#include "material/surface.glsl"
#include "material/lobes.glsl"
#include "material/scatter.glsl"
#include "world/scene/areas.glsl"
#include "world/scene/lights.glsl"
#include "world/scene/direct.glsl"
#include "film/wide.glsl"
#include "world/scene/film_units.glsl"
#include "world/scene/one_hit.glsl"
#include "world/scene/no_point.glsl"
#include "world/scene/points.glsl"
#include "world/scene/camera_path.glsl"

void main()
{
    uint item = invocation_index();
    if (item >= push.path_count) {
        return;
    }
    CameraPath path = camera_paths[item];
    uint index = path.place / SAMPLES;
    uint number = path.place % SAMPLES;
    uint depth = path.state >> 8;
    Chain chain = new_chain(path.position, path.direction, path.weight, vec2(0.0));
    chain.saw_specular = (path.state & 1u) != 0;
    chain.gathers = (path.state & 2u) != 0;
    chain.starts_nowhere = (path.state & 4u) != 0;
    chain.sees_emission = (path.state & 8u) != 0;
    chain.point_count = (path.state >> 4) & 3u;
    uint first_point = chain.point_count;
    if (follow(chain, index, number, push.draws, push.emitter_count, depth)) {
        put_off(chain, path.place, depth + CHAIN_STEPS);
    }
    note_unless(is_finite(chain.light[0]) && is_finite(chain.light[1]) && is_finite(chain.light[2]), NONFINITE_LIGHT, push.draws.domain,
                push.draws.round, index);
    write_pass_sum(path.place, chain.light, push.film_scale, push.film_limit, mix32(push.rounding + depth), true);
    write_points(chain, index, number, push.pixel_count, first_point);
}
