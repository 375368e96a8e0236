"""Errors of the reading process, in words."""

import os

from asyncua import ua


class ReadingError(Exception):
    """The server cannot be read; the text says why, and what to do."""


_REMEDIES = {
    "BadCertificateUntrusted": "it does not trust our certificate: let its trust list have it",
    "BadSecurityChecksFailed": "it refuses our certificate: let its trust list have it, and look at its log",
    "BadCertificateUriInvalid": "it refuses the URI in our certificate: make one with robomesh keys opcua",
    "BadCertificateUseNotAllowed": "it refuses the use of our certificate: make one with robomesh keys opcua",
    "BadCertificateTimeInvalid": "our certificate has expired, or a clock is wrong",
    "BadIdentityTokenRejected": "it refuses the user: see user and password_file",
    "BadIdentityTokenInvalid": "it refuses the user: see user and password_file",
    "BadUserAccessDenied": "it refuses the user: see user and password_file",
    "BadTooManySessions": "it has no session left: end another client, or allow more",
    "BadSecurityPolicyRejected": "it refuses this security policy",
}


def in_words(error: BaseException) -> str:
    """Return an error's reason in a line."""
    if isinstance(error, ua.UaStatusCodeError):
        # Its class has the status code's name.
        name = type(error).__name__
        remedy = _REMEDIES.get(name)
        return f"{remedy} ({name})" if remedy else f"the server answers {name}"
    if isinstance(error, TimeoutError):
        return "the server does not answer in time"
    if isinstance(error, OSError) and error.errno and error.errno > 0:
        return os.strerror(error.errno).lower()
    if isinstance(error, ConnectionError):
        return "the server has closed the connection"
    text = str(error).strip()
    if text.startswith("No matching endpoints"):
        return "the server offers no connection with the site file's security"
    return " ".join(text.split()) if text else type(error).__name__
