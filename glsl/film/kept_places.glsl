// Places of a film of which more is kept: what parts of light a block brings them, and what each of the latest blocks left. How far
// the errors of places go together, and which part of light they sit in, follows from it (src/engine/error/degrees_of_freedom.rs). Twin of
// src/plan/latest_blocks.rs.

// One of so many places is kept.
uint kept_step(uint place_count)
{
    return (place_count + KEPT_PLACES - 1) / KEPT_PLACES;
}

uint kept_count(uint place_count)
{
    uint step = kept_step(place_count);
    return (place_count + step - 1) / step;
}

// The number of a place among those that are kept, which lie at random; NONE: it is not kept.
uint kept_number(uint place, uint place_count)
{
    uint step = kept_step(place_count);
    uint number = place / step;
    return place == number * step + mix32(number) % step ? number : NONE;
}
