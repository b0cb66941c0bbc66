// What a ray met: position, normals, material.

layout(set = 0, binding = 2, scalar) readonly buffer Normals { TriangleNormals normals[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Uvs { TriangleUvs uvs[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Materials { SurfaceMaterial materials[]; };
layout(set = 0, binding = 5, scalar) readonly buffer Textures { TextureInfo textures[]; };
// The linear values of 8-bit codes, then texels; more of them in the next buffers, as devices may bound the size of one.
layout(set = 0, binding = 6, scalar) readonly buffer Texels { uint texels[]; };
layout(set = 0, binding = 15, scalar) readonly buffer Texels1 { uint texels_1[]; };
layout(set = 0, binding = 16, scalar) readonly buffer Texels2 { uint texels_2[]; };
layout(set = 0, binding = 17, scalar) readonly buffer Texels3 { uint texels_3[]; };
// One for all triangles where no mesh has any.
layout(set = 0, binding = 14, scalar) readonly buffer Colours { TriangleColours colours[]; };

struct Surface {
    vec3 position;
    float error; // bound of each coordinate's
    uint plane; // twice its number, plus 1 on the back
    vec3 ng; // geometric normal on the side of wo
    vec3 ns; // shading normal on the same side
    bool front;
    bool scatters;
    uint kind;
    float parameter;
    vec3 base_colour;
    vec3 emission; // radiance towards wo
};

uint wrapped(int place, uint size, uint wrap)
{
    int extent = int(size);
    if (wrap == 2) {
        return uint(clamp(place, 0, extent - 1));
    }
    int period = wrap == 1 ? 2 * extent : extent;
    int folded = place - period * int(floor(divide(float(place), float(period))));
    folded = folded < 0 ? folded + period : (folded >= period ? folded - period : folded);
    return uint(folded < extent ? folded : period - 1 - folded);
}

uint texel_word(uint place)
{
    if (HAS_MANY_TEXELS) {
        uint part = place / TEXELS_PER_BUFFER, within = place % TEXELS_PER_BUFFER;
        return part == 0 ? texels[within] : (part == 1 ? texels_1[within] : (part == 2 ? texels_2[within] : texels_3[within]));
    }
    return texels[place];
}

float linear_of_code(uint code)
{
    return uintBitsToFloat(texels[code & 255]);
}

// Twin of src/scene/texture.rs.
vec3 texel(TextureInfo info, int i, int j)
{
    uint place = wrapped(j, info.height, info.wrap >> 2) * info.width + wrapped(i, info.width, info.wrap & 3u);
    uint word = texel_word(info.first_texel + place);
    if (info.shares_exponent != 0) {
        // A power of two: 2^(exponent - 24).
        float unit = uintBitsToFloat(((word >> 27) + (127 - 24)) << 23);
        return vec3(word & 511, (word >> 9) & 511, (word >> 18) & 511) * unit;
    }
    return vec3(linear_of_code(word), linear_of_code(word >> 8), linear_of_code(word >> 16));
}

// Bilinear between texel centres.
vec3 sample_texture(uint texture_index, vec2 uv)
{
    TextureInfo info = textures[texture_index];
    vec2 place = uv * vec2(info.width, info.height) - 0.5;
    vec2 corner = floor(place);
    vec2 share = place - corner;
    int i = int(corner.x), j = int(corner.y);
    vec3 lower = (1.0 - share.x) * texel(info, i, j) + share.x * texel(info, i + 1, j);
    vec3 upper = (1.0 - share.x) * texel(info, i, j + 1) + share.x * texel(info, i + 1, j + 1);
    return (1.0 - share.y) * lower + share.y * upper;
}

vec2 mixed_uv(vec2 a, vec2 b, vec2 c, float u, float v)
{
    return (1.0 - u - v) * a + u * b + v * c;
}

vec3 triangle_normal(Triangle triangle)
{
    return normalize(cross(triangle.b - triangle.a, triangle.c - triangle.a));
}

vec3 triangle_point(Triangle triangle, float u, float v)
{
    precise vec3 point = (1.0 - u - v) * triangle.a + u * triangle.b + v * triangle.c;
    return point;
}

// The weights of the second and third corner at a point of a triangle.
vec2 triangle_weights(Triangle triangle, vec3 point)
{
    vec3 ab = triangle.b - triangle.a, ac = triangle.c - triangle.a, ap = point - triangle.a;
    vec3 perpendicular = cross(ab, ac);
    return divide(vec2(dot(cross(ap, ac), perpendicular), dot(cross(ab, ap), perpendicular)), dot(perpendicular, perpendicular));
}

// Barycentric weights of the second and third corner, moved into the triangle until the point is off its edges by
// its own error: what starts there starts on the right side of the wall beyond the edge.
vec2 off_the_edges(Triangle triangle, vec2 weights, float error)
{
    vec3 ab = triangle.b - triangle.a, ac = triangle.c - triangle.a, bc = triangle.c - triangle.b;
    vec3 perpendicular = cross(ab, ac);
    vec3 all_weights = vec3(1.0 - weights.x - weights.y, weights);
    // Distance from the edge opposite a corner = its weight * |perpendicular| / edge.
    float area_squared = dot(perpendicular, perpendicular);
    vec3 edges_squared = vec3(dot(bc, bc), dot(ac, ac), dot(ab, ab));
    vec3 least_squared = error * error * edges_squared;
    if (all(greaterThanEqual(all_weights, vec3(0.0))) && all(greaterThanEqual(all_weights * all_weights * area_squared, least_squared))) {
        return weights;
    }
    vec3 least = divide(least_squared, area_squared);
    all_weights = max(all_weights, min(vec3(sqrt(least.x), sqrt(least.y), sqrt(least.z)), vec3(0.25)));
    return divide(all_weights.yz, all_weights.x + all_weights.y + all_weights.z);
}

// Radiance that leaves a triangle's shining side.
vec3 emitted_radiance(SurfaceMaterial material, uint index, float u, float v)
{
    vec3 emission = material.emission;
    if (HAS_TEXTURES) {
        if (material.emission_texture != NONE) {
            TriangleUvs at = uvs[index];
            emission *= sample_texture(material.emission_texture, mixed_uv(at.emission_a, at.emission_b, at.emission_c, u, v));
        }
    }
    return emission;
}

Surface surface_at(Hit hit, vec3 wo)
{
    Triangle triangle = triangles[hit.triangle];
    SurfaceMaterial material = materials[triangle.material];
    Surface surface;
    surface.error = triangle_error(triangle);
    vec2 inside = off_the_edges(triangle, vec2(hit.u, hit.v), surface.error);
    surface.position = triangle_point(triangle, inside.x, inside.y);
    vec3 normal = triangle_normal(triangle);
    surface.front = dot(normal, wo) >= 0.0;
    surface.ng = surface.front ? normal : -normal;
    surface.plane = 2 * (triangle.plane & ~HIDDEN) + (surface.front ? 0 : 1);
    surface.ns = surface.ng;
    if (HAS_SMOOTH_NORMALS) {
        TriangleNormals at = normals[hit.triangle];
        if (at.a != NONE) {
            vec3 smooth_normal = normalize((1.0 - hit.u - hit.v) * unpack_normal(at.a) + hit.u * unpack_normal(at.b) + hit.v * unpack_normal(at.c));
            smooth_normal = dot(smooth_normal, surface.ng) < 0.0 ? -smooth_normal : smooth_normal;
            // Seen from below its shading normal, a surface is what its triangles are.
            surface.ns = dot(smooth_normal, wo) > 0.0 ? smooth_normal : surface.ng;
        }
    }
    surface.kind = material.surface;
    surface.parameter = material.parameter;
    bool shown = surface.front;
    if (HAS_TWO_SIDED) {
        shown = shown || material.two_sided != 0;
    }
    surface.scatters = shown || surface.kind == SURFACE_DIELECTRIC;
    surface.base_colour = material.base_colour;
    if (HAS_TEXTURES) {
        if (material.base_texture != NONE) {
            TriangleUvs at = uvs[hit.triangle];
            surface.base_colour *= sample_texture(material.base_texture, mixed_uv(at.base_a, at.base_b, at.base_c, hit.u, hit.v));
        }
    }
    if (HAS_VERTEX_COLOURS) {
        TriangleColours at = colours[min(hit.triangle, uint(colours.length()) - 1)];
        // Exactly 1 where all three are.
        surface.base_colour *= at.a + hit.u * (at.b - at.a) + hit.v * (at.c - at.a);
    }
    surface.emission = shown ? emitted_radiance(material, hit.triangle, hit.u, hit.v) : vec3(0.0);
    return surface;
}

bool is_specular(Surface surface)
{
    return surface.kind == SURFACE_MIRROR || surface.kind == SURFACE_DIELECTRIC;
}
