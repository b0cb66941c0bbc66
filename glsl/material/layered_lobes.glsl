// The lobes of a layered surface as they are seen from a direction: what each weighs, how it is sampled, and which belong to photon
// maps. The guide's page on materials has the formulas.

#include "material/albedo.glsl"
#include "material/ggx.glsl"
#include "material/matt_lobes.glsl"

struct Lobes {
    MattLobes matt;
    MattCover cover;
    MattFilm film;
    // With the sharp ones.
    vec3 f0;
    float f90;
    // Of a solid that refracts: 1 - m times t, F0 and F90 of exact Fresnel reflectance.
    vec3 exact_f0;
    float exact_f90;
    float exact_share;
    // (1 - m) t b
    vec3 transmitted;
    // All of diffuse transmission but the factors of where light comes from.
    vec3 beyond;
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
    float beyond_chance;
};

// Exact Fresnel reflectance at a cosine; 1 in total reflection.
float reflectance_at(float cosine, float eta)
{
    float cos_t_squared = refracted_cosine_squared(cosine, eta);
    return cos_t_squared > 0.0 ? fresnel(cosine, sqrt(cos_t_squared), eta) : 1.0;
}

// What a dielectric reflects that transmits. Of a solid: between F0 and F90 as exact reflectance is between its value along the normal
// and 1.
vec3 dielectric_reflectance(Lobes lobes, bool is_solid, float cosine)
{
    float share = fifth_power(clamp(1.0 - cosine, 0.0, 1.0));
    if (is_solid) {
        if (refracted_cosine_squared(cosine, lobes.eta) <= 0.0) {
            return vec3(1.0);
        }
        float along = divide(1.0 - lobes.eta, 1.0 + lobes.eta);
        along *= along;
        share = clamp(divide(reflectance_at(cosine, lobes.eta) - along, 1.0 - along), 0.0, 1.0);
    }
    vec3 exact = lobes.exact_f0 + (lobes.exact_f90 - lobes.exact_f0) * share;
    if (HAS_IRIDESCENCE) {
        if (lobes.film.share > 0.0) {
            // The same from both sides: it is asked where the ray is in the rarer medium.
            float outside = is_solid && lobes.eta > 1.0 ? sqrt(max(refracted_cosine_squared(cosine, lobes.eta), 0.0)) : cosine;
            vec3 film = film_reflectance(lobes.exact_f0, lobes.film.ior, lobes.film.thickness, outside);
            exact = (1.0 - lobes.film.share) * exact + lobes.film.share * film;
        }
    }
    return exact;
}

// Colour of what the base reflects, or transmits, at v.h.
vec3 base_lobe_colour(Lobes lobes, bool is_solid, float cosine, bool is_beyond)
{
    vec3 colour = lobes.f0 + (lobes.f90 - lobes.f0) * fifth_power(clamp(1.0 - cosine, 0.0, 1.0));
    if (HAS_IRIDESCENCE) {
        if (lobes.film.share > 0.0) {
            colour = under_film(colour, lobes.film, cosine);
        }
    }
    if (HAS_TRANSMISSION) {
        if (is_beyond || lobes.exact_share > 0.0) {
            vec3 exact = dielectric_reflectance(lobes, is_solid, cosine);
            colour = is_beyond ? lobes.transmitted * (1.0 - exact) : colour + lobes.exact_share * exact;
        }
    }
    return colour;
}

float coat_colour(float coat, float cosine)
{
    return coat * (0.04 + 0.96 * fifth_power(clamp(1.0 - cosine, 0.0, 1.0)));
}

bool is_matt(float alpha)
{
    return alpha >= MAP_ALPHA;
}

// Rays follow what a solid reflects however rough it is: what it transmits they follow too. And they follow what is sharp across a
// tangent if not along it.
bool is_matt_reflection(Lobes lobes, Layers layers)
{
    bool is_stretched = false;
    if (HAS_ANISOTROPY) {
        is_stretched = layers.is_stretched;
    }
    return is_matt(layers.alpha) && lobes.exact_share == 0.0 && !is_stretched;
}

Facets base_facets(Surface surface)
{
    Layers layers = surface.layers;
    return Facets(surface.ns, layers.alpha, layers.is_stretched, layers.alpha_along, layers.tangent);
}

Facets coat_facets(Surface surface)
{
    return even_facets(surface.layers.coat_normal, surface.layers.coat_alpha);
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

// Bound of what stretched facets reflect beyond even ones as sharp as they are across, at a cosine, by a reflectance that is 1 at the horizon.
float stretch_excess(float cosine)
{
    return 0.004 + 0.1 * max(1.0 - 4.5 * cosine, 0.0);
}

// What layers reflect of all light from wi, on either side.
LayerAlbedos albedos_towards(Surface surface, MattCover cover, vec3 wi)
{
    return albedos_at(surface.layers.alpha, cover, abs(dot(wi, surface.ns)), abs(dot(wi, surface.layers.coat_normal)));
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

    lobes.film = no_film();
    MattCover cover = no_cover();
    if (HAS_COATS) {
        cover.coat = layers.coat;
        cover.coat_alpha = layers.coat_alpha;
        cover.has_coat_lobe = uint(layers.coat > 0.0 && is_matt(layers.coat_alpha));
        cover.coat_normal = pack_normal(layers.coat_normal);
    }
    if (HAS_SHEEN) {
        cover.sheen = layers.sheen;
        cover.sheen_alpha = layers.sheen_alpha;
    }
    if (HAS_IRIDESCENCE) {
        lobes.film = MattFilm(layers.iridescence, layers.film_ior, layers.film_thickness, schlick_share, f0, layers.metallic, base, 0);
    }
    LayerAlbedos seen = albedos_at(layers.alpha, cover, cosine, max(dot(layers.coat_normal, wo), 1e-6));
    cover.coat_albedo = seen.coat;
    cover.sheen_albedo = seen.sheen;
    lobes.cover = cover;

    float e0 = largest(f0), e90 = f90;
    if (HAS_IRIDESCENCE) {
        e0 += layers.iridescence * (layers.film_bound - e0);
        e90 += layers.iridescence * (1.0 - e90);
    }
    float below_diffuse = below_base(e0, e90, seen.base);
    if (HAS_ANISOTROPY) {
        if (layers.is_stretched) {
            below_diffuse = max(below_diffuse - e90 * stretch_excess(cosine), 0.0);
        }
    }
    below_diffuse *= 1.0 - seen.coat;
    vec2 mean = mean_albedo(layers.alpha);
    float left = 1.0 - (e0 * mean.x + e90 * mean.y);
    if (HAS_COATS) {
        if (layers.coat > 0.0) {
            vec2 coat_mean = mean_albedo(layers.coat_alpha);
            vec2 first = mean_products(layers.alpha, layers.coat_alpha, false);
            vec2 second = mean_products(layers.alpha, layers.coat_alpha, true);
            left += layers.coat * (e0 * (0.04 * first.x + first.y) + e90 * (0.04 * second.x + second.y) - (0.04 * coat_mean.x + coat_mean.y));
        }
    }
    lobes.matt.e0 = e0;
    lobes.matt.e90 = e90;
    lobes.matt.alpha = layers.alpha;
    float left_over = (0.31830988618379067 * divide(below_diffuse, max(left, 1e-6)));
    lobes.beyond = vec3(0.0);
    if (HAS_DIFFUSE_TRANSMISSION) {
        vec3 beyond = opaque_share * layers.diffuse_transmission * layers.diffuse_transmission_colour;
        lobes.beyond = beyond * left_over;
        base *= 1.0 - layers.diffuse_transmission;
    }
    lobes.matt.diffuse = opaque_share * base * left_over;
    bool is_in_map = is_matt_reflection(lobes, layers);
    if (HAS_IRIDESCENCE) {
        lobes.film.is_matt = uint(is_in_map);
    }
    lobes.matt.f0 = is_in_map ? lobes.f0 : vec3(0.0);
    lobes.matt.f90 = is_in_map ? lobes.f90 : 0.0;

    // Of what is under the coat and the sheen.
    float left_by_sheen = below_sheen(cover.sheen, seen.sheen);
    float below = (1.0 - seen.coat) * left_by_sheen;
    float diffuse = largest(opaque_share * base) * below_diffuse * left_by_sheen;
    float beyond = 0.0;
    if (HAS_DIFFUSE_TRANSMISSION) {
        beyond = opaque_share * layers.diffuse_transmission * largest(layers.diffuse_transmission_colour) * below_diffuse * left_by_sheen;
    }
    vec3 reflected = lobes.f0 * seen.base.x + lobes.f90 * seen.base.y;
    if (HAS_IRIDESCENCE) {
        if (layers.iridescence > 0.0) {
            // Elsewhere the film may reflect what it does not here.
            vec3 film = max(under_film(vec3(0.0), lobes.film, cosine), vec3(0.02 * layers.iridescence * (layers.metallic + schlick_share)));
            reflected = (1.0 - layers.iridescence) * reflected + (seen.base.x + seen.base.y) * film;
        }
    }
    vec3 transmitted = vec3(0.0);
    if (HAS_TRANSMISSION) {
        if (layers.transmission > 0.0) {
            vec3 exact = dielectric_reflectance(lobes, layers.is_solid, cosine);
            reflected += lobes.exact_share * exact;
            transmitted = lobes.transmitted * (1.0 - exact);
            if (layers.alpha >= DELTA_ALPHA) {
                // Facets let light through where the surface as a whole would not.
                transmitted = max(transmitted, 0.125 * lobes.transmitted);
            }
        }
    }
    float reflection = largest(reflected) * below;
    float sheen = (1.0 - left_by_sheen) * (1.0 - seen.coat);
    float coat = seen.coat;
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
    if (HAS_DIFFUSE_TRANSMISSION) {
        sum += beyond;
    }
    float share = sum > 0.0 ? divide(1.0, sum) : 0.0;
    lobes.diffuse_chance = diffuse * share;
    lobes.sheen_chance = sheen * share;
    lobes.reflection_chance = reflection * share;
    lobes.coat_chance = coat * share;
    lobes.transmission_chance = transmission * share;
    lobes.beyond_chance = beyond * share;
    if (layers.is_unlit) {
        lobes.diffuse_chance = lobes.sheen_chance = lobes.reflection_chance = lobes.coat_chance = lobes.transmission_chance = lobes.beyond_chance = 0.0;
        lobes.matt.diffuse = lobes.matt.f0 = vec3(0.0);
        lobes.matt.f90 = 0.0;
        if (HAS_IRIDESCENCE) {
            lobes.film.is_matt = 0;
        }
    }
    return lobes;
}

// Probability of the matt lobes together, where the path does not pass.
float matt_chance(Lobes lobes, Layers layers)
{
    return lobes.diffuse_chance + lobes.sheen_chance + (is_matt_reflection(lobes, layers) ? lobes.reflection_chance : 0.0)
         + (is_matt(layers.coat_alpha) ? lobes.coat_chance : 0.0);
}

// BRDF or BTDF times the cosine of a sharp lobe that is no delta, but for its colour; the density of its sampling, 1/sr; and v.h.
struct Weighed {
    float value;
    float density;
    float along;
};

Weighed weigh_reflection(Facets facets, vec3 wo, vec3 wi)
{
    float cos_l = dot(wi, facets.n), cos_v = dot(wo, facets.n);
    if (cos_l <= 0.0 || cos_v <= 0.0) {
        return Weighed(0.0, 0.0, 1.0);
    }
    vec3 h = normalize(wo + wi);
    float density = facet_density(facets, to_facets(facets, h));
    float value = density * facet_visibility(facets, wi, wo, cos_l, cos_v) * cos_l;
    return Weighed(value, 0.25 * density * facet_masking(facets, wo, cos_v), dot(wo, h));
}

// Refraction of Walter et al. (2007), of radiance towards wo.
Weighed weigh_refraction(Facets facets, float eta, vec3 wo, vec3 wi)
{
    float cos_l = -dot(wi, facets.n), cos_v = dot(wo, facets.n);
    // On the side of wo: eta wo + wi points away from the rarer medium.
    vec3 h = eta * wo + wi;
    float squared = dot(h, h);
    if (cos_l <= 0.0 || cos_v <= 0.0 || squared < 1e-12) {
        return Weighed(0.0, 0.0, 1.0);
    }
    h *= inversesqrt(squared);
    h = dot(h, facets.n) < 0.0 ? -h : h;
    float v_h = dot(wo, h), l_h = -dot(wi, h);
    if (v_h <= 0.0 || l_h <= 0.0) {
        return Weighed(0.0, 0.0, 1.0);
    }
    float density = facet_density(facets, to_facets(facets, h));
    float spread = eta * v_h - l_h;
    float jacobian = divide(l_h, max(spread * spread, 1e-12));
    float both = density * v_h * jacobian;
    float value = eta * eta * both * 4.0 * facet_visibility(facets, wi, wo, cos_l, cos_v) * cos_l;
    return Weighed(value, both * facet_masking(facets, wo, cos_v), v_h);
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

// Density with which the matt lobes together send a path along wi, 1/sr.
float density_of_matt_lobes(Surface surface, Lobes lobes, vec3 wo, vec3 wi)
{
    Layers layers = surface.layers;
    float density = (lobes.diffuse_chance + lobes.sheen_chance) * (0.31830988618379067 * max(dot(wi, surface.ns), 0.0));
    if (is_matt_reflection(lobes, layers)) {
        density += lobes.reflection_chance * weigh_reflection(base_facets(surface), wo, wi).density;
    }
    if (HAS_COATS) {
        if (is_matt(layers.coat_alpha)) {
            density += lobes.coat_chance * weigh_reflection(coat_facets(surface), wo, wi).density;
        }
    }
    return density;
}

// `asks_matt`: rays of the matt lobes see the light, too.
LobeLight weigh_light(Surface surface, Lobes lobes, vec3 wo, vec3 wi, float light_density, bool asks_matt)
{
    Layers layers = surface.layers;
    LobeLight light = LobeLight(vec3(0.0), vec3(0.0));
    float cosine = dot(wi, surface.ns);
    bool is_beyond = dot(wi, surface.ng) <= 0.0;
    LayerAlbedos lit = albedos_towards(surface, lobes.cover, wi);
    if (!is_beyond && cosine > 0.0) {
        light.matt = matt_brdf(lobes.matt, lobes.cover, lobes.film, lit, surface.ns, wo, wi) * cosine;
        if (asks_matt) {
            light.matt *= light_share(light_density, density_of_matt_lobes(surface, lobes, wo, wi));
        }
    }
    float chance = is_beyond || is_matt_reflection(lobes, layers) ? 0.0 : lobes.reflection_chance;
    bool is_refracted = false;
    if (HAS_TRANSMISSION) {
        chance = is_beyond ? lobes.transmission_chance : chance;
        is_refracted = is_beyond && layers.is_solid;
    }
    if (layers.alpha >= DELTA_ALPHA && chance > 0.0) {
        // A thin wall transmits as it would reflect the mirrored direction.
        vec3 reflected = is_beyond ? wi - 2.0 * cosine * surface.ns : wi;
        Weighed found;
        if (is_refracted) {
            found = weigh_refraction(base_facets(surface), lobes.eta, wo, wi);
        } else {
            found = weigh_reflection(base_facets(surface), wo, reflected);
        }
        if (found.density > 0.0) {
            vec3 colour = base_lobe_colour(lobes, layers.is_solid, found.along, is_beyond) * below_cover(lobes.cover, lit);
            light.sharp += colour * (found.value * light_share(light_density, chance * found.density));
        }
    }
    if (HAS_DIFFUSE_TRANSMISSION) {
        if (is_beyond && cosine < 0.0 && lobes.beyond_chance > 0.0) {
            float density = lobes.beyond_chance * (0.31830988618379067 * -cosine);
            light.sharp += below_all(lobes.beyond, lobes.matt, lobes.cover, lit) * (-cosine * light_share(light_density, density));
        }
    }
    if (HAS_COATS) {
        if (!is_beyond && layers.coat_alpha >= DELTA_ALPHA && !is_matt(layers.coat_alpha) && lobes.coat_chance > 0.0) {
            // Its own cosine is that to its own normal.
            Weighed found = weigh_reflection(coat_facets(surface), wo, wi);
            if (found.density > 0.0) {
                float share = light_share(light_density, lobes.coat_chance * found.density);
                light.sharp += vec3(coat_colour(layers.coat, found.along) * found.value * share);
            }
        }
    }
    return light;
}
