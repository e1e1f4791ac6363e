//! The fuzzer's program: libFuzzer's own `main`, and one target, which the environment variable `ROHRPOST_FUZZ` names.
//! `cargo xtask fuzz` builds and runs it; docs/src/proof.md says how.

#![no_main]

use libfuzzer_sys::fuzz_target;
use rohrpost_fuzz::{Target, target};
use std::sync::OnceLock;

static TARGET: OnceLock<Target> = OnceLock::new();

fn chosen() -> Target {
    let name = std::env::var("ROHRPOST_FUZZ").unwrap_or_default();
    target(&name).unwrap_or_else(|unknown| {
        eprintln!("ROHRPOST_FUZZ: {unknown}");
        std::process::exit(2)
    })
}

fuzz_target!(init: TARGET.get_or_init(chosen), |data: &[u8]| {
    (TARGET.get_or_init(chosen).run)(data);
});
