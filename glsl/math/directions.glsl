// Unit vectors: packed in 32 bits, and as frames. Packing is octahedral (Cigolle et al. 2014): 16 bits
// a coordinate place a normal to 7e-5 radians. Twin of src/scene/geometry/mod.rs.

vec2 octahedral(vec3 v)
{
    vec2 flat_part = divide(v.xy, abs(v.x) + abs(v.y) + abs(v.z));
    vec2 signs = vec2(flat_part.x >= 0.0 ? 1.0 : -1.0, flat_part.y >= 0.0 ? 1.0 : -1.0);
    return v.z >= 0.0 ? flat_part : (1.0 - abs(flat_part.yx)) * signs;
}

vec3 from_octahedral(vec2 o)
{
    vec3 v = vec3(o, 1.0 - abs(o.x) - abs(o.y));
    vec2 signs = vec2(o.x >= 0.0 ? 1.0 : -1.0, o.y >= 0.0 ? 1.0 : -1.0);
    v.xy = v.z >= 0.0 ? v.xy : (1.0 - abs(o.yx)) * signs;
    return normalize(v);
}

// `half_range` codes on either side of 0.
uvec2 quantised(vec2 o, float half_range)
{
    return uvec2(roundEven(clamp(o, -1.0, 1.0) * half_range) + half_range);
}

uint pack_normal(vec3 n)
{
    uvec2 code = quantised(octahedral(n), 32767.0);
    return code.x | (code.y << 16);
}

vec3 unpack_normal(uint code)
{
    return from_octahedral((vec2(code & 0xffffu, code >> 16) - 32767.0) * (1.0 / 32767.0));
}

// A direction in 2 x 15 bits and a number below 4 above them.
uint pack_direction(vec3 d, uint number)
{
    uvec2 code = quantised(octahedral(d), 16383.0);
    return code.x | (code.y << 15) | (number << 30);
}

vec3 unpack_direction(uint code)
{
    return from_octahedral((vec2(code & 0x7fffu, (code >> 15) & 0x7fffu) - 16383.0) * (1.0 / 16383.0));
}

// Tangents of a unit vector (Duff et al. 2017).
vec3 to_frame(vec3 local, vec3 n)
{
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = divide(-1.0, s + n.z);
    float b = n.x * n.y * a;
    vec3 tangent = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
    vec3 bitangent = vec3(b, s + n.y * n.y * a, -n.y);
    return local.x * tangent + local.y * bitangent + local.z * n;
}
