// How much surface a density estimate covers.

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
// signed by the edge's direction. Says whether the edge enters the disc, and counts the edges that have the
// centre on their left.
float kernel_over_edge(vec2 from, vec2 to, inout bool enters, inout uint left_count)
{
    vec2 edge = to - from;
    float edge_length = norm(edge);
    if (edge_length == 0.0) {
        return 0.0;
    }
    vec2 along = divide(edge, edge_length);
    float h = from.x * along.y - from.y * along.x;
    float s0 = dot(from, along), s1 = dot(to, along);
    left_count += h > 0.0 ? 1 : 0;
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

// Integral of the kernel over the part of a triangle that belongs to an estimate, in units of 2^-24 of the
// squared radius: integers add up alike in whatever order the triangles come.
uint kernel_over_triangle(uint index, vec3 position, vec3 normal, float radius, float least_cosine)
{
    Triangle triangle = triangles[index];
    // No photon is ever stored on a mirror or on glass.
    uint kind = materials[triangle.material].surface;
    if (kind == SURFACE_MIRROR || kind == SURFACE_DIELECTRIC) {
        return 0;
    }
    vec3 front = triangle_normal(triangle);
    bool turned = false;
    if (HAS_TWO_SIDED) {
        turned = dot(front, normal) < 0.0 && materials[triangle.material].two_sided != 0;
    }
    vec3 side = turned ? -front : front;
    float height = dot(position - triangle.a, side);
    if (abs(height) >= radius || !belongs(normal, side, height, radius, least_cosine)) {
        return 0;
    }
    // In the triangle's own plane, in units of the disc that the sphere cuts out of it.
    float disc = sqrt((radius - height) * (radius + height));
    vec3 centre = position - height * side;
    vec3 x = normalize(triangle.b - triangle.a);
    vec3 y = cross(front, x);
    vec2 a = divide(vec2(dot(triangle.a - centre, x), dot(triangle.a - centre, y)), disc);
    vec2 b = divide(vec2(dot(triangle.b - centre, x), dot(triangle.b - centre, y)), disc);
    vec2 c = divide(vec2(dot(triangle.c - centre, x), dot(triangle.c - centre, y)), disc);
    bool enters = false;
    uint left_count = 0;
    float whole = kernel_over_edge(a, b, enters, left_count);
    whole += kernel_over_edge(b, c, enters, left_count);
    whole += kernel_over_edge(c, a, enters, left_count);
    // No edge in the disc: all of it or nothing, not the rounding of sectors that cancel.
    if (!enters) {
        whole = left_count == 3 ? 3.14159265358979324 * kernel_norm() : 0.0;
    }
    float share = divide(disc, radius);
    return uint(roundEven(max(whole, 0.0) * share * share * 16777216.0));
}

// Triangles that one estimate looks at: a mesh so dense that more lie within the radius is taken as a surface
// that goes on beyond it.
const uint MAX_COVERED = 8192;

uint saturated_sum(uint a, uint b)
{
    return a > 0xffffffffu - b ? 0xffffffffu : a + b;
}

// Integral of the kernel over all surface that belongs to an estimate: the area, with the box kernel. Whole is set
// if it could not be found: then the whole disc stands for it.
float covered_area(vec3 position, vec3 normal, float radius, float least_cosine, out bool whole)
{
    uint sum = 0;
    uint seen = 0;
    whole = false;
    if (HAS_BVH) {
        // A little wider than the sphere, for the rounding of the boxes.
        float reach = radius * (1.0 + 1.0 / 1024.0);
        // Siblings to visit: the first of them, and a bit for each in reach above the mask of those that are
        // nodes at all.
        uvec2 group = uvec2(0, 0x100u);
        uvec2 stack[BVH_STACK];
        uint depth = 0;
        for (;;) {
            uint slot = findLSB(group.y >> 8);
            group.y &= ~(0x100u << slot);
            if (group.y > 0xffu) {
                stack[depth++] = group;
            }
            uint place = group.x + bitCount(group.y & ((1u << slot) - 1u));
            BvhNode node = nodes[place];
            vec3 spacing = uintBitsToFloat((uvec3(node.spacing, node.spacing >> 8, node.spacing >> 16) & 0xffu) << 23);
            uint child_nodes = node.spacing >> 24;
            uint near_nodes = 0;
            uint near_leaves = 0;
            [[unroll]] for (uint child = 0; child < 8; child++) {
                vec3 low = vec3(byte_of(node.min_x, child), byte_of(node.min_y, child), byte_of(node.min_z, child)) * spacing + node.origin;
                vec3 high = vec3(byte_of(node.max_x, child), byte_of(node.max_y, child), byte_of(node.max_z, child)) * spacing + node.origin;
                uint meta = byte_of(node.meta, child);
                if (meta != 0 && all(lessThanEqual(low, position + reach)) && all(greaterThanEqual(high, position - reach))) {
                    bool is_node = ((child_nodes >> child) & 1u) != 0;
                    near_nodes |= is_node ? 1u << child : 0;
                    near_leaves |= is_node ? 0 : (meta >> 5) << (meta & 31u);
                }
            }
            while (near_leaves != 0) {
                sum = saturated_sum(sum, kernel_over_triangle(node.first_triangle + findLSB(near_leaves), position, normal, radius, least_cosine));
                near_leaves &= near_leaves - 1;
                seen++;
            }
            if (seen > MAX_COVERED) {
                whole = true;
                return 3.14159265358979324 * kernel_norm() * radius * radius;
            }
            group = uvec2(node.first_child, (near_nodes << 8) | child_nodes);
            if (near_nodes == 0) {
                if (depth == 0) {
                    break;
                }
                group = stack[--depth];
            }
        }
    } else {
        for (uint index = 0; index < triangles.length(); index++) {
            sum = saturated_sum(sum, kernel_over_triangle(index, position, normal, radius, least_cosine));
        }
    }
    return float(sum) * (1.0 / 16777216.0) * radius * radius;
}
