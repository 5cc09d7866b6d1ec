//! Whom an encrypted connection trusts: the authorities of one file, nobody else.

use crate::error::{Exit, Result};
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject as _;
use rustls::{ClientConfig, RootCertStore};
use std::path::Path;
use std::sync::Arc;

/// Reads the authorities of a file of certificates as PEM.
///
/// # Errors
/// If the file cannot be read, or holds no certificate.
pub fn trusting(file: &Path) -> Result<Arc<ClientConfig>> {
    let name = format!("read certificates of {}", file.display());
    let wrong =
        |error: &dyn std::fmt::Display| Exit::Configuration.fail(format!("{name}: {error}"));
    let mut roots = RootCertStore::empty();
    let certificates = match CertificateDer::pem_file_iter(file) {
        Ok(certificates) => certificates,
        Err(error) => return wrong(&error),
    };
    for certificate in certificates {
        let added = certificate.map(|certificate| roots.add(certificate));
        match added {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return wrong(&error),
            Err(error) => return wrong(&error),
        }
    }
    if roots.is_empty() {
        return wrong(&"there is none: write them as PEM");
    }
    let config = ClientConfig::builder().with_root_certificates(roots);
    Ok(Arc::new(config.with_no_client_auth()))
}
