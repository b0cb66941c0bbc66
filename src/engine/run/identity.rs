//! What a run computes, whoever does it: runs of one identity leave the same bits of the same blocks, so that their sums may be added.

use bytemuck::Pod;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};

use crate::gpu::DeviceFacts;
use crate::settings::Math;
use crate::text::one_line;

/// By default that of a run that nobody has to know again.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Identity {
    /// What the scene is called; another name makes no other identity.
    pub scene: String,
    /// Hash of all that is lit, of the camera, or of the points that are asked about.
    pub content: String,
    /// All settings that change bits of a block.
    pub settings: Map<String, Value>,
    /// Hash of what the run found out before its first block.
    pub plan: String,
    /// The device and its driver where they decide the last bits; `None` with strict arithmetic.
    pub device: Option<String>,
}

/// Settings that change no bit of a block.
const WITHOUT_EFFECT: [&str; 9] = ["rounds", "stop", "keeps_parts", "builder", "chunk", "group_size", "paranoid", "counters", "threads"];

/// Settings of either world that change bits of a block.
pub(crate) fn settings_with_effect(settings: &impl Serialize) -> Map<String, Value> {
    let Ok(Value::Object(mut settings)) = serde_json::to_value(settings) else { unreachable!("settings are an object") };
    WITHOUT_EFFECT.iter().for_each(|name| drop(settings.remove(*name)));
    settings
}

impl Identity {
    /// `settings` are those of either world.
    pub(crate) fn new(
        scene: &str,
        content: Hash,
        settings: &impl Serialize,
        plan: Hash,
        device: Option<&DeviceFacts>,
        math: Math,
    ) -> Identity {
        let settings = settings_with_effect(settings);
        let device = match (math, device) {
            (Math::Strict, _) => None,
            (Math::Fast, Some(facts)) => Some(format!("{}, {}", facts.name, facts.driver)),
            (Math::Fast, None) => Some("cpu".to_owned()),
        };
        Identity { scene: scene.to_owned(), content: content.finish(), settings, plan: plan.finish(), device }
    }

    /// Why a file of `other` does not go with this, if it does not: what differs, and the remedy.
    pub(crate) fn differs_from(&self, other: &Identity) -> Option<String> {
        let names = self.settings.keys().chain(other.settings.keys().filter(|name| !self.settings.contains_key(*name)));
        let value = |identity: &Identity, name: &str| match identity.settings.get(name) {
            None => "nothing".to_owned(),
            Some(Value::Null) => "as usual".to_owned(),
            Some(value) => value.to_string(),
        };
        for name in names {
            let (own, others) = (value(self, name), value(other, name));
            if own != others {
                return Some(format!("is of a run with {} {others}, not {own}", name.replace('_', "-")));
            }
        }
        if self.content != other.content {
            return Some(format!("is of another scene, view or photon map ({})", other.scene));
        }
        if self.device != other.device {
            let name = |identity: &Identity| one_line(&identity.device.clone().unwrap_or_default());
            let remedy = "devices of different makes need `math` strict in all parts of a run";
            return Some(format!("is of {}, not of {}; {remedy}", name(other), name(self)));
        }
        let otherwise = "was planned otherwise, as another version or driver does, or more than 65536 rounds; begin the run anew";
        (self.plan != other.plan).then(|| otherwise.to_owned())
    }
}

/// Of what is compared as a whole.
#[derive(Default)]
pub(crate) struct Hash(Sha256);

impl Hash {
    pub(crate) fn add<T: Pod>(&mut self, values: &[T]) {
        self.0.update((values.len() as u64).to_le_bytes());
        self.0.update(bytemuck::cast_slice::<T, u8>(values));
    }

    /// Numbers as text, which has all their digits.
    pub(crate) fn add_text(&mut self, text: &str) {
        self.add(text.as_bytes());
    }

    pub(crate) fn finish(self) -> String {
        self.0.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::scene::SceneSettings;

    #[test]
    fn identities_say_what_differs() {
        let identity = |settings: &SceneSettings, text: &str| {
            let mut content = Hash::default();
            content.add_text(text);
            Identity::new("a scene", content, settings, Hash::default(), None, settings.math)
        };
        let usual = SceneSettings::default();
        let of = |settings: &SceneSettings, text: &str| identity(&usual, "room").differs_from(&identity(settings, text));
        assert_eq!(of(&SceneSettings { rounds: 99, chunk: Some(7), ..usual.clone() }, "room"), None);
        let fewer = of(&SceneSettings { caustic_photons: 77, ..usual.clone() }, "room").unwrap();
        assert!(fewer.contains("caustic-photons 77, not 131072"), "{fewer}");
        assert!(of(&usual, "another").unwrap().contains("another scene"));
        let strict = of(&SceneSettings { math: Math::Strict, ..usual.clone() }, "room").unwrap();
        assert!(strict.contains("math \"strict\", not \"fast\""), "{strict}");
    }
}
