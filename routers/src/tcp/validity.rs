//! Until when a certificate holds, so that it is renewed before.

use rustls::crypto::ring;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, UnixTime};
use std::path::Path;
use std::time::Duration;

/// A moment at which none holds any more: what is encoded ends with the year 9999.
const NEVER: UnixTime = UnixTime::since_unix_epoch(Duration::from_secs(1 << 40));

/// The last second since 1970 in which a certificate holds, whoever has signed it; none if the file is none.
pub fn holds_until_s(path: &Path) -> Option<u64> {
    let shown = CertificateDer::from_pem_file(path).ok()?;
    let shown = webpki::EndEntityCert::try_from(&shown).ok()?;
    let algorithms = ring::default_provider().signature_verification_algorithms.all;
    // Nothing reads it out; but what has expired is told with since when, before anybody looks who signed it.
    match shown.verify_for_usage(algorithms, &[], &[], NEVER, webpki::KeyUsage::client_auth(), None, None) {
        Err(webpki::Error::CertExpired { not_after, .. }) => Some(not_after.as_secs()),
        _ => None,
    }
}
