// Photons of a map as dots on the pixels of a window, where nothing that the camera sees first hides them.
// Dispatched by src/engine/scene/live.rs. One thread = one photon.
#extension GL_EXT_scalar_block_layout : require

#include "world/scene/visible_point.glsl"

// Photons of a map as dots; see `glsl/kernels/show_photons.comp`.
struct ShowPhotonsPush {
    uint photon_count;
    uint width;
    uint height;
    uint shown_width;
    uint shown_height;
    uint zoom;
    vec3 eye;
    vec3 forward;
    // To the picture's right and upper edge, as camera rays have them.
    vec3 right;
    vec3 up;
    uint is_orthographic;
    // As the window has it, and pixels along each side of a dot.
    uint colour;
    uint dot_size;
};

layout(push_constant, scalar) uniform Push { ShowPhotonsPush push; };
layout(set = 1, binding = 0, scalar) readonly buffer Map { uvec4 map[]; };
layout(set = 1, binding = 1, scalar) readonly buffer VisiblePoints { VisiblePoint visible_points[]; };
layout(set = 1, binding = 2, scalar) writeonly buffer WindowPixels { uint window_pixels[]; };

#include "dispatch/dispatch.glsl"
#include "math/math.glsl"
#include "film/window.glsl"

// A photon this much farther away than what the camera sees is behind it.
const float TOLERANCE = 1.01;

void main()
{
    uint photon = invocation_index();
    if (photon >= push.photon_count) {
        return;
    }
    uvec4 place = map[2 * photon];
    if (place.w == NONE) {
        return;
    }
    vec3 from_eye = uintBitsToFloat(place.xyz) - push.eye;
    float depth = inner_product(from_eye, push.forward);
    if (depth <= 0.0) {
        return;
    }
    float spread = push.is_orthographic != 0 ? 1.0 : depth;
    float x = divide(inner_product(from_eye, push.right), inner_product(push.right, push.right) * spread);
    float y = divide(inner_product(from_eye, push.up), inner_product(push.up, push.up) * spread);
    if (abs(x) >= 1.0 || abs(y) >= 1.0) {
        return;
    }
    vec2 on_picture = vec2(0.5 + 0.5 * x, 0.5 - 0.5 * y) * vec2(push.shown_width, push.shown_height);
    uvec2 seen = min(uvec2(on_picture), uvec2(push.shown_width - 1, push.shown_height - 1));
    VisiblePoint point = visible_points[seen.y * push.shown_width + seen.x];
    if (point.arrivals != 0 && norm(from_eye) > TOLERANCE * norm(point.position - push.eye)) {
        return;
    }
    uvec2 window = uvec2(push.width, push.height);
    uvec2 at = corner_of_picture(window, uvec2(push.shown_width, push.shown_height), push.zoom) + uvec2(on_picture * float(push.zoom));
    for (uint spot = 0; spot < push.dot_size * push.dot_size; spot++) {
        uvec2 pixel = at + uvec2(spot % push.dot_size, spot / push.dot_size);
        if (pixel.x < window.x && pixel.y < window.y) {
            window_pixels[pixel.y * push.width + pixel.x] = push.colour;
        }
    }
}
