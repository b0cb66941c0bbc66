//! Light of one colour temperature as white.

use std::fmt;
use std::str::FromStr;

use glam::{DMat3, DVec3};

/// A colour temperature, within those that [`planckian`] is made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kelvin(f32);

impl FromStr for Kelvin {
    type Err = String;

    fn from_str(text: &str) -> Result<Kelvin, String> {
        let allowed = || "must be from 1667 to 25000 K; a candle has 1900, daylight 6500".to_owned();
        text.trim().parse().ok().filter(|kelvin| (1667.0..=25_000.0).contains(kelvin)).map(Kelvin).ok_or_else(allowed)
    }
}

impl fmt::Display for Kelvin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// What takes linear Rec. 709 values of a scene to those of an image in which a black body of this temperature is white: by the cones'
/// responses, each scaled by itself (Bradford: Lam 1985).
pub(crate) fn adaptation(kelvin: Kelvin) -> DMat3 {
    let [x, y] = planckian(f64::from(kelvin.0));
    let white = DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
    let cones = DMat3::from_cols_array_2d(&[[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]).transpose();
    let of_rgb = cones * XYZ_OF_RGB.transpose();
    of_rgb.inverse() * DMat3::from_diagonal(of_rgb * DVec3::ONE / (cones * white)) * of_rgb
}

/// Rows; white is D65 (IEC 61966-2-1, with the digits of B. Lindbloom).
const XYZ_OF_RGB: DMat3 =
    DMat3::from_cols_array_2d(&[[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]);

/// Chromaticity of a black body, x and y of CIE 1931: the fit of Kang et al. (2002), "Design of advanced color temperature control system
/// for HDTV applications", which is within 0.0005.
fn planckian(kelvin: f64) -> [f64; 2] {
    let cubic = |u: f64, [c3, c2, c1, c0]: [f64; 4]| ((c3 * u + c2) * u + c1) * u + c0;
    let of_x = if kelvin <= 4000.0 { [-0.2661239, -0.2343589, 0.8776956, 0.179910] } else { [-3.0258469, 2.1070379, 0.2226347, 0.240390] };
    let x = cubic(1000.0 / kelvin, of_x);
    let of_y = match kelvin {
        ..=2222.0 => [-1.1063814, -1.34811020, 2.18555832, -0.20219683],
        ..=4000.0 => [-0.9549476, -1.37418593, 2.09137015, -0.16748867],
        _ => [3.0817580, -5.87338670, 3.75112997, -0.37001483],
    };
    [x, cubic(x, of_y)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIE 15:2018: illuminant A is a black body of 2856 K; daylight is a little greener than that of 6504 K.
    #[test]
    fn tungsten_light_becomes_white_and_daylight_stays() {
        let [x, y] = planckian(2856.0);
        assert!((x - 0.44757).abs() < 1e-3 && (y - 0.40745).abs() < 1e-3, "{x} {y}");

        let tungsten = XYZ_OF_RGB.transpose().inverse() * DVec3::new(0.44757 / 0.40745, 1.0, (1.0 - 0.44757 - 0.40745) / 0.40745);
        let shown = adaptation(Kelvin(2856.0)) * tungsten;
        assert!((shown - DVec3::ONE).abs().max_element() < 0.01, "{tungsten} -> {shown}");
        let daylight = adaptation(Kelvin(6504.0)) * DVec3::ONE;
        assert!((daylight - DVec3::ONE).abs().max_element() < 0.05, "{daylight}");
        assert!(tungsten.x > 3.0 * tungsten.z);
    }
}
