// All lobes of a surface together: with which probability a path follows each, how they weigh light, and where a path goes on. Each lobe has
// a file in material/lobes.

#include "material/rough_brdf.glsl"
#include "material/lobes/transmission.glsl"
#include "material/lobes/diffuse_transmission.glsl"
#include "material/lobes/lambert.glsl"
#include "material/lobes/phong.glsl"
#include "material/lobes/mirror.glsl"
#include "material/lobes/glass.glsl"

bool has_layers(uint kind)
{
    return HAS_LAYERS && kind == SURFACE_LAYERED;
}

// With which probability a path from wo follows each lobe: as it takes a share of the light.
void set_chances(inout Lobes lobes, Surface surface, LayerAlbedos seen, float below_diffuse, float cosine)
{
    Layers layers = surface.layers;
    vec3 exact = vec3(0.0);
    if (HAS_TRANSMISSION && layers.transmission > 0.0) {
        exact = dielectric_reflectance(lobes.base, layers.is_solid, cosine);
    }
    float left_by_sheen = below_sheen(lobes.cover.sheen, seen.sheen);
    float below = (1.0 - seen.coat) * left_by_sheen;
    vec3 transmitted = transmission_along(lobes, layers, exact);
    float diffuse = diffuse_weight(surface, lobes.base, below_diffuse) * left_by_sheen;
    float sheen = (1.0 - left_by_sheen) * (1.0 - seen.coat);
    float reflection = reflection_weight(lobes.base, layers, seen, exact, cosine) * below;
    float coat = seen.coat;
    float transmission = largest(transmitted) * below;
    lobes.passing = vec3(0.0);
    lobes.pass_chance = 0.0;
    if (HAS_PASSING) {
        lobes.passing = vec3(1.0 - layers.coverage);
        if (HAS_TRANSMISSION && !layers.is_solid && layers.transmission > 0.0 && layers.alpha < DELTA_ALPHA) {
            lobes.passing += layers.coverage * below * transmitted;
            transmission = 0.0;
        }
        lobes.pass_chance = min(largest(lobes.passing), 1.0);
    }
    float sum = diffuse + sheen + reflection + coat + transmission;
    float beyond = 0.0;
    if (HAS_DIFFUSE_TRANSMISSION) {
        beyond = diffuse_transmission_weight(layers, lobes.base, below_diffuse) * left_by_sheen;
        sum += beyond;
    }
    float share = sum > 0.0 && !layers.is_unlit ? divide(1.0, sum) : 0.0;
    lobes.diffuse_chance = diffuse * share;
    lobes.sheen_chance = sheen * share;
    lobes.reflection_chance = reflection * share;
    lobes.coat_chance = coat * share;
    lobes.transmission_chance = transmission * share;
    lobes.beyond_chance = beyond * share;
}

// `eta`: index where wo is over that beyond, of a solid.
Lobes lobes_of(Surface surface, vec3 wo, float eta)
{
    Layers layers = surface.layers;
    float cosine = max(dot(surface.ns, wo), 1e-6);
    Lobes lobes;
    lobes.base = base_of(surface, eta);
    lobes.cover = cover_of(layers);
    LayerAlbedos seen = albedos_at(layers.alpha, lobes.cover, cosine, max(dot(layers.coat_normal, wo), 1e-6));
    lobes.cover.coat_albedo = seen.coat;
    lobes.cover.sheen_albedo = seen.sheen;

    vec2 bound = reflectance_bound(lobes.base, layers);
    lobes.rough.e0 = bound.x;
    lobes.rough.e90 = bound.y;
    lobes.rough.alpha = layers.alpha;
    float below_diffuse = share_below(layers, lobes.rough, seen, cosine), left = mean_share_below(layers, lobes.rough);
    float left_over = (0.31830988618379067 * divide(below_diffuse, max(left, 1e-6)));
    lobes.rough.diffuse = diffuse_colour(surface, lobes.base) * left_over;
    lobes.beyond = vec3(0.0);
    if (HAS_DIFFUSE_TRANSMISSION) {
        lobes.beyond = diffuse_transmission_colour(layers, lobes.base) * left_over;
    }
    lobes.transmitted = (1.0 - layers.metallic) * layers.transmission * surface.base_colour;
    bool is_in_map = is_rough_reflection(lobes, layers) && !layers.is_unlit;
    lobes.base.film.is_rough = uint(is_in_map);
    lobes.rough.f0 = is_in_map ? lobes.base.f0 : vec3(0.0);
    lobes.rough.f90 = is_in_map ? lobes.base.f90 : 0.0;
    if (layers.is_unlit) {
        lobes.rough.diffuse = vec3(0.0);
    }
    set_chances(lobes, surface, seen, below_diffuse, cosine);
    return lobes;
}

// Of a layered surface that a path meets in these media, which has met `depth` before, for light of a channel.
Lobes lobes_at(inout Surface surface, vec3 wo, uint media, uint channel, uint depth)
{
    float eta = index_ratio(surface, media, channel);
    surface.ns = normal_of_refraction(surface, wo, eta, depth);
    return lobes_of(surface, wo, eta);
}

// Probability of the rough lobes together, where the path does not pass.
float rough_chance(Lobes lobes, Layers layers)
{
    return lobes.diffuse_chance + lobes.sheen_chance + (is_rough_reflection(lobes, layers) ? lobes.reflection_chance : 0.0)
         + (is_rough(layers.coat_alpha) ? lobes.coat_chance : 0.0);
}

// Density with which the rough lobes together send a path along wi, 1/sr.
float density_of_rough_lobes(Surface surface, Lobes lobes, vec3 wo, vec3 wi)
{
    float density = (lobes.diffuse_chance + lobes.sheen_chance) * even_density(surface.ns, wi);
    if (is_rough_reflection(lobes, surface.layers)) {
        density += reflection_density(surface, lobes, wo, wi);
    }
    if (HAS_COATS && is_rough(surface.layers.coat_alpha)) {
        density += coat_density(surface, lobes, wo, wi);
    }
    return density;
}

// What the base reflects or transmits, at v.h.
vec3 base_colour_at(Lobes lobes, bool is_solid, float cosine, bool is_beyond)
{
    vec3 exact = vec3(0.0);
    if (HAS_TRANSMISSION && (is_beyond || lobes.base.exact_share > 0.0)) {
        exact = dielectric_reflectance(lobes.base, is_solid, cosine);
    }
    if (HAS_TRANSMISSION && is_beyond) {
        return transmission_colour(lobes, exact);
    }
    return reflection_colour(lobes.base, exact, cosine);
}

// BRDF or BTDF times cosine of what rays follow of the base that is no delta, beside which a light sample of this density counts in part.
vec3 sharp_base(Surface surface, Lobes lobes, LayerAlbedos towards_light, vec3 wo, vec3 wi, bool is_beyond, float light_density)
{
    Layers layers = surface.layers;
    float chance = is_beyond ? lobes.transmission_chance : (is_rough_reflection(lobes, layers) ? 0.0 : lobes.reflection_chance);
    if (layers.alpha < DELTA_ALPHA || chance <= 0.0) {
        return vec3(0.0);
    }
    Weighed found;
    if (HAS_TRANSMISSION && is_beyond) {
        found = weigh_transmission(surface, lobes, wo, wi);
    } else {
        found = weigh_reflection(base_facets(surface), wo, wi);
    }
    if (found.density <= 0.0) {
        return vec3(0.0);
    }
    vec3 colour = base_colour_at(lobes, layers.is_solid, found.along, is_beyond) * below_cover(lobes.cover, towards_light);
    return colour * (found.value * light_share(light_density, chance * found.density));
}

// What arrives from a direction, as rough and as sharp lobes weigh it: BRDF times cosine.
struct LobeLight {
    vec3 rough;
    vec3 sharp;
};

// `asks_rough`: rays of the rough lobes see the light, too.
LobeLight weigh_light(Surface surface, Lobes lobes, vec3 wo, vec3 wi, float light_density, bool asks_rough)
{
    LobeLight light = LobeLight(vec3(0.0), vec3(0.0));
    float cosine = dot(wi, surface.ns);
    LayerAlbedos towards_light = albedos_towards(surface, lobes.cover, wi);
    bool is_beyond = dot(wi, surface.ng) <= 0.0;
    if (!is_beyond && cosine > 0.0) {
        light.rough = rough_brdf(lobes.rough, lobes.cover, lobes.base.film, towards_light, surface.ns, wo, wi) * cosine;
        if (asks_rough) {
            light.rough *= light_share(light_density, density_of_rough_lobes(surface, lobes, wo, wi));
        }
    }
    light.sharp = sharp_base(surface, lobes, towards_light, wo, wi, is_beyond, light_density);
    if (HAS_DIFFUSE_TRANSMISSION && is_beyond) {
        light.sharp += sharp_diffuse_transmission(surface, lobes, towards_light, wi, light_density);
    }
    if (HAS_COATS && !is_beyond) {
        light.sharp += sharp_coat(surface, lobes, wo, wi, light_density);
    }
    return light;
}

const uint LOBE_DIFFUSE = 0;
const uint LOBE_REFLECTION = 1;
const uint LOBE_COAT = 2;
const uint LOBE_TRANSMISSION = 3;
const uint LOBE_SHEEN = 4;
const uint LOBE_DIFFUSE_TRANSMISSION = 5;

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
    return (lobe == LOBE_REFLECTION && is_smooth_reflection(layers, lobes))
        || (HAS_COATS && lobe == LOBE_COAT && is_smooth_coat(layers, lobes))
        || (HAS_TRANSMISSION && lobe == LOBE_TRANSMISSION && is_smooth_transmission(layers, lobes));
}

// Diffuse lobe, sheen and diffuse transmission: by the cosine.
Scatter sample_even_lobe(Surface surface, Lobes lobes, vec3 wo, vec2 u, ChosenLobe chosen)
{
    bool is_beyond = HAS_DIFFUSE_TRANSMISSION && chosen.lobe == LOBE_DIFFUSE_TRANSMISSION;
    vec3 n = is_beyond ? -surface.ns : surface.ns, side = is_beyond ? -surface.ng : surface.ng;
    vec3 wi = to_frame(sample_cosine_hemisphere(u.x, u.y), n);
    LayerAlbedos towards_light = albedos_towards(surface, lobes.cover, wi);
    Scatter scatter = Scatter(wi, vec3(0.0), dot(wi, side) > 0.0, is_beyond, false, 0.0);
    if (is_beyond) {
        scatter.weight = diffuse_transmission_btdf(lobes, towards_light);
        scatter.density = chosen.chance * even_density(n, wi);
        scatter.alive = scatter.alive && scatter.density > 0.0;
    } else if (HAS_SHEEN && chosen.lobe == LOBE_SHEEN) {
        scatter.weight = sheen_brdf(lobes.cover, towards_light, surface.ns, wo, wi);
    } else {
        scatter.weight = diffuse_brdf(lobes.rough, lobes.cover, towards_light);
    }
    scatter.weight *= divide(3.14159265358979324, chosen.chance);
    return scatter;
}

// Reflection, transmission and coat: by facets, as often as they are seen.
Scatter sample_facet_lobe(Surface surface, Lobes lobes, vec3 wo, vec2 u, ChosenLobe chosen, bool carries_radiance)
{
    Layers layers = surface.layers;
    bool is_coat = HAS_COATS && chosen.lobe == LOBE_COAT, is_beyond = HAS_TRANSMISSION && chosen.lobe == LOBE_TRANSMISSION;
    Facets facets = base_facets(surface);
    if (is_coat) {
        facets = coat_facets(surface);
    }
    bool is_delta = facets.alpha < DELTA_ALPHA || (is_beyond && goes_straight(layers, lobes));
    SampledFacet facet = sample_facet(facets, is_delta, wo, u, chosen.chance);
    vec3 wi;
    if (is_beyond) {
        wi = transmit_at_facet(surface, lobes, facet, wo);
    } else {
        wi = reflect_at_facet(facet, wo);
    }
    float cos_l = is_beyond ? -dot(wi, facets.n) : dot(wi, facets.n);
    Scatter scatter = leave_facet(facets, facet, wo, wi, cos_l, is_beyond ? -surface.ng : surface.ng, chosen.chance);
    scatter.weight *= carries_radiance && is_beyond && layers.is_solid ? lobes.base.eta * lobes.base.eta : 1.0;
    if (is_coat) {
        scatter.weight *= coat_colour(layers.coat, facet.along);
        scatter.is_specular = !is_rough(facets.alpha);
    } else {
        LayerAlbedos towards_light = albedos_towards(surface, lobes.cover, scatter.direction);
        scatter.weight *= base_colour_at(lobes, layers.is_solid, facet.along, is_beyond) * below_cover(lobes.cover, towards_light);
        scatter.is_specular = is_beyond || !is_rough_reflection(lobes, layers);
    }
    return scatter;
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
    if (chosen.lobe == LOBE_DIFFUSE || chosen.lobe == LOBE_SHEEN || chosen.lobe == LOBE_DIFFUSE_TRANSMISSION) {
        return sample_even_lobe(surface, lobes, wo, u.yz, chosen);
    }
    return sample_facet_lobe(surface, lobes, wo, u.yz, chosen, carries_radiance);
}

// Samples where a path goes on that came from wo; u = (choice, two for the direction). A camera path carries radiance, which refraction
// compresses; a photon carries flux. The path has met `depth` surfaces before. `lobes` are those of a layered surface.
Scatter sample_surface(Surface surface, Lobes lobes, vec3 wo, vec3 u, uint depth, bool carries_radiance)
{
    if (has_layers(surface.kind)) {
        return sample_layered(surface, lobes, wo, u, carries_radiance);
    }
    if (HAS_MIRROR && surface.kind == SURFACE_MIRROR) {
        return sample_mirror(surface, wo);
    }
    if (HAS_DIELECTRIC && surface.kind == SURFACE_DIELECTRIC) {
        return sample_glass(surface, wo, u.x, depth, carries_radiance);
    }
    if (HAS_GLOSSY && surface.kind == SURFACE_GLOSSY) {
        return sample_glossy(surface, wo, u.yz);
    }
    return sample_lambert(surface, u.yz);
}
