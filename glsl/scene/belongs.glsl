// What belongs to a density estimate, and how much it weighs.

// Least cosine between normals: 41 degrees take in the facets of a curved surface, no box's corner.
const float MIN_NORMAL_COSINE = 0.75;

// Whether a plane through a point at signed distance `height` from the middle of an estimate, with normal
// `other`, may carry photons that count. On a smooth surface distance grows with the angle between the
// normals; a parallel plane further off is another surface (a thin wall's other side, a shelf below).
bool belongs(vec3 normal, vec3 other, float height, float radius, float least_cosine)
{
    float cosine = dot(normal, other);
    float sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    return cosine >= least_cosine && abs(height) <= radius * (sine + 1.0 / 1024.0);
}

// The same of equal normals, whose angle is 0.
bool belongs_to_plane(float height, float radius)
{
    return abs(height) <= radius * (1.0 / 1024.0);
}

// Weight of a photon at the squared share `s` of the radius.
float kernel_weight(float s)
{
    if (KERNEL == KERNEL_BOX) {
        return 1.0;
    }
    if (KERNEL == KERNEL_CONE) {
        return 1.0 - sqrt(s);
    }
    return 1.0 - s;
}
