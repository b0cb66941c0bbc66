// Lights: where photons start, and what arrives at a point straight from them.

// A light, or an emissive triangle. Lengths are those of the normalised scene.
struct Emitter {
    // `EMITTER_...`.
    uint kind;
    uint triangle;
    // Share of the emitters up to and with this one.
    float cumulative;
    float probability;
    // Relative flux of each of its photons.
    vec3 flux;
    // Radiance, radiant intensity or irradiance, as its kind has it; of a uniform disc the
    // intensity of a unit of area.
    vec3 strength;
    // Of a triangle the weights of its second and third corner where the emitting piece begins, and the piece's width over the
    // triangle's (`scene::geometry::lamp_pieces`).
    vec3 position;
    // Its axis or normal; a directional light's flight; towards the brightest part of a sky's picture.
    vec3 direction;
    // Radius of a disc; versine (1 - cosine) of a spot's inner cone, of which a narrow one keeps its digits.
    float size;
    // Versine of a spot's outer cone; of a sky, the share of light samples that its table chooses.
    float outer_versine;
    // Of a cone around the brightest part of a sky's picture.
    float sun_versine;
};

layout(set = 0, binding = 7, scalar) readonly buffer Emitters { Emitter emitters[]; };

// Chosen by power: the first emitter whose cumulative share lies above u.
uint pick_emitter(uint emitter_count, float u)
{
    uint low = 0;
    uint high = emitter_count - 1;
    while (low < high) {
        uint middle = (low + high) / 2;
        if (emitters[middle].cumulative > u) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    return low;
}

// Bound of the error of each coordinate of a point on no triangle. What lies there, of a scene one unit wide,
// is no better known than to a part of that.
float position_error(vec3 position)
{
    vec3 size = abs(position);
    return max(max(size.x, 0.25), max(size.y, size.z)) * (1.0 / 1048576.0);
}

float triangle_area(Triangle triangle)
{
    return 0.5 * norm(cross(triangle.b - triangle.a, triangle.c - triangle.a));
}

// The corners of an emissive triangle, or of the piece of it that a light is; the rest is the triangle's.
Triangle lamp_corners(Emitter light, Triangle triangle)
{
    vec3 ab = triangle.b - triangle.a, ac = triangle.c - triangle.a;
    Triangle piece = triangle;
    piece.a = triangle.a + light.position.x * ab + light.position.y * ac;
    piece.b = piece.a + light.position.z * ab;
    piece.c = piece.a + light.position.z * ac;
    return piece;
}

// Weights of the second and third corner of its triangle, from those of the piece that a light is.
vec2 weights_in_triangle(Emitter light, vec2 at)
{
    return light.position.xy + light.position.z * at;
}

// 1 - cosine of the angle between unit vectors, with all digits of a small angle.
float versine_between(vec3 a, vec3 b)
{
    vec3 chord = a - b;
    return 0.5 * dot(chord, chord);
}

// glTF's falloff between a spot's cones, at a versine from its axis.
float spot_falloff(Emitter light, float versine)
{
    if (versine <= light.size) {
        return 1.0;
    }
    float share = versine < light.outer_versine ? divide(light.outer_versine - versine, light.outer_versine - light.size) : 0.0;
    return share * share;
}

// Integral of the falloff over the versine: solid angle over 2 pi. The square of what is linear has a third of the ring.
float spot_integral(Emitter light)
{
    return light.size + (light.outer_versine - light.size) * (1.0 / 3.0);
}

#include "world/scene/sky.glsl"

struct Emission {
    vec3 position;
    vec3 direction;
    vec3 axis; // of the light's law: its normal where it has one
    vec3 flux;
    bool is_far; // from beyond the scene
};

Emission emit_from_lamp(Emitter light, vec4 u, vec4 w)
{
    Triangle triangle = triangles[light.triangle];
    SurfaceMaterial material = materials[triangle.material];
    vec2 at = sample_triangle(u.yz);
    if (HAS_TEXTURES) {
        at = weights_in_triangle(light, at);
    }
    vec3 normal = triangle_normal(triangle);
    if (HAS_TWO_SIDED) {
        normal = material.two_sided != 0 && u.w < 0.5 ? -normal : normal;
    }
    float error = triangle_error(triangle);
    vec2 inside = off_the_edges(triangle, at, error);
    vec3 position = offset_origin(triangle_point(triangle, inside.x, inside.y), error, normal, normal);
    vec3 direction = to_frame(sample_cosine_hemisphere(w.x, w.y), normal);
    return Emission(position, direction, normal, light.flux * lamp_share(material, light.triangle, at.x, at.y), false);
}

// In proportion to the intensity: the inner cone evenly, the ring by its falloff.
vec3 sample_spot(Emitter light, vec2 u)
{
    float width = light.outer_versine - light.size;
    float below = u.x * spot_integral(light);
    float versine = below;
    if (below > light.size) {
        float above = max(1.0 - divide(3.0 * (below - light.size), width), LEAST);
        versine = light.outer_versine - width * exp2(log2(above) * (1.0 / 3.0));
    }
    return to_frame(direction_at(1.0 - versine, versine * (2.0 - versine), u.y), light.direction);
}

Emission emit_from_disc(Emitter light, vec4 u, vec4 w)
{
    vec3 start = sample_disc(light.position, light.direction, light.size, u.yz);
    vec3 local = light.kind == EMITTER_DISC_COSINE ? sample_cosine_hemisphere(w.x, w.y) : sample_uniform_hemisphere(w.x, w.y);
    vec3 position = offset_origin(start, position_error(start), light.direction, light.direction);
    return Emission(position, to_frame(local, light.direction), light.direction, light.flux, false);
}

// What comes from beyond the scene starts on a disc that covers it.
Emission emit_from_afar(Emitter light, vec3 direction, vec3 flux, float scene_radius, vec4 u)
{
    vec3 position = sample_disc(-2.0 * scene_radius * direction, direction, scene_radius, u.yz);
    return Emission(position, direction, light.direction, flux, true);
}

Emission emit_from_sky(Emitter light, float scene_radius, vec4 u, vec4 w)
{
    if (HAS_SKY_PICTURE) {
        SkySample found = sample_sky_table(light, w.xy);
        // Over the density of an even choice of all directions; the strength is in the flux.
        vec3 texel = sample_texture(textures[light.triangle], place_in_sky(light, found.wi)).xyz;
        vec3 flux = light.flux * (texel * divide(0.07957747154594767, found.density));
        return emit_from_afar(light, -found.wi, flux, scene_radius, u);
    }
    return emit_from_afar(light, sample_sphere(w.x, w.y), light.flux, scene_radius, u);
}

// A photon's start. u and w = eight uniform numbers: the light was chosen by u.x, and w.z and w.w are left.
Emission sample_emission(Emitter light, float scene_radius, vec4 u, vec4 w)
{
    if (HAS_TRIANGLE_LIGHTS && light.kind == EMITTER_TRIANGLE) {
        return emit_from_lamp(light, u, w);
    }
    if (HAS_DISC_LIGHTS && (light.kind == EMITTER_DISC_COSINE || light.kind == EMITTER_DISC_UNIFORM)) {
        return emit_from_disc(light, u, w);
    }
    if (HAS_DIRECTIONAL_LIGHTS && light.kind == EMITTER_DIRECTIONAL) {
        return emit_from_afar(light, light.direction, light.flux, scene_radius, u);
    }
    if (HAS_ENVIRONMENT && light.kind == EMITTER_ENVIRONMENT) {
        return emit_from_sky(light, scene_radius, u, w);
    }
    vec3 direction = light.direction;
    if (HAS_SPOT_LIGHTS && light.kind == EMITTER_SPOT) {
        direction = sample_spot(light, w.xy);
    }
    if (HAS_POINT_LIGHTS && light.kind == EMITTER_POINT) {
        direction = sample_sphere(w.x, w.y);
    }
    return Emission(light.position, direction, light.direction, light.flux, false);
}

// Whether a point at signed height `height` over a flat lamp lies off its plane for certain. What lies in that plane
// gets nothing from it, and close by, the rounding of that nothing over the squared distance could be anything.
bool is_before(float height, vec3 position, float error)
{
    return abs(height) > 2.0 * (position_error(position) + error);
}

#include "world/scene/openings.glsl"

// What one light adds at a point: `radiance` is what arrives along wi, over the probability density of
// this sample; the light ends at `target`, or comes from beyond the scene.
struct Arriving {
    vec3 wi;
    vec3 radiance;
    vec3 target;
    bool is_far;
    bool is_beside; // from the sky, and through none of the openings that a trial found
    float density; // of this direction where lights are chosen by power, 1/sr; 0: no ray meets the light by chance
};

// Density with which sample_light() takes a point of a lamp, 1/sr, from a place that the lamp faces.
float lamp_density(Emitter light, Triangle triangle, vec3 position, vec3 point)
{
    Triangle lamp = triangle;
    float width = 1.0;
    if (HAS_TEXTURES) {
        lamp = lamp_corners(light, triangle);
        width = light.position.z;
    }
    float angle = sample_spherical_triangle(normalize(lamp.a - position), normalize(lamp.b - position), normalize(lamp.c - position),
                                            vec2(0.5)).w;
    vec3 way = point - position;
    float squared = dot(way, way);
    float cosine = abs(dot(triangle_normal(triangle), way)) * inversesqrt(max(squared, 1e-30));
    float area = triangle_area(triangle) * width * width;
    return angle > 0.0 ? divide(1.0, angle) : divide(squared, max(cosine * area, 1e-30));
}

float environment_density(Emitter sky, vec3 position, vec3 ns, vec3 wi)
{
    float by_table = sky.outer_versine, others = cosine_density(ns, wi);
    if (HAS_OPENINGS && openings[0].radius != 0.0) {
        float sum = sum_of_versines(position);
        by_table = table_share(sky, position);
        others = density_with_cones(position, ns, wi, sum > 0.0 ? OPENING_SHARE : 0.0, sum).density;
    }
    return density_with_table(sky, by_table, wi, others);
}

// Light from a point, which leaves with this share of its strength.
void arrive_from_point(inout Arriving arriving, vec3 position, float share)
{
    vec3 way = arriving.target - position;
    float distance_squared = dot(way, way);
    arriving.wi = distance_squared > 0.0 ? way * inversesqrt(distance_squared) : vec3(0.0);
    arriving.radiance *= distance_squared > 0.0 ? divide(share, distance_squared) : 0.0;
}

// A direction within the triangle as it is seen, or a point of it where that has no area.
void sample_lamp(inout Arriving arriving, Emitter light, vec3 position, vec2 u)
{
    Triangle triangle = triangles[light.triangle];
    SurfaceMaterial material = materials[triangle.material];
    Triangle lamp = triangle;
    float area = triangle_area(triangle);
    vec2 at = sample_triangle(u);
    if (HAS_TEXTURES) {
        lamp = lamp_corners(light, triangle);
        area *= light.position.z * light.position.z;
        at = weights_in_triangle(light, at);
    }
    vec3 normal = triangle_normal(triangle);
    vec3 point = triangle_point(triangle, at.x, at.y);
    float side = dot(normal, position - point);
    if (HAS_TWO_SIDED) {
        normal = material.two_sided != 0 && side < 0.0 ? -normal : normal;
    }
    float cosine = is_before(side, position, triangle_error(triangle)) ? max(dot(normal, normalize(position - point)), 0.0) : 0.0;
    vec4 direction = vec4(0.0);
    if (cosine > 0.0) {
        direction = sample_spherical_triangle(normalize(lamp.a - position), normalize(lamp.b - position), normalize(lamp.c - position), u);
    }
    float approach = -dot(direction.xyz, normal);
    bool by_direction = direction.w > 0.0 && approach > 0.0;
    if (by_direction) {
        point = position + direction.xyz * divide(dot(normal, position - triangle.a), approach);
        if (HAS_TEXTURES) {
            at = triangle_weights(triangle, point);
        }
        arriving.wi = direction.xyz;
    }
    arriving.target = offset_origin(point, position_error(point) + triangle_error(triangle), normal, normal);
    arriving.radiance = material.emission * lamp_share(material, light.triangle, at.x, at.y) * divide(by_direction ? direction.w : area, light.probability);
    if (!by_direction) {
        arrive_from_point(arriving, position, cosine);
    }
    if (HAS_LAYERS) {
        arriving.density = lamp_density(light, triangle, position, arriving.target);
    }
}

void sample_disc_light(inout Arriving arriving, Emitter light, vec3 position, vec2 u)
{
    vec3 point = sample_disc(light.position, light.direction, light.size, u);
    arriving.target = offset_origin(point, position_error(point), light.direction, light.direction);
    arriving.radiance *= 3.14159265358979324 * light.size * light.size;
    float cosine = dot(light.direction, normalize(position - point));
    float share = light.kind == EMITTER_DISC_COSINE ? max(cosine, 0.0) : (cosine > 0.0 ? 1.0 : 0.0);
    share = is_before(dot(light.direction, position - light.position), position, position_error(light.position)) ? share : 0.0;
    arrive_from_point(arriving, position, share);
}

void sample_environment(inout Arriving arriving, Emitter light, vec3 position, vec3 ns, vec2 u)
{
    arriving.is_far = true;
    if (HAS_OPENINGS && openings[0].radius != 0.0) {
        SampledSky sampled = sample_sky(light, position, ns, u);
        arriving.wi = sampled.wi;
        arriving.is_beside = !sampled.is_aimed;
        arriving.radiance *= divide(1.0, max(sampled.density, 1e-6));
    } else if (HAS_SKY_PICTURE) {
        SkySample sampled = sample_open_sky(light, ns, u);
        arriving.wi = sampled.wi;
        arriving.radiance *= divide(1.0, max(sampled.density, 1e-30));
    } else {
        vec3 local = sample_cosine_hemisphere(u.x, u.y);
        arriving.wi = to_frame(local, ns);
        arriving.radiance *= divide(3.14159265358979324, max(local.z, 1e-6));
    }
    if (HAS_SKY_PICTURE) {
        arriving.radiance *= sample_texture(textures[light.triangle], place_in_sky(light, arriving.wi)).xyz;
    }
    if (HAS_LAYERS) {
        arriving.density = environment_density(light, position, ns, arriving.wi);
    }
}

// `light` has the probability with which it was chosen; u is for its area.
Arriving sample_light(Emitter light, vec3 position, vec3 ns, vec2 u)
{
    Arriving arriving = Arriving(vec3(0.0), divide(light.strength, light.probability), light.position, false, false, 0.0);
    if (HAS_TRIANGLE_LIGHTS && light.kind == EMITTER_TRIANGLE) {
        sample_lamp(arriving, light, position, u);
    } else if (HAS_DISC_LIGHTS && (light.kind == EMITTER_DISC_COSINE || light.kind == EMITTER_DISC_UNIFORM)) {
        sample_disc_light(arriving, light, position, u);
    } else if (HAS_DIRECTIONAL_LIGHTS && light.kind == EMITTER_DIRECTIONAL) {
        arriving.is_far = true;
        arriving.wi = -light.direction;
    } else if (HAS_ENVIRONMENT && light.kind == EMITTER_ENVIRONMENT) {
        sample_environment(arriving, light, position, ns, u);
    } else {
        float share = 1.0;
        if (HAS_SPOT_LIGHTS && light.kind == EMITTER_SPOT) {
            share = spot_falloff(light, versine_between(normalize(position - light.position), light.direction));
        }
        arrive_from_point(arriving, position, share);
    }
    return arriving;
}

// Radiance from beyond the scene.
vec3 environment_radiance(uint emitter_count, vec3 direction)
{
    if (HAS_ENVIRONMENT && emitter_count != 0) {
        // It stands last among the emitters.
        Emitter light = emitters[emitter_count - 1];
        return light.kind == EMITTER_ENVIRONMENT ? sky_radiance(light, direction) : vec3(0.0);
    }
    return vec3(0.0);
}

// Density, 1/sr, of light samples towards the sky where lights are chosen by power.
float sky_light_density(uint emitter_count, vec3 position, vec3 ns, vec3 wi)
{
    if (HAS_ENVIRONMENT && emitter_count != 0) {
        Emitter light = emitters[emitter_count - 1];
        return light.kind == EMITTER_ENVIRONMENT ? light.probability * environment_density(light, position, ns, wi) : 0.0;
    }
    return 0.0;
}

// The same towards a point that a ray has met; 0 if no emitter is there.
float lamp_light_density(uint emitter_count, Hit hit, vec3 position, vec3 point)
{
    // Emitters that are triangles come first, in their order.
    uint low = 0, high = emitter_count;
    while (low < high) {
        uint middle = (low + high) / 2;
        Emitter light = emitters[middle];
        if (light.kind == EMITTER_TRIANGLE && light.triangle < hit.triangle) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    Triangle triangle = triangles[hit.triangle];
    for (uint k = low; k < emitter_count; k++) {
        Emitter light = emitters[k];
        if (light.kind != EMITTER_TRIANGLE || light.triangle != hit.triangle) {
            break;
        }
        bool is_within = true;
        if (HAS_TEXTURES) {
            vec2 at = divide(vec2(hit.u, hit.v) - light.position.xy, light.position.z);
            is_within = at.x >= 0.0 && at.y >= 0.0 && at.x + at.y <= 1.0;
        }
        if (is_within) {
            return light.probability * lamp_density(light, triangle, position, point);
        }
    }
    return 0.0;
}
