//! What charts share: SVG that takes its text colour from the page around it.

use plotters::coord::Shift;
use plotters::prelude::*;

/// Lines of the scale; the page gives them its own colour.
pub const SCALE: RGBColor = RGBColor(0x99, 0x99, 0x98);

/// Size of letters.
pub const TEXT: u32 = 17;

pub type Drawn<T> = Result<T, DrawingAreaErrorKind<std::io::Error>>;

/// Whole decades around all values.
pub fn decades(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(low, high), value| (low.min(value), high.max(value)));
    let low = low.log10().floor();
    10f64.powf(low)..10f64.powf(high.log10().ceil().max(low + 1.0))
}

/// Draws, and makes the SVG fit for being part of a page: it scales with its box, and names no
/// address.
pub fn svg(size: (u32, u32), draw: impl FnOnce(&DrawingArea<SVGBackend, Shift>) -> Drawn<()>) -> String {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        draw(&area).and_then(|()| area.present()).expect("drawing into memory cannot fail");
    }
    text.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1).replacen("<svg ", "<svg role=\"img\" ", 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_end_on_decades() {
        assert_eq!(decades([2130.0, 105_640.0].into_iter()), 1e3..1e6);
        assert_eq!(decades([100.0].into_iter()), 1e2..1e3);
    }
}
