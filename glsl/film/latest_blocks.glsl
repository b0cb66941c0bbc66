// What each of the latest blocks left at some places of a film. Expects film/kept_places.glsl.

layout(set = 1, binding = 4, scalar) writeonly buffer LatestBlocks { float latest_blocks[]; };

// Where a block's values of kept places begin.
uint first_of_block(uint block, uint place_count)
{
    return block % KEPT_BLOCKS * kept_count(place_count);
}

float float_of(uvec2 sum)
{
    precise float value = float(sum.y) * 4294967296.0 + float(sum.x);
    return value;
}
