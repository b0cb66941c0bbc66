// A photon as it leaves the lights of a scene (world/scene/lights.glsl), aimed where that pays (world/scene/aim.glsl).

PhotonState leave_light(uint photon, Draws draws, PhotonEmission emission)
{
    vec4 u = philox_floats(uvec4(photon, draws.round, 0, draws.domain), draws.seed);
    vec4 w = philox_floats(uvec4(photon, draws.round, 1, draws.domain), draws.seed);
    Emitter light = emitters[pick_emitter(emission.emitter_count, u.x)];
    Emission emitted = sample_emission(light, emission.scene_radius, u, w);
    if (HAS_AIMED_PHOTONS && emission.target_count != 0) {
        if (emitted.is_far) {
            aim_far(emitted, emission.scene_radius, emission.target_count, vec3(w.z, u.yz));
        } else {
            aim_near(emitted, light, emission.target_count, w.zxy);
        }
        emitted.flux *= emission.flux_gain;
    }
    if (HAS_OPENINGS && emission.through_openings != 0) {
        if (emitted.is_far) {
            aim_at_openings(emitted, emission.scene_radius, vec3(w.z, u.yz));
        }
        emitted.flux *= emission.flux_gain;
    }
    note_unless(is_finite(emitted.position) && is_finite(emitted.direction) && is_finite(emitted.flux), NONFINITE_PHOTON, draws.domain,
                draws.round, photon);
    uint media = 0;
    if (HAS_MEDIA && !emitted.is_far) {
        media = media_at(emitted.position, emitted.direction);
    }
    return PhotonState(emitted.position, photon, emitted.direction, ARRIVED_DIRECT, emitted.flux, media);
}
