"""What the site file says of the page: `[console]`."""

from pathlib import Path

from pydantic import BaseModel, StrictBool

from services.site_file.part import Quiet


class ConsoleTls(BaseModel):
    """The page's certificate, with those that signed it, and its key (PEM)."""

    model_config = Quiet
    certificate: Path
    key: Path


class Console(BaseModel):
    """Where the page is served, and to whom."""

    model_config = Quiet
    listen: str = "127.0.0.1:8080"
    # Names that people reach it by, beside addresses and localhost.
    hosts: tuple[str, ...] = ()
    # Who may sign in (robomesh accounts); without it whoever reaches the page may use it.
    accounts: Path | None = None
    tls: ConsoleTls | None = None
    insecure: StrictBool = False

    @property
    def scheme(self) -> str:
        """Of the page's address."""
        return "https" if self.tls is not None else "http"


def beside(console: Console, folder: Path) -> Console:
    """The same with its paths taken from the site file's folder."""
    changes: dict[str, object] = {}
    if console.accounts is not None:
        changes["accounts"] = folder / console.accounts
    if console.tls is not None:
        files = {"certificate": folder / console.tls.certificate, "key": folder / console.tls.key}
        changes["tls"] = ConsoleTls.model_validate(files)
    return console.model_copy(update=changes)
