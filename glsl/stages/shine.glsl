// A photon as it leaves the lights of a scene.

LightPath shine(uint photon, Draws draws, PhotonEmission emission)
{
    vec4 u = philox_floats(uvec4(photon, draws.round, 0, draws.domain), draws.seed);
    vec4 w = philox_floats(uvec4(photon, draws.round, 1, draws.domain), draws.seed);
    Emission emitted = sample_emission(emission.emitter_count, emission.scene_radius, u, w);
    note_unless(is_finite(emitted.position) && is_finite(emitted.direction) && is_finite(emitted.flux), ODD_PHOTON, draws.domain,
                draws.round, photon);
    return LightPath(emitted.position, photon, emitted.direction, ARRIVED_DIRECT, emitted.flux);
}
