//! Samples of tiles of a picture that have more than all pixels have.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::settings::tile_samples::{TILE, TileSamples};

/// Samples beyond those of all pixels, as the kernels read them (`glsl/world/scene/extra_samples.glsl`).
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct ExtraSamples {
    /// Of each pixel the first one and how many; the most samples of a pixel, and nothing; then the pixel of each, tile by tile. Empty where
    /// all have the same.
    pub table: Arc<Vec<u32>>,
    pub count: u32,
    /// Samples of a pixel, at most.
    pub most: u32,
}

impl ExtraSamples {
    /// Refuses more of them than a buffer holds, before they are listed.
    pub(crate) fn new(tiles: Option<&TileSamples>, samples: u32, (width, height): (u32, u32), buffer_bytes: u64) -> Result<ExtraSamples> {
        let Some(tiles) = tiles else { return Ok(ExtraSamples { most: samples, ..ExtraSamples::default() }) };
        let most = samples << tiles.most();
        let starts = |end: u32| (0..end).step_by(TILE as usize);
        let all_tiles = || starts(height).flat_map(|top| starts(width).map(move |left| (top, left)));
        let extra_of = |top: u32, left: u32| samples * ((1 << tiles.doublings(left, top)) - 1);
        let in_tile = |start: u32, end: u32| start..(start + TILE).min(end);
        let listed: u64 = all_tiles()
            .map(|(top, left)| (in_tile(top, height).len() * in_tile(left, width).len()) as u64 * u64::from(extra_of(top, left)))
            .sum();
        let words = 2 * u64::from(width) * u64::from(height) + 2 + listed;
        if words * size_of::<u32>() as u64 > buffer_bytes {
            let allowed = format!(
                "gives pixels {listed} samples more than all have, and a buffer of the device holds {buffer_bytes} bytes, 4 a sample; set fewer `samples`"
            );
            return Err(Error::setting("settings", "tiles", allowed));
        }
        let mut pixels = Vec::with_capacity(listed as usize);
        let mut table = vec![0; 2 * (width * height) as usize];
        for (top, left) in all_tiles() {
            let extra = extra_of(top, left);
            for (y, x) in in_tile(top, height).flat_map(|y| in_tile(left, width).map(move |x| (y, x))) {
                let pixel = y * width + x;
                table[2 * pixel as usize..][..2].copy_from_slice(&[pixels.len() as u32, extra]);
                pixels.resize(pixels.len() + extra as usize, pixel);
            }
        }
        let count = pixels.len() as u32;
        table.extend([most, 0].into_iter().chain(pixels));
        Ok(ExtraSamples { table: Arc::new(table), count, most })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of 6 x 5 pixels has tiles that are cut off.
    #[test]
    fn each_pixel_has_the_samples_of_its_tile() {
        let tiles = TileSamples::new(&[0, 3, 1, 0], (6, 5));
        assert_eq!((tiles.most(), tiles.counts()), (3, vec![2, 1, 0, 1]));
        assert!(tiles.check(2, (6, 5)).is_ok() && tiles.check(256, (6, 5)).is_err() && tiles.check(2, (9, 5)).is_err());
        // 60 words of pixels, 2 of the tables, 120 samples.
        let made = |bytes: u64| ExtraSamples::new(Some(&tiles), 2, (6, 5), bytes);
        assert!(made(4 * 182 - 1).unwrap_err().to_string().contains("120 samples more"));
        let extra = made(4 * 182).unwrap();
        // 2 x 4 pixels with 14 more, 4 x 1 with 2 more.
        assert_eq!((extra.count, extra.most), (8 * 14 + 4 * 2, 16));
        let (of_pixels, pixels) = extra.table.split_at(62);
        assert_eq!((of_pixels[60], pixels.len()), (16, 120));
        for pixel in 0..30u32 {
            let (first, count) = (of_pixels[2 * pixel as usize], of_pixels[2 * pixel as usize + 1]);
            let (x, y) = (pixel % 6, pixel / 6);
            assert_eq!(count, [[0, 14], [2, 0]][usize::from(y == 4)][usize::from(x >= 4)], "{x}, {y}");
            assert!((first..first + count).all(|sample| pixels[sample as usize] == pixel));
        }
        let text = serde_json::to_string(&tiles).unwrap();
        assert_eq!(text, r#"["03","10"]"#);
        assert_eq!(serde_json::from_str::<TileSamples>(&text).unwrap(), tiles);
    }
}
