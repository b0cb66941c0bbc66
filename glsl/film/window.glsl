// Pixels of a window. Expects math/math.glsl.

// Where a picture begins that stands in the middle of a window; 0 along a side that it does not fill.
uvec2 corner_of_picture(uvec2 window, uvec2 shown, uint zoom)
{
    uvec2 size = shown * zoom;
    return uvec2(window.x > size.x ? (window.x - size.x) / 2 : 0, window.y > size.y ? (window.y - size.y) / 2 : 0);
}

// The sRGB transfer function (IEC 61966-2-1). Twin of `srgb_code` in src/output/colour.rs.
float srgb(float linear)
{
    linear = clamp(linear, 0.0, 1.0);
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * exponential2(logarithm2(linear) * (1.0 / 2.4)) - 0.055;
}

// Codes of 8 bits from 0 to 1, opaque.
uint packed_colour(vec3 colour, uint blue_first)
{
    uvec3 code = uvec3(clamp(colour, vec3(0.0), vec3(1.0)) * 255.0 + 0.5);
    uvec3 ordered = blue_first != 0 ? code.zyx : code;
    return ordered.x | ordered.y << 8 | ordered.z << 16 | 0xff000000u;
}
