#!/usr/bin/env bash
# Makes the keys for updates: a certificate authority, and a certificate that signs bundles.
#
#     yocto/keys.sh DIR
#
# fringed-ca.cert.pem goes into every image. Anyone with signing.key.pem can update every device that has it, and anyone with
# fringed-ca.key.pem can make such keys: keep both off the build machine if possible, and out of every repository.
set -euo pipefail
dir=${1:?usage: keys.sh DIR}
if [[ -e $dir/fringed-ca.key.pem ]]; then
    echo "$dir has keys already: devices in the field take only updates that these sign" >&2
    exit 73
fi
umask 077
mkdir -p "$dir"
cd "$dir"
openssl req -x509 -newkey rsa:4096 -nodes -sha256 -days 7300 -subj "/O=fringed/CN=updates" \
    -addext basicConstraints=critical,CA:TRUE -addext keyUsage=critical,keyCertSign,cRLSign \
    -keyout fringed-ca.key.pem -out fringed-ca.cert.pem
openssl req -newkey rsa:4096 -nodes -sha256 -subj "/O=fringed/CN=bundles" -keyout signing.key.pem -out signing.csr.pem
openssl x509 -req -sha256 -days 3650 -in signing.csr.pem -CA fringed-ca.cert.pem -CAkey fringed-ca.key.pem -CAcreateserial \
    -extfile <(printf 'basicConstraints=critical,CA:FALSE\nkeyUsage=critical,digitalSignature\n') -out signing.cert.pem
rm signing.csr.pem
echo "$dir: fringed-ca.cert.pem for devices, signing.cert.pem and signing.key.pem for bundles"
