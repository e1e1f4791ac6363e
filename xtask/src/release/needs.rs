//! What binaries need of the system that they are installed on: the oldest glibc, and libraries.

use crate::cargo::output;
use crate::failure::Failure;
use std::path::PathBuf;
use std::process::Command;

/// Parts of Debian's `libc6` and `libgcc-s1`, which each Linux with glibc has, and which the tag `manylinux` allows.
const ALLOWED: [&str; 8] = [
    "libc.so.6",
    "libm.so.6",
    "libdl.so.2",
    "librt.so.1",
    "libpthread.so.0",
    "libgcc_s.so.1",
    "ld-linux-x86-64.so.2",
    "ld-linux-aarch64.so.1",
];

/// A version of glibc, such as 2.34.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Glibc(pub(super) u32, pub(super) u32);

/// The oldest glibc that has all symbols of these binaries. An error if one needs a library that not every Linux has.
pub(super) fn glibc(binaries: &[PathBuf]) -> Result<Glibc, Failure> {
    let text = output(Command::new("readelf").args(["--wide", "--dynamic", "--version-info"]).args(binaries))?;
    if let Some(other) = libraries(&text).find(|library| !ALLOWED.contains(library)) {
        return Err(format!("a binary needs `{other}`, which no package of ours brings; link it statically"));
    }
    versions(&text).max().ok_or_else(|| "readelf names no version of glibc".into())
}

fn libraries(text: &str) -> impl Iterator<Item = &str> {
    text.lines()
        .filter(|line| line.contains("(NEEDED)"))
        .filter_map(|line| Some(line.split_once('[')?.1.split_once(']')?.0))
}

fn versions(text: &str) -> impl Iterator<Item = Glibc> {
    text.split("GLIBC_").skip(1).filter_map(|rest| {
        let number = rest.split(|c: char| c != '.' && !c.is_ascii_digit()).next()?;
        let mut parts = number.split('.').map(str::parse);
        Some(Glibc(parts.next()?.ok()?, parts.next()?.ok()?))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_symbol_and_all_libraries_are_read() {
        let text = " 0x01 (NEEDED)             Shared library: [libm.so.6]\n 0x0f (SONAME)  Library soname: [x]\n  \
                    0x0010:   Name: GLIBC_2.2.5  Flags: none  Version: 8\n  0x20: Name: GLIBC_2.34  Flags: none\n  \
                    0x30: Name: GCC_3.0\n 004: GLIBC_PRIVATE 5 (GLIBC_2.9) \n";
        assert_eq!(libraries(text).collect::<Vec<_>>(), ["libm.so.6"]);
        assert_eq!(versions(text).max(), Some(Glibc(2, 34)));
    }
}
