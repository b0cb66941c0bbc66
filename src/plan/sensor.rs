//! What light is asked of: a camera's picture, or points.

use serde::{Deserialize, Serialize};

/// What light is asked of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Sensor {
    /// A camera's picture.
    Picture { width: u32, height: u32 },
    /// Irradiance at points; of a phase's many points one set is asked each round.
    Receivers { count: u32 },
}

impl Sensor {
    pub(crate) fn pixels(self) -> u32 {
        match self {
            Sensor::Picture { width, height } => width.saturating_mul(height),
            Sensor::Receivers { count } => count,
        }
    }

    /// Width and height of a picture; receivers have none.
    pub(crate) fn size(self) -> (u32, u32) {
        match self {
            Sensor::Picture { width, height } => (width, height),
            Sensor::Receivers { .. } => (0, 0),
        }
    }
}
