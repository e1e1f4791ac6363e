//! Writes the supervision core twice, as it is and with all mistakes of the catalogue planted in it, each with the
//! models beside it.

#[path = "src/catalog/mod.rs"]
mod catalog;

use rohrpost_planted::{Models, Part};

fn main() {
    Models {
        core: "../src",
        parts: &[
            Part { of: "lib.rs", module: "wormhole_model", file: "wormhole_model/mod" },
            Part { of: "wormhole.rs", module: "state", file: "wormhole_model/state" },
            Part { of: "lib.rs", module: "lease_model", file: "lease_model" },
        ],
        tests: Some(("rohrpost_supervision", "../tests/lease")),
        catalog: catalog::MISTAKES,
    }
    .write();
}
