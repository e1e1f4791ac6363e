//! Builds, runs and tests.

fn main() {}
