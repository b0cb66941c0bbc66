// A photon as it leaves a disc light of the box; how it leaves the disc is in world/room/disc.glsl.

layout(set = 0, binding = 2, scalar) readonly buffer Lights { DiscLight lights[]; };
layout(set = 1, binding = 0, scalar) readonly buffer StreamSeeds { uvec2 stream_seeds[]; };

PhotonState leave_light(uint index, PhotonRange range)
{
    uint photon = range.first_photon + index;
    DiscLight light = lights[range.light];
    uvec2 start = uvec2(range.first_sample + index, range.light);
    if (RNG == RNG_RAND48) {
        start = affine48(stream_seeds[index], range.jump_multiplier, range.jump_increment);
    }
    uvec2 stream = open_stream(push.key, photon, start);
    vec4 u = draw_emission(push.key, photon, stream);
    vec3 position;
    vec3 direction;
    emit_from_disc(light, walls[light.wall], u, position, direction);
    note_unless(is_finite(position) && is_finite(direction) && is_finite(light.flux), NONFINITE_PHOTON, DOMAIN_PHOTONS, push.key.round, photon);
    return PhotonState(position, light.wall, direction, photon, stream, light.flux);
}
