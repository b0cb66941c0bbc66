// What a ray met: position, normals, material.

// Shading normals at a triangle's corners, octahedral; all `NONE` on a flat triangle.
struct TriangleNormals {
    uint a;
    uint b;
    uint c;
};

// Texture coordinates at a triangle's corners.
struct TriangleUvs {
    vec2 base_a;
    vec2 base_b;
    vec2 base_c;
    vec2 emission_a;
    vec2 emission_b;
    vec2 emission_c;
};

// Linear colours at a triangle's corners, which multiply the material's base colour, and alphas.
struct TriangleColours {
    vec3 a;
    vec3 b;
    vec3 c;
    vec3 alphas;
};

// What layered materials need at a triangle's corners: texture coordinates of the mesh's first and second set; tangents, octahedral, for
// normal map and anisotropy, and for the normal map of the coat. Bits 0 and 3 of `turned`: their bitangents are -(normal x tangent).
struct TriangleLayers {
    vec2 first_a;
    vec2 first_b;
    vec2 first_c;
    vec2 second_a;
    vec2 second_b;
    vec2 second_c;
    uint tangent_a;
    uint tangent_b;
    uint tangent_c;
    uint coat_tangent_a;
    uint coat_tangent_b;
    uint coat_tangent_c;
    uint turned;
};

// What a layered material adds to its `SurfaceMaterial`.
struct LayeredMaterial {
    float metallic;
    float roughness;
    float ior;
    float specular;
    vec3 specular_colour;
    float transmission;
    // It encloses a medium; else it is a thin wall.
    uint is_solid;
    // Number of its medium, from 1; 0: it is no solid, or media do not matter.
    uint medium;
    // Of the medium whose number is this record's place plus 1, for each unit of length.
    vec3 medium_absorption;
    float medium_ior;
    // Half of what lies between the indices for red and for blue, of its solid, and of that medium.
    float ior_spread;
    float medium_spread;
    // Of a thin film: how much of it is there, its index, its thickness, nanometres, from where a texture is 0 to where it is 1, and the
    // least F0 with which Schlick's formula is above all that it reflects.
    float iridescence;
    float film_ior;
    float film_least;
    float film_most;
    float film_bound;
    // Share of what enters it that is scattered evenly beyond, and its colour.
    float diffuse_transmission;
    vec3 diffuse_transmission_colour;
    // How much rougher the base is along a direction: 0 to 1, and cosine and sine of what turns the direction from the tangent.
    float anisotropy;
    vec2 anisotropy_turn;
    float coat;
    float coat_roughness;
    vec3 sheen_colour;
    float sheen_roughness;
    float normal_scale;
    float coat_normal_scale;
    // `COVERAGE_...`.
    uint coverage;
    float alpha;
    float cutoff;
    uint is_unlit;
    // Somewhere it has a lobe that photon maps know. Density estimates beside such a place count photons elsewhere, too.
    uint is_rough;
    // Its lookups, among the records of textures.
    uint first_lookup;
    uint end_lookup;
};

struct SurfaceMaterial {
    vec3 base_colour;
    // `SURFACE_...`.
    uint surface;
    // Radiance of the front, W/m2/sr.
    vec3 emission;
    // Exponent or index of refraction.
    float parameter;
    uint base_texture;
    uint emission_texture;
    uint two_sided;
};

layout(set = 0, binding = 2, scalar) readonly buffer Normals { TriangleNormals normals[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Uvs { TriangleUvs uvs[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Materials { SurfaceMaterial materials[]; };
// One for all triangles where no mesh has any.
layout(set = 0, binding = 14, scalar) readonly buffer VertexColours { TriangleColours vertex_colours[]; };
// One for all triangles where no layered material has a texture of its own, or a normal map.
layout(set = 0, binding = 18, scalar) readonly buffer LayersOfTriangles { TriangleLayers triangle_layers[]; };
// One for each material.
layout(set = 0, binding = 19, scalar) readonly buffer LayeredMaterials { LayeredMaterial layered_materials[]; };

#include "material/layers.glsl"
#include "material/textures.glsl"

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

// The value of the emission's texture, or 1.
vec3 emission_texel(SurfaceMaterial material, uint index, float u, float v)
{
    if (HAS_TEXTURES && material.emission_texture != NONE) {
        TriangleUvs at = uvs[index];
        return sample_texture(textures[material.emission_texture], mixed_uv(at.emission_a, at.emission_b, at.emission_c, u, v)).rgb;
    }
    return vec3(1.0);
}

// The value of the base colour's texture, or 1.
vec4 base_texel(SurfaceMaterial material, uint index, float u, float v)
{
    if (HAS_TEXTURES && material.base_texture != NONE) {
        TriangleUvs at = uvs[index];
        return sample_texture(textures[material.base_texture], mixed_uv(at.base_a, at.base_b, at.base_c, u, v));
    }
    return vec4(1.0);
}

float vertex_alpha_at(uint index, float u, float v)
{
    if (HAS_VERTEX_COLOURS) {
        TriangleColours at = vertex_colours[min(index, uint(vertex_colours.length()) - 1)];
        return at.alphas.x + u * (at.alphas.y - at.alphas.x) + v * (at.alphas.z - at.alphas.x);
    }
    return 1.0;
}

// How much of a layered surface is there; `alpha` is its texture's.
float coverage_by(uint index, float alpha, float u, float v)
{
    LayeredMaterial layered = layered_materials[triangles[index].material];
    if (layered.coverage == COVERAGE_WHOLE) {
        return 1.0;
    }
    alpha *= layered.alpha * vertex_alpha_at(index, u, v);
    return layered.coverage == COVERAGE_MASK ? (alpha >= layered.cutoff ? 1.0 : 0.0) : clamp(alpha, 0.0, 1.0);
}

float coverage_of(SurfaceMaterial material, uint index, float u, float v)
{
    return coverage_by(index, base_texel(material, index, u, v).a, u, v);
}

// The share of a lamp's light at one of its points: of its texture, and of alpha.
vec3 lamp_share(SurfaceMaterial material, uint index, float u, float v)
{
    vec3 share = emission_texel(material, index, u, v);
    if (HAS_PASSING && material.surface == SURFACE_LAYERED) {
        share *= coverage_of(material, index, u, v);
    }
    return share;
}

TriangleLayers layers_of_triangle(uint index)
{
    return triangle_layers[min(index, uint(triangle_layers.length()) - 1)];
}

// Tangents of the corners, and whether bitangents are -(normal x tangent).
struct CornerTangents {
    uvec3 packed;
    bool is_turned;
};

// Tangent, bitangent and normal of the front, from the unit normal n of either side.
mat3 tangent_frame(CornerTangents at, vec3 n, bool front, float u, float v)
{
    vec3 normal = front ? n : -n;
    vec3 tangent = (1.0 - u - v) * unpack_normal(at.packed.x) + u * unpack_normal(at.packed.y) + v * unpack_normal(at.packed.z);
    return mat3(tangent, at.is_turned ? cross(tangent, normal) : cross(normal, tangent), normal);
}

// A normal map's normal about the unit normal n on the side of wo.
vec3 mapped_normal(vec3 texel, float scale, vec3 n, CornerTangents tangents, float u, float v, vec3 wo, bool front)
{
    vec3 code = 2.0 * texel - 1.0;
    mat3 frame = tangent_frame(tangents, n, front, u, v);
    vec3 tangent = frame[0], bitangent = frame[1], normal = frame[2];
    vec3 way = scale * code.x * tangent + scale * code.y * bitangent + code.z * normal;
    float squared = dot(way, way);
    vec3 mapped = squared > 0.0 ? way * inversesqrt(squared) : normal;
    mapped = front ? mapped : -mapped;
    // Towards the eye, where it would look away.
    float cosine = dot(mapped, wo);
    return cosine < LEAST_MAPPED_COSINE ? normalize(mapped + (LEAST_MAPPED_COSINE - cosine) * wo) : mapped;
}

// What a material's textures say, by layer: 1 where it has none. Returns a bit for each that it has. A loop, as in sample_texture().
uint look_up_layers(LayeredMaterial material, Hit hit, out vec4 values[LAYER_COUNT])
{
    uint found = 0;
    for (uint layer = 0; layer < LAYER_COUNT; layer++) {
        values[layer] = vec4(1.0);
    }
    if (HAS_LAYER_TEXTURES) {
        TriangleLayers at = layers_of_triangle(hit.triangle);
        vec2 first = mixed_uv(at.first_a, at.first_b, at.first_c, hit.u, hit.v);
        vec2 second = mixed_uv(at.second_a, at.second_b, at.second_c, hit.u, hit.v);
        [[dont_unroll]] for (uint k = material.first_lookup; k < material.end_lookup; k++) {
            TextureInfo lookup = textures[k];
            vec2 uv = lookup.uv_set == 0 ? first : second;
            values[lookup.layer] = sample_texture(lookup, vec2(dot(lookup.row_u, uv), dot(lookup.row_v, uv)) + lookup.offset);
            found |= 1u << lookup.layer;
        }
    }
    return found;
}

CornerTangents base_tangents(TriangleLayers at)
{
    return CornerTangents(uvec3(at.tangent_a, at.tangent_b, at.tangent_c), (at.turned & 1u) != 0);
}

// Anisotropy: `texel` has the direction of its stretch in the frame of tangent and bitangent, and its strength. A line of facets has a
// width, as it is no delta.
void stretch_facets(inout Layers layers, LayeredMaterial material, vec3 texel, mat3 frame, vec3 ns)
{
    vec2 code = 2.0 * texel.rg - 1.0, turn = material.anisotropy_turn;
    vec3 way = (turn.x * code.x - turn.y * code.y) * frame[0] + (turn.y * code.x + turn.x * code.y) * frame[1];
    way -= dot(way, ns) * ns;
    float strength = material.anisotropy * texel.b, squared = dot(way, way);
    layers.is_stretched = true;
    layers.alpha = max(layers.alpha, DELTA_ALPHA);
    layers.alpha_along = layers.alpha + strength * strength * (1.0 - layers.alpha);
    layers.tangent = squared > 1e-12 ? way * inversesqrt(squared) : to_frame(vec3(1.0, 0.0, 0.0), ns);
}

// Layers and shading normal of a layered surface, whose other fields are known; `alpha` is that of its base colour's texture.
void add_layers(inout Surface surface, Hit hit, uint material_index, vec3 wo, float alpha)
{
    LayeredMaterial material = layered_materials[material_index];
    vec4 values[LAYER_COUNT];
    uint found = look_up_layers(material, hit, values);
    Layers layers;
    layers.metallic = material.metallic * values[LAYER_METALLIC_ROUGHNESS].b;
    float roughness = material.roughness * values[LAYER_METALLIC_ROUGHNESS].g;
    layers.alpha = roughness * roughness;
    layers.is_stretched = false;
    layers.alpha_along = layers.alpha;
    layers.tangent = vec3(0.0);
    layers.ior = material.ior;
    layers.ior_spread = 0.0;
    layers.specular = material.specular * values[LAYER_SPECULAR].a;
    layers.specular_colour = material.specular_colour * values[LAYER_SPECULAR_COLOUR].rgb;
    layers.transmission = 0.0;
    layers.is_solid = false;
    layers.medium = material.medium;
    if (HAS_TRANSMISSION) {
        layers.transmission = material.transmission * values[LAYER_TRANSMISSION].r;
        layers.is_solid = material.is_solid != 0;
    }
    if (HAS_DISPERSION) {
        layers.ior_spread = material.ior_spread;
    }
    layers.diffuse_transmission = 0.0;
    layers.diffuse_transmission_colour = vec3(0.0);
    if (HAS_DIFFUSE_TRANSMISSION) {
        layers.diffuse_transmission = material.diffuse_transmission * values[LAYER_DIFFUSE_TRANSMISSION].a;
        layers.diffuse_transmission_colour = material.diffuse_transmission_colour * values[LAYER_DIFFUSE_TRANSMISSION_COLOUR].rgb;
        layers.is_solid = material.is_solid != 0;
    }
    layers.iridescence = 0.0;
    layers.film_ior = 1.0;
    layers.film_thickness = 0.0;
    layers.film_bound = 0.0;
    if (HAS_IRIDESCENCE) {
        layers.iridescence = material.iridescence * values[LAYER_IRIDESCENCE].r;
        layers.film_ior = material.film_ior;
        layers.film_thickness = material.film_least + (material.film_most - material.film_least) * values[LAYER_IRIDESCENCE_THICKNESS].g;
        layers.film_bound = material.film_bound;
    }
    layers.coat = 0.0;
    layers.coat_alpha = 1.0;
    layers.coat_normal = surface.ns;
    if (HAS_COATS) {
        layers.coat = material.coat * values[LAYER_COAT].r;
        float coat_roughness = material.coat_roughness * values[LAYER_COAT_ROUGHNESS].g;
        layers.coat_alpha = coat_roughness * coat_roughness;
    }
    layers.sheen = vec3(0.0);
    layers.sheen_alpha = 1.0;
    if (HAS_SHEEN) {
        layers.sheen = material.sheen_colour * values[LAYER_SHEEN_COLOUR].rgb;
        float sheen_roughness = material.sheen_roughness * values[LAYER_SHEEN_ROUGHNESS].a;
        layers.sheen_alpha = max(sheen_roughness * sheen_roughness, LEAST_SHEEN_ALPHA);
    }
    layers.coverage = 1.0;
    if (HAS_PASSING) {
        layers.coverage = coverage_by(hit.triangle, alpha, hit.u, hit.v);
    }
    layers.is_unlit = material.is_unlit != 0;
    vec3 smooth_ns = surface.ns;
    if (HAS_NORMAL_MAPS) {
        TriangleLayers at = layers_of_triangle(hit.triangle);
        if ((found & (1u << LAYER_NORMAL)) != 0) {
            surface.ns = mapped_normal(values[LAYER_NORMAL].rgb, material.normal_scale, smooth_ns, base_tangents(at), hit.u, hit.v, wo, surface.front);
        }
        if ((found & (1u << LAYER_COAT_NORMAL)) != 0) {
            CornerTangents tangents = CornerTangents(uvec3(at.coat_tangent_a, at.coat_tangent_b, at.coat_tangent_c), (at.turned & 8u) != 0);
            layers.coat_normal = mapped_normal(values[LAYER_COAT_NORMAL].rgb, material.coat_normal_scale, smooth_ns, tangents, hit.u, hit.v, wo,
                                               surface.front);
        }
    }
    if (HAS_ANISOTROPY && material.anisotropy > 0.0) {
        vec3 texel = (found & (1u << LAYER_ANISOTROPY)) != 0 ? values[LAYER_ANISOTROPY].rgb : vec3(1.0, 0.5, 1.0);
        mat3 frame = tangent_frame(base_tangents(layers_of_triangle(hit.triangle)), smooth_ns, surface.front, hit.u, hit.v);
        stretch_facets(layers, material, texel, frame, surface.ns);
    }
    surface.layers = layers;
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
    vec4 base = base_texel(material, hit.triangle, hit.u, hit.v);
    surface.base_colour = material.base_colour * base.rgb;
    if (HAS_VERTEX_COLOURS) {
        TriangleColours at = vertex_colours[min(hit.triangle, uint(vertex_colours.length()) - 1)];
        // Exactly 1 where all three are.
        surface.base_colour *= at.a + hit.u * (at.b - at.a) + hit.v * (at.c - at.a);
    }
    surface.emission = shown ? material.emission * emission_texel(material, hit.triangle, hit.u, hit.v) : vec3(0.0);
    if (HAS_LAYERS && surface.kind == SURFACE_LAYERED) {
        add_layers(surface, hit, triangle.material, wo, base.a);
    }
    return surface;
}

#include "material/media.glsl"

// Whether all light passes a material as if it were not there, such as that of sheets for points in the air (src/scene/sensors.rs).
bool is_not_there(uint material)
{
    if (HAS_PASSING) {
        LayeredMaterial layered = layered_materials[material];
        return materials[material].surface == SURFACE_LAYERED && layered.coverage == COVERAGE_BLEND && layered.alpha == 0.0;
    }
    return false;
}

// Whether photons are stored on a material, and so whether its area is what they are counted over: both ask here. Light leaves mirrors
// and glass in single directions, so that no density can give it.
bool keeps_photons(uint material)
{
    uint kind = materials[material].surface;
    if (HAS_LAYERS && kind == SURFACE_LAYERED) {
        return layered_materials[material].is_rough != 0;
    }
    return kind != SURFACE_MIRROR && kind != SURFACE_DIELECTRIC;
}

bool is_specular(Surface surface)
{
    return surface.kind == SURFACE_MIRROR || surface.kind == SURFACE_DIELECTRIC;
}
