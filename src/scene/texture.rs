//! Colour textures, as linear values.

use glam::{DVec2, Vec3};

/// What lies beyond the picture's edges.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wrap {
    Repeat,
    MirroredRepeat,
    Clamp,
}

#[derive(Debug, Clone)]
pub struct Texture {
    pub name: String,
    pub width: u32,
    pub height: u32,
    /// Linear colour, row by row from v = 0.
    pub texels: Vec<Vec3>,
    pub wrap: [Wrap; 2],
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
    /// Bilinear between texel centres.
    pub fn sample(&self, uv: DVec2) -> Vec3 {
        let place = DVec2::new(uv.x * f64::from(self.width) - 0.5, uv.y * f64::from(self.height) - 0.5);
        // Beyond that a coordinate has no fraction left, and its place no meaning.
        let place = place.clamp(DVec2::splat(-1e15), DVec2::splat(1e15));
        let (corner, share) = (place.floor(), place.fract_gl().as_vec2());
        let texel = |di: i64, dj: i64| {
            let i = self.wrap[0].index(corner.x as i64 + di, self.width);
            let j = self.wrap[1].index(corner.y as i64 + dj, self.height);
            self.texels[j * self.width as usize + i]
        };
        texel(0, 0).lerp(texel(1, 0), share.x).lerp(texel(0, 1).lerp(texel(1, 1), share.x), share.y)
    }
}

/// The sRGB transfer function (IEC 61966-2-1), from 8-bit code to linear.
pub fn linear_of_srgb(code: u8) -> f32 {
    let value = f32::from(code) / 255.0;
    if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker(wrap: Wrap) -> Texture {
        let texels = vec![Vec3::ZERO, Vec3::ONE, Vec3::ONE, Vec3::ZERO];
        Texture { name: "checker".into(), width: 2, height: 2, texels, wrap: [wrap; 2] }
    }

    #[test]
    fn textures_meet_their_texels_and_wrap() {
        for wrap in [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::Clamp] {
            let texture = checker(wrap);
            assert_eq!(texture.sample(DVec2::new(0.25, 0.25)), Vec3::ZERO);
            assert_eq!(texture.sample(DVec2::new(0.75, 0.25)), Vec3::ONE);
            assert_eq!(texture.sample(DVec2::new(0.5, 0.5)), Vec3::splat(0.5));
        }
        let beyond = DVec2::new(1.25, 0.25);
        assert_eq!(checker(Wrap::Repeat).sample(beyond), Vec3::ZERO);
        assert_eq!(checker(Wrap::MirroredRepeat).sample(beyond), Vec3::ONE);
        assert_eq!(checker(Wrap::Clamp).sample(beyond), Vec3::ONE);
    }

    #[test]
    fn srgb_is_decoded() {
        assert_eq!((linear_of_srgb(0), linear_of_srgb(255)), (0.0, 1.0));
        assert!((linear_of_srgb(188) - 0.502_886).abs() < 1e-5);
    }
}
