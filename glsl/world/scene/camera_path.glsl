// A camera path: mirrors and glass, the first surface that scatters (a visible point), and where a
// final gather is asked for, a sampled ray and a second chain to a second visible point.

#include "rng/draws.glsl"
#include "world/scene/visible_point.glsl"
#include "world/scene/work.glsl"

// A path from the camera or a receiver, under way over mirrors and glass.
struct CameraPath {
    vec3 position;
    Sample own;
    vec3 direction;
    // Bits 0 to 3: it saw a specular surface, it gathers, it starts at no surface, emission counts at its next one; bits 4
    // and 5: visible points found; bit 6: it ends there; from bit 8 on: surfaces that it has met.
    uint state;
    vec3 weight;
    // Of its smooth ways, where the others were followed too (glsl/world/scene/other_ways.glsl).
    float chance;
    // What it runs through (glsl/material/media.glsl).
    uint media;
    // Of a direction that a sharp lobe gave it, 1/sr, and the point and the normal there; 0: none.
    float density;
    vec3 from;
    vec3 from_normal;
};

struct Chain {
    vec3 position;
    vec3 direction;
    vec3 weight; // radiance at the eye for radiance that arrives along the ray
    float chance; // of the smooth ways it took where the others are followed too; what shines counts so often less
    bool is_smooth; // it has met nothing yet but mirrors, panes and what they show
    bool is_other_way; // that a path did not take: it sees what shines
    bool saw_specular; // before the first visible point
    bool gathers; // the first visible point, or a receiver, lies behind
    bool starts_nowhere; // at a receiver that no photon can reach
    bool sees_emission; // what shines at the next vertex has not been counted yet
    bool ends_at_light; // matt lobes sent it, and follow no light but what shines at the next vertex
    uint media; // what it runs through
    // Of a path whose direction light samples know too: the density of that direction, 1/sr, and from where; 0: no light sample has
    // counted what it meets.
    float density;
    vec3 from;
    vec3 from_normal;
    uint point_count; // visible points found
    bool met_surface; // the eye's path, which scatters light
    vec3 light[3]; // direct, specular, indirect
    vec3 seen; // what shines by itself and is met by the eye's ray, before any surface that scatters
};

// The path of this thread, and ways that it has not taken. No arguments: drivers keep copies of one that has arrays.
Chain chain;
uint ways_found;
uint ways_left;

void start_chain(vec3 position, vec3 direction, vec3 weight)
{
    chain = Chain(position, direction, weight, 1.0, true, false, false, false, false, true, false, 0, 0.0, vec3(0.0), vec3(0.0), 0,
                  false, vec3[](vec3(0.0), vec3(0.0), vec3(0.0)), vec3(0.0));
    ways_found = 0;
    ways_left = 0;
}

// The part of the picture that light of the current vertex belongs to, when it arrived in this way.
uint part_of(uint arrival)
{
    return chain.saw_specular ? PART_SPECULAR
         : chain.gathers      ? PART_INDIRECT
                              : (arrival == ARRIVED_DIRECT ? PART_DIRECT : (arrival == ARRIVED_CAUSTIC ? PART_CAUSTIC : PART_INDIRECT));
}

void add_weighted_light(vec3 light)
{
    uint part = part_of(ARRIVED_DIRECT);
    if ((PARTS & part) != 0) {
        uint place = part == PART_DIRECT ? 0 : (part == PART_SPECULAR ? 1 : 2);
        chain.light[place] += light;
    }
}

void add_light(vec3 radiance)
{
    add_weighted_light(chain.weight * radiance);
}

// Whether the eye's ray has met nothing but gaps so far.
bool is_straight()
{
    return !chain.saw_specular && !chain.gathers && !chain.ends_at_light;
}

// What shines by itself at the next vertex. Seen straight it is no light of surfaces.
void add_shining(vec3 radiance)
{
    bool is_seen = false;
    if (HAS_SEEN_LIGHT) {
        is_seen = is_straight() && (PARTS & PART_DIRECT) != 0;
    }
    vec3 light = chain.chance * chain.weight * radiance;
    if (is_seen) {
        chain.seen += light;
    } else {
        add_weighted_light(light);
    }
}

// Notes what the latest shadow rays found; `weight` is what light at their point adds to the pixel.
void note_shadow_rays(uint pixel, vec3 weight)
{
    if (light_arrived) {
        if (!is_reached(pixel, HIT_SHADOW_RAY)) {
            note_hit(pixel, HIT_SHADOW_RAY);
        }
    } else {
        note_miss(pixel, HIT_SHADOW_RAY, weight * stopped_light);
    }
    bool may_be_unseen = HAS_LIGHT_CLUSTERS;
    if (HAS_OPENINGS) {
        may_be_unseen = true;
    }
    if (may_be_unseen) {
        if (unseen_light_arrived && !is_reached(pixel, HIT_UNSEEN_LIGHT)) {
            note_hit(pixel, HIT_UNSEEN_LIGHT);
        } else {
            note_miss(pixel, HIT_UNSEEN_LIGHT, weight * stopped_unseen_light);
        }
    }
}

// The arrivals at the current vertex that some part asks for by photons: shadow rays see to direct light, and a gather
// ray to indirect.
uint arrivals_wanted(bool gathers)
{
    uint wanted = 0;
    uint first = ARRIVED_DIRECT;
    if (HAS_SHADOW_RAYS) {
        first = ARRIVED_CAUSTIC;
    }
    uint last = gathers ? ARRIVED_CAUSTIC : ARRIVED_INDIRECT;
    for (uint arrival = first; arrival <= last; arrival *= 2) {
        wanted |= (PARTS & part_of(arrival)) != 0 ? arrival : 0;
    }
    return wanted;
}

// Adds what shines at the end of a ray, where light samples have not counted all of it; `light_density` is theirs.
void add_emission(vec3 radiance, float light_density)
{
    float share = 1.0;
    if (HAS_LAYERS) {
        if (chain.density > 0.0) {
            share = divide(chain.density, chain.density + float(work.shadow_rays) * light_density);
        }
    }
    add_shining(share * radiance);
}

bool gathers_here(Surface surface)
{
    if (HAS_GLOSSY) {
        return GATHER_RAYS == GATHER_ALL || (GATHER_RAYS == GATHER_GLOSSY && surface.kind == SURFACE_GLOSSY);
    }
    return GATHER_RAYS == GATHER_ALL;
}

// Surfaces that one dispatch follows a chain over; what is still under way then goes on in another (kernels/go_on.comp).
layout(constant_id = 46) const uint CHAIN_STEPS = MAX_BOUNCES;

// Of a camera path beyond LOSSLESS_DEPTH.
const float MAX_SURVIVAL = 0.95;

// Random numbers of a place that are no vertex's: light at a receiver, then roulette at each depth, then the channel.
const uint RECEIVER_BLOCK = 1 + VERTEX_BLOCKS * MAX_BOUNCES;
const uint ROULETTE_BLOCK = RECEIVER_BLOCK + 1;
const uint CHANNEL_BLOCK = ROULETTE_BLOCK + MAX_BOUNCES;
// A place on the camera's lens.
const uint LENS_BLOCK = CHANNEL_BLOCK + 1;
// A direction of the sky that a pixel looks at, two blocks.
const uint WINDOW_BLOCK = LENS_BLOCK + 1;

// What shines where the path leaves the scene.
void see_sky(uint emitter_count)
{
    if (chain.sees_emission) {
        float light_density = 0.0;
        if (HAS_LAYERS) {
            light_density = sky_light_density(emitter_count, chain.from, chain.from_normal, chain.direction);
        }
        vec3 radiance = environment_radiance(emitter_count, chain.direction);
        if (HAS_SKY_PICTURE) {
            if (window.is_there && is_straight()) {
                radiance *= share_of_rays(emitters[emitter_count - 1], chain.direction);
            }
        }
        add_emission(radiance, light_density);
    }
}

// What shines where the path meets a surface.
void see_lamp(Surface surface, Hit hit, uint emitter_count)
{
    if (chain.sees_emission) {
        float light_density = 0.0;
        if (HAS_LAYERS) {
            if (chain.density > 0.0 && surface.emission != vec3(0.0)) {
                light_density = lamp_light_density(emitter_count, hit, chain.from, surface.position);
            }
        }
        add_emission(surface.emission, light_density);
    }
}

// Whether a ray leaves matt lobes of the eye's paths to see what shines. A gather ray would leave them for other light.
bool seeks_light()
{
    bool seeks = false;
    if (GATHER_RAYS == GATHER_NONE) {
        seeks = !chain.gathers && (PARTS & part_of(ARRIVED_DIRECT)) != 0;
    }
    return seeks;
}

// Leaves a visible point, of whose light `scale` goes on to the eye. Says whether a gather ray leaves it.
bool leave_point(Surface surface, Lobes lobes, vec3 wo, vec3 scale, bool for_all, uint pixel_count)
{
    bool leads = !for_all || own.number == 0;
    bool gathers = leads && !chain.gathers && gathers_here(surface) && (PARTS & part_of(ARRIVED_INDIRECT)) != 0;
    uint arrivals = arrivals_wanted(gathers);
    uint for_others = 0;
    if (HAS_CAUSTIC_MAP) {
        for_others = ARRIVED_CAUSTIC;
    }
    arrivals = leads ? arrivals : arrivals & for_others;
    arrivals |= arrivals == 0 ? SEEN
                              : SEEN | (chain.saw_specular ? SEEN_OVER_SPECULAR : 0) | (chain.gathers ? SEEN_BY_GATHER : 0)
                                    | (for_all ? SEEN_FOR_ALL : 0);
    uint place = place_of_point(chain.point_count++, own.place, pixel_count);
    visible_points[place] = VisiblePoint(surface.position, surface.plane, divide(chain.weight * scale, float(own.count)),
                                         surface.ns == surface.ng ? NONE : pack_normal(surface.ns), pack_direction(wo, 0), surface.parameter,
                                         surface.kind, arrivals);
    if (HAS_LAYERS) {
        write_matt_lobes(place, lobes);
    }
    return gathers;
}

#include "world/scene/other_ways.glsl"

// Follows the path of a sample to its next surface and over it; it is over `depth` surfaces already. Says whether it goes on. Random
// numbers: block 1 + VERTEX_BLOCKS * depth goes on, the one after it is for direct light.
bool step(uint pixel_count, Draws draws, uint emitter_count, uint depth)
{
    uint index = own.pixel;
    uint number = own.number;
    note_unless(is_finite(chain.position) && is_finite(chain.direction) && is_finite(chain.weight), NONFINITE_LIGHT, draws.domain,
                draws.round, index);
    vec3 wo = -chain.direction;
    Hit hit = closest_hit(chain.position, chain.direction);
    if (hit.triangle == NONE) {
        see_sky(emitter_count);
        return false;
    }
    if (HAS_MEDIA) {
        chain.weight *= transmittance(chain.media, hit.t);
    }
    Surface surface = surface_at(hit, wo);
    uint block = 1 + VERTEX_BLOCKS * depth;
    bool is_layered = false;
    if (HAS_LAYERS) {
        is_layered = surface.kind == SURFACE_LAYERED;
    }
    Lobes lobes;
    Scatter scatter;
    float matt = 1.0;
    // Beyond this surface.
    float chance = chain.chance;
    if (is_layered) {
        uint channel = 1;
        if (HAS_DISPERSION) {
            if (is_dispersive(surface, chain.media)) {
                // Once a path: of one channel it stays.
                channel = choose_channel(chain.weight, stratified_at(number, index, CHANNEL_BLOCK, draws).x);
                chain.weight = light_of_channel(chain.weight, channel);
            }
        }
        float eta = index_ratio(surface, chain.media, channel);
        surface.ns = normal_of_refraction(surface, wo, eta, depth);
        lobes = lobes_of(surface, wo, eta);
        // The eye does not see the back of what has one side.
        bool is_culled = !surface.scatters && !chain.gathers && !chain.ends_at_light;
        vec3 u = stratified_at(number, index, block, draws).zxy;
        scatter = sample_layered(surface, lobes, wo, u, true);
        if (follows_other_ways(depth) && !is_culled) {
            chance *= part_at_layers(surface, lobes, wo, choose_lobe(lobes, u.x), scatter.passes, depth);
        }
        if (is_culled || scatter.passes) {
            chain.weight *= is_culled ? vec3(1.0) : scatter.weight;
            chain.chance = chance;
            // It stops light samples.
            chain.density = is_culled ? 0.0 : chain.density;
            chain.position = offset_origin(surface.position, surface.error, surface.ng, chain.direction);
            return true;
        }
        if (HAS_PASSING) {
            chain.weight *= divide(surface.layers.coverage, 1.0 - lobes.pass_chance);
        }
        matt = matt_chance(lobes, surface.layers);
        if (surface.layers.is_unlit && !chain.gathers && !chain.ends_at_light) {
            add_shining(surface.base_colour);
        }
    }
    see_lamp(surface, hit, emitter_count);
    if (!surface.scatters || chain.ends_at_light) {
        return false;
    }
    if (HAS_SEEN_LIGHT) {
        bool is_unlit = is_layered && surface.layers.is_unlit;
        chain.met_surface = chain.met_surface || (is_straight() && !is_unlit);
    }
    bool specular = is_layered ? scatter.is_specular : is_specular(surface);
    bool is_smooth = specular;
    if (is_layered) {
        is_smooth = specular && scatter.density == 0.0;
    }
    if (chain.is_other_way && !is_smooth) {
        return false;
    }
    vec3 scale = is_layered ? vec3(1.0) : surface.base_colour * scatter_scale(surface.kind, surface.parameter);
    bool wants_direct = (PARTS & part_of(ARRIVED_DIRECT)) != 0;
    bool asks_lights = false;
    if (HAS_SHADOW_RAYS) {
        asks_lights = !chain.is_other_way && (is_layered || (!specular && wants_direct));
    }
    if (is_layered) {
        chain.density = 0.0;
    }
    if (asks_lights) {
        Target here = plain_target(surface.position, surface.error, surface.ng, surface.ns, wo, surface.kind, surface.parameter);
        here.surface = surface;
        here.lobes = lobes;
        here.media = chain.media;
        here.asks_lobes = is_layered && seeks_light();
        vec3 light = scale * direct_light(here, emitter_count, draws, index, number, block + 1);
        if (wants_direct) {
            add_light(light);
        }
        // Of what a gather ray meets the caustic map has counted the light of sharp lobes.
        if (is_layered && (!chain.gathers || chain.starts_nowhere)) {
            bool saw_specular = chain.saw_specular;
            chain.saw_specular = saw_specular || !chain.gathers;
            add_light(sharp_light);
            chain.saw_specular = saw_specular;
            chain.density = scatter.density;
            chain.from = surface.position;
            chain.from_normal = surface.ns;
        }
        note_shadow_rays(index, divide(chain.weight * scale, float(own.count)));
    }
    // Matt lobes are followed no further but for a gather.
    if (is_layered && !specular && matt == 0.0) {
        return false;
    }
    if (!specular) {
        if (is_layered) {
            scale = vec3(divide(0.31830988618379067, matt));
        }
        // Where it is by chance that a path gets here, each counts for itself.
        bool for_all = !chain.saw_specular && !chain.gathers && matt == 1.0;
        if (leave_point(surface, lobes, wo, scale, for_all, pixel_count)) {
            chain.gathers = true;
            chain.density = 0.0;
            chain.weight *= for_all ? float(own.count) : 1.0;
            // Shadow rays and the caustic map have counted what shines from here on.
            chain.sees_emission = false;
        } else if (asks_lights && is_layered && seeks_light()) {
            chain.ends_at_light = true;
            chain.density = density_of_matt_lobes(surface, lobes, wo, scatter.direction);
        } else {
            return false;
        }
    }
    bool ends = specular && !chain.gathers;
    if (HAS_SPECULAR_CHAINS) {
        ends = false;
    }
    if (ends) {
        return false;
    }
    vec3 u = stratified_at(number, index, block, draws).zxy;
    if (!is_layered) {
        scatter = sample_built_in(surface, wo, u, depth, true);
        if (HAS_DIELECTRIC) {
            if (surface.kind == SURFACE_DIELECTRIC && follows_other_ways(depth)) {
                chance *= part_at_glass(surface, wo, dot(scatter.direction, surface.ng) > 0.0, depth);
            }
        }
    }
    chain.chance = is_smooth ? chance : 1.0;
    chain.is_smooth = chain.is_smooth && is_smooth;
    if (!scatter.alive) {
        return false;
    }
    if (depth >= ROULETTE_DEPTH) {
        float most = depth < LOSSLESS_DEPTH ? 1.0 : MAX_SURVIVAL;
        float survival = min(max(scatter.weight.x, max(scatter.weight.y, scatter.weight.z)), most);
        if (stratified_at(number, index, ROULETTE_BLOCK + depth, draws).x >= survival) {
            return false;
        }
        scatter.weight = divide(scatter.weight, survival);
    }
    if (surface.kind == SURFACE_PAPER_PHONG) {
        scatter.weight *= lobe_weight(surface.kind, surface.parameter, surface.ns, wo, scatter.direction);
    }
    chain.weight *= scatter.weight;
    // No caustic map holds what reaches a receiver in the air over mirrors and glass.
    chain.sees_emission = chain.sees_emission || (chain.starts_nowhere && specular);
    chain.saw_specular = chain.saw_specular || (specular && !chain.gathers);
    if (HAS_MEDIA) {
        if (is_layered && surface.layers.medium != 0 && dot(scatter.direction, surface.ng) < 0.0) {
            chain.media = media_beyond(surface, chain.media);
        }
    }
    chain.position = offset_origin(surface.position, surface.error, surface.ng, scatter.direction);
    chain.direction = scatter.direction;
    return true;
}

// Camera paths that are under way when their dispatch ends.
layout(set = 1, binding = 9, scalar) writeonly buffer NextCameraPaths { CameraPath next_camera_paths[]; };
// [0]: how many.
layout(set = 1, binding = 10, scalar) buffer CameraPathCounts { uint camera_path_counts[]; };

void put_off(uint depth)
{
    uint flags = uint(chain.saw_specular) | uint(chain.gathers) << 1 | uint(chain.starts_nowhere) << 2 | uint(chain.sees_emission) << 3
               | uint(chain.ends_at_light) << 6 | uint(chain.met_surface) << 7;
    next_camera_paths[atomicAdd(camera_path_counts[0], 1)] =
        CameraPath(chain.position, own, chain.direction, flags | chain.point_count << 4 | depth << 8, chain.weight, chain.chance, chain.media,
                   chain.density, chain.from, chain.from_normal);
}

// Visible points that the path has not found: nothing arrives there.
void write_missing_points(uint pixel_count)
{
    for (uint k = chain.point_count; k < points_per_path(); k++) {
        visible_points[place_of_point(k, own.place, pixel_count)] = no_point();
    }
}

// Follows the path of a sample, which is over `depth` surfaces already, and ways that it has not taken. What is under way when the
// dispatch ends is put off.
void follow(uint pixel_count, Draws draws, uint emitter_count, uint depth)
{
    uint end = min(depth + CHAIN_STEPS, MAX_BOUNCES);
    while (true) {
        bool goes_on = step(pixel_count, draws, emitter_count, depth);
        depth++;
        if (goes_on && depth < end) {
            continue;
        }
        if (goes_on && (chain.is_other_way || end == MAX_BOUNCES)) {
            note_cut_path(max(chain.weight.x, max(chain.weight.y, chain.weight.z)));
        } else if (goes_on) {
            put_off(depth);
        }
        if (ways_left == 0) {
            break;
        }
        depth = take_way();
        end = depth + STEPS_OF_WAY;
    }
}
