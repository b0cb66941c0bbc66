// What is known of a pixel, or receiver, that some kind of light has not reached.

// For each pixel and kind of `HIT_...` the bits of the most light that one hit would have added in a
// round, where nothing has hit so far; REACHED once something has; 0 where nothing was asked. Of a map it is that times the
// squared radius, so that rounds compare. The bits of floats above 0 have the floats' order.
layout(set = 1, binding = 3, scalar) buffer SingleHits { uint single_hits[]; };

const uint REACHED = 0xffffffffu;

bool is_reached(uint pixel, uint kind)
{
    return single_hits[HIT_KINDS * pixel + kind] == REACHED;
}

void note_hit(uint pixel, uint kind)
{
    atomicMax(single_hits[HIT_KINDS * pixel + kind], REACHED);
}

void note_miss(uint pixel, uint kind, vec3 single_hit)
{
    float light = max(single_hit.x, max(single_hit.y, single_hit.z));
    if (light > 0.0) {
        // Nothing above the largest float: an infinity's bits would still be in order, and REACHED stays apart.
        atomicMax(single_hits[HIT_KINDS * pixel + kind], floatBitsToUint(min(light, uintBitsToFloat(0x7f7fffffu))));
    }
}
