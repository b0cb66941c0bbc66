//! The pose of nodes at a time of the file's first animation (glTF 2.0, section 3.11 and appendix C).

use std::collections::HashMap;

use glam::{DMat4, DQuat, DVec3, DVec4};
use gltf::animation::{Interpolation, Property};
use gltf::{Accessor, Document};

use super::accessor::{self, Vertices};
use super::transforms::{self, Transform};
use super::{Loader, called, node_name};
use crate::error::{Error, Result};

/// What an animation says of a node.
#[derive(Default)]
pub(super) struct Pose {
    translation: Option<DVec3>,
    rotation: Option<DQuat>,
    scale: Option<DVec3>,
    pub(super) weights: Option<Vec<f32>>,
    /// By how much single precision has moved its places, along each axis.
    pub(super) rounding: DVec3,
}

impl Pose {
    /// With what the node has at rest where the animation says nothing.
    pub(super) fn matrix(&self, rest: &Transform) -> DMat4 {
        let (scale, rotation, translation) = rest.parts();
        DMat4::from_scale_rotation_translation(
            self.scale.unwrap_or(scale),
            self.rotation.unwrap_or(rotation),
            self.translation.unwrap_or(translation),
        )
    }
}

/// Times, and for each its values: with a tangent before and behind them where the interpolation is cubic.
struct Keys {
    times: Vec<f64>,
    values: Vec<f64>,
    /// Values of one key, tangents left out.
    width: usize,
    interpolation: Interpolation,
}

impl Keys {
    /// Which part of a key, from 0 to 2 where it has tangents.
    fn part(&self, key: usize, part: usize) -> &[f64] {
        let first = match self.interpolation {
            Interpolation::CubicSpline => (3 * key + part) * self.width,
            _ => key * self.width,
        };
        &self.values[first..first + self.width]
    }

    fn value(&self, key: usize) -> &[f64] {
        self.part(key, 1)
    }

    /// Before the first key its value, behind the last one that of the last.
    fn at(&self, time: f64, is_rotation: bool) -> Vec<f64> {
        let next = self.times.partition_point(|key| *key <= time);
        if next == 0 || next == self.times.len() {
            return self.value(next.saturating_sub(1)).to_vec();
        }
        let (before, span) = (next - 1, self.times[next] - self.times[next - 1]);
        let share = (time - self.times[before]) / span;
        let pairs = self.value(before).iter().zip(self.value(next));
        match self.interpolation {
            Interpolation::Step => self.value(before).to_vec(),
            Interpolation::Linear if is_rotation => {
                let quaternion = |values: &[f64]| DQuat::from_slice(values).normalize();
                quaternion(self.value(before)).slerp(quaternion(self.value(next)), share).to_array().to_vec()
            }
            Interpolation::Linear => pairs.map(|(a, b)| a + share * (b - a)).collect(),
            Interpolation::CubicSpline => {
                let (s, s2, s3) = (share, share * share, share.powi(3));
                let tangents = self.part(before, 2).iter().zip(self.part(next, 0));
                let hermite = |((a, b), (out, into)): ((&f64, &f64), (&f64, &f64))| {
                    (2.0 * s3 - 3.0 * s2 + 1.0) * a + (3.0 * s2 - 2.0 * s3) * b + span * ((s3 - 2.0 * s2 + s) * out + (s3 - s2) * into)
                };
                pairs.zip(tangents).map(hermite).collect()
            }
        }
    }
}

impl Loader {
    /// Poses of the nodes that the first animation moves, by their numbers.
    pub(super) fn read_poses(&self, document: &Document, time: f64) -> Result<HashMap<usize, Pose>> {
        let Some(animation) = document.animations().next() else {
            return Err(Error::setting("at", time, "is a time of an animation, and the file has none; leave `at` out"));
        };
        let name = called("animation", animation.name(), animation.index());
        let mut poses: HashMap<usize, Pose> = HashMap::new();
        for channel in animation.channels() {
            let node = channel.target().node();
            let what = format!("{name}, channel {} of {}", channel.index(), node_name(&node));
            let keys = |width: usize| self.keys(&channel.sampler(), width, &what);
            let pose = poses.entry(node.index()).or_default();
            match channel.target().property() {
                Property::Translation => {
                    let keys = keys(3)?;
                    let places: Vec<DVec3> = (0..keys.times.len()).map(|key| DVec3::from_slice(keys.value(key))).collect();
                    pose.rounding = transforms::most_rounding(&channel.sampler().output(), &places);
                    pose.translation = Some(DVec3::from_slice(&keys.at(time, false)));
                }
                Property::Scale => pose.scale = Some(DVec3::from_slice(&keys(3)?.at(time, false))),
                Property::Rotation => {
                    let keys = keys(4)?;
                    let is_turn = (0..keys.times.len()).all(|key| DVec4::from_slice(keys.value(key)).length_squared() > 0.25);
                    self.require(is_turn, &what, || "has a rotation that is no unit quaternion".into())?;
                    pose.rotation = Some(DQuat::from_slice(&keys.at(time, true)).normalize());
                }
                Property::MorphTargetWeights => {
                    let targets = node.mesh().and_then(|mesh| mesh.primitives().next()).map_or(0, |of| of.morph_targets().len());
                    self.require(targets > 0, &what, || "animates morph targets of a node that has none".into())?;
                    pose.weights = Some(keys(targets)?.at(time, false).into_iter().map(|weight| weight as f32).collect());
                }
            }
        }
        Ok(poses)
    }

    fn keys(&self, sampler: &gltf::animation::Sampler, width: usize, what: &str) -> Result<Keys> {
        let times: Vec<f64> = accessor::read(self, &sampler.input(), &Vertices::All, what, |[time]: [f32; 1]| f64::from(time))?;
        self.require(!times.is_empty(), what, || "has no keys".into())?;
        if let Some(pair) = times.windows(2).find(|pair| pair[0] > pair[1]) {
            return Err(self.refuse(what, format!("has a key at {} s before one at {} s; times must rise", pair[0], pair[1])));
        }
        let output = sampler.output();
        let values: Vec<f64> = match output.dimensions() {
            gltf::accessor::Dimensions::Vec3 if width == 3 => self.numbers::<3>(&output, what)?,
            gltf::accessor::Dimensions::Vec4 if width == 4 => self.numbers::<4>(&output, what)?,
            _ => self.numbers::<1>(&output, what)?,
        };
        let interpolation = sampler.interpolation();
        let parts = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let wanted = times.len() * width * parts;
        let reason = || format!("has {} numbers for {} keys, which need {wanted}", values.len(), times.len());
        self.require(values.len() == wanted, what, reason)?;
        Ok(Keys { times, values, width, interpolation })
    }

    fn numbers<const N: usize>(&self, accessor: &Accessor, what: &str) -> Result<Vec<f64>> {
        let read = accessor::read(self, accessor, &Vertices::All, what, |numbers: [f32; N]| numbers.map(f64::from))?;
        Ok(read.into_flattened())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(interpolation: Interpolation, times: &[f64], width: usize, values: &[f64]) -> Keys {
        Keys { times: times.to_vec(), values: values.to_vec(), width, interpolation }
    }

    #[test]
    fn values_between_keys_are_those_of_the_specification() {
        let linear = keys(Interpolation::Linear, &[1.0, 3.0], 1, &[10.0, 20.0]);
        assert_eq!([0.0, 1.0, 1.5, 3.0, 9.0].map(|time| linear.at(time, false)[0]), [10.0, 10.0, 12.5, 20.0, 20.0]);
        let step = keys(Interpolation::Step, &[1.0, 3.0], 1, &[10.0, 20.0]);
        assert_eq!([0.0, 2.9, 3.0].map(|time| step.at(time, false)[0]), [10.0, 10.0, 20.0]);
        // x^3 between 1 and 3 has the slopes 3 and 27.
        let cubic = keys(Interpolation::CubicSpline, &[1.0, 3.0], 1, &[0.0, 1.0, 3.0, 27.0, 27.0, 0.0]);
        for time in [1.0, 1.5, 2.0, 2.75, 3.0] {
            assert!((cubic.at(time, false)[0] - time * time * time).abs() < 1e-12, "{time}");
        }
        let one = keys(Interpolation::Linear, &[2.0], 1, &[7.0]);
        assert_eq!([0.0, 2.0, 5.0].map(|time| one.at(time, false)[0]), [7.0; 3]);
    }

    #[test]
    fn rotations_take_the_shorter_way() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let turn = keys(Interpolation::Linear, &[0.0, 1.0], 4, &[0.0, 0.0, 0.0, 1.0, 0.0, -half, 0.0, -half]);
        let found = DQuat::from_slice(&turn.at(0.5, true));
        assert!(found.angle_between(DQuat::from_rotation_y(std::f64::consts::FRAC_PI_4)) < 1e-6, "{found}");
    }
}
