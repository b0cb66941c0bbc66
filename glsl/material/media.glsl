// What a path runs through: a stack of at most four media, eight bits each, the one entered last lowest; 0: none. Of nested solids the
// one entered last counts. Where more than four enclose a path, the outermost is forgotten.

uint medium_removed(uint media, uint medium)
{
    for (uint place = 0; place < 32; place += 8) {
        if (((media >> place) & 255u) == medium) {
            uint below = (1u << place) - 1;
            // Shifting by 32 bits has no meaning.
            uint above = place == 24 ? 0 : media >> (place + 8) << place;
            return (media & below) | above;
        }
    }
    return media;
}

float index_in(uint media)
{
    uint medium = media & 255u;
    return medium == 0 ? 1.0 : layered_materials[medium - 1].medium_ior;
}

// Behind a boundary.
uint media_beyond(Surface surface, uint media)
{
    uint medium = surface.layers.medium;
    return surface.front ? (media << 8) | medium : medium_removed(media, medium);
}

// Index of refraction where the ray came from over that beyond, of a solid.
float index_ratio(Surface surface, uint media)
{
    float ior = max(surface.layers.ior, 1e-3);
    if (HAS_MEDIA) {
        if (surface.layers.medium != 0) {
            // Who sees the back of a solid is inside it.
            bool is_known = surface.front || medium_removed(media, surface.layers.medium) != media;
            return divide(is_known ? index_in(media) : ior, index_in(media_beyond(surface, media)));
        }
    }
    return surface.front ? divide(1.0, ior) : ior;
}

// Share of light that is left after a way.
vec3 transmittance(uint media, float way)
{
    if (HAS_MEDIA) {
        uint medium = media & 255u;
        if (medium != 0) {
            vec3 depth = 1.44269504088896341 * way * layered_materials[medium - 1].medium_absorption;
            return vec3(exp2(-depth.x), exp2(-depth.y), exp2(-depth.z));
        }
    }
    return vec3(1.0);
}

// What encloses a point: the solids that a ray from there leaves and has not entered.
uint media_at(vec3 position)
{
    uint media = 0;
    if (HAS_MEDIA) {
        // Along no axis and no diagonal.
        const vec3 direction = vec3(0.48666426, 0.81110711, 0.32444284);
        uint entered = 0;
        uint count = 0;
        for (uint step = 0; step < MAX_BOUNCES && count < 32; step++) {
            Hit hit = closest_hit(position, direction);
            if (hit.triangle == NONE) {
                break;
            }
            Triangle triangle = triangles[hit.triangle];
            uint medium = layered_materials[triangle.material].medium;
            vec3 normal = triangle_normal(triangle);
            bool leaves = dot(normal, direction) > 0.0;
            if (medium != 0) {
                uint without = medium_removed(entered, medium);
                if (!leaves) {
                    entered = (entered << 8) | medium;
                } else if (without != entered) {
                    entered = without;
                } else {
                    // The first that it leaves is the innermost.
                    media |= medium << count;
                    count += 8;
                }
            }
            position = offset_origin(triangle_point(triangle, hit.u, hit.v), triangle_error(triangle), normal, direction);
        }
    }
    return media;
}
