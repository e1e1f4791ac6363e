//! Round trips: an interface goes to a file and to code of each language, and comes back with the same hash.
//!
//! The golden files are what is generated. `UPDATE_GOLDEN=1 cargo test -p rohrpost-cli --bin rohrpost interface` writes
//! them anew; read the diff before you commit. Rust's are compiled into this test, Python's are imported and checked by
//! `clients/python/tests`, C's are compiled here.

mod c;
mod files;
mod hostile;
mod zoo;

use super::{Language, file, generated};
use rohrpost::interface::Interface;
use rohrpost::schema::Description;
use std::path::{Path, PathBuf};

/// The interface that Python wrote, as Rust.
#[allow(dead_code, unreachable_pub, reason = "nothing of it is called here")]
mod gripper {
    include!("../golden/gripper.rust");
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src/begin/interface/golden")
}

/// Where Python finds its golden files.
fn python_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../clients/python/tests/generated")
}

#[track_caller]
fn assert_golden(path: &Path, text: &str) {
    let text = format!("{}\n", text.trim_end());
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(path, &text).unwrap();
    }
    let there = std::fs::read_to_string(path).unwrap_or_default();
    assert!(there == text, "{} is not what is generated; UPDATE_GOLDEN=1 writes it", path.display());
}

/// All that is made of an interface is as its golden files have it.
#[track_caller]
fn assert_all_golden(name: &str, description: &Description) {
    let made = |lang| generated(description, lang).unwrap();
    assert_golden(&folder().join(format!("{name}.rust")), &made(Language::Rust));
    assert_golden(&folder().join(format!("{name}.h")), &made(Language::C));
    assert_golden(&python_folder().join(format!("{name}.py")), &made(Language::Python));
}

#[test]
fn an_interface_of_rust_is_the_same_in_each_language() {
    let description = zoo::description();
    assert_golden(&folder().join("zoo.json"), &file::write(&description).unwrap());
    assert_eq!(file::load(&folder().join("zoo.json")).unwrap(), description, "nothing is lost in a file");
    assert_all_golden("zoo", &description);
    assert_eq!(zoo::generated_hash(), description.hash());
}

#[test]
fn an_interface_of_python_is_the_same_in_each_language() {
    // Written by `clients/python/tests/test_generated.py`, of a class there.
    let description = file::load(&python_folder().join("gripper.json")).unwrap();
    assert_all_golden("gripper", &description);
    assert_eq!(gripper::GripperInterface::description().hash(), description.hash());
}
