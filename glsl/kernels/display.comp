// Pixels of a window from what is shown: exposed, with the tone curve and transfer function of PNG files, or in false colours.
// Dispatched by src/window/display.rs once a frame. One thread = one pixel of the window.
#extension GL_EXT_scalar_block_layout : require

// What is shown, as pixels of a window; see `glsl/kernels/display.comp`.
struct DisplayPush {
    // Of the window, and of what is shown.
    uint width;
    uint height;
    uint shown_width;
    uint shown_height;
    // Pixels of the window along each side of one that is shown.
    uint zoom;
    // Stops by which values are made brighter.
    float stops;
    // 1: values are errors, for false colours.
    uint is_error;
    // 1: values are radiance; 0: the paper's display values.
    uint is_light;
    // 1: the window wants blue first.
    uint blue_first;
};

layout(push_constant, scalar) uniform Push { DisplayPush push; };
layout(set = 1, binding = 0, scalar) readonly buffer Shown { vec4 shown[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer WindowPixels { uint window_pixels[]; };

#include "dispatch/dispatch.glsl"
#include "math/math.glsl"
#include "film/window.glsl"

// The Khronos PBR Neutral tone mapper (Khronos Group 2024). Twin of `Tone::of` in src/output/colour.rs.
vec3 neutral(vec3 colour)
{
    const float FRESNEL = 0.04;
    const float START = 0.8 - FRESNEL;
    const float DESATURATION = 0.15;
    colour = max(colour, vec3(0.0));
    float least = min(min(colour.x, colour.y), colour.z);
    colour -= least < 2.0 * FRESNEL ? least - 6.25 * least * least : FRESNEL;
    float peak = max(max(colour.x, colour.y), colour.z);
    if (peak < START) {
        return colour;
    }
    const float REST = 1.0 - START;
    float new_peak = 1.0 - divide(REST * REST, peak + REST - START);
    float white = 1.0 - divide(1.0, DESATURATION * (peak - new_peak) + 1.0);
    colour *= divide(new_peak, peak);
    return colour + white * (vec3(new_peak) - colour);
}

// Relative errors from 0.1 % to 100 %, evenly by their logarithm; grey where they are unknown. Twin of `ERROR_COLOURS` in src/window/panel.rs.
vec3 false_colour(float error)
{
    const vec3 COLOURS[5] = vec3[](vec3(0.27, 0.0, 0.33), vec3(0.23, 0.32, 0.55), vec3(0.13, 0.57, 0.55), vec3(0.37, 0.79, 0.38), vec3(0.99, 0.91, 0.14));
    if (error < 0.0) {
        return vec3(0.5);
    }
    // log2(1000) steps of a factor of 2, over four distances between colours.
    float place = clamp(logarithm2(max(1000.0 * error, 1.0)) * (4.0 / 9.9657843), 0.0, 4.0);
    uint first = min(uint(place), 3);
    return COLOURS[first] + (place - float(first)) * (COLOURS[first + 1] - COLOURS[first]);
}

void main()
{
    uint place = invocation_index();
    if (place >= push.width * push.height) {
        return;
    }
    uvec2 pixel = uvec2(place % push.width, place / push.width);
    uvec2 corner = corner_of_picture(uvec2(push.width, push.height), uvec2(push.shown_width, push.shown_height), push.zoom);
    uvec2 at = (pixel - corner) / push.zoom;
    if (pixel.x < corner.x || pixel.y < corner.y || at.x >= push.shown_width || at.y >= push.shown_height) {
        window_pixels[place] = packed_colour(vec3(0.11), push.blue_first);
        return;
    }
    vec3 value = shown[at.y * push.shown_width + at.x].xyz;
    if (push.is_error != 0) {
        window_pixels[place] = packed_colour(false_colour(value.x), push.blue_first);
        return;
    }
    value *= exponential2(push.stops);
    if (push.is_light != 0) {
        value = neutral(value);
        value = vec3(srgb(value.x), srgb(value.y), srgb(value.z));
    }
    window_pixels[place] = packed_colour(value, push.blue_first);
}
