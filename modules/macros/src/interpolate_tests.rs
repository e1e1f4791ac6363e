//! Compile errors of structs without values in between, and what is written for those that have some.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use super::expand;

#[test]
fn mistakes_are_told_with_what_would_be_right() {
    for (item, says) in [
        ("enum Way { To(f64) }", "write `#[interpolate(earlier)]` or `#[interpolate(nearer)]` before each field"),
        ("union Both { a: u8, b: i8 }", "only structs have values in between"),
        ("struct Way { #[interpolate(linear)] x: f64 }", "a field has `heading`, `earlier` or `nearer`; without"),
        ("struct Way { #[interpolate(heading = 1)] x: f64 }", "a field has `heading`, `earlier` or `nearer`; without"),
        ("struct Way { #[interpolate] x: f64 }", "a field has `heading`, `earlier` or `nearer`; without"),
        (
            "struct Way { #[interpolate(heading)] #[interpolate(nearer)] x: f64 }",
            "a field has one of `heading`, `earlier` and `nearer`",
        ),
        ("#[interpolate(earlier)] struct Way(f64);", "a struct has `crate = path`"),
    ] {
        let error = expand(item.parse().unwrap()).unwrap_err().to_string();
        assert!(error.contains(says), "{item}: {error}");
    }
}

#[test]
fn each_field_comes_from_where_the_author_says() {
    let written = |item: &str| expand(item.parse().unwrap()).unwrap().to_string().replace(' ', "");
    let way = written("#[interpolate(crate = other::fusion)] struct Way<T>(T, #[interpolate(earlier)] u8);");
    assert!(way.contains("impl<T:other::fusion::Interpolate>other::fusion::InterpolateforWay<T>"), "{way}");
    assert!(way.contains("0:<Tasother::fusion::Interpolate>::interpolate(&from.0,&to.0,share)"), "{way}");
    assert!(way.contains("1:<u8as::core::clone::Clone>::clone(&from.1)"), "{way}");
    let way = written("struct Way { #[interpolate(heading)] a: f64, #[interpolate(nearer)] b: bool }");
    assert!(way.contains("a:<f64as::rohrpost::fusion::Heading>::turn(&from.a,&to.a,share)"), "{way}");
    assert!(way.contains("b:<boolas::core::clone::Clone>::clone(share.nearer(&from.b,&to.b))"), "{way}");
}
