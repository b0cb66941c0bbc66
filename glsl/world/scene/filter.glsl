// Where in the picture around a pixel a path from the camera starts, from uniform numbers.

// Offset from a pixel's centre, in pixels, as likely as the filter weighs it.
float filter_offset(float u)
{
    if (FILTER == FILTER_TENT) {
        return u < 0.5 ? sqrt(2.0 * u) - 1.0 : 1.0 - sqrt(2.0 - 2.0 * u);
    }
    return u - 0.5;
}

vec2 filter_offsets(vec2 u)
{
    if (FILTER == FILTER_GAUSSIAN) {
        // Of half a pixel's deviation, cut at four deviations (Box and Muller 1958).
        vec2 sin_cos = sin_cos_turns(u.y);
        return 0.5 * sqrt(-1.3862943611198906 * log2(max(1.0 - u.x, 1.0 / 16777216.0) * (1.0 - 3.3546263e-4) + 3.3546263e-4)) * sin_cos.yx;
    }
    return vec2(filter_offset(u.x), filter_offset(u.y));
}

// Density of these offsets, per square pixel.
float filter_density(vec2 offset)
{
    if (FILTER == FILTER_GAUSSIAN) {
        float squared = dot(offset, offset);
        return squared < 4.0 ? 0.63661977236758134 * exp2(-2.8853900817779268 * squared) * (1.0 / (1.0 - 3.3546263e-4)) : 0.0;
    }
    vec2 off = abs(offset);
    if (FILTER == FILTER_TENT) {
        vec2 sides = max(1.0 - off, vec2(0.0));
        return sides.x * sides.y;
    }
    return max(off.x, off.y) <= 0.5 ? 1.0 : 0.0;
}
