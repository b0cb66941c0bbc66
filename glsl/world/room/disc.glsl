// Emission of a disc light flush with its wall. Twin of src/cpu/emission.rs.

// A disc of light flush with a wall.
struct DiscLight {
    vec3 centre;
    float radius;
    uint wall;
    // Relative flux of each of its photons, in (0, 1].
    float flux;
};

layout(constant_id = 2) const uint EMISSION_LAW = EMISSION_UNIFORM;

// `u`: disc radius, disc angle, cosine, azimuth.
void emit_from_disc(DiscLight light, Wall wall, vec4 u, out vec3 position, out vec3 direction)
{
    vec2 sin_cos = sin_cos_turns(u.y);
    precise float distance_from_centre = light.radius * sqrt(u.x);
    precise vec2 offset = distance_from_centre * sin_cos.yx;
    precise vec3 point = light.centre + (offset.x * wall.tangent + offset.y * wall.bitangent);
    position = point;
    vec3 local = EMISSION_LAW == EMISSION_COSINE ? sample_cosine_hemisphere(u.z, u.w)
                                                 : sample_uniform_hemisphere(u.z, u.w);
    direction = to_world(local, wall);
}
