// Quotients, roots, and the functions of GLSL that Vulkan lets every device round as it likes. With STRICT_MATH
// only sums, products and integers decide a result, and those are the same to the bit on every device that
// rounds to nearest; else the device's own functions are as fast as it has them. They stand in native_*, and
// compile.rs lets them stand nowhere else. What lies closer to 0 than any normal number a device may keep or
// take for 0; to quotients, roots and angles it is 0. Twin of src/cpu/math.rs.

layout(constant_id = 30) const bool STRICT_MATH = false;

const uint SIGN_BIT = 0x80000000u;
const uint INFINITY_BITS = 0x7f800000u;
const uint NAN_BITS = 0x7fc00000u;
const uint LEADING_BIT = 0x00800000u;
const float LEAST_NORMAL = 1.17549435082228751e-38;

float native_quotient(float a, float b) { return a / b; }
float native_root(float x) { return sqrt(x); }
float native_inverse_root(float x) { return inversesqrt(x); }
float native_exp2(float x) { return exp2(x); }
float native_log2(float x) { return log2(x); }
float native_atan(float y, float x) { return atan(y, x); }
float native_asinh(float x) { return asinh(x); }

// IEEE 754's answers where an operand or the result is no normal number; those too small to be one are 0.
float extreme_quotient(uint a, uint b)
{
    uint size_a = a & ~SIGN_BIT, size_b = b & ~SIGN_BIT;
    bool a_is_zero = size_a < LEADING_BIT, b_is_zero = size_b < LEADING_BIT;
    bool undefined = size_a > INFINITY_BITS || size_b > INFINITY_BITS || (a_is_zero && b_is_zero)
                  || (size_a == INFINITY_BITS && size_b == INFINITY_BITS);
    uint size = a_is_zero || size_b == INFINITY_BITS ? 0 : INFINITY_BITS;
    return uintBitsToFloat(undefined ? NAN_BITS : ((a ^ b) & SIGN_BIT) | size);
}

// a / b rounded to nearest: long division of the mantissas. The device's own quotient is a first guess, and its
// remainder, exact in 32 bits as it is small, says by how much the guess is off.
float rounded_quotient(float x, float y)
{
    uint a = floatBitsToUint(x), b = floatBitsToUint(y);
    int exponent_a = int(a >> 23) & 0xff, exponent_b = int(b >> 23) & 0xff;
    if (exponent_a == 0 || exponent_a == 255 || exponent_b == 0 || exponent_b == 255) {
        return extreme_quotient(a, b);
    }
    uint dividend = (a & (LEADING_BIT - 1)) | LEADING_BIT, divisor = (b & (LEADING_BIT - 1)) | LEADING_BIT;
    uint shift = dividend < divisor ? 24 : 23;
    uint quotient = uint(native_quotient(float(dividend), float(divisor)) * float(1u << shift));
    int remainder = int((dividend << shift) - quotient * divisor);
    // Vulkan allows 2.5 units in the last place, and the guess was cut to an integer.
    int d = int(divisor);
    int off = int(remainder >= d) + int(remainder >= 2 * d) + int(remainder >= 3 * d) + int(remainder >= 4 * d)
            - int(remainder < 0) - int(remainder < -d) - int(remainder < -2 * d) - int(remainder < -3 * d);
    remainder -= off * d;
    quotient += uint(off) + uint(2 * remainder > d);
    int exponent = exponent_a - exponent_b + (dividend < divisor ? 126 : 127);
    uint sign = (a ^ b) & SIGN_BIT;
    if (exponent <= 0) {
        return uintBitsToFloat(sign);
    }
    // A quotient that was rounded up to a power of two carries into the exponent.
    uint bits = exponent >= 255 ? INFINITY_BITS : (uint(exponent) << 23) + (quotient - LEADING_BIT);
    return uintBitsToFloat(sign | bits);
}

// sqrt(x) rounded to nearest, in the same way.
float rounded_root(float x)
{
    uint bits = floatBitsToUint(x);
    int exponent = int(bits >> 23) & 0xff;
    if (exponent == 0 || bits >= INFINITY_BITS) {
        bool undefined = exponent != 0 && bits != INFINITY_BITS;
        return uintBitsToFloat(undefined ? NAN_BITS : (exponent == 0 ? bits & SIGN_BIT : INFINITY_BITS));
    }
    uint mantissa = (bits & (LEADING_BIT - 1)) | LEADING_BIT;
    uint shift = (exponent & 1) == 1 ? 23 : 24;
    uint root = uint(native_root(float(mantissa) * float(1u << shift)));
    int remainder = int((mantissa << shift) - root * root);
    root += uint(int(floor(native_quotient(float(remainder), float(2 * root)))));
    remainder = int((mantissa << shift) - root * root);
    int off = int(remainder > 2 * int(root)) - int(remainder < 0);
    root += uint(off);
    remainder = int((mantissa << shift) - root * root);
    root += uint(remainder > int(root));
    return uintBitsToFloat((uint(exponent + 150 - int(shift)) >> 1 << 23) + (root - LEADING_BIT));
}

float divide(float a, float b)
{
    if (STRICT_MATH) {
        return rounded_quotient(a, b);
    }
    return native_quotient(a, b);
}

vec2 divide(vec2 a, float b) { return vec2(divide(a.x, b), divide(a.y, b)); }
vec3 divide(vec3 a, float b) { return vec3(divide(a.x, b), divide(a.y, b), divide(a.z, b)); }

float square_root(float x)
{
    if (STRICT_MATH) {
        return rounded_root(x);
    }
    return native_root(x);
}

float inverse_root(float x)
{
    if (STRICT_MATH) {
        return rounded_quotient(1.0, rounded_root(x));
    }
    return native_inverse_root(x);
}

// 2^x to 2 units in the last place, 0 below 2^-125: Taylor's polynomial between half-integers.
float exponential2(float x)
{
    if (STRICT_MATH) {
        if (x <= -125.0 || x >= 128.0) {
            return x < 0.0 ? 0.0 : uintBitsToFloat(INFINITY_BITS);
        }
        float whole = roundEven(x);
        float z = (x - whole) * 0.69314718055994531;
        float power = 1.0 + z * (1.0 + z * (1.0 / 2.0 + z * (1.0 / 6.0 + z * (1.0 / 24.0 + z * (1.0 / 120.0 + z * (1.0 / 720.0 + z * (1.0 / 5040.0)))))));
        return uintBitsToFloat(floatBitsToUint(power) + (uint(int(whole)) << 23));
    }
    return native_exp2(x);
}

// log2(x) to 3 units in the last place, of a normal x above 0: the series of artanh about the nearest power of two.
float logarithm2(float x)
{
    if (STRICT_MATH) {
        uint bits = floatBitsToUint(x);
        int exponent = int(bits >> 23) - 127;
        float mantissa = uintBitsToFloat((bits & (LEADING_BIT - 1)) | 0x3f800000u);
        bool above = mantissa > 1.41421356;
        mantissa = above ? 0.5 * mantissa : mantissa;
        float s = rounded_quotient(mantissa - 1.0, mantissa + 1.0);
        float s2 = s * s;
        float series = s * (1.0 + s2 * (1.0 / 3.0 + s2 * (1.0 / 5.0 + s2 * (1.0 / 7.0 + s2 * (1.0 / 9.0)))));
        return float(exponent + int(above)) + 2.8853900817779268 * series;
    }
    return native_log2(x);
}

// Angle of (x, y) in [-pi, pi], to 3 units in the last place; 0 for the origin.
float angle_of(float y, float x)
{
    if (STRICT_MATH) {
        float small = min(abs(x), abs(y)), large = max(abs(x), abs(y));
        if (large < LEAST_NORMAL) {
            return 0.0;
        }
        float t = rounded_quotient(small, large);
        bool folded = t > 0.41421356;
        t = folded ? rounded_quotient(t - 1.0, t + 1.0) : t;
        float t2 = t * t;
        float angle = t + t * t2 * (-1.0 / 3.0 + t2 * (1.0 / 5.0 + t2 * (-1.0 / 7.0 + t2 * (1.0 / 9.0 + t2 * (-1.0 / 11.0 + t2 * (1.0 / 13.0 + t2 * (-1.0 / 15.0 + t2 * (1.0 / 17.0))))))));
        angle = folded ? 0.78539816339744831 + angle : angle;
        angle = abs(y) > abs(x) ? 1.5707963267948966 - angle : angle;
        angle = x < 0.0 ? 3.14159265358979324 - angle : angle;
        return y <= -LEAST_NORMAL ? -angle : angle;
    }
    return native_atan(y, x);
}

// Inverse hyperbolic sine to 6 units in the last place: ln(1 + r), r = |x| + x^2 / (1 + sqrt(1 + x^2)), with the
// rounding of 1 + r undone.
float area_sine(float x)
{
    if (STRICT_MATH) {
        float a = abs(x);
        float r = a + rounded_quotient(a * a, 1.0 + rounded_root(1.0 + a * a));
        float sum = 1.0 + r;
        float logarithm = sum == 1.0 ? r : 0.69314718055994531 * logarithm2(sum) * rounded_quotient(r, sum - 1.0);
        return x < 0.0 ? -logarithm : logarithm;
    }
    return native_asinh(x);
}

// The terms of these are summed from left to right.
float inner_product(vec2 a, vec2 b) { return a.x * b.x + a.y * b.y; }
float inner_product(vec3 a, vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

vec3 outer_product(vec3 a, vec3 b)
{
    return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

float norm(vec2 v) { return square_root(inner_product(v, v)); }
float norm(vec3 v) { return square_root(inner_product(v, v)); }
vec3 unit_vector(vec3 v) { return v * inverse_root(inner_product(v, v)); }

// From here on these names mean the functions above.
#define sqrt square_root
#define inversesqrt inverse_root
#define exp2 exponential2
#define log2 logarithm2
#define atan angle_of
#define asinh area_sine
#define dot inner_product
#define cross outer_product
#define normalize unit_vector
