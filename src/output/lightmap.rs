//! Irradiance or radiosity of every wall as float images, with a file that says where texels lie.

use glam::Vec3;
use serde::Serialize;

use super::colour::Format;
use super::destination::{Destination, Folder};
use super::exr_file::{channels, encode_errors};
use super::image::GreyImage;
use crate::engine::error::bound::ErrorSource;
use crate::engine::room::film::WallEstimate;
use crate::scene::room::RoomScene;

/// Physical quantities of a wall's texel, both in W/m2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Quantity {
    Irradiance,
    Radiosity,
}

#[derive(Serialize)]
struct Layout<'a> {
    quantity: Quantity,
    unit: &'static str,
    /// Of the standard errors: rounds less one.
    degrees_of_freedom: u32,
    walls: Vec<WallLayout<'a>>,
}

/// The centre of the texel in column i, row j lies at origin + (i + 1/2) / width u + (j + 1/2) / height v.
#[derive(Serialize)]
struct WallLayout<'a> {
    name: &'a str,
    file: String,
    origin: [f64; 3],
    u: [f64; 3],
    v: [f64; 3],
    width: usize,
    height: usize,
}

/// Files of a lightmap, before there is any content.
pub(crate) fn destinations(folder: &Folder, scene: &RoomScene) -> Vec<Destination> {
    let walls = scene.walls().flat_map(|(_, wall)| names(wall.name)).map(|name| folder.file(&name));
    walls.chain([folder.file(LAYOUT)]).collect()
}

const LAYOUT: &str = "layout.json";

/// Grey as three equal channels, as the values are.
fn error_picture(side: u32, errors: &[f64], source: ErrorSource) -> Vec<u8> {
    let values = channels("", ["R", "G", "B"], errors.iter().map(|error| Vec3::splat(*error as f32)));
    encode_errors((side, side), values, source)
}

/// Files of a wall: its values, and their standard errors.
fn names(wall: &str) -> [String; 2] {
    [format!("{wall}.exr"), format!("{wall}-error.exr")]
}

/// `<wall>.exr` and `<wall>-error.exr` for every wall, and `layout.json`.
pub(crate) fn files(
    folder: &Folder,
    quantity: Quantity,
    scene: &RoomScene,
    walls: &[WallEstimate],
    source: ErrorSource,
) -> Vec<(Destination, Vec<u8>)> {
    let mut layout = Layout { quantity, unit: "W/m2", degrees_of_freedom: source.degrees_of_freedom, walls: Vec::new() };
    let mut files = Vec::new();
    for wall in walls {
        let (values, errors) = match quantity {
            Quantity::Irradiance => (&wall.irradiance, &wall.irradiance_error),
            Quantity::Radiosity => (&wall.radiosity, &wall.radiosity_error),
        };
        let mesh = values.len().isqrt();
        let picture = |values: Vec<f64>| GreyImage { width: mesh, height: mesh, values }.encode(Format::Exr, None);
        let [file, error_file] = names(wall.name);
        files.push((folder.file(&file), picture(values.clone())));
        files.push((folder.file(&error_file), error_picture(mesh as u32, errors, source)));
        let rectangle = scene.rectangle(wall.face);
        layout.walls.push(WallLayout {
            name: wall.name,
            file,
            origin: rectangle.origin.to_array(),
            u: rectangle.u.to_array(),
            v: rectangle.v.to_array(),
            width: mesh,
            height: mesh,
        });
    }
    files.push((folder.file(LAYOUT), serde_json::to_vec_pretty(&layout).expect("a layout is plain data")));
    files
}
