//! Puts the page for a browser into the program, if `OHMSTRAIN_PAGE` names its file, which `scripts/web.sh` makes.

use std::env;
use std::fs;
use std::path::{Path, absolute};

fn main() -> std::io::Result<()> {
    println!("cargo::rerun-if-env-changed=OHMSTRAIN_PAGE");
    let named = env::var("OHMSTRAIN_PAGE").ok().filter(|page| !page.is_empty());
    let page = named.map(absolute).transpose()?;
    let content = match &page {
        Some(page) => format!("Some(include_bytes!({page:?}))"),
        None => "None".into(),
    };
    if let Some(page) = &page {
        println!("cargo::rerun-if-changed={}", page.display());
    }
    let folder = env::var("OUT_DIR").map_err(std::io::Error::other)?;
    fs::write(Path::new(&folder).join("page.rs"), content)
}
