// Both ways at smooth glass. Where the eye's path meets a surface that sends light on in several directions, each without any spread, it
// takes one of them by chance, as what scatters beyond varies little. What emits light may be brighter than all else, a lamp in glass
// that shows 4 % of it for example. So the other ways are followed too, for emission alone, and the path counts emission as
// if it had been certain to take its own: all of it is then counted once, and none by chance.

// At few surfaces of a path, and so many ways in all.
const uint DEPTH_OF_WAYS = 8;
const uint MOST_WAYS = 4;
// Surfaces that another way is followed over: roulette ends nearly all before.
const uint STEPS_OF_WAY = 2 * LOSSLESS_DEPTH;
const bool RAYS_HIT_LIGHTS = HAS_ENVIRONMENT || HAS_TRIANGLE_LIGHTS || HAS_DISC_LIGHTS;

struct Way {
    vec3 position;
    vec3 direction;
    vec3 weight;
    uint media;
    uint depth; // twice, plus 1 where it has seen a specular surface
};

Way ways[MOST_WAYS];

bool follows_split_paths(uint depth)
{
    return HAS_SPECULAR_CHAINS && RAYS_HIT_LIGHTS && chain.is_smooth && !has_gathered() && depth < DEPTH_OF_WAYS;
}

// A way whose light counts `weight` times beside the path's own. `media` is what it runs through.
void add_way(Surface surface, Scatter scatter, vec3 weight, uint media, uint depth)
{
    weight *= chain.chance * chain.weight;
    if (scatter.alive && weight != vec3(0.0)) {
        vec3 position = offset_origin(surface.position, surface.error, surface.ng, scatter.direction);
        bool saw_specular = chain.saw_specular || scatter.is_specular;
        ways[ways_left++] = Way(position, scatter.direction, weight, media, 2 * (depth + 1) + uint(saw_specular));
    }
}

// Leaves a way for later at glass of which the path took the other, and says by what chance.
float part_at_glass(Surface surface, vec3 wo, bool reflects, uint depth)
{
    Glass glass = glass_at(surface, wo, depth);
    if (glass.reflectance == 0.0 || glass.reflectance == 1.0 || ways_found + 2 > MOST_WAYS) {
        return 1.0;
    }
    ways_found++;
    float chance = reflects ? glass.reflectance : 1.0 - glass.reflectance;
    Scatter other = way_of_glass(surface, glass, wo, !reflects, true);
    add_way(surface, other, (1.0 - chance) * other.weight, chain.media, depth);
    return chance;
}

// The same at a layered surface, whose own way is by `chosen`, or passes.
float part_at_layers(Surface surface, Lobes lobes, vec3 wo, ChosenLobe chosen, bool passes, uint depth)
{
    float pass_chance = 0.0;
    float coverage = 1.0;
    if (HAS_PASSING) {
        pass_chance = lobes.pass_chance;
        coverage = surface.layers.coverage;
    }
    // The same whatever the path took.
    uint smooth_count = pass_chance > 0.0 && pass_chance < 1.0 ? 1 : 0;
    for (uint lobe = LOBE_REFLECTION; lobe <= LOBE_TRANSMISSION; lobe++) {
        smooth_count += is_smooth_lobe(surface.layers, lobes, lobe) ? 1 : 0;
    }
    bool is_own_smooth = passes || is_smooth_lobe(surface.layers, lobes, chosen.lobe);
    if (pass_chance >= 1.0 || ways_found + smooth_count > MOST_WAYS) {
        return 1.0;
    }
    for (uint lobe = LOBE_REFLECTION; lobe <= LOBE_TRANSMISSION; lobe++) {
        if ((passes || lobe != chosen.lobe) && is_smooth_lobe(surface.layers, lobes, lobe)) {
            Scatter other = sample_facet_lobe(surface, lobes, wo, vec2(0.5), ChosenLobe(lobe, 1.0, 1.0), true);
            uint media = chain.media;
            if (HAS_MEDIA && surface.layers.medium != 0 && dot(other.direction, surface.ng) < 0.0) {
                media = media_beyond(surface, media);
            }
            ways_found++;
            add_way(surface, other, coverage * other.weight, media, depth);
        }
    }
    if (HAS_PASSING && !passes && pass_chance > 0.0) {
        ways_found++;
        add_way(surface, Scatter(-wo, lobes.passing, true, false, true, 0.0), lobes.passing, chain.media, depth);
    }
    return passes ? pass_chance : (is_own_smooth ? (1.0 - pass_chance) * chosen.chance : 1.0);
}

// The same at any surface, where u has chosen the lobe of the path's own way.
float leave_split_paths(float u, uint depth)
{
    if (vertex.is_layered) {
        return part_at_layers(vertex.surface, vertex.lobes, vertex.wo, choose_lobe(vertex.lobes, u), vertex.scatter.passes, depth);
    }
    if (HAS_DIELECTRIC && vertex.surface.kind == SURFACE_DIELECTRIC) {
        return part_at_glass(vertex.surface, vertex.wo, dot(vertex.scatter.direction, vertex.surface.ng) > 0.0, depth);
    }
    return 1.0;
}

// Goes on with a way that was left; its depth.
uint take_way()
{
    Way way = ways[--ways_left];
    chain.position = way.position;
    chain.direction = way.direction;
    chain.weight = way.weight;
    chain.media = way.media;
    chain.role = ROLE_SPLIT;
    chain.saw_specular = (way.depth & 1u) != 0;
    chain.chance = 1.0;
    chain.is_smooth = true;
    chain.sees_emission = true;
    chain.density = 0.0;
    return way.depth >> 1;
}
