//! Transforms of nodes as the file's text has them, in double precision; and how far single precision, in which glTF's buffers and the
//! `gltf` crate hold numbers, moves what lies far from 0.

use glam::{DMat4, DQuat, DVec3};
use gltf::Accessor;
use gltf::accessor::DataType;
use serde_json::Value;

/// Of one node, from its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Transform {
    Matrix(DMat4),
    Parts { translation: DVec3, rotation: DQuat, scale: DVec3 },
}

impl Transform {
    pub(super) fn matrix(&self) -> DMat4 {
        match *self {
            Transform::Matrix(matrix) => matrix,
            Transform::Parts { translation, rotation, scale } => DMat4::from_scale_rotation_translation(scale, rotation, translation),
        }
    }

    /// Scale, rotation and translation.
    pub(super) fn parts(&self) -> (DVec3, DQuat, DVec3) {
        match *self {
            Transform::Matrix(matrix) => matrix.to_scale_rotation_translation(),
            Transform::Parts { translation, rotation, scale } => (scale, rotation, translation),
        }
    }
}

/// Of all nodes, in order. What has not the numbers that it should is as good as not there: reading the file refuses it.
pub(super) fn of_nodes(root: &Value) -> Vec<Transform> {
    root["nodes"].as_array().into_iter().flatten().map(of_node).collect()
}

fn of_node(node: &Value) -> Transform {
    if let Some(columns) = numbers(&node["matrix"]) {
        return Transform::Matrix(DMat4::from_cols_array(&columns));
    }
    Transform::Parts {
        translation: numbers(&node["translation"]).map_or(DVec3::ZERO, DVec3::from_array),
        rotation: numbers(&node["rotation"]).map_or(DQuat::IDENTITY, |of| unit(DQuat::from_array(of))),
        scale: numbers(&node["scale"]).map_or(DVec3::ONE, DVec3::from_array),
    }
}

fn numbers<const N: usize>(list: &Value) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = list.as_array()?.iter().map(Value::as_f64).collect();
    numbers?.try_into().ok()
}

/// A rotation that is one but for the rounding of its numbers: far from the origin the scale that rounding adds moves a node by metres.
fn unit(rotation: DQuat) -> DQuat {
    const ROUNDING: f64 = 1e-3;
    if (rotation.length() - 1.0).abs() < ROUNDING { rotation.normalize() } else { rotation }
}

/// By how much at most single precision has moved a number that was rounded to it. One that ends in six binary zeros or more was most
/// likely meant as it is.
pub(super) fn rounding(number: f64) -> f64 {
    let single = number as f32;
    if !single.is_finite() || single.to_bits().trailing_zeros() >= 6 {
        return 0.0;
    }
    0.5 * f64::from(single.abs().next_up() - single.abs())
}

/// Of each coordinate the most that rounding has moved it; 0 where a buffer does not hold numbers of single precision.
pub(super) fn most_rounding<'a>(accessor: &Accessor, vectors: impl IntoIterator<Item = &'a DVec3>) -> DVec3 {
    match accessor.data_type() {
        DataType::F32 => vectors.into_iter().fold(DVec3::ZERO, |most, vector| most.max(vector.map(rounding))),
        _ => DVec3::ZERO,
    }
}

/// How far a transform moves what each coordinate may be off by so much.
pub(super) fn moved(matrix: &DMat4, by: DVec3) -> f64 {
    let along = |axis: usize| matrix.col(axis).truncate().abs() * by[axis];
    (along(0) + along(1) + along(2)).max_element()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_has_not_its_numbers_is_as_good_as_not_there() {
        let [of_two, none] = of_nodes(&json!({"nodes": [{"scale": [1, 2]}, {}]}))[..] else { panic!() };
        assert_eq!((of_two, none.matrix()), (none, DMat4::IDENTITY));
    }

    #[test]
    fn rounding_is_half_a_step() {
        assert_eq!(rounding(4_649_776.22), 0.25);
        assert_eq!(rounding(4_649_792.0), 0.0, "six zeros at the end");
        assert_eq!(rounding(-500_123.37), 1.0 / 64.0);
        assert_eq!([0.0, 5000.0, -1.5, f64::INFINITY].map(rounding), [0.0; 4]);
    }
}
