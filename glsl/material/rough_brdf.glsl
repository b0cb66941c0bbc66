// The lobes that photon maps know, as they weigh light: diffuse, sheen, and what base and coat reflect broadly.

#include "material/lobes/diffuse.glsl"
#include "material/lobes/sheen.glsl"
#include "material/lobes/reflection.glsl"
#include "material/lobes/coat.glsl"

// The BRDF of all of them together, 1/sr, from above the surface; `towards_light` are the albedos towards wi.
vec3 rough_brdf(RoughLobes lobes, RoughCover cover, RoughFilm film, LayerAlbedos towards_light, vec3 n, vec3 wo, vec3 wi)
{
    vec3 sum = diffuse_brdf(lobes, cover, towards_light) + sheen_brdf(cover, towards_light, n, wo, wi);
    sum += reflection_brdf(lobes, cover, film, towards_light, n, wo, wi);
    return sum + coat_brdf(cover, n, wo, wi);
}
