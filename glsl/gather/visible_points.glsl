// Density estimation of a photon map: each visible point sums the flux of the photons that belong to it.
// A point's candidates are shared out in slices of GATHER_SLICE, so that no invocation loops long: the first one of
// every point at first, then those of the few points that have more. Of a slice, as many invocations as there are
// lanes take every so many-th candidate. The including kernel chose how sums are added.

#include "world/scene/visible_point.glsl"

layout(set = 1, binding = 4, scalar) readonly buffer VisiblePoints { VisiblePoint visible_points[]; };
layout(set = 1, binding = 2, scalar) readonly buffer SortedMap { uvec4 sorted_map[]; };
// Points with more than one slice: how many, the longest one's candidates; then which, and each one's candidates.
layout(set = 1, binding = 3, scalar) buffer DensePoints { uint dense_points[]; };

// The point of an invocation, or NONE.
uint point_of(uint item, uint slice)
{
    if (push.first_slice != 0) {
        bool has_slice = item < dense_points[0] && dense_points[3 + 2 * item] > slice * GATHER_SLICE;
        return has_slice ? dense_points[2 + 2 * item] : NONE;
    }
    uint place = push.first_point + item;
    if (place >= push.end_point) {
        return NONE;
    }
    return point_in_tiles(place, push.width, push.height, push.pixel_count);
}

layout(set = 1, binding = 14, scalar) readonly buffer RoughLobesOfPoints { RoughLobes rough_lobes[]; };
layout(set = 1, binding = 16, scalar) readonly buffer RoughCoversOfPoints { RoughCover rough_covers[]; };

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

// What a point takes of photons.
struct Query {
    VisiblePoint point;
    uint bits; // that decide what is rounded up
    float radius;
    vec3 normal;
    vec3 ns;
    vec3 wo;
    bool is_flat;
    bool is_even; // of a photon in its plane nothing matters but the flux
    bool has_cuts;
    Cuts cuts;
    // Of a layered surface.
    bool is_layered;
    RoughLobes lobes;
    RoughCover cover;
};

// That of this thread, and what it has found. No arguments: drivers keep copies of what has arrays.
Query query;
// Three channels of each arrival; the first three of a map that holds one arrival only. 32 bits after the binary point:
// of a channel a billionth as bright as the photons' mean, a photon still adds some units.
uvec2 sums[9];
// The same of photons within NEAR_SHARE of the radius, all arrivals together.
uvec2 nearer[3];
bool has_found;

// Whether a point asks this map, and is of a class that this grid serves: then `radius` is the point's own.
bool is_asked(VisiblePoint point, uint index, inout float radius)
{
    uint wanted = HAS_ALL_ARRIVALS ? ARRIVED_DIRECT | ARRIVED_CAUSTIC | ARRIVED_INDIRECT : 1u << push.arrival;
    if ((point.arrivals & wanted) == 0) {
        return false;
    }
    if (HAS_RADIUS_CLASSES) {
        uint own_class = radius_class(index, push.map_class);
        radius = radius_of_class(push.radius, own_class);
        return own_class >= push.first_class && own_class < push.end_class;
    }
    return true;
}

void start_query(VisiblePoint point, uint index, float radius)
{
    query.point = point;
    query.bits = mix32(push.rounding + position_bits(point.position));
    query.normal = plane_normal(point.plane);
    query.cuts = cuts_of(push.first_cut + index, query.normal, radius);
    query.has_cuts = query.cuts.lines[0].w < query.cuts.reach;
    query.radius = min(radius, query.cuts.reach);
    query.is_flat = point.shading_normal == NONE;
    query.ns = query.is_flat ? query.normal : unpack_normal(point.shading_normal);
    query.wo = unpack_direction(point.wo);
    query.is_even = query.is_flat && !has_lobe(point.surface);
    query.is_layered = HAS_LAYERS && point.surface == SURFACE_LAYERED;
    query.cover = no_cover();
    if (query.is_layered) {
        query.lobes = rough_lobes[index];
        if (HAS_COATS || HAS_SHEEN || HAS_IRIDESCENCE) {
            query.cover = rough_covers[index];
        }
    }
    [[unroll]] for (uint k = 0; k < 9; k++) {
        sums[k] = uvec2(0);
    }
    nearer = uvec2[](uvec2(0), uvec2(0), uvec2(0));
    has_found = false;
}

// The flux of a photon as a layered surface weighs it beside a Lambertian one.
vec3 layered_weight(vec3 wi, float cosine)
{
    float coat_cosine = HAS_COATS ? abs(dot(wi, unpack_normal(query.cover.coat_normal))) : cosine;
    RoughLobes lobes = query.lobes;
    RoughCover cover = query.cover;
    LayerAlbedos towards_light = albedos_at(lobes.alpha, cover, cosine, coat_cosine);
    return 3.14159265358979324 * rough_brdf(lobes, cover, cover.film, towards_light, query.ns, query.wo, wi);
}

// Adds a photon of an arrival, 0 to 2; `near_gain` is what its flux counts within the smaller radius, 0 beyond.
void add_photon(vec3 flux, uint arrival, bool is_near, float near_gain, float chance)
{
    [[unroll]] for (uint channel = 0; channel < 3; channel++) {
        uvec2 amount = fixed_point(flux[channel], chance);
        if (HAS_ALL_ARRIVALS) {
            [[unroll]] for (uint k = 0; k < 3; k++) {
                sums[3 * k + channel] = add64(sums[3 * k + channel], k == arrival ? amount : uvec2(0));
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
    has_found = true;
}

// Adds what a photon of the row yz of cells brings to the point.
void gather_photon(uint place, ivec2 yz, uint index)
{
    VisiblePoint point = query.point;
    float radius = query.radius;
    uvec4 words = sorted_map[2 * place];
    vec3 position = uintBitsToFloat(words.xyz);
    precise vec3 way = position - point.position;
    precise float distance_squared = way.x * way.x + way.y * way.y + way.z * way.z;
    if (!(distance_squared <= radius * radius && cell_at(position, push.cells).yz == yz)) {
        return;
    }
    uvec4 light = sorted_map[2 * place + 1];
    uint arrival = light.w >> 30;
    // Most photons lie in the point's plane: nothing of theirs is to be unpacked but their flux.
    bool is_alike = words.w == point.plane;
    vec3 photon_normal = query.normal;
    float height = 0.0;
    if (!is_alike) {
        photon_normal = plane_normal(words.w);
        height = plane_height(words.w, point.position);
    }
    bool may_count = is_alike || (belongs(query.normal, photon_normal, height, radius) && !are_apart(point.plane, words.w));
    if (!may_count || (query.has_cuts && is_cut_off(query.cuts, way)) || ((point.arrivals >> arrival) & 1u) == 0) {
        return;
    }
    vec3 wi = query.ns;
    float cosine = 1.0;
    if (!(is_alike && query.is_even)) {
        wi = unpack_direction(light.w);
        cosine = dot(wi, query.ns);
    }
    if (!(cosine > 0.0)) {
        return;
    }
    float weight = lobe_weight(point.surface, point.exponent, query.ns, query.wo, wi);
    float near_radius = radius * NEAR_SHARE;
    bool is_near = HAS_DIFFERENCES && distance_squared <= near_radius * near_radius
                && (is_alike || belongs(query.normal, photon_normal, height, near_radius));
    float near_gain = 1.0;
    if (KERNEL != KERNEL_BOX) {
        float share = kernel_at(distance_squared, height, radius);
        weight *= share;
        near_gain = is_near ? divide(kernel_at(distance_squared, height, near_radius), share) : 0.0;
    }
    if (HAS_SMOOTH_NORMALS) {
        weight *= query.is_flat ? 1.0 : shading_gain(cosine, dot(wi, photon_normal));
    }
    vec3 arrived = uintBitsToFloat(light.xyz);
    if (query.is_layered) {
        arrived *= layered_weight(wi, cosine);
    }
    precise vec3 flux = arrived * weight;
    note_unless(is_finite(flux), NONFINITE_ESTIMATE, 0, push.round, index % push.pixel_count);
    add_photon(flux, arrival, is_near, near_gain, chance_of(mix32(query.bits + position_bits(position))));
}

// Adds what was found to the sums of the point.
void write_sums(uint index)
{
    // Without direct light the first set of sums is that of caustics.
    uint first = HAS_ALL_ARRIVALS ? 3 * index : 3 * ((push.arrival - 1) * push.point_count + index);
    uint sum_count = HAS_ALL_ARRIVALS ? 9 : 3;
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
    float radius = push.radius;
    if (!is_asked(point, index, radius)) {
        return;
    }
    start_query(point, index, radius);
    CellRange range = cells_near(point.position, radius);
    uint photon_count = map_length();
    uint slice_begin = slice * GATHER_SLICE;
    uint slice_end = slice_begin + GATHER_SLICE;
    uint passed = 0; // candidates in the rows before this one
    for (int z = range.first.z; z <= range.last.z; z++) {
        for (int y = range.first.y; y <= range.last.y; y++) {
            uvec2 run = row_of_photons(range, ivec2(y, z));
            uint begin = clamp(slice_begin, passed, passed + run.y) - passed;
            uint end = clamp(slice_end, passed, passed + run.y) - passed;
            for (uint k = begin + lane; k < end; k += push.lanes) {
                uint place = run.x + k;
                gather_photon(place >= photon_count ? place - photon_count : place, ivec2(y, z), index);
            }
            passed += run.y;
        }
    }
    if (push.first_slice == 0 && passed > GATHER_SLICE && lane == 0) {
        uint place = atomicAdd(dense_points[0], 1);
        dense_points[2 + 2 * place] = index;
        dense_points[3 + 2 * place] = passed;
        atomicMax(dense_points[1], passed);
    }
    if (has_found) {
        write_sums(index);
    }
}
