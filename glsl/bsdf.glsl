// The paper's Phong weight (section 4.4), fixed when the photon is stored. Twin of src/cpu/bsdf.rs.

layout(constant_id = 3) const bool HAS_PHONG = false;
layout(constant_id = 4) const uint PHONG_DIRECTION = PHONG_MIRROR;

// max(cosine, 0)^shininess, with 1 for shininess 0 and nothing for a direction that points away.
// Close to 1 the logarithm comes from its series, as log2 is only good to 2^-21 there.
float phong_lobe(float cosine, float shininess)
{
    if (cosine <= 0.0) {
        return 0.0;
    }
    float x = 1.0 - cosine;
    float logarithm = x < 0.03125 ? -x * (1.0 + x * (1.0 / 2.0 + x * (1.0 / 3.0 + x * (1.0 / 4.0))))
                                  : 0.69314718055994531 * log2(cosine);
    return shininess == 0.0 ? 1.0 : min(exp2(1.44269504088896341 * shininess * logarithm), 1.0);
}

// What a stored photon weighs at the eye: 1 on a Lambertian wall (shininess below 0).
float view_weight(Wall wall, vec3 position, vec3 arriving, vec3 reflected, vec3 eye)
{
    if (HAS_PHONG) {
        if (wall.shininess >= 0.0) {
            vec3 to_eye = eye - position;
            float eye_distance_squared = dot(to_eye, to_eye);
            vec3 mirrored = arriving - 2.0 * dot(arriving, wall.normal) * wall.normal;
            vec3 lobe = PHONG_DIRECTION == PHONG_SAMPLED ? reflected : mirrored;
            // Seen from the photon itself there is no direction to the eye: no weight.
            return eye_distance_squared > 0.0
                ? phong_lobe(dot(to_eye, lobe) * inversesqrt(eye_distance_squared), wall.shininess)
                : 0.0;
        }
    }
    return 1.0;
}
