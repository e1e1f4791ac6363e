//! Programs of a bundle, checked again before each start.

use crate::bundle::{Bundle, DifferenceKind};
use crate::manifest::FileEntry;
use crate::path::spellings;
use std::collections::HashMap;
use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Programs of a bundle. A module that is started again is started from the file that the manifest names.
#[derive(Clone, Debug)]
pub struct Programs {
    bundle: Bundle,
    /// What the system said of each file before it was verified: while that is the same, the file is.
    known: HashMap<PathBuf, (FileEntry, Option<Stamp>)>,
}

/// Changes with each change of a file: device, number, size, and the times of change of content and of anything, ns.
type Stamp = [i128; 5];

impl Programs {
    /// Notes what the system says of each program. Then all of the bundle is to be verified.
    pub fn of(bundle: &Bundle) -> Self {
        let programs = bundle.manifest().files().iter().filter(|file| file.executable);
        let known = programs.map(|file| {
            let path = file.path.below(bundle.folder());
            let stamp = stamp(&path).ok();
            (path, (file.clone(), stamp))
        });
        Self { bundle: bundle.clone(), known: known.collect() }
    }

    /// Permits the start of a program that is as the manifest says, or that lies outside of the bundle.
    ///
    /// # Errors
    /// A program in the bundle's folder that the manifest does not have, or has with other content, and a link in place
    /// of a program or of a folder.
    pub fn permit(&self, program: &Path) -> io::Result<()> {
        let real = program.canonicalize()?;
        let mut inside = spellings(program).filter(|path| path.starts_with(self.bundle.folder()));
        let Some(program) = inside.next() else { return Ok(()) };
        if program != real {
            return Err(io::Error::other("it is a link, or lies behind one, and a bundle has none"));
        }
        let Some((file, known)) = self.known.get(&program) else {
            return Err(io::Error::other("the manifest of the bundle does not have it"));
        };
        if known.is_some() && stamp(&program).ok() == *known {
            return Ok(());
        }
        match self.bundle.difference(file) {
            None => Ok(()),
            Some(DifferenceKind::Changed) => {
                Err(io::Error::other("it was changed: its digest is not that of the bundle's manifest"))
            }
            Some(kind) => Err(io::Error::other(format!("it is not as the bundle's manifest says ({kind:?})"))),
        }
    }
}

fn stamp(path: &Path) -> io::Result<Stamp> {
    let there = fs::symlink_metadata(path)?;
    let ns = |seconds: i64, ns: i64| i128::from(seconds) * 1_000_000_000 + i128::from(ns);
    let changed = ns(there.ctime(), there.ctime_nsec());
    let written = ns(there.mtime(), there.mtime_nsec());
    Ok([there.dev().into(), there.ino().into(), there.size().into(), written, changed])
}
