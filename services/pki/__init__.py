"""A site's keys: its certificate authority, who has a certificate, and what each may do.

Whoever only uses a folder of keys needs `folder.py`; the package `cryptography` is needed where
certificates are made (`deeds.py`, `certificates.py`).
"""

from services.pki.folder import Folder

__all__ = ["Folder"]
