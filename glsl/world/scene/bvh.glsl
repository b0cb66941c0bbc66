// Rays against the scene's triangles: a compressed wide BVH (Ylitie, Karras and Laine 2017), and the
// watertight test of Woop, Benthin and Wald (2013).

// In the order of the BVH's leaves; its front is where it runs counter-clockwise.
struct Triangle {
    vec3 a;
    vec3 b;
    vec3 c;
    uint material;
    // Number of its front's plane; plus `HIDDEN` if others that lie in it hide a part: then it counts as no surface,
    // triangles of their own stand for what is visible of it, and rays meet it only between those.
    uint plane;
};

#include "world/scene/bvh_node.glsl"

layout(set = 0, binding = 0, scalar) readonly buffer Nodes { BvhNode nodes[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Triangles { Triangle triangles[]; };

struct Hit {
    float t;
    uint triangle; // NONE: no hit
    float u; // barycentric weights of the second and third corner
    float v;
};

// The ray's own axes: z along its largest component, sheared so that the ray is that axis.
struct ShearedRay {
    vec3 origin;
    vec3 shear;
    uint axis;
};

vec3 along_axis(vec3 v, uint axis)
{
    return axis == 0 ? v.yzx : (axis == 1 ? v.zxy : v.xyz);
}

ShearedRay sheared(vec3 origin, vec3 direction)
{
    vec3 size = abs(direction);
    uint axis = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
    vec3 d = along_axis(direction, axis);
    precise vec3 shear = vec3(divide(d.x, d.z), divide(d.y, d.z), divide(1.0, d.z));
    return ShearedRay(origin, shear, axis);
}

// Bound of the error of each coordinate of a point on a triangle: a few roundings of its largest corner's. It is
// the same along every axis, as a plane through the origin is no more exact than its corners.
float triangle_error(Triangle triangle)
{
    vec3 largest = max(abs(triangle.a), max(abs(triangle.b), abs(triangle.c)));
    return max(largest.x, max(largest.y, largest.z)) * (1.0 / 1048576.0);
}

// The distance below which rounding may have put a hit in front of the ray (Pharr, Jakob and Humphreys,
// section 6.8.7): a ray that leaves a triangle does not meet it, or another of its plane, again.
float nearest_certain(ShearedRay ray, vec3 a, vec3 b, vec3 c, vec3 edges, float determinant)
{
    const float rounding = 1.0 / 4194304.0; // four half-ulps
    float z = abs(ray.shear.z) * max(abs(a.z), max(abs(b.z), abs(c.z)));
    vec2 flat_part = max(abs(a.xy), max(abs(b.xy), abs(c.xy))) + abs(ray.shear.xy) * max(abs(a.z), max(abs(b.z), abs(c.z)));
    float edge = max(abs(edges.x), max(abs(edges.y), abs(edges.z)));
    float edge_error = 6.0 * rounding * flat_part.x * flat_part.y;
    return divide(3.0 * (2.0 * rounding * edge * z + edge_error * z), abs(determinant));
}

// Whether a ray whose distance to a triangle is lost in rounding meets it: it must come towards its plane from a
// place off it. So a ray meets the wall beside the one that it leaves, however close to their edge, and never the
// one that it leaves, nor another of that plane.
bool comes_towards(ShearedRay ray, vec3 a, vec3 b, vec3 c, float error)
{
    vec3 normal = cross(b - a, c - a);
    float height = -dot(normal, a);
    float approach = dot(normal, vec3(ray.shear.xy, 1.0)) * (ray.shear.z < 0.0 ? -1.0 : 1.0);
    return height * height > 0.0625 * error * error * dot(normal, normal) && (height > 0.0) != (approach > 0.0);
}

// How far a ray still goes to get behind everything that may hide a triangle of its plane.
float hidden_depth(ShearedRay ray, vec3 a, vec3 b, vec3 c)
{
    vec3 normal = cross(b - a, c - a);
    return divide(abs(ray.shear.z) * norm(normal), abs(dot(normal, vec3(ray.shear.xy, 1.0))) * (0.5 * float(IN_PLANE_INVERSE)));
}

// Takes the triangle if the ray meets it within (0, hit.t), or at hit.t with a smaller number: then the
// nearest hit does not depend on the order of the tests. `precise` keeps an edge's value the same, sign
// apart, in both triangles that share it: no ray slips through between them.
void intersect_triangle(ShearedRay ray, uint index, inout Hit hit)
{
    Triangle triangle = triangles[index];
    vec3 a = along_axis(triangle.a - ray.origin, ray.axis);
    vec3 b = along_axis(triangle.b - ray.origin, ray.axis);
    vec3 c = along_axis(triangle.c - ray.origin, ray.axis);
    precise vec2 pa = a.xy - ray.shear.xy * a.z;
    precise vec2 pb = b.xy - ray.shear.xy * b.z;
    precise vec2 pc = c.xy - ray.shear.xy * c.z;
    precise float u = pc.x * pb.y - pc.y * pb.x;
    precise float v = pa.x * pc.y - pa.y * pc.x;
    precise float w = pb.x * pa.y - pb.y * pa.x;
    if (min(u, min(v, w)) < 0.0 && max(u, max(v, w)) > 0.0) {
        return;
    }
    precise float determinant = u + v + w;
    if (determinant == 0.0) {
        return;
    }
    precise float t = divide(ray.shear.z * (u * a.z + v * b.z + w * c.z), determinant);
    float certain = nearest_certain(ray, a, b, c, vec3(u, v, w), determinant);
    if (t <= certain && !comes_towards(ray, a, b, c, triangle_error(triangle))) {
        return;
    }
    // A back at the same place as a front lies behind it, whichever way their distances were rounded.
    t += (determinant < 0.0) != (ray.shear.z < 0.0) ? min(certain, t * (1.0 / 262144.0)) : 0.0;
    bool is_hidden = HAS_OVERLAPS && triangle.plane >= HIDDEN;
    if (is_hidden) {
        float depth = 2.0 * certain + hidden_depth(ray, a, b, c);
        // What leaves one of those that hide it may start on either side of it.
        if (t <= depth) {
            return;
        }
        t += depth;
    }
    if (t < hit.t || (t == hit.t && index < hit.triangle)) {
        precise float second = divide(v, determinant);
        precise float third = divide(w, determinant);
        hit = Hit(t, index, second, third);
    }
}

// Children that the ray may meet before t_max: nodes as bits 24 to 31 in the order of their visit,
// triangles as bits 0 to 23.
//
// The boxes are widened by a few roundings of the terms that place them, so that no box is missed
// whose triangle would be met.
uint intersect_children(BvhNode node, vec3 origin, vec3 inverse, uint octant, float t_max)
{
    vec3 spacing = spacing_of(node);
    vec3 slope = spacing * inverse;
    vec3 start = (node.origin - origin) * inverse;
    vec3 slack = (abs(start) + 255.0 * abs(slope)) * (1.0 / 1048576.0);
    uint hits = 0;
    [[unroll]] for (uint child = 0; child < 8; child++) {
        vec3 low = vec3(byte_of(node.min_x, child), byte_of(node.min_y, child), byte_of(node.min_z, child)) * slope + start;
        vec3 high = vec3(byte_of(node.max_x, child), byte_of(node.max_y, child), byte_of(node.max_z, child)) * slope + start;
        vec3 enter = min(low, high) - slack;
        vec3 leave = max(low, high) + slack;
        float t_enter = max(max(enter.x, enter.y), max(enter.z, 0.0));
        float t_leave = min(min(leave.x, leave.y), min(leave.z, t_max));
        uint meta = byte_of(node.meta, child);
        if (meta != 0 && t_enter <= t_leave) {
            bool is_node = (meta & 0x18u) == 0x18u;
            hits |= (meta >> 5) << ((is_node ? meta ^ octant : meta) & 31u);
        }
    }
    return hits;
}

// Children whose boxes meet the box from `low` to `high`: nodes as bits 24 to 31, triangles as bits 0 to 23.
uint children_in_box(BvhNode node, vec3 low, vec3 high)
{
    uint child_nodes = child_nodes_of(node);
    uint found = 0;
    [[unroll]] for (uint child = 0; child < 8; child++) {
        uint meta = byte_of(node.meta, child);
        if (meta != 0 && all(lessThanEqual(low_corner(node, child), high)) && all(greaterThanEqual(high_corner(node, child), low))) {
            bool is_node = ((child_nodes >> child) & 1u) != 0;
            found |= is_node ? 0x01000000u << child : (meta >> 5) << (meta & 31u);
        }
    }
    return found;
}

// What rays of this invocation have cost: nodes of the hierarchy, or without one groups of as many triangles as take as long.
uint nodes_visited = 0;

// The nearest hit before t_max, or any hit if `any`.
Hit traverse(vec3 origin, vec3 direction, float t_max, bool any)
{
    Hit hit = Hit(t_max, NONE, 0.0, 0.0);
    ShearedRay ray = sheared(origin, direction);
    if (HAS_BVH) {
        // An axis along which the ray does not move is given a speed too small to matter.
        const float slowest = 1.0 / 1152921504606846976.0;
        vec3 speed = mix(direction, vec3(slowest), lessThan(abs(direction), vec3(slowest)));
        vec3 inverse = vec3(native_quotient(1.0, speed.x), native_quotient(1.0, speed.y), native_quotient(1.0, speed.z));
        uint octant = (direction.x < 0.0 ? 0 : 4) | (direction.y < 0.0 ? 0 : 2) | (direction.z < 0.0 ? 0 : 1);

        // Nodes to visit: the first of their siblings, and bits 24 to 31 for those still to come above the
        // mask of siblings that are nodes at all.
        uvec2 group = uvec2(0, 0x80000000u);
        uvec2 stack[BVH_STACK];
        uint depth = 0;
        for (;;) {
            nodes_visited++;
            uint bit = findMSB(group.y);
            group.y &= ~(1u << bit);
            if (group.y > 0x00ffffffu) {
                stack[depth++] = group;
            }
            uint slot = (bit - 24) ^ octant;
            uint place = group.x + bitCount(group.y & 0xffu & ~(0xffffffffu << slot));
            BvhNode node = nodes[place];
            uint hits = intersect_children(node, origin, inverse, octant, hit.t);
            group = uvec2(node.first_child, (hits & 0xff000000u) | child_nodes_of(node));
            uint leaves = hits & 0x00ffffffu;
            while (leaves != 0) {
                uint leaf = findLSB(leaves);
                leaves &= leaves - 1;
                intersect_triangle(ray, node.first_triangle + leaf, hit);
            }
            if (any && hit.triangle != NONE) {
                break;
            }
            if (group.y <= 0x00ffffffu) {
                if (depth == 0) {
                    break;
                }
                group = stack[--depth];
            }
        }
    } else {
        nodes_visited += (triangles.length() + 15) / 16;
        for (uint index = 0; index < triangles.length(); index++) {
            intersect_triangle(ray, index, hit);
        }
    }
    return hit;
}

Hit closest_hit(vec3 origin, vec3 direction)
{
    return traverse(origin, direction, uintBitsToFloat(0x7f7fffffu), false);
}

// Whether anything lies between `origin` and `origin` + `way`.
bool is_occluded(vec3 origin, vec3 way)
{
    return traverse(origin, way, 1.0, true).triangle != NONE;
}

// Where a ray starts that leaves `position` towards `direction`: off the surface by what the position may
// be wrong, and one float further (Pharr, Jakob and Humphreys, section 6.8.6). `error` bounds each
// coordinate's error.
vec3 offset_origin(vec3 position, float error, vec3 normal, vec3 direction)
{
    precise vec3 way = error * (abs(normal.x) + abs(normal.y) + abs(normal.z)) * (dot(direction, normal) < 0.0 ? -normal : normal);
    precise vec3 start = position + way;
    ivec3 bits = floatBitsToInt(start);
    ivec3 away = ivec3(sign(way)) * (ivec3(1) | (bits >> 31));
    return mix(intBitsToFloat(bits + away), start, equal(start, vec3(0.0)));
}
