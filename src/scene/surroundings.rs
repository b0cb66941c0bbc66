//! Light from beyond a scene, in place of its own: an environment, a sun with its sky.

use std::path::PathBuf;
use std::sync::Arc;

use glam::Vec3;

use super::light::{Light, LightKind};
use super::sky::Sky;
use super::{Scene, daylight};
use crate::error::{Error, Result, require};

/// What is given instead of the scene's own; nothing by default.
#[derive(Debug, Clone, Default)]
pub struct Surroundings {
    pub environment: Option<Environment>,
    /// Azimuth and elevation of a sun, degrees clockwise from -z as seen from above and above the horizon. It comes with its clear sky
    /// unless there is an environment.
    pub sun: Option<[f64; 2]>,
    /// Turns the environment's picture about the vertical, degrees, counter-clockwise as seen from above.
    pub rotate: Option<f64>,
    /// Multiplies the environment's light, or that of the sun and its sky.
    pub strength: Option<f32>,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Environment {
    /// The same radiance from everywhere, W/m2/sr.
    Colour([f32; 3]),
    /// A picture of all directions, .hdr or .exr.
    Image(PathBuf),
}

const ENVIRONMENT: &str = "environment";
/// W/m2/sr. The power of a large scene under more is no number.
const MOST_RADIANCE: f32 = 1e30;

impl Surroundings {
    /// Refuses numbers that are not allowed, before a scene is read, which may take long.
    pub fn validate(&self) -> Result<()> {
        if let Some(degrees) = self.rotate {
            require(degrees.is_finite(), "environment_rotate", degrees, "must be finite")?;
        }
        if let Some(factor) = self.strength {
            require((0.0..=1e9).contains(&factor), "environment_strength", factor, "must be 0 to 1e9")?;
        }
        Ok(())
    }

    /// Puts them around a scene, and an even sky around one that nothing lights: then returns what is to be said of it.
    pub fn light(&self, scene: &mut Scene) -> Result<Option<&'static str>> {
        let is_lit = scene.is_lit() || self.environment.is_some() || self.sun.is_some();
        let own = match &self.environment {
            Some(Environment::Colour(radiance)) => Some(LightKind::Environment { radiance: Vec3::from(*radiance) }),
            Some(Environment::Image(path)) => {
                let sky = Sky::read(path).map_err(|reason| Error::setting(ENVIRONMENT, path.display(), reason))?;
                scene.warnings.extend(sky.warnings.iter().cloned());
                Some(LightKind::Sky(Arc::new(sky)))
            }
            None if self.sun.is_some() => self.sun.map(|[azimuth, elevation]| LightKind::Sky(Arc::new(daylight::sky(azimuth, elevation)))),
            None if !is_lit => Some(LightKind::Environment { radiance: Vec3::ONE }),
            None => None,
        };
        if let Some(kind) = own {
            scene.lights.retain(|light| !light.kind.is_environment());
            scene.lights.push(Light { name: ENVIRONMENT.into(), kind });
        }
        let is_of_sun = self.sun.is_some() && self.environment.is_none();
        let mut environment = scene.lights.iter_mut().map(|light| &mut light.kind).find(|kind| kind.is_environment());
        if let Some(degrees) = self.rotate {
            let reason = "turns a picture, and not the sky of `sun`; change the azimuth of `sun`";
            require(!is_of_sun, "environment_rotate", degrees, reason)?;
            let Some(LightKind::Sky(sky)) = &mut environment else {
                let reason = "turns a picture, and the environment is none; give `environment` FILE";
                return Err(Error::setting("environment_rotate", degrees, reason));
            };
            *sky = Arc::new(Sky::clone(sky).turned(degrees));
        }
        if let Some(factor) = self.strength {
            match &mut environment {
                Some(LightKind::Environment { radiance }) => *radiance *= factor,
                Some(LightKind::Sky(sky)) => Arc::make_mut(sky).strength *= factor,
                _ => {
                    let reason = "multiplies an environment, and there is none; give `environment`";
                    return Err(Error::setting("environment_strength", factor, reason));
                }
            }
        }
        let brightest = match environment {
            Some(LightKind::Environment { radiance }) => radiance.max_element(),
            Some(LightKind::Sky(sky)) => sky.brightest(),
            _ => 0.0,
        };
        require(brightest <= MOST_RADIANCE, ENVIRONMENT, brightest, format!("must be at most {MOST_RADIANCE:e} W/m2/sr"))?;
        if let Some([azimuth, elevation]) = self.sun {
            let mut kind = daylight::sun(azimuth, elevation);
            if let (true, Some(factor), LightKind::Directional { irradiance, .. }) = (is_of_sun, self.strength, &mut kind) {
                *irradiance *= factor;
            }
            scene.lights.push(Light { name: "sun".into(), kind });
        }
        Ok((!is_lit).then_some("nothing in this scene emits light; a sky of 1 W/m2/sr lights it (`environment` 0 for black)"))
    }
}
