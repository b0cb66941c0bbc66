//! The paper's box: photons stored for each one emitted, by every builder.

use super::{Case, Estimate};
use crate::engine::Control;
use crate::engine::room::{self};
use crate::rng::Rng;
use crate::scene::open_box::open_box;
use crate::settings::{Builder, EmissionLaw, RoomSettings};

/// Photons stored at 1 to 15 bounces for each one emitted, lights of equal intensity and Lambertian ones: the
/// radiosity recursion g_(k+1) = K g_k with exact form factors.
const STORED_UNIFORM: f64 = 1.502_371;
const STORED_COSINE: f64 = 1.542_715;
/// Standard deviation of the number stored of one photon.
const DEVIATION: f64 = 2.0;
const PHOTONS: u32 = 1 << 20;

pub(super) fn cases() -> Vec<Case> {
    let laws = [(EmissionLaw::Uniform, STORED_UNIFORM), (EmissionLaw::Cosine, STORED_COSINE)];
    Builder::ALL.into_iter().flat_map(|builder| laws.map(|(law, expected)| case(builder, law, expected))).collect()
}

fn case(builder: Builder, emission: EmissionLaw, expected: f64) -> Case {
    let settings = RoomSettings { builder, emission, photons: PHOTONS, rng: Rng::Philox, mesh: 1, ..RoomSettings::default() };
    let law = format!("{emission:?}").to_lowercase();
    Case {
        name: format!("open box, {} builder, {law} lights: hits stored per photon", builder.name()),
        expected,
        on_gpu: builder != Builder::Cpu,
        measure: Box::new(move |gpu| {
            let result = room::run(gpu, &open_box(&settings), &settings, &mut Control::default())?;
            let emitted = f64::from(PHOTONS);
            Ok(Estimate { mean: result.ledger().stored as f64 / emitted, standard_error: DEVIATION / emitted.sqrt() })
        }),
    }
}
