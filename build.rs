//! Compiles every kernel of `glsl/kernels` to SPIR-V and writes `kernels.rs`: for each kernel a
//! struct whose fields are its buffers, with everything else that reflection knows of it. Writes `records.rs` too, the structs
//! in those buffers and in push constants, and `charts.md`, the charts of the guide.
//!
//! Without the feature `compile-glsl` the SPIR-V is that of `glsl/prebuilt`, where `tools/package` puts it in the packed crate.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use sha2::{Digest, Sha256};
use spirq::ReflectConfig;
use spirq::ty::{AccessType, DescriptorType, StructType, Type};
use spirq::var::Variable;

#[cfg(feature = "compile-glsl")]
#[path = "glsl/compile.rs"]
mod compile;
#[path = "src/constants.rs"]
mod constants;

fn main() {
    println!("cargo:rerun-if-changed=src/constants.rs");
    println!("cargo:rerun-if-changed=glsl");
    let glsl = PathBuf::from(env::var("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("glsl");
    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo sets it"));

    let modules = modules(&glsl);
    let spirv = out.join("spirv");
    // Kernels that are gone stay in an old folder, and the packed crate would have them.
    let _ = fs::remove_dir_all(&spirv);
    fs::create_dir_all(&spirv).expect("OUT_DIR can be written");
    let mut structs = String::new();
    let mut layouts = String::new();
    let mut max_buffers = 0;
    let mut scene_elements: BTreeMap<String, String> = BTreeMap::new();
    let mut records: BTreeMap<String, String> = BTreeMap::new();
    for Module { name, path, words, files } in &modules {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        fs::write(spirv.join(format!("{name}.spv")), bytes).expect("OUT_DIR can be written");
        let kernel = Kernel { votes_in_loops: files.iter().any(|file| file == "builder/persistent.glsl"), ..reflect(words) };
        for Buffer { name: buffer, element, .. } in &kernel.scene {
            assert_eq!(scene_elements.entry(buffer.clone()).or_insert(element.clone()), element, "{buffer} of set 0 in {name}");
        }
        let scene_bindings = world_of(name, &kernel.scene).map_or(0, |(_, buffers)| buffers.len());
        max_buffers = max_buffers.max(scene_bindings + kernel.buffers.len());
        write_kernel(&mut structs, path, name, &kernel);
        write_layouts(&mut layouts, name, &kernel);
        let sources: Vec<String> = files.iter().map(|file| read(&glsl, file)).collect();
        for record in kernel.records.iter().map(struct_name) {
            records.entry(record).or_insert_with_key(|record| rust_record(&sources, record));
        }
    }
    fs::write(spirv.join(LIST), list(&glsl, &modules)).expect("OUT_DIR can be written");
    write_worlds(&mut structs, &scene_elements);
    let buffer_count =
        format!("/// Storage buffers that the kernel with the most of them binds.\npub(crate) const MAX_BUFFERS: u32 = {max_buffers};\n");
    let source = format!(
        "{structs}\n{buffer_count}\n/// Every struct in a buffer or push-constant block of a kernel.\npub(crate) const STRUCTS: &[(&str, ReflectedStruct)] = &[\n{layouts}];\n"
    );
    fs::write(out.join("kernels.rs"), source).expect("OUT_DIR can be written");
    fs::write(out.join("records.rs"), format!("records! {{\n{}\n}}\n", records.into_values().collect::<Vec<_>>().join("\n")))
        .expect("OUT_DIR can be written");
    fs::write(out.join("charts.md"), charts()).expect("OUT_DIR can be written");
}

/// A kernel's SPIR-V.
struct Module {
    name: String,
    /// Within `glsl`, as are the files.
    path: String,
    words: Vec<u32>,
    /// What it was made from.
    files: Vec<String>,
}

/// Every kernel, compiled from its GLSL.
#[cfg(feature = "compile-glsl")]
fn modules(glsl: &Path) -> Vec<Module> {
    // A fault in a shared file is found by every kernel that includes it, and shown once.
    let mut failures = BTreeSet::new();
    let mut modules = Vec::new();
    for source in compile::sources(glsl) {
        match compile::compile(glsl, &source, constants::SHARED_WITH_GLSL, &|_, text| text) {
            Ok(compile::Compiled { words, files }) => {
                files.iter().for_each(|file| println!("cargo:rerun-if-changed={}", file.display()));
                let within = |file: &PathBuf| file.strip_prefix(glsl).expect("GLSL is in its folder").to_string_lossy().into_owned();
                modules.push(Module { name: source.name, path: source.path, words, files: files.iter().map(within).collect() });
            }
            Err(message) => drop(failures.insert(message)),
        }
    }
    if !failures.is_empty() {
        failures.iter().for_each(|message| eprint!("{message}"));
        std::process::exit(1);
    }
    modules
}

/// Every kernel, as it was compiled before.
#[cfg(not(feature = "compile-glsl"))]
fn modules(glsl: &Path) -> Vec<Module> {
    let prebuilt = glsl.join("prebuilt");
    let end = |what: &str| -> ! {
        println!("cargo::error={what}; add photonmill's feature compile-glsl, which needs the library shaderc, or use the packed crate");
        std::process::exit(0);
    };
    let Ok(list) = fs::read_to_string(prebuilt.join(LIST)) else {
        end("this copy of photonmill has no compiled kernels (glsl/prebuilt), as the packed crate does")
    };
    let (sources, kernels) = list.split_once('\n').unwrap_or_default();
    if sources != hash(glsl) {
        end("the compiled kernels in glsl/prebuilt are of other sources than those in glsl");
    }
    let module = |line: &str| {
        let mut words = line.split(' ').map(str::to_owned);
        let [name, path] = [(); 2].map(|()| words.next().expect("a kernel has a name and a path"));
        let file = prebuilt.join(format!("{name}.spv"));
        let bytes = fs::read(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let spirv = bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().expect("four bytes")));
        Module { name, path, words: spirv.collect(), files: words.collect() }
    };
    kernels.lines().map(module).collect()
}

/// File in which kernels are listed: after the hash of the sources, a line for each with its name, its path, and the files that it
/// was made from.
const LIST: &str = "kernels.txt";

fn list(glsl: &Path, modules: &[Module]) -> String {
    let line = |Module { name, path, files, .. }: &Module| format!("{name} {path} {}\n", files.join(" "));
    format!("{}\n{}", hash(glsl), modules.iter().map(line).collect::<String>())
}

/// SHA-256 of all that decides the SPIR-V.
fn hash(glsl: &Path) -> String {
    let mut hash = Sha256::new();
    let mut add = |name: &str, content: &[u8]| hash.update([name.as_bytes(), &content.len().to_le_bytes(), content].concat());
    let mut folders = vec![glsl.to_owned()];
    let mut files = BTreeSet::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
            let path = entry.expect("a folder can be read").path();
            let is_source = path.extension().is_some_and(|kind| ["glsl", "comp", "rs"].iter().any(|known| kind == *known));
            if path.is_dir() {
                folders.push(path);
            } else if is_source {
                files.insert(path);
            }
        }
    }
    for path in files {
        let name = path.strip_prefix(glsl).expect("GLSL is in its folder").to_string_lossy().replace('\\', "/");
        add(&name, &fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())));
    }
    for (name, value) in constants::SHARED_WITH_GLSL {
        add(name, &value.to_le_bytes());
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

fn read(glsl: &Path, name: &str) -> String {
    fs::read_to_string(glsl.join(name)).unwrap_or_else(|error| panic!("glsl/{name}: {error}"))
}

/// A struct that one of these files declares, with its comments, as the macro `records!` of `src/records.rs` takes it.
fn rust_record(sources: &[String], name: &str) -> String {
    let start = format!("struct {name} {{\n");
    let split = sources.iter().find_map(|source| source.split_once(&start));
    let (before, after) = split.unwrap_or_else(|| panic!("no file declares {name}"));
    let [comment, fields] = [before.rsplit("\n\n").next(), after.split("};").next()].map(|part| part.expect("a split has a part"));
    let declaration = format!("{comment}{start}{fields}}}");
    let rust = declaration.lines().map(|line| match line.trim().split([' ', ';']).collect::<Vec<_>>()[..] {
        ["//", ..] => line.replacen("//", "///", 1),
        ["struct", name, "{"] => format!("{name} {{"),
        ["}"] => "}".to_owned(),
        [kind, field, ""] => format!("    {field}: {},", rust_type(kind)),
        _ => panic!("{line}: a record has a field a line"),
    });
    rust.collect::<Vec<_>>().join("\n")
}

fn rust_type(glsl: &str) -> &str {
    match glsl {
        "uint" => "u32",
        "float" => "f32",
        "vec2" => "Vec2",
        "vec3" => "Vec3",
        "uvec2" => "UVec2",
        "uvec3" => "UVec3",
        record => record,
    }
}

/// Charts and pictures of the guide.
const CHARTS: [&str; 12] = [
    "tools/study/open-box-main.svg",
    "tools/study/open-box-radius.svg",
    "tools/study/open-box-paper.svg",
    "tools/study/cornell-spheres-main.svg",
    "tools/bench/compaction-lavapipe.svg",
    "tools/bench/peers.svg",
    "tools/bench/h200/compaction.svg",
    "tools/bench/h200-scale/scale-photons.svg",
    "tools/bench/h200-scale/scale-triangles.svg",
    "src/guide/sunlit-room.png",
    "src/guide/dispersion.png",
    "src/guide/window.png",
];

/// Markdown that defines a link for each chart, named as its file. The link is the chart itself, as rustdoc keeps no files
/// beside its pages.
fn charts() -> String {
    let definition = |path: &str| {
        println!("cargo:rerun-if-changed={path}");
        let content = fs::read(path).unwrap_or_else(|error| panic!("{path}: {error}"));
        let (stem, ending) = path.rsplit_once('.').expect("a file's name has an ending");
        let name = stem.rsplit('/').next().expect("a path has a last part");
        let kind = if ending == "svg" { "svg+xml" } else { ending };
        format!("[{name}]: data:image/{kind};base64,{}\n", BASE64.encode(content))
    };
    CHARTS.map(definition).concat() + "\n"
}

struct Buffer {
    name: String,
    binding: u32,
    access: AccessType,
    /// Rust type of an element.
    element: String,
    /// Bytes from one element to the next in GLSL, where it may be a part of Rust's.
    stride: usize,
}

/// Rust types of elements that kernels see as words, by the names of their buffers; all other elements are what they are in GLSL.
const PACKED: [(&str, &[&str]); 5] = [
    ("crate::photon::StoredPhoton", &["photons", "sorted_photons", "tree_photons"]),
    ("crate::photon::Origin", &["origins", "tree_origins"]),
    ("crate::photon::MapPhoton", &["map", "sorted_map", "landed"]),
    ("crate::photon_state::PackedPhotonState", &["paths", "next_paths"]),
    (
        "u64",
        &[
            "film",
            "film_totals",
            "low_squares",
            "high_squares",
            "pass_sums",
            "estimates",
            "differences",
            "near_sums",
            "film_sums",
            "film_squares",
            "part_totals",
            "sums_of_block",
            "surface_sums_of_block",
            "surface_sums",
            "part_sums",
            "surface_squares",
        ],
    ),
];

/// Set 0 of each world: the buffers of its scene, in the order of their bindings.
const WORLDS: [(&str, &[&str]); 2] = [
    ("Room", &["rooms", "walls", "lights", "points"]),
    (
        "Scene",
        &[
            "nodes",
            "triangles",
            "normals",
            "uvs",
            "materials",
            "textures",
            "texels",
            "emitters",
            "caustic_targets",
            "planes",
            "light_nodes",
            "light_regions",
            "light_shares",
            "openings",
            "vertex_colours",
            "texels_1",
            "texels_2",
            "texels_3",
            "triangle_layers",
            "layered_materials",
            "albedos",
        ],
    ),
];

fn element_type(buffer: &str, element: &Type) -> String {
    if let Type::Struct(record) = element {
        return format!("crate::records::{}", struct_name(record));
    }
    let packed = PACKED.iter().find(|(_, buffers)| buffers.contains(&buffer)).map(|(packed, _)| *packed);
    let number = element.to_string();
    let own = || match number.as_str() {
        known @ ("u32" | "f32") => known,
        "vec2<u32>" => "glam::UVec2",
        "vec2<f32>" => "glam::Vec2",
        "vec4<f32>" => "glam::Vec4",
        "vec4<u32>" => "[u32; 4]",
        other => panic!("buffer {buffer}: {other} has no Rust type here"),
    };
    packed.unwrap_or_else(own).to_owned()
}

#[derive(Default)]
struct Kernel {
    /// Of set 1: its own.
    buffers: Vec<Buffer>,
    /// Of set 0.
    scene: Vec<Buffer>,
    /// (name, id) of the named specialization constants.
    constants: Vec<(String, u32)>,
    push: Option<StructType>,
    /// Its lanes vote in the loop of builder/persistent.glsl.
    votes_in_loops: bool,
    records: Vec<StructType>,
    /// Stride of the array that each record lies in, by record name.
    strides: Vec<(String, usize)>,
}

/// The module with `false` in place of constants that follow from others by `&&`, `||` and the like, and 1 in place of those by `?`, which
/// spirq cannot evaluate: nothing that is read here depends on them.
fn without_operations_on_truth(words: &[u32]) -> Vec<u32> {
    const CONSTANT_FALSE: u32 = 42 | 3 << 16;
    const SPEC_CONSTANT_OP: u32 = 52;
    const LOGICAL: std::ops::RangeInclusive<u32> = 164..=168;
    const CONSTANT: u32 = 43 | 4 << 16;
    const SELECT: u32 = 169;
    let (header, mut rest) = words.split_at(5);
    let mut result = header.to_vec();
    while let Some(first) = rest.first() {
        let (instruction, others) = rest.split_at((first >> 16) as usize);
        match instruction {
            [_, kind, id, operation, ..] if first & 0xffff == SPEC_CONSTANT_OP && LOGICAL.contains(operation) => {
                result.extend([CONSTANT_FALSE, *kind, *id]);
            }
            [_, kind, id, SELECT, ..] if first & 0xffff == SPEC_CONSTANT_OP => result.extend([CONSTANT, *kind, *id, 1]),
            _ => result.extend(instruction),
        }
        rest = others;
    }
    result
}

fn reflect(words: &[u32]) -> Kernel {
    let words = without_operations_on_truth(words);
    let entry_points = ReflectConfig::new().spv(words).ref_all_rscs(true).reflect().expect("spirq reads what shaderc wrote");
    let mut kernel = Kernel::default();
    for variable in &entry_points[0].vars {
        match variable {
            Variable::Descriptor { desc_bind, desc_ty: DescriptorType::StorageBuffer(_), ty, .. } => {
                let Type::Struct(block) = ty else { panic!("a storage buffer that is no block: {ty:?}") };
                let [member] = block.members.as_slice() else { panic!("a buffer block holds one array: {block:?}") };
                let Type::Array(array) = &member.ty else { panic!("a buffer block holds one array: {block:?}") };
                let name = member.name.clone().expect("buffers have names");
                let stride = array.stride.expect("buffer arrays have a stride");
                let element = element_type(&name, &array.element_ty);
                let buffer = Buffer { element, stride, name, binding: desc_bind.bind(), access: member.access_ty };
                if desc_bind.set() == 0 { &mut kernel.scene } else { &mut kernel.buffers }.push(buffer);
                if let Type::Struct(record) = array.element_ty.as_ref() {
                    kernel.strides.push((struct_name(record), stride));
                    kernel.records.push(record.clone());
                }
            }
            Variable::PushConstant { ty: Type::Struct(block), .. } => {
                let [member] = block.members.as_slice() else { panic!("a push-constant block holds one record: {block:?}") };
                let Type::Struct(record) = &member.ty else { panic!("a push-constant block holds one record: {block:?}") };
                kernel.push = Some(record.clone());
                kernel.records.push(record.clone());
            }
            Variable::SpecConstant { name: Some(name), spec_id, .. } if !name.is_empty() => {
                kernel.constants.push((name.clone(), *spec_id));
            }
            _ => {}
        }
    }
    kernel.buffers.sort_by_key(|buffer| buffer.binding);
    if let Some([one, two]) = kernel.buffers.windows(2).find(|pair| pair[0].binding == pair[1].binding) {
        panic!("{} and {} have the same binding, {}", one.name, two.name, one.binding);
    }
    kernel.constants.sort();
    // A record inside a record has a twin of its own.
    let mut next = 0;
    while next < kernel.records.len() {
        let inner: Vec<StructType> = kernel.records[next]
            .members
            .iter()
            .filter_map(|member| match &member.ty {
                Type::Struct(record) => Some(record.clone()),
                _ => None,
            })
            .collect();
        kernel.records.extend(inner);
        next += 1;
    }
    kernel
}

fn struct_name(record: &StructType) -> String {
    record.name.clone().expect("records have names")
}

fn camel_case(name: &str) -> String {
    name.split('_').map(|part| part[..1].to_uppercase() + &part[1..]).collect()
}

fn write_kernel(source: &mut String, path: &str, name: &str, kernel: &Kernel) {
    let type_name = camel_case(name);
    let push = kernel.push.as_ref().map_or("()".to_owned(), |record| format!("crate::records::{}", struct_name(record)));
    writeln!(source, "/// `glsl/{path}`.\npub(crate) struct {type_name}<'a> {{").unwrap();
    let world = world_of(name, &kernel.scene);
    if let Some((world, _)) = world {
        writeln!(source, "    pub(crate) {}: &'a {world},", world.to_lowercase()).unwrap();
    }
    for buffer in &kernel.buffers {
        writeln!(source, "    pub(crate) {}: &'a Buffer<{}>,", buffer.name, buffer.element).unwrap();
    }
    writeln!(source, "}}\n\nimpl Kernel for {type_name}<'_> {{").unwrap();
    writeln!(source, "    type Push = {push};").unwrap();
    writeln!(source, "    const MODULE: Module = Module {{").unwrap();
    writeln!(source, "        name: \"{name}\",").unwrap();
    writeln!(source, "        spirv: include_bytes!(concat!(env!(\"OUT_DIR\"), \"/spirv/{name}.spv\")),").unwrap();
    writeln!(source, "        push_bytes: size_of::<{push}>() as u32,").unwrap();
    writeln!(source, "        scene_bindings: {},", world.map_or(0, |(_, bindings)| bindings.len())).unwrap();
    writeln!(source, "        votes_in_loops: {},", kernel.votes_in_loops).unwrap();
    writeln!(source, "        bindings: &[").unwrap();
    for Buffer { binding, access, .. } in &kernel.buffers {
        let reads = *access != AccessType::WriteOnly;
        let writes = *access != AccessType::ReadOnly;
        writeln!(source, "            Binding {{ binding: {binding}, reads: {reads}, writes: {writes} }},").unwrap();
    }
    writeln!(source, "        ],\n        constants: &[").unwrap();
    for (constant, id) in &kernel.constants {
        writeln!(source, "            (\"{constant}\", {id}),").unwrap();
    }
    writeln!(source, "        ],\n    }};\n").unwrap();
    writeln!(
        source,
        "    const FITS: () = {{\n        assert!(size_of::<{push}>() <= super::kernel::PUSH_BYTES as usize, \"push constants of {name}\");"
    )
    .unwrap();
    for Buffer { name: buffer, element, stride, .. } in kernel.scene.iter().chain(&kernel.buffers) {
        let fits = format!("size_of::<{element}>().is_multiple_of({stride}) || {stride}usize.is_multiple_of(size_of::<{element}>())");
        writeln!(source, "        assert!({fits}, \"elements of {buffer} in {name}\");").unwrap();
    }
    writeln!(source, "    }};\n").unwrap();
    let scene = world.map_or("Vec::new()".to_owned(), |(world, _)| format!("self.{}.buffers()", world.to_lowercase()));
    writeln!(source, "    fn scene(&self) -> Vec<&AnyBuffer> {{\n        {scene}\n    }}\n").unwrap();
    write_buffers(source, kernel.buffers.iter().map(|buffer| buffer.name.as_str()));
    writeln!(source, "}}\n").unwrap();
}

fn write_buffers<'a>(source: &mut String, names: impl Iterator<Item = &'a str>) {
    let fields: Vec<String> = names.map(|name| format!("self.{name}.any()")).collect();
    writeln!(source, "    fn buffers(&self) -> Vec<&AnyBuffer> {{\n        vec![{}]\n    }}", fields.join(", ")).unwrap();
}

/// The world whose scene a kernel looks at, where it looks at one: name, and buffers in the order of their bindings.
fn world_of(kernel: &str, scene: &[Buffer]) -> Option<(&'static str, &'static [&'static str])> {
    let first = scene.first()?;
    let world = *WORLDS.iter().find(|(_, buffers)| buffers.contains(&first.name.as_str())).unwrap_or_else(|| {
        panic!("{} of {kernel} is in no scene; set 0 is for scenes", first.name);
    });
    for Buffer { name, binding, .. } in scene {
        assert_eq!(world.1.get(*binding as usize), Some(&name.as_str()), "binding {binding} of set 0 in {kernel}");
    }
    Some(world)
}

/// The scene of each world, by the types that kernels give its buffers.
fn write_worlds(source: &mut String, elements: &BTreeMap<String, String>) {
    for (world, buffers) in WORLDS {
        writeln!(source, "/// What kernels look at: set 0, the same for all of them.\npub(crate) struct {world} {{").unwrap();
        for name in buffers {
            writeln!(source, "    pub(crate) {name}: Buffer<{}>,", elements[*name]).unwrap();
        }
        writeln!(source, "}}\n\nimpl {world} {{").unwrap();
        write_buffers(source, buffers.iter().copied());
        writeln!(source, "}}\n").unwrap();
    }
}

fn write_layouts(source: &mut String, kernel_name: &str, kernel: &Kernel) {
    for record in &kernel.records {
        let name = struct_name(record);
        let stride = kernel.strides.iter().find(|(of, _)| *of == name).map(|(_, stride)| *stride);
        let fields: String = record
            .members
            .iter()
            .map(|member| {
                let kind = match &member.ty {
                    Type::Struct(inner) => struct_name(inner),
                    other => other.to_string(),
                };
                let field = member.name.as_deref().expect("fields have names");
                let offset = member.offset.expect("buffer fields have offsets");
                format!("Field {{ name: \"{field}\", kind: \"{kind}\", offset: {offset} }}, ")
            })
            .collect();
        writeln!(source, "    (\"{kernel_name}\", ReflectedStruct {{ name: \"{name}\", stride_bytes: {stride:?}, fields: &[{fields}] }}),")
            .unwrap();
    }
}
