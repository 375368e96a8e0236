"""Certificates: an authority, and what it issues (X.509, EC P-256).

The common name is <name>.<site>, the organizational unit the role. Only a router's certificate may be used by
a server, so no other certificate passes for a router's, whatever its address.
"""

from datetime import UTC, datetime, timedelta
from typing import NamedTuple

from robomesh.extras import missing
from services.pki.errors import KeysError

try:
    from cryptography import x509
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID
except ImportError:
    raise KeysError(missing("cryptography")) from None

# The clock of a machine that has just started may be behind.
_CLOCKS_BEHIND = timedelta(minutes=10)
_AUTHORITY_LIFETIME = timedelta(days=3650)
_AUTHORITY = "authority."


class Issued(NamedTuple):
    """A certificate with its private key, as PEM, and its entry in the list."""

    key: bytes
    certificate: bytes
    serial: str
    fingerprint: str
    issued: datetime
    expires: datetime


class Authority(NamedTuple):
    """The key and certificate that sign a site's certificates."""

    key: ec.EllipticCurvePrivateKey
    certificate: x509.Certificate


class BundleContent(NamedTuple):
    """Content of a bundle's certificate.

    Attributes:
        authority: The site of the authority that signed it.
    """

    name: str
    role: str
    authority: str
    expires: datetime


def make_authority(site: str, now: datetime) -> tuple[bytes, bytes]:
    """Make a new authority's private key and certificate, as PEM."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, _AUTHORITY + site)])
    usage = x509.KeyUsage(
        digital_signature=False,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=True,
        crl_sign=True,
        encipher_only=False,
        decipher_only=False,
    )
    certificate = (
        _builder(name, name, key, now, now + _AUTHORITY_LIFETIME)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .sign(key, hashes.SHA256())
    )
    return _private(key), _pem(certificate)


def read_authority(key: bytes, certificate: bytes) -> Authority:
    """Read an authority from its PEM files.

    Raises:
        KeysError: If they are not a key and its certificate.
    """
    try:
        private = serialization.load_pem_private_key(key, None)
        public = x509.load_pem_x509_certificate(certificate)
    except (ValueError, TypeError) as error:
        raise KeysError(f"the authority's key or certificate cannot be read: {error}") from None
    if not isinstance(private, ec.EllipticCurvePrivateKey) or private.public_key() != public.public_key():
        raise KeysError("the authority's key does not belong to its certificate authority.pem")
    return Authority(private, public)


def issue(
    authority: Authority, name: str, role: str, *, now: datetime, lifetime: timedelta, serves: bool = False
) -> Issued:
    """Make a new key and certificate.

    Args:
        name: Its common name, <name>.<site>.
        serves: Clients may accept it as a router of this site.
    """
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name(
        [
            x509.NameAttribute(NameOID.COMMON_NAME, name),
            x509.NameAttribute(NameOID.ORGANIZATIONAL_UNIT_NAME, role),
        ]
    )
    ends = min(now + lifetime, authority.certificate.not_valid_after_utc)
    usages = [ExtendedKeyUsageOID.CLIENT_AUTH, *([ExtendedKeyUsageOID.SERVER_AUTH] if serves else [])]
    certificate = (
        _builder(subject, authority.certificate.subject, key, now, ends)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage(usages), critical=True)
        .add_extension(x509.SubjectAlternativeName([x509.DNSName(name)]), critical=False)
        .sign(authority.key, hashes.SHA256())
    )
    return Issued(
        _private(key),
        _pem(certificate),
        f"{certificate.serial_number:x}",
        f"sha256:{certificate.fingerprint(hashes.SHA256()).hex()}",
        now,
        certificate.not_valid_after_utc,
    )


def read_bundle(bundle: bytes) -> BundleContent:
    """Read a bundle's certificate and verify that the authority in the same file signed it.

    Raises:
        KeysError: If it is not a bundle, or the signature is wrong.
    """
    try:
        serialization.load_pem_private_key(bundle, None)
        own, authority, *_ = x509.load_pem_x509_certificates(bundle)
        own.verify_directly_issued_by(authority)
        (name,) = own.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
        (role,) = own.subject.get_attributes_for_oid(NameOID.ORGANIZATIONAL_UNIT_NAME)
        (issuer,) = own.issuer.get_attributes_for_oid(NameOID.COMMON_NAME)
    except (ValueError, TypeError, InvalidSignature):
        raise KeysError(
            "not a bundle of a key, its certificate and the authority's: robomesh keys issue writes one"
        ) from None
    return BundleContent(
        str(name.value),
        str(role.value),
        str(issuer.value).removeprefix(_AUTHORITY),
        own.not_valid_after_utc,
    )


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePrivateKey, now: datetime, ends: datetime
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before((now - _CLOCKS_BEHIND).astimezone(UTC))
        .not_valid_after(ends.astimezone(UTC))
    )


def _pem(certificate: x509.Certificate) -> bytes:
    return certificate.public_bytes(serialization.Encoding.PEM)


def _private(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
