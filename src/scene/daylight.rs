//! The sun in a clear sky: the analytic sky of Hosek and Wilkie (2012) at turbidity 3, and the sun's illuminance by the Illuminating
//! Engineering Society's formula for clear days (Recommended practice for the calculation of daylight availability, 1984).

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec3, Vec3};
use hw_skymodel::rgb::{Channel, SkyParams, SkyState};

use super::light::{LUMENS_PER_WATT, LightKind};
use super::sky::Sky;

/// Of a clear day, and of ground such as grass.
const TURBIDITY: f32 = 3.0;
const GROUND_ALBEDO: f32 = 0.2;
/// Lux beyond the atmosphere, and the optical depth of the air above.
const SOLAR_ILLUMINANCE: f64 = 127_500.0;
const EXTINCTION: f64 = 0.21;
const WIDTH: u32 = 512;
const HEIGHT: u32 = 256;

/// Unit, towards the sun; degrees, clockwise from -z as seen from above, and above the horizon.
fn towards_sun(azimuth: f64, elevation: f64) -> DVec3 {
    let ((sin_azimuth, cos_azimuth), (height, flat)) = (azimuth.to_radians().sin_cos(), elevation.to_radians().sin_cos());
    DVec3::new(flat * sin_azimuth, height, -flat * cos_azimuth)
}

/// The sun alone, white, in W/m2 of 683 lm.
pub(crate) fn sun(azimuth: f64, elevation: f64) -> LightKind {
    let towards = towards_sun(azimuth, elevation);
    let illuminance = SOLAR_ILLUMINANCE * (-EXTINCTION / towards.y.max(1e-3)).exp();
    LightKind::Directional { direction: -towards, irradiance: Vec3::splat(illuminance as f32 / LUMENS_PER_WATT) }
}

/// The sky without the sun, and below the horizon ground that the sun and the sky light.
pub(crate) fn sky(azimuth: f64, elevation: f64) -> Sky {
    let towards = towards_sun(azimuth, elevation);
    let params =
        SkyParams { elevation: elevation.to_radians().clamp(0.0, FRAC_PI_2) as f32, turbidity: TURBIDITY, albedo: [GROUND_ALBEDO; 3] };
    let model = SkyState::new(&params).expect("its parameters are in range");
    let direction = |i: u32, j: u32| {
        let (turn, angle) = (TAU * ((f64::from(i) + 0.5) / f64::from(WIDTH) - 0.5), PI * (f64::from(j) + 0.5) / f64::from(HEIGHT));
        DVec3::new(angle.sin() * turn.cos(), angle.cos(), angle.sin() * turn.sin())
    };
    let above = |i: u32, j: u32| {
        let direction = direction(i, j);
        let (theta, gamma) = (direction.y.clamp(-1.0, 1.0).acos() as f32, direction.angle_between(towards) as f32);
        Vec3::from([Channel::R, Channel::G, Channel::B].map(|channel| model.radiance(theta, gamma, channel).max(0.0)))
    };
    let rows = HEIGHT / 2;
    let mut colours: Vec<Vec3> = (0..rows).flat_map(|j| (0..WIDTH).map(move |i| (i, j))).map(|(i, j)| above(i, j)).collect();
    let texel = |j: u32| TAU / f64::from(WIDTH) * PI / f64::from(HEIGHT) * (PI * (f64::from(j) + 0.5) / f64::from(HEIGHT)).sin();
    let of_sky: DVec3 = (0..rows)
        .flat_map(|j| (0..WIDTH).map(move |i| (i, j)))
        .zip(&colours)
        .map(|((i, j), colour)| texel(j) * direction(i, j).y * colour.as_dvec3())
        .sum();
    let LightKind::Directional { irradiance, .. } = sun(azimuth, elevation) else { unreachable!("the sun is far") };
    let ground = f64::from(GROUND_ALBEDO) / PI * (of_sky + towards.y * irradiance.as_dvec3());
    colours.resize((WIDTH * HEIGHT) as usize, ground.as_vec3());
    Sky::of("clear sky", WIDTH, HEIGHT, colours)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Diffuse illuminance of a horizontal surface under a clear sky is 5 to 25 klx, and 30 to 110 klx with the sun (the IES's
    /// practice, as above); the sky is blue, and brightest about the sun.
    #[test]
    fn clear_skies_are_as_bright_as_measured_ones() {
        for elevation in [10.0, 30.0, 60.0, 90.0] {
            let sky = sky(120.0, elevation);
            let mut horizontal = DVec3::ZERO;
            for (i, j) in (0..64).flat_map(|j| (0..256).map(move |i| (i, j))) {
                let (angle, turn) = (FRAC_PI_2 * (f64::from(j) + 0.5) / 64.0, TAU * f64::from(i) / 256.0);
                let direction = DVec3::new(angle.sin() * turn.cos(), angle.cos(), angle.sin() * turn.sin());
                horizontal += angle.sin() * angle.cos() * FRAC_PI_2 / 64.0 * TAU / 256.0 * sky.radiance(direction);
            }
            let lux = |colour: DVec3| f64::from(LUMENS_PER_WATT) * colour.dot(DVec3::new(0.2126, 0.7152, 0.0722));
            assert!((5e3..25e3).contains(&lux(horizontal)), "{elevation} degrees: {horizontal}");
            assert!(horizontal.z > 1.2 * horizontal.x);
            let LightKind::Directional { direction, irradiance } = sun(120.0, elevation) else { panic!("the sun is far") };
            assert!((direction.y + elevation.to_radians().sin()).abs() < 1e-12);
            let all = lux(horizontal - direction.y * irradiance.as_dvec3());
            assert!(elevation < 30.0 || (45e3..130e3).contains(&all), "{elevation} degrees: {all} lx");
            let near = sky.radiance(-direction);
            assert!(
                elevation > 80.0 || lux(near) > 2.0 * lux(sky.radiance(DVec3::new(direction.x, 0.3, direction.z).normalize())),
                "{near}"
            );
            // Ground that sees all of that returns a fifth.
            assert!((lux(sky.radiance(DVec3::NEG_Y)) * PI / (0.2 * all) - 1.0).abs() < 0.05);
        }
    }

    #[test]
    fn the_sun_stands_where_it_is_put() {
        for (azimuth, elevation, expected) in
            [(0.0, 0.0, DVec3::NEG_Z), (90.0, 0.0, DVec3::X), (180.0, 45.0, DVec3::new(0.0, 0.5f64.sqrt(), 0.5f64.sqrt()))]
        {
            assert!(towards_sun(azimuth, elevation).distance(expected) < 1e-12);
        }
    }
}
