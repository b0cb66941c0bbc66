// How much surface a density estimate covers, and on which surface a given point lies.

// Integral of the kernel over a disc of radius 1, over pi.
float kernel_norm()
{
    if (KERNEL == KERNEL_BOX) {
        return 1.0;
    }
    if (KERNEL == KERNEL_CONE) {
        return 1.0 / 3.0;
    }
    return 0.5;
}

// Integral of the kernel over the triangle between the centre and the piece from s0 to s1 of a line at
// distance h, all within the disc of radius 1.
float kernel_under_line(float h, float s0, float s1)
{
    if (KERNEL == KERNEL_BOX) {
        return 0.5 * h * (s1 - s0);
    }
    if (KERNEL == KERNEL_CONE) {
        float q0 = sqrt(h * h + s0 * s0), q1 = sqrt(h * h + s1 * s1);
        float height = max(abs(h), 1e-12);
        float cubes = h * (s1 * q1 - s0 * q0) + h * h * h * (asinh(divide(s1, height)) - asinh(divide(s0, height)));
        return 0.5 * h * (s1 - s0) - cubes * (1.0 / 6.0);
    }
    return 0.5 * h * (s1 - s0) - 0.25 * h * (h * h * (s1 - s0) + (s1 * s1 * s1 - s0 * s0 * s0) * (1.0 / 3.0));
}

// Integral over the sector between two directions.
float kernel_in_sector(vec2 from, vec2 to)
{
    float angle = atan(from.x * to.y - from.y * to.x, dot(from, to));
    return 0.5 * kernel_norm() * angle;
}

// Integral of the kernel over the triangle between the centre and an edge, clipped to the unit disc;
// signed by the edge's direction. Says whether the edge enters the disc, and how far the centre lies at least to the left
// of all edges.
float kernel_over_edge(vec2 from, vec2 to, inout bool enters, inout float left)
{
    vec2 edge = to - from;
    float edge_length = norm(edge);
    if (edge_length == 0.0) {
        return 0.0;
    }
    vec2 along = divide(edge, edge_length);
    float h = from.x * along.y - from.y * along.x;
    float s0 = dot(from, along), s1 = dot(to, along);
    left = min(left, h);
    float half_chord_squared = 1.0 - h * h;
    if (half_chord_squared <= 0.0) {
        return kernel_in_sector(from, to);
    }
    float half_chord = sqrt(half_chord_squared);
    float c0 = clamp(s0, -half_chord, half_chord), c1 = clamp(s1, -half_chord, half_chord);
    enters = enters || c0 != c1;
    vec2 foot = h * vec2(along.y, -along.x);
    float sum = kernel_under_line(h, c0, c1);
    if (c0 != s0) {
        sum += kernel_in_sector(from, foot + along * c0);
    }
    if (c1 != s1) {
        sum += kernel_in_sector(foot + along * c1, to);
    }
    return sum;
}

// A degree: what single precision and the facets of a fine mesh may turn a receiver's normal by.
const float RECEIVER_NORMAL_COSINE = 0.99985;

// A place whose surroundings are looked through, and what was found.
struct Cover {
    vec3 position;
    vec3 normal;
    uint plane; // of a visible point; NONE: of a receiver, that is to be found
    float radius;
    float near_radius; // a smaller one that is asked about too; 0: none is
    float reach; // half the edge of the box that is looked through
    uint sum; // kernel's integral, in units of 2^-24 of the squared radius: integers add up alike in whatever order
    uint near_sum; // within the smaller radius, in units of its square
    uint nearest; // plane of the nearest surface
    float distance; // to it
    Cuts cuts;
};

// Whether photons of a plane, or the receiver itself, may lie on it for this place and radius.
bool may_cover(Cover cover, uint plane, vec3 side, float height, float radius)
{
    if (abs(height) >= radius) {
        return false;
    }
    if (cover.plane != NONE) {
        return plane == cover.plane || (belongs(cover.normal, side, height, radius) && !are_apart(cover.plane, plane));
    }
    float cosine = dot(cover.normal, side);
    float sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    return cosine >= RECEIVER_NORMAL_COSINE && abs(height) <= radius * (sine + 1.0 / 1024.0);
}

const uint MOST_EDGES = 3 + CUT_LINES;

// A triangle, and what lines leave of it. Each edge has a place of its own, those of the triangle first: no index depends on what
// is cut, which takes compilers long to make code of. An edge that is gone has no length.
struct Polygon {
    vec2 from[MOST_EDGES];
    vec2 to[MOST_EDGES];
};

Polygon as_polygon(vec2 a, vec2 b, vec2 c)
{
    vec2 none = vec2(0.0);
    return Polygon(vec2[](a, b, c, none, none, none), vec2[](b, c, a, none, none, none));
}

vec2 flat_place(vec3 way, vec3 x, vec3 y, float unit)
{
    return divide(vec2(dot(way, x), dot(way, y)), unit);
}

// Keeps the part whose product with `normal` is at most `most` (Sutherland and Hodgman 1974) of a polygon of so many edges; one more
// leads along the line. Loops over edges are unrolled, for which they need a constant end: the triangles of a fine mesh are as many as a
// device's loops may turn.
void cut_off(inout Polygon polygon, uint edges, vec2 normal, float most)
{
    vec2 leaves = vec2(0.0), returns = vec2(0.0);
    [[unroll]] for (uint k = 0; k < MOST_EDGES; k++) {
        if (k >= edges) {
            continue;
        }
        vec2 from = polygon.from[k], to = polygon.to[k];
        float from_beyond = dot(from, normal) - most, to_beyond = dot(to, normal) - most;
        if ((from_beyond <= 0.0) != (to_beyond <= 0.0)) {
            vec2 crossing = from + (to - from) * divide(from_beyond, from_beyond - to_beyond);
            if (from_beyond <= 0.0) {
                leaves = crossing;
                polygon.to[k] = crossing;
            } else {
                returns = crossing;
                polygon.from[k] = crossing;
            }
        } else if (from_beyond > 0.0) {
            polygon.to[k] = from;
        }
    }
    polygon.from[edges] = leaves;
    polygon.to[edges] = returns;
}

// Keeps what no line cuts off of a triangle in the plane of x and y, in units of `unit`; `rise` leads from its origin to the place that
// the lines belong to.
void cut_off_walls(inout Polygon polygon, Cuts cuts, vec3 x, vec3 y, float unit, vec3 rise)
{
    [[unroll]] for (uint k = 0; k < CUT_LINES; k++) {
        vec4 line = cuts.lines[k];
        if (line.w < cuts.reach) {
            cut_off(polygon, 3 + k, vec2(dot(line.xyz, x), dot(line.xyz, y)) * unit, line.w + dot(line.xyz, rise));
        }
    }
}

// Integral of the kernel over a convex polygon, within the unit disc. Says how far the middle lies at least to the left of its edges.
float kernel_over(Polygon polygon, out float left)
{
    bool enters = false, is_empty = true;
    float sum = 0.0;
    left = 1.0;
    [[unroll]] for (uint k = 0; k < MOST_EDGES; k++) {
        is_empty = is_empty && polygon.from[k] == polygon.to[k];
        sum += kernel_over_edge(polygon.from[k], polygon.to[k], enters, left);
    }
    left = is_empty ? -1.0 : left;
    // No edge in the disc: all of it or nothing, not the rounding of sectors that cancel. Sectors say which of the two: the direction of
    // a short edge is all rounding, and so is the side of it that the middle lies on.
    float whole = 3.14159265358979324 * kernel_norm();
    if (!enters) {
        return sum > 0.5 * whole ? whole : 0.0;
    }
    return sum;
}

uint saturated_sum(uint a, uint b)
{
    return a > 0xffffffffu - b ? 0xffffffffu : a + b;
}

// The part of a triangle within a radius, in units of 2^-24 of its square, and how far the middle lies at least to the left of its edges.
uint triangle_within(Cover cover, Triangle triangle, vec3 front, float height, float radius, out float left)
{
    // In the triangle's own plane, in units of the disc that the sphere cuts out of it.
    float disc = sqrt((radius - height) * (radius + height));
    vec3 centre = cover.position - height * front;
    vec3 x = normalize(triangle.b - triangle.a);
    vec3 y = cross(front, x);
    Polygon part = as_polygon(flat_place(triangle.a - centre, x, y, disc), flat_place(triangle.b - centre, x, y, disc),
                              flat_place(triangle.c - centre, x, y, disc));
    cut_off_walls(part, cover.cuts, x, y, disc, height * front);
    float whole = kernel_over(part, left);
    float share = divide(disc, radius);
    return uint(roundEven(max(whole, 0.0) * share * share * 16777216.0));
}

// Adds the part of a triangle that belongs.
void cover_triangle(inout Cover cover, uint index)
{
    Triangle triangle = triangles[index];
    if (triangle.plane >= HIDDEN || !keeps_photons(triangle.material)) {
        return;
    }
    float radius = cover.radius;
    uint plane = 2 * triangle.plane;
    vec3 front = plane_normal(plane);
    if (HAS_TWO_SIDED) {
        plane += dot(front, cover.normal) < 0.0 && materials[triangle.material].two_sided != 0 ? 1 : 0;
    }
    vec3 side = plane_normal(plane);
    float height = plane_height(plane, cover.position);
    if (!may_cover(cover, plane, side, height, radius)) {
        return;
    }
    float left;
    uint sum = triangle_within(cover, triangle, front, height, radius, left);
    cover.sum = saturated_sum(cover.sum, sum);
    if (cover.near_radius > 0.0 && sum != 0 && may_cover(cover, plane, side, height, cover.near_radius)) {
        float near_left;
        cover.near_sum = saturated_sum(cover.near_sum, triangle_within(cover, triangle, front, height, cover.near_radius, near_left));
    }
    // A triangle that the place lies on, or within rounding of its edge, is nearer than any that it lies beside, and below it however
    // little of the disc it is.
    bool is_below = left > -1.0 / 1024.0;
    if (cover.plane == NONE && (is_below || sum != 0)) {
        float distance = abs(height) + (is_below ? 0.0 : radius);
        if (distance < cover.distance || (distance == cover.distance && plane < cover.nearest)) {
            cover.distance = distance;
            cover.nearest = plane;
        }
        cover.reach = is_below ? min(cover.reach, abs(height) + radius * (1.0 / 256.0)) : cover.reach;
    }
}

// Triangles that one estimate looks at: a mesh so dense that more lie within the radius is taken as a surface
// that goes on beyond it.
const uint MAX_COVERED = 8192;

// Looks at all triangles in reach, and says whether they were too many.
bool cover_triangles(inout Cover cover)
{
    uint seen = 0;
    uint first_triangle, leaves;
    begin_walk();
    while (next_leaves(cover.position - cover.reach, cover.position + cover.reach, first_triangle, leaves)) {
        for (; leaves != 0; leaves &= leaves - 1) {
            cover_triangle(cover, first_triangle + findLSB(leaves));
            seen++;
        }
        if (seen > MAX_COVERED && (cover.plane != NONE || cover.nearest != NONE)) {
            return true;
        }
    }
    return false;
}

Cover around(vec3 position, vec3 normal, uint plane, float radius, float near_radius, Cuts cuts)
{
    // A little wider than the sphere, for the rounding of the boxes.
    return Cover(position, normal, plane, radius, near_radius, radius * (1.0 + 1.0 / 1024.0), 0, 0, NONE, 2.0 * radius, cuts);
}

// The same of a disc without edges, up to the walls.
float disc_area(Cover cover, float radius)
{
    // A triangle around the disc.
    Polygon part = as_polygon(vec2(4.0, 0.0), vec2(-4.0, 6.0), vec2(-4.0, -6.0));
    vec3 x = to_frame(vec3(1.0, 0.0, 0.0), cover.normal), y = to_frame(vec3(0.0, 1.0, 0.0), cover.normal);
    cut_off_walls(part, cover.cuts, x, y, radius, vec3(0.0));
    float left;
    return kernel_over(part, left) * radius * radius;
}

// Integrals of the kernel over all surface that belongs to an estimate, and to one of a smaller radius, 0: none is asked for. With the
// box kernel they are areas. Both from one walk, as a device's loops may turn no more often (lavapipe counts all turns of a shader).
// Whole is set if they could not be found: then the whole disc stands for them, up to the walls.
vec2 covered_areas(vec3 position, uint plane, float radius, float near_radius, Cuts cuts, out bool whole)
{
    Cover cover = around(position, plane_normal(plane), plane, radius, near_radius, cuts);
    whole = cover_triangles(cover);
    if (whole) {
        return vec2(disc_area(cover, radius), near_radius > 0.0 ? disc_area(cover, near_radius) : 0.0);
    }
    vec2 sums = vec2(float(cover.sum), float(cover.near_sum)) * (1.0 / 16777216.0);
    return vec2(sums.x * radius * radius, sums.y * near_radius * near_radius);
}

// Plane of the surface that a receiver lies on; NONE: it lies on none.
uint plane_below(vec3 position, vec3 normal, float radius)
{
    Cover cover = around(position, normal, NONE, radius, 0.0, no_cuts(radius));
    cover_triangles(cover);
    return cover.nearest;
}
