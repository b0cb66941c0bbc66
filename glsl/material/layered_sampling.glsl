// Where a path goes on from a layered surface.

const uint LOBE_DIFFUSE = 0;
const uint LOBE_REFLECTION = 1;
const uint LOBE_COAT = 2;
const uint LOBE_TRANSMISSION = 3;
const uint LOBE_SHEEN = 4;
const uint LOBE_DIFFUSE_TRANSMISSION = 5;

const float SAME_INDEX = 1e-4;

struct ChosenLobe {
    uint lobe;
    float chance;
    float end; // sum of the chances so far
};

// Lobes without a chance are never chosen, and the last one that has some catches what rounding leaves below 1.
void consider(inout ChosenLobe chosen, uint lobe, float chance, float u)
{
    if (chance > 0.0 && u >= chosen.end) {
        chosen.lobe = lobe;
        chosen.chance = chance;
    }
    chosen.end += chance;
}

ChosenLobe choose_lobe(Lobes lobes, float u)
{
    ChosenLobe chosen = ChosenLobe(LOBE_DIFFUSE, lobes.diffuse_chance, lobes.diffuse_chance);
    consider(chosen, LOBE_REFLECTION, lobes.reflection_chance, u);
    if (HAS_COATS) {
        consider(chosen, LOBE_COAT, lobes.coat_chance, u);
    }
    if (HAS_TRANSMISSION) {
        consider(chosen, LOBE_TRANSMISSION, lobes.transmission_chance, u);
    }
    if (HAS_SHEEN) {
        consider(chosen, LOBE_SHEEN, lobes.sheen_chance, u);
    }
    if (HAS_DIFFUSE_TRANSMISSION) {
        consider(chosen, LOBE_DIFFUSE_TRANSMISSION, lobes.beyond_chance, u);
    }
    return chosen;
}

// Whether light may leave by this lobe in one direction alone.
bool is_smooth_lobe(Layers layers, Lobes lobes, uint lobe)
{
    bool is_smooth = false;
    if (lobe == LOBE_REFLECTION) {
        is_smooth = lobes.reflection_chance > 0.0 && layers.alpha < DELTA_ALPHA;
    }
    if (HAS_COATS) {
        if (lobe == LOBE_COAT) {
            is_smooth = lobes.coat_chance > 0.0 && layers.coat_alpha < DELTA_ALPHA;
        }
    }
    if (HAS_TRANSMISSION) {
        if (lobe == LOBE_TRANSMISSION) {
            bool goes_straight = layers.is_solid && abs(lobes.eta - 1.0) < SAME_INDEX;
            is_smooth = lobes.transmission_chance > 0.0 && (layers.alpha < DELTA_ALPHA || goes_straight);
        }
    }
    return is_smooth;
}

// A direction by the cosine, for the diffuse lobe or the sheen.
Scatter sample_broad_lobe(Surface surface, Lobes lobes, vec3 wo, vec2 u, ChosenLobe chosen)
{
    vec3 wi = to_frame(sample_cosine_hemisphere(u.x, u.y), surface.ns);
    LayerAlbedos lit = albedos_towards(surface, lobes.cover, wi);
    vec3 brdf = chosen.lobe == LOBE_SHEEN ? sheen_brdf(lobes.cover, lit, surface.ns, wo, wi) : diffuse_brdf(lobes.matt, lobes.cover, lit);
    bool is_alive = dot(wi, surface.ng) > 0.0;
    return Scatter(wi, brdf * divide(3.14159265358979324, chosen.chance), is_alive, false, false, 0.0);
}

// The same on the other side.
Scatter sample_beyond(Surface surface, Lobes lobes, vec2 u, ChosenLobe chosen)
{
    vec3 wi = to_frame(sample_cosine_hemisphere(u.x, u.y), -surface.ns);
    float cosine = max(-dot(wi, surface.ns), 0.0);
    LayerAlbedos lit = albedos_towards(surface, lobes.cover, wi);
    vec3 btdf = below_all(lobes.beyond, lobes.matt, lobes.cover, lit);
    float density = chosen.chance * (0.31830988618379067 * cosine);
    return Scatter(wi, btdf * divide(3.14159265358979324, chosen.chance), dot(wi, surface.ng) < 0.0 && density > 0.0, true, false, density);
}

// Light that a facet reflects or transmits. The normals of facets are sampled as often as they are seen.
Scatter sample_facet(Surface surface, Lobes lobes, vec3 wo, vec2 u, ChosenLobe chosen, bool carries_radiance)
{
    Layers layers = surface.layers;
    bool is_coat = chosen.lobe == LOBE_COAT, is_beyond = chosen.lobe == LOBE_TRANSMISSION;
    bool is_refracted = is_beyond && layers.is_solid;
    Facets facets = base_facets(surface);
    if (is_coat) {
        facets = coat_facets(surface);
    }
    vec3 n = facets.n;
    bool goes_straight = is_refracted && abs(lobes.eta - 1.0) < SAME_INDEX;
    bool is_delta = facets.alpha < DELTA_ALPHA || goes_straight;

    vec3 h = n;
    float density = 0.0;
    float cos_v = max(dot(wo, n), 1e-6);
    float masking = facet_masking(facets, wo, cos_v);
    if (!is_delta) {
        vec3 local = sample_visible_normal(facets, to_facets(facets, wo), u);
        density = chosen.chance * masking * facet_density(facets, local);
        h = from_facets(facets, local);
    }
    float along = clamp(dot(wo, h), 0.0, 1.0);
    vec3 wi = 2.0 * along * h - wo;
    bool is_alive = true;
    if (is_refracted) {
        float cos_t_squared = refracted_cosine_squared(along, lobes.eta);
        float l_h = sqrt(max(cos_t_squared, 0.0));
        float spread = lobes.eta * along - l_h;
        is_alive = cos_t_squared > 0.0;
        wi = goes_straight ? -wo : normalize(spread * h - lobes.eta * wo);
        density *= along * divide(l_h, max(spread * spread, 1e-12));
    } else {
        wi = is_beyond ? wi - 2.0 * dot(wi, n) * n : wi;
        density *= 0.25;
    }
    vec3 side = is_beyond ? -surface.ng : surface.ng;
    float cos_l = is_beyond ? -dot(wi, n) : dot(wi, n);
    float weight = divide(1.0, chosen.chance);
    if (is_delta) {
        wi = goes_straight ? wi : on_side(wi, side);
    } else {
        is_alive = is_alive && cos_l > 0.0;
        weight *= divide(4.0 * facet_visibility(facets, wi, wo, max(cos_l, 1e-6), cos_v) * cos_l, masking);
    }
    is_alive = is_alive && (goes_straight || dot(wi, side) > 0.0);
    weight *= carries_radiance && is_refracted ? lobes.eta * lobes.eta : 1.0;
    vec3 colour = vec3(coat_colour(layers.coat, along));
    bool is_sharp = !is_matt(facets.alpha);
    if (!is_coat) {
        LayerAlbedos lit = albedos_towards(surface, lobes.cover, wi);
        colour = base_lobe_colour(lobes, layers.is_solid, along, is_beyond) * below_cover(lobes.cover, lit);
        is_sharp = is_beyond || !is_matt_reflection(lobes, layers);
    }
    return Scatter(wi, weight * colour, is_alive, is_sharp, false, density);
}

// u.x chooses the lobe, the others the direction. A path that does not pass keeps the share `coverage` over one less the probability of
// passing, which the weight leaves to the caller.
Scatter sample_layered(Surface surface, Lobes lobes, vec3 wo, vec3 u, bool carries_radiance)
{
    if (HAS_PASSING) {
        if (u.y < lobes.pass_chance) {
            return Scatter(-wo, divide(lobes.passing, lobes.pass_chance), true, false, true, 0.0);
        }
        u.y = divide(u.y - lobes.pass_chance, 1.0 - lobes.pass_chance);
    }
    ChosenLobe chosen = choose_lobe(lobes, u.x);
    if (chosen.chance <= 0.0) {
        return Scatter(-wo, vec3(0.0), false, false, false, 0.0);
    }
    if (chosen.lobe == LOBE_DIFFUSE || chosen.lobe == LOBE_SHEEN) {
        return sample_broad_lobe(surface, lobes, wo, u.yz, chosen);
    }
    if (HAS_DIFFUSE_TRANSMISSION) {
        if (chosen.lobe == LOBE_DIFFUSE_TRANSMISSION) {
            return sample_beyond(surface, lobes, u.yz, chosen);
        }
    }
    return sample_facet(surface, lobes, wo, u.yz, chosen, carries_radiance);
}
