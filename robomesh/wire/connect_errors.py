"""Reasons why a router refuses our connection, and the remaining validity of our certificate.

Zenoh reports only that it could not connect. After a failure this module repeats the handshake with
Python's TLS, which reports the reason.
"""

import socket
import ssl
from collections.abc import Iterable
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

from robomesh.contract.certificate_identity import Identity, read_identity
from robomesh.contract.endpoints import Tls
from robomesh.errors import SessionError

_TIMEOUT_S = 2.0
_SOON = timedelta(days=5)
_KEYS = "--keys FILE; in Python keys=FILE"
_NO_TLS = "name the port of a router with TLS, or tcp/HOST:PORT"
# Time to wait after the handshake for an alert about our certificate [s].
_VERDICT_S = 0.5


def own_certificate(tls: Tls | None, now: datetime | None = None) -> tuple[Identity | None, str | None]:
    """Return the identity of our certificate, and a warning if it expires soon.

    Raises:
        SessionError: If a file cannot be read or is damaged, or the certificate has expired.
    """
    if tls is None:
        return None, None
    for file in (tls.ca, tls.key):
        read_identity(file)
    identity = read_identity(tls.certificate)
    try:
        _context(tls)
    except (ssl.SSLError, ValueError) as error:
        mismatch = getattr(error, "reason", "") == "KEY_VALUES_MISMATCH"
        problem = "the key is of another certificate" if mismatch else "a part is missing or damaged"
        files = ", ".join(str(file) for file in dict.fromkeys((tls.certificate, tls.key, tls.ca)))
        raise SessionError(f"{files}: {problem}: copy the bundle of robomesh keys again") from None
    if identity is None or identity.expires is None:
        return identity, None
    left = identity.expires - (now or datetime.now(UTC))
    when = f"{identity.expires:%Y-%m-%d %H:%M} UTC"
    advice = f"robomesh keys renew {identity.name.partition('.')[0]} at site {identity.site}"
    about = f"the certificate of {identity.name}"
    if left <= timedelta(0):
        raise SessionError(f"{tls.certificate}: {about} expired on {when}: {advice}")
    return identity, f"{about} expires on {when}: {advice}" if left < _SOON else None


def left_s(file: Path, at_first: datetime) -> float:
    """Return the time until a file's certificate expires [s].

    Reads the file again, because the next link is opened with a certificate renewed in the meantime.

    Args:
        at_first: Expiry of the certificate at the start; used if the file cannot be read now.
    """
    try:
        identity = read_identity(file)
    except SessionError:
        identity = None
    expires = at_first if identity is None or identity.expires is None else identity.expires
    return (expires - datetime.now(UTC)).total_seconds()


def refusal_of_routers(endpoints: Iterable[str], tls: Tls | None) -> str | None:
    """Return why the first reachable router refuses the connection; None: unknown."""
    return next((reason for each in endpoints if (reason := refusal_of_router(each, tls))), None)


def refusal_of_router(endpoint: str, tls: Tls | None) -> str | None:
    """Return why the TLS handshake with a router fails; None: it does not listen, or it accepts us."""
    protocol, _, rest = endpoint.partition("/")
    host, _, port = rest.partition("?")[0].partition("#")[0].rpartition(":")
    if protocol not in ("tcp", "tls") or not port.isdigit():
        return None
    plain = protocol == "tcp"
    try:
        # A server without TLS may wait forever for the rest of what it takes for a message.
        raw = socket.create_connection((host.strip("[]"), int(port)), _VERDICT_S if plain else _TIMEOUT_S)
    except (OSError, OverflowError, UnicodeError):  # no such port, no such name
        return None
    with raw:
        try:
            with _context(None if plain else tls).wrap_socket(raw) as link:
                if plain:
                    return f"{endpoint} accepts only TLS: name a certificate ({_KEYS})"
                link.settimeout(_VERDICT_S)
                with suppress(TimeoutError):  # no alert
                    link.recv(1)
        except TimeoutError:
            return None if plain else f"{endpoint} accepts connections, but does not answer: {_NO_TLS}"
        except ssl.SSLCertVerificationError as error:
            assert tls is not None
            return f"{endpoint} has a certificate that {tls.ca} did not sign: {error.verify_message}"
        except (ssl.SSLEOFError, ssl.SSLZeroReturnError, ConnectionError):
            # A router without TLS does so with the longer first message of newer OpenSSLs.
            return None if plain else f"{endpoint} accepts connections, but ends them: {_NO_TLS}"
        except ssl.SSLError as error:
            return None if plain else _verdict(endpoint, tls, error)
        except OSError:
            pass
    return None


def _context(tls: Tls | None) -> ssl.SSLContext:
    """Return the context of a client with these certificates; None: of one that accepts any server.

    Raises:
        ssl.SSLError: If a certificate or key is damaged or missing, or they do not belong together.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    if tls is None:
        context.verify_mode = ssl.CERT_NONE
    else:
        context.load_verify_locations(tls.ca)
        # With a password OpenSSL does not ask the terminal for one.
        context.load_cert_chain(tls.certificate, tls.key, password="")
    return context


def _verdict(endpoint: str, tls: Tls | None, error: ssl.SSLError) -> str | None:
    reason = (error.reason or "").lower()
    if "alert" not in reason:
        return f"{endpoint} does not speak TLS: {_NO_TLS}" if "wrong_version" in reason else None
    alert = reason.rpartition("alert_")[2].replace("_", " ")
    shown = "no certificate" if tls is None else f"the certificate in {tls.certificate}"
    known = {
        "certificate required": f"it needs one ({_KEYS})",
        "unknown ca": "another site's authority signed it",
        "certificate expired": "it has expired: robomesh keys renew",
        "certificate revoked": "it was revoked",
    }
    return f"refused by {endpoint}: {shown}: {known.get(alert, alert)}"
