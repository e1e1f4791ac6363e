//! `include/rohrpost.h` is what the sources say.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use std::path::Path;

#[test]
fn the_header_is_what_the_sources_say() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).unwrap();
    let mut header = Vec::new();
    cbindgen::Builder::new().with_config(config).with_crate(folder).generate().unwrap().write(&mut header);
    let header = String::from_utf8(header).unwrap();
    // Codes are read often; and what Rust calls safety is what C has to give.
    let header = header.replace("ROHRPOST_CODE_", "ROHRPOST_").replace("// # Safety\n", "// Pointers:\n");
    let path = folder.join("include/rohrpost.h");
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, &header).unwrap();
    }
    let there = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(there == header, "UPDATE_GOLDEN=1 cargo test -p rohrpost-c --test header");
}
