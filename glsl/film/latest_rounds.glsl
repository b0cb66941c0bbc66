// What each of the latest rounds left at some places of a film: how far the errors of places go together follows from it
// (src/engine/degrees_of_freedom.rs). Twin of src/plan/latest_rounds.rs.
layout(set = 1, binding = 4, scalar) writeonly buffer LatestRounds { float latest_rounds[]; };

// One of so many places is kept.
uint kept_step(uint place_count)
{
    return (place_count + KEPT_PLACES - 1) / KEPT_PLACES;
}

// The number of a place among those that are kept, which lie at random; NONE: it is not kept.
uint kept_number(uint place, uint place_count)
{
    uint step = kept_step(place_count);
    uint number = place / step;
    return place == number * step + mix32(number) % step ? number : NONE;
}

// Where a round's values of kept places begin.
uint first_of_round(uint round, uint place_count)
{
    uint step = kept_step(place_count);
    return round % KEPT_ROUNDS * ((place_count + step - 1) / step);
}

float float_of(uvec2 sum)
{
    precise float value = float(sum.y) * 4294967296.0 + float(sum.x);
    return value;
}
