//! Compiles every kernel of `glsl/kernels` to SPIR-V and writes `kernels.rs`: for each kernel a
//! struct whose fields are its buffers, with everything else that reflection knows of it.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

use shaderc::{CompileOptions, Compiler, EnvVersion, OptimizationLevel, ResolvedInclude, ShaderKind, TargetEnv};
use spirq::ReflectConfig;
use spirq::ty::{AccessType, DescriptorType, StructType, Type};
use spirq::var::Variable;

#[path = "src/constants.rs"]
#[expect(dead_code, reason = "only the table of all constants is used here")]
mod constants;

fn main() {
    println!("cargo:rerun-if-changed=src/constants.rs");
    println!("cargo:rerun-if-changed=glsl");
    let glsl = PathBuf::from(env::var("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("glsl");
    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo sets it"));

    let mut kernels: Vec<PathBuf> = fs::read_dir(glsl.join("kernels"))
        .expect("glsl/kernels can be read")
        .map(|entry| entry.expect("glsl/kernels can be read").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "comp"))
        .collect();
    kernels.sort();

    let compiler = Compiler::new().expect("shaderc starts");
    // A fault in a shared file is found by every kernel that includes it, and shown once.
    let mut failures = BTreeSet::new();
    let mut structs = String::new();
    let mut layouts = String::new();
    let mut max_buffers = 0;
    for path in &kernels {
        match compile(&compiler, &glsl, path) {
            Ok(words) => {
                let name = path.file_stem().expect("a kernel has a name").to_string_lossy().into_owned();
                let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
                fs::write(out.join(format!("{name}.spv")), bytes).expect("OUT_DIR can be written");
                let kernel = reflect(&words);
                max_buffers = max_buffers.max(kernel.buffers.len());
                write_kernel(&mut structs, &name, &kernel);
                write_layouts(&mut layouts, &name, &kernel);
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
}

/// SPIR-V of one kernel, or shaderc's message, which names file and line.
///
/// The module is left unoptimised: drivers optimise it anyway, and the optimiser would drop names
/// and unused bindings that reflection needs.
fn compile(compiler: &Compiler, glsl: &Path, path: &Path) -> Result<Vec<u32>, String> {
    let source = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let included = RefCell::new(BTreeSet::new());
    let mut options = CompileOptions::new().expect("shaderc starts");
    options.set_target_env(TargetEnv::Vulkan, EnvVersion::Vulkan1_3 as u32);
    options.set_optimization_level(OptimizationLevel::Zero);
    options.set_warnings_as_errors();
    for (name, value) in constants::SHARED_WITH_GLSL {
        options.add_macro_definition(name, Some(&format!("{value}u")));
    }
    options.set_include_callback(|name, _kind, from, _depth| {
        let file = glsl.join(name);
        included.borrow_mut().insert(file.clone());
        let content = fs::read_to_string(&file).map_err(|error| format!("included from {from}: {}: {error}", file.display()))?;
        Ok(ResolvedInclude { resolved_name: format!("glsl/{name}"), content })
    });
    let shown = path.strip_prefix(glsl.parent().expect("glsl lies in the package")).unwrap_or(path).display().to_string();
    let artifact =
        compiler.compile_into_spirv(&source, ShaderKind::Compute, &shown, "main", Some(&options)).map_err(|error| error.to_string())?;
    println!("cargo:rerun-if-changed={}", path.display());
    for file in included.borrow().iter() {
        println!("cargo:rerun-if-changed={}", file.display());
    }
    let words = artifact.as_binary();
    if let Some(function) = rounded_as_the_device_likes(words) {
        return Err(format!("{shown}: {function} divides or calls a function that devices round differently; use glsl/math.glsl\n"));
    }
    Ok(uncontracted(words))
}

/// Each instruction of a module: its place, its number, and its words.
fn instructions(words: &[u32]) -> impl Iterator<Item = (usize, u32, &[u32])> {
    const HEADER_WORDS: usize = 5;
    let mut at = HEADER_WORDS;
    std::iter::from_fn(move || {
        let first = *words.get(at)?;
        let instruction = (at, first & 0xffff, &words[at..at + (first >> 16) as usize]);
        at += (first >> 16) as usize;
        Some(instruction)
    })
}

const NAME: u32 = 5;
const FUNCTION: u32 = 54;

/// (id, name) of what has a name.
fn names(words: &[u32]) -> impl Iterator<Item = (u32, String)> {
    instructions(words).filter(|(_, op, _)| *op == NAME).map(|(_, _, instruction)| {
        let bytes = instruction[2..].iter().flat_map(|word| word.to_le_bytes());
        (instruction[1], bytes.take_while(|byte| !matches!(byte, 0 | b'(')).map(char::from).collect())
    })
}

/// Functions, by result id, whose names begin with one of these.
fn functions_named(words: &[u32], starts: &[&str]) -> BTreeSet<u32> {
    names(words).filter(|(_, name)| starts.iter().any(|start| name.starts_with(start))).map(|(id, _)| id).collect()
}

/// The first function, other than `native_...`, that does what Vulkan does not define to the bit: divides, takes
/// a dot product, or calls a built-in function that is neither rounding, choice, nor packing.
fn rounded_as_the_device_likes(words: &[u32]) -> Option<String> {
    const CALL_BUILT_IN: u32 = 12;
    let built_in_is_exact = |number: u32| matches!(number, 2..=9 | 37..=45 | 54..=65 | 73..=75);
    let native = functions_named(words, &["native_"]);
    let mut function = 0;
    let offender = instructions(words).find(|(_, op, instruction)| {
        if *op == FUNCTION {
            function = instruction[2];
        }
        // Quotients, remainders, products with matrices and of vectors.
        let is_open = matches!(op, 136 | 140 | 141 | 143..=148) || (*op == CALL_BUILT_IN && !built_in_is_exact(instruction[4]));
        is_open && !native.contains(&function)
    });
    offender.map(|_| names(words).find(|(id, _)| *id == function).map_or_else(String::new, |(_, name)| name))
}

/// Functions whose rounding decides no result: they may fuse a product and a sum.
const MAY_CONTRACT: [&str; 1] = ["intersect_children"];

/// Marks every floating-point operation as one to be rounded by itself, as `precise` does in GLSL: else a
/// driver may fuse and reorder operations in one pipeline and not in another, and a specialization that
/// takes an unused effect away would change the last bit of a result.
fn uncontracted(words: &[u32]) -> Vec<u32> {
    const DECORATE: u32 = 71;
    const NO_CONTRACTION: u32 = 42;
    // OpTypeVoid, the first instruction that may stand after all decorations.
    const FIRST_TYPES: std::ops::RangeInclusive<u32> = 19..=33;
    // Negation, sums, differences, products, quotients, remainders, products of vectors and matrices.
    let is_arithmetic = |op: u32| matches!(op, 127 | 129 | 131 | 133 | 136 | 140..=148);

    let free = functions_named(words, &MAY_CONTRACT);
    let decorated: BTreeSet<u32> = instructions(words)
        .filter(|(_, op, instruction)| *op == DECORATE && instruction[2] == NO_CONTRACTION)
        .map(|(_, _, instruction)| instruction[1])
        .collect();
    let mut function = 0;
    let mut results = Vec::new();
    for (_, op, instruction) in instructions(words) {
        match op {
            FUNCTION => function = instruction[2],
            op if is_arithmetic(op) && !free.contains(&function) && !decorated.contains(&instruction[2]) => results.push(instruction[2]),
            _ => {}
        }
    }
    let place = instructions(words).find(|(_, op, _)| FIRST_TYPES.contains(op)).expect("a module has types").0;
    let decorations = results.iter().flat_map(|result| [DECORATE | 3 << 16, *result, NO_CONTRACTION]);
    words[..place].iter().copied().chain(decorations).chain(words[place..].iter().copied()).collect()
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

fn write_kernel(source: &mut String, name: &str, kernel: &Kernel) {
    let type_name = camel_case(name);
    let push = kernel.push.as_ref().map_or("()".to_owned(), |record| format!("crate::records::{}", struct_name(record)));
    writeln!(source, "/// `glsl/kernels/{name}.comp`.\npub struct {type_name}<'a> {{").unwrap();
    for buffer in &kernel.buffers {
        writeln!(source, "    pub {}: &'a Buffer,", buffer.name).unwrap();
    }
    writeln!(source, "}}\n\nimpl Kernel for {type_name}<'_> {{").unwrap();
    writeln!(source, "    type Push = {push};").unwrap();
    writeln!(source, "    const MODULE: Module = Module {{").unwrap();
    writeln!(source, "        name: \"{name}\",").unwrap();
    writeln!(source, "        spirv: include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{name}.spv\")),").unwrap();
    writeln!(source, "        push_bytes: size_of::<{push}>() as u32,").unwrap();
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
