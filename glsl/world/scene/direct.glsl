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

// Of the place that was asked last: the most that one shadow ray would have added which something stopped, and whether some
// light arrived. A ray to a point or along a direction finds the same each time, so that one that is stopped is no chance
// missed.
vec3 stopped_light = vec3(0.0);
bool light_arrived = false;

// What arrives straight from lights, times lobe and cosine: irradiance where there is no lobe. The rays of all samples of
// the place `index` share a block of random numbers.
vec3 direct_light(Target point, uint emitter_count, Draws draws, uint index, uint number, uint block)
{
    vec3 sum = vec3(0.0);
    stopped_light = vec3(0.0);
    light_arrived = false;
    if (emitter_count == 0) {
        return sum;
    }
    uvec4 words = words_of(index, block, draws);
    for (uint ray = 0; ray < SHADOW_RAYS; ray++) {
        vec3 u = stratified(number * SHADOW_RAYS + ray, SAMPLES * SHADOW_RAYS, words);
        Arriving arriving = sample_light(emitter_count, point.position, point.ns, u);
        float cosine = dot(arriving.wi, point.ns);
        // Before the guards below, which would drop what is no number.
        note_unless(is_finite(cosine) && is_finite(arriving.radiance) && (arriving.is_far || is_finite(arriving.target)), NONFINITE_LIGHT,
                    draws.domain, draws.round, index);
        if (cosine > 0.0 && dot(arriving.wi, point.ng) > 0.0 && max(arriving.radiance.x, max(arriving.radiance.y, arriving.radiance.z)) > 0.0) {
            vec3 start = offset_origin(point.position, point.error, point.ng, point.ng);
            bool hidden = arriving.is_far ? traverse(start, arriving.wi, uintBitsToFloat(0x7f7fffffu), true).triangle != NONE
                                          : is_occluded(start, arriving.target - start);
            vec3 light = arriving.radiance * (cosine * lobe_weight(point.kind, point.exponent, point.ns, point.wo, arriving.wi));
            if (!hidden) {
                sum += light;
                light_arrived = true;
            } else {
                uint kind = emitters[pick_emitter(emitter_count, u.z)].kind;
                bool is_certain = kind == EMITTER_POINT || kind == EMITTER_SPOT || kind == EMITTER_DIRECTIONAL;
                stopped_light = is_certain ? stopped_light : max(stopped_light, divide(light, float(SHADOW_RAYS)));
            }
        }
    }
    return divide(sum, float(SHADOW_RAYS));
}
