"""What strict verifiers make of certificates: both ends of a TLS session meet in memory, and openssl looks at each certificate.

Arguments: the folder of certificates, and the file names of a TCP router and of a node.
"""

import shutil
import ssl
import subprocess
import sys

folder, server, client = sys.argv[1:]


def context(purpose, own):
    context = ssl.SSLContext(purpose)
    context.verify_mode = ssl.CERT_REQUIRED
    context.verify_flags |= ssl.VERIFY_X509_STRICT
    context.load_verify_locations(f"{folder}/ca.pem")
    context.load_cert_chain(f"{folder}/{own}.pem", f"{folder}/{own}.key")
    return context


up, down = ssl.MemoryBIO(), ssl.MemoryBIO()
name = "tcp-router.rohrpost"
ends = [
    context(ssl.PROTOCOL_TLS_CLIENT, client).wrap_bio(down, up, server_hostname=name),
    context(ssl.PROTOCOL_TLS_SERVER, server).wrap_bio(up, down, server_side=True),
]
for _ in range(10):
    for end in ends:
        try:
            end.do_handshake()
        except ssl.SSLWantReadError:
            pass
ends[0].write(b"met")
assert ends[1].read(3) == b"met"

if shutil.which("openssl"):
    for own, purpose in [(server, "sslserver"), (client, "sslclient")]:
        verify = ["openssl", "verify", "-x509_strict", "-purpose", purpose, "-CAfile", f"{folder}/ca.pem"]
        subprocess.run([*verify, f"{folder}/{own}.pem"], check=True)
