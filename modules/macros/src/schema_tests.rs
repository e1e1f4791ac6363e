//! Compile errors of types without a schema.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use super::expand;

#[test]
fn mistakes_are_told_with_what_would_be_right() {
    for (item, says) in [
        ("union Both { a: u8, b: i8 }", "structs and enums have a description"),
        ("#[schema(unit = \"m\")] struct Way(f64);", "a type has `name`, its fields `unit`, `min` and `max`"),
        ("#[schema(name = \"\")] struct Way(f64);", "an empty name is none"),
        ("struct Way { #[schema(units = \"m\")] x: f64 }", "unknown key; there are `unit`, `min`"),
        ("struct Way { #[schema(default = 1.0)] x: f64 }", "only parameters have a default"),
        ("struct Way { #[schema(max = 1)] x: String }", "only numbers have a range: u8, u16"),
        ("struct Way { #[serde(skip)] x: f64 }", "a description cannot say what `skip` does to the bytes"),
        ("#[serde(tag = \"kind\")] enum Way { To(u8) }", "a description cannot say what `tag` does to the bytes"),
        ("enum Way { #[serde(untagged)] To(u8) }", "a description cannot say what `untagged` does to the bytes"),
    ] {
        let error = expand(item.parse().unwrap()).unwrap_err().to_string();
        assert!(error.contains(says), "{item}: {error}");
    }
}

#[test]
fn names_are_the_authors() {
    let written = |item: &str| expand(item.parse().unwrap()).unwrap().to_string();
    assert!(
        written("#[schema(name = \"rohrpost.Way\")] #[serde(rename = \"W\")] struct Way;").contains("\"rohrpost.Way\"")
    );
    assert!(written("#[serde(rename = \"W\")] struct Way;").contains("\"W\""));
    assert!(written("struct Way { r#type: u8 }").contains("\"type\""));
}
