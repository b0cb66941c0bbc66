// Direct light by shadow rays.

// A point that light arrives at: a surface, or a receiver.
struct Target {
    vec3 position;
    float error;
    vec3 ng;
    vec3 ns;
    vec3 wo;
    uint kind;
    float exponent;
};

// What a shadow ray found: light times lobe and cosine, irradiance where there is no lobe, and whether something stands before it.
struct ShadowRay {
    vec3 light;
    bool is_asked; // light may arrive from there
    bool is_hidden;
};

ShadowRay cast_shadow_ray(Target point, Arriving arriving, Draws draws, uint index)
{
    ShadowRay ray = ShadowRay(vec3(0.0), false, false);
    float cosine = dot(arriving.wi, point.ns);
    // Before the guards below, which would drop what is no number.
    note_unless(is_finite(cosine) && is_finite(arriving.radiance) && (arriving.is_far || is_finite(arriving.target)), NONFINITE_LIGHT,
                draws.domain, draws.round, index);
    if (cosine > 0.0 && dot(arriving.wi, point.ng) > 0.0 && max(arriving.radiance.x, max(arriving.radiance.y, arriving.radiance.z)) > 0.0) {
        vec3 start = offset_origin(point.position, point.error, point.ng, point.ng);
        ray.is_asked = true;
        ray.is_hidden = arriving.is_far ? traverse(start, arriving.wi, uintBitsToFloat(0x7f7fffffu), true).triangle != NONE
                                        : is_occluded(start, arriving.target - start);
        ray.light = arriving.radiance * (cosine * lobe_weight(point.kind, point.exponent, point.ns, point.wo, arriving.wi));
    }
    return ray;
}

// Of the place that was asked last: the most that one shadow ray would have added which something stopped, and whether some
// light arrived. A ray to a point or along a direction finds the same each time, so that one that is stopped is no chance
// missed.
vec3 stopped_light = vec3(0.0);
bool light_arrived = false;
// The same of the lights that a trial has not seen from round about, and of the sky beside the openings that it has found.
vec3 stopped_unseen_light = vec3(0.0);
bool unseen_light_arrived = false;

// One sample in so many casts a ray more, to the lights that a trial has not seen from round about.
const uint SAMPLES_PER_UNSEEN = 4;

// What arrives straight from lights, times lobe and cosine: irradiance where there is no lobe. The rays of all samples of
// the place `index` share a block of random numbers.
vec3 direct_light(Target point, uint emitter_count, Draws draws, uint index, uint number, uint block)
{
    vec3 sum = vec3(0.0);
    stopped_light = vec3(0.0);
    light_arrived = false;
    stopped_unseen_light = vec3(0.0);
    unseen_light_arrived = false;
    if (emitter_count == 0) {
        return sum;
    }
    uvec4 words = words_of(index, block, draws);
    uint ray_count = SHADOW_RAYS;
    uint unseen_row = 0;
    if (LIGHT_CLUSTERS != 0) {
        unseen_row = row_of_shares(point.position, point.ng, false);
        bool asks_unseen = ((number + mix32(words.x + words.y)) & (SAMPLES_PER_UNSEEN - 1)) == 0 && !is_empty(unseen_row);
        ray_count += uint(asks_unseen);
    }
    for (uint ray = 0; ray < ray_count; ray++) {
        vec3 u = stratified(number * SHADOW_RAYS + ray, SAMPLES * SHADOW_RAYS, words);
        Emitter light;
        float count = 1.0;
        if (LIGHT_CLUSTERS != 0) {
            uint row = unseen_row - LIGHT_CLUSTERS;
            if (ray == SHADOW_RAYS) {
                row = unseen_row;
                u = stratified(number, SAMPLES, uvec4(mix32(words.x), mix32(words.y), mix32(words.z), mix32(words.w)));
                // For the samples that cast none.
                count = float(SAMPLES_PER_UNSEEN * SHADOW_RAYS);
            }
            ChosenLight chosen = choose_light(row, point.position, u.z, mix32(words.w + (number * (SHADOW_RAYS + 1) + ray)));
            light = emitters[chosen.emitter];
            light.probability = chosen.probability;
        } else {
            light = emitters[pick_emitter(emitter_count, u.z)];
        }
        Arriving arriving = sample_light(light, point.position, point.ns, u.xy);
        ShadowRay found = cast_shadow_ray(point, arriving, draws, index);
        if (found.is_asked) {
            bool is_unseen = ray == SHADOW_RAYS || arriving.is_beside;
            if (!found.is_hidden) {
                sum += count * found.light;
                light_arrived = true;
                unseen_light_arrived = unseen_light_arrived || is_unseen;
            } else {
                bool is_certain = light.kind == EMITTER_POINT || light.kind == EMITTER_SPOT || light.kind == EMITTER_DIRECTIONAL;
                vec3 stopped = is_certain ? vec3(0.0) : divide(count * found.light, float(SHADOW_RAYS));
                stopped_light = max(stopped_light, stopped);
                stopped_unseen_light = is_unseen ? max(stopped_unseen_light, stopped) : stopped_unseen_light;
            }
        }
    }
    return divide(sum, float(SHADOW_RAYS));
}
