// Random numbers of the paths that start at one place in a round, a pixel's or a receiver's.

// Samples of a block are points of the Sobol' sequence, scrambled for the place, the round and the block (Burley 2020): each
// is as likely anywhere and all together lie evenly, the first two numbers most of all. No block knows of another, so rounds
// are as independent as by chance alone.

vec4 scrambled(uint number, uvec4 words)
{
    uvec4 point = sobol(number);
    for (uint k = 0; k < 4; k++) {
        point[k] = owen_scramble(point[k], words[k]) >> 8;
    }
    return vec4(unit_float(point.x), unit_float(point.y), unit_float(point.z), unit_float(point.w));
}

// Whose bits scramble a block of a place.
uvec4 words_of(uint index, uint block, Draws draws)
{
    return philox(uvec4(index, draws.round, block, draws.domain), draws.seed);
}

// Where sample `number` of a place starts: four numbers of block 0.
vec4 stratified_start(uint number, uint index, Draws draws)
{
    return scrambled(number, words_of(index, 0, draws));
}

// Three numbers of any other block for sample `number` of `count`, shuffled, so that two blocks meet as by chance.
vec3 stratified(uint number, uint count, uvec4 words)
{
    uint mask = count > 1 ? (2u << findMSB(count - 1)) - 1 : 0;
    return scrambled(owen_scramble(number, words.w) & mask, words).xyz;
}
