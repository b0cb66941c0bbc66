//! Powers, logarithms and angles that are the same to the bit on every machine. Twin of `glsl/math/math.glsl`, which explains
//! them; quotients and roots are rounded to nearest on a CPU anyway.

/// 2^x to 2 units in the last place, 0 below 2^-125.
pub(crate) fn exp2(x: f32) -> f32 {
    if x <= -125.0 || x >= 128.0 {
        return if x < 0.0 { 0.0 } else { f32::INFINITY };
    }
    let whole = x.round_ties_even();
    let z = (x - whole) * std::f32::consts::LN_2;
    let power =
        1.0 + z * (1.0 + z * (1.0 / 2.0 + z * (1.0 / 6.0 + z * (1.0 / 24.0 + z * (1.0 / 120.0 + z * (1.0 / 720.0 + z * (1.0 / 5040.0)))))));
    f32::from_bits(power.to_bits().wrapping_add((whole as i32 as u32) << 23))
}

/// log2(x) to 3 units in the last place, of a normal x above 0.
pub(crate) fn log2(x: f32) -> f32 {
    const LEADING_BIT: u32 = 1 << 23;
    let exponent = (x.to_bits() >> 23) as i32 - 127;
    let mantissa = f32::from_bits((x.to_bits() & (LEADING_BIT - 1)) | 1.0f32.to_bits());
    let above = mantissa > std::f32::consts::SQRT_2;
    let mantissa = if above { 0.5 * mantissa } else { mantissa };
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let s2 = s * s;
    let series = s * (1.0 + s2 * (1.0 / 3.0 + s2 * (1.0 / 5.0 + s2 * (1.0 / 7.0 + s2 * (1.0 / 9.0)))));
    (exponent + i32::from(above)) as f32 + 2.0 * std::f32::consts::LOG2_E * series
}

/// Angle of (x, y) in [-pi, pi], to 3 units in the last place; 0 for the origin.
pub(crate) fn angle_of(y: f32, x: f32) -> f32 {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    let (small, large) = (x.abs().min(y.abs()), x.abs().max(y.abs()));
    if large < f32::MIN_POSITIVE {
        return 0.0;
    }
    let t = if small < f32::MIN_POSITIVE { 0.0 } else { small / large };
    let folded = t > 0.414_213_56;
    let t = if folded { (t - 1.0) / (t + 1.0) } else { t };
    let t2 = t * t;
    let series = -1.0 / 3.0
        + t2 * (1.0 / 5.0
            + t2 * (-1.0 / 7.0 + t2 * (1.0 / 9.0 + t2 * (-1.0 / 11.0 + t2 * (1.0 / 13.0 + t2 * (-1.0 / 15.0 + t2 * (1.0 / 17.0)))))));
    let angle = t + t * t2 * series;
    let angle = if folded { FRAC_PI_4 + angle } else { angle };
    let angle = if y.abs() > x.abs() { FRAC_PI_2 - angle } else { angle };
    let angle = if x < 0.0 { PI - angle } else { angle };
    if y <= -f32::MIN_POSITIVE { -angle } else { angle }
}
