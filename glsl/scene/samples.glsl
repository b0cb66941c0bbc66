// Random numbers of the paths that start at one place in a round, a pixel's or a receiver's.

// Sample `number` of `count` of a block of random numbers: points of the Sobol' sequence, shuffled and scrambled for the
// block (Burley 2020). Each is as likely anywhere, all together lie evenly, and no block knows of another, so rounds
// are as independent as by chance alone. The first two numbers lie most evenly together.
vec3 stratified(uint number, uint count, uint index, uint block, Draws draws)
{
    uvec4 words = philox(uvec4(index, draws.round, block, draws.domain), draws.seed);
    if (count > 1) {
        uint mask = (2u << findMSB(count - 1)) - 1;
        uvec4 point = sobol(owen_scramble(number, words.w) & mask);
        for (uint k = 0; k < 3; k++) {
            words[k] = owen_scramble(point[k], words[k]);
        }
    }
    return vec3(unit_float(words.x >> 8), unit_float(words.y >> 8), unit_float(words.z >> 8));
}
