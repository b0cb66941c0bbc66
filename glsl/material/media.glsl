// What a path runs through: a stack of media, in its lowest bits the one that fills the place; 0: none. That is the medium entered last,
// or that of the smallest solid.
// A scene in which more of them lie in one another than there is room for is refused (src/scene/geometry/mod.rs).

// Of one medium: eight, or fewer where many solids lie in one another.
layout(constant_id = 75) const uint MEDIUM_BITS = 8;
const uint MEDIUM_MASK = (1u << MEDIUM_BITS) - 1u;

// Some solids lie partly in one another (src/scene/solids.rs). Then media are numbered by size, and the highest number fills the place,
// whatever the path entered last: else light that comes in along a path could not go back along it.
layout(constant_id = 76) const bool HAS_MEDIA_BY_SIZE = false;

uint medium_added(uint media, uint medium)
{
    uint place = 0;
    if (HAS_MEDIA_BY_SIZE) {
        while (place + 2 * MEDIUM_BITS <= 32 && ((media >> place) & MEDIUM_MASK) > medium) {
            place += MEDIUM_BITS;
        }
    }
    uint below = (1u << place) - 1;
    return ((media & ~below) << MEDIUM_BITS) | (medium << place) | (media & below);
}

uint medium_removed(uint media, uint medium)
{
    for (uint place = 0; place + MEDIUM_BITS <= 32; place += MEDIUM_BITS) {
        if (((media >> place) & MEDIUM_MASK) == medium) {
            uint below = (1u << place) - 1;
            // Shifting by 32 bits has no meaning.
            uint above = place + MEDIUM_BITS == 32 ? 0 : media >> (place + MEDIUM_BITS) << place;
            return (media & below) | above;
        }
    }
    return media;
}

const float MAX_IOR = 100.0;

// Index of refraction for a channel, 0 to 2: red has least.
float index_for(float ior, float spread, uint channel)
{
    if (HAS_DISPERSION) {
        if (spread > 0.0) {
            return clamp(ior + (float(channel) - 1.0) * spread, 1.0, MAX_IOR);
        }
    }
    return ior;
}

float index_in(uint media, uint channel)
{
    uint medium = media & MEDIUM_MASK;
    return medium == 0 ? 1.0 : index_for(layered_materials[medium - 1].medium_ior, layered_materials[medium - 1].medium_spread, channel);
}

// Behind a boundary.
uint media_beyond(Surface surface, uint media)
{
    uint medium = surface.layers.medium;
    return surface.front ? medium_added(media, medium) : medium_removed(media, medium);
}

float spread_in(uint media)
{
    uint medium = media & MEDIUM_MASK;
    return medium == 0 ? 0.0 : layered_materials[medium - 1].medium_spread;
}

// Whether colours part at a surface.
bool is_dispersive(Surface surface, uint media)
{
    if (!surface.layers.is_solid || surface.layers.transmission == 0.0) {
        return false;
    }
    float spread = surface.layers.ior_spread;
    if (HAS_MEDIA) {
        spread = max(spread, max(spread_in(media), spread_in(media_beyond(surface, media))));
    }
    return spread > 0.0;
}

// One of the channels that a path has light in, each as likely. Without light it is the middle one.
uint choose_channel(vec3 light, float u)
{
    uint count = uint(light.x > 0.0) + uint(light.y > 0.0) + uint(light.z > 0.0);
    uint left = min(uint(u * float(count)), max(count, 1u) - 1);
    uint chosen = 1;
    for (uint channel = 0; channel < 3; channel++) {
        if (light[channel] > 0.0) {
            chosen = left == 0 ? channel : chosen;
            left--;
        }
    }
    return chosen;
}

// The light of that channel, which stands for all that had as good a chance.
vec3 light_of_channel(vec3 light, uint channel)
{
    float count = float(uint(light.x > 0.0) + uint(light.y > 0.0) + uint(light.z > 0.0));
    vec3 kept = vec3(0.0);
    kept[channel] = count * light[channel];
    return kept;
}

// Index of refraction where the ray came from over that beyond, of a solid, for light of a channel.
float index_ratio(Surface surface, uint media, uint channel)
{
    float ior = max(index_for(surface.layers.ior, surface.layers.ior_spread, channel), 1e-3);
    if (HAS_MEDIA) {
        if (surface.layers.medium != 0) {
            // Who sees the back of a solid is inside it.
            bool is_known = surface.front || medium_removed(media, surface.layers.medium) != media;
            return divide(is_known ? index_in(media, channel) : ior, index_in(media_beyond(surface, media), channel));
        }
    }
    return surface.front ? divide(1.0, ior) : ior;
}

// Share of light that is left after a way.
vec3 transmittance(uint media, float way)
{
    if (HAS_MEDIA) {
        uint medium = media & MEDIUM_MASK;
        if (medium != 0) {
            vec3 depth = 1.44269504088896341 * way * layered_materials[medium - 1].medium_absorption;
            return vec3(exp2(-depth.x), exp2(-depth.y), exp2(-depth.z));
        }
    }
    return vec3(1.0);
}

// What encloses a point: the solids that a ray from there leaves and has not entered. `way` leads off the surface that the point lies on:
// a solid has no face where it touches one that is opaque.
uint media_at(vec3 position, vec3 way)
{
    uint media = 0;
    if (HAS_MEDIA) {
        // Along no axis and no diagonal.
        const vec3 upwards = vec3(0.48666426, 0.81110711, 0.32444284);
        vec3 direction = dot(upwards, way) < 0.0 ? -upwards : upwards;
        uint entered = 0;
        uint count = 0;
        for (uint step = 0; step < MAX_BOUNCES && count + MEDIUM_BITS <= 32; step++) {
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
                    entered = (entered << MEDIUM_BITS) | medium;
                } else if (without != entered) {
                    entered = without;
                } else {
                    // The first that it leaves is the innermost.
                    media = HAS_MEDIA_BY_SIZE ? medium_added(media, medium) : media | medium << count;
                    count += MEDIUM_BITS;
                }
            }
            position = offset_origin(triangle_point(triangle, hit.u, hit.v), triangle_error(triangle), normal, direction);
        }
    }
    return media;
}
