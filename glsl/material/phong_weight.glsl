// The paper's Phong weight (section 4.4), fixed when the photon is stored. Twin of src/cpu/bsdf.rs.

layout(constant_id = 4) const uint PHONG_DIRECTION = PHONG_MIRROR;

#include "material/phong_lobe.glsl"

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
            float cosine = eye_distance_squared > 0.0 ? dot(to_eye, lobe) * inversesqrt(eye_distance_squared) : 0.0;
            return phong_lobe(cosine, 1.0 - cosine, wall.shininess);
        }
    }
    return 1.0;
}
