//! Texture coordinates as near 0 as whole turns bring them. Far from it single precision, in which kernels have them, has no digits left
//! for a place in a picture.

use std::collections::BTreeSet;

use glam::{DMat2, DVec2};
use rayon::prelude::*;

use crate::scene::material::UvTransform;
use crate::scene::texture::Wrap;
use crate::scene::{Mesh, Scene};
use crate::text::some_of;

/// Turns: coordinates within these stay as they are.
const FAR: f64 = 64.0;
/// Turns that a triangle may span. Times the texels of a side, up to 200 000, it is still a 32-bit integer.
const MAX_TURNS: f64 = 1e4;

/// Two turns, not one: every second one is mirrored in some pictures. One that ends at its edges looks the same anywhere beyond them.
fn near_along(at: [f64; 3], wrap: Wrap) -> [f64; 3] {
    let (least, most) = (at.into_iter().fold(f64::INFINITY, f64::min), at.into_iter().fold(f64::NEG_INFINITY, f64::max));
    let base = match wrap {
        _ if least >= -FAR && most <= FAR => return at,
        Wrap::Clamp if least > FAR => least.floor() - 2.0,
        Wrap::Clamp if most < -FAR => most.ceil() + 2.0,
        Wrap::Clamp => 0.0,
        Wrap::Repeat | Wrap::MirroredRepeat => 2.0 * (0.5 * at[0]).floor(),
    };
    at.map(|at| (at - base).clamp(-MAX_TURNS, MAX_TURNS))
}

/// Coordinates of a triangle's corners in a picture.
pub(super) fn near(uvs: [DVec2; 3], wrap: [Wrap; 2]) -> [DVec2; 3] {
    let [u, v] = [near_along(uvs.map(|uv| uv.x), wrap[0]), near_along(uvs.map(|uv| uv.y), wrap[1])];
    [0, 1, 2].map(|corner| DVec2::new(u[corner], v[corner]))
}

/// An offset that is added to coordinates.
pub(super) fn near_offset(offset: DVec2, wrap: [Wrap; 2]) -> DVec2 {
    let along = |at: f64, wrap: Wrap| if wrap == Wrap::Clamp || at.abs() <= FAR { at } else { at - 2.0 * (0.5 * at).floor() };
    DVec2::new(along(offset.x, wrap[0]), along(offset.y, wrap[1]))
}

/// For coordinates that kernels transform themselves.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turns {
    transform: UvTransform,
    wrap: [Wrap; 2],
    /// Takes a way in the picture to one in the coordinates.
    back: DMat2,
    /// As kernels add it.
    offset: DVec2,
}

impl Turns {
    /// `None` where a transform makes a line or a point of all coordinates.
    pub(super) fn new(transform: UvTransform, wrap: [Wrap; 2]) -> Option<Turns> {
        let along = |axis: DVec2| transform.apply(axis) - transform.offset;
        let back = DMat2::from_cols(along(DVec2::X), along(DVec2::Y)).inverse();
        let offset = near_offset(transform.offset, wrap).as_vec2().as_dvec2();
        back.is_finite().then_some(Turns { transform, wrap, back, offset })
    }

    /// Coordinates of a triangle's corners, before the transform.
    pub(super) fn near(&self, uvs: [DVec2; 3]) -> [DVec2; 3] {
        let places = uvs.map(|uv| self.transform.apply(uv));
        let is_far = |place: &DVec2| place.abs().max_element() > FAR;
        if !places.iter().any(is_far) && !is_far(&self.transform.offset) {
            return uvs;
        }
        near(places, self.wrap).map(|place| self.back * (place - self.offset))
    }
}

/// That triangles span more turns than kernels count.
pub(super) fn warning(scene: &Scene) -> Option<String> {
    let is_wide = |mesh: &&Mesh| {
        let spans = |(set, transform): (usize, UvTransform)| {
            let most = mesh.uvs[set].iter().fold(0.0, |most: f64, uv| most.max(uv.abs().max_element()));
            // Seldom.
            most * transform.scale.abs().max_element() > MAX_TURNS / 4.0
                && mesh.triangles.iter().any(|triangle| {
                    let [a, b, c] = triangle.map(|vertex| transform.apply(mesh.uvs[set][vertex as usize]));
                    (b - a).abs().max(c - a).abs().max_element() > MAX_TURNS
                })
        };
        let mut uses = scene.materials[mesh.material].textures().map(|used| (used.uv_set, used.transform));
        uses.any(spans)
    };
    let wide: BTreeSet<String> = scene.meshes.par_iter().filter(is_wide).map(|mesh| format!("mesh '{}'", mesh.name)).collect();
    (!wide.is_empty()).then(|| {
        format!(
            "triangles across which a texture repeats more than {MAX_TURNS} times ({}): it repeats {MAX_TURNS} times there",
            some_of(wide.iter())
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_turns_leave_the_place_in_the_picture() {
        let far = [DVec2::new(500_123.25, -4_649_776.5), DVec2::new(500_124.0, -4_649_777.0), DVec2::new(500_123.5, -4_649_776.0)];
        for wrap in [Wrap::Repeat, Wrap::MirroredRepeat] {
            let found = near(far, [wrap; 2]);
            for (far, found) in far.iter().zip(found) {
                let turns = 0.5 * (*far - found);
                assert!(turns == turns.floor() && found.abs().max_element() < 4.0, "{far} became {found}");
            }
        }
        let clamped = near(far, [Wrap::Clamp; 2]);
        assert!(clamped.iter().all(|at| at.x >= 2.0 && at.x < 64.0 && at.y <= -2.0 && at.y > -64.0), "{clamped:?}");
        let close = [DVec2::splat(-3.0), DVec2::ONE, DVec2::splat(63.0)];
        assert_eq!(near(close, [Wrap::Repeat; 2]), close);
    }

    /// Scaled down, far coordinates lose thousands of them at once.
    #[test]
    fn coordinates_before_a_transform_keep_their_place_after_it() {
        let transform = UvTransform { scale: DVec2::new(0.01, -0.003), rotation: 0.4, offset: DVec2::new(1e5, -7.3) };
        let turns = Turns::new(transform, [Wrap::Repeat; 2]).unwrap();
        let far = [DVec2::new(500_123.25, 4_649_776.5), DVec2::new(500_223.0, 4_649_777.0), DVec2::new(500_123.5, 4_649_876.0)];
        for (far, found) in far.iter().zip(turns.near(far)) {
            let (sine, cosine) = transform.rotation.sin_cos();
            let scaled = transform.scale * found.as_vec2().as_dvec2();
            let at = turns.offset + DVec2::new(cosine * scaled.x + sine * scaled.y, cosine * scaled.y - sine * scaled.x);
            let off = 0.5 * (transform.apply(*far) - at);
            assert!((off - off.round()).abs().max_element() < 1e-4, "{far}: {off}");
            assert!(at.abs().max_element() < 8.0, "{at}");
        }
        assert!(Turns::new(UvTransform { scale: DVec2::X, ..transform }, [Wrap::Repeat; 2]).is_none());
    }
}
