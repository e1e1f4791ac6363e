//! Bundles: all files that the nodes of an installation run, provably the same everywhere.
//!
//! ```text
//! bundles/3f9a…/         made by `make`, named by the SHA-256 of its manifest
//! ├── manifest.toml      version, trial, configuration; path, size and SHA-256 of each file
//! ├── manifest.sig       Ed25519 signature of the bytes of manifest.toml, and the public key
//! └── robot.toml, …      the files
//!
//! ROOT/                  folder of a node, such as /var/lib/rohrpost
//! ├── trusted/*.pub      public keys, put there by a person: bundles signed by others are refused
//! ├── staging/3f9a…/     a bundle while it is received. An interrupted one stays, and is completed by the next push
//! ├── bundles/3f9a…/     whole, verified bundles: the last three
//! ├── current            symbolic link to one of them; launch is given ROOT/current/robot.toml
//! ├── state.toml         the order of the bundles, how the trial of each went, the highest version ever accepted
//! └── *.lock             push.lock: one push at a time; state.lock: changes of state.toml and current, moments;
//!                        launch.lock: one launch at a time, with the name of its bundle
//! ```
//!
//! A **manifest** is TOML that a person can read. Its form is canonical: what [`Manifest::text`] writes is all that
//! [`Manifest::parse`] accepts, byte by byte. So paths are checked once ([`FilePath`]), and no two texts mean the same.
//!
//! **Receiving** ([`NodeFolder::receive`]) verifies signature and version, copies files that another bundle of the node
//! has, asks its [`Source`] for the others, and hashes each while it is written. A source is a folder, or a stream: a
//! push over ssh is `rohrpost bundle receive` on the node, with files on its standard input.
//!
//! **Switching.** A process may be killed, or the power may fail, at any step. These steps are durable in this order:
//!
//! 1. each file and each folder in `staging/3f9a…` (fsync); then all of it is verified once more from the disk;
//! 2. its rename to `bundles/3f9a…` (fsync of both folders). A damaged bundle of that name is exchanged for it;
//! 3. `state.toml` (fsync, rename, fsync of the folder), which says that the trial of 3f9a… is due;
//! 4. `current` (rename, fsync of the folder): from now on the node has the new bundle;
//! 5. bundles beyond three are renamed into `staging`, then removed. The bundle of a running launch stays.
//!
//! What `state.toml` says of a bundle that is not current has no effect, so a stop between 3 and 4 leaves the old
//! bundle.
//!
//! **Trial** ([`Trial`]). A bundle that is current for the first time has a trial. `state.toml` says `running` before
//! launch starts a module of it, and `passed` when all modules have stayed up for the time in the manifest. It has
//! failed if launch could not start, if a module was given up, or is not on at the end of that time; or if the next
//! launch finds `running`: then launch was killed, or the computer lost power. After a failed trial `current` is the
//! nearest bundle before that was trusted and whole when launch began; that was verified without the lock of the state,
//! which nothing holds for longer than moments. A launch that was told to stop leaves the trial due.
//!
//! Not promised: protection from a person that may write to ROOT. The digests show changes; the lock files and
//! `state.toml` are trusted, and a file that changes between its check and its start is not noticed.

#![forbid(unsafe_code)]

mod bundle;
mod digest;
mod disk;
mod key;
mod make;
mod manifest;
mod node;
mod path;
mod programs;
mod receive;
mod state;
mod stream;
mod trial;

pub use bundle::{Bundle, Difference, DifferenceKind, OpenError};
pub use digest::Sha256;
pub use disk::FileError;
pub use key::{KeyError, PublicKey, SECRET_FILE, Signature, SigningKey, Trusted};
pub use make::{Ingredient, MakeError, Recipe, make};
pub use manifest::{FileEntry, Manifest, ManifestError, TRIAL_MAX};
pub use node::{NodeFolder, NodeFolderError, NodeReport};
pub use path::{FilePath, PathError, lexical};
pub use programs::Programs;
pub use receive::{FolderSource, ReceiveError, Received, Source};
pub use state::{State, StateError, TrialState};
pub use stream::{SendError, StreamSource, send};
pub use trial::{Begun, Trial};
