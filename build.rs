//! Compiles every kernel of `glsl/kernels` to SPIR-V and writes `kernels.rs`: for each kernel a
//! struct whose fields are its buffers, with everything else that reflection knows of it. Writes `charts.md` too: the
//! charts of the guide.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::{env, fs};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use compile::{Compiled, compile};
use spirq::ReflectConfig;
use spirq::ty::{AccessType, DescriptorType, StructType, Type};
use spirq::var::Variable;

#[path = "glsl/compile.rs"]
mod compile;
#[path = "src/constants.rs"]
#[expect(dead_code, reason = "only the table of all constants is used here")]
mod constants;

fn main() {
    println!("cargo:rerun-if-changed=src/constants.rs");
    println!("cargo:rerun-if-changed=glsl");
    let glsl = PathBuf::from(env::var("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("glsl");
    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo sets it"));

    // A fault in a shared file is found by every kernel that includes it, and shown once.
    let mut failures = BTreeSet::new();
    let mut structs = String::new();
    let mut layouts = String::new();
    let mut max_buffers = 0;
    for source in compile::sources(&glsl) {
        let compile::Source { name, path, .. } = &source;
        match compile(&glsl, &source, constants::SHARED_WITH_GLSL, &|_, text| text) {
            Ok(Compiled { words, files }) => {
                files.iter().for_each(|file| println!("cargo:rerun-if-changed={}", file.display()));
                let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
                fs::write(out.join(format!("{name}.spv")), bytes).expect("OUT_DIR can be written");
                let kernel =
                    Kernel { votes_in_loops: files.iter().any(|file| file.ends_with("builder/persistent.glsl")), ..reflect(&words) };
                max_buffers = max_buffers.max(kernel.buffers.len());
                write_kernel(&mut structs, path, name, &kernel);
                write_layouts(&mut layouts, name, &kernel);
            }
            Err(message) => drop(failures.insert(message)),
        }
    }
    if !failures.is_empty() {
        failures.iter().for_each(|message| eprint!("{message}"));
        std::process::exit(1);
    }
    let buffer_count =
        format!("/// Storage buffers that the kernel with the most of them binds.\npub const MAX_BUFFERS: u32 = {max_buffers};\n");
    let source = format!(
        "{structs}\n{buffer_count}\n/// Every struct in a buffer or push-constant block of a kernel.\npub const STRUCTS: &[(&str, ReflectedStruct)] = &[\n{layouts}];\n"
    );
    fs::write(out.join("kernels.rs"), source).expect("OUT_DIR can be written");
    fs::write(out.join("charts.md"), charts()).expect("OUT_DIR can be written");
}

/// Charts of the guide, under `tools`.
const CHARTS: [&str; 9] = [
    "study/open-box-overview",
    "study/open-box-radius",
    "study/open-box-paper",
    "study/cornell-spheres-overview",
    "bench/compaction-lavapipe",
    "bench/peers",
    "bench/h200/compaction",
    "bench/h200-scale/scale-photons",
    "bench/h200-scale/scale-triangles",
];

/// Markdown that defines a link for each chart, named as its file. The link is the chart itself, as rustdoc keeps no files
/// beside its pages.
fn charts() -> String {
    let definition = |chart: &str| {
        let path = format!("tools/{chart}.svg");
        println!("cargo:rerun-if-changed={path}");
        let svg = fs::read(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
        let name = chart.rsplit('/').next().expect("a path has a last part");
        format!("[{name}]: data:image/svg+xml;base64,{}\n", BASE64.encode(svg))
    };
    CHARTS.map(definition).concat() + "\n"
}

struct Buffer {
    name: String,
    set: u32,
    binding: u32,
    access: AccessType,
}

#[derive(Default)]
struct Kernel {
    buffers: Vec<Buffer>,
    /// (name, id) of the named specialization constants.
    constants: Vec<(String, u32)>,
    push: Option<StructType>,
    /// Its lanes vote in the loop of builder/persistent.glsl.
    votes_in_loops: bool,
    records: Vec<StructType>,
    /// Stride of the array that each record lies in, by record name.
    strides: Vec<(String, usize)>,
}

fn reflect(words: &[u32]) -> Kernel {
    let entry_points = ReflectConfig::new().spv(words).ref_all_rscs(true).reflect().expect("spirq reads what shaderc wrote");
    let mut kernel = Kernel::default();
    for variable in &entry_points[0].vars {
        match variable {
            Variable::Descriptor { desc_bind, desc_ty: DescriptorType::StorageBuffer(_), ty, .. } => {
                let Type::Struct(block) = ty else { panic!("a storage buffer that is no block: {ty:?}") };
                let [member] = block.members.as_slice() else { panic!("a buffer block holds one array: {block:?}") };
                kernel.buffers.push(Buffer {
                    name: member.name.clone().expect("buffers have names"),
                    set: desc_bind.set(),
                    binding: desc_bind.bind(),
                    access: member.access_ty,
                });
                if let Type::Array(array) = &member.ty
                    && let Type::Struct(record) = array.element_ty.as_ref()
                {
                    kernel.strides.push((struct_name(record), array.stride.expect("buffer arrays have a stride")));
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
    kernel.buffers.sort_by_key(|buffer| (buffer.set, buffer.binding));
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
    writeln!(source, "/// `glsl/{path}`.\npub struct {type_name}<'a> {{").unwrap();
    for buffer in &kernel.buffers {
        writeln!(source, "    pub {}: &'a Buffer,", buffer.name).unwrap();
    }
    writeln!(source, "}}\n\nimpl Kernel for {type_name}<'_> {{").unwrap();
    writeln!(source, "    type Push = {push};").unwrap();
    writeln!(source, "    const MODULE: Module = Module {{").unwrap();
    writeln!(source, "        name: \"{name}\",").unwrap();
    writeln!(source, "        spirv: include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{name}.spv\")),").unwrap();
    writeln!(source, "        push_bytes: size_of::<{push}>() as u32,").unwrap();
    writeln!(source, "        votes_in_loops: {},", kernel.votes_in_loops).unwrap();
    writeln!(source, "        bindings: &[").unwrap();
    for Buffer { name, set, binding, access } in &kernel.buffers {
        let reads = *access != AccessType::WriteOnly;
        let writes = *access != AccessType::ReadOnly;
        writeln!(source, "            Binding {{ name: \"{name}\", set: {set}, binding: {binding}, reads: {reads}, writes: {writes} }},")
            .unwrap();
    }
    writeln!(source, "        ],\n        constants: &[").unwrap();
    for (constant, id) in &kernel.constants {
        writeln!(source, "            (\"{constant}\", {id}),").unwrap();
    }
    writeln!(source, "        ],\n    }};\n").unwrap();
    // The least that a Vulkan device may offer.
    writeln!(source, "    const FITS: () = assert!(size_of::<{push}>() <= 128, \"push constants of {name}\");\n").unwrap();
    writeln!(source, "    fn buffers(&self) -> Vec<&Buffer> {{").unwrap();
    let fields: Vec<String> = kernel.buffers.iter().map(|buffer| format!("self.{}", buffer.name)).collect();
    writeln!(source, "        vec![{}]\n    }}\n}}\n", fields.join(", ")).unwrap();
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
