//! Takes the docstrings out of `photonmill.pyi`, where editors find them, for Python itself: as a macro that has one for each name.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

const STUB: &str = "photonmill.pyi";

fn main() {
    println!("cargo::rerun-if-changed={STUB}");
    let stub = std::fs::read_to_string(STUB).expect("the stub is there");
    let mut macro_text = "macro_rules! doc {\n".to_owned();
    for (name, text) in docstrings(&stub) {
        writeln!(macro_text, "    ({name:?}) => {{ {text:?} }};").unwrap();
    }
    let folder = std::env::var("OUT_DIR").expect("cargo gives a folder");
    std::fs::write(Path::new(&folder).join("doc.rs"), macro_text + "}\n").expect("the folder takes a file");
}

/// Docstrings by name: of `Class`, with what its `__new__` takes, of `Class.method` and of `function`; the module's has no name.
fn docstrings(stub: &str) -> BTreeMap<String, String> {
    let mut docs = BTreeMap::new();
    let mut class = String::new();
    let mut of = Some(String::new());
    let mut lines = stub.lines();
    while let Some(line) = lines.next() {
        let name_after = |word: &str| {
            let rest = line.trim_start().strip_prefix(word)?;
            Some(rest.chars().take_while(|letter| letter.is_alphanumeric() || *letter == '_').collect::<String>())
        };
        let is_outside = !line.starts_with(' ');
        if let Some(name) = name_after("class ") {
            (class, of) = (name.clone(), Some(name));
        } else if let Some(name) = name_after("def ") {
            of = Some(if is_outside { name } else { format!("{class}.{name}") });
        } else if let Some(text) = line.trim_start().strip_prefix("\"\"\"") {
            let indent = line.len() - line.trim_start().len();
            let mut doc = text.to_owned();
            while !doc.ends_with("\"\"\"") {
                let next = lines.next().expect("a docstring ends");
                doc += "\n";
                doc += next.get(indent..).unwrap_or("");
            }
            let doc = doc.trim_end_matches("\"\"\"").trim_end().to_owned();
            // What follows a field is of that alone.
            match of.take() {
                Some(name) if name.ends_with(".__new__") => {
                    let known: &mut String = docs.get_mut(&class).expect("a class has a docstring");
                    *known += "\n\n";
                    *known += &doc;
                }
                Some(name) => drop(docs.insert(name, doc)),
                None => {}
            }
        }
    }
    docs
}
