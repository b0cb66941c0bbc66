// Textures: their texels as they lie in memory, and values between texels. Twin of src/scene/texture.rs.

// A texture; behind those of the scene, each that a layered material looks up, for which the rest counts.
struct TextureInfo {
    uint width;
    uint height;
    uint first_texel;
    // 0 repeat, 1 mirrored, 2 clamp: of u, and of v times 4; plus 16 where the nearest texel alone counts.
    uint wrap;
    // `TEXELS_...`.
    uint encoding;
    // `LAYER_...`: what it multiplies, or says.
    uint layer;
    uint uv_set;
    // It is looked up at (dot(row_u, uv), dot(row_v, uv)) + offset.
    vec2 row_u;
    vec2 row_v;
    vec2 offset;
};

layout(set = 0, binding = 5, scalar) readonly buffer Textures { TextureInfo textures[]; };
// The linear values of 8-bit codes, then texels; more of them in the next buffers, as devices may bound the size of one.
layout(set = 0, binding = 6, scalar) readonly buffer Texels { uint texels[]; };
layout(set = 0, binding = 15, scalar) readonly buffer Texels1 { uint texels_1[]; };
layout(set = 0, binding = 16, scalar) readonly buffer Texels2 { uint texels_2[]; };
layout(set = 0, binding = 17, scalar) readonly buffer Texels3 { uint texels_3[]; };

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

vec4 texel(TextureInfo info, int i, int j)
{
    uint place = wrapped(j, info.height, (info.wrap >> 2) & 3u) * info.width + wrapped(i, info.width, info.wrap & 3u);
    if (info.encoding == TEXELS_FLOAT) {
        // 21 bits each: numbers of single precision without their signs and lowest bits.
        uint low = texel_word(info.first_texel + 2 * place), high = texel_word(info.first_texel + 2 * place + 1);
        uvec3 channels = uvec3(low, low >> 21 | high << 11, high >> 10) & 0x1fffffu;
        return vec4(uintBitsToFloat(channels << 10), 1.0);
    }
    uint word = texel_word(info.first_texel + place);
    vec4 shares = vec4(word & 255, (word >> 8) & 255, (word >> 16) & 255, word >> 24) * (1.0 / 255.0);
    if (info.encoding == TEXELS_LINEAR) {
        return shares;
    }
    return vec4(linear_of_code(word), linear_of_code(word >> 8), linear_of_code(word >> 16), shares.w);
}

// Linear colour and alpha: bilinear between texel centres, or the nearest one's. A loop, as drivers take long to compile four copies.
vec4 sample_texture(TextureInfo info, vec2 uv)
{
    vec2 place = uv * vec2(info.width, info.height) - 0.5;
    vec2 corner = floor(place);
    vec2 share = place - corner;
    if ((info.wrap & 16u) != 0) {
        share = vec2(greaterThanEqual(share, vec2(0.5)));
    }
    vec4 row = vec4(0.0), sum = vec4(0.0);
    [[dont_unroll]] for (int k = 0; k < 4; k++) {
        vec4 value = texel(info, int(corner.x) + (k & 1), int(corner.y) + (k >> 1));
        row = (k & 1) == 0 ? (1.0 - share.x) * value : row + share.x * value;
        sum = k == 1 ? (1.0 - share.y) * row : (k == 3 ? sum + share.y * row : sum);
    }
    return sum;
}
