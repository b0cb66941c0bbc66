//! Lightmaps in the user's own file: what was there stays to the byte, what is added leads every texel to its light, and a second
//! bake finds the coordinates of the first.

use super::gltf::assert_said;
use super::lightmap_texels::{numbered, open};
use crate::common::gltf_file::{data_uri, encoded, floats, push};
use crate::common::prelude::*;
use crate::common::program::entries;
use crate::common::rich_file::{compressed, draco_square};
use photonmill::bake::original::KEY;
use photonmill::bake::pages::{Atlas, Pages, Place as PlaceOnPage};
use photonmill::bake::{IntoFile, Layout, MAX_SIDE, Object};
use photonmill::output::destination::Folder;
use photonmill::scene::gltf::source::{Chunk, File, binary_file};
use serde_json::{Value, json};

/// A file being made: its document, and its first buffer.
struct Builder {
    json: Value,
    bytes: Vec<u8>,
}

impl Builder {
    fn new() -> Builder {
        let json = json!({
            "asset": {"version": "2.0", "generator": "by hand", "extras": {"kept": true}}, "scene": 0, "scenes": [{"nodes": []}],
            "nodes": [], "meshes": [], "materials": [{"name": "white"}], "accessors": [], "bufferViews": [], "buffers": [{}],
        });
        Builder { json, bytes: Vec::new() }
    }

    fn push(&mut self, list: &str, value: Value) -> usize {
        push(&mut self.json[list], value)
    }

    fn view(&mut self, bytes: &[u8], stride: Option<usize>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        stride.inspect(|stride| view["byteStride"] = json!(stride));
        self.bytes.extend(bytes);
        self.push("bufferViews", view)
    }

    fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8], stride: Option<usize>) -> usize {
        let view = self.view(bytes, stride);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "count": count, "type": kind, "name": kind}))
    }

    fn floats(&mut self, kind: &str, numbers: &[f32], count: usize) -> usize {
        self.accessor(kind, 5126, count, &floats(numbers), None)
    }

    /// The corners of a cube of 1 m, each one vertex, of six sides.
    fn cube(&mut self) -> (usize, usize) {
        let corner = |k: usize| [0, 1, 2].map(|axis| (k >> axis & 1) as f32);
        let numbers: Vec<f32> = (0..8).flat_map(corner).collect();
        let positions = self.floats("VEC3", &numbers, 8);
        self.json["accessors"][positions]["min"] = json!([0, 0, 0]);
        self.json["accessors"][positions]["max"] = json!([1, 1, 1]);
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5u8]];
        let indices: Vec<u8> = sides.iter().flat_map(|[a, b, c, d]| [*a, *b, *c, *a, *c, *d]).collect();
        let indices = self.accessor("SCALAR", 5121, 36, &indices, None);
        (positions, indices)
    }

    /// Positions of a square of 1 m.
    fn square(&mut self) -> usize {
        let positions = self.floats("VEC3", &[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.], 4);
        self.json["accessors"][positions]["min"] = json!([0, 0, 0]);
        self.json["accessors"][positions]["max"] = json!([1, 1, 0]);
        positions
    }

    fn node(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        push(&mut self.json["scenes"][0]["nodes"], json!(index));
        index
    }

    fn binary(mut self, chunks: &[Chunk]) -> Vec<u8> {
        self.json["buffers"][0] = json!({"byteLength": self.bytes.len(), "name": "geometry"});
        binary_file(&self.json, &self.bytes, chunks)
    }

    /// The path of a file, which is there as long as the place is.
    fn written(self, chunks: &[Chunk]) -> (Place, PathBuf) {
        let place = Place::new();
        place.write("model.glb", self.binary(chunks));
        let path = place.at("model.glb");
        (place, path)
    }
}

/// A cube that is skinned, animated and morphed, with attributes of many types, and much that is not read.
fn rich() -> Builder {
    let mut made = Builder::new();
    let (positions, indices) = made.cube();
    let bytes = |of: fn(u8) -> Vec<u8>| (0..8u8).flat_map(of).collect::<Vec<u8>>();
    let sign = |bit: u8| if bit > 0 { 73u8 } else { 183 };
    let normals: Vec<u8> = (0..8u8).flat_map(|k| [sign(k & 1), sign(k & 2), sign(k & 4), 0]).collect();
    let normals = made.accessor("VEC3", 5120, 8, &normals, Some(4));
    let uvs = made.accessor("VEC2", 5123, 8, &bytes(|k| [k, 3 * k, 200 - k, k].into()), None);
    let colours = made.accessor("VEC4", 5121, 8, &bytes(|k| [255, 30 * k, 0, 255].into()), None);
    let joints = made.accessor("VEC4", 5121, 8, &bytes(|k| [k & 1, 0, 0, 0].into()), None);
    let weights = made.accessor("VEC4", 5121, 8, &bytes(|_| [255, 0, 0, 0].into()), None);
    for shares in [normals, uvs, colours, weights] {
        made.json["accessors"][shares]["normalized"] = json!(true);
    }
    let temperatures = made.accessor("SCALAR", 5123, 8, &bytes(|k| [k, 1, 9, 9].into()), Some(4));
    made.json["accessors"][temperatures]["min"] = json!([256]);
    made.json["accessors"][temperatures]["max"] = json!([263]);
    let (at, by) = (made.view(&[1, 6], None), made.view(&floats(&[0.0, 0.25, 0.0, 0.5, 0.0, 0.0]), None));
    let sparse = json!({"count": 2, "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": by}});
    let morphed = made.push(
        "accessors",
        json!({"componentType": 5126, "count": 8, "type": "VEC3", "sparse": sparse, "min": [0, 0, 0], "max": [0.5, 0.25, 0]}),
    );
    let attributes = json!({
        "POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs, "COLOR_0": colours, "JOINTS_0": joints, "WEIGHTS_0": weights,
        "_TEMPERATURE": temperatures,
    });
    let primitive = json!({"attributes": attributes, "indices": indices, "material": 0, "mode": 4, "targets": [{"POSITION": morphed}]});
    made.push("meshes", json!({"name": "cube", "primitives": [primitive], "weights": [0.5], "extras": {"targetNames": ["bump"]}}));

    let extras = json!({"artist": "somebody", "numbers": [1, 2.5, 0.1, 1e-9], "nothing": null});
    made.node(json!({"name": "cube", "mesh": 0, "skin": 0, "extras": extras, "extensions": {"EXT_unheard_of": {"deep": [{}]}}}));
    let bones = [made.node(json!({"name": "low"})), made.node(json!({"name": "high", "translation": [0.5, 0, 0]}))];
    made.json["skins"] = json!([{"joints": bones, "name": "bones"}]);
    made.node(json!({"name": "eye", "camera": 0, "translation": [0, 0, 5], "extras": {"text": ""}}));
    made.node(json!({"name": "bulb", "translation": [0, 4, 0], "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    made.json["cameras"] = json!([{"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "zfar": 9, "znear": 1}}]);
    let (times, turns) = (made.floats("SCALAR", &[0.0, 1.0], 2), made.floats("VEC3", &[0.0; 6], 2));
    let channel = json!({"sampler": 0, "target": {"node": bones[1], "path": "translation"}});
    made.json["animations"] = json!([{"name": "wave", "channels": [channel], "samplers": [{"input": times, "output": turns}]}]);
    let picture = encoded(&image::RgbImage::from_pixel(2, 2, image::Rgb([9, 99, 200])), image::ImageFormat::Png);
    let view = made.view(&picture, None);
    made.json["images"] = json!([{"name": "paint", "bufferView": view, "mimeType": "image/png"}]);
    made.json["textures"] = json!([{"source": 0, "name": "paint"}]);
    made.json["materials"] = json!([
        {"name": "paint", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0, "roughnessFactor": 0.123_456_789}, "extras": {"list": [1]}},
        {"name": "unused", "extensions": {"EXT_unheard_of": 3}},
    ]);
    made.json["extensionsUsed"] = json!(["KHR_lights_punctual", "EXT_unheard_of", "KHR_mesh_quantization"]);
    made.json["extensions"] =
        json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 683}]}, "EXT_unheard_of": {"at": "the root"}});
    made
}

/// What a bake of a file is made of.
struct Baked {
    folder: tempfile::TempDir,
    /// Of the document in it.
    path: PathBuf,
    scene: Scene,
    layout: Layout,
    pages: Pages,
    warnings: Vec<String>,
    written: Vec<String>,
    /// What is said of them.
    purposes: String,
}

impl Baked {
    fn new(path: &Path, atlas: Atlas) -> Baked {
        let scene = open(path);
        let file = File::open(path).unwrap();
        let layout = Layout::of_file(&scene, Some(&file), 16.0, atlas.max_side()).unwrap();
        let pages = Pages::new(&layout, atlas);
        let folder = tempfile::tempdir().unwrap();
        let destination = Folder::open("-o", folder.path()).unwrap();
        let into_file = IntoFile::new(&destination, &file, &scene, &layout, &pages).unwrap();
        let warnings = into_file.warnings.clone();
        let written = into_file.write(&destination, &layout.maps(&numbered(&layout), Default::default()), Some(0.5)).unwrap();
        let purposes = written.iter().map(|written| written.purpose.as_str()).collect::<Vec<_>>().join("\n");
        let written = written.into_iter().map(|written| written.name).collect();
        let path = folder.path().join(path.file_name().expect("it is a file"));
        Baked { folder, path, scene, layout, pages, warnings, written, purposes }
    }

    fn of(made: Builder, atlas: Atlas) -> Baked {
        let (_place, path) = made.written(&[]);
        Baked::new(&path, atlas)
    }

    fn again(&self, atlas: Atlas) -> Baked {
        Baked::new(&self.path, atlas)
    }

    fn file(&self) -> File {
        File::open(&self.path).unwrap()
    }
}

/// The vertices of a primitive's triangles.
fn vertices(file: &File, primitive: &Value) -> Vec<usize> {
    let elements = file.elements(primitive["indices"].as_u64().unwrap() as usize, "indices").unwrap();
    (0..elements.count).map(|k| elements.number(k, 0) as usize).collect()
}

/// An object without these members.
fn without(value: &Value, members: &[&str]) -> Value {
    let mut value = value.clone();
    value.as_object_mut().unwrap().retain(|name, _| !members.contains(&name.as_str()));
    value
}

/// Whether every covered texel of every object is found as an engine would look it up: by the node's extras and the set of the
/// written file, in the written picture.
fn leads_to_its_light(baked: &Baked, json: &Value, file: &File) -> Check {
    let mut number = 0.0;
    let mut pictures = HashMap::new();
    // Primitives of one map may share texels on their edge.
    let mut claims: HashMap<(usize, u32, u32), u32> = HashMap::new();
    let node_of = |mesh: usize| baked.scene.meshes[mesh].source.as_ref().unwrap().node;
    for (mesh, lightmap) in baked.layout.lightmaps() {
        lightmap.texels.iter().for_each(|texel| *claims.entry((node_of(mesh), texel.x, texel.y)).or_default() += 1);
    }
    for (mesh, lightmap) in baked.layout.lightmaps() {
        let source = baked.scene.meshes[mesh].source.as_ref().unwrap();
        let node = &json["nodes"][source.node];
        let said = &node["extras"][KEY];
        let name = |member: &str| said[member].as_str().map(str::to_owned).ok_or(format!("{} names no picture", lightmap.mesh.name));
        for member in ["irradiance", "error"] {
            let name = name(member)?;
            pictures.entry(name.clone()).or_insert_with(|| image::open(baked.folder.path().join(&name)).unwrap().into_rgb32f());
        }
        let [offset, scale] =
            ["offset", "scale"].map(|member| DVec2::new(said[member][0].as_f64().unwrap(), said[member][1].as_f64().unwrap()));
        let primitive = &json["meshes"][node["mesh"].as_u64().unwrap() as usize]["primitives"][source.primitive];
        let accessor = |name: &str| primitive["attributes"][name].as_u64().unwrap() as usize;
        let uvs = file.elements(accessor(&format!("TEXCOORD_{}", said["texCoord"])), "uvs").unwrap();
        let positions = file.elements(accessor("POSITION"), "positions").unwrap();
        require(uvs.count == positions.count, || format!("{} coordinates for {} vertices", uvs.count, positions.count))?;
        let place = |vertex: usize| DVec2::new(uvs.number(vertex, 0), uvs.number(vertex, 1));
        let places: Vec<DVec2> = vertices(file, primitive).into_iter().map(place).collect();
        for texel in &lightmap.texels {
            number += 1.0;
            if claims[&(source.node, texel.x, texel.y)] > 1 {
                continue;
            }
            let point = texel.points[0];
            let [b, c] = point.weights.map(f64::from);
            let corners = &places[3 * point.triangle as usize..][..3];
            // Mirrored instances turn their triangles.
            let is_turned = lightmap.mesh.triangles[point.triangle as usize].map(|vertex| lightmap.uvs[vertex as usize]);
            let swapped = (is_turned[1] - corners[1]).length() > (is_turned[1] - corners[2]).length();
            let (b, c) = if swapped { (c, b) } else { (b, c) };
            let uv = offset + scale * (corners[0] * (1.0 - b - c) + corners[1] * b + corners[2] * c);
            let value = |member: &str| {
                let picture = &pictures[said[member].as_str().unwrap()];
                let place = (uv * DVec2::new(picture.width().into(), picture.height().into())).floor();
                picture.get_pixel_checked(place.x as u32, place.y as u32).map(|pixel| pixel.0)
            };
            let found = (value("irradiance"), value("error"));
            let wanted = (Some([number, 0.5, 0.25]), Some([0.125, number, 0.0]));
            require(found == wanted, || format!("{}: {found:?} instead of {wanted:?} at {uv}", lightmap.mesh.name))?;
        }
    }
    require(number > 0.0, || "there are no texels")
}

/// Whether nothing but what may be was added to a document, and every corner of every triangle has the attributes that it had.
fn only_adds(before: &File, after: &File) -> Check {
    let mut rest = after.json.clone();
    let length = |list: &str| before.json[list].as_array().map_or(0, Vec::len);
    for list in ["accessors", "bufferViews", "meshes", "buffers"] {
        rest[list].as_array_mut().unwrap().truncate(length(list));
    }
    let mut was = before.json.clone();
    for node in [&mut rest, &mut was].into_iter().flat_map(|json| json["nodes"].as_array_mut().unwrap()) {
        if let Some(extras) = node.get_mut("extras").and_then(Value::as_object_mut) {
            extras.remove(KEY);
            if extras.is_empty() {
                node.as_object_mut().unwrap().remove("extras");
            }
        }
    }
    if before.is_binary {
        rest["buffers"][0]["byteLength"] = before.json["buffers"][0]["byteLength"].clone();
        let own = before.binary.as_ref().unwrap();
        require(after.binary.as_ref().unwrap().starts_with(own), || "the binary part begins otherwise")?;
        require(after.other_chunks == before.other_chunks, || "chunks are missing")?;
    }
    for (number, mesh) in before.json["meshes"].as_array().unwrap().iter().enumerate() {
        for (place, primitive) in mesh["primitives"].as_array().unwrap().iter().enumerate() {
            let new = after.json["meshes"][number]["primitives"][place].clone();
            same_corners(before, primitive, after, &new)?;
            rest["meshes"][number]["primitives"][place] = primitive.clone();
            // All but what numbers accessors.
            let bare = |value: &Value| without(value, &["attributes", "indices", "targets", "mode"]);
            require(bare(&new) == bare(primitive), || format!("{new} was {primitive}"))?;
        }
    }
    require(rest == was, || format!("{rest} was {was}"))
}

fn same_corners(before: &File, primitive: &Value, after: &File, new: &Value) -> Check {
    let (old_vertices, new_vertices) = (vertices(before, primitive), vertices(after, new));
    let maps = |value: &Value| -> Vec<Value> {
        [vec![value["attributes"].clone()], value["targets"].as_array().cloned().unwrap_or_default()].concat()
    };
    let mut pairs = Vec::new();
    for (old, new) in maps(primitive).iter().zip(maps(new)) {
        for (name, accessor) in old.as_object().unwrap() {
            pairs.push((name.clone(), accessor.as_u64().unwrap() as usize, new[name].as_u64().unwrap() as usize));
        }
    }
    for (name, old, new) in pairs {
        let (one, two) = (before.elements(old, "old").unwrap(), after.elements(new, "new").unwrap());
        require(one.kind == two.kind && one.size == two.size, || format!("{name} has another type"))?;
        let element = |of: &photonmill::scene::gltf::source::Elements, vertex: usize| of.bytes[vertex * of.size..][..of.size].to_vec();
        let is_same = old_vertices.len() == new_vertices.len()
            && old_vertices.iter().zip(&new_vertices).all(|(a, b)| element(&one, *a) == element(&two, *b));
        require(is_same, || format!("{name} differs"))?;
        let [described, was] = [(after, new), (before, old)].map(|(file, accessor)| -> Value {
            let rest = without(&file.json["accessors"][accessor], &["bufferView", "byteOffset", "count", "sparse"]);
            // Whole numbers of floats are equal.
            serde_json::from_str(&rest.to_string().replace(".0,", ",").replace(".0]", "]")).unwrap()
        });
        require(described == was, || format!("{name}: {described} was {was}"))?;
    }
    Ok(())
}

/// The reader of another crate takes it too.
fn assert_valid(file: &File) {
    for (number, view) in file.json["bufferViews"].as_array().unwrap().iter().enumerate() {
        let buffer = &file.json["buffers"][view["buffer"].as_u64().unwrap() as usize];
        let end = view["byteOffset"].as_u64().unwrap_or(0) + view["byteLength"].as_u64().unwrap();
        assert!(end <= buffer["byteLength"].as_u64().unwrap(), "view {number}");
    }
    // The crate does not know all extensions.
    let root = serde_json::from_value(without(&file.json, &["extensionsRequired"])).unwrap();
    gltf::Document::from_json(root).unwrap();
}

#[test]
fn a_file_keeps_all_that_it_had() {
    let chunks = [(*b"ODD\0", vec![1, 2, 3, 4])];
    let (_place, path) = rich().written(&chunks);
    let original = std::fs::read(&path).unwrap();
    let baked = Baked::new(&path, Atlas::Off);
    assert_eq!(std::fs::read(&path).unwrap(), original);
    let (before, after) = (File::open(&path).unwrap(), baked.file());
    assert_eq!(after.other_chunks, chunks);
    assert_holds("the file", only_adds(&before, &after));
    assert_holds("its texels", leads_to_its_light(&baked, &after.json, &after));
    assert_valid(&after);
    assert_eq!(baked.written, ["model.glb", "cube.exr", "cube_error.exr", "model_preview.glb"]);
    let primitive = &after.json["meshes"][0]["primitives"][0];
    assert!(primitive["attributes"]["TEXCOORD_1"].is_u64(), "{primitive}");
    assert!(after.json["accessors"][primitive["attributes"]["POSITION"].as_u64().unwrap() as usize]["count"].as_u64() > Some(8));
    // The scene is the same in all but its coordinates.
    let again = open(&baked.path);
    for triangle in 0..12 {
        assert_eq!(again.meshes[0].corners(triangle), baked.scene.meshes[0].corners(triangle));
    }
    assert_eq!(again.materials, baked.scene.materials);

    let spoilt = |change: &dyn Fn(&mut File)| {
        let mut file = baked.file();
        change(&mut file);
        file
    };
    type Change<'a> = &'a dyn Fn(&mut File);
    let changes: [(&str, Change); 6] = [
        ("a material renamed", &|file| file.json["materials"][0]["name"] = json!("Paint")),
        ("an animation lost", &|file| drop(file.json.as_object_mut().unwrap().remove("animations"))),
        ("an extra rounded", &|file| file.json["nodes"][0]["extras"]["numbers"][2] = json!(0.100_000_000_000_000_02)),
        ("a byte changed", &|file| file.binary.as_mut().unwrap()[3] ^= 1),
        ("a chunk lost", &|file| file.other_chunks.clear()),
        ("joints that are weights", &|file| {
            let attributes = &mut file.json["meshes"][0]["primitives"][0]["attributes"];
            attributes["JOINTS_0"] = attributes["WEIGHTS_0"].clone();
        }),
    ];
    for (what, change) in changes {
        assert_complains(what, only_adds(&before, &spoilt(change)));
    }
    type Move = fn(&mut Value);
    let moved: [(&str, Move); 2] = [
        ("an offset of a texel", |json| json["nodes"][0]["extras"][KEY]["offset"] = json!([0.03, 0.0])),
        ("another set", |json| json["nodes"][0]["extras"][KEY]["texCoord"] = json!(0)),
    ];
    for (what, change) in moved {
        let mut json = after.json.clone();
        change(&mut json);
        assert_complains(what, leads_to_its_light(&baked, &json, &after));
    }
}

#[test]
fn a_second_bake_finds_the_coordinates() {
    for atlas in [Atlas::Off, Atlas::Size(128)] {
        let first = Baked::of(rich(), atlas);
        let second = first.again(atlas);
        assert!(first.layout.objects.iter().all(|object| object.set.is_none()));
        assert!(second.layout.objects.iter().all(|object| object.set == Some(1)), "{:?}", second.layout.warnings);
        let sizes = |baked: &Baked| baked.layout.objects.iter().map(|object| [object.width, object.height]).collect::<Vec<_>>();
        assert_eq!(sizes(&first), sizes(&second));
        let (before, after) = (first.file(), second.file());
        assert_eq!(before.binary, after.binary);
        assert_holds("the second bake", only_adds(&before, &after));
        assert_holds("its texels", leads_to_its_light(&second, &after.json, &after));
    }
}

/// Two nodes of a mesh that differ in size, one mirrored, one squeezed, and one of the mesh without a transform.
fn instances() -> Builder {
    let mut made = Builder::new();
    let (positions, indices) = made.cube();
    made.push(
        "meshes",
        json!({"name": "cube", "primitives": [{"attributes": {"POSITION": positions}, "indices": indices, "material": 0}]}),
    );
    for (name, x, scale) in [
        ("large", 0, [2, 2, 2]),
        ("mirrored", 3, [-1, 1, 1]),
        ("wall", 6, [1, 5, 10]),
        ("small", 9, [1, 1, 1]),
        ("far wall", 12, [1, 5, 10]),
    ] {
        made.node(json!({"name": name, "mesh": 0, "translation": [x, 0, 0], "scale": scale}));
    }
    made
}

#[test]
fn instances_share_coordinates_where_they_are_alike() {
    for atlas in [Atlas::Off, Atlas::Size(512)] {
        let baked = Baked::of(instances(), atlas);
        let after = baked.file();
        let objects = &baked.layout.objects;
        let shared: Vec<usize> = objects.iter().map(|object| object.charts_of).collect();
        assert_eq!(shared, [1, 1, 2, 1, 2]);
        assert_eq!([objects[0].width, objects[0].height], [2 * objects[1].width, 2 * objects[1].height]);
        let meshes: Vec<u64> = (0..5).map(|node| after.json["nodes"][node]["mesh"].as_u64().unwrap()).collect();
        assert_eq!(meshes, [0, 0, 1, 0, 1]);
        assert_eq!(after.json["meshes"].as_array().unwrap().len(), 2);
        assert_holds("their texels", leads_to_its_light(&baked, &after.json, &after));
        assert_valid(&after);
        // Every texel is of its own instance.
        for (mesh, lightmap) in baked.layout.lightmaps() {
            let (low, high) = Scene { meshes: vec![baked.scene.meshes[mesh].clone()], ..Scene::default() }.bounds();
            let is_within = |at: DVec3| at.cmpge(low - 1e-6).all() && at.cmple(high + 1e-6).all();
            assert!(lightmap.texels.iter().all(|texel| texel.points.iter().all(|point| is_within(point.sample(&lightmap.mesh).position))));
            let facing_out =
                |triangle: usize| lightmap.mesh.normal(triangle).dot(lightmap.mesh.corners(triangle)[0] - 0.5 * (low + high)) > 0.0;
            assert!((0..12).all(facing_out), "{}", lightmap.mesh.name);
        }
        // Again, with sets that are there.
        let second = baked.again(atlas);
        assert!(second.layout.objects.iter().all(|object| object.set == Some(1)));
        assert_eq!(second.file().binary, after.binary);
    }
}

/// A mesh of two primitives of one list of vertices: halves of a square, with these coordinates as second set.
fn halves(second_set: Option<[[f32; 2]; 4]>) -> Builder {
    let mut made = Builder::new();
    let positions = made.square();
    let uvs = made.floats("VEC2", &[0., 0., 4., 0., 4., 4., 0., 4.], 4);
    let mut attributes = json!({"POSITION": positions, "TEXCOORD_0": uvs});
    if let Some(second) = second_set {
        attributes["TEXCOORD_1"] = json!(made.floats("VEC2", second.as_flattened(), 4));
    }
    made.json["materials"] = json!([{"name": "left"}, {"name": "right"}]);
    let half = |made: &mut Builder, corners: [u8; 3], material: usize| {
        let indices = made.accessor("SCALAR", 5121, 3, &corners, None);
        json!({"attributes": attributes.clone(), "indices": indices, "material": material})
    };
    let halves = [half(&mut made, [0, 1, 2], 0), half(&mut made, [0, 2, 3], 1)];
    made.push("meshes", json!({"name": "square", "primitives": halves}));
    made.node(json!({"name": "square", "mesh": 0, "scale": [4, 4, 4]}));
    made
}

#[test]
fn primitives_of_a_node_share_a_map() {
    let whole = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let part = whole.map(|[u, v]| [0.5 + 0.25 * u, 0.125 + 0.25 * v]);
    let over_itself = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [1.0, 0.0]];
    for (second_set, set) in [(None, None), (Some(whole), Some(1)), (Some(part), Some(1)), (Some(over_itself), None)] {
        let baked = Baked::of(halves(second_set), Atlas::Off);
        let after = baked.file();
        let [object] = &baked.layout.objects[..] else { panic!("one object") };
        assert_eq!((object.meshes.as_slice(), object.set), (&[0, 1][..], set));
        assert_holds("their texels", leads_to_its_light(&baked, &after.json, &after));
        // No texel is of both, but on the edge that they share.
        let places: Vec<BTreeSet<(u32, u32)>> =
            baked.layout.lightmaps().map(|(_, lightmap)| lightmap.texels.iter().map(|texel| (texel.x, texel.y)).collect()).collect();
        let on_both = places[0].intersection(&places[1]).count();
        assert!(on_both == 0 || set.is_some() && on_both as u32 <= 2 * object.width, "{on_both} texels of both");
        let density = f64::from(object.width * object.height) / 16.0;
        assert!(set.is_none() || density == 256.0, "{density} texels per square metre");
        // The set after those that are there.
        let said = &after.json["nodes"][0]["extras"][KEY];
        let expected = if second_set == Some(over_itself) { 2 } else { 1 };
        assert_eq!(said["texCoord"], expected, "{said}");
        let is_named = baked.warnings.iter().any(|warning| warning.contains("'square'") && warning.contains("TEXCOORD_1"));
        assert_eq!(is_named, expected == 2, "{:?}", baked.warnings);
        assert_eq!(baked.again(Atlas::Off).layout.objects[0].set, Some(expected));
    }
}

#[test]
fn a_mesh_without_coordinates_gets_two_sets() {
    let mut made = instances();
    let attributes = Baked::of(instances(), Atlas::Off).file().json["meshes"][0]["primitives"][0]["attributes"].clone();
    assert_eq!(attributes["TEXCOORD_0"], attributes["TEXCOORD_1"]);
    // Textures are seen at their origin, as before.
    let picture = encoded(&image::RgbImage::from_fn(8, 8, |x, y| image::Rgb([30 * x as u8, 30 * y as u8, 0])), image::ImageFormat::Png);
    made.json["images"] = json!([{"uri": data_uri("image/png", &picture)}]);
    made.json["textures"] = json!([{"source": 0}]);
    made.json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    let again = open(&Baked::of(made, Atlas::Off).path);
    let is_at_origin = |uvs: &[DVec2]| uvs.iter().all(|uv| *uv == DVec2::ZERO);
    assert!(again.meshes.iter().all(|mesh| is_at_origin(&mesh.uvs[0]) && !is_at_origin(&mesh.uvs[1])));
}

/// Numbered squares in a row.
fn squares(count: usize) -> Builder {
    let mut made = Builder::new();
    let positions = made.square();
    let second = made.floats("VEC2", &[0., 0., 1., 0., 1., 1., 0., 1.], 4);
    let indices = made.accessor("SCALAR", 5121, 6, &[0, 1, 2, 0, 2, 3], None);
    for k in 0..count {
        // Every second one has coordinates that reach to the border.
        let attributes = if k % 2 == 0 {
            json!({"POSITION": positions, "TEXCOORD_0": second, "TEXCOORD_1": second})
        } else {
            json!({"POSITION": positions})
        };
        let mesh = made.push("meshes", json!({"primitives": [{"attributes": attributes, "indices": indices}]}));
        let scale = 1 + k % 3;
        made.node(json!({"name": format!("square {k}"), "mesh": mesh, "translation": [4 * k, 0, 0], "scale": [scale, scale, 1]}));
    }
    made
}

/// Whether maps lie on their pages, apart from each other.
fn stand_apart(layout: &Layout, pages: &Pages) -> Check {
    let mut taken = HashMap::new();
    for (number, (object, PlaceOnPage { page, x, y })) in layout.objects.iter().zip(&pages.places).enumerate() {
        let [width, height] = pages.sizes[*page];
        let is_within = x + object.width <= width && y + object.height <= height;
        require(is_within, || format!("object {number} leaves its page"))?;
        // Two texels around coordinates of a file; new charts have theirs.
        let margin = if object.set.is_some() { 2 } else { 0 };
        for row in *y..y + object.height + 2 * margin {
            for column in *x..x + object.width + 2 * margin {
                let place = (*page, (column as i32 - margin as i32, row as i32 - margin as i32));
                let other = taken.insert(place, number);
                require(other.is_none_or(|other| other == number), || format!("objects {other:?} and {number} at {place:?}"))?;
            }
        }
    }
    Ok(())
}

#[test]
fn objects_share_pages() {
    for (count, atlas, page_count) in
        [(8, Atlas::Auto, 8), (9, Atlas::Auto, 1), (20, Atlas::Off, 20), (20, Atlas::Size(64), 0), (3, Atlas::Size(512), 1)]
    {
        let baked = Baked::of(squares(count), atlas);
        assert!(baked.warnings.is_empty() && baked.layout.warnings.is_empty(), "{:?} {:?}", baked.warnings, baked.layout.warnings);
        let found = baked.pages.sizes.len();
        assert!(found == page_count || page_count == 0 && (4..20).contains(&found), "{found} pages");
        assert_holds("pages", stand_apart(&baked.layout, &baked.pages));
        assert_holds("texels", leads_to_its_light(&baked, &baked.file().json, &baked.file()));
        if let Atlas::Size(size) = atlas {
            assert!(baked.pages.sizes.iter().all(|of| *of == [size; 2]));
        }
        // A document, two pictures a page, a preview.
        assert_eq!(baked.written.len(), 2 + 2 * found, "{:?}", baked.written);
        if found > 1 {
            let mut spoilt = baked.pages.clone();
            spoilt.places[1] = spoilt.places[0];
            assert_complains("two maps at one place", stand_apart(&baked.layout, &spoilt));
        }
        // The border of a map goes on around it: what a filter finds there is of the map.
        let pictures = baked.pages.pictures(&baked.layout.maps(&numbered(&baked.layout), Default::default()));
        let has_border = |object: &Object| object.set.is_some() && atlas != Atlas::Off && found < count;
        for (object, PlaceOnPage { page, x, y }) in pairs(&baked.layout.objects, &baked.pages.places).filter(|of| has_border(of.0)) {
            let picture = &pictures[*page];
            let at = |x: u32, y: u32| picture.irradiance[(y * picture.width + x) as usize];
            assert_eq!((at(x - 1, *y), at(x - 2, y - 2)), (at(*x, *y), at(*x, *y)), "{}", object.name);
            let (right, low) = (x + object.width, y + object.height);
            assert_eq!((at(right, low), at(right + 1, low + 1)), (at(right - 1, low - 1), at(right - 1, low - 1)), "{}", object.name);
        }
    }
}

#[test]
fn maps_larger_than_a_page_are_coarser() {
    let mut made = squares(2);
    made.json["nodes"][0]["scale"] = json!([50, 50, 1]);
    let baked = Baked::of(made, Atlas::Size(128));
    assert_eq!((baked.layout.objects[0].width, baked.layout.objects[0].height), (124, 124));
    assert_said(&baked.layout.warnings, &["124", "square 0"]);
    assert!(Atlas::Auto.max_side() < MAX_SIDE);
}

/// A text, and a binary file that has no place for what is added.
#[test]
fn files_keep_the_parts_beside_them() {
    let place = Place::new();
    let mut made = instances();
    std::fs::create_dir_all(place.at("in/parts of it")).unwrap();
    made.json["buffers"][0] = json!({"byteLength": made.bytes.len(), "uri": "parts%20of%20it/geometry.bin"});
    let picture = encoded(&image::RgbImage::from_pixel(2, 2, image::Rgb([9, 99, 200])), image::ImageFormat::Png);
    made.json["images"] = json!([{"uri": "parts%20of%20it/paint.png"}, {"uri": "lost.png"}, {"uri": data_uri("image/png", &picture)}]);
    made.json["textures"] = json!([{"source": 0}]);
    made.json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    place.write("in/parts of it/geometry.bin", &made.bytes);
    place.write("in/parts of it/paint.png", &picture);
    place.write("in/model.gltf", made.json.to_string());
    place.write("in/model.glb", binary_file(&made.json, &[], &[]));
    for name in ["in/model.gltf", "in/model.glb"] {
        let baked = Baked::new(&place.at(name), Atlas::Off);
        assert!(matches!(&baked.warnings[..], [warning] if warning.contains("lost.png")), "{name}: {:?}", baked.warnings);
        let of = |name: &str| std::fs::read(baked.folder.path().join(name)).unwrap();
        assert!((of("parts of it/geometry.bin"), of("parts of it/paint.png")) == (made.bytes.clone(), picture.clone()), "{name}");
        let after = baked.file();
        assert_eq!(after.json["buffers"][0], made.json["buffers"][0], "{name}");
        assert_eq!(after.json["buffers"][1]["uri"], "model_lightmap.bin", "{name}");
        assert_eq!(after.json["images"], made.json["images"], "{name}");
        assert_holds(name, leads_to_its_light(&baked, &after.json, &after));
        assert_valid(&after);
        assert_eq!(open(&baked.path).triangle_count(), 60, "{name}");
    }

    // Over itself it is not written, whatever the folder is called.
    for folder in ["in", "in/.", "in/parts of it/.."] {
        let refused = place.run(&format!("bake in/model.gltf -o '{folder}'"));
        let said = text(&refused.stderr);
        let last = said.lines().last().unwrap_or_default();
        assert!(refused.status.code() == Some(2) && last.contains("-o") && last.contains("never overwritten"), "{said}");
    }
}

#[test]
fn what_cannot_be_extended_is_named_before_there_is_light() {
    // Extras that are no object have no room for a name.
    let (_place, path) = instances().written(&[]);
    let (scene, mut file) = (open(&path), File::open(&path).unwrap());
    file.json["nodes"][3]["extras"] = json!([1, 2]);
    let layout = Layout::of_file(&scene, Some(&file), 16.0, MAX_SIDE).unwrap();
    let pages = Pages::new(&layout, Atlas::Off);
    let names = vec!["a.exr".to_owned(); 5];
    let extended = photonmill::bake::original::extended(&file, &scene, &layout, &pages, &names, &names).unwrap();
    assert!(matches!(&extended.warnings[..], [warning] if warning.contains("'small'")), "{:?}", extended.warnings);
    assert_eq!(extended.json["nodes"][3]["extras"], json!([1, 2]));
}

/// The program, from a file: its lines name every file, and only those are there.
#[test]
fn every_file_is_printed_with_what_it_is_for() {
    let Some(_) = device() else { return };
    let place = Place::new();
    let mut made = squares(9);
    made.json["materials"] = json!([{"name": "white"}]);
    made.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    made.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": 683}]}});
    made.node(json!({"name": "sun", "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    place.write("model.glb", made.binary(&[]));
    let (stdout, _) = place.succeed("bake model.glb -o out --photons 50 --rounds 1 --texels-per-metre 4 --preview");
    let mut named: Vec<&str> = stdout.lines().filter_map(|line| Some(line.strip_prefix("wrote out/")?.split_once(": ")?.0)).collect();
    named.sort_unstable();
    assert_eq!(named, ["lightmap.exr", "lightmap_error.exr", "model.glb", "model_preview.glb"]);
    assert_eq!(named, entries(&place.at("out")));
    // The sun shines on squares that face it: 1 W/m2 on each of their texels, wherever it was packed.
    let file = File::open(&place.at("out/model.glb")).unwrap();
    let picture = image::open(place.at("out/lightmap.exr")).unwrap().into_rgb32f();
    for node in 0..9 {
        let said = &file.json["nodes"][node]["extras"][KEY];
        let number = |member: &str, axis: usize| said[member][axis].as_f64().unwrap();
        let middle = [0, 1].map(|axis| number("offset", axis) + 0.5 * number("scale", axis));
        let pixel = picture.get_pixel((middle[0] * f64::from(picture.width())) as u32, (middle[1] * f64::from(picture.height())) as u32);
        assert!((pixel.0[0] - 1.0).abs() < 1e-4, "node {node}: {pixel:?}");
    }
    place.assert_refused([
        ("bake model.glb -o out --atlas 10", ["--atlas", "64"]),
        ("bake model.glb -o out --atlas many", ["--atlas", "off"]),
        ("bake cornell -o out --atlas 256", ["--atlas", "built in"]),
    ]);
}

/// What the program refuses before it looks for a device.
#[test]
fn what_cannot_be_baked_is_refused_in_one_line() {
    let place = Place::new();
    let model = |materials: Value| {
        let mut made = instances();
        made.json["materials"] = materials;
        made.binary(&[])
    };
    place.write("model.glb", model(json!([{"name": "white"}])));
    place.write("unlit.glb", model(json!([{"extensions": {"KHR_materials_unlit": {}}}])));
    place.write("mirror.glb", model(json!([{"pbrMetallicRoughness": {"roughnessFactor": 0}}])));
    std::fs::create_dir(place.at("out")).unwrap();
    let nothing: &[&str] = &["the scene has nothing to bake"];
    place.assert_refused([
        ("bake unlit.glb -o out --environment 0", nothing),
        ("bake unlit.glb -o out --environment 0 --texels-per-metre 4 --radius .05", nothing),
        ("bake mirror.glb -o out --environment 0", nothing),
        ("bake model.glb -o out --environment 0 --json out/model.glb", &["--json", "-o writes it too"]),
        ("bake model.glb -o out --environment 0 --json out/large_error.exr", &["--json", "-o writes it too"]),
        ("bake cornell -o out --texels-per-metre 4 --json out/scene.bin", &["--json", "-o writes it too"]),
        ("bake model.glb -o out --exposure 1", &["--exposure 1", "add --preview"]),
    ]);
}

/// The sky's light is in the maps, and a file that is kept loses nothing that it had.
#[test]
fn only_scenes_that_are_written_anew_lose_their_sky() {
    let (_place, path) = instances().written(&[]);
    let (mut scene, file) = (open(&path), File::open(&path).unwrap());
    scene.lights.push(Light { name: "sky".into(), kind: LightKind::Environment { radiance: Vec3::ONE } });
    let warnings = |file: Option<&File>| Layout::of_file(&scene, file, 4.0, MAX_SIDE).unwrap().warnings;
    assert_eq!(warnings(Some(&file)), Vec::<String>::new());
    assert!(matches!(&warnings(None)[..], [warning] if warning.contains("scene.gltf omits")));
}

/// Compressed meshes get coordinates too, and are then no longer compressed.
#[test]
fn compressed_files_are_extended_unpacked() {
    let place = Place::new();
    for (name, json) in [("draco", draco_square()), ("meshopt", compressed("EXT_meshopt_compression"))] {
        place.write(&format!("{name}.gltf"), json.to_string());
        let baked = Baked::new(&place.at(&format!("{name}.gltf")), Atlas::Off);
        assert!(baked.purposes.contains("no longer compressed"), "{}", baked.purposes);
        let written = std::fs::read_to_string(&baked.path).unwrap();
        assert!(!written.contains("compression"), "{written}");
        assert_valid(&baked.file());
        let (before, after) = (&baked.scene, &open(&baked.path));
        let area =
            |scene: &Scene| scene.meshes.iter().flat_map(|mesh| (0..mesh.triangles.len()).map(|triangle| mesh.area(triangle))).sum::<f64>();
        assert!((area(before) / area(after) - 1.0).abs() < 1e-6 && !after.meshes[0].uvs[1].is_empty());
    }
}
