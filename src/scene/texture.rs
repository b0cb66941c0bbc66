//! Colour textures: four bytes per texel, as in most files, or eight where they have no bound, and linear values where they are sampled.

use std::sync::LazyLock;

use glam::{DVec2, Vec3, Vec4};
use rayon::prelude::*;

/// What lies beyond the picture's edges.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Wrap {
    Repeat,
    MirroredRepeat,
    Clamp,
}

/// What a place between texel centres has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Filter {
    #[default]
    Bilinear,
    /// The value of the nearest texel.
    Nearest,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    pub name: String,
    pub width: u32,
    pub height: u32,
    /// Row by row from v = 0.
    pub texels: Texels,
    pub wrap: [Wrap; 2],
    pub filter: Filter,
}

/// Of a texture, as the kernels read them too (`glsl/material/textures.glsl`).
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Texels {
    /// Red, green and blue by the sRGB curve, then alpha, which is linear.
    Srgb(Vec<[u8; 4]>),
    /// Red, green, blue and alpha, linear: 255 is 1.
    Linear(Vec<[u8; 4]>),
    /// Linear, of any size: red, green and blue from the lowest bit, each the eight bits of exponent and the upper 13 of the fraction of a
    /// number of single precision. Each channel has an exponent of its own, so that a weak one beside a strong one keeps its digits.
    Float(Vec<u64>),
}

/// Linear value of each 8-bit code.
pub(crate) static LINEAR_OF_SRGB: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|code| linear_of_srgb(code as u8)));

impl Texels {
    pub fn count(&self) -> usize {
        match self {
            Texels::Srgb(codes) | Texels::Linear(codes) => codes.len(),
            Texels::Float(codes) => codes.len(),
        }
    }

    /// A texel's linear colour, and its alpha.
    pub fn at(&self, place: usize) -> Vec4 {
        match self {
            Texels::Srgb(codes) => {
                let [red, green, blue, alpha] = codes[place];
                let [red, green, blue] = [red, green, blue].map(|code| LINEAR_OF_SRGB[usize::from(code)]);
                Vec4::new(red, green, blue, share_of_code(alpha))
            }
            Texels::Linear(codes) => Vec4::from(codes[place].map(share_of_code)),
            Texels::Float(codes) => of_float_code(codes[place]).extend(1.0),
        }
    }

    /// Of each texel, as the kernels have it.
    fn words_of_each(&self) -> usize {
        match self {
            Texels::Srgb(_) | Texels::Linear(_) => 1,
            Texels::Float(_) => 2,
        }
    }

    pub fn word_count(&self) -> usize {
        self.count() * self.words_of_each()
    }

    /// All of them, as the kernels have them.
    pub fn words(&self) -> impl IndexedParallelIterator<Item = u32> + '_ {
        let word = |place: usize| match self {
            Texels::Srgb(codes) | Texels::Linear(codes) => u32::from_le_bytes(codes[place]),
            Texels::Float(codes) => (codes[place / 2] >> (32 * (place & 1))) as u32,
        };
        (0..self.word_count()).into_par_iter().map(word)
    }
}

fn share_of_code(code: u8) -> f32 {
    f32::from(code) * (1.0 / 255.0)
}

/// Linear colours, each channel within 2^-14 of its value (0.006 %). What is negative or no number is 0.
impl From<Vec<Vec3>> for Texels {
    fn from(colours: Vec<Vec3>) -> Texels {
        Texels::Float(colours.into_par_iter().map(float_code).collect())
    }
}

impl Texels {
    /// Colours times a factor.
    pub(super) fn scaled(colours: &[Vec3], factor: f64) -> Texels {
        let texel = |colour: &Vec3| float_code((colour.as_dvec3() * factor).as_vec3());
        Texels::Float(colours.par_iter().map(texel).collect())
    }
}

/// Of a channel: all of a number of single precision but its sign and the lowest bits of its fraction.
const CHANNEL_BITS: u32 = 21;
const DROPPED_BITS: u32 = 31 - CHANNEL_BITS;
/// The largest number that they hold.
const MOST: f32 = f32::from_bits((f32::MAX.to_bits() >> DROPPED_BITS) << DROPPED_BITS);

fn float_code(colour: Vec3) -> u64 {
    // Kernels may take numbers below the least normal one for 0.
    let channel = |value: f32| if value >= f32::MIN_POSITIVE { value.min(MOST) } else { 0.0 };
    let rounded = |value: f32| u64::from((channel(value).to_bits() + (1 << (DROPPED_BITS - 1))) >> DROPPED_BITS);
    rounded(colour.x) | rounded(colour.y) << CHANNEL_BITS | rounded(colour.z) << (2 * CHANNEL_BITS)
}

fn of_float_code(code: u64) -> Vec3 {
    let channel = |number: u32| f32::from_bits(((code >> (number * CHANNEL_BITS)) as u32 & ((1 << CHANNEL_BITS) - 1)) << DROPPED_BITS);
    Vec3::new(channel(0), channel(1), channel(2))
}

impl Wrap {
    fn index(self, place: i64, size: u32) -> usize {
        let size = i64::from(size);
        if (0..size).contains(&place) {
            return place as usize;
        }
        let index = match self {
            Wrap::Repeat => place.rem_euclid(size),
            Wrap::Clamp => place.clamp(0, size - 1),
            Wrap::MirroredRepeat => {
                let folded = place.rem_euclid(2 * size);
                folded.min(2 * size - 1 - folded)
            }
        };
        index as usize
    }
}

impl Texture {
    /// Linear colour and alpha at a place.
    pub fn sample(&self, uv: DVec2) -> Vec4 {
        let place = DVec2::new(uv.x * f64::from(self.width) - 0.5, uv.y * f64::from(self.height) - 0.5);
        // Beyond that a coordinate has no fraction left, and its place no meaning.
        let place = place.clamp(DVec2::splat(-1e15), DVec2::splat(1e15));
        let (corner, share) = (place.floor(), place.fract_gl().as_vec2());
        let texel = |di: i64, dj: i64| {
            let i = self.wrap[0].index(corner.x as i64 + di, self.width);
            let j = self.wrap[1].index(corner.y as i64 + dj, self.height);
            self.texels.at(j * self.width as usize + i)
        };
        if self.filter == Filter::Nearest {
            // To the side of the centre that the place lies on.
            return texel(i64::from(share.x >= 0.5), i64::from(share.y >= 0.5));
        }
        texel(0, 0).lerp(texel(1, 0), share.x).lerp(texel(0, 1).lerp(texel(1, 1), share.x), share.y)
    }
}

impl Texels {
    /// Least and largest value of a channel: 0 to 2 are the colours, 3 is alpha.
    pub fn range(&self, channel: usize) -> (f32, f32) {
        // Of codes, whose values grow with them.
        if let Texels::Srgb(codes) | Texels::Linear(codes) = self {
            let join = |a: (u8, u8), b: (u8, u8)| (a.0.min(b.0), a.1.max(b.1));
            let (least, most) = codes.par_iter().map(|code| (code[channel], code[channel])).reduce(|| (u8::MAX, u8::MIN), join);
            return match self {
                Texels::Srgb(_) if channel < 3 => (LINEAR_OF_SRGB[usize::from(least)], LINEAR_OF_SRGB[usize::from(most)]),
                _ => (share_of_code(least), share_of_code(most)),
            };
        }
        let one = |place: usize| self.at(place)[channel];
        let join = |a: (f32, f32), b: (f32, f32)| (a.0.min(b.0), a.1.max(b.1));
        (0..self.count()).into_par_iter().map(|place| (one(place), one(place))).reduce(|| (f32::INFINITY, f32::NEG_INFINITY), join)
    }
}

/// The sRGB transfer function (IEC 61966-2-1), from 8-bit code to linear.
pub(crate) fn linear_of_srgb(code: u8) -> f32 {
    let value = f32::from(code) / 255.0;
    if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker(wrap: Wrap) -> Texture {
        let texels = vec![Vec3::ZERO, Vec3::ONE, Vec3::ONE, Vec3::ZERO];
        Texture { name: "checker".into(), width: 2, height: 2, texels: texels.into(), wrap: [wrap; 2], filter: Filter::Bilinear }
    }

    #[test]
    fn textures_meet_their_texels_and_wrap() {
        for wrap in [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::Clamp] {
            let texture = checker(wrap);
            assert_eq!(texture.sample(DVec2::new(0.25, 0.25)), Vec4::W);
            assert_eq!(texture.sample(DVec2::new(0.75, 0.25)), Vec4::ONE);
            assert_eq!(texture.sample(DVec2::new(0.5, 0.5)), Vec3::splat(0.5).extend(1.0));
        }
        let beyond = DVec2::new(1.25, 0.25);
        assert_eq!(checker(Wrap::Repeat).sample(beyond), Vec4::W);
        assert_eq!(checker(Wrap::MirroredRepeat).sample(beyond), Vec4::ONE);
        assert_eq!(checker(Wrap::Clamp).sample(beyond), Vec4::ONE);
    }

    #[test]
    fn nearest_texels_and_alpha() {
        let texels = Texels::Linear(vec![[0, 51, 102, 153], [255, 0, 51, 204]]);
        let texture = Texture { name: "two".into(), width: 2, height: 1, texels, wrap: [Wrap::Repeat; 2], filter: Filter::Nearest };
        for (u, texel) in
            [(0.01, [0.0, 0.2, 0.4, 0.6]), (0.49, [0.0, 0.2, 0.4, 0.6]), (0.51, [1.0, 0.0, 0.2, 0.8]), (1.2, [0.0, 0.2, 0.4, 0.6])]
        {
            assert!(texture.sample(DVec2::new(u, 0.3)).abs_diff_eq(Vec4::from(texel), 1e-6), "{u}");
        }
        let filtered = Texture { filter: Filter::Bilinear, ..texture }.sample(DVec2::new(0.5, 0.5));
        assert!(filtered.abs_diff_eq(Vec4::new(0.5, 0.1, 0.3, 0.7), 1e-6));
    }

    #[test]
    fn each_channel_keeps_its_digits_beside_the_others() {
        let texel = |colour: Vec3| Texels::from(vec![colour]).at(0).truncate();
        for exact in [Vec3::ZERO, Vec3::ONE, Vec3::new(0.5, 0.25, 2f32.powi(-100)), Vec3::splat(MOST), Vec3::new(3.0, 0.75, 1.5e30)] {
            assert!((texel(exact) - exact).abs().cmple(exact * 2f32.powi(-14)).all(), "{exact}");
        }
        assert_eq!(texel(Vec3::new(f32::INFINITY, -1.0, f32::NAN)), Vec3::new(MOST, 0.0, 0.0));
        for k in 1..4000 {
            let colour = 1.013f32.powi(k % 1500 - 700) * Vec3::new(1.0, 1e-9 * k as f32, 3e-5);
            let off = (texel(colour) - colour).abs() / colour;
            assert!(off.max_element() < 2f32.powi(-14), "{colour} {}", texel(colour));
        }
    }

    #[test]
    fn words_are_the_texels_from_the_lowest_bit() {
        let texels = Texels::from(vec![Vec3::new(1.0, 2.0, 3.0), Vec3::splat(0.3)]);
        let words: Vec<u32> = texels.words().collect();
        let Texels::Float(codes) = &texels else { panic!("{texels:?}") };
        let joined: Vec<u64> = words.chunks(2).map(|pair| u64::from(pair[0]) | u64::from(pair[1]) << 32).collect();
        assert_eq!((&joined, texels.word_count()), (codes, 4));
    }

    #[test]
    fn srgb_is_decoded() {
        assert_eq!((linear_of_srgb(0), linear_of_srgb(255)), (0.0, 1.0));
        assert!((linear_of_srgb(188) - 0.502_886).abs() < 1e-5);
    }
}
