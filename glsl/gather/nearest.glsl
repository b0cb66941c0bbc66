// Density estimation by the nearest photons (Jensen 1996): the K photons of the point's wall that are nearest and
// within the radius. The K-th only says how large the disc is: the flux of the K - 1 nearer ones over its area is
// right on average, K of them would be too much by K / (K - 1) (Loftsgaarden and Quesenberry 1965 for the
// estimate; Mack and Rosenblatt 1979 for its bias). Where fewer than K lie within the radius, all of them count
// over the disc of the radius: of evenly spread photons both cases together have the right mean again. Twin of
// src/cpu/nearest.rs.
//
// The film gets what the disc of the full radius would hold at that density, so that it is read the same way as
// that of a fixed radius. At equal distance the photon of lower number, then bounce, is nearer, so the photons
// are the same ones whatever order the map has. A search goes on in a further dispatch where it takes many
// steps. The including kernel chose how the film adds.

// A search for a point's nearest photons, between two dispatches.
struct Search {
    // Leaves before it are done; `NONE`: all are.
    uint next_leaf;
    // Photons found.
    uint found;
    // Squared distance beyond which no photon is wanted.
    float limit;
};

layout(set = 0, binding = 3, scalar) readonly buffer Points { Point points[]; };
layout(set = 0, binding = 0, scalar) readonly buffer Rooms { Room rooms[]; };
// Heaps, the farthest photon on top: (bits of the squared distance, place in the tree), entry by entry of all points.
layout(set = 1, binding = 4, scalar) buffer NearestPhotons { uvec2 nearest_photons[]; };
layout(set = 1, binding = 5, scalar) buffer Searches { Search searches[]; };
layout(set = 1, binding = 6, scalar) buffer Unfinished { uint unfinished[]; };
layout(set = 1, binding = 7, scalar) readonly buffer TreeOrigins { uvec2 tree_origins[]; };

// Steps after which a search makes room: eight lanes that wait for each other, as lavapipe's do, loop 65 535 times
// at most.
const uint SEARCH_STEPS = GATHER_SLICE;
// (1 / 1024)^2: the least disc, relative to that of the radius.
const float LEAST_DISC = 1.0 / 1048576.0;

uint heap_place(uint lane, uint entry)
{
    return entry * (push.end_point - push.first_point) + lane;
}

// Squared distances are not negative, so their bits are in their order.
bool nearer(uvec2 a, uvec2 b)
{
    if (a.x != b.x) {
        return a.x < b.x;
    }
    uvec2 origin_a = tree_origins[a.y], origin_b = tree_origins[b.y];
    return origin_a.x != origin_b.x ? origin_a.x < origin_b.x : origin_a.y < origin_b.y;
}

// Keeps a photon if it is one of the nearest so far.
void insert_nearest(uint lane, uvec2 photon, inout uint found, inout uint steps)
{
    uint entry;
    if (found < push.nearest) {
        entry = found;
        found++;
        while (entry > 0) {
            uint parent = (entry - 1) / 2;
            uvec2 above = nearest_photons[heap_place(lane, parent)];
            if (nearer(photon, above)) {
                break;
            }
            nearest_photons[heap_place(lane, entry)] = above;
            entry = parent;
            steps++;
        }
    } else if (nearer(photon, nearest_photons[heap_place(lane, 0)])) {
        entry = 0;
        uint child = 1;
        while (child < found) {
            uvec2 below = nearest_photons[heap_place(lane, child)];
            if (child + 1 < found) {
                uvec2 other = nearest_photons[heap_place(lane, child + 1)];
                if (nearer(below, other)) {
                    below = other;
                    child++;
                }
            }
            if (nearer(below, photon)) {
                break;
            }
            nearest_photons[heap_place(lane, entry)] = below;
            entry = child;
            child = 2 * entry + 1;
            steps++;
        }
    } else {
        return;
    }
    nearest_photons[heap_place(lane, entry)] = photon;
}

// A squared distance within which K photons lie for certain, found in the smallest node around the point that has
// so many; the radius where that is less, or they are not there at all.
float first_limit(Point point, uint begin, uint leaf_count)
{
    uint photon_count = wall_begins[point.wall + 1] - begin;
    if (photon_count < push.nearest) {
        return push.radius_squared;
    }
    uint leaf = 0;
    uint height = leaf_count == 1 ? 0 : findMSB(leaf_count - 1) + 1;
    uint first = 0, end = photon_count;
    while (height > 0) {
        height--;
        uint boundary = leaf + (1u << height);
        if (boundary < leaf_count && beyond_plane(point, begin, boundary) >= 0.0) {
            leaf = boundary;
        }
        uint node_end = min((leaf + (1u << height)) * TREE_LEAF, photon_count);
        if (node_end - leaf * TREE_LEAF < push.nearest) {
            break;
        }
        first = leaf * TREE_LEAF;
        end = node_end;
    }
    // A wall whose last node is nearly empty has the next larger one filled; MAX_NEAREST bounds both.
    vec2 place = along_wall(point.position, point.wall / 2);
    float farthest = 0.0;
    for (uint i = first; i < min(end, first + 2 * MAX_NEAREST); i++) {
        farthest = max(farthest, squared_distance(place, tree_photons[begin + i]));
    }
    return min(farthest, push.radius_squared);
}

// sum * factor in the film's units, rounded once: sum below 2^38 in units of 2^-NEAREST_BITS, factor from 1 to
// 2^NEAREST_GAIN_BITS. The product with the factor's 24 bits fits 62.
uvec2 scaled(uvec2 sum, float factor)
{
    uint bits = floatBitsToUint(factor);
    uint mantissa = (bits & 0x007fffffu) | 0x00800000u;
    uint exponent = (bits >> 23) - 127;
    uint high, low;
    umulExtended(sum.x, mantissa, high, low);
    high += sum.y * mantissa;
    uint shift = NEAREST_BITS + 23 - push.film_shift - exponent;
    uint half_bit = shift - 1;
    uint carry;
    low = uaddCarry(low, half_bit < 32 ? 1u << half_bit : 0, carry);
    high += carry + (half_bit < 32 ? 0 : 1u << (half_bit - 32));
    if (shift < 32) {
        return uvec2(low >> shift | high << (32 - shift), high >> shift);
    }
    return uvec2(high >> (shift - 32), 0);
}

// What the disc of the full radius holds where `found` photons are in the heap.
void add_nearest(uint index, uint lane, Point point, uint found)
{
    bool is_full = found == push.nearest;
    uvec2 sums[2];
    sums[0] = uvec2(0);
    sums[1] = uvec2(0);
    for (uint entry = is_full ? 1 : 0; entry < found; entry++) {
        uint place = nearest_photons[heap_place(lane, entry)].y;
        sums[0] = add_words(sums[0], to_fixed_point(flux_of(tree_photons[place]), float(1u << NEAREST_BITS)));
        sums[1] = add_words(sums[1], to_fixed_point(weight_of(tree_photons[place]), float(1u << NEAREST_BITS)));
    }
    float factor = 1.0;
    if (is_full) {
        float farthest = max(uintBitsToFloat(nearest_photons[heap_place(lane, 0)].x), push.radius_squared * LEAST_DISC);
        float whole = push.radius_squared * covered_disc(point.position, point.wall, sqrt(push.radius_squared), rooms[0]);
        float covered = farthest * covered_disc(point.position, point.wall, sqrt(farthest), rooms[0]);
        factor = clamp(divide(whole, covered), 1.0, float(1u << NEAREST_GAIN_BITS));
    }
    for (uint channel = 0; channel < CHANNEL_COUNT; channel++) {
        uvec2 amount = scaled(sums[channel], factor);
        if (amount != uvec2(0)) {
            add_to_film(index * CHANNEL_COUNT + channel, amount);
        }
    }
}

void gather()
{
    uint lane = invocation_index();
    uint index = push.first_point + lane;
    if (index >= push.end_point) {
        return;
    }
    Point point = points[index];
    uint begin = wall_begins[point.wall];
    uint leaf_count = leaf_count_of(point.wall);
    Search search = searches[lane];
    if (push.is_first == 1) {
        search = Search(0, 0, first_limit(point, begin, leaf_count));
    }
    if (search.next_leaf == NONE) {
        return;
    }
    uint height = leaf_count <= 1 ? 0 : findMSB(leaf_count - 1) + 1;
    Walk walk = Walk(begin, search.next_leaf, leaf_count, height, search.next_leaf != 0, 0);
    vec2 place = along_wall(point.position, point.wall / 2);
    uint leaf;
    while (walk.steps < SEARCH_STEPS && next_leaf(walk, point, search.limit, leaf)) {
        uint end = min(begin + (leaf + 1) * TREE_LEAF, wall_begins[point.wall + 1]);
        for (uint i = begin + leaf * TREE_LEAF; i < end; i++) {
            walk.steps++;
            float distance_squared = squared_distance(place, tree_photons[i]);
            if (distance_squared <= search.limit) {
                insert_nearest(lane, uvec2(floatBitsToUint(distance_squared), i), search.found, walk.steps);
            }
        }
        if (search.found == push.nearest) {
            search.limit = min(search.limit, uintBitsToFloat(nearest_photons[heap_place(lane, 0)].x));
        }
    }
    bool is_done = walk.leaf >= walk.end;
    if (is_done) {
        add_nearest(index, lane, point, search.found);
    } else {
        atomicMax(unfinished[0], 1);
    }
    searches[lane] = Search(is_done ? NONE : walk.leaf, search.found, search.limit);
}
