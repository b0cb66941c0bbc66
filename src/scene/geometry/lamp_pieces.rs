//! Triangles that emit by a texture, cut into pieces: each is chosen by how bright the texture is there, so that photons and shadow
//! rays find what is small and bright on a lamp.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use crate::scene::Texture;
use crate::scene::texture::Wrap;
use crate::scene::work;

/// A piece of a triangle: a quarter of it, or of another piece.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    /// Weights of the triangle's second and third corner at the piece's first.
    pub corner: DVec2,
    /// Of its edges over the triangle's: a power of two, negative in a piece that is turned by half a turn.
    pub width: f64,
}

/// Pieces beyond one per triangle, of all lamps together.
const MOST_CUTS: usize = 1 << 16;
/// No piece is cut in which the texture is nowhere so many times as bright as on the mean ..
const CONTRAST: f64 = 4.0;
/// .. or so many times where the piece has all of the texture, which most others then have too ..
const CONTRAST_OF_ALL: f64 = 64.0;
/// .. nor one that is smaller, in texels.
const LEAST_TEXELS: f64 = 0.25;
/// Weights of 32 bits are evenly spread over no much smaller one.
const LEAST_WIDTH: f64 = 1.0 / 16_384.0;

impl Piece {
    pub(super) const WHOLE: Piece = Piece { corner: DVec2::ZERO, width: 1.0 };

    fn quarters(self) -> [Piece; 4] {
        let half = 0.5 * self.width;
        let at = |u: f64, v: f64, width: f64| Piece { corner: self.corner + DVec2::new(u, v), width };
        [at(0.0, 0.0, half), at(half, 0.0, half), at(0.0, half, half), at(half, half, -half)]
    }

    /// What the piece's corners have, from what those of its triangle have.
    pub(super) fn corners(self, [a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
        let (ab, ac) = (b - a, c - a);
        let first = a + self.corner.x * ab + self.corner.y * ac;
        [first, first + self.width * ab, first + self.width * ac]
    }
}

/// How bright a texture is over a part of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Brightness {
    pub mean: DVec3,
    /// No sample is brighter.
    pub most: f64,
}

/// Sum of some texels, and the largest channel of all.
#[derive(Debug, Clone, Copy)]
struct Cell {
    sum: DVec3,
    most: f32,
}

impl Cell {
    const NONE: Cell = Cell { sum: DVec3::ZERO, most: 0.0 };

    fn of(texel: Vec3) -> Cell {
        Cell { sum: texel.as_dvec3(), most: texel.max_element() }
    }

    fn and(self, other: Cell) -> Cell {
        Cell { sum: self.sum + other.sum, most: self.most.max(other.most) }
    }
}

/// Cells of 2^level texels a side, row by row.
struct Level {
    columns: usize,
    cells: Vec<Cell>,
}

/// A texture that something emits by, with sums over its blocks.
pub(crate) struct EmissiveTexture<'a> {
    texture: &'a Texture,
    /// From cells of two texels a side to one of all texels.
    levels: Vec<Level>,
    pub all: Brightness,
}

impl<'a> EmissiveTexture<'a> {
    pub(super) fn new(texture: &'a Texture) -> EmissiveTexture<'a> {
        work::add(|| texture.texels.count());
        let mut levels: Vec<Level> = Vec::new();
        let (mut columns, mut rows) = (texture.width as usize, texture.height as usize);
        while levels.is_empty() || columns * rows > 1 {
            let below = levels.last();
            let (width, height) = (columns, rows);
            (columns, rows) = (width.div_ceil(2), height.div_ceil(2));
            let cell = |place: usize| {
                let (i, j) = (place % columns * 2, place / columns * 2);
                let own = (j..(j + 2).min(height)).flat_map(|j| (i..(i + 2).min(width)).map(move |i| j * width + i));
                own.map(|place| below.map_or_else(|| Cell::of(texture.texels.at(place).truncate()), |level| level.cells[place]))
                    .fold(Cell::NONE, Cell::and)
            };
            let cells = (0..columns * rows).into_par_iter().with_min_len(1 << 12).map(cell).collect();
            levels.push(Level { columns, cells });
        }
        let all = brightness(levels[levels.len() - 1].cells[0], texture.texels.count() as f64);
        EmissiveTexture { texture, levels, all }
    }

    /// Over the rectangle of texture coordinates that holds a triangle.
    fn over(&self, uvs: [DVec2; 3]) -> Brightness {
        let (low, high) = self.texels_of(uvs);
        // Beyond that a coordinate has no fraction left, and its place no meaning.
        if low.is_nan() || high.is_nan() || low.abs().max(high.abs()).max_element() > 1e15 {
            return self.all;
        }
        if (high - low).max_element() < 4.0 { self.near(low, high) } else { self.of_cells(low, high) }
    }

    /// The rectangle in texels, from the centre of the first, with the rounding of coordinates.
    fn texels_of(&self, uvs: [DVec2; 3]) -> (DVec2, DVec2) {
        let size = DVec2::new(f64::from(self.texture.width), f64::from(self.texture.height));
        let rounding = uvs.iter().fold(DVec2::ONE, |most, uv| most.max(uv.abs())) * size / 2f64.powi(21);
        let places = uvs.map(|uv| uv * size - 0.5);
        (places[0].min(places[1]).min(places[2]) - rounding, places[0].max(places[1]).max(places[2]) + rounding)
    }

    /// Exactly: samples are bilinear between the centres of texels, largest at corners, and on the mean that of the corners.
    fn near(&self, low: DVec2, high: DVec2) -> Brightness {
        let ends = |low: f64, high: f64| {
            let between = (low.floor() as i64 + 1..high.ceil() as i64).map(|place| place as f64);
            std::iter::once(low).chain(between).chain([high]).collect::<Vec<f64>>()
        };
        let (columns, rows) = (ends(low.x, high.x), ends(low.y, high.y));
        let size = DVec2::new(f64::from(self.texture.width), f64::from(self.texture.height));
        let sample = |x: f64, y: f64| self.texture.sample((DVec2::new(x, y) + 0.5) / size).truncate().as_dvec3();
        let share = |ends: &[f64], k: usize| {
            let before = if k > 0 { ends[k] - ends[k - 1] } else { 0.0 };
            let after = if k + 1 < ends.len() { ends[k + 1] - ends[k] } else { 0.0 };
            0.5 * (before + after) / (ends[ends.len() - 1] - ends[0])
        };
        let (mut mean, mut most) = (DVec3::ZERO, 0.0f64);
        for (j, y) in rows.iter().enumerate() {
            for (i, x) in columns.iter().enumerate() {
                let value = sample(*x, *y);
                mean += share(&columns, i) * share(&rows, j) * value;
                most = most.max(value.max_element());
            }
        }
        Brightness { mean, most }
    }

    /// From the smallest cells of which not too many lie there.
    fn of_cells(&self, low: DVec2, high: DVec2) -> Brightness {
        const MOST_CELLS: usize = 64;
        let [across, along] = self.texture.wrap;
        let columns = wrapped(across, low.x, high.x, self.texture.width);
        let rows = wrapped(along, low.y, high.y, self.texture.height);
        let cells = |spans: &[(usize, usize)], level: usize| {
            spans.iter().map(|(first, last)| (last >> level) - (first >> level) + 1).sum::<usize>()
        };
        let level = (1..self.levels.len()).find(|level| cells(&columns, *level) * cells(&rows, *level) <= MOST_CELLS);
        let level = level.unwrap_or(self.levels.len());
        let Level { columns: stride, cells } = &self.levels[level - 1];
        let (mut sum, mut count) = (Cell::NONE, 0);
        for (top, bottom) in rows {
            for j in top >> level..=bottom >> level {
                for (left, right) in &columns {
                    for i in left >> level..=right >> level {
                        sum = sum.and(cells[j * stride + i]);
                        let side = |place: usize, size: u32| (size as usize - (place << level)).min(1 << level);
                        count += side(i, self.texture.width) * side(j, self.texture.height);
                    }
                }
            }
        }
        brightness(sum, count as f64)
    }
}

fn brightness(cell: Cell, count: f64) -> Brightness {
    Brightness { mean: cell.sum / count, most: f64::from(cell.most) }
}

/// The first and last texels of the parts of a row that samples from `low` to `high` come from.
fn wrapped(wrap: Wrap, low: f64, high: f64, size: u32) -> Vec<(usize, usize)> {
    let (first, last, size) = (low.floor() as i64, high.floor() as i64 + 1, i64::from(size));
    let all = vec![(0, size as usize - 1)];
    if wrap == Wrap::Clamp {
        return vec![(first.clamp(0, size - 1) as usize, last.clamp(0, size - 1) as usize)];
    }
    if last - first + 1 >= size {
        return all;
    }
    // Of a picture and its mirror image beside it, which repeat together.
    let period = if wrap == Wrap::Repeat { size } else { 2 * size };
    let (first, last) = (first.rem_euclid(period), last.rem_euclid(period));
    let fold = |place: i64| place.min(2 * size - 1 - place) as usize;
    if wrap == Wrap::Repeat {
        return if first <= last {
            vec![(first as usize, last as usize)]
        } else {
            vec![(0, last as usize), (first as usize, size as usize - 1)]
        };
    }
    let (near, far) = (fold(first).min(fold(last)), fold(first).max(fold(last)));
    match (first < size, last < size) {
        (true, true) | (false, false) => vec![(near, far)],
        (true, false) => vec![(near, size as usize - 1)],
        (false, true) => vec![(0, far)],
    }
}

/// A triangle that emits by a texture.
pub(crate) struct Lamp<'a> {
    pub emissive: &'a EmissiveTexture<'a>,
    pub uvs: [DVec2; 3],
    /// Of the whole triangle, texture left out.
    pub flux: f64,
}

impl Lamp<'_> {
    fn of(&self, piece: Piece) -> Brightness {
        let [a, b, c] = piece.corners(self.uvs.map(|uv| uv.extend(0.0))).map(DVec3::truncate);
        self.emissive.over([a, b, c])
    }

    fn is_worth_cutting(&self, piece: Piece, brightness: &Brightness) -> bool {
        let (low, high) = self.emissive.texels_of(self.uvs);
        let texels = piece.width.abs() * (high - low);
        let Texture { width, height, .. } = *self.emissive.texture;
        let has_all = texels.x >= f64::from(width) && texels.y >= f64::from(height);
        brightness.most > if has_all { CONTRAST_OF_ALL } else { CONTRAST } * brightness.mean.max_element()
            && texels.max_element() > LEAST_TEXELS
            && piece.width.abs() > LEAST_WIDTH
    }
}

/// A piece that may be cut.
struct Open {
    /// By how much its light may be more than it seems.
    priority: f64,
    lamp: usize,
    piece: Piece,
    brightness: Brightness,
}

impl PartialEq for Open {
    fn eq(&self, other: &Open) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Open) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Open) -> Ordering {
        self.priority.total_cmp(&other.priority).then(other.lamp.cmp(&self.lamp))
    }
}

/// Pieces of each lamp, with the brightness of each.
pub(crate) struct Cut {
    pub pieces: Vec<Vec<(Piece, Brightness)>>,
    /// Pieces with spots much brighter than their mean, of which there were too many to cut all.
    pub left: usize,
}

/// Cuts lamps where their brightness differs most, those first that emit most; a lamp that needs no cut is whole.
pub(crate) fn cut(lamps: &[Lamp]) -> Cut {
    let open = |lamp: usize, piece: Piece, brightness: Brightness| {
        let priority = lamps[lamp].flux * piece.width * piece.width * (brightness.most - brightness.mean.max_element());
        Open { priority, lamp, piece, brightness }
    };
    let wholes: Vec<Brightness> = lamps.par_iter().map(|lamp| lamp.of(Piece::WHOLE)).collect();
    let mut pieces: Vec<Vec<(Piece, Brightness)>> = vec![Vec::new(); lamps.len()];
    let mut queue: BinaryHeap<Open> = wholes.into_iter().enumerate().map(|(lamp, whole)| open(lamp, Piece::WHOLE, whole)).collect();
    let (mut cuts, mut left) = (0, 0);
    while let Some(Open { lamp, piece, brightness, .. }) = queue.pop() {
        let is_worth_cutting = lamps[lamp].is_worth_cutting(piece, &brightness);
        if cuts + 3 > MOST_CUTS || !is_worth_cutting {
            left += usize::from(is_worth_cutting && brightness.most > CONTRAST_OF_ALL * brightness.mean.max_element());
            pieces[lamp].push((piece, brightness));
            continue;
        }
        cuts += 3;
        queue.extend(piece.quarters().map(|quarter| open(lamp, quarter, lamps[lamp].of(quarter))));
    }
    Cut { pieces, left }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::mix32;

    /// Mostly dark, with one texel in so many bright.
    fn speckled(width: u32, height: u32, one_in: u32, wrap: Wrap) -> Texture {
        let texel = |k: u32| if mix32(k).is_multiple_of(one_in) { Vec3::new(700.0, 0.5, 31.0) } else { Vec3::splat(0.1) };
        let texels = (0..width * height).map(texel).collect::<Vec<_>>().into();
        Texture { name: "speckled".into(), width, height, texels, wrap: [wrap; 2], filter: Default::default() }
    }

    /// Pieces cover their triangle once, no sample of one is brighter than it says, and all together are about as bright.
    #[test]
    fn pieces_are_as_bright_as_they_say() {
        let uvs = [DVec2::new(-0.3, 0.2), DVec2::new(1.9, 0.4), DVec2::new(0.3, 2.7)];
        for wrap in [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::Clamp] {
            for (width, height, one_in) in [(61, 37, 300), (1, 1, 1), (64, 9, 100), (2, 8, 7)] {
                let texture = speckled(width, height, one_in, wrap);
                let emissive = EmissiveTexture::new(&texture);
                let Cut { pieces, left } = cut(&[Lamp { emissive: &emissive, uvs, flux: 1.0 }]);
                assert_eq!(left, 0);
                let area: f64 = pieces[0].iter().map(|(piece, _)| piece.width * piece.width).sum();
                assert_eq!(area, 1.0, "{wrap:?} {width} x {height}");
                let (mut said, mut found) = (0.0, 0.0);
                for (number, (piece, brightness)) in pieces[0].iter().enumerate() {
                    let [a, b, c] = piece.corners(uvs.map(|uv| uv.extend(0.0))).map(DVec3::truncate);
                    let random = |k: usize| f64::from(mix32((number * 64 + k) as u32)) / 2f64.powi(32);
                    for k in 0..32 {
                        let (u, v) = (random(2 * k), random(2 * k + 1));
                        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                        let sample = texture.sample(a + u * (b - a) + v * (c - a)).truncate().as_dvec3();
                        assert!(
                            sample.max_element() <= (1.0 + 1e-6) * brightness.most,
                            "{wrap:?} {width} x {height}: {sample} in {piece:?}, {brightness:?}"
                        );
                        found += sample.x * piece.width * piece.width / 32.0;
                    }
                    said += brightness.mean.x * piece.width * piece.width;
                }
                assert!((0.5..2.0).contains(&(said / found)), "{wrap:?} {width} x {height}: {said} for {found}");
            }
        }
    }

    /// A texel among a million gets its share, and even light needs no pieces.
    #[test]
    fn a_bright_texel_has_a_piece_of_its_own() {
        let mut texels = vec![Vec3::ONE; 1 << 20];
        let even = Texture { texels: texels.clone().into(), ..speckled(1024, 1024, 1, Wrap::Clamp) };
        let uvs = [DVec2::ZERO, DVec2::X, DVec2::Y];
        let cut_one = |texture: &Texture| cut(&[Lamp { emissive: &EmissiveTexture::new(texture), uvs, flux: 1.0 }]);
        assert_eq!(cut_one(&even).pieces[0].len(), 1);
        texels[300 * 1024 + 200] = Vec3::splat(1e4);
        let Cut { pieces, .. } = cut_one(&Texture { texels: texels.into(), ..even });
        let share = |(piece, brightness): &(Piece, Brightness)| brightness.mean.x * piece.width * piece.width;
        let all: f64 = pieces[0].iter().map(share).sum();
        let bright: f64 = pieces[0].iter().filter(|(piece, _)| piece.width.abs() < 1.0 / 256.0).map(share).sum();
        // Half of the texture is on the triangle, so 1e4 of 5.3e5.
        assert!(pieces[0].len() < 400 && (bright / all / (1e4 / 5.3e5) - 1.0).abs() < 0.2, "{} pieces, {}", pieces[0].len(), bright / all);
    }

    #[test]
    fn what_is_too_much_to_cut_is_counted() {
        let texture = speckled(1024, 1024, 100, Wrap::Clamp);
        let emissive = EmissiveTexture::new(&texture);
        let lamp = || Lamp { emissive: &emissive, uvs: [DVec2::ZERO, DVec2::X, DVec2::Y], flux: 1.0 };
        let Cut { pieces, left } = cut(&[lamp(), lamp()]);
        let count = pieces.iter().map(Vec::len).sum::<usize>();
        assert!(left > 1000 && count <= MOST_CUTS + 2 && count > MOST_CUTS - 3, "{left} of {count}");
    }
}
