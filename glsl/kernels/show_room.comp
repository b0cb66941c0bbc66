// What the walls of the paper's box hold after whole rounds, seen by a camera: the paper's illumination, or its error. Walls are seen
// from within alone, so that one can look in from everywhere.
// Dispatched by src/engine/room/live.rs. One thread = one pixel.
#extension GL_EXT_scalar_block_layout : require

#include "gather/points.glsl"

// The same of the paper's box; see `glsl/kernels/show_room.comp`.
struct ShowRoomPush {
    uint width;
    uint height;
    vec3 eye;
    vec3 forward;
    vec3 right;
    vec3 up;
    uint shows;
    uint channel_count;
    // Texels along each side of a wall, and walls, each with its texels one behind the other.
    uint mesh;
    uint wall_count;
    // Of the box.
    vec3 middle;
    uint rounds;
    // Illumination that a film unit is worth after these rounds, and the mean of what is shown, of which errors are relative.
    float unit;
    float mean;
};

layout(push_constant, scalar) uniform Push { ShowRoomPush push; };
layout(set = 0, binding = 3, scalar) readonly buffer Points { Point points[]; };
layout(set = 1, binding = 0, scalar) readonly buffer FilmTotals { uvec2 film_totals[]; };
layout(set = 1, binding = 1, scalar) readonly buffer LowSquares { uvec2 low_squares[]; };
layout(set = 1, binding = 2, scalar) readonly buffer HighSquares { uvec2 high_squares[]; };
layout(set = 1, binding = 3, scalar) writeonly buffer Shown { vec4 shown[]; };

#include "dispatch/dispatch.glsl"
#include "math/math.glsl"
#include "film/wide.glsl"
#include "film/deviation.glsl"

// Of a texel's last channel, which is the paper's.
float value_of(uint point)
{
    uint sum = point * push.channel_count + push.channel_count - 1;
    if (push.shows == SHOW_ERROR) {
        float variance = variance_of_sum(film_totals[sum], uvec4(low_squares[sum], high_squares[sum]), push.rounds);
        return push.rounds < 2 || variance == 0.0 ? -1.0 : divide(square_root(variance) * push.unit, push.mean);
    }
    return (float(film_totals[sum].y) * 4294967296.0 + float(film_totals[sum].x)) * push.unit;
}

void main()
{
    uint pixel = invocation_index();
    if (pixel >= push.width * push.height) {
        return;
    }
    float x = divide(2.0 * (float(pixel % push.width) + 0.5), float(push.width)) - 1.0;
    float y = 1.0 - divide(2.0 * (float(pixel / push.width) + 0.5), float(push.height));
    vec3 direction = push.forward + x * push.right + y * push.up;
    uint texels = push.mesh * push.mesh;
    float nearest = 1e30;
    float value = push.shows == SHOW_ERROR ? -1.0 : 0.0;
    for (uint wall = 0; wall < push.wall_count; wall++) {
        // Rows of texels along u, one behind the other along v, from the corner of the first.
        vec3 first = points[wall * texels].position;
        vec3 u = points[wall * texels + 1].position - first;
        vec3 v = points[wall * texels + push.mesh].position - first;
        vec3 normal = outer_product(u, v);
        vec3 inwards = inner_product(push.middle - first, normal) < 0.0 ? -normal : normal;
        float slope = inner_product(direction, inwards);
        if (slope >= 0.0) {
            continue;
        }
        float distance = divide(inner_product(first - push.eye, inwards), slope);
        if (distance <= 0.0 || distance >= nearest) {
            continue;
        }
        vec3 on_wall = push.eye + distance * direction - first;
        float s = divide(inner_product(on_wall, u), inner_product(u, u)) + 0.5;
        float t = divide(inner_product(on_wall, v), inner_product(v, v)) + 0.5;
        float side = float(push.mesh);
        if (s < 0.0 || t < 0.0 || s >= side || t >= side) {
            continue;
        }
        nearest = distance;
        value = value_of(wall * texels + uint(t) * push.mesh + uint(s));
    }
    shown[pixel] = vec4(vec3(value), 1.0);
}
