"""Commands for files with shapes read one file and others of its folder, and no other file that it names."""

import json

import pytest

from services.command_line.robots import shapes

BOX = "#VRML V2.0 utf8\nShape { geometry Box { } }\n"


@pytest.fixture
def folder(tmp_path):
    """Return a folder with a link to a file outside of it."""
    (tmp_path / "secret.wrl").write_text(BOX)
    (tmp_path / "open" / "parts").mkdir(parents=True)
    (tmp_path / "open" / "link.wrl").symlink_to(tmp_path / "secret.wrl")
    (tmp_path / "open" / "parts" / "box.wrl").write_text(BOX)
    return tmp_path / "open"


@pytest.mark.parametrize(
    "address", ["../secret.wrl", "{outside}/secret.wrl", "file://{outside}/secret.wrl", "link.wrl"]
)
def test_file_outside_of_the_folder_counts_as_missing(folder, address, capsys):
    named = address.format(outside=folder.parent)
    path = folder / "a.wrl"
    path.write_text(f'{BOX}Inline {{ url "{named}" }}\nInline {{ url "parts/box.wrl" }}\n')
    shapes.info(path, True)
    printed = json.loads(capsys.readouterr().out)
    assert printed["triangles"] == 24
    assert (
        "no such file in the folder 'open'; other folders are not read; it is left out"
        in printed["warnings"][0]
    )
    shapes.convert(path, folder / "a.glb", None, None)
    capsys.readouterr()
    shapes.info(folder / "a.glb", True)
    assert json.loads(capsys.readouterr().out)["triangles"] == 24
