//! How the errors of a result's values add up to one number: the root of a mean square, relative to the result's light.

use crate::settings::stop::Measure;

/// Of the mean, what [`Measure::RelMse`] adds to each value: a value far below the mean counts like one of a hundredth of it.
pub(crate) const REL_MSE_EPSILON: f64 = 0.01;

/// What an error of a value adds, in a result of so many values with this mean.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ErrorMeasure {
    measure: Measure,
    values: f64,
    mean: f64,
}

impl ErrorMeasure {
    /// Of values whose sum is known; `values` is how many there are, a share of one where a pixel shows little of them.
    pub(crate) fn new(measure: Measure, values: f64, sum: f64) -> ErrorMeasure {
        let values = values.max(f64::MIN_POSITIVE);
        ErrorMeasure { measure, values, mean: sum / values }
    }

    /// The root of what an absolute error adds to the square of the relative one, at a value; infinite where all is black.
    pub(crate) fn relative(&self, error: f64, value: f64) -> f64 {
        if error == 0.0 {
            return 0.0;
        }
        let scale = match self.measure {
            Measure::Rmse => self.mean,
            Measure::RelMse => value.hypot(REL_MSE_EPSILON * self.mean),
        };
        if scale > 0.0 { error / (scale * self.values.sqrt()) } else { f64::INFINITY }
    }

    /// The same of an error that may be of any value: that of the mean.
    pub(crate) fn relative_to_mean(&self, error: f64) -> f64 {
        self.relative(error, self.mean)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_add_up_to_their_formulas() {
        let (values, errors) = ([1.0, 2.0, 0.0, 5.0], [0.1, 0.2, 0.3, 0.4]);
        let of = |measure| {
            let measure = ErrorMeasure::new(measure, 4.0, values.iter().sum());
            errors.iter().zip(values).map(|(error, value)| measure.relative(*error, value).powi(2)).sum::<f64>().sqrt()
        };
        let mean_square = errors.iter().map(|error| error * error).sum::<f64>() / 4.0;
        assert!((of(Measure::Rmse) - mean_square.sqrt() / 2.0).abs() < 1e-12);
        let relative = errors.iter().zip(values).map(|(error, value)| error * error / (value * value + 0.0004)).sum::<f64>() / 4.0;
        assert!((of(Measure::RelMse) - relative.sqrt()).abs() < 1e-12);
        let black = ErrorMeasure::new(Measure::Rmse, 4.0, 0.0);
        assert_eq!((black.relative(0.0, 0.0), black.relative(1.0, 0.0)), (0.0, f64::INFINITY));
    }
}
