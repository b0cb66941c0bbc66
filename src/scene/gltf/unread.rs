//! Takes out of a file's JSON what no mesh of the scene uses and what is not read, so that no mistake in these refuses the file.

use std::collections::BTreeSet;

use gltf::json::mesh::Semantic;
use gltf::json::texture::{VALID_MAG_FILTERS, VALID_MIN_FILTERS};
use gltf::json::validation::Checked;
use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::Error as Fault;
use serde_json::{Value, json};

use super::members::{accessors, entries, index, items, items_mut};
use super::{LeftOut, VISIBILITY, called, image_light, is_read, named};
use crate::scene::layers::PARAMETERS;
use crate::text::echo;

const LIGHTS: &str = "/extensions/KHR_lights_punctual";
const SPEC_GLOSS: &str = "KHR_materials_pbrSpecularGlossiness";

/// Lists keep their length, as their members are named by numbers. Gives the numbers of the scene's nodes that are not hidden.
pub(super) fn take_out(root: &mut Value, is_posed: bool, left_out: &mut LeftOut) -> BTreeSet<usize> {
    add_scene(root);
    // Lists that may be missing.
    for scene in items_mut(root, "scenes").filter_map(|(_, scene)| scene.as_object_mut()) {
        scene.entry("nodes").or_insert_with(|| json!([]));
    }
    let nodes = nodes_of_scene(root);
    take_animations(root, is_posed, &nodes, left_out);
    // Pictures that only an extension names.
    for (_, texture) in items_mut(root, "textures") {
        for name in ["EXT_texture_webp", "KHR_texture_basisu"] {
            if let Some(source) = texture["extensions"][name].get("source").cloned() {
                texture["source"] = source;
            }
        }
    }
    let mut materials = BTreeSet::new();
    let mut meshes = BTreeSet::new();
    for node in &nodes {
        let (node, json) = (*node, &root["nodes"][*node]);
        name_unread_extensions(json, &called("node", json["name"].as_str(), node), left_out);
        let Some(mesh) = index(&json["mesh"]) else { continue };
        meshes.insert(mesh);
        let name = json["name"].as_str().or(root["meshes"][mesh]["name"].as_str());
        let owner = format!("mesh '{}'", named("mesh", name, mesh));
        for primitive in items(&root["meshes"][mesh]["primitives"]) {
            materials.extend(index(&primitive["material"]));
            name_unread_extensions(primitive, &owner, left_out);
            let mut shifted = items(&primitive["targets"]).flat_map(entries);
            if shifted.any(|(name, _)| name.starts_with("TEXCOORD_") || name.starts_with("COLOR_")) {
                left_out.add("texture coordinates and colours of morph targets", &owner);
            }
        }
    }
    let mut textures = BTreeSet::new();
    for (place, material) in items_mut(root, "materials") {
        let owner = format!("material '{}'", named("material", material["name"].as_str(), place));
        if materials.contains(&place) {
            take_out_of_material(material, &owner, left_out);
            find_textures(material, &mut textures);
        } else {
            left_out.add("materials on no mesh", &owner);
            *material = json!({});
        }
    }
    let of_textures =
        |member: &str| -> BTreeSet<usize> { textures.iter().filter_map(|texture| index(&root["textures"][*texture][member])).collect() };
    let (mut images, samplers) = (of_textures("source"), of_textures("sampler"));
    images.extend(image_light::images(root));
    for (list, used, blank) in
        [("textures", &textures, json!({})), ("images", &images, json!({"uri": ""})), ("samplers", &samplers, json!({}))]
    {
        for (_, unused) in items_mut(root, list).filter(|(place, _)| !used.contains(place)) {
            *unused = blank.clone();
        }
    }
    for (place, mesh) in items_mut(root, "meshes") {
        if meshes.contains(&place) {
            take_out_of_mesh(mesh, &format!("mesh '{}'", named("mesh", mesh["name"].as_str(), place)), left_out);
        } else {
            *mesh = json!({"primitives": []});
        }
    }
    allow_missing_members(root);
    let accessors = accessors(root, nodes.iter().map(|node| &root["nodes"][*node]), |_, _| true);
    for (_, unused) in items_mut(root, "accessors").filter(|(place, _)| !accessors.contains(place)) {
        *unused = json!({"componentType": 5121, "count": 1, "type": "SCALAR"});
    }
    let views = views(root);
    for (_, unused) in items_mut(root, "bufferViews").filter(|(place, _)| !views.contains(place)) {
        // What it has compressed is not unpacked.
        take(unused, "", "extensions");
    }
    for (place, sampler) in items_mut(root, "samplers") {
        for (member, allowed) in [("magFilter", VALID_MAG_FILTERS), ("minFilter", VALID_MIN_FILTERS)] {
            let is_valid = |value: &Value| allowed.iter().any(|allowed| value.as_u64() == Some(u64::from(*allowed)));
            let Some(filter) = sampler.get(member).filter(|filter| !is_valid(filter)) else { continue };
            let what = format!("filters of samplers that glTF does not have ({member} must be one of {allowed:?})");
            left_out.add(what, &format!("sampler {place} with {}", echo(filter)));
            take(sampler, "", member);
        }
    }
    nodes
}

/// Puts all nodes that are below no other into a scene where there is none: a file may be a library of them.
fn add_scene(root: &mut Value) {
    if items(&root["scenes"]).next().is_some() {
        return;
    }
    take(root, "", "scene");
    if items(&root["nodes"]).next().is_none() {
        return;
    }
    let below: BTreeSet<usize> = items(&root["nodes"]).flat_map(|node| items(&node["children"])).filter_map(index).collect();
    let roots: Vec<usize> = (0..items(&root["nodes"]).count()).filter(|node| !below.contains(node)).collect();
    root["scenes"] = json!([{"nodes": roots}]);
}

/// All animations; where a pose is asked for all but the first, of which only what moves nodes is left.
fn take_animations(root: &mut Value, is_posed: bool, nodes: &BTreeSet<usize>, left_out: &mut LeftOut) {
    let animations = root.as_object_mut().and_then(|root| root.remove("animations"));
    let Some(Value::Array(mut animations)) = animations.filter(|animations| items(animations).next().is_some()) else { return };
    if !is_posed {
        left_out.add("animations (`at` SECONDS takes a pose of the first)", "");
        return;
    }
    if animations.len() > 1 {
        left_out.add("animations beside the first", "");
    }
    animations.truncate(1);
    if let Some(Value::Array(channels)) = animations[0].get_mut("channels") {
        let moves_node = |channel: &Value| {
            let target = &channel["target"];
            target["node"].is_number() && matches!(target["path"].as_str(), Some("translation" | "rotation" | "scale" | "weights"))
        };
        let before = channels.len();
        channels.retain(moves_node);
        if channels.len() < before {
            left_out.add("what animations move besides nodes", "");
        }
        // Meshes that are not in the scene are taken out.
        let is_elsewhere = |node: usize| root["nodes"].get(node).is_some() && !nodes.contains(&node);
        channels.retain(|channel| channel["target"]["path"] != "weights" || !index(&channel["target"]["node"]).is_some_and(is_elsewhere));
    }
    root["animations"] = animations.into();
}

/// Without those that are hidden, and all below these.
fn nodes_of_scene(root: &Value) -> BTreeSet<usize> {
    let scene = index(&root["scene"]).unwrap_or(0);
    let mut found = BTreeSet::new();
    let mut next: Vec<usize> = items(&root["scenes"][scene]["nodes"]).filter_map(index).collect();
    while let Some(node) = next.pop() {
        if root["nodes"][node]["extensions"][VISIBILITY]["visible"] != false && found.insert(node) {
            next.extend(items(&root["nodes"][node]["children"]).filter_map(index));
        }
    }
    found
}

/// Buffer views of accessors, pictures and compressed primitives.
fn views(root: &Value) -> BTreeSet<usize> {
    let of_accessor = |accessor: &Value| {
        let sparse = &accessor["sparse"];
        [index(&accessor["bufferView"]), index(&sparse["indices"]["bufferView"]), index(&sparse["values"]["bufferView"])]
    };
    let of_primitive = |primitive: &Value| index(&primitive["extensions"]["KHR_draco_mesh_compression"]["bufferView"]);
    let mut found: BTreeSet<usize> = items(&root["accessors"]).flat_map(of_accessor).flatten().collect();
    found.extend(items(&root["images"]).filter_map(|image| index(&image["bufferView"])));
    found.extend(items(&root["meshes"]).flat_map(|mesh| items(&mesh["primitives"])).filter_map(of_primitive));
    found
}

/// Attributes that glTF does not have, and those of an application.
fn take_out_of_mesh(mesh: &mut Value, owner: &str, left_out: &mut LeftOut) {
    for (_, primitive) in items_mut(mesh, "primitives") {
        let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut) else { continue };
        attributes.retain(|name, _| {
            let is_known = matches!(Checked::<Semantic>::deserialize(name.as_str().into_deserializer()), Ok::<_, Fault>(Checked::Valid(_)));
            if !is_known {
                left_out.add(format!("attributes that glTF does not have ({})", echo(name)), owner);
            }
            is_known && !name.starts_with('_')
        });
    }
}

/// Puts in what glTF asks for and nothing here reads, or what other readers do without: bounds of positions, what cameras clip, the kind
/// of pictures, which their bytes say, the cone of a spot light. Takes out what views say to graphics cards.
fn allow_missing_members(root: &mut Value) {
    let primitives = || items(&root["meshes"]).flat_map(|mesh| items(&mesh["primitives"]));
    let positions: BTreeSet<usize> = primitives().filter_map(|primitive| index(&primitive["attributes"]["POSITION"])).collect();
    for (_, accessor) in items_mut(root, "accessors").filter(|(place, _)| positions.contains(place)) {
        if let Some(accessor) = accessor.as_object_mut() {
            accessor.extend([("min".to_owned(), json!([0, 0, 0])), ("max".to_owned(), json!([0, 0, 0]))]);
        }
    }
    for (_, view) in items_mut(root, "bufferViews") {
        take(view, "", "target");
        // As tight as its elements are.
        if view["byteStride"] == 0 {
            take(view, "", "byteStride");
        }
    }
    for (_, image) in items_mut(root, "images").filter(|(_, image)| !image["bufferView"].is_null() && image["mimeType"].is_null()) {
        image["mimeType"] = json!("image/png");
    }
    for (_, light) in root.pointer_mut(LIGHTS).into_iter().flat_map(|lights| items_mut(lights, "lights")) {
        if light["type"] == "spot" && light["spot"].is_null() {
            light["spot"] = json!({});
        }
    }
    for (_, camera) in items_mut(root, "cameras") {
        for (kind, members) in [("perspective", &["znear"][..]), ("orthographic", &["znear", "zfar"])] {
            let Some(numbers) = camera.get_mut(kind).and_then(Value::as_object_mut) else { continue };
            numbers.extend(members.iter().map(|member| ((*member).to_owned(), json!(1))));
        }
    }
}

fn take_out_of_material(material: &mut Value, owner: &str, left_out: &mut LeftOut) {
    if take(material, "", "occlusionTexture") {
        left_out.add("occlusion textures (what they guess is computed)", owner);
    }
    if take(material, "/extensions/KHR_materials_volume", "thicknessTexture") {
        left_out.add("thickness textures (rays measure the thickness)", owner);
    }
    name_unread_extensions(material, owner, left_out);
    let Some(extensions) = material.get_mut("extensions").and_then(Value::as_object_mut) else { return };
    extensions.retain(|name, _| is_read(name));
    if extensions.contains_key(SPEC_GLOSS) && !extensions.contains_key("KHR_materials_unlit") {
        // Each says that it must not stand beside the other.
        for name in PARAMETERS.iter().map(|(group, _)| group) {
            if extensions.remove(*name).is_some() {
                left_out.add(format!("the extension {name} beside {SPEC_GLOSS}, where glTF forbids it"), owner);
            }
        }
        // What it stands in for.
        take(material, "", "pbrMetallicRoughness");
    }
}

fn name_unread_extensions(object: &Value, owner: &str, left_out: &mut LeftOut) {
    for name in entries(&object["extensions"]).map(|(name, _)| name).filter(|name| !is_read(name)) {
        left_out.add(format!("the extension {name}"), owner);
    }
}

/// The numbers of all textures that a material names.
fn find_textures(value: &Value, found: &mut BTreeSet<usize>) {
    for (name, member) in entries(value) {
        if name.ends_with("Texture") {
            found.extend(index(&member["index"]));
        }
        find_textures(member, found);
    }
}

/// Whether it was there.
fn take(value: &mut Value, pointer: &str, member: &str) -> bool {
    value.pointer_mut(pointer).and_then(Value::as_object_mut).and_then(|object| object.remove(member)).is_some()
}
