// Direct light by shadow rays.

// A point that light arrives at: of a surface, or a receiver.
struct ShadingPoint {
    Surface surface;
    vec3 wo;
    Lobes lobes; // of a layered surface
    uint media; // on the side of wo
    bool asks_lobes; // a ray of its rough lobes sees lights, too
};

ShadingPoint receiver_at(vec3 position, float error, vec3 ng, vec3 ns)
{
    ShadingPoint point;
    point.surface.position = position;
    point.surface.error = error;
    point.surface.ng = ng;
    point.surface.ns = ns;
    point.surface.kind = SURFACE_RECEIVER;
    point.surface.parameter = 0.0;
    point.wo = ns;
    point.media = 0;
    point.asks_lobes = false;
    return point;
}

// What a layered surface lets pass straight.
vec3 passing_at(Hit hit, vec3 wo, uint media)
{
    if (HAS_PANES && layered_materials[triangles[hit.triangle].material].transmission > 0.0) {
        Surface surface = surface_at(hit, wo);
        return lobes_of(surface, wo, index_ratio(surface, media, 1)).passing;
    }
    SurfaceMaterial material = materials[triangles[hit.triangle].material];
    return vec3(1.0 - coverage_of(material, hit.triangle, hit.u, hit.v));
}

// What passes straight along a way that ends at t_max of it: all, nothing, or the share that thin walls and gaps of alpha leave.
vec3 light_through(vec3 start, vec3 way, float t_max, uint media)
{
    vec3 left = vec3(1.0);
    if (HAS_MEDIA) {
        // What has no end leaves the medium through a wall, which hides it.
        left = t_max == 1.0 ? transmittance(media, norm(way)) : left;
    }
    if (HAS_PASSING) {
        vec3 share = left;
        vec3 wo = -normalize(way);
        for (uint sheet = 0; sheet < MAX_BOUNCES; sheet++) {
            Hit hit = traverse(start, way, t_max, false);
            if (hit.triangle == NONE) {
                return share;
            }
            if (materials[triangles[hit.triangle].material].surface != SURFACE_LAYERED) {
                return vec3(0.0);
            }
            share *= passing_at(hit, wo, media);
            if (largest(share) == 0.0) {
                return share;
            }
            Triangle triangle = triangles[hit.triangle];
            vec3 next = offset_origin(triangle_point(triangle, hit.u, hit.v), triangle_error(triangle), triangle_normal(triangle), way);
            // To the same end.
            if (t_max == 1.0) {
                way = start + way - next;
            }
            start = next;
        }
        return vec3(0.0);
    }
    return traverse(start, way, t_max, true).triangle == NONE ? left : vec3(0.0);
}

// What a shadow ray found: light times lobe and cosine, irradiance where there is no lobe, and whether something stands before it.
struct ShadowRay {
    vec3 light;
    vec3 sharp_light; // by lobes that rays follow
    bool is_asked; // light may arrive from there
    bool is_hidden;
};

ShadowRay cast_shadow_ray(ShadingPoint point, Arriving arriving, Draws draws, uint index)
{
    ShadowRay ray = ShadowRay(vec3(0.0), vec3(0.0), false, false);
    Surface surface = point.surface;
    float cosine = dot(arriving.wi, surface.ns);
    // Before the guards below, which would drop what is no number.
    note_unless(is_finite(cosine) && is_finite(arriving.radiance) && (arriving.is_far || is_finite(arriving.target)), NONFINITE_LIGHT,
                draws.domain, draws.round, index);
    vec3 leaves_along = surface.ng;
    uint media = point.media;
    if (largest(arriving.radiance) > 0.0) {
        if (has_layers(surface.kind)) {
            LobeLight light = weigh_light(surface, point.lobes, point.wo, arriving.wi, float(work.shadow_rays) * arriving.density, point.asks_lobes);
            ray.light = arriving.radiance * light.rough;
            ray.sharp_light = arriving.radiance * light.sharp;
            ray.is_asked = largest(ray.light) > 0.0 || largest(ray.sharp_light) > 0.0;
            leaves_along = arriving.wi;
            if (HAS_MEDIA && surface.layers.medium != 0 && dot(arriving.wi, surface.ng) < 0.0) {
                media = media_beyond(surface, media);
            }
        } else if (cosine > 0.0 && dot(arriving.wi, surface.ng) > 0.0) {
            ray.light = arriving.radiance * (cosine * lobe_weight(surface.kind, surface.parameter, surface.ns, point.wo, arriving.wi));
            ray.is_asked = true;
        }
    }
    if (ray.is_asked) {
        vec3 start = offset_origin(surface.position, surface.error, surface.ng, leaves_along);
        vec3 way = arriving.is_far ? arriving.wi : arriving.target - start;
        vec3 share = light_through(start, way, arriving.is_far ? uintBitsToFloat(0x7f7fffffu) : 1.0, media);
        ray.is_hidden = share == vec3(0.0);
        // What is hidden still has its light: that which was stopped.
        share = ray.is_hidden ? vec3(1.0) : share;
        ray.light *= share;
        ray.sharp_light *= share;
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

// What sharp lobes make of it.
vec3 sharp_light = vec3(0.0);

// What arrives straight from lights, times lobe and cosine: irradiance where there is no lobe. The rays of all samples of
// the place `index` in a block of rounds share random numbers.
vec3 direct_light(ShadingPoint point, uint emitter_count, Draws draws, uint index, uint number, uint block)
{
    Surface surface = point.surface;
    vec3 sum = vec3(0.0);
    stopped_light = vec3(0.0);
    light_arrived = false;
    stopped_unseen_light = vec3(0.0);
    unseen_light_arrived = false;
    sharp_light = vec3(0.0);
    if (emitter_count == 0) {
        return sum;
    }
    uvec4 words = words_of(index, block, draws);
    number = number_in_block(number, own.count, draws);
    uint sample_count = own.count * work.rounds_per_block;
    uint ray_count = work.shadow_rays;
    uint unseen_row = 0;
    if (HAS_LIGHT_CLUSTERS) {
        unseen_row = row_of_shares(surface.position, surface.ng, false);
        bool asks_unseen = ((number + mix32(words.x + words.y)) & (SAMPLES_PER_UNSEEN - 1)) == 0 && !is_empty(unseen_row);
        ray_count += uint(asks_unseen);
    }
    for (uint ray = 0; ray < ray_count; ray++) {
        vec3 u = stratified(number * work.shadow_rays + ray, sample_count * work.shadow_rays, words);
        Emitter light;
        float by_power = 0.0;
        float count = 1.0;
        if (HAS_LIGHT_CLUSTERS) {
            uint row = unseen_row - cluster_count();
            if (ray == work.shadow_rays) {
                row = unseen_row;
                u = stratified(number, sample_count, uvec4(mix32(words.x), mix32(words.y), mix32(words.z), mix32(words.w)));
                // For the samples that cast none.
                count = float(SAMPLES_PER_UNSEEN * work.shadow_rays);
            }
            ChosenLight chosen = choose_light(row, surface.position, u.z, mix32(words.w + (number * (work.shadow_rays + 1) + ray)));
            light = emitters[chosen.emitter];
            by_power = light.probability;
            light.probability = chosen.probability;
        } else {
            light = emitters[pick_emitter(emitter_count, u.z)];
            by_power = light.probability;
        }
        Arriving arriving = sample_light(light, surface.position, surface.ns, u.xy);
        if (HAS_LAYERS) {
            // Both samplings weigh each other as if lights were chosen by power everywhere: shares that add up to 1 make no bias.
            arriving.density *= by_power;
        }
        ShadowRay found = cast_shadow_ray(point, arriving, draws, index);
        if (found.is_asked) {
            bool is_unseen = ray == work.shadow_rays || arriving.is_beside;
            if (!found.is_hidden) {
                sum += count * found.light;
                sharp_light += count * found.sharp_light;
                light_arrived = true;
                unseen_light_arrived = unseen_light_arrived || is_unseen;
            } else {
                bool is_certain = light.kind == EMITTER_POINT || light.kind == EMITTER_SPOT || light.kind == EMITTER_DIRECTIONAL;
                vec3 stopped = is_certain ? vec3(0.0) : divide(count * (found.light + found.sharp_light), float(work.shadow_rays));
                stopped_light = max(stopped_light, stopped);
                stopped_unseen_light = is_unseen ? max(stopped_unseen_light, stopped) : stopped_unseen_light;
            }
        }
    }
    sharp_light = divide(sharp_light, float(work.shadow_rays));
    return divide(sum, float(work.shadow_rays));
}
