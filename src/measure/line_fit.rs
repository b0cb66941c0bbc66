//! A straight line through points by least squares.

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LineFit {
    pub slope: f64,
    pub intercept: f64,
    /// Standard error of the slope; not a number for two points, which any line fits.
    pub slope_error: f64,
}

impl LineFit {
    /// `None` without two points of different x.
    pub(crate) fn of(points: &[(f64, f64)]) -> Option<LineFit> {
        let count = points.len() as f64;
        let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), point| (x + point.0 / count, y + point.1 / count));
        let sum = |of: &dyn Fn(f64, f64) -> f64| points.iter().map(|point| of(point.0 - x, point.1 - y)).sum::<f64>();
        let spread = sum(&|x, _| x * x);
        let slope = sum(&|x, y| x * y) / spread;
        let left = sum(&|x, y| (y - slope * x).powi(2));
        (spread > 0.0).then(|| LineFit { slope, intercept: y - slope * x, slope_error: (left / (count - 2.0) / spread).sqrt() })
    }

    /// Through the logarithms of points above 0: the slope is the exponent of a power law.
    pub(crate) fn of_logarithms(points: &[(f64, f64)]) -> Option<LineFit> {
        LineFit::of(&points.iter().map(|(x, y)| (x.ln(), y.ln())).collect::<Vec<_>>())
    }

    pub(crate) fn at(&self, x: f64) -> f64 {
        self.intercept + self.slope * x
    }
}
