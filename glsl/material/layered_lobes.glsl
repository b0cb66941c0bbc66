// The lobes of a layered surface as they are seen from a direction: what each weighs, how it is sampled, and which belong to photon
// maps. The guide's page on materials has the formulas.

#include "material/albedo.glsl"
#include "material/ggx.glsl"
#include "material/matt_lobes.glsl"

// Number of each lobe, and how many there are.
const uint LOBE_DIFFUSE = 0;
const uint LOBE_SHEEN = 1;
const uint LOBE_REFLECTION = 2;
const uint LOBE_COAT = 3;
const uint LOBE_TRANSMISSION = 4;

struct Lobes {
    MattLobes matt;
    MattCover cover;
    // With the sharp ones.
    vec3 f0;
    float f90;
    // Of a solid that refracts: 1 - m times t, F0 and F90 of exact Fresnel reflectance.
    vec3 exact_f0;
    float exact_f90;
    float exact_share;
    // (1 - m) t b
    vec3 transmitted;
    // Index of refraction where the eye is, over that beyond; 1 for a thin wall.
    float eta;
    // Light that goes straight on, and the probability with which a path does.
    vec3 passing;
    float pass_chance;
    // Probabilities of the others where it does not.
    float diffuse_chance;
    float sheen_chance;
    float reflection_chance;
    float coat_chance;
    float transmission_chance;
};

float largest(vec3 v)
{
    return max(v.x, max(v.y, v.z));
}

// Exact Fresnel reflectance at a cosine; 1 in total reflection.
float reflectance_at(float cosine, float eta)
{
    float cos_t_squared = refracted_cosine_squared(cosine, eta);
    return cos_t_squared > 0.0 ? fresnel(cosine, sqrt(cos_t_squared), eta) : 1.0;
}

// What a solid reflects: between F0 and F90 as exact reflectance is between its value along the normal and 1.
vec3 exact_fresnel(Lobes lobes, float cosine)
{
    if (refracted_cosine_squared(cosine, lobes.eta) <= 0.0) {
        return vec3(1.0);
    }
    float along = divide(1.0 - lobes.eta, 1.0 + lobes.eta);
    along *= along;
    float share = clamp(divide(reflectance_at(cosine, lobes.eta) - along, 1.0 - along), 0.0, 1.0);
    return lobes.exact_f0 + (lobes.exact_f90 - lobes.exact_f0) * share;
}

// Colour of the base's reflection at v.h.
vec3 reflection_colour(Lobes lobes, float cosine)
{
    vec3 colour = lobes.f0 + (lobes.f90 - lobes.f0) * fifth_power(clamp(1.0 - cosine, 0.0, 1.0));
    if (HAS_TRANSMISSION) {
        if (lobes.exact_share > 0.0) {
            colour += lobes.exact_share * exact_fresnel(lobes, cosine);
        }
    }
    return colour;
}

// What is transmitted at v.h.
vec3 transmission_colour(Lobes lobes, Layers layers, float cosine)
{
    if (layers.is_solid) {
        return lobes.transmitted * (1.0 - exact_fresnel(lobes, cosine));
    }
    return lobes.transmitted * (1.0 - (lobes.exact_f0 + (lobes.exact_f90 - lobes.exact_f0) * fifth_power(clamp(1.0 - cosine, 0.0, 1.0))));
}

bool is_matt(float alpha)
{
    return alpha >= MAP_ALPHA;
}

// Rays follow what a solid reflects however rough it is: what it transmits they follow too.
bool is_matt_reflection(Lobes lobes, Layers layers)
{
    return is_matt(layers.alpha) && lobes.exact_share == 0.0;
}

// Smooth normals do not keep phase space: without an end, some of what enters a coarse ball of glass is reflected in it for ever. What
// enters a solid by its triangles alone also leaves it. The path has met `depth` surfaces before.
vec3 normal_of_refraction(Surface surface, vec3 wo, float eta, uint depth)
{
    bool is_trapped = false;
    if (HAS_SMOOTH_NORMALS) {
        is_trapped = depth >= SMOOTH_TOTAL_REFLECTIONS && surface.layers.is_solid && surface.layers.transmission > 0.0
                  && surface.layers.alpha < DELTA_ALPHA && refracted_cosine_squared(min(dot(wo, surface.ns), 1.0), eta) <= 0.0;
    }
    return is_trapped ? surface.ng : surface.ns;
}

// `eta`: index where wo is over that beyond, of a solid.
Lobes lobes_of(Surface surface, vec3 wo, float eta)
{
    Layers layers = surface.layers;
    vec3 base = surface.base_colour;
    float cosine = max(dot(surface.ns, wo), 1e-6);
    float dielectric = 1.0 - layers.metallic;
    float along = divide(layers.ior - 1.0, layers.ior + 1.0);
    vec3 f0 = min(along * along * layers.specular_colour, vec3(1.0)) * layers.specular;
    float f90 = layers.specular;
    float opaque_share = dielectric * (1.0 - layers.transmission);
    float transmissive_share = dielectric * layers.transmission;

    Lobes lobes;
    lobes.eta = 1.0;
    lobes.exact_share = 0.0;
    lobes.exact_f0 = f0;
    lobes.exact_f90 = f90;
    lobes.transmitted = transmissive_share * base;
    float schlick_share = dielectric;
    if (HAS_TRANSMISSION) {
        if (layers.is_solid && layers.transmission > 0.0) {
            lobes.eta = eta;
            float relative = divide(1.0 - eta, 1.0 + eta);
            lobes.exact_f0 = min(relative * relative * layers.specular_colour, vec3(1.0)) * layers.specular;
            lobes.exact_share = transmissive_share;
            schlick_share = opaque_share;
        }
    }
    lobes.f0 = layers.metallic * base + schlick_share * f0;
    lobes.f90 = layers.metallic + schlick_share * f90;

    float e0 = largest(f0), e90 = f90;
    vec2 albedo = ggx_albedo(layers.alpha, cosine);
    vec2 mean = mean_albedo(layers.alpha);
    float below_diffuse = max(1.0 - (e0 * albedo.x + e90 * albedo.y), 0.0);
    float left = 1.0 - (e0 * mean.x + e90 * mean.y);
    MattCover cover = no_cover();
    if (HAS_COATS) {
        if (layers.coat > 0.0) {
            cover.coat = layers.coat;
            cover.coat_alpha = layers.coat_alpha;
            cover.has_coat_lobe = uint(is_matt(layers.coat_alpha));
            cover.coat_normal = pack_normal(layers.coat_normal);
            cover.below_coat = 1.0 - coat_albedo(layers.coat, layers.coat_alpha, cosine);
            below_diffuse *= cover.below_coat;
            vec2 coat_mean = mean_albedo(layers.coat_alpha);
            vec2 first = mean_products(layers.alpha, layers.coat_alpha, false);
            vec2 second = mean_products(layers.alpha, layers.coat_alpha, true);
            left += layers.coat * (e0 * (0.04 * first.x + first.y) + e90 * (0.04 * second.x + second.y) - (0.04 * coat_mean.x + coat_mean.y));
        }
    }
    if (HAS_SHEEN) {
        if (layers.sheen != vec3(0.0)) {
            cover.sheen = layers.sheen;
            cover.sheen_alpha = layers.sheen_alpha;
            cover.below_sheen = 1.0 - sheen_share(layers.sheen, layers.sheen_alpha, cosine);
        }
    }
    lobes.cover = cover;
    lobes.matt.e0 = e0;
    lobes.matt.e90 = e90;
    lobes.matt.alpha = layers.alpha;
    lobes.matt.diffuse = opaque_share * base * (0.31830988618379067 * divide(below_diffuse, max(left, 1e-6)));
    bool is_in_map = is_matt_reflection(lobes, layers);
    lobes.matt.f0 = is_in_map ? lobes.f0 : vec3(0.0);
    lobes.matt.f90 = is_in_map ? lobes.f90 : 0.0;

    // Of what is under the coat and the sheen.
    float below = cover.below_coat * cover.below_sheen;
    float diffuse = largest(opaque_share * base) * below_diffuse * cover.below_sheen;
    vec3 reflected = lobes.f0 * albedo.x + lobes.f90 * albedo.y;
    vec3 transmitted = vec3(0.0);
    if (HAS_TRANSMISSION) {
        if (layers.transmission > 0.0) {
            reflected += lobes.exact_share * exact_fresnel(lobes, cosine);
            transmitted = transmission_colour(lobes, layers, cosine);
            if (layers.is_solid && layers.alpha >= DELTA_ALPHA) {
                // Facets let light through where the surface as a whole would not.
                transmitted = max(transmitted, 0.125 * lobes.transmitted);
            }
        }
    }
    float reflection = largest(reflected) * below;
    float sheen = (1.0 - cover.below_sheen) * cover.below_coat;
    float coat = 1.0 - cover.below_coat;
    lobes.passing = vec3(0.0);
    lobes.pass_chance = 0.0;
    float transmission = largest(transmitted) * below;
    if (HAS_PASSING) {
        bool is_pane = false;
        if (HAS_TRANSMISSION) {
            is_pane = !layers.is_solid && layers.transmission > 0.0 && layers.alpha < DELTA_ALPHA;
        }
        lobes.passing = vec3(1.0 - layers.coverage);
        if (is_pane) {
            lobes.passing += layers.coverage * below * transmitted;
            transmission = 0.0;
        }
        lobes.pass_chance = min(largest(lobes.passing), 1.0);
    }
    float sum = diffuse + sheen + reflection + coat + transmission;
    float share = sum > 0.0 ? divide(1.0, sum) : 0.0;
    lobes.diffuse_chance = diffuse * share;
    lobes.sheen_chance = sheen * share;
    lobes.reflection_chance = reflection * share;
    lobes.coat_chance = coat * share;
    lobes.transmission_chance = transmission * share;
    if (layers.is_unlit) {
        lobes.diffuse_chance = lobes.sheen_chance = lobes.reflection_chance = lobes.coat_chance = lobes.transmission_chance = 0.0;
        lobes.matt.diffuse = lobes.matt.f0 = vec3(0.0);
        lobes.matt.f90 = 0.0;
    }
    return lobes;
}

// Probability of the matt lobes together, where the path does not pass.
float matt_chance(Lobes lobes, Layers layers)
{
    return lobes.diffuse_chance + lobes.sheen_chance + (is_matt_reflection(lobes, layers) ? lobes.reflection_chance : 0.0)
         + (is_matt(layers.coat_alpha) ? lobes.coat_chance : 0.0);
}

// What is left of light under coat and sheen, from two directions.
float below_both(Lobes lobes, float cosine)
{
    float below = 1.0;
    MattCover cover = lobes.cover;
    if (HAS_COATS) {
        below = cover.coat > 0.0 ? min(cover.below_coat, 1.0 - coat_albedo(cover.coat, cover.coat_alpha, cosine)) : 1.0;
    }
    if (HAS_SHEEN) {
        below *= cover.sheen != vec3(0.0) ? min(cover.below_sheen, 1.0 - sheen_share(cover.sheen, cover.sheen_alpha, cosine)) : 1.0;
    }
    return below;
}

// BRDF or BTDF times the cosine of a sharp lobe that is no delta, and the density of its sampling, 1/sr.
struct Weighed {
    vec3 value;
    float density;
};

Weighed weigh_reflection(float alpha, vec3 n, vec3 wo, vec3 wi)
{
    float cos_l = dot(wi, n), cos_v = dot(wo, n);
    if (cos_l <= 0.0 || cos_v <= 0.0) {
        return Weighed(vec3(0.0), 0.0);
    }
    vec3 h = normalize(wo + wi);
    float density = ggx_density(to_local(h, n), alpha);
    return Weighed(vec3(density * ggx_visibility(alpha, cos_l, cos_v) * cos_l), 0.25 * density * ggx_masking(alpha, cos_v));
}

// Refraction of Walter et al. (2007), of radiance towards wo.
Weighed weigh_refraction(float alpha, float eta, vec3 n, vec3 wo, vec3 wi)
{
    float cos_l = -dot(wi, n), cos_v = dot(wo, n);
    // On the side of wo: eta wo + wi points away from the rarer medium.
    vec3 h = eta * wo + wi;
    float squared = dot(h, h);
    if (cos_l <= 0.0 || cos_v <= 0.0 || squared < 1e-12) {
        return Weighed(vec3(0.0), 0.0);
    }
    h *= inversesqrt(squared);
    h = dot(h, n) < 0.0 ? -h : h;
    float v_h = dot(wo, h), l_h = -dot(wi, h);
    if (v_h <= 0.0 || l_h <= 0.0) {
        return Weighed(vec3(0.0), 0.0);
    }
    float density = ggx_density(to_local(h, n), alpha);
    float spread = eta * v_h - l_h;
    float jacobian = divide(l_h, max(spread * spread, 1e-12));
    float both = density * v_h * jacobian;
    return Weighed(vec3(eta * eta * both * 4.0 * ggx_visibility(alpha, cos_l, cos_v) * cos_l), both * ggx_masking(alpha, cos_v));
}

// What arrives from a direction, as matt and as sharp lobes weigh it: BRDF times cosine.
struct LobeLight {
    vec3 matt;
    vec3 sharp;
};

// The share of a light sample that counts beside the sampling of a lobe (the balance heuristic, Veach 1997, section 9.2); 0: no ray of
// a lobe meets this light.
float light_share(float light_density, float lobe_density)
{
    return light_density > 0.0 ? divide(light_density, light_density + lobe_density) : 1.0;
}

LobeLight weigh_light(Surface surface, Lobes lobes, vec3 wo, vec3 wi, float light_density)
{
    Layers layers = surface.layers;
    LobeLight light = LobeLight(vec3(0.0), vec3(0.0));
    float cosine = dot(wi, surface.ns);
    if (dot(wi, surface.ng) > 0.0) {
        light.matt = matt_brdf(lobes.matt, lobes.cover, surface.ns, wo, wi) * max(cosine, 0.0);
        // Its own cosine is that to its own normal, which only a map makes another one.
        if (layers.alpha >= DELTA_ALPHA && !is_matt_reflection(lobes, layers) && lobes.reflection_chance > 0.0) {
            Weighed found = weigh_reflection(layers.alpha, surface.ns, wo, wi);
            if (found.density > 0.0) {
                vec3 colour = reflection_colour(lobes, dot(wo, normalize(wo + wi))) * below_both(lobes, cosine);
                light.sharp += colour * found.value * light_share(light_density, lobes.reflection_chance * found.density);
            }
        }
        if (HAS_COATS) {
            if (layers.coat_alpha >= DELTA_ALPHA && !is_matt(layers.coat_alpha) && lobes.coat_chance > 0.0) {
                Weighed found = weigh_reflection(layers.coat_alpha, layers.coat_normal, wo, wi);
                if (found.density > 0.0) {
                    float colour = layers.coat * (0.04 + 0.96 * fifth_power(clamp(1.0 - dot(wo, normalize(wo + wi)), 0.0, 1.0)));
                    light.sharp += colour * found.value * light_share(light_density, lobes.coat_chance * found.density);
                }
            }
        }
    } else if (HAS_TRANSMISSION) {
        if (layers.alpha >= DELTA_ALPHA && lobes.transmission_chance > 0.0 && dot(wi, surface.ng) < 0.0) {
            Weighed found;
            float along;
            if (layers.is_solid) {
                found = weigh_refraction(layers.alpha, lobes.eta, surface.ns, wo, wi);
                vec3 h = normalize(lobes.eta * wo + wi);
                along = abs(dot(wo, h));
            } else {
                vec3 mirrored_wi = wi - 2.0 * cosine * surface.ns;
                found = weigh_reflection(layers.alpha, surface.ns, wo, mirrored_wi);
                along = dot(wo, normalize(wo + mirrored_wi));
            }
            if (found.density > 0.0) {
                vec3 colour = transmission_colour(lobes, layers, along) * below_both(lobes, abs(cosine));
                light.sharp += colour * found.value * light_share(light_density, lobes.transmission_chance * found.density);
            }
        }
    }
    return light;
}

const float SAME_INDEX = 1e-4;

// Refraction at a smooth boundary, and total reflection where the index makes it.
Scatter refract_smoothly(Surface surface, Lobes lobes, vec3 wo, bool carries_radiance, float chance)
{
    float eta = lobes.eta;
    if (abs(eta - 1.0) < SAME_INDEX) {
        vec3 weight = lobes.transmitted * divide(below_both(lobes, abs(dot(wo, surface.ns))), chance);
        return Scatter(-wo, weight, true, true, false, 0.0);
    }
    vec3 ns = surface.ns;
    float cos_i = min(dot(wo, ns), 1.0);
    float cos_t_squared = refracted_cosine_squared(cos_i, eta);
    if (cos_t_squared <= 0.0) {
        return Scatter(-wo, vec3(0.0), false, true, false, 0.0);
    }
    vec3 wi = on_side(normalize((eta * cos_i - sqrt(cos_t_squared)) * ns - eta * wo), -surface.ng);
    vec3 weight = transmission_colour(lobes, surface.layers, cos_i) * (below_both(lobes, abs(dot(wi, ns))) * divide(1.0, chance));
    weight *= carries_radiance ? eta * eta : 1.0;
    return Scatter(wi, weight, dot(wi, surface.ng) < 0.0, true, false, 0.0);
}

// A lobe of GGX that reflects; its weight lacks the colour, which `along`, v.h, gives.
Scatter sample_reflection(float alpha, vec3 n, vec3 ng, vec3 wo, vec2 u, out float along)
{
    along = dot(wo, n);
    if (alpha < DELTA_ALPHA) {
        vec3 wi = on_side(mirrored(wo, n), ng);
        return Scatter(wi, vec3(1.0), dot(wi, ng) > 0.0, true, false, 0.0);
    }
    vec3 v = to_local(wo, n);
    vec3 h = sample_visible_normal(v, alpha, u);
    along = max(dot(v, h), 0.0);
    vec3 local = 2.0 * along * h - v;
    vec3 wi = to_frame(local, n);
    bool is_above = local.z > 0.0 && dot(wi, ng) > 0.0;
    float cos_v = max(v.z, 1e-6);
    float masking = ggx_masking(alpha, cos_v);
    float weight = is_above ? divide(4.0 * ggx_visibility(alpha, local.z, cos_v) * local.z, masking) : 0.0;
    return Scatter(wi, vec3(weight), is_above, !is_matt(alpha), false, 0.25 * ggx_density(h, alpha) * masking);
}

// Where a path goes on from a layered surface that came from wo: u.x chooses the lobe, the others the direction. A path that does not
// pass keeps the share `coverage` over one less the probability of passing, which the weight leaves to the caller.
Scatter sample_layered(Surface surface, Lobes lobes, vec3 wo, vec3 u, bool carries_radiance)
{
    Layers layers = surface.layers;
    if (HAS_PASSING) {
        if (u.y < lobes.pass_chance) {
            return Scatter(-wo, divide(lobes.passing, lobes.pass_chance), true, false, true, 0.0);
        }
        u.y = divide(u.y - lobes.pass_chance, 1.0 - lobes.pass_chance);
    }
    float cosine = max(dot(wo, surface.ns), 1e-6);
    float chance = lobes.diffuse_chance;
    float before = 0.0;
    bool is_diffuse = u.x < chance;
    before += chance;
    if (!is_diffuse) {
        chance = lobes.reflection_chance;
    }
    if (!is_diffuse && u.x < before + chance) {
        float along;
        Scatter scatter = sample_reflection(layers.alpha, surface.ns, surface.ng, wo, u.yz, along);
        scatter.weight *= reflection_colour(lobes, along) * (below_both(lobes, max(dot(scatter.direction, surface.ns), 0.0)) * divide(1.0, chance));
        scatter.density *= chance;
        scatter.is_specular = !is_matt_reflection(lobes, layers);
        return scatter;
    }
    before += is_diffuse ? 0.0 : chance;
    if (HAS_COATS) {
        chance = is_diffuse ? chance : lobes.coat_chance;
        if (!is_diffuse && u.x < before + chance) {
            float along;
            Scatter scatter = sample_reflection(layers.coat_alpha, layers.coat_normal, surface.ng, wo, u.yz, along);
            scatter.weight *= layers.coat * (0.04 + 0.96 * fifth_power(clamp(1.0 - along, 0.0, 1.0))) * divide(1.0, chance);
            scatter.density *= chance;
            return scatter;
        }
        before += is_diffuse ? 0.0 : chance;
    }
    if (HAS_TRANSMISSION) {
        chance = is_diffuse ? chance : lobes.transmission_chance;
        if (!is_diffuse && u.x < before + chance) {
            if (layers.is_solid && (layers.alpha < DELTA_ALPHA || abs(lobes.eta - 1.0) < SAME_INDEX)) {
                return refract_smoothly(surface, lobes, wo, carries_radiance, chance);
            }
            vec3 v = to_local(wo, surface.ns);
            vec3 h = sample_visible_normal(v, layers.alpha, u.yz);
            float v_h = max(dot(v, h), 0.0);
            float cos_v = max(v.z, 1e-6);
            float masking = ggx_masking(layers.alpha, cos_v);
            float density = ggx_density(h, layers.alpha) * masking;
            vec3 local;
            if (layers.is_solid) {
                float cos_t_squared = refracted_cosine_squared(v_h, lobes.eta);
                float l_h = sqrt(max(cos_t_squared, 0.0));
                local = (lobes.eta * v_h - l_h) * h - lobes.eta * v;
                float spread = lobes.eta * v_h - l_h;
                density *= cos_t_squared > 0.0 ? v_h * divide(l_h, max(spread * spread, 1e-12)) : 0.0;
            } else {
                local = 2.0 * v_h * h - v;
                local.z = -local.z;
                density *= 0.25;
            }
            vec3 wi = to_frame(local, surface.ns);
            bool is_below = density > 0.0 && local.z < 0.0 && dot(wi, surface.ng) < 0.0;
            float weight = is_below ? divide(4.0 * ggx_visibility(layers.alpha, -local.z, cos_v) * -local.z, masking * chance) : 0.0;
            weight *= carries_radiance && layers.is_solid ? lobes.eta * lobes.eta : 1.0;
            return Scatter(wi, transmission_colour(lobes, layers, v_h) * (weight * below_both(lobes, max(-local.z, 0.0))), is_below, true, false,
                           chance * density);
        }
        before += is_diffuse ? 0.0 : chance;
    }
    // Both the same way: by the cosine.
    chance = is_diffuse ? chance : lobes.sheen_chance;
    vec3 wi = to_frame(sample_cosine_hemisphere(u.y, u.z), surface.ns);
    MattLobes matt = lobes.matt;
    MattCover cover = lobes.cover;
    matt.f0 = vec3(0.0);
    matt.f90 = 0.0;
    cover.has_coat_lobe = 0;
    vec3 brdf;
    if (is_diffuse) {
        // The sheen's share of what is under it stays, its own lobe goes.
        brdf = diffuse_brdf(matt, cover, surface.ns, wi);
    } else {
        matt.diffuse = vec3(0.0);
        brdf = matt_brdf(matt, cover, surface.ns, wo, wi);
    }
    bool is_above = chance > 0.0 && dot(wi, surface.ng) > 0.0;
    return Scatter(wi, is_above ? brdf * divide(3.14159265358979324, chance) : vec3(0.0), is_above, false, false, 0.0);
}
