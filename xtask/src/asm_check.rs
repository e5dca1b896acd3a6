//! `cargo xtask asm-check`: reads the machine code of the traversal kernels.
//!
//! What it proves of every kernel compiled for AVX2 and AVX-512:
//! - It calls nothing but [`CALLS`]. A leaf operation that is not inlined would show: a call per node
//!   costs as much as the node, and its code would be compiled for the baseline.
//! - It panics nowhere but at [`CHECKS`], which are passed once a ray, an instance or 64 rays. A bounds
//!   check in a step would show. A panic knows its place in the source: the kernel loads the address
//!   of a `Location`, whatever the compiler moved or merged.

mod image;

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    process::Command,
};

use image::Image;

/// What kernels may call, as parts of names.
const CALLS: &[&str] = &[
    // Triangles met exactly at an edge.
    "rayburst_simd::triangles::decide_exactly",
    // Memory for rays in flight, once a batch.
    "interleaved::flights::Hangar<",
    "interleaved::flights::SCRATCH",
    "core::ptr::drop_in_place",
    "core::ops::drop::Drop>::drop",
    "free@",
    "__rust_dealloc",
    "thread_local::destructors",
    "std::thread::local::panic_access_error",
    // Empty groups of a bundle, once for 64 rays.
    "memset@",
    "memcpy@",
    // Indices of rays without a bundle: once a batch, and when there are more than ever before.
    "batch::OTHERS",
    // Sorting rays, once for thousands.
    "stream::sort",
    "alloc::raw_vec::RawVec",
    // Rays of a bundle that are in doubt.
    "bundle::walk::Pilot<",
    // Panics have a list of their own.
    "core::slice::index::slice_index_fail",
    "_Unwind_Resume",
    "core::panicking::",
];

/// Where kernels may panic: a file, and a part of the line. None is in a step from node to node.
const CHECKS: &[(&str, &str)] = &[
    // Storing the answer of a ray.
    ("traverse/answers.rs", "self.0[index] ="),
    ("traverse/interleaved/mod.rs", "counts["),
    // Taking the next ray.
    ("traverse/interleaved/mod.rs", "let ray = &self.rays[index];"),
    // Looking at 64 rays, and putting them side by side.
    ("traverse/batch.rs", "stream::sort("),
    ("traverse/batch.rs", "is_coherent(&rays[part"),
    ("bundle/mod.rs", "let part = &rays[first..];"),
    ("bundle/mod.rs", "tracer.isa.load16("),
    ("bundle/mod.rs", "tracer.structure.local(&part["),
    // Answering a ray of a bundle.
    ("bundle/mod.rs", "&rays[index]"),
    ("layout/triangles.rs", "starts[geometry]"),
    // Entering an instance.
    ("src/tlas.rs", "self.placed["),
    ("src/tlas.rs", "self.blases["),
    ("src/tlas.rs", "self.instances["),
    ("src/tlas.rs", "self.tlas.blases["),
    ("src/tlas.rs", "self.tlas.placed["),
    // Memory kept by the thread, once a batch.
    ("std/src/thread/local.rs", ""),
];

/// Kernels that trace nothing, by a part of their names: they may allocate and check bounds.
const NOT_TRACING: &str = "::refit::";

const BINARY: &str = "target/release/rayburst-verify";

/// A function as disassembled.
struct Function {
    name: String,
    start: u64,
    /// Instructions without addresses.
    code: Vec<String>,
}

/// Builds the kernels and checks them.
pub(crate) fn run() -> Result<(), String> {
    // Only this way of mangling tells the kernels apart.
    let build = "rustc --release -p rayburst-verify --no-default-features --bin rayburst-verify -- \
                 -C symbol-mangling-version=v0 -C strip=none";
    let status = Command::new("cargo").args(build.split(' ')).status();
    let status = status.map_err(|e| format!("cannot run cargo: {e}"))?;
    if !status.success() {
        return Err("the kernels do not build".into());
    }
    let functions = parse(&objdump(&["-d", "-C", "--no-show-raw-insn"])?);
    let names = functions.iter().map(|f| (f.start, f.name.as_str())).collect();
    let bytes = fs::read(BINARY).map_err(|e| format!("cannot read {BINARY}: {e}"))?;
    let image = Image::new(bytes, &objdump(&["-R"])?, &names);
    let (mut kernels, mut problems) = (BTreeMap::new(), BTreeSet::new());
    let is_kernel =
        |f: &&Function| f.name.contains("::vectorize::region::<") && !f.name.contains(NOT_TRACING);
    for function in functions.iter().filter(is_kernel) {
        let isa = if function.name.contains("avx512") { "avx512" } else { "avx2" };
        *kernels.entry(isa).or_insert(0) += 1;
        for problem in check(function, &image) {
            problems.insert(format!("{isa}: {problem}"));
        }
    }
    // Of a BLAS, an instance and instances, for the nearest hit and for any.
    if kernels.len() < 2 || kernels.values().any(|&count| count < 6) {
        return Err(format!("only these kernels are in {BINARY}: {kernels:?}"));
    }
    if problems.is_empty() {
        eprintln!("asm-check: ok, kernels: {kernels:?}");
        return Ok(());
    }
    let list: Vec<_> = problems.into_iter().collect();
    Err(format!("{} problems in kernels:\n  {}", list.len(), list.join("\n  ")))
}

fn objdump(arguments: &[&str]) -> Result<String, String> {
    let output = Command::new("objdump").args(arguments).arg(BINARY).output();
    let output = output.map_err(|e| format!("cannot run objdump (of binutils): {e}"))?;
    if !output.status.success() {
        return Err(format!("objdump failed: {}", String::from_utf8_lossy(&output.stderr)));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

fn parse(text: &str) -> Vec<Function> {
    let mut functions: Vec<Function> = vec![];
    for line in text.lines() {
        if let Some((start, name)) = line.strip_suffix(">:").and_then(|l| l.split_once(" <")) {
            if let Ok(start) = u64::from_str_radix(start, 16) {
                functions.push(Function { name: name.to_owned(), start, code: vec![] });
            }
        } else if let (Some((_, code)), Some(last)) = (line.split_once(":\t"), functions.last_mut())
        {
            last.code.push(code.to_owned());
        }
    }
    functions
}

/// What an instruction reads or calls by an address relative to itself.
fn operand(code: &str) -> Option<u64> {
    let address = code.split_once("# ")?.1.split_whitespace().next()?;
    u64::from_str_radix(address, 16).ok()
}

/// What a kernel should not do.
fn check(function: &Function, image: &Image) -> Vec<String> {
    let mut problems = vec![];
    // Registers that were given the address of a function, which is checked there.
    let mut known = BTreeSet::new();
    for code in &function.code {
        let (mnemonic, operands) = code.split_once(' ').unwrap_or((code, ""));
        let goes_to =
            |text: &str| text.split_once('<').map(|(_, n)| n.trim_end_matches('>').to_owned());
        let callee = match mnemonic {
            "call"
                if operands.trim_start().strip_prefix('*').is_some_and(|r| known.contains(r)) =>
            {
                None
            }
            "mov" => {
                let slot = operand(code).and_then(|slot| image.slot(slot));
                if slot.is_some() {
                    let register = operands.split(',').nth(1).unwrap_or("");
                    known.insert(register.split_whitespace().next().unwrap_or("").to_owned());
                }
                slot.map(str::to_owned)
            }
            "call" => {
                let slot = operand(code).and_then(|slot| image.slot(slot));
                Some(slot.map(str::to_owned).or(goes_to(operands)).unwrap_or(operands.to_owned()))
            }
            // A call at the end may be a jump.
            "jmp" => goes_to(operands).filter(|to| !to.starts_with(&function.name)),
            "lea" => {
                if let Some(place) = operand(code).and_then(|at| image.location(at)) {
                    problems.extend(place.problem(&function.name));
                }
                None
            }
            _ => None,
        };
        if let Some(callee) = callee.filter(|callee| !CALLS.iter().any(|c| callee.contains(c))) {
            problems.push(format!("calls {callee} in {}", function.name));
        }
    }
    problems
}

impl image::Location {
    fn problem(&self, kernel: &str) -> Option<String> {
        let text = fs::read_to_string(&self.file).unwrap_or_default();
        let line = text.lines().nth(self.line as usize - 1).unwrap_or_default().trim();
        let known = |(file, part): &(&str, &str)| self.file.ends_with(file) && line.contains(part);
        let may = CHECKS.iter().any(known);
        let at = || format!("{}:{}", self.file, self.line);
        (!may).then(|| format!("may panic at {}, `{line}`, in {kernel}", at()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CODE: &str = "\
0000000000001000 <kernel::vectorize::region::<Batch>>:
    1000:\tmov    %rsp,%rbp
    1008:\tcall   2000 <rayburst_simd::triangles::decide_exactly>
    1014:\tjmp    1004 <kernel::vectorize::region::<Batch>+0x4>
    1020:\tlea    0x10(%rip),%rdx        # 4000 <data>
    1024:\tcall   *0x10(%rip)        # 5000 <_DYNAMIC>
0000000000003000 <core::panicking::panic_bounds_check>:
    3000:\tud2
";
    const SLOTS: &str = "\
0000000000004000 R_X86_64_RELATIVE  *ABS*+0x0000000000004018
0000000000005000 R_X86_64_RELATIVE  *ABS*+0x0000000000003000
";

    fn problems(code: &str, file: &str) -> Vec<String> {
        let functions = parse(code);
        let names = functions.iter().map(|f| (f.start, f.name.as_str())).collect();
        let image = Image::new(image::tests::elf(0x4000, file, 7), SLOTS, &names);
        check(&functions[0], &image)
    }

    #[test]
    fn a_call_that_is_not_inlined_is_found() {
        let file = "rust/std/src/thread/local.rs";
        assert_eq!(problems(CODE, file), [""; 0]);
        let code = CODE.replace("triangles::decide_exactly", "avx2::slab8");
        let found = problems(&code, file);
        assert!(found.len() == 1 && found[0].contains("avx2::slab8"), "{found:?}");
        let found = problems(&CODE.replace("1004 <kernel", "6000 <other"), file);
        assert!(found.len() == 1 && found[0].contains("calls other"), "{found:?}");
    }

    #[test]
    fn a_check_in_a_step_is_found() {
        let found = problems(CODE, "crates/rayburst-accel/src/traverse/walk.rs");
        assert!(found.len() == 1 && found[0].contains("traverse/walk.rs:7"), "{found:?}");
    }
}
