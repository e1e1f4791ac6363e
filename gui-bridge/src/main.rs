//! Draws a robot in Rerun.

fn main() {}
