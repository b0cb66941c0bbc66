// Receivers that touch walls.

// Moves a wall's part of a receiver's place: along the receiver's own plane, until it lies before the wall for certain.
vec3 off_the_wall(uint index, vec3 position, vec3 normal)
{
    Triangle triangle = triangles[index];
    float least = 2.5 * (position_error(position) + triangle_error(triangle));
    vec3 wall = triangle_normal(triangle);
    float cosine = dot(wall, normal);
    float sine_squared = (1.0 - cosine) * (1.0 + cosine);
    vec3 heights = vec3(dot(triangle.a - position, normal), dot(triangle.b - position, normal), dot(triangle.c - position, normal));
    // The receiver's own plane, and what falls off from it at an edge, hide nothing from it.
    if (sine_squared < 0.02 || max(heights.x, max(heights.y, heights.z)) <= least) {
        return position;
    }
    float before = dot(wall, position - triangle.a);
    if (HAS_TWO_SIDED && materials[triangle.material].two_sided != 0 && before < 0.0) {
        wall = -wall;
        cosine = -cosine;
        before = -before;
    }
    bool touches = before < least && before > -0.25 * least;
    return touches ? position + (wall - cosine * normal) * divide(least - before, sine_squared) : position;
}

// A receiver's place off the walls that rise where it lies. In the plane of a wall it would get nothing from that wall
// (see is_before), and its rays would pass between the two sides.
vec3 off_the_walls(vec3 position, vec3 normal)
{
    // Coordinates lie within 1.
    float reach = 2.5 * (position_error(position) + 1.0 / 1048576.0);
    uint first_triangle, leaves;
    begin_walk();
    while (next_leaves(position - reach, position + reach, first_triangle, leaves)) {
        for (; leaves != 0; leaves &= leaves - 1) {
            position = off_the_wall(first_triangle + findLSB(leaves), position, normal);
        }
    }
    return position;
}
