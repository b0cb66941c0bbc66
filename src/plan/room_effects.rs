//! Which effects a run of the paper's box simulates, and why: an effect that the scene cannot show costs nothing.

use serde::Serialize;

use crate::scene::room::RoomScene;
use crate::settings::RoomSettings;

#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct Decision {
    pub effect: &'static str,
    pub kept: bool,
    pub reason: String,
}

pub(crate) fn decide(scene: &RoomScene, settings: &RoomSettings, equal_flux: bool) -> Vec<Decision> {
    let glossy: Vec<&str> = scene.walls().filter(|(_, wall)| wall.shininess.is_some()).map(|(_, wall)| wall.name).collect();
    let reflects = scene.walls().any(|(_, wall)| wall.albedo > 0.0);
    vec![
        Decision {
            effect: "Phong weights",
            kept: !glossy.is_empty(),
            reason: match glossy.as_slice() {
                [] => "every wall is Lambertian".to_owned(),
                names => format!("glossy: {}", names.join(", ")),
            },
        },
        Decision {
            effect: "a separate sum of flux",
            kept: !glossy.is_empty() || !equal_flux,
            reason: match (glossy.is_empty(), equal_flux) {
                (false, _) => "Phong weights are not flux".to_owned(),
                (true, false) => "photons of different lights carry different flux".to_owned(),
                (true, true) => "every photon carries the same flux and counts as one".to_owned(),
            },
        },
        Decision {
            effect: "indirect light",
            kept: reflects && settings.bounces > 1,
            reason: match (reflects, settings.bounces) {
                (false, _) => "no wall reflects".to_owned(),
                (true, 1) => "one bounce was asked for".to_owned(),
                (true, bounces) => format!("walls reflect, up to {bounces} bounces"),
            },
        },
    ]
}
