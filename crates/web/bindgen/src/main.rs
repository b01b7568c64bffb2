//! Makes a JavaScript module with types of `ohmstrain_web.wasm`: `ohmstrain-web-bindgen IN.wasm DIR`.

use std::env;
use std::error::Error;

use wasm_bindgen_cli_support::Bindgen;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [input, folder] = &arguments[..] else { return Err("expected IN.wasm DIR".into()) };
    let mut bindgen = Bindgen::new();
    bindgen.input_path(input).out_name("ohmstrain").web(true)?.typescript(true).omit_default_module_path(true);
    bindgen.remove_name_section(true).remove_producers_section(true);
    Ok(bindgen.generate(folder)?)
}
