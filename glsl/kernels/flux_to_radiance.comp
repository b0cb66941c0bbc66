// What the photon maps found at each visible point, as light: flux over the area that really lies on the surface, times
// reflectance, in film units. It takes the place of the point's first sums. Notes which pixels photons have reached, bright
// ones, and what a smaller radius would change.
// Dispatched by src/engine/scene/estimate.rs once a round. One thread = one visible point.
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_EXT_scalar_block_layout : require

#include "world/scene/visible_point.glsl"
#include "world/scene/work.glsl"

struct FluxToRadiancePush {
    WorkDivision work;
    uint first_point;
    uint end_point;
    uint point_count;
    uint pixel_count;
    // Of the picture; 0 where points are receivers, in an order of their own.
    uint width;
    uint height;
    // Mask of the arrivals that some map holds.
    uint arrivals;
    uint round;
    // Hash of the seed and the round that decides what is rounded up.
    uint rounding;
    float film_scale;
    float film_limit;
    // Of class 0.
    float global_radius;
    float caustic_radius;
    // Where the caustic map's cuts begin.
    uint first_caustic_cut;
    // Flux of a photon of relative flux 1, over the photons of the round.
    float global_flux;
    float caustic_flux;
};

layout(push_constant, scalar) uniform Push { FluxToRadiancePush push; };
layout(set = 1, binding = 1, scalar) readonly buffer VisiblePoints { VisiblePoint visible_points[]; };
layout(set = 1, binding = 2, scalar) buffer Estimates { uvec2 estimates[]; };

#include "math/math.glsl"
#include "ledger/nonfinite_values.glsl"
#include "dispatch/dispatch.glsl"
#include "world/scene/effects.glsl"
#include "world/scene/sample_places.glsl"
#include "world/scene/extra_samples.glsl"
#include "math/directions.glsl"
#include "world/scene/bvh.glsl"
#include "material/surface.glsl"
#include "world/scene/box_walk.glsl"
#include "gather/belongs.glsl"
#include "gather/disc_cuts.glsl"
#include "gather/cover.glsl"
#include "gather/near.glsl"
#include "gather/radius_class.glsl"
#include "film/wide.glsl"
#include "world/scene/film_units.glsl"
#include "film/kept_places.glsl"
#include "film/kept_parts.glsl"
#include "film/differences.glsl"
#include "world/scene/tiles.glsl"
#include "world/scene/single_hit.glsl"

float flux_of(uvec2 sum)
{
    return float(sum.y) + float(sum.x) * (1.0 / 4294967296.0);
}

vec3 gathered_flux(uint place)
{
    vec3 flux;
    for (uint channel = 0; channel < 3; channel++) {
        flux[channel] = flux_of(estimates[3 * place + channel]);
    }
    return flux;
}

vec3 near_flux_of(uint place, bool is_caustic)
{
    uint first = place_of_near(place, push.point_count, is_caustic);
    vec3 flux;
    for (uint channel = 0; channel < 3; channel++) {
        flux[channel] = flux_of(uvec2(near_sums[first + 2 * channel], near_sums[first + 2 * channel + 1]));
    }
    return flux;
}

// Areas in which the photons of a map were looked for, weighted by the kernel: within the radius, and where asked within the smaller one.
vec2 areas_around(VisiblePoint point, uint place, bool is_caustic, bool with_near)
{
    float radius = is_caustic ? push.caustic_radius : push.global_radius;
    if (HAS_RADIUS_CLASSES) {
        radius = radius_of_class(radius, radius_class(place, is_caustic ? CAUSTIC_CLASS : GLOBAL_CLASS));
    }
    Cuts cuts = cuts_of(place + (is_caustic ? push.first_caustic_cut : 0), plane_normal(point.plane), radius);
    radius = min(radius, cuts.reach);
    float near_radius = with_near ? radius * NEAR_SHARE : 0.0;
    vec2 areas = 3.14159265358979324 * kernel_norm() * vec2(radius * radius, near_radius * near_radius);
    if (HAS_EDGE_CORRECTION) {
        bool whole;
        vec2 covered = covered_areas(point.position, point.plane, radius, near_radius, cuts, whole);
        note_unless(is_finite(covered.x) && is_finite(covered.y), NONFINITE_ESTIMATE, 0, push.round, pixel_of_point(place, push.pixel_count));
        if (whole) {
            atomicAdd(anomalies[2], 1);
        }
        // Photons were found, so some surface is there; rounding may call a sliver nothing. The least area is
        // 200 of the units that gather/cover.glsl sums areas in.
        return max(covered, areas * (1.0 / 262144.0));
    }
    return areas;
}

// The brightest photon of the global map carries 1. Caustics are left out: they are local, so that most points lack those of some lamp.
void note_brightness(uint pixel, vec3 flux, vec3 one_photon)
{
    if (max(flux.x, max(flux.y, flux.z)) * float(DIM_PHOTONS) >= 1.0) {
        note_hit(pixel, HIT_BRIGHT_PHOTON);
    } else {
        note_miss(pixel, HIT_BRIGHT_PHOTON, one_photon);
    }
}

float density_in(float area, bool is_caustic)
{
    return divide(is_caustic ? push.caustic_flux : push.global_flux, area);
}

// Part of the picture (direct, specular, caustic, indirect) that an arrival adds to.
uint part_number(uint seen, uint arrival)
{
    return (seen & SEEN_OVER_SPECULAR) != 0 ? 1 : ((seen & SEEN_BY_GATHER) != 0 ? 3 : (arrival == 0 ? 0 : arrival + 1));
}

void main()
{
    work = push.work;
    uint place = push.first_point + invocation_index();
    bool exists = place < push.end_point;
    uvec2 totals[PART_COUNT];
    for (uint part = 0; part < PART_COUNT; part++) {
        totals[part] = uvec2(0);
    }
    VisiblePoint point = no_point();
    if (exists) {
        place = point_in_tiles(place, push.width, push.height, push.pixel_count);
        point = visible_points[place];
    }
    uvec2 sums[3] = uvec2[](uvec2(0), uvec2(0), uvec2(0));
    bool is_lit = false;
    vec3 change = vec3(0.0); // of a smaller radius
    uint first_arrival = 1;
    if (HAS_ALL_ARRIVALS) {
        first_arrival = 0;
    }
    float global_area = 0.0; // 0: not known yet
    // Triangles that discs of lit points were cut to: which points that are not lit are looked at too depends on rounds before.
    uint triangle_count = 0;
    uint of_global_area = 0;
    // The area of what nothing is found in costs as much as any: rounds 0, 1, 2, 4, 8 and so on are enough to know it.
    bool looks_at_misses = (push.round & (push.round - 1)) == 0;
    for (uint arrival = first_arrival; arrival < 3; arrival++) {
        if ((point.arrivals & push.arrivals & (1u << arrival)) == 0) {
            continue;
        }
        vec3 flux = gathered_flux((arrival - first_arrival) * push.point_count + place);
        bool is_caustic = HAS_CAUSTIC_MAP && arrival == 1;
        uint pixel = pixel_of_point(place, push.pixel_count);
        uint kind = is_caustic ? HIT_CAUSTIC_PHOTON : HIT_GLOBAL_PHOTON;
        bool is_new = !is_reached(pixel, kind);
        if (flux == vec3(0.0)) {
            if (!(is_new && looks_at_misses && point.weight != vec3(0.0))) {
                continue;
            }
        } else if (is_new) {
            note_hit(pixel, kind);
        }
        float for_all = !is_caustic && (point.arrivals & SEEN_FOR_ALL) != 0 ? float(samples_of(pixel)) : 1.0;
        float area = is_caustic ? 0.0 : global_area;
        uint of_area = is_caustic ? 0 : of_global_area;
        float widest = is_caustic ? push.caustic_radius : push.global_radius;
        if (area == 0.0) {
            vec3 near_flux = vec3(0.0);
            if (HAS_DIFFERENCES) {
                near_flux = near_flux_of(place, is_caustic);
            }
            triangles_found = 0;
            vec2 areas = areas_around(point, place, is_caustic, near_flux != vec3(0.0));
            of_area = triangles_found;
            area = areas.x;
            if (near_flux != vec3(0.0)) {
                change += for_all * point.weight * (near_flux * density_in(areas.y, is_caustic));
            }
        }
        global_area = is_caustic ? global_area : area;
        of_global_area = is_caustic ? of_global_area : of_area;
        float density = density_in(area, is_caustic);
        vec3 one_photon = for_all * point.weight * (density * widest * widest);
        if (flux == vec3(0.0)) {
            note_miss(pixel, kind, one_photon);
            continue;
        }
        triangle_count += of_area;
        of_global_area = is_caustic ? of_global_area : 0;
        if (!is_caustic && !is_reached(pixel, HIT_BRIGHT_PHOTON)) {
            note_brightness(pixel, flux, one_photon);
        }
        vec3 radiance = for_all * point.weight * (flux * density);
        note_unless(is_finite(radiance), NONFINITE_ESTIMATE, 0, push.round, pixel);
        uint part = part_number(point.arrivals, arrival);
        uint chance = mix32(push.rounding + position_bits(point.position));
        uint kept = kept_number(pixel, push.pixel_count);
        for (uint channel = 0; channel < 3; channel++) {
            uvec2 units = to_film_units(radiance[channel], push.film_scale, push.film_limit, chance);
            sums[channel] = add64(sums[channel], units);
            totals[part] = add64(totals[part], units);
            add_to_parts(kept, pixel, push.pixel_count, part, channel, units);
        }
        is_lit = true;
        change -= radiance;
    }
    for (uint part = 0; part < PART_COUNT; part++) {
        add_part_total(part, totals[part]);
    }
    triangle_count = subgroupAdd(triangle_count);
    if (subgroupElect() && triangle_count != 0) {
        add_to_anomaly(12, triangle_count);
    }
    // What is not lit has sums of 0.
    if (is_lit) {
        for (uint channel = 0; channel < 3; channel++) {
            estimates[3 * place + channel] = sums[channel];
        }
    }
    if (HAS_DIFFERENCES && is_lit) {
        add_difference(pixel_of_point(place, push.pixel_count), push.pixel_count, change * push.film_scale, push.film_limit);
    }
}
