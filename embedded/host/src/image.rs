//! Content of a program's image: the code that a step can reach, and forbidden code.

use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::fs;
use std::path::Path;

/// Sizes, and call sites of forbidden functions.
pub struct Image {
    /// Bytes of all functions that a step can reach, the step included.
    pub step_code: u64,
    /// Bytes of read-only data, without the replayed codes.
    pub read_only: u64,
    /// Software routines for double precision.
    pub soft_double: Vec<String>,
    /// Symbols of a heap.
    pub heap: Vec<String>,
    /// Number of calls of panics.
    pub panics: usize,
    /// Number of calls through pointers that a step can reach: its code would be larger than counted.
    pub indirect: usize,
}

struct Function {
    name: String,
    size: u64,
}

impl Image {
    /// Reads the output of `arm-none-eabi-nm -S`, `-objdump -d` and `-size -A` for a program.
    pub fn read(stem: &Path) -> Result<Self, Box<dyn Error>> {
        let text = |extension: &str| fs::read_to_string(stem.with_extension(extension));
        let (functions, codes) = symbols(&text("nm")?)?;
        let (calls, indirect) = calls(&text("dis")?, &functions);
        let reached = reached(&functions, &calls)?;
        let named = |test: fn(&str) -> bool| {
            functions.values().map(|function| function.name.clone()).filter(|name| test(name)).collect::<Vec<_>>()
        };
        let panics = calls
            .iter()
            .filter(|(from, _)| !functions.get(from).is_some_and(|function| is_panic(&function.name)))
            .flat_map(|(_, to)| to)
            .filter(|to| functions.get(to).is_some_and(|function| is_panic(&function.name)))
            .count();
        let read_only = text("size")?
            .lines()
            .find_map(|line| line.strip_prefix(".rodata")?.split_whitespace().next()?.parse::<u64>().ok())
            .unwrap_or(0);
        Ok(Self {
            step_code: reached.iter().filter_map(|address| functions.get(address)).map(|f| f.size).sum(),
            read_only: read_only - codes,
            soft_double: named(is_soft_double),
            heap: named(is_heap),
            panics,
            indirect: indirect.iter().filter(|address| reached.contains(address)).count(),
        })
    }
}

/// Returns functions by address, and the size of the replayed codes.
fn symbols(nm: &str) -> Result<(BTreeMap<u64, Function>, u64), Box<dyn Error>> {
    let (mut functions, mut codes) = (BTreeMap::new(), 0);
    for line in nm.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [address, size, kind, name] = words.as_slice() else { continue };
        let size = u64::from_str_radix(size, 16)?;
        match *kind {
            "t" | "T" | "w" | "W" => {
                // The lowest bit marks Thumb code.
                let address = u64::from_str_radix(address, 16)? & !1;
                functions.insert(address, Function { name: (*name).into(), size });
            }
            "r" | "R" if name.contains("CODES") => codes += size,
            _ => {}
        }
    }
    Ok((functions, codes))
}

/// Returns the calls between functions by address, one per call site; and the functions that call through a pointer.
fn calls(disassembly: &str, functions: &BTreeMap<u64, Function>) -> (BTreeMap<u64, Vec<u64>>, Vec<u64>) {
    let (mut calls, mut indirect) = (BTreeMap::<u64, Vec<u64>>::new(), Vec::new());
    for line in disassembly.lines() {
        let mut columns = line.split('\t');
        let (Some(address), Some(_), Some(mnemonic)) = (columns.next(), columns.next(), columns.next()) else {
            continue;
        };
        let Some(from) = hex(address.trim().trim_end_matches(':')).and_then(|at| inside(functions, at)) else {
            continue;
        };
        if mnemonic == "blx" {
            indirect.push(from);
        } else if mnemonic.starts_with('b') {
            let target = columns.next().and_then(|operand| hex(operand.split_whitespace().next()?));
            if let Some(to) = target.and_then(|at| inside(functions, at)).filter(|to| *to != from) {
                calls.entry(from).or_default().push(to);
            }
        }
    }
    (calls, indirect)
}

fn hex(text: &str) -> Option<u64> {
    u64::from_str_radix(text, 16).ok()
}

/// Returns the function around an address.
fn inside(functions: &BTreeMap<u64, Function>, address: u64) -> Option<u64> {
    let (start, function) = functions.range(..=address).next_back()?;
    (address < start + function.size).then_some(*start)
}

fn reached(
    functions: &BTreeMap<u64, Function>,
    calls: &BTreeMap<u64, Vec<u64>>,
) -> Result<BTreeSet<u64>, Box<dyn Error>> {
    let step = functions.iter().find(|(_, function)| function.name.contains("filter_step"));
    let mut waiting = vec![*step.ok_or("no symbol `filter_step`: the step was inlined")?.0];
    let mut reached = BTreeSet::new();
    while let Some(address) = waiting.pop() {
        if reached.insert(address) {
            waiting.extend(calls.get(&address).into_iter().flatten());
        }
    }
    Ok(reached)
}

/// True for run-time routines of the ARM ABI and of the compiler that compute in `f64`.
fn is_soft_double(name: &str) -> bool {
    let arm = ["__aeabi_d", "__aeabi_cd", "__aeabi_i2d", "__aeabi_ui2d", "__aeabi_l2d", "__aeabi_ul2d", "__aeabi_f2d"];
    let compiler = ["df2", "df3", "sfdf2", "dfsf2", "sidf", "dfsi", "didf", "dfdi"];
    arm.iter().any(|prefix| name.starts_with(prefix))
        || (name.starts_with("__") && compiler.iter().any(|ending| name.ends_with(ending)))
}

fn is_heap(name: &str) -> bool {
    ["__rust_alloc", "__rg_alloc", "__rust_dealloc", "__rdl_alloc", "malloc", "GlobalAlloc"]
        .iter()
        .any(|part| name.contains(part))
}

fn is_panic(name: &str) -> bool {
    name.contains("panicking") || name.contains("rust_begin_unwind") || name.contains("panic_fmt")
}
