//! The box as a picture, like the paper's figures: the walls unfolded, and seen from several angles.

use glam::{DVec3, Vec3};
use png::ColorType;

use super::colour::{Format, eight_bits};
use super::exr_file::{self, channels};
use super::metadata::Metadata;
use crate::engine::room::film::WallEstimate;
use crate::scene::Camera;
use crate::scene::rectangle::Rectangle;
use crate::scene::room::{RoomScene, face_axis};

/// A grey picture, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct GreyImage {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f64>,
}

/// A wall's texels as a function of position.
struct Texture<'a> {
    rectangle: Rectangle,
    values: &'a [f64],
    mesh: usize,
}

impl<'a> Texture<'a> {
    fn of_walls(scene: &RoomScene, walls: &[(usize, &'a [f64])]) -> Vec<(usize, Texture<'a>)> {
        let texture = |(face, values): &(usize, &'a [f64])| {
            (*face, Texture { rectangle: scene.rectangle(*face), values, mesh: values.len().isqrt() })
        };
        walls.iter().map(texture).collect()
    }

    /// (s, t) of a point of the wall's plane; each in [0, 1] on the wall.
    fn coordinates(&self, point: DVec3) -> (f64, f64) {
        let from_origin = point - self.rectangle.origin;
        let along = |side: DVec3| from_origin.dot(side) / side.length_squared();
        (along(self.rectangle.u), along(self.rectangle.v))
    }

    /// The texel that holds a point.
    fn nearest(&self, point: DVec3) -> f64 {
        let (s, t) = self.coordinates(point);
        let index = |x: f64| ((x * self.mesh as f64) as usize).min(self.mesh - 1);
        self.values[index(t) * self.mesh + index(s)]
    }

    /// Bilinear between texel centres.
    fn smooth(&self, point: DVec3) -> f64 {
        let (s, t) = self.coordinates(point);
        let last = (self.mesh - 1) as f64;
        let place = |x: f64| (x * self.mesh as f64 - 0.5).clamp(0.0, last);
        let (column, row) = (place(s), place(t));
        let texel = |i: f64, j: f64| self.values[j.min(last) as usize * self.mesh + i.min(last) as usize];
        let (i, j, di, dj) = (column.floor(), row.floor(), column.fract(), row.fract());
        let lower = texel(i, j) * (1.0 - di) + texel(i + 1.0, j) * di;
        let upper = texel(i, j + 1.0) * (1.0 - di) + texel(i + 1.0, j + 1.0) * di;
        lower * (1.0 - dj) + upper * dj
    }
}

/// Pixels along a wall in the unfolded picture.
const WALL_PIXELS: usize = 192;
/// Pixels along a perspective view: two by two of them are as high as the unfolded box.
const VIEW_PIXELS: usize = 3 * WALL_PIXELS / 2;
/// Rays along each side of a pixel.
const RAYS: usize = 3;

/// The unfolded walls on the left, four views on the right.
pub(crate) fn overview(scene: &RoomScene, walls: &[WallEstimate]) -> GreyImage {
    let mut picture = GreyImage::black(3 * WALL_PIXELS + 2 * VIEW_PIXELS, 3 * WALL_PIXELS);
    picture.paste(&unfolded(scene, walls), 0, 0);
    for (place, eye) in VIEWS.iter().enumerate() {
        let view = perspective(scene, &illumination(walls), eye.1, VIEW_PIXELS);
        picture.paste(&view, 3 * WALL_PIXELS + place % 2 * VIEW_PIXELS, place / 2 * VIEW_PIXELS);
    }
    picture
}

/// The box from one of [`VIEWS`].
pub(crate) fn view(scene: &RoomScene, walls: &[WallEstimate], number: usize, pixels: usize) -> GreyImage {
    view_of_values(scene, &illumination(walls), number, pixels)
}

/// The same with values of any kind, of the texels of each face.
pub(crate) fn view_of_values(scene: &RoomScene, walls: &[(usize, &[f64])], number: usize, pixels: usize) -> GreyImage {
    perspective(scene, walls, VIEWS[number].1, pixels)
}

fn illumination(walls: &[WallEstimate]) -> Vec<(usize, &[f64])> {
    walls.iter().map(|wall| (wall.face, &wall.illumination[..])).collect()
}

/// The walls folded out around the back wall, as one looks in through the opening.
pub(crate) fn unfolded(scene: &RoomScene, walls: &[WallEstimate]) -> GreyImage {
    let (min, max) = (scene.min_corner, scene.max_corner);
    let side = WALL_PIXELS;
    let mut picture = GreyImage::black(3 * side, 3 * side);
    for (face, texture) in Texture::of_walls(scene, &illumination(walls)) {
        // Column and row of the wall's square, and its point at (x, y), both from 0 to 1 with y up.
        type Unfold = fn(DVec3, DVec3, f64, f64) -> DVec3;
        let (column, row, point): (usize, usize, Unfold) = match face {
            0 => (0, 1, |min, max, x, y| DVec3::new(min.x, mix(min.y, max.y, y), mix(max.z, min.z, x))),
            1 => (2, 1, |min, max, x, y| DVec3::new(max.x, mix(min.y, max.y, y), mix(min.z, max.z, x))),
            2 => (1, 2, |min, max, x, y| DVec3::new(mix(min.x, max.x, x), min.y, mix(max.z, min.z, y))),
            3 => (1, 0, |min, max, x, y| DVec3::new(mix(min.x, max.x, x), max.y, mix(min.z, max.z, y))),
            4 => (1, 1, |min, max, x, y| DVec3::new(mix(min.x, max.x, x), mix(min.y, max.y, y), min.z)),
            // The opening of other rooms would cover the view.
            _ => continue,
        };
        for j in 0..side {
            for i in 0..side {
                let x = (i as f64 + 0.5) / side as f64;
                let y = 1.0 - (j as f64 + 0.5) / side as f64;
                picture.values[(row * side + j) * picture.width + column * side + i] = texture.nearest(point(min, max, x, y));
            }
        }
    }
    picture
}

fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// Eyes and where they are: in half widths of the box from its centre, all in front of the opening.
pub(crate) const VIEWS: [(&str, [f64; 3]); 4] = [
    ("from the front", [0.0, 0.0, 4.2]),
    ("from the upper right", [1.7, 1.2, 4.2]),
    ("from the upper left", [-1.7, 1.2, 4.2]),
    ("from the lower right", [1.2, -1.8, 4.2]),
];

/// Only the insides of walls are drawn, so that a wall between eye and box does not hide it.
fn perspective(scene: &RoomScene, walls: &[(usize, &[f64])], eye: [f64; 3], pixels: usize) -> GreyImage {
    let centre = 0.5 * (scene.min_corner + scene.max_corner);
    let half = 0.5 * (scene.max_corner - scene.min_corner).max_element();
    let eye = centre + half * DVec3::from(eye);
    let Camera { forward, right, up, .. } = Camera::looking_at("view", eye, centre, DVec3::Y, 1.0);
    // The picture fits the corner that stands out most.
    let reach = |corner: usize| {
        let side = |axis: usize| if corner >> axis & 1 == 1 { scene.max_corner[axis] } else { scene.min_corner[axis] };
        let from_eye = DVec3::new(side(0), side(1), side(2)) - eye;
        from_eye.dot(right).abs().max(from_eye.dot(up).abs()) / from_eye.dot(forward)
    };
    let half_width = 1.03 * (0..8).map(reach).fold(0.0, f64::max);

    let textures = Texture::of_walls(scene, walls);
    let seen = |x: f64, y: f64| {
        let direction = forward + half_width * (x * right + y * up);
        let hits = textures.iter().filter_map(|(face, texture)| {
            let (axis, sign) = face_axis(*face);
            // From inside, a ray runs towards the wall's own side.
            if direction[axis] * sign <= 0.0 {
                return None;
            }
            let distance = (texture.rectangle.origin[axis] - eye[axis]) / direction[axis];
            let point = eye + distance * direction;
            let (s, t) = texture.coordinates(point);
            let on_wall = distance > 0.0 && (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t);
            on_wall.then(|| (distance, texture.smooth(point)))
        });
        hits.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |(_, value)| value)
    };
    let mut picture = GreyImage::black(pixels, pixels);
    for j in 0..pixels {
        for i in 0..pixels {
            let sum: f64 = (0..RAYS * RAYS)
                .map(|ray| {
                    let x = i as f64 + ((ray % RAYS) as f64 + 0.5) / RAYS as f64;
                    let y = j as f64 + ((ray / RAYS) as f64 + 0.5) / RAYS as f64;
                    seen(2.0 * x / pixels as f64 - 1.0, 1.0 - 2.0 * y / pixels as f64)
                })
                .sum();
            picture.values[j * pixels + i] = sum / (RAYS * RAYS) as f64;
        }
    }
    picture
}

impl GreyImage {
    pub(crate) fn black(width: usize, height: usize) -> GreyImage {
        GreyImage { width, height, values: vec![0.0; width * height] }
    }

    /// Copies another picture in, its upper left corner at (column, row).
    pub(crate) fn paste(&mut self, other: &GreyImage, column: usize, row: usize) {
        for j in 0..other.height {
            let to = (row + j) * self.width + column;
            self.values[to..to + other.width].copy_from_slice(&other.values[j * other.width..(j + 1) * other.width]);
        }
    }

    /// The file's bytes.
    pub(crate) fn encode(&self, format: Format, metadata: Option<&Metadata>) -> Vec<u8> {
        let (width, height) = (self.width as u32, self.height as u32);
        match format {
            Format::Png => {
                let code = |value: &f64| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
                eight_bits(width, height, ColorType::Grayscale, &self.values.iter().map(code).collect::<Vec<u8>>(), metadata)
            }
            // Grey as three equal channels, which every reader of EXR shows.
            Format::Exr => {
                let values = self.values.iter().map(|value| Vec3::splat(*value as f32));
                exr_file::encode((width, height), channels("", ["R", "G", "B"], values), metadata)
            }
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::scene::open_box::open_box;
    use crate::settings::RoomSettings;

    /// Walls of this illumination by face and texel.
    pub(crate) fn walls_of(scene: &RoomScene, texels: usize, of_texel: impl Fn(usize, usize) -> f64) -> Vec<WallEstimate> {
        let wall = |face: usize, name| {
            let illumination: Vec<f64> = (0..texels).map(|texel| of_texel(face, texel)).collect();
            let none = vec![0.0; texels];
            let (radiosity, irradiance) = (illumination.clone(), illumination.clone());
            WallEstimate { name, face, illumination, radiosity, irradiance, radiosity_error: none.clone(), irradiance_error: none }
        };
        scene.walls().map(|(face, described)| wall(face, described.name)).collect()
    }

    #[test]
    fn walls_stand_where_they_belong() {
        let scene = open_box(&RoomSettings::default());
        let walls = walls_of(&scene, 16, |face, _| 0.1 * (face + 1) as f64);
        let unfolded = unfolded(&scene, &walls);
        let at = |column: usize, row: usize| {
            let (i, j) = (column * WALL_PIXELS + WALL_PIXELS / 2, row * WALL_PIXELS + WALL_PIXELS / 2);
            (unfolded.values[j * unfolded.width + i] * 10.0).round() as usize
        };
        assert_eq!([at(0, 1), at(2, 1), at(1, 2), at(1, 0), at(1, 1), at(0, 0)], [1, 2, 3, 4, 5, 0]);

        // Straight in front, the back wall is in the middle, the floor below, the left wall left.
        let front = perspective(&scene, &illumination(&walls), VIEWS[0].1, 64);
        let at = |i: usize, j: usize| (front.values[j * 64 + i] * 10.0).round() as usize;
        assert_eq!([at(32, 32), at(8, 32), at(55, 32), at(32, 55), at(32, 8)], [5, 1, 2, 3, 4]);
    }

    #[test]
    fn an_exr_holds_the_values_untouched() {
        let picture = GreyImage { width: 2, height: 1, values: vec![0.125, 7.5] };
        let read =
            image::load_from_memory_with_format(&picture.encode(Format::Exr, None), image::ImageFormat::OpenExr).unwrap().into_rgb32f();
        assert_eq!(read.into_raw(), [0.125, 0.125, 0.125, 7.5, 7.5, 7.5]);
    }
}
