//! What is shown, from the film to the window's pixels, without leaving the device.

use egui::FullOutput;
use glam::Vec4;

use crate::constants::SHOW_ERROR;
use crate::error::Result;
use crate::gpu::kernels::Display;
use crate::gpu::window::{Overlay, Presenter};
use crate::gpu::{Buffer, Commands, Extent, Gpu, Memory};
use crate::records::DisplayPush;

/// How values become colours.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Exposure {
    pub shows: u32,
    pub stops: f32,
    /// The paper's box has display values, which no curve changes.
    pub is_light: bool,
}

/// Buffers of one size of window and picture.
pub(crate) struct DisplayImage {
    pub size: [u32; 2],
    pub window: [u32; 2],
    /// Radiance, or the relative error; see `glsl/kernels/show_scene.comp`.
    pub shown: Buffer<Vec4>,
    pub pixels: Buffer<u32>,
}

impl DisplayImage {
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2], window: [u32; 2]) -> Result<DisplayImage> {
        let count = |size: [u32; 2]| u64::from(size[0]) * u64::from(size[1]);
        Ok(DisplayImage {
            size,
            window,
            shown: gpu.buffer("shown", count(size), Memory::Device)?,
            pixels: gpu.buffer("window pixels", count(window), Memory::Device)?,
        })
    }

    /// Records the pixels of the window, of which so many are one of the picture along each side.
    pub(crate) fn expose(&self, commands: &mut Commands, exposure: Exposure, zoom: u32, blue_first: bool) -> Result<()> {
        let push = DisplayPush {
            width: self.window[0],
            height: self.window[1],
            shown_width: self.size[0],
            shown_height: self.size[1],
            zoom,
            stops: exposure.stops,
            is_error: u32::from(exposure.shows == SHOW_ERROR),
            is_light: u32::from(exposure.is_light),
            blue_first: u32::from(blue_first),
        };
        let kernel = Display { shown: &self.shown, window_pixels: &self.pixels };
        commands.dispatch(kernel, &push, Extent::Items(u64::from(push.width) * u64::from(push.height)))
    }

    /// The window's pixels as they are, red first, for a file.
    pub(crate) fn codes(&self, commands: &mut Commands, blue_first: bool) -> Result<Vec<[u8; 3]>> {
        let count = u64::from(self.window[0]) * u64::from(self.window[1]);
        let words = commands.read(&self.pixels, count as usize)?;
        let code = |word: u32| {
            let [first, green, third, _] = word.to_le_bytes();
            if blue_first { [third, green, first] } else { [first, green, third] }
        };
        Ok(words.into_iter().map(code).collect())
    }

    /// Shows the pixels, which are written by now. `false`: the window has another size.
    pub(crate) fn present(&self, presenter: &mut Presenter, interface: &egui::Context, output: FullOutput) -> Result<bool> {
        let primitives = interface.tessellate(output.shapes, output.pixels_per_point);
        let overlay = Overlay { textures: output.textures_delta, primitives, pixels_per_point: output.pixels_per_point };
        presenter.present(&self.pixels, self.window, overlay)
    }
}
