// Twin of phong_lobe in src/cpu/bsdf.rs.

// max(cosine, 0)^exponent, with 1 for exponent 0 and nothing for a direction that points away; drop = 1 - cosine.
// Close to 1 the logarithm comes from the drop by its series, as log2 is only good to 2^-21 there.
float phong_lobe(float cosine, float drop, float exponent)
{
    if (cosine <= 0.0) {
        return 0.0;
    }
    float logarithm = drop < 0.03125 ? -drop * (1.0 + drop * (1.0 / 2.0 + drop * (1.0 / 3.0 + drop * (1.0 / 4.0))))
                                     : 0.69314718055994531 * log2(cosine);
    return exponent == 0.0 ? 1.0 : min(exp2(1.44269504088896341 * exponent * logarithm), 1.0);
}
