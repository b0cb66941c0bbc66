// Finds the walls that cut the discs of density estimates off.
// Dispatched by src/engine/scene/estimate.rs once a round for each map. One thread = one visible point.
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require

#include "world/scene/visible_point.glsl"
#include "world/scene/work.glsl"

// Where walls cut the discs of density estimates off.
struct DiscCutsPush {
    WorkDivision work;
    uint first_point;
    uint end_point;
    uint pixel_count;
    // Of the picture; 0 where points are receivers, in an order of their own.
    uint width;
    uint height;
    // Mask of the arrivals that the map holds.
    uint arrivals;
    // `GLOBAL_CLASS` or `CAUSTIC_CLASS`, and where its cuts begin.
    uint map_class;
    uint first_cut;
    // Of class 0.
    float radius;
};

layout(push_constant, scalar) uniform Push { DiscCutsPush push; };
layout(set = 1, binding = 1, scalar) readonly buffer VisiblePoints { VisiblePoint visible_points[]; };

#include "math/math.glsl"
#include "dispatch/dispatch.glsl"
#include "world/scene/effects.glsl"
#include "world/scene/sample_places.glsl"
#include "math/directions.glsl"
#include "world/scene/bvh.glsl"
#include "world/scene/box_walk.glsl"
#include "material/surface.glsl"
#include "gather/belongs.glsl"
#include "gather/radius_class.glsl"
#include "gather/disc_cuts.glsl"
#include "world/scene/tiles.glsl"

// What rises above the surface by less than this share of the radius is no wall: low steps, and the roughness of a mesh. Light that
// passes below what stands higher than that does not reach far.
const float WALL_SHARE = 1.0 / 32.0;
// Where more walls are in the way than there are lines, the disc shrinks to the next of them, but no further than this share.
const float LEAST_SHARE = 1.0 / 8.0;
// What rounding may move a wall's foot by: 8 units in the last place of a coordinate of 0.5.
const float FOOT_ERROR = 1.0 / 2097152.0;

// Triangles that are looked at for one line: four times as many are as many as a device's loops may turn.
const uint MAX_SEEN = 12288;

// A visible point in the frame of its surface.
struct Site {
    vec3 position;
    vec3 x;
    vec3 y;
    vec3 normal;
    float radius;
    float level; // above the surface: what crosses it is a wall
};

// The nearest place where a wall stands on the surface.
struct Foot {
    vec2 place;
    float squared; // its distance
    vec2 across; // a unit vector at a right angle to the wall, away from its front
};

vec3 on_site(Site site, vec3 position)
{
    vec3 way = position - site.position;
    return vec3(dot(way, site.x), dot(way, site.y), dot(way, site.normal) - site.level);
}

// Takes the nearest place of a triangle that is not cut off yet, if none is nearer.
void look_at(Site site, uint index, Cuts cuts, inout Foot nearest)
{
    Triangle triangle = triangles[index];
    if (triangle.plane >= HIDDEN || is_not_there(triangle.material)) {
        return;
    }
    vec3 a = on_site(site, triangle.a), b = on_site(site, triangle.b), c = on_site(site, triangle.c);
    bool a_above = a.z > 0.0, b_above = b.z > 0.0, c_above = c.z > 0.0;
    if (a_above == b_above && b_above == c_above) {
        return;
    }
    // A surface that the estimate goes on over is no wall.
    vec3 front = plane_normal(2 * triangle.plane);
    vec3 side = dot(front, site.normal) < 0.0 ? -front : front;
    if (belongs(site.normal, side, plane_height(2 * triangle.plane, site.position), site.radius)) {
        return;
    }
    // From the corner that lies alone on its side of the level, to the others.
    vec3 alone = a_above == b_above ? c : (a_above == c_above ? b : a);
    vec3 one = a_above == b_above ? a : (a_above == c_above ? c : b);
    vec3 other = a_above == b_above ? b : (a_above == c_above ? a : c);
    vec2 from = alone.xy + (one.xy - alone.xy) * divide(alone.z, alone.z - one.z);
    vec2 to = alone.xy + (other.xy - alone.xy) * divide(alone.z, alone.z - other.z);
    // Down to the surface, along the triangle's plane.
    vec3 wall = vec3(dot(front, site.x), dot(front, site.y), dot(front, site.normal));
    float flat_squared = dot(wall.xy, wall.xy);
    if (flat_squared < 0.01) {
        return;
    }
    vec2 down = wall.xy * divide(wall.z * site.level, flat_squared);
    from += down;
    to += down;

    vec2 along = to - from;
    float first = 0.0, last = 1.0;
    [[unroll]] for (uint k = 0; k < CUT_LINES; k++) {
        vec2 direction = vec2(dot(cuts.lines[k].xyz, site.x), dot(cuts.lines[k].xyz, site.y));
        // Other triangles of the same wall lie beyond the line, even if the point touches it.
        float beyond = dot(from, direction) - cuts.lines[k].w + CUT_ANGLE_ERROR * cuts.reach + 0.5 * FOOT_ERROR;
        float slope = dot(along, direction);
        first = slope < 0.0 ? max(first, divide(-beyond, slope)) : first;
        last = slope > 0.0 ? min(last, divide(-beyond, slope)) : last;
        last = slope == 0.0 && beyond > 0.0 ? -1.0 : last;
    }
    if (first > last) {
        return;
    }
    float squared_length = dot(along, along);
    float at = squared_length > 0.0 ? clamp(divide(-dot(from, along), squared_length), first, last) : first;
    vec2 place = from + at * along;
    float squared = dot(place, place);
    if (squared < nearest.squared) {
        vec2 across = wall.xy * inversesqrt(flat_squared);
        nearest = Foot(place, squared, dot(from, across) > 0.0 ? across : -across);
    }
}

// The nearest foot of a wall within the radius; farther off: there is none.
Foot nearest_foot(Site site, Cuts cuts)
{
    Foot nearest = Foot(vec2(0.0), cuts.reach * cuts.reach, vec2(0.0));
    uint first_triangle, leaves;
    // Around the disc at the level of walls, a little wider than the sphere: leaning walls stand nearer than they are there.
    vec3 middle = site.position + site.level * site.normal;
    vec3 sines = 1.0 - site.normal * site.normal;
    vec3 reach = (1.0 + 1.0 / 1024.0 + 10.0 * WALL_SHARE) * site.radius
               * vec3(square_root(max(sines.x, 0.0)), square_root(max(sines.y, 0.0)), square_root(max(sines.z, 0.0))) + FOOT_ERROR;
    uint seen = 0;
    begin_walk();
    while (seen < MAX_SEEN && next_leaves(middle - reach, middle + reach, first_triangle, leaves)) {
        for (; leaves != 0; leaves &= leaves - 1) {
            look_at(site, first_triangle + findLSB(leaves), cuts, nearest);
            seen++;
        }
    }
    return nearest;
}

void main()
{
    work = push.work;
    uint place = push.first_point + invocation_index();
    if (place >= push.end_point) {
        return;
    }
    place = point_in_tiles(place, push.width, push.height, push.pixel_count);
    VisiblePoint point = visible_points[place];
    if ((point.arrivals & push.arrivals) == 0) {
        return;
    }
    float radius = push.radius;
    if (HAS_RADIUS_CLASSES) {
        radius = radius_of_class(radius, radius_class(place, push.map_class));
    }
    vec3 normal = plane_normal(point.plane);
    Site site = Site(point.position, to_frame(vec3(1.0, 0.0, 0.0), normal), to_frame(vec3(0.0, 1.0, 0.0), normal), normal, radius,
                     WALL_SHARE * radius);
    Cuts cuts = no_cuts(radius);
    vec2 directions[CUT_LINES];
    float distances[CUT_LINES];
    float reach = radius;
    uint count = 0;
    for (;;) {
        Foot foot = nearest_foot(site, cuts);
        if (foot.squared >= radius * radius) {
            break;
        }
        float distance = square_root(foot.squared);
        if (count == CUT_LINES) {
            reach = max(distance - FOOT_ERROR, LEAST_SHARE * radius);
            break;
        }
        [[unroll]] for (uint k = 0; k < CUT_LINES; k++) {
            if (k == count) {
                directions[k] = distance > 64.0 * FOOT_ERROR ? divide(foot.place, distance) : foot.across;
                distances[k] = max(distance - FOOT_ERROR, 0.0);
                cuts.lines[k] = unpack_cut(pack_cut(directions[k], distances[k], radius), normal, radius);
            }
        }
        count++;
    }
    uvec4 words = uvec4(floatBitsToUint(reach), NONE, NONE, NONE);
    [[unroll]] for (uint k = 0; k < CUT_LINES; k++) {
        if (k < count && distances[k] < reach) {
            words[1 + k] = pack_cut(directions[k], distances[k], reach);
        }
    }
    disc_cuts[push.first_cut + place] = words;
}
