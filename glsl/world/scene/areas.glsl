// Points on emissive areas, and directions towards them, from uniform numbers.

// Barycentric weights of the second and third corner, uniform over a triangle.
vec2 sample_triangle(vec2 u)
{
    float root = sqrt(u.x);
    return vec2(root * (1.0 - u.y), root * u.y);
}

vec3 sample_disc(vec3 centre, vec3 normal, float radius, vec2 u)
{
    vec2 sin_cos = sin_cos_turns(u.y);
    return centre + to_frame(vec3(radius * sqrt(u.x) * sin_cos.yx, 0.0), normal);
}

// Solid angle above which a triangle is sampled by direction: close by, the squared distance of a point on
// it may be next to nothing, and few points would carry nearly all of the light.
const float MIN_SPHERICAL = 0.05;

float angle_between(vec3 a, vec3 b)
{
    return atan(norm(cross(a, b)), dot(a, b));
}

// A direction within the spherical triangle of three unit vectors, evenly by solid angle, and that angle
// (Arvo 1995); 0 if it is too small to be worth it.
vec4 sample_spherical_triangle(vec3 a, vec3 b, vec3 c, vec2 u)
{
    float volume = abs(dot(a, cross(b, c)));
    float base = 1.0 + dot(a, b) + dot(b, c) + dot(c, a);
    if (2.0 * atan(volume, base) < MIN_SPHERICAL) {
        return vec4(0.0);
    }
    vec3 ab = normalize(cross(a, b)), bc = normalize(cross(b, c)), ca = normalize(cross(c, a));
    float alpha = angle_between(ab, -ca);
    float angles = alpha + angle_between(bc, -ab) + angle_between(ca, -bc);
    float excess = angles - 3.14159265358979324;
    // The arc from b to a point c' of the arc from a to c cuts off the share u.x of the area.
    float part = 3.14159265358979324 + u.x * excess;
    float turns = part * 0.15915494309189535;
    vec2 of_part = sin_cos_turns(turns - floor(turns));
    vec2 of_alpha = sin_cos_turns(alpha * 0.15915494309189535);
    float sin_phi = of_part.x * of_alpha.y - of_part.y * of_alpha.x;
    float cos_phi = of_part.y * of_alpha.y + of_part.x * of_alpha.x;
    float k1 = cos_phi + of_alpha.y;
    float k2 = sin_phi - of_alpha.x * dot(a, b);
    float divisor = (k2 * sin_phi + k1 * cos_phi) * of_alpha.x;
    float cosine = abs(divisor) > 1e-12 ? clamp(divide(k2 + (k2 * cos_phi - k1 * sin_phi) * of_alpha.y, divisor), -1.0, 1.0) : 1.0;
    vec3 towards_c = c - dot(c, a) * a;
    vec3 corner = cosine * a + sqrt(1.0 - cosine * cosine) * towards_c * inversesqrt(max(dot(towards_c, towards_c), 1e-30));
    float z = 1.0 - u.y * (1.0 - dot(corner, b));
    vec3 towards_corner = corner - dot(corner, b) * b;
    vec3 direction = z * b + sqrt(max(1.0 - z * z, 0.0)) * towards_corner * inversesqrt(max(dot(towards_corner, towards_corner), 1e-30));
    return vec4(direction, excess);
}
