// Finds the class of each visible point's radius, from the photons of a trial around it: the density of those within the smallest
// radius that holds enough of them.
// Dispatched by src/engine/scene/radius_class.rs for each grid, from the finest to the widest, in a run's first round. One thread =
// one visible point.
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

#include "world/scene/visible_point.glsl"
#include "index/push.glsl"

// Which radius each visible point has, by photons of a trial around it.
struct RadiusClassPush {
    uint first_point;
    uint end_point;
    // `GLOBAL_CLASS` or `CAUSTIC_CLASS`, the first of the classes that this grid serves, and how many there are.
    uint map_class;
    uint first_class;
    uint class_count;
    // Where nothing is known.
    uint usual_class;
    // Of class 0.
    float radius;
    // Photons of the trial within a radius that is to hold as many of a round as wanted.
    float wanted;
    // Of what is clear around a point: larger radii are halved, once or twice.
    float clearance_share;
    // No radius need be smaller than this share of a point's distance from the eye: half a pixel.
    vec3 eye;
    float pixel_share;
    CellPush cells;
};

layout(push_constant, scalar) uniform Push { RadiusClassPush push; };
layout(set = 1, binding = 4, scalar) readonly buffer VisiblePoints { VisiblePoint visible_points[]; };
layout(set = 1, binding = 2, scalar) readonly buffer SortedMap { uvec4 sorted_map[]; };
layout(set = 1, binding = 3, scalar) readonly buffer Clearances { float clearances[]; };
// Points of each class: of the global map, then of the caustic map.
layout(set = 1, binding = 5, scalar) buffer ClassCounts { uint class_counts[]; };

#include "math/math.glsl"
#include "dispatch/dispatch.glsl"
#include "math/directions.glsl"
#include "world/scene/effects.glsl"
#include "gather/belongs.glsl"
#include "index/buckets.glsl"
#include "gather/bucket_rows.glsl"
#include "gather/radius_class.glsl"

// How often a radius may be halved for what is clear around a point: where the density is known, to a sixteenth of the photons;
// where it is not, once, as a chance that is missed weighs more in a smaller disc.
const uint HALVINGS_KNOWN = 2;
const uint HALVINGS_UNKNOWN = 1;

// Photons within `radius` of a point and within half of it; counting ends where the second are enough. A trial has no more of them
// than a loop may take (src/engine/scene/trial.rs).
uvec2 photons_near(VisiblePoint point, float radius)
{
    uvec2 found = uvec2(0);
    vec3 normal = plane_normal(point.plane);
    CellRange range = cells_near(point.position, radius);
    uint photon_count = map_length();
    for (int z = range.first.z; z <= range.last.z; z++) {
        for (int y = range.first.y; y <= range.last.y; y++) {
            uvec2 run = row_of_photons(range, ivec2(y, z));
            for (uint k = 0; k < run.y && found.y < 8 * CLASS_PHOTONS; k++) {
                uint place = run.x + k;
                uvec4 words = sorted_map[2 * (place >= photon_count ? place - photon_count : place)];
                vec3 position = uintBitsToFloat(words.xyz);
                vec3 way = position - point.position;
                float squared = way.x * way.x + way.y * way.y + way.z * way.z;
                bool counts = squared <= radius * radius && cell_at(position, push.cells).yz == ivec2(y, z);
                if (counts && words.w != point.plane) {
                    counts = belongs(normal, plane_normal(words.w), plane_height(words.w, point.position), radius)
                             && !are_apart(point.plane, words.w);
                }
                found += uvec2(counts, counts && squared <= 0.25 * radius * radius);
            }
        }
    }
    return found;
}

// The class at a point with so many photons within `radius` and within half of it.
uint class_at(VisiblePoint point, float radius, uvec2 found, float clear)
{
    uint own_class = push.usual_class;
    uint most_halvings = HALVINGS_UNKNOWN;
    if (found.x >= CLASS_PHOTONS) {
        bool is_dense = found.y >= CLASS_PHOTONS;
        float squared = is_dense ? 0.25 * radius * radius : radius * radius;
        float count = float(is_dense ? found.y : found.x);
        // The class whose radius is nearest, by its logarithm, to that which holds as many photons as wanted.
        own_class = 0;
        most_halvings = HALVINGS_KNOWN;
        float own = radius_of_class(push.radius, own_class);
        while (own_class + 1 < push.class_count && own * own * count > 2.0 * squared * push.wanted) {
            own_class++;
            own = radius_of_class(push.radius, own_class);
        }
    }
    vec3 way = point.position - push.eye;
    float pixel = push.pixel_share * sqrt(way.x * way.x + way.y * way.y + way.z * way.z);
    while (own_class > 0 && radius_of_class(push.radius, own_class) < pixel) {
        own_class--;
    }
    uint last_class = min(own_class + most_halvings, push.class_count - 1);
    while (own_class < last_class && radius_of_class(push.radius, own_class) > clear) {
        own_class++;
    }
    return own_class;
}

void main()
{
    uint index = push.first_point + invocation_index();
    if (index >= push.end_point || radius_class(index, push.map_class) != NO_CLASS) {
        return;
    }
    VisiblePoint point = visible_points[index];
    uint own_class = push.usual_class;
    // What is asked of a point does not count, so that parts of a picture have the radii of the whole. Rays of a final gather end
    // elsewhere in each round, and where this round sees nothing a later one may: they have the usual radius.
    if ((point.arrivals & (SEEN | SEEN_BY_GATHER)) == SEEN) {
        float radius = radius_of_class(push.radius, push.first_class);
        uvec2 found = photons_near(point, radius);
        if (found.x < CLASS_PHOTONS && push.first_class > 0) {
            return; // a wider grid decides
        }
        own_class = class_at(point, radius, found, push.clearance_share * clearances[index]);
        atomicAdd(class_counts[push.map_class / CAUSTIC_CLASS * RADIUS_CLASSES + own_class], 1);
    }
    uint others = radius_classes[index] & ~(0xffu << push.map_class);
    radius_classes[index] = others | own_class << push.map_class;
}
