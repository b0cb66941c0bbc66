// The functions of math/math.glsl at given numbers.
// Dispatched by src/gpu/check.rs. One thread = one pair of operands.
#extension GL_EXT_scalar_block_layout : require

// Functions of `glsl/math/math.glsl` at (a, b).
struct MathResults {
    // The bits of a, taken for an integer.
    float converted;
    // a b + a
    float sum_of_product;
    // a / b
    float quotient;
    // Of a.
    float root;
    float inverse_root;
    float exp2;
    float log2;
    // Angle of (b, a).
    float angle;
    float asinh;
};

layout(set = 1, binding = 0, scalar) readonly buffer Operands { vec2 operands[]; };
layout(set = 1, binding = 1, scalar) writeonly buffer Results { MathResults results[]; };

#include "math/math.glsl"
#include "dispatch/dispatch.glsl"

void main()
{
    uint index = invocation_index();
    if (index >= operands.length()) {
        return;
    }
    float a = operands[index].x, b = operands[index].y;
    results[index] = MathResults(float(floatBitsToUint(a)), a * b + a, divide(a, b), sqrt(a), inversesqrt(a), exp2(a), log2(a), atan(a, b), asinh(a));
}
