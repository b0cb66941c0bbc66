// Density estimation of a photon map: each visible point sums the flux of the photons that belong to it.
// A point's candidates are shared out in slices of GATHER_SLICE, so that no invocation loops long: the first one of
// every point at first, then those of the few points that have more. Of a slice, as many invocations as there are
// lanes take every so many-th candidate. The including kernel chose how sums are added.

#include "world/scene/visible_point.glsl"

layout(set = 1, binding = 4, scalar) readonly buffer VisiblePoints { VisiblePoint visible_points[]; };
layout(set = 1, binding = 2, scalar) readonly buffer SortedMap { uvec4 sorted_map[]; };
// Points with more than one slice: how many, the longest one's candidates; then which, and each one's candidates.
layout(set = 1, binding = 3, scalar) buffer Crowded { uint crowded[]; };

// The point of an invocation, or NONE.
uint point_of(uint item, uint slice)
{
    if (push.first_slice != 0) {
        bool has_slice = item < crowded[0] && crowded[3 + 2 * item] > slice * GATHER_SLICE;
        return has_slice ? crowded[2 + 2 * item] : NONE;
    }
    uint place = push.first_point + item;
    if (place >= push.end_point) {
        return NONE;
    }
    return point_in_tiles(place, push.width, push.height, push.pixel_count);
}

layout(set = 1, binding = 14, scalar) readonly buffer MattLobesOfPoints { MattLobes matt_lobes[]; };
layout(set = 1, binding = 16, scalar) readonly buffer MattCoversOfPoints { MattCover matt_covers[]; };

// Weight of a photon that far from the point and that high above its plane.
float kernel_at(float distance_squared, float height, float radius)
{
    float height_squared = height * height;
    return kernel_weight(clamp(divide(distance_squared - height_squared, radius * radius - height_squared), 0.0, 1.0));
}

// 32 bits before the binary point and 32 behind it, rounded up by chance.
uvec2 fixed_point(float flux, float chance)
{
    float whole = floor(flux);
    precise float fraction = (flux - whole) * 4294967296.0 + chance;
    return uvec2(uint(fraction), uint(whole));
}

void gather_photons()
{
    work = push.work;
    uint slice = push.first_slice + gl_WorkGroupID.y;
    uint invocation = gl_WorkGroupID.x * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    uint lane = invocation % push.lanes;
    uint index = point_of(invocation / push.lanes, slice);
    if (index == NONE) {
        return;
    }
    VisiblePoint point = visible_points[index];
    uint point_bits = mix32(push.rounding + position_bits(point.position));
    uint wanted = 1u << push.arrival;
    if (HAS_ALL_ARRIVALS) {
        wanted = ARRIVED_DIRECT | ARRIVED_CAUSTIC | ARRIVED_INDIRECT;
    }
    if ((point.arrivals & wanted) == 0) {
        return;
    }
    float radius = push.radius;
    if (HAS_RADIUS_CLASSES) {
        uint own_class = radius_class(index, push.map_class);
        if (own_class < push.first_class || own_class >= push.end_class) {
            return;
        }
        radius = radius_of_class(push.radius, own_class);
    }
    vec3 normal = plane_normal(point.plane);
    Cuts cuts = cuts_of(push.first_cut + index, normal, radius);
    CellRange range = cells_near(point.position, radius);
    bool has_cuts = cuts.lines[0].w < cuts.reach;
    radius = min(radius, cuts.reach);
    bool is_flat = point.shading_normal == NONE;
    vec3 ns = is_flat ? normal : unpack_normal(point.shading_normal);
    vec3 wo = unpack_direction(point.wo);
    bool is_even = is_flat && !has_lobe(point.surface);
    bool is_layered = false;
    MattLobes lobes;
    MattCover cover = no_cover();
    MattFilm film = no_film();
    if (HAS_LAYERS) {
        is_layered = point.surface == SURFACE_LAYERED;
        if (is_layered) {
            lobes = matt_lobes[index];
            bool has_cover = HAS_COATS;
            if (HAS_SHEEN) {
                has_cover = true;
            }
            if (HAS_IRIDESCENCE) {
                has_cover = true;
            }
            if (has_cover) {
                cover = matt_covers[index];
                film = cover.film;
            }
        }
    }
    uint photon_count = map_length();
    uint slice_begin = slice * GATHER_SLICE;
    uint slice_end = slice_begin + GATHER_SLICE;

    // Three channels of each arrival; the first three of a map that holds one arrival only. 32 bits after the binary point:
    // of a channel a billionth as bright as the photons' mean, a photon still adds some units.
    uvec2 sums[9];
    [[unroll]] for (uint k = 0; k < 9; k++) {
        sums[k] = uvec2(0);
    }
    // The same of photons nearer than that, all arrivals together.
    uvec2 nearer[3] = uvec2[](uvec2(0), uvec2(0), uvec2(0));
    float near_radius = radius * NEAR_SHARE;
    bool found = false;
    uint passed = 0; // candidates in the rows before this one
    for (int z = range.first.z; z <= range.last.z; z++) {
        for (int y = range.first.y; y <= range.last.y; y++) {
            uvec2 run = row_of_photons(range, ivec2(y, z));
            uint begin = clamp(slice_begin, passed, passed + run.y) - passed;
            uint end = clamp(slice_end, passed, passed + run.y) - passed;
            for (uint k = begin + lane; k < end; k += push.lanes) {
                uint place = run.x + k;
                place = place >= photon_count ? place - photon_count : place;
                uvec4 words = sorted_map[2 * place];
                vec3 position = uintBitsToFloat(words.xyz);
                precise vec3 way = position - point.position;
                precise float distance_squared = way.x * way.x + way.y * way.y + way.z * way.z;
                if (distance_squared <= radius * radius && cell_at(position, push.cells).yz == ivec2(y, z)) {
                    uvec4 light = sorted_map[2 * place + 1];
                    // Most photons lie in the point's plane: nothing of theirs is to be unpacked but their flux.
                    bool is_alike = words.w == point.plane;
                    vec3 photon_normal = normal;
                    float height = 0.0;
                    if (!is_alike) {
                        photon_normal = plane_normal(words.w);
                        height = plane_height(words.w, point.position);
                    }
                    bool may_count = is_alike || (belongs(normal, photon_normal, height, radius) && !are_apart(point.plane, words.w));
                    bool counts = may_count && !(has_cuts && is_cut_off(cuts, way))
                                  && ((point.arrivals >> (light.w >> 30)) & 1u) != 0;
                    vec3 wi = ns;
                    float cosine = 1.0;
                    if (!(is_alike && is_even)) {
                        wi = unpack_direction(light.w);
                        cosine = dot(wi, ns);
                    }
                    if (counts && cosine > 0.0) {
                        float weight = lobe_weight(point.surface, point.exponent, ns, wo, wi);
                        bool is_near = false;
                        if (HAS_DIFFERENCES) {
                            is_near = distance_squared <= near_radius * near_radius
                                      && (is_alike || belongs(normal, photon_normal, height, near_radius));
                        }
                        float near_gain = 1.0;
                        if (KERNEL != KERNEL_BOX) {
                            float share = kernel_at(distance_squared, height, radius);
                            weight *= share;
                            near_gain = is_near ? divide(kernel_at(distance_squared, height, near_radius), share) : 0.0;
                        }
                        if (HAS_SMOOTH_NORMALS) {
                            weight *= is_flat ? 1.0 : shading_gain(cosine, dot(wi, photon_normal));
                        }
                        vec3 arrived = uintBitsToFloat(light.xyz);
                        if (is_layered) {
                            float coat_cosine = cosine;
                            if (HAS_COATS) {
                                coat_cosine = abs(dot(wi, unpack_normal(cover.coat_normal)));
                            }
                            LayerAlbedos lit = albedos_at(lobes.alpha, cover, cosine, coat_cosine);
                            arrived *= 3.14159265358979324 * matt_brdf(lobes, cover, film, lit, ns, wo, wi);
                        }
                        precise vec3 flux = arrived * weight;
                        note_unless(is_finite(flux), NONFINITE_ESTIMATE, 0, push.round, index % push.pixel_count);
                        float chance = chance_of(mix32(point_bits + position_bits(position)));
                        [[unroll]] for (uint channel = 0; channel < 3; channel++) {
                            uvec2 amount = fixed_point(flux[channel], chance);
                            if (HAS_ALL_ARRIVALS) {
                                [[unroll]] for (uint arrival = 0; arrival < 3; arrival++) {
                                    sums[3 * arrival + channel] = add64(sums[3 * arrival + channel], arrival == light.w >> 30 ? amount : uvec2(0));
                                }
                            } else {
                                sums[channel] = add64(sums[channel], amount);
                            }
                            if (is_near) {
                                if (KERNEL != KERNEL_BOX) {
                                    amount = fixed_point(flux[channel] * near_gain, chance);
                                }
                                nearer[channel] = add64(nearer[channel], amount);
                            }
                        }
                        found = true;
                    }
                }
            }
            passed += run.y;
        }
    }
    if (push.first_slice == 0 && passed > GATHER_SLICE && lane == 0) {
        uint place = atomicAdd(crowded[0], 1);
        crowded[2 + 2 * place] = index;
        crowded[3 + 2 * place] = passed;
        atomicMax(crowded[1], passed);
    }
    if (found) {
        // Without direct light the first set of sums is that of caustics.
        uint first = 3 * ((push.arrival - 1) * push.point_count + index);
        uint sum_count = 3;
        if (HAS_ALL_ARRIVALS) {
            first = 3 * index;
            sum_count = 9;
        }
        [[unroll]] for (uint k = 0; k < 9; k++) {
            if (k < sum_count && sums[k] != uvec2(0)) {
                add_to_film(first + k / 3 * 3 * push.point_count + k % 3, sums[k]);
            }
        }
        if (HAS_DIFFERENCES) {
            uint place = place_of_near(index, push.point_count, push.map_class == CAUSTIC_CLASS);
            for (uint channel = 0; channel < 3; channel++) {
                if (nearer[channel] != uvec2(0)) {
                    add_to_near(place + 2 * channel, nearer[channel]);
                }
            }
        }
    }
}
