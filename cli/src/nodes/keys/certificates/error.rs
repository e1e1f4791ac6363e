//! Errors of certificates.

use rohrpost_config::KeysError;
use rohrpost_routers::tcp::SealError;
use std::io;
use std::path::PathBuf;

/// Why certificates cannot be made or read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CertificateError {
    /// A file.
    #[error("{0}: {1}")]
    File(PathBuf, io::Error),
    /// Other users may read a key.
    #[error(transparent)]
    Open(#[from] KeysError),
    /// The certificate of the authority.
    #[error(transparent)]
    Authority(#[from] SealError),
    /// Only half of the authority is there.
    #[error(
        "{certificate} is there, and {secret} is not: without it nothing can be signed. Bring it from where the \
         authority was made; if it is lost, `rohrpost keys rotate --authority {file}` begins anew, and then the same \
         without `--authority` for each other system of the installation",
        certificate = .0.display(), secret = .1.display(), file = .2.display()
    )]
    NoKey(PathBuf, PathBuf, PathBuf),
    /// Key and certificate belong to different authorities.
    #[error(
        "{secret} is not the key of {certificate}: they are of two authorities. Bring both from where one of them was \
         made, or `rohrpost keys rotate --authority {file}` begins anew",
        certificate = .0.display(), secret = .1.display(), file = .2.display()
    )]
    OtherKey(PathBuf, PathBuf, PathBuf),
    /// A file holds no valid key, or a certificate cannot be made.
    #[error("{0}: {1}")]
    Unfit(PathBuf, rcgen::Error),
}
