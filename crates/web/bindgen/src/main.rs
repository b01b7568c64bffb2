//! Makes a JavaScript module with types of `ohmstrain_web.wasm`, and the WebAssembly in xz: `ohmstrain-web-bindgen IN.wasm DIR`.

use std::env;
use std::error::Error;
use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

use lzma_rust2::{XzOptions, XzWriter};
use wasm_bindgen_cli_support::Bindgen;

const SMALLEST: u32 = 9;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [input, folder] = &arguments[..] else { return Err("expected IN.wasm DIR".into()) };
    let mut bindgen = Bindgen::new();
    bindgen.input_path(input).out_name("ohmstrain").web(true)?.typescript(true).omit_default_module_path(true);
    bindgen.remove_name_section(true).remove_producers_section(true);
    bindgen.generate(folder)?;

    let module = Path::new(folder).join("ohmstrain_bg.wasm");
    let mut options = XzOptions::with_preset(SMALLEST);
    // Code is bytes: their places modulo four say nothing, the byte before says something.
    (options.lzma_options.lc, options.lzma_options.pb) = (4, 0);
    let mut packed = XzWriter::new(File::create(module.with_extension("wasm.xz"))?, options)?;
    packed.write_all(&fs::read(module)?)?;
    packed.finish()?;
    Ok(())
}
