//! Writes the team core twice, as it is and with all mistakes of the catalogue planted in it, each with the model
//! beside it; beside the latter the simulation of traffic, too.

#[path = "src/catalog.rs"]
mod catalog;

use rohrpost_planted::{Models, Part};

fn main() {
    Models {
        core: "../src",
        parts: &[
            Part { of: "lib.rs", module: "team_model", file: "team_model/mod" },
            Part { of: "group/mod.rs", module: "key", file: "team_model/group_key" },
            Part { of: "view/mod.rs", module: "key", file: "team_model/view_key" },
            Part { of: "team.rs", module: "key", file: "team_model/team_key" },
        ],
        tests: Some(("rohrpost_team", "../tests/traffic")),
        catalog: catalog::MISTAKES,
    }
    .write();
}
