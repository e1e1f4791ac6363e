//! Until when a certificate holds, so that it is renewed before.

use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject;
use std::path::Path;
use x509_cert::Certificate;
use x509_cert::der::Decode;

/// The last second since 1970 in which a certificate holds, regardless of its signature; none if the file is no
/// certificate.
pub fn holds_until_s(path: &Path) -> Option<u64> {
    let der = CertificateDer::from_pem_file(path).ok()?;
    let certificate = Certificate::from_der(&der).ok()?;
    Some(certificate.tbs_certificate().validity().not_after.to_unix_duration().as_secs())
}

#[cfg(test)]
mod tests {
    use super::holds_until_s;
    use rcgen::{CertificateParams, KeyPair, date_time_ymd};

    #[test]
    fn the_end_of_a_certificate_is_read_and_what_is_none_has_no_end() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("node.pem");
        let mut params = CertificateParams::new(["base".into()]).unwrap();
        // Before 2050 and from then on, the end is written in two ways.
        for (year, seconds) in [(2031, 1_924_992_000), (2061, 2_871_763_200)] {
            params.not_after = date_time_ymd(year, 1, 1);
            let pem = params.self_signed(&KeyPair::generate().unwrap()).unwrap().pem();
            std::fs::write(&file, &pem).unwrap();
            assert_eq!(holds_until_s(&file), Some(seconds), "{year}");
            std::fs::write(&file, pem.replace('M', "N")).unwrap();
            assert_eq!(holds_until_s(&file), None, "it is damaged");
        }
        assert_eq!(holds_until_s(&folder.path().join("absent.pem")), None);
    }
}
