//! Compiles the shaders of glsl/ to SPIR-V, a warning being an error, and writes the tables that `bake::device::shaders` and
//! (names that begin with `view_`) `view::shaders` include: code, local size, push constant size, and the layout of every
//! structure for the layout tests.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

#[path = "src/bake/device/shared.rs"]
mod shared;

fn main() {
    println!("cargo:rerun-if-changed=glsl");
    println!("cargo:rerun-if-changed=src/bake/device/shared.rs");
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let mut sources: Vec<_> = std::fs::read_dir("glsl")
        .expect("glsl/ is part of the package")
        .map(|entry| entry.expect("glsl/ can be listed").path())
        .filter(|path| kind(path).is_some())
        .collect();
    sources.sort();
    let (view, bake): (Vec<_>, Vec<_>) = sources
        .into_iter()
        .partition(|path| stem(path).starts_with("view_"));
    let compiler = shaderc::Compiler::new().expect("shaderc starts");
    for (name, sources) in [("shaders.rs", bake), ("view_shaders.rs", view)] {
        let table = table(&compiler, &out, &sources);
        std::fs::write(out.join(name), table).expect("OUT_DIR can be written");
    }
}

/// The stage that a file's extension names, with what is put behind the stem in constants' names.
fn kind(path: &Path) -> Option<(shaderc::ShaderKind, &'static str)> {
    match path.extension()?.to_str()? {
        "comp" => Some((shaderc::ShaderKind::Compute, "")),
        "vert" => Some((shaderc::ShaderKind::Vertex, "_VERT")),
        "frag" => Some((shaderc::ShaderKind::Fragment, "_FRAG")),
        _ => None,
    }
}

fn stem(path: &Path) -> &str {
    let stem = path.file_stem().expect("a file has a stem");
    stem.to_str().expect("shader names are ASCII")
}

/// The Rust source of a table of shaders; writes their SPIR-V beside it.
fn table(compiler: &shaderc::Compiler, out: &Path, sources: &[PathBuf]) -> String {
    let mut table = String::new();
    let mut layouts = BTreeMap::new();
    for path in sources {
        let (_, suffix) = kind(path).expect("only those were listed");
        let file = path.file_name().and_then(|n| n.to_str()).expect("ASCII");
        let spirv = compile(compiler, path, shaderc::OptimizationLevel::Performance);
        let plain = Module::parse(&compile(compiler, path, shaderc::OptimizationLevel::Zero));
        std::fs::write(out.join(format!("{file}.spv")), bytes(&spirv))
            .expect("OUT_DIR can be written");
        let name = stem(path);
        let constant = name.to_uppercase() + suffix;
        writeln!(
            table,
            "/// `glsl/{file}`.\npub const {constant}: Shader = Shader {{ name: {name:?}, spirv: include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{file}.spv\")), push_bytes: {}, local_size: {:?} }};",
            plain.push_bytes(),
            plain.local_size,
        )
        .expect("a String takes it");
        layouts.extend(plain.layouts());
    }
    writeln!(table, "/// Structure, size of its array elements (0: none seen), members with their offsets, as SPIR-V has them.")
        .expect("a String takes it");
    writeln!(
        table,
        "#[cfg(test)]\npub const LAYOUTS: &[(&str, &[(&str, u32)])] = &["
    )
    .expect("a String takes it");
    for (name, members) in layouts {
        writeln!(table, "    ({name:?}, &{members:?}),").expect("a String takes it");
    }
    writeln!(table, "];").expect("a String takes it");
    table
}

fn compile(
    compiler: &shaderc::Compiler,
    path: &Path,
    level: shaderc::OptimizationLevel,
) -> Vec<u32> {
    let source = std::fs::read_to_string(path).expect("listed above");
    let mut options = shaderc::CompileOptions::new().expect("shaderc starts");
    options.set_target_env(
        shaderc::TargetEnv::Vulkan,
        shaderc::EnvVersion::Vulkan1_3 as u32,
    );
    options.set_warnings_as_errors();
    options.set_optimization_level(level);
    options.set_include_callback(|wanted, _, _, _| {
        let path = Path::new("glsl").join(wanted);
        let content =
            std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(shaderc::ResolvedInclude {
            resolved_name: path.display().to_string(),
            content,
        })
    });
    for (name, value) in shared::MACROS {
        options.add_macro_definition(name, Some(&format!("{value}u")));
    }
    if level == shaderc::OptimizationLevel::Zero {
        options.set_generate_debug_info();
    }
    let file = path.display().to_string();
    match compiler.compile_into_spirv(
        &source,
        kind(path).expect("only those were listed").0,
        &file,
        "main",
        Some(&options),
    ) {
        Ok(artifact) => artifact.as_binary().to_vec(),
        Err(error) => {
            eprintln!("{error}");
            std::process::exit(1);
        }
    }
}

fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|w| w.to_le_bytes()).collect()
}

/// What the table needs of a SPIR-V module.
#[derive(Default)]
struct Module {
    local_size: [u32; 3],
    names: BTreeMap<u32, String>,
    member_names: BTreeMap<(u32, u32), String>,
    offsets: BTreeMap<(u32, u32), u32>,
    strides: BTreeMap<u32, u32>,
    constants: BTreeMap<u32, u32>,
    /// Result id -> opcode, operands.
    types: BTreeMap<u32, (u32, Vec<u32>)>,
    push_pointer: Option<u32>,
}

const OP_NAME: u32 = 5;
const OP_MEMBER_NAME: u32 = 6;
const OP_EXECUTION_MODE: u32 = 16;
const OP_EXECUTION_MODE_ID: u32 = 331;
const OP_TYPE_INT: u32 = 21;
const OP_TYPE_FLOAT: u32 = 22;
const OP_TYPE_VECTOR: u32 = 23;
const OP_TYPE_ARRAY: u32 = 28;
const OP_TYPE_STRUCT: u32 = 30;
const OP_TYPE_POINTER: u32 = 32;
const OP_CONSTANT: u32 = 43;
const OP_SPEC_CONSTANT: u32 = 50;
const OP_VARIABLE: u32 = 59;
const OP_DECORATE: u32 = 71;
const OP_MEMBER_DECORATE: u32 = 72;
const DECORATION_ARRAY_STRIDE: u32 = 6;
const DECORATION_OFFSET: u32 = 35;
const STORAGE_PUSH_CONSTANT: u32 = 9;
const MODE_LOCAL_SIZE: u32 = 17;
const MODE_LOCAL_SIZE_ID: u32 = 38;

impl Module {
    fn parse(words: &[u32]) -> Self {
        let mut module = Self::default();
        let mut size_ids = None;
        let mut rest = &words[5..];
        while let Some(&head) = rest.first() {
            let (length, op) = ((head >> 16) as usize, head & 0xffff);
            let o = &rest[1..length];
            match op {
                OP_NAME => {
                    module.names.insert(o[0], text(&o[1..]));
                }
                OP_MEMBER_NAME => {
                    module.member_names.insert((o[0], o[1]), text(&o[2..]));
                }
                OP_EXECUTION_MODE if o[1] == MODE_LOCAL_SIZE => {
                    module.local_size = [o[2], o[3], o[4]]
                }
                OP_EXECUTION_MODE_ID if o[1] == MODE_LOCAL_SIZE_ID => {
                    size_ids = Some([o[2], o[3], o[4]])
                }
                OP_DECORATE if o[1] == DECORATION_ARRAY_STRIDE => {
                    module.strides.insert(o[0], o[2]);
                }
                OP_MEMBER_DECORATE if o[2] == DECORATION_OFFSET => {
                    module.offsets.insert((o[0], o[1]), o[3]);
                }
                OP_TYPE_INT | OP_TYPE_FLOAT | OP_TYPE_VECTOR | OP_TYPE_ARRAY | OP_TYPE_STRUCT
                | OP_TYPE_POINTER => {
                    module.types.insert(o[0], (op, o[1..].to_vec()));
                }
                OP_CONSTANT | OP_SPEC_CONSTANT => {
                    module.constants.insert(o[1], o[2]);
                }
                OP_VARIABLE if o[2] == STORAGE_PUSH_CONSTANT => module.push_pointer = Some(o[0]),
                _ => {}
            }
            rest = &rest[length..];
        }
        if let Some(ids) = size_ids {
            module.local_size = ids.map(|id| module.constants[&id]);
        }
        module
    }

    fn size(&self, id: u32) -> u32 {
        let (op, o) = &self.types[&id];
        match *op {
            OP_TYPE_INT | OP_TYPE_FLOAT => o[0] / 8,
            OP_TYPE_VECTOR => self.size(o[0]) * o[1],
            OP_TYPE_ARRAY => {
                self.strides
                    .get(&id)
                    .copied()
                    .unwrap_or_else(|| self.size(o[0]))
                    * self.constants[&o[1]]
            }
            OP_TYPE_POINTER => 8,
            _ => (0..o.len() as u32)
                .map(|m| {
                    self.offsets.get(&(id, m)).copied().unwrap_or(0) + self.size(o[m as usize])
                })
                .max()
                .unwrap_or(0),
        }
    }

    fn push_bytes(&self) -> u32 {
        self.push_pointer
            .map_or(0, |pointer| self.size(self.types[&pointer].1[1]))
    }

    /// Members and offsets of every structure that lies in memory.
    fn layouts(&self) -> BTreeMap<String, Vec<(String, u32)>> {
        let structs = self
            .types
            .iter()
            .filter(|(_, (op, _))| *op == OP_TYPE_STRUCT);
        structs
            .filter(|(id, _)| self.offsets.contains_key(&(**id, 0)))
            .filter_map(|(id, (_, members))| {
                let name = self.names.get(id)?.clone();
                let members = (0..members.len() as u32).map(|m| {
                    (
                        self.member_names
                            .get(&(*id, m))
                            .cloned()
                            .unwrap_or_default(),
                        self.offsets[&(*id, m)],
                    )
                });
                Some((name, members.collect()))
            })
            .collect()
    }
}

fn text(words: &[u32]) -> String {
    let bytes: Vec<u8> = bytes(words).into_iter().take_while(|b| *b != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}
