"""The site file's `[watch]`, and the settings of the service, which add what it knows of the site."""

from pathlib import Path

from robots.schema.toml_table import TomlTable

# A restart is over by then: the old token is gone and the new one is present.
SETTLED_S = 6.0


class Watch(TomlTable):
    """The service that raises alarms.

    Attributes:
        folder: Folder of its alarms, so that a restart keeps acknowledgements.
    """

    folder: Path = Path("watch")


class Settings(Watch):
    """A site's watch.

    Attributes:
        expected: Services that should run, with their robots (`-`: the whole site), beside those seen.
        settled_s: Minimum time for which a service is missing or duplicate before an alarm begins [s].
    """

    site: str
    expected: tuple[tuple[str, str], ...] = ()
    settled_s: float = SETTLED_S
