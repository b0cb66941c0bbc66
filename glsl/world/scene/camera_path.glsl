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
    // Bits 0 to 2: its role; bit 3: it saw a specular surface; bit 4: emission counts at its next one; bit 5: it met a surface that scatters;
    // bits 6 and 7: visible points found; from bit 8 on: surfaces that it has met.
    uint state;
    vec3 weight;
    // Of its smooth ways, where the others were followed too (glsl/world/scene/splitting.glsl).
    float chance;
    // What it runs through (glsl/material/media.glsl).
    uint media;
    // Of a direction that a sharp lobe gave it, 1/sr, and the point and the normal there; 0: none.
    float density;
    vec3 from;
    vec3 from_normal;
};

// What a path is followed for.
const uint ROLE_EYE = 0; // what the eye sees
const uint ROLE_SPLIT = 1; // what emits light, along a way that a path did not take
const uint ROLE_TO_LIGHT = 2; // what emits light at the next vertex, seen from rough lobes
const uint ROLE_GATHER = 3; // indirect light of the first visible point, or of a receiver
const uint ROLE_GATHER_IN_AIR = 4; // all light of a receiver that no photon can reach

struct Chain {
    vec3 position;
    vec3 direction;
    vec3 weight; // radiance at the eye for radiance that arrives along the ray
    float chance; // of the smooth ways it took where the others are followed too; what emits light counts so often less
    uint role;
    bool is_smooth; // it has met nothing yet but mirrors, panes and what they show
    bool saw_specular; // before the first visible point
    bool sees_emission; // what emits light at the next vertex has not been counted yet
    uint media; // what it runs through
    // Of a path whose direction light samples know too: the density of that direction, 1/sr, and from where; 0: no light sample has
    // counted what it meets.
    float density;
    vec3 from;
    vec3 from_normal;
    uint point_count; // visible points found
    bool met_surface; // the eye's path, which scatters light
    vec3 light[3]; // direct, specular, indirect
    vec3 seen; // what emits light and is met by the eye's ray, before any surface that scatters
};

// The path of this thread, and ways that it has not taken. No arguments: drivers keep copies of one that has arrays.
Chain chain;
uint ways_found;
uint ways_left;

void start_chain(vec3 position, vec3 direction, vec3 weight)
{
    chain = Chain(position, direction, weight, 1.0, ROLE_EYE, true, false, true, 0, 0.0, vec3(0.0), vec3(0.0), 0, false,
                  vec3[](vec3(0.0), vec3(0.0), vec3(0.0)), vec3(0.0));
    ways_found = 0;
    ways_left = 0;
}

// Constants say which roles the paths of a kernel may have, so that what belongs to others takes no place in it.
bool has_gathered()
{
    return (HAS_RECEIVERS || GATHER_RAYS != GATHER_NONE) && chain.role >= ROLE_GATHER;
}

bool gathers_in_air()
{
    return HAS_RECEIVERS && chain.role == ROLE_GATHER_IN_AIR;
}

bool is_other_way()
{
    return HAS_SPECULAR_CHAINS && chain.role == ROLE_SPLIT;
}

bool ends_at_light()
{
    return HAS_LAYERS && chain.role == ROLE_TO_LIGHT;
}

// The part of the picture that light of the current vertex belongs to, when it arrived in this way.
uint part_of(uint arrival)
{
    return chain.saw_specular ? PART_SPECULAR
         : has_gathered()     ? PART_INDIRECT
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
    return !chain.saw_specular && !has_gathered() && !ends_at_light();
}

// What emits light at the next vertex. Seen straight it is no light of surfaces.
void add_emission(vec3 radiance)
{
    vec3 light = chain.chance * chain.weight * radiance;
    if (HAS_SEEN_LIGHT && is_straight() && (PARTS & PART_DIRECT) != 0) {
        chain.seen += light;
    } else {
        add_weighted_light(light);
    }
}

// Notes what the latest shadow rays found; `weight` is what light at their point adds to the pixel.
void note_shadow_rays(uint pixel, vec3 weight)
{
    if (!light_arrived) {
        note_miss(pixel, HIT_SHADOW_RAY, weight * stopped_light);
    } else if (!is_reached(pixel, HIT_SHADOW_RAY)) {
        note_hit(pixel, HIT_SHADOW_RAY);
    }
    if (HAS_LIGHT_CLUSTERS || HAS_OPENINGS) {
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
    uint first = HAS_SHADOW_RAYS ? ARRIVED_CAUSTIC : ARRIVED_DIRECT;
    uint last = gathers ? ARRIVED_CAUSTIC : ARRIVED_INDIRECT;
    for (uint arrival = first; arrival <= last; arrival *= 2) {
        wanted |= (PARTS & part_of(arrival)) != 0 ? arrival : 0;
    }
    return wanted;
}

// Adds what emits light at the end of a ray, where light samples have not counted all of it; `light_density` is theirs.
void add_emission(vec3 radiance, float light_density)
{
    float share = 1.0;
    if (HAS_LAYERS && chain.density > 0.0) {
        share = divide(chain.density, chain.density + float(work.shadow_rays) * light_density);
    }
    add_emission(share * radiance);
}

bool gathers_here(Surface surface)
{
    return GATHER_RAYS == GATHER_ALL || (HAS_GLOSSY && GATHER_RAYS == GATHER_GLOSSY && surface.kind == SURFACE_GLOSSY);
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

// What emits light where the path leaves the scene.
void see_sky(uint emitter_count)
{
    if (chain.sees_emission) {
        float light_density = 0.0;
        if (HAS_LAYERS) {
            light_density = sky_light_density(emitter_count, chain.from, chain.from_normal, chain.direction);
        }
        vec3 radiance = environment_radiance(emitter_count, chain.direction);
        if (HAS_SKY_PICTURE && window.is_there && is_straight()) {
            radiance *= share_of_rays(emitters[emitter_count - 1], chain.direction);
        }
        add_emission(radiance, light_density);
    }
}

// What emits light where the path meets a surface.
void see_lamp(Surface surface, Hit hit, uint emitter_count)
{
    if (chain.sees_emission) {
        float light_density = 0.0;
        if (HAS_LAYERS && chain.density > 0.0 && surface.emission != vec3(0.0)) {
            light_density = lamp_light_density(emitter_count, hit, chain.from, surface.position);
        }
        add_emission(surface.emission, light_density);
    }
}

// Whether a ray leaves rough lobes of the eye's paths to see what emits light. A gather ray would leave them for other light.
bool seeks_light()
{
    return GATHER_RAYS == GATHER_NONE && !has_gathered() && (PARTS & part_of(ARRIVED_DIRECT)) != 0;
}

// A surface that the path has met.
struct Vertex {
    Surface surface;
    vec3 wo;
    bool is_layered;
    Lobes lobes; // of a layered surface
    Scatter scatter; // where the path goes on
    bool is_smooth; // and where it goes by a lobe that has one direction alone
    float rough; // probability of the lobes that photon maps know
    float chance; // chain.chance beyond
};

// Where the path of this thread is. No argument: NVIDIA's compiler copies it for each function (18 % of the time of view.comp on an H100).
Vertex vertex;

// The eye does not see the back of what has one side.
bool is_culled()
{
    return vertex.is_layered && !vertex.surface.scatters && !has_gathered() && !ends_at_light();
}

#include "world/scene/splitting.glsl"

// Random numbers: block 1 + VERTEX_BLOCKS * depth goes on, the one after it is for direct light.
uint block_at(uint depth)
{
    return 1 + VERTEX_BLOCKS * depth;
}

// Samples where the path goes on.
void sample_way(Draws draws, uint depth)
{
    vec3 u = stratified_at(own.number, own.pixel, block_at(depth), draws).zxy;
    vertex.scatter = sample_surface(vertex.surface, vertex.lobes, vertex.wo, u, depth, true);
    vertex.is_smooth = vertex.scatter.is_specular && vertex.scatter.density == 0.0;
    vertex.chance = chain.chance;
    if (follows_split_paths(depth) && !is_culled()) {
        vertex.chance *= leave_split_paths(u.x, depth);
    }
}

// Of a layered surface the lobe that is sampled says what it is to this path. All others are sampled only once the path leaves them
// (leave_surface()): few do, and what is sampled would wait in registers for the shadow rays.
void meet_surface(Hit hit, Draws draws, uint depth)
{
    vertex.wo = -chain.direction;
    vertex.surface = surface_at(hit, vertex.wo);
    vertex.is_layered = has_layers(vertex.surface.kind);
    vertex.rough = 1.0;
    if (vertex.is_layered) {
        uint channel = 1;
        if (HAS_DISPERSION && is_dispersive(vertex.surface, chain.media)) {
            // Once a path: of one channel it stays.
            channel = choose_channel(chain.weight, stratified_at(own.number, own.pixel, CHANNEL_BLOCK, draws).x);
            chain.weight = light_of_channel(chain.weight, channel);
        }
        vertex.lobes = lobes_at(vertex.surface, vertex.wo, chain.media, channel, depth);
        vertex.rough = rough_chance(vertex.lobes, vertex.surface.layers);
        sample_way(draws, depth);
    } else {
        vertex.scatter.passes = false;
        vertex.scatter.is_specular = vertex.is_smooth = is_specular(vertex.surface);
    }
}

// Goes straight on as if no surface were there.
void pass()
{
    if (is_culled()) {
        // It stops light samples.
        chain.density = 0.0;
    } else {
        chain.weight *= vertex.scatter.weight;
    }
    chain.chance = vertex.chance;
    chain.position = offset_origin(vertex.surface.position, vertex.surface.error, vertex.surface.ng, chain.direction);
}

// Adds direct light by shadow rays. Says whether any were asked for.
bool add_direct_light(uint emitter_count, Draws draws, uint block)
{
    bool wants_direct = (PARTS & part_of(ARRIVED_DIRECT)) != 0;
    chain.density = 0.0;
    if (!HAS_SHADOW_RAYS || is_other_way() || !(vertex.is_layered || (!vertex.scatter.is_specular && wants_direct))) {
        return false;
    }
    vec3 scale = vertex.is_layered ? vec3(1.0) : vertex.surface.base_colour * scatter_scale(vertex.surface.kind, vertex.surface.parameter);
    ShadingPoint here = ShadingPoint(vertex.surface, vertex.wo, vertex.lobes, chain.media, vertex.is_layered && seeks_light());
    vec3 light = scale * direct_light(here, emitter_count, draws, own.pixel, own.number, block);
    if (wants_direct) {
        add_light(light);
    }
    // Of what a gather ray meets the caustic map has counted the light of sharp lobes.
    if (vertex.is_layered && (!has_gathered() || gathers_in_air())) {
        bool saw_specular = chain.saw_specular;
        chain.saw_specular = saw_specular || !has_gathered();
        add_light(sharp_light);
        chain.saw_specular = saw_specular;
        chain.density = vertex.scatter.density;
        chain.from = vertex.surface.position;
        chain.from_normal = vertex.surface.ns;
    }
    note_shadow_rays(own.pixel, divide(chain.weight * scale, float(own.count)));
    return true;
}

// Leaves a visible point for rough lobes. Says whether a ray leaves it to gather light.
bool leave_point(bool for_all, uint pixel_count)
{
    Surface surface = vertex.surface;
    bool leads = !for_all || own.number == 0;
    bool gathers = leads && !has_gathered() && gathers_here(surface) && (PARTS & part_of(ARRIVED_INDIRECT)) != 0;
    uint arrivals = arrivals_wanted(gathers);
    arrivals = leads ? arrivals : arrivals & (HAS_CAUSTIC_MAP ? ARRIVED_CAUSTIC : 0);
    arrivals |= arrivals == 0 ? SEEN
                              : SEEN | (chain.saw_specular ? SEEN_OVER_SPECULAR : 0) | (has_gathered() ? SEEN_BY_GATHER : 0)
                                    | (for_all ? SEEN_FOR_ALL : 0);
    // What light goes on to the eye.
    vec3 scale = vertex.is_layered ? vec3(divide(0.31830988618379067, vertex.rough)) : surface.base_colour * scatter_scale(surface.kind, surface.parameter);
    uint place = place_of_point(chain.point_count++, own.place, pixel_count);
    visible_points[place] = VisiblePoint(surface.position, surface.plane, divide(chain.weight * scale, float(own.count)),
                                         surface.ns == surface.ng ? NONE : pack_normal(surface.ns), pack_direction(vertex.wo, 0), surface.parameter,
                                         surface.kind, arrivals);
    if (HAS_LAYERS) {
        write_rough_lobes(place, vertex.lobes);
    }
    return gathers;
}

// Leaves a visible point, and says what the path goes on for, if it does.
bool leave_matt_lobes(bool asked_lights, uint pixel_count)
{
    if (vertex.rough == 0.0) {
        return false;
    }
    // Where it is by chance that a path gets here, each counts for itself.
    bool for_all = !chain.saw_specular && !has_gathered() && vertex.rough == 1.0;
    if (leave_point(for_all, pixel_count)) {
        chain.role = ROLE_GATHER;
        chain.density = 0.0;
        chain.weight *= for_all ? float(own.count) : 1.0;
        // Shadow rays and the caustic map have counted what emits light from here on.
        chain.sees_emission = false;
        return true;
    }
    if (asked_lights && vertex.is_layered && seeks_light()) {
        chain.role = ROLE_TO_LIGHT;
        chain.density = density_of_rough_lobes(vertex.surface, vertex.lobes, vertex.wo, vertex.scatter.direction);
        return true;
    }
    return false;
}

// Goes on from a surface. Says whether the path does.
bool leave_surface(Draws draws, uint depth)
{
    if (!vertex.is_layered) {
        sample_way(draws, depth);
    }
    Surface surface = vertex.surface;
    Scatter scatter = vertex.scatter;
    chain.chance = vertex.is_smooth ? vertex.chance : 1.0;
    chain.is_smooth = chain.is_smooth && vertex.is_smooth;
    if (!scatter.alive) {
        return false;
    }
    if (depth >= ROULETTE_DEPTH) {
        float most = depth < LOSSLESS_DEPTH ? 1.0 : MAX_SURVIVAL;
        float survival = min(max(scatter.weight.x, max(scatter.weight.y, scatter.weight.z)), most);
        if (stratified_at(own.number, own.pixel, ROULETTE_BLOCK + depth, draws).x >= survival) {
            return false;
        }
        scatter.weight = divide(scatter.weight, survival);
    }
    if (surface.kind == SURFACE_PAPER_PHONG) {
        scatter.weight *= lobe_weight(surface.kind, surface.parameter, surface.ns, vertex.wo, scatter.direction);
    }
    chain.weight *= scatter.weight;
    // No caustic map holds what reaches a receiver in the air over mirrors and glass.
    chain.sees_emission = chain.sees_emission || (gathers_in_air() && scatter.is_specular);
    chain.saw_specular = chain.saw_specular || (scatter.is_specular && !has_gathered());
    if (HAS_MEDIA && vertex.is_layered && surface.layers.medium != 0 && dot(scatter.direction, surface.ng) < 0.0) {
        chain.media = media_beyond(surface, chain.media);
    }
    chain.position = offset_origin(surface.position, surface.error, surface.ng, scatter.direction);
    chain.direction = scatter.direction;
    return true;
}

// Follows the path of a sample to its next surface and over it; it is over `depth` surfaces already. Says whether it goes on.
bool step(uint pixel_count, Draws draws, uint emitter_count, uint depth)
{
    note_unless(is_finite(chain.position) && is_finite(chain.direction) && is_finite(chain.weight), NONFINITE_LIGHT, draws.domain,
                draws.round, own.pixel);
    Hit hit = closest_hit(chain.position, chain.direction);
    if (hit.triangle == NONE) {
        see_sky(emitter_count);
        return false;
    }
    if (HAS_MEDIA) {
        chain.weight *= transmittance(chain.media, hit.t);
    }
    meet_surface(hit, draws, depth);
    if (is_culled() || vertex.scatter.passes) {
        pass();
        return true;
    }
    if (HAS_PASSING && vertex.is_layered) {
        chain.weight *= divide(vertex.surface.layers.coverage, 1.0 - vertex.lobes.pass_chance);
    }
    bool is_unlit = vertex.is_layered && vertex.surface.layers.is_unlit;
    if (is_unlit && !has_gathered() && !ends_at_light()) {
        add_emission(vertex.surface.base_colour);
    }
    see_lamp(vertex.surface, hit, emitter_count);
    if (!vertex.surface.scatters || ends_at_light()) {
        return false;
    }
    if (HAS_SEEN_LIGHT) {
        chain.met_surface = chain.met_surface || (is_straight() && !is_unlit);
    }
    if (is_other_way() && !vertex.is_smooth) {
        return false;
    }
    bool asked_lights = add_direct_light(emitter_count, draws, block_at(depth) + 1);
    bool goes_on = vertex.scatter.is_specular ? HAS_SPECULAR_CHAINS || has_gathered() : leave_matt_lobes(asked_lights, pixel_count);
    return goes_on && leave_surface(draws, depth);
}

// Camera paths that are under way when their dispatch ends.
layout(set = 1, binding = 9, scalar) writeonly buffer NextCameraPaths { CameraPath next_camera_paths[]; };
// [0]: how many.
layout(set = 1, binding = 10, scalar) buffer CameraPathCounts { uint camera_path_counts[]; };

void put_off(uint depth)
{
    uint state = chain.role | uint(chain.saw_specular) << 3 | uint(chain.sees_emission) << 4 | uint(chain.met_surface) << 5
               | chain.point_count << 6 | depth << 8;
    next_camera_paths[atomicAdd(camera_path_counts[0], 1)] =
        CameraPath(chain.position, own, chain.direction, state, chain.weight, chain.chance, chain.media, chain.density, chain.from,
                   chain.from_normal);
}

// Takes up a path that was put off; its depth.
uint take_up(CameraPath path)
{
    start_chain(path.position, path.direction, path.weight);
    own = path.own;
    chain.chance = path.chance;
    chain.role = path.state & 7u;
    chain.saw_specular = (path.state & 8u) != 0;
    chain.sees_emission = (path.state & 16u) != 0;
    chain.met_surface = (path.state & 32u) != 0;
    chain.point_count = (path.state >> 6) & 3u;
    chain.media = path.media;
    chain.density = path.density;
    chain.from = path.from;
    chain.from_normal = path.from_normal;
    return path.state >> 8;
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
        if (goes_on && (is_other_way() || end == MAX_BOUNCES)) {
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
