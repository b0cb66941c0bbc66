// What each pixel sees: a path from the camera over mirrors and glass to the first surface that
// scatters, its emission and direct light, and where asked one ray further for a final gather.
// Dispatched by src/engine/scene/points.rs once a round. One thread = one sample of a pixel.
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_EXT_scalar_block_layout : require

#include "world/scene/work.glsl"
#include "rng/draws.glsl"

struct CameraPathsPush {
    Draws draws;
    WorkDivision work;
    // Hash of the seed and the round that decides what is rounded up.
    uint rounding;
    uint width;
    uint height;
    // Paths of all pixels, those of each together, and behind them extra samples.
    uint first_path;
    uint end_path;
    vec3 eye;
    vec3 forward;
    // To the picture's right and upper edge: at unit distance, or where parallel rays start.
    vec3 right;
    vec3 up;
    uint is_orthographic;
    // 0: a pinhole.
    float lens_radius;
    // Distance of the plane in focus along the view.
    float focus;
    uint emitter_count;
    // Width of a pixel's filter over the distance between pixels.
    float footprint;
    // Film units in 1 W/m2/sr.
    float film_scale;
    // Largest sum of one pass, film units.
    float film_limit;
};

layout(push_constant, scalar) uniform Push { CameraPathsPush push; };

// Paths may start at receivers.
const bool HAS_RECEIVERS = false;
#include "world/scene/camera_kernel.glsl"
#include "world/scene/extra_samples.glsl"
#include "world/scene/seen_sky.glsl"
#include "world/scene/tiles.glsl"

// Of the eye from the middle of the scene, which lies within 0.87 of it: from farther away rays start so far before the middle.
const float FAR_EYE = 8.0;
const float NEAR_START = 1.5;

void main()
{
    work = push.work;
    uint path = push.first_path + invocation_index();
    uint pixel_count = push.width * push.height;
    uint even = work.samples * pixel_count;
    if (path >= push.end_path) {
        return;
    }
    if (path < even) {
        own = even_sample(pixel_in_tiles(path / work.samples, push.width, push.height), path % work.samples);
    } else {
        own = extra_sample(path - even, pixel_count);
    }
    uint pixel = own.pixel;
    uint number = own.number;
    vec4 u = stratified_start(number, pixel, push.draws);
    vec2 place = vec2(pixel % push.width, pixel / push.width) + 0.5 + push.footprint * filter_offsets(u.xy);
    vec2 picture = vec2(divide(2.0 * place.x, push.width) - 1.0, 1.0 - divide(2.0 * place.y, push.height));
    vec3 origin = push.eye;
    vec3 start = vec3(0.0);
    vec3 way = push.forward + picture.x * push.right + picture.y * push.up;
    if (push.is_orthographic != 0) {
        origin += picture.x * push.right + picture.y * push.up;
        way = push.forward;
    }
    if (push.lens_radius > 0.0) {
        vec2 at = stratified_at(number, pixel, LENS_BLOCK, push.draws).xy;
        start = sample_disc(vec3(0.0), push.forward, push.lens_radius, at);
        origin += start;
        way = push.focus * way - start;
    }
    vec3 direction = normalize(way);
    // From far away surfaces that lie on one another are at the same distance, as it is rounded.
    float distance_to_middle = norm(origin);
    if (distance_to_middle > FAR_EYE) {
        origin += (distance_to_middle - NEAR_START) * direction;
    }

    start_chain(origin, direction, vec3(1.0));
    if (HAS_MEDIA) {
        chain.media = media_at(origin, direction);
    }
    if (HAS_SKY_PICTURE) {
        Emitter sky = emitters[max(push.emitter_count, 1u) - 1];
        bool has_peaks = push.emitter_count != 0 && sky.kind == EMITTER_ENVIRONMENT && sky.outer_versine > LEAST_PEAK_SHARE;
        // Parallel rays see the sky in one direction, and a path in a medium leaves it by other ways.
        if (has_peaks && push.is_orthographic == 0 && chain.media == 0) {
            float focus = push.lens_radius > 0.0 ? push.focus : 1.0;
            vec2 middle = vec2(pixel % push.width, pixel / push.width) + 0.5;
            window = SkyWindow(true, uvec2(0), uvec2(0), start, focus, push.forward, push.right, push.up, vec2(push.width, push.height), middle,
                               push.footprint);
            open_window(sky);
            see_peaks_of_sky(sky, push.eye + start, push.draws, pixel, number);
        }
    }
    follow(pixel_count, push.draws, push.emitter_count, 0);
    note_unless(is_finite(chain.light[0]) && is_finite(chain.light[1]) && is_finite(chain.light[2]), NONFINITE_LIGHT, push.draws.domain,
                push.draws.round, pixel);
    note_surface(chain.met_surface, most_samples(pixel_count) / own.count);
    float share = divide(1.0, float(own.count));
    write_pass_sum(own.place, pixel, pixel_count, chain.light, chain.seen, share * push.film_scale, share * push.film_limit, push.rounding, false);
    note_nodes();
    write_missing_points(pixel_count);
}
