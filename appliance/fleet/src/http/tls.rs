//! Whom an encrypted connection trusts: the authorities of one file, nobody else.

use crate::error::{Exit, Result};
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject as _;
use rustls::{ClientConfig, RootCertStore};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// Reads the authorities of a file of certificates as PEM.
///
/// # Errors
/// If the file cannot be read, or holds no certificate.
pub fn trusting(file: &Path) -> Result<Arc<ClientConfig>> {
    let wrong = Exit::Configuration.because(format!("read certificates of {}", file.display()));
    let config = ClientConfig::builder().with_root_certificates(roots(file).map_err(wrong)?);
    Ok(Arc::new(config.with_no_client_auth()))
}

fn roots(file: &Path) -> Result<RootCertStore, Box<dyn Error>> {
    let mut roots = RootCertStore::empty();
    for certificate in CertificateDer::pem_file_iter(file)? {
        roots.add(certificate?)?;
    }
    if roots.is_empty() {
        return Err("there is none: write them as PEM".into());
    }
    Ok(roots)
}
