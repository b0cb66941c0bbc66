//! `photonmill info`: what a file holds, what became of every material in words, and what is left out.

use super::gltf::with_image;
use crate::common::gltf_file::{data_uri, encoded};
use crate::common::prelude::*;
use crate::common::rich_file::animated;
use image::{ImageFormat, RgbImage};
use serde_json::{Value, json};

/// The square with these materials on as many squares, and one picture.
fn square_with(materials: &Value) -> Value {
    let mut value = with_image(json!({"name": "wood", "uri": data_uri("image/png", &encoded(&RgbImage::new(16, 8), ImageFormat::Png))}));
    let count = materials.as_array().unwrap().len();
    let mut primitive = value["meshes"][0]["primitives"][0].clone();
    let primitives = (0..count).map(|k| {
        primitive["material"] = json!(k);
        primitive.clone()
    });
    value["meshes"][0]["primitives"] = primitives.collect();
    value["materials"] = materials.clone();
    value
}

#[test]
fn materials_are_described_in_words() {
    let texture = json!({"index": 0});
    let glass = |volume: Value| {
        let extensions = json!({"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": volume});
        json!({"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0}, "extensions": extensions})
    };
    let with = |name: &str, content: Value| json!({"pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": {format!("KHR_materials_{name}"): content}});
    let mut cases = [
        (json!({}), "metal, roughness 1"),
        (
            json!({"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.4, "baseColorTexture": texture,
                "metallicRoughnessTexture": texture}}),
            "dielectric, ior 1.5, roughness 0.4 (texture 'wood'), base colour texture 'wood'",
        ),
        (
            json!({"pbrMetallicRoughness": {"metallicFactor": 0.25, "baseColorFactor": [0.012345, 1, 0.5, 1]}, "doubleSided": true}),
            "dielectric and metal, metallic 0.25, ior 1.5, roughness 1, base colour 0.0123 1 0.5, two-sided",
        ),
        (
            json!({"pbrMetallicRoughness": {"metallicRoughnessTexture": texture}}),
            "dielectric and metal, metallic 1 (texture 'wood'), ior 1.5, roughness 1 (texture 'wood')",
        ),
        (glass(json!({"thicknessFactor": 0})), "thin wall of glass, ior 1.5, roughness 0"),
        (with("transmission", json!({"transmissionFactor": 1})), "thin wall of glass, ior 1.5, roughness 1"),
        (
            glass(json!({"thicknessFactor": 1, "attenuationColor": [0.25, 0.25, 1], "attenuationDistance": 2})),
            "solid glass, ior 1.5, roughness 0, 0.25 0.25 1 of the light left after 2 m",
        ),
        (
            json!({"pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": {
                "KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": {"thicknessFactor": 1},
                "KHR_materials_dispersion": {"dispersion": 0.5}}}),
            "solid glass, ior 1.5, dispersion 0.5, roughness 1",
        ),
        (
            with("transmission", json!({"transmissionFactor": 0.5, "transmissionTexture": texture})),
            "thin wall of glass, ior 1.5, roughness 1, transmission 0.5 (texture 'wood')",
        ),
        (
            with("diffuse_transmission", json!({"diffuseTransmissionFactor": 0.5, "diffuseTransmissionColorTexture": texture})),
            "dielectric, ior 1.5, roughness 1, diffuse transmission 0.5 of colour 1 (texture 'wood')",
        ),
        (
            with("anisotropy", json!({"anisotropyStrength": 0.5, "anisotropyRotation": 1.5707964, "anisotropyTexture": texture})),
            "dielectric, ior 1.5, roughness 1, anisotropy 0.5 (texture 'wood') turned by 90 degrees",
        ),
        (
            with("iridescence", json!({"iridescenceFactor": 0.5, "iridescenceThicknessTexture": texture})),
            "dielectric, ior 1.5, roughness 1, iridescence 0.5, a film of 100 to 400 nm (texture 'wood') and ior 1.3",
        ),
        (with("ior", json!({"ior": 0})), "dielectric, ior infinite, roughness 1"),
        (
            with("specular", json!({"specularFactor": 0.5, "specularColorTexture": texture})),
            "dielectric, ior 1.5, roughness 1, specular 0.5, specular colour 1 (texture 'wood')",
        ),
        (
            with("clearcoat", json!({"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.1, "clearcoatNormalTexture": texture})),
            "dielectric, ior 1.5, roughness 1, clear coat 0.5 of roughness 0.1, normal map of the coat (texture 'wood')",
        ),
        (
            with("sheen", json!({"sheenColorFactor": [1, 0.5, 0], "sheenRoughnessFactor": 0.3, "sheenRoughnessTexture": texture})),
            "dielectric, ior 1.5, roughness 1, sheen 1 0.5 0 of roughness 0.3 (texture 'wood')",
        ),
        (
            json!({"alphaMode": "MASK", "normalTexture": {"index": 0, "scale": 0.5}, "emissiveFactor": [0.6, 0.6, 0.6]}),
            "metal, roughness 1, cut out where alpha is below 0.5, normal map of scale 0.5 (texture 'wood'), emits 0.6 W/m2/sr",
        ),
        (
            json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.25]}, "extensions": {"KHR_materials_unlit": {}}}),
            "unlit: the eye sees its base colour as it is, blended by alpha 0.25",
        ),
        (
            with("pbrSpecularGlossiness", json!({"specularFactor": [0.2, 0.2, 0.2], "glossinessFactor": 0.75})),
            "dielectric, ior infinite, roughness 0.25, specular colour 0.2",
        ),
    ];
    cases.iter_mut().enumerate().for_each(|(k, (material, _))| material["name"] = json!(format!("thing {k}")));
    let place = Place::new();
    place.write("a.gltf", square_with(&cases.iter().map(|(material, _)| material.clone()).collect()).to_string());
    let (stdout, _) = place.succeed("info a.gltf");
    for (material, expected) in cases {
        let line = format!("    {}: {expected}", material["name"].as_str().unwrap());
        assert!(stdout.lines().any(|found| found == line), "{material} is to be described as {expected}: {stdout}");
    }
}

#[test]
fn textures_are_named_with_what_is_unusual_about_them() {
    let place = Place::new();
    let transformed = |transform: Value| json!({"index": 1, "extensions": {"KHR_texture_transform": transform}});
    let mut value = square_with(&json!([
        {"name": "same", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}},
        {"name": "same", "pbrMetallicRoughness": {"metallicFactor": 0.3, "baseColorTexture": {"index": 1}}},
        {"name": "other", "normalTexture": transformed(json!({"scale": [0.3, -2], "rotation": 0.75, "offset": [0.1, 0]})),
            "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 2}}
    ]));
    let nameless = json!({"uri": value["images"][0]["uri"]});
    value["images"].as_array_mut().unwrap().push(nameless);
    value["samplers"] = json!([{"wrapS": 33071, "wrapT": 33071}, {"wrapS": 33648}]);
    value["textures"] = json!([{"source": 0}, {"source": 0, "sampler": 0}, {"source": 1, "sampler": 1}]);
    value["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(2);
    value["nodes"][0]["scale"] = json!([0.3, 0.3, 0.3]);
    place.write("a.gltf", value.to_string());
    let stdout = text(&place.run("info a.gltf").stdout);
    for line in [
        "    same #0: metal, roughness 1, base colour texture 'wood', UV set 1\n",
        "    same #1: dielectric and metal, metallic 0.3, ior 1.5, roughness 1, base colour texture 'wood', clamped\n",
        "    other: metal, roughness 1, normal map (texture 'wood', clamped, scaled by 0.3 -2, turned by 0.75 rad, moved by 0.1 0), \
         emits 1 W/m2/sr (texture 1, mirrored in u, repeated in v)\n",
    ] {
        assert!(stdout.contains(line), "{line}{stdout}");
    }
    let json = text(&place.run("info a.gltf --json").stdout);
    assert!(json.contains("0.3,") && !json.contains("0.30000"), "{json}");
}

#[test]
fn a_pose_is_described() {
    let place = Place::new();
    place.write("a.gltf", animated().to_string());
    let said = |command: &str| text(&place.run(command).stdout);
    assert!(said("info a.gltf").contains("animations (--at SECONDS takes a pose of the first)"));
    let posed = said("info a.gltf --at 1");
    assert!(posed.contains("what animations move besides nodes") && !posed.contains("--at SECONDS"), "{posed}");
    assert!(said("info a.gltf --at -1").contains("what animations move besides nodes"));
    assert!(place.refusal("info cornell --at 1").unwrap().contains("--at"));
}

#[test]
fn a_file_is_described_as_text_and_as_json() {
    let place = Place::new();
    let mut value = square_with(&json!([
        {"name": "floor", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}}},
        {"name": "brushed", "extensions": {"EXT_materials_fur": {}}}
    ]));
    // Its indices are the zeros that the first position has.
    value["meshes"][0]["primitives"][1]["indices"] = json!(4);
    value["accessors"].as_array_mut().unwrap().push(json!({"bufferView": 0, "componentType": 5123, "count": 3, "type": "SCALAR"}));
    place.write("a.gltf", value.to_string());
    let (stdout, stderr) = place.succeed("info a.gltf");
    assert_eq!(stderr, "");
    let expected = "\
a: 1 mesh, 2 triangles, 2 x 2 x 0 m, 2 materials, 2 textures (0.000977 MiB), 3 lights, 1 camera
extensions
    KHR_lights_punctual, KHR_materials_emissive_strength
materials
    floor: dielectric and metal, metallic 1 (texture 'wood'), ior 1.5, roughness 1 (texture 'wood'), base colour texture 'wood'
    brushed: metal, roughness 1; on no mesh
textures
    texture image 'wood': 16x8, sRGB colours, bilinear, 0.000488 MiB
    texture image 'wood': 16x8, linear numbers, bilinear, 0.000488 MiB
lights, beside materials that emit
    light 'bulb': point
    light of node 'sun': directional
    light of node 'beam': spot
cameras
    eye
warnings
    1 triangle without area left out (mesh 'wall')
    ignored: the extension EXT_materials_fur: material 'brushed'
";
    assert_eq!(stdout, expected);

    let json: Value = serde_json::from_slice(&place.run("info a.gltf --json").stdout).unwrap();
    assert_eq!((&json["mesh_count"], &json["triangle_count"], &json["texture_bytes"]), (&json!(1), &json!(2), &json!(1024)));
    assert_eq!(json["materials"][1], json!({"name": "brushed", "description": "metal, roughness 1", "triangle_count": 0}));
    let wood =
        json!({"name": "texture image 'wood'", "width": 16, "height": 8, "texels": "sRGB colours", "filter": "bilinear", "bytes": 512});
    assert_eq!((&json["textures"][0], &json["lights"][0]), (&wood, &json!({"name": "light 'bulb'", "kind": "point"})));
    assert_eq!((&json["cameras"], json["warnings"].as_array().unwrap().len()), (&json!(["eye"]), 2));
    assert_eq!(json["extensions_used"], value["extensionsUsed"]);

    // Built-in scenes have other surfaces, and nothing to leave out.
    let built_in = text(&place.run("info cornell-spheres").stdout);
    for line in ["    white: matt, base colour 0.725 0.71 0.68\n", "    glass: smooth glass, ior 1.5\n", "    none\n"] {
        assert!(built_in.contains(line), "{line}{built_in}");
    }
    assert!(place.refusal("info absent.glb").unwrap().contains("no such file"));
}
