// Random numbers of the paths that start at one place, a pixel's or a receiver's.

// Samples are points of the Sobol' sequence, scrambled for the place, the block of rounds and the vertex (Burley 2020): each is as
// likely anywhere, and those of all rounds of a block together lie evenly, the first two numbers most of all. Nothing of a block
// depends on another, so blocks are as independent as by chance alone.

vec4 scrambled(uint number, uvec4 words)
{
    uvec4 point = sobol(number);
    for (uint k = 0; k < 4; k++) {
        point[k] = owen_scramble(point[k], words[k]) >> 8;
    }
    return vec4(unit_float(point.x), unit_float(point.y), unit_float(point.z), unit_float(point.w));
}

// The number of a sample among those of all rounds of its block, of which each has `count`.
uint number_in_block(uint number, uint count, Draws draws)
{
    return draws.round % work.rounds_per_block * count + number;
}

// Whose bits scramble the samples of a place for a vertex, in all rounds of a block.
uvec4 words_of(uint index, uint vertex, Draws draws)
{
    return philox(uvec4(index, draws.round / work.rounds_per_block, vertex, draws.domain), draws.seed);
}

// Where sample `number` of a place starts: four numbers of vertex 0.
vec4 stratified_start(uint number, uint index, Draws draws)
{
    return scrambled(number_in_block(number, own.count, draws), words_of(index, 0, draws));
}

// Three numbers for sample `number` of `count`, shuffled, so that two vertices meet as by chance.
vec3 stratified(uint number, uint count, uvec4 words)
{
    uint mask = count > 1 ? (2u << findMSB(count - 1)) - 1 : 0;
    return scrambled(owen_scramble(number, words.w) & mask, words).xyz;
}

// The same at a vertex of sample `number` of a place.
vec3 stratified_at(uint number, uint index, uint vertex, Draws draws)
{
    return stratified(number_in_block(number, own.count, draws), own.count * work.rounds_per_block, words_of(index, vertex, draws));
}
