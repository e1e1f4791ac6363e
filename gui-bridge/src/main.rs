//! The GUI bridge's program: a module like any other, started by launch or by hand.

#![forbid(unsafe_code)]

fn main() -> std::process::ExitCode {
    rohrpost_gui_bridge::run_with::<()>()
}
