"""Security of the connection: choice of a server's endpoint, and check of its pinned certificate."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from asyncua import Client, ua
from asyncua.crypto import security_policies as policies
from asyncua.crypto.uacrypto import CertProperties
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization

from controllers.opcua.reader.problems import ReadingError, in_words
from controllers.opcua.reader.session import TIMEOUT_S, ReadOnlyGuard
from controllers.opcua.settings import OpcUaSettings
from protocol_gateway.seam.errors import GatewaySettingsError
from protocol_gateway.seam.secret_file import read_password, read_secret
from robomesh.texts import one_line

_POLICIES: dict[str, type[policies.SecurityPolicy]] = {
    each.URI: each
    for each in (
        policies.SecurityPolicyAes256Sha256RsaPss,
        policies.SecurityPolicyAes128Sha256RsaOaep,
        policies.SecurityPolicyBasic256Sha256,
    )
}
"""The best first; older ones use SHA-1."""
_NAME = "robomesh"
_T = TypeVar("_T")


def client_of(url: str) -> Client:
    """Return a client without security, which only reads."""
    client = Client(url, timeout=TIMEOUT_S)
    client.name = client.description = _NAME
    client.uaclient.observer = ReadOnlyGuard()
    return client


async def endpoints_of(url: str) -> list[ua.EndpointDescription]:
    """Ask a server for its endpoints, which needs no session.

    Raises:
        ReadingError: If it does not answer.
    """
    try:
        endpoints: list[ua.EndpointDescription] = await client_of(url).connect_and_get_server_endpoints()
    except Exception as error:
        raise ReadingError(f"it does not list its endpoints: {in_words(error)}") from None
    return endpoints


@dataclass(frozen=True, slots=True)
class Offers:
    """Offers of a server.

    Attributes:
        name: Its application's name.
        security: Names of policies, by the mode's name.
        fingerprints: Of its certificates with SignAndEncrypt and a policy that is used here.
    """

    name: str
    security: Mapping[str, Sequence[str]]
    fingerprints: frozenset[str]


def offers_of(endpoints: Sequence[ua.EndpointDescription]) -> Offers:
    """Return what a server's endpoints offer."""
    security: dict[str, list[str]] = {}
    name = ""
    for each in endpoints:
        policy = (each.SecurityPolicyUri or "").rpartition("#")[2]
        policies = security.setdefault(each.SecurityMode.name.rstrip("_"), [])
        if policy not in policies:
            policies.append(policy)
        text = each.Server.ApplicationName if each.Server is not None else None
        name = name or (text.Text if text is not None else None) or ""
    certificates = _encrypted(endpoints).values()
    return Offers(
        one_line(name) or "without a name",
        security,
        frozenset(fingerprint(first_certificate(each)) for each in certificates),
    )


def _encrypted(endpoints: Sequence[ua.EndpointDescription]) -> dict[str, bytes]:
    """Return the certificates of the endpoints that may be used, by their policies."""
    return {
        each.SecurityPolicyUri: each.ServerCertificate or b""
        for each in endpoints
        if each.SecurityMode == ua.MessageSecurityMode.SignAndEncrypt and each.SecurityPolicyUri in _POLICIES
    }


async def secured_client(url: str, settings: OpcUaSettings) -> Client:
    """Return a client for `connect`, with the site file's security and user.

    Raises:
        ReadingError: If the server offers no such security, has another certificate, or a file is missing.
    """
    client = client_of(url)
    if settings.security != "none":
        own, key = _own(Path(settings.certificate))
        policy, server = _chosen(await endpoints_of(url), settings.server_certificate)
        client.application_uri = _uri(own, settings.certificate)
        await client.set_security(
            policy,
            CertProperties(own.public_bytes(serialization.Encoding.DER), "der"),
            CertProperties(key, "der"),
            server_certificate=CertProperties(server, "der"),
            mode=ua.MessageSecurityMode.SignAndEncrypt,
        )
    if settings.user:
        client.set_user(settings.user)
        client.set_password(_of_file(read_password, settings.password_file, "password_file"))
    return client


def _chosen(
    endpoints: Sequence[ua.EndpointDescription], pinned: str
) -> tuple[type[policies.SecurityPolicy], bytes]:
    """Return the best policy among the endpoints with the pinned certificate, and that certificate."""
    offered = _encrypted(endpoints)
    if not offered:
        raise ReadingError(
            "the server offers no SignAndEncrypt with Basic256Sha256 or a newer policy: switch it on there, "
            'or write security = "none" if the network is trusted'
        )
    seen = {fingerprint(first_certificate(each)): first_certificate(each) for each in offered.values()}
    if pinned not in seen:
        raise ReadingError(
            f"the server's certificate has the fingerprint sha256:{min(seen)}, but the site file has "
            f"sha256:{pinned or '(none)'}: compare it with the one that the server shows at its own panel, "
            "and if they agree write it as server_certificate"
        )
    best = next(
        uri for uri in _POLICIES if uri in offered and fingerprint(first_certificate(offered[uri])) == pinned
    )
    return _POLICIES[best], seen[pinned]


def first_certificate(chain: bytes) -> bytes:
    """Return the first certificate of a chain, which servers may send in one piece."""
    if chain[:2] != b"\x30\x82" or len(chain) < 4:
        return chain
    return chain[: int.from_bytes(chain[2:4], "big") + 4]


def fingerprint(certificate: bytes) -> str:
    """Return the SHA-256 sum of a certificate in DER, as hexadecimal digits."""
    digest = hashes.Hash(hashes.SHA256())
    digest.update(certificate)
    return digest.finalize().hex()


def _own(path: Path) -> tuple[x509.Certificate, bytes]:
    """Return our certificate, and its private key as DER."""
    content = _of_file(read_secret, path, "certificate")
    try:
        key = serialization.load_pem_private_key(content, None)
        certificate = x509.load_pem_x509_certificate(content)
    except (ValueError, TypeError) as error:
        raise ReadingError(
            f"{path}: not a certificate with its private key in PEM ({error}): robomesh keys opcua makes one"
        ) from None
    plain = key.private_bytes(
        serialization.Encoding.DER, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    return certificate, plain


def _uri(certificate: x509.Certificate, path: str) -> str:
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        return names.get_values_for_type(x509.UniformResourceIdentifier)[0]
    except (x509.ExtensionNotFound, IndexError):
        raise ReadingError(
            f"{path}: the certificate has no application URI: robomesh keys opcua makes one with it"
        ) from None


def _of_file(read: Callable[[Path, str], _T], path: str | Path, key: str) -> _T:
    """Return the content of a file that only its owner may read."""
    try:
        return read(Path(path), key)
    except GatewaySettingsError as error:
        raise ReadingError(str(error)) from None
