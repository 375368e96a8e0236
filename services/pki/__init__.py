"""A site's keys: its certificate authority, the certificates that it issued, and their rights.

Reading a folder of keys needs `folder.py` only. Making certificates (`site_keys.py`, `certificates.py`)
needs the package `cryptography`.
"""

from services.pki.folder import Folder

__all__ = ["Folder"]
