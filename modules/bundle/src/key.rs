//! The key that signs bundles, and the public keys that a node trusts.
//!
//! ```text
//! keys/bundle.key        where bundles are made, and nowhere else     ed25519-seed 64 digits
//! keys/bundle.pub        copied to ROOT/trusted/ of each node         ed25519 64 digits
//! BUNDLE/manifest.sig    in each bundle                               ed25519 public key, signature
//! ```

use crate::digest::{Sha256, hex, parse_hex};
use crate::disk::{self, At, FileError};
use ring::rand::{SecureRandom, SystemRandom};
use ring::signature::{ED25519, Ed25519KeyPair, KeyPair, UnparsedPublicKey};
use rohrpost_config::{KeysError, open_secret};
use std::fmt;
use std::fs::DirBuilder;
use std::io::{Read, Write};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

/// The secret key, in the folder with an installation's keys.
pub const SECRET_FILE: &str = "bundle.key";
/// The public half, beside the secret key.
const PUBLIC_FILE: &str = "bundle.pub";
/// End of the names of public keys in a node's folder.
const PUBLIC_END: &str = "pub";
/// A longer file is none of these.
pub(crate) const KEY_BYTES_MAX: usize = 1024;
const ALGORITHM: &str = "ed25519";
const SEED: &str = "ed25519-seed";
const PREAMBLE: &str = "\
# Signs bundles of a Rohrpost installation. Keep it where bundles are made; nodes need bundle.pub alone.
";

/// A public key of Ed25519.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PublicKey([u8; 32]);

/// The signature of a manifest, with the public key that it is to be verified with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signature {
    key: PublicKey,
    bytes: [u8; 64],
}

/// The key that signs.
pub struct SigningKey(Ed25519KeyPair);

/// The public keys that a node trusts.
#[derive(Clone, Debug)]
pub struct Trusted {
    folder: PathBuf,
    keys: Vec<PublicKey>,
}

/// What is wrong with a key or a signature.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// A secret file that others may read.
    #[error(transparent)]
    Secret(#[from] KeysError),
    /// There is one already.
    #[error(
        "{}: there is a key already; to change it, move it away first, and give nodes the new bundle.pub",
        .0.display()
    )]
    Exists(PathBuf),
    /// Content of a file.
    #[error("{}: {why}", path.display())]
    Wrong {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what would be right.
        why: &'static str,
    },
    /// The system has no random numbers.
    #[error("the system gives no random numbers")]
    Random,
    /// A node without a key.
    #[error(
        "{folder}: no key is trusted; copy bundle.pub of the computer that signs bundles to {folder}/",
        folder = .0.display()
    )]
    NoneTrusted(PathBuf),
    /// A key that the node does not have.
    #[error(
        "signed with key {key}, which is none of those in {} ({known}); if it is right, copy its bundle.pub there",
        folder.display()
    )]
    Unknown {
        /// Fingerprint of the key.
        key: String,
        /// Folder of the trusted keys.
        folder: PathBuf,
        /// Fingerprints of the keys there.
        known: String,
    },
    /// A signature of something else.
    #[error("the signature is not of this manifest; it was changed, or damaged on its way: fetch the bundle anew")]
    Mismatch,
}

impl PublicKey {
    /// Reads `ed25519` and 64 digits.
    ///
    /// ```
    /// # use rohrpost_bundle::PublicKey;
    /// let text = format!("ed25519 {}\n", "ab".repeat(32));
    /// assert_eq!(PublicKey::parse(&text).map(|key| key.text()), Some(text));
    /// ```
    pub fn parse(text: &str) -> Option<Self> {
        let digits = text.strip_prefix(ALGORITHM)?.strip_prefix(' ')?.strip_suffix('\n')?;
        parse_hex(digits).map(Self)
    }

    /// The text that [`parse`](Self::parse) reads.
    pub fn text(&self) -> String {
        format!("{ALGORITHM} {}\n", hex(&self.0))
    }

    /// Short name, by which people compare keys.
    pub fn fingerprint(&self) -> String {
        let digits = Sha256::of(&self.0).to_string();
        [0, 4, 8, 12].map(|at| &digits[at..at + 4]).join("-")
    }
}

impl Signature {
    /// Reads `ed25519`, a public key and a signature.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let text = std::str::from_utf8(bytes).ok()?;
        let (key, signature) = text.strip_suffix('\n')?.rsplit_once(' ')?;
        Some(Self { key: PublicKey::parse(&format!("{key}\n"))?, bytes: parse_hex(signature)? })
    }

    /// The text that [`parse`](Self::parse) reads.
    pub fn text(&self) -> String {
        format!("{ALGORITHM} {} {}\n", hex(&self.key.0), hex(&self.bytes))
    }

    /// The key that it names.
    pub fn key(&self) -> PublicKey {
        self.key
    }

    /// Whether the key that it names has signed this message.
    pub fn is_of(&self, message: &[u8]) -> bool {
        UnparsedPublicKey::new(&ED25519, self.key.0).verify(message, &self.bytes).is_ok()
    }
}

impl fmt::Debug for SigningKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "signing key {}", self.public().fingerprint())
    }
}

impl SigningKey {
    /// Makes a key, and writes it and its public half into a folder, which is made if it is not there.
    ///
    /// # Errors
    /// [`KeyError::Exists`], [`KeyError::File`] and [`KeyError::Random`].
    pub fn create(folder: &Path) -> Result<Self, KeyError> {
        let mut seed = [0; 32];
        SystemRandom::new().fill(&mut seed).map_err(|_| KeyError::Random)?;
        let key = Self::from_seed(&seed).ok_or(KeyError::Random)?;
        DirBuilder::new().recursive(true).mode(0o700).create(folder).at("made", folder)?;
        for (name, text) in
            [(SECRET_FILE, format!("{PREAMBLE}{SEED} {}\n", hex(&seed))), (PUBLIC_FILE, key.public().text())]
        {
            let path = folder.join(name);
            // A file for its owner alone, from its first moment on.
            let mut file = tempfile::NamedTempFile::new_in(folder).at("written", &path)?;
            file.write_all(text.as_bytes()).and_then(|()| file.as_file().sync_all()).at("written", &path)?;
            // A secret key is never lost, a public one can be made again.
            let kept = if name == SECRET_FILE { file.persist_noclobber(&path) } else { file.persist(&path) };
            match kept.map_err(|error| error.error) {
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
                    return Err(KeyError::Exists(path));
                }
                kept => kept.at("written", &path)?,
            };
        }
        disk::sync_folder(folder)?;
        Ok(key)
    }

    /// Reads the secret key of a file.
    ///
    /// # Errors
    /// [`KeyError::File`], [`KeyError::Secret`] and [`KeyError::Wrong`].
    pub fn load(path: &Path) -> Result<Self, KeyError> {
        let failed = |error| KeyError::File(FileError { path: path.to_owned(), doing: "read", error });
        let mut text = String::new();
        open_secret(path, failed)?.take(KEY_BYTES_MAX as u64).read_to_string(&mut text).map_err(failed)?;
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let seed = lines.next().and_then(|line| parse_hex(line.strip_prefix(SEED)?.strip_prefix(' ')?));
        let key = seed.as_ref().and_then(Self::from_seed).filter(|_| lines.next().is_none());
        let why = "no key that signs bundles; `rohrpost keys bundle` makes one";
        key.ok_or_else(|| KeyError::Wrong { path: path.to_owned(), why })
    }

    fn from_seed(seed: &[u8; 32]) -> Option<Self> {
        Ed25519KeyPair::from_seed_unchecked(seed).ok().map(Self)
    }

    /// Public half of the key.
    pub fn public(&self) -> PublicKey {
        let mut bytes = [0; 32];
        bytes.copy_from_slice(self.0.public_key().as_ref());
        PublicKey(bytes)
    }

    /// Signs a message.
    pub fn sign(&self, message: &[u8]) -> Signature {
        let mut bytes = [0; 64];
        bytes.copy_from_slice(self.0.sign(message).as_ref());
        Signature { key: self.public(), bytes }
    }
}

impl Trusted {
    /// Reads all public keys of a folder: the files `*.pub`.
    ///
    /// # Errors
    /// [`KeyError::NoneTrusted`], [`KeyError::File`] and [`KeyError::Wrong`].
    pub fn load(folder: &Path) -> Result<Self, KeyError> {
        let mut keys = Vec::new();
        let is_key = |path: &PathBuf| path.extension().is_some_and(|end| end == PUBLIC_END);
        for path in disk::entries(folder)?.into_iter().filter(is_key) {
            let text = disk::read(&path, KEY_BYTES_MAX).at("read", &path)?;
            let key = std::str::from_utf8(&text).ok().and_then(PublicKey::parse);
            let why = "no public key; a line `ed25519` and 64 digits is right, as bundle.pub has it";
            keys.push(key.ok_or(KeyError::Wrong { path, why })?);
        }
        if keys.is_empty() {
            return Err(KeyError::NoneTrusted(folder.to_owned()));
        }
        Ok(Self { folder: folder.to_owned(), keys })
    }

    /// Verifies a signature of a message.
    ///
    /// # Errors
    /// [`KeyError::Unknown`] and [`KeyError::Mismatch`].
    pub fn verify(&self, message: &[u8], signature: &Signature) -> Result<(), KeyError> {
        if !self.keys.contains(&signature.key) {
            let known: Vec<String> = self.keys.iter().map(PublicKey::fingerprint).collect();
            let (key, folder) = (signature.key.fingerprint(), self.folder.clone());
            return Err(KeyError::Unknown { key, folder, known: known.join(", ") });
        }
        if signature.is_of(message) { Ok(()) } else { Err(KeyError::Mismatch) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{self, Permissions};
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_key_is_kept_secret_and_never_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("keys");
        let key = SigningKey::create(&folder).unwrap();
        let path = folder.join(SECRET_FILE);
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(SigningKey::load(&path).unwrap().public(), key.public());
        assert!(matches!(SigningKey::create(&folder), Err(KeyError::Exists(_))));
        assert_eq!(SigningKey::load(&path).unwrap().public(), key.public());
        fs::set_permissions(&path, Permissions::from_mode(0o644)).unwrap();
        assert!(matches!(SigningKey::load(&path), Err(KeyError::Secret(KeysError::Open(..)))));
        fs::set_permissions(&path, Permissions::from_mode(0o600)).unwrap();
        let seed = fs::read_to_string(&path).unwrap();
        for text in ["".to_owned(), seed.replace("ed25519-seed", "ed25519"), seed.trim_end().to_owned() + "0\n"] {
            fs::write(&path, &text).unwrap();
            assert!(matches!(SigningKey::load(&path), Err(KeyError::Wrong { .. })), "{text}");
        }
    }

    #[test]
    fn only_the_exact_message_and_signature_of_a_trusted_key_pass() {
        let folder = tempfile::tempdir().unwrap();
        let [ours, other] = ["ours", "other"].map(|name| SigningKey::create(&folder.path().join(name)).unwrap());
        let trusted = folder.path().join("trusted");
        assert!(matches!(Trusted::load(&trusted), Err(KeyError::NoneTrusted(_))));
        fs::create_dir(&trusted).unwrap();
        fs::write(trusted.join("ours.pub"), ours.public().text()).unwrap();
        fs::write(trusted.join("README"), "not a key").unwrap();
        let keys = Trusted::load(&trusted).unwrap();
        let (message, signature) = (b"all files", ours.sign(b"all files"));
        keys.verify(message, &signature).unwrap();
        assert!(matches!(keys.verify(b"all filed", &signature), Err(KeyError::Mismatch)));
        assert!(matches!(keys.verify(message, &other.sign(message)), Err(KeyError::Unknown { .. })));
        let text = signature.text().into_bytes();
        assert_eq!(Signature::parse(&text), Some(signature));
        for (at, bit) in (0..text.len()).flat_map(|at| (0..8).map(move |bit| (at, bit))) {
            let mut flipped = text.clone();
            flipped[at] ^= 1 << bit;
            let passes = Signature::parse(&flipped).is_some_and(|read| keys.verify(message, &read).is_ok());
            assert!(!passes, "byte {at}, bit {bit}");
        }
        fs::write(trusted.join("bad.pub"), "ed25519 00").unwrap();
        assert!(Trusted::load(&trusted).unwrap_err().to_string().contains("bad.pub: no public key"));
    }
}
