// Where walls cut the disc of a density estimate off: photons behind them do not count, and the area behind them is none of the
// estimate's. Of each wall, the line through its nearest place, at a right angle to the way there: all of the wall lies beyond it, as a
// part of a wall is convex. kernels/disc_cuts.comp finds them, and gather/disc_cuts.glsl gives those of a visible point.

const uint CUT_LINES = 3;
// Of a line: bits of its distance, in units of the reach, and above them those of its direction along the surface.
const uint CUT_DISTANCE_BITS = 14;
const float CUT_DISTANCES = float((1u << CUT_DISTANCE_BITS) - 1u);
const float CUT_DIRECTIONS = float((1u << (32 - CUT_DISTANCE_BITS)) - 1u);
// What packing may turn a direction by, with some rounding: lines are drawn in by as much.
const float CUT_ANGLE_ERROR = 1.0 / 32768.0;

struct Cuts {
    // Nothing farther off counts.
    float reach;
    // What counts has at most the product w with xyz, a unit vector along the surface.
    vec4 lines[CUT_LINES];
};

// Cuts nothing off.
const vec4 NO_LINE = vec4(0.0, 0.0, 0.0, 1e30);

Cuts no_cuts(float reach)
{
    return Cuts(reach, vec4[](NO_LINE, NO_LINE, NO_LINE));
}

// A line at `distance` in `direction`, a unit vector of the surface's frame; 0 to 4 are the four corners of the square that stands for
// the circle of directions.
uint pack_cut(vec2 direction, float distance, float reach)
{
    float x = divide(direction.x, abs(direction.x) + abs(direction.y));
    float turn = direction.y >= 0.0 ? 1.0 - x : 3.0 + x;
    uint code = uint(roundEven(clamp(turn * 0.25, 0.0, 1.0) * CUT_DIRECTIONS));
    // `NONE` stands for no line: the largest distance is left out.
    float share = clamp(divide(distance, reach) - CUT_ANGLE_ERROR, 0.0, 1.0);
    return code << CUT_DISTANCE_BITS | min(uint(share * CUT_DISTANCES), uint(CUT_DISTANCES) - 1u);
}

vec4 unpack_cut(uint code, vec3 normal, float reach)
{
    if (code == NONE) {
        return NO_LINE;
    }
    float turn = float(code >> CUT_DISTANCE_BITS) * (4.0 / CUT_DIRECTIONS);
    float x = turn < 2.0 ? 1.0 - turn : turn - 3.0;
    float y = (turn < 2.0 ? 1.0 : -1.0) * (1.0 - abs(x));
    float size = inversesqrt(x * x + y * y);
    float share = float(code & uint(CUT_DISTANCES)) * (1.0 / CUT_DISTANCES);
    return vec4(to_frame(vec3(x * size, y * size, 0.0), normal), share * reach);
}

// Whether a place, `way` from the middle of the estimate, is cut off from there.
bool is_cut_off(Cuts cuts, vec3 way)
{
    bool beyond = false;
    [[unroll]] for (uint k = 0; k < CUT_LINES; k++) {
        precise float along = way.x * cuts.lines[k].x + way.y * cuts.lines[k].y + way.z * cuts.lines[k].z;
        beyond = beyond || along > cuts.lines[k].w;
    }
    return beyond;
}
