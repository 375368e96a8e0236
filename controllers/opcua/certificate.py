"""The gateway's certificate for OPC UA servers. It is self-signed: each server has its own list of clients.

OPC UA, part 6, 6.2.2 requires RSA, the application's URI among the names, and these uses of the key.
"""

import platform
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

from robomesh.errors import RobomeshError
from robomesh.extras import missing
from robomesh.files.atomic_write import write_atomically

# The largest that every policy from Basic256Sha256 on takes, and that old controllers can compute with.
_BITS = 2048
_CLOCKS_BEHIND = timedelta(days=1)


class CertificateError(RobomeshError):
    """The certificate cannot be made."""


class Made(NamedTuple):
    """A certificate that was made.

    Attributes:
        public: DER file of the certificate alone, for the server's trust list.
        uri: The application's URI in it.
        fingerprint: SHA-256, hexadecimal.
    """

    public: Path
    uri: str
    fingerprint: str
    expires: datetime


def make_own(file: Path, lifetime: timedelta) -> Sequence[str]:
    """Make the gateway's own certificate for OPC UA servers.

    FILE.pem holds the private key; FILE.der is for the server's list of trusted clients.
    """
    made = make(file, datetime.now(UTC).replace(microsecond=0), lifetime)
    return (
        f'{file}: write certificate = "{file}" below [robot.opcua]',
        f"{made.public}: let the server trust it; {made.uri}, until {made.expires:%Y-%m-%d}",
        f"  fingerprint sha256:{made.fingerprint}",
    )


def make(file: Path, now: datetime, lifetime: timedelta) -> Made:
    """Write a new private key and its certificate to a file, and the certificate alone next to it.

    Raises:
        CertificateError: If the file exists, or cannot be written, or a package is missing.
    """
    try:
        from cryptography import x509
        from cryptography.hazmat.primitives import hashes, serialization
        from cryptography.hazmat.primitives.asymmetric import rsa
        from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID
    except ImportError:
        raise CertificateError(missing("cryptography")) from None
    public = file.with_suffix(".der")
    for each in (file, public):
        if each.exists():
            raise CertificateError(f"{each} exists: servers trust the certificate in it; choose another name")
    host = platform.node()
    uri = f"urn:{host}:robomesh:gateway"
    key = rsa.generate_private_key(public_exponent=65537, key_size=_BITS)
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"robomesh@{host}"[:64])])
    usage = x509.KeyUsage(
        digital_signature=True,
        content_commitment=True,
        key_encipherment=True,
        data_encipherment=True,
        key_agreement=False,
        key_cert_sign=True,
        crl_sign=False,
        encipher_only=False,
        decipher_only=False,
    )
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before((now - _CLOCKS_BEHIND).astimezone(UTC))
        .not_valid_after((now + lifetime).astimezone(UTC))
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.CLIENT_AUTH]), critical=False)
        .add_extension(
            x509.SubjectAlternativeName([x509.UniformResourceIdentifier(uri), x509.DNSName(host)]),
            critical=False,
        )
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    try:
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_atomically(file, private + certificate.public_bytes(serialization.Encoding.PEM))
        write_atomically(public, certificate.public_bytes(serialization.Encoding.DER))
    except OSError as error:
        raise CertificateError(f"{error.filename or file}: cannot be written: {error.strerror}") from None
    return Made(public, uri, certificate.fingerprint(hashes.SHA256()).hex(), certificate.not_valid_after_utc)
