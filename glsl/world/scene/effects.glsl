// What a scene and a request call for, as specialization constants: code of effects that are left out is
// no part of the pipeline. src/plan/planning.rs sets them, and src/gpu/specialize.rs takes that code away: of a condition with `&&` and
// `||` too, but not of one that a variable holds, of which only the driver knows.

// A scene of few triangles needs no tree: its list is tested from end to end.
layout(constant_id = 7) const bool HAS_BVH = true;
// Some triangle is HIDDEN.
layout(constant_id = 47) const bool HAS_OVERLAPS = true;
layout(constant_id = 8) const bool HAS_SMOOTH_NORMALS = true;
layout(constant_id = 9) const bool HAS_TEXTURES = true;
// More texels than one buffer holds.
layout(constant_id = 52) const bool HAS_MANY_TEXELS = false;
layout(constant_id = 51) const bool HAS_VERTEX_COLOURS = true;
// glTF's materials, and what each may have.
layout(constant_id = 53) const bool HAS_LAYERS = false;
layout(constant_id = 54) const bool HAS_TRANSMISSION = false;
layout(constant_id = 55) const bool HAS_COATS = false;
layout(constant_id = 56) const bool HAS_SHEEN = false;
layout(constant_id = 57) const bool HAS_NORMAL_MAPS = false;
// Textures of layers, beside those of base colour and emission.
layout(constant_id = 60) const bool HAS_LAYER_TEXTURES = false;
// Thin walls that may be smooth.
layout(constant_id = 61) const bool HAS_PANES = false;
// Surfaces that light passes straight as if nothing were there: gaps of alpha, thin smooth walls.
layout(constant_id = 58) const bool HAS_PASSING = false;
// Media that absorb, or lie in one another.
layout(constant_id = 59) const bool HAS_MEDIA = false;
// Solids whose index of refraction differs from colour to colour.
layout(constant_id = 62) const bool HAS_DISPERSION = false;
// Surfaces that scatter light evenly to their other side.
layout(constant_id = 63) const bool HAS_DIFFUSE_TRANSMISSION = false;
// Thin films.
layout(constant_id = 64) const bool HAS_IRIDESCENCE = false;
// Microfacets that are rougher along a tangent.
layout(constant_id = 65) const bool HAS_ANISOTROPY = false;
layout(constant_id = 10) const bool HAS_TWO_SIDED = true;
layout(constant_id = 11) const bool HAS_GLOSSY = true;
layout(constant_id = 12) const bool HAS_MIRROR = true;
layout(constant_id = 13) const bool HAS_DIELECTRIC = true;
layout(constant_id = 14) const bool HAS_PAPER_PHONG = true;
layout(constant_id = 15) const bool HAS_TRIANGLE_LIGHTS = true;
layout(constant_id = 16) const bool HAS_POINT_LIGHTS = true;
layout(constant_id = 17) const bool HAS_SPOT_LIGHTS = true;
layout(constant_id = 18) const bool HAS_DIRECTIONAL_LIGHTS = true;
layout(constant_id = 19) const bool HAS_DISC_LIGHTS = true;
layout(constant_id = 20) const bool HAS_ENVIRONMENT = true;
// The environment is a picture.
layout(constant_id = 70) const bool HAS_SKY_PICTURE = false;
// Visible points send rays towards lights; not where the photon maps hold direct light too.
layout(constant_id = 21) const bool HAS_SHADOW_RAYS = true;
// Camera rays may hit emitters (pictures only).
layout(constant_id = 72) const bool HAS_SEEN_LIGHT = false;
// Whether photons are also counted within a smaller radius, which gives the bias (film/differences.glsl).
layout(constant_id = 73) const bool HAS_DIFFERENCES = false;
// Whether a picture keeps the parts of each pixel's light apart (film/kept_parts.glsl).
layout(constant_id = 74) const bool HAS_PARTS = false;

// Where the sums of a sample stand among those of all: three channels of what surfaces scatter, then of what is seen straight.
uint place_of_sums(uint sample_place)
{
    uint size = 3;
    if (HAS_SEEN_LIGHT) {
        size = 6;
    }
    return size * sample_place;
}

layout(constant_id = 22) const uint KERNEL = KERNEL_BOX;
layout(constant_id = 23) const bool HAS_EDGE_CORRECTION = true;
// Photons of a caustic map of its own; without one the global map holds caustics too.
layout(constant_id = 24) const bool HAS_CAUSTIC_MAP = true;
// The global map holds direct light and caustics as well.
layout(constant_id = 25) const bool HAS_ALL_ARRIVALS = false;
layout(constant_id = 26) const uint GATHER_RAYS = GATHER_NONE;
// Parts of the picture that are asked for.
layout(constant_id = 27) const uint PARTS = 15;
layout(constant_id = 28) const uint FILTER = FILTER_BOX;
layout(constant_id = 29) const bool HAS_SPECULAR_CHAINS = true;
layout(constant_id = 40) const bool HAS_AIMED_PHOTONS = true;
// Light comes from beyond the scene, perhaps through openings.
layout(constant_id = 50) const bool HAS_OPENINGS = false;
// Radii differ from point to point.
layout(constant_id = 48) const bool HAS_RADIUS_CLASSES = false;
// A shadow ray chooses one of several clusters of lights by what they did in a trial, and not a light by its power.
layout(constant_id = 49) const bool HAS_LIGHT_CLUSTERS = false;
