"""Define's imports: meshes of every format, URDF, pairs of links."""

import io
import zipfile
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import trimesh
import zenoh

from robomesh.contract.endpoints import router_config
from robomesh.wire.session import SessionSettings
from robots.bodies.link_pairs import plan_of
from robots.bodies.verdicts import IGNORED
from robots.descriptions.description import load
from robots.descriptions.urdf.write import to_urdf
from tests.ports import free_port
from tests.robots.test_step import step_box
from tests.services.defining import defining

REAL = Path(__file__).parents[3] / "shared" / "testdata" / "urdf" / "abb_irb2400_support"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    mesh = SessionSettings(connect=(endpoint,), wait_s=5.0)
    with (
        zenoh.open(router_config((endpoint,))),
        defining(mesh, tmp_path_factory.mktemp("define")) as page,
    ):
        yield page


def converted(page, name, content, **others):
    files = {name: page.upload(content)} | {path: page.upload(each) for path, each in others.items()}
    return page.post("/mesh", {"file": name, "files": files})


@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "glb", "dae"])
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Setting the shape:DeprecationWarning")  # of pycollada, which writes it
def test_a_box_of_any_format_is_converted(page, ending):
    content = trimesh.creation.box((2.0, 4.0, 6.0)).export(file_type=ending)
    answer = converted(page, f"box.{ending}", content.encode() if isinstance(content, str) else content)
    assert answer.status == 200, answer.text
    found = answer.json
    assert (found["triangles"], found["min"], found["max"]) == (12, [-1, -2, -3], [1, 2, 3])
    glb = trimesh.load(io.BytesIO(page.get(f"/glb/{found['glb']}").body), file_type="glb")
    # The file's own axes, turned to glTF's y up as if they were z up; the page turns them back.
    assert np.allclose(glb.extents, [2.0, 6.0, 4.0])


@pytest.mark.slow
def test_a_dxf_is_converted(page):
    drawing = ezdxf.new()
    drawing.modelspace().add_3dface([(0, 0, 0), (100, 0, 0), (0, 200, 0)])
    text = io.StringIO()
    drawing.write(text)
    found = converted(page, "part.dxf", text.getvalue().encode()).json
    assert (found["triangles"], found["max"]) == (1, [100, 200, 0])


@pytest.mark.slow
def test_a_step_file_is_converted_in_the_confined_worker(page):
    found = converted(page, "box.step", step_box((10, 20, 30)).encode()).json
    assert found["triangles"] == 12
    assert np.allclose(found["max"], [10, 20, 30])


@pytest.mark.slow
def test_a_broken_step_file_is_reported(page):
    answer = converted(page, "part.step", b"ISO-10303-21;\nHEADER;\nnonsense")
    assert answer.status == 422
    assert answer.json["text"].startswith("part.step: cannot be read as STEP")


@pytest.mark.slow
def test_scale_and_axis_are_guessed_with_a_reason(page):
    box = trimesh.creation.box((200.0, 100.0, 50.0)).export(file_type="stl")
    found = converted(page, "a.stl", box).json
    assert (found["scale"], found["up"]) == (0.001, "z")
    assert "millimetres" in found["guess"]
    found = converted(page, "b.stl", trimesh.creation.box((0.2, 0.1, 0.3)).export(file_type="stl")).json
    assert found["scale"] == 1.0


@pytest.mark.slow
def test_missing_files_are_asked_for_by_name(page):
    outer = b'#VRML V2.0 utf8\nInline { url "part.wrl" }\nShape { geometry Box { } }\n'
    found = converted(page, "a.wrl", outer).json
    assert (found["triangles"], found["missing"]) == (12, ["part.wrl"])
    found = converted(page, "b.wrl", b'#VRML V2.0 utf8\nInline { url "part.wrl" }\n').json
    assert (found["triangles"], found["missing"]) == (0, ["part.wrl"])
    assert page.get(f"/glb/{found['glb']}").body[:4] == b"glTF"
    obj = b"mtllib paint.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    assert converted(page, "c.obj", obj).json["missing"] == ["paint.mtl"]


@pytest.mark.slow
def test_a_broken_igs_is_refused_in_words(page):
    answer = converted(page, "a.igs", b"S      1\n")
    assert answer.status == 422
    assert "IGES" in answer.text


def kinds(page, draft):
    """Return what the page shows of each pair: the server's plan, and the draft's own choices."""
    answer = page.post("/collisions", draft)
    assert answer.status == 200, answer.text
    ticked = {frozenset(pair) for pair in draft["description"].get("collision", {}).get("ignore", [])}
    found = {frozenset(pair["links"]): pair for pair in answer.json["pairs"]}
    return {
        pair: "description" if pair in ticked and each["kind"] != "adjacent" else each["kind"]
        for pair, each in found.items()
    }


@pytest.mark.slow
def test_each_pair_of_links_is_judged(page):
    found = kinds(page, page.draft())
    assert len(found) == 15, "6 links"
    assert found[frozenset(("base", "column"))] == "adjacent"
    assert found[frozenset(("base", "forearm"))] == "apart"


@pytest.mark.slow
def test_pairs_that_the_draft_ignores_are_judged_too(page):
    draft = page.draft()
    draft["description"]["collision"] = {"ignore": [["base", "forearm"]]}
    (pair,) = (
        each
        for each in page.post("/collisions", draft).json["pairs"]
        if set(each["links"]) == {"base", "forearm"}
    )
    assert pair["kind"] == "apart"


@pytest.mark.slow
@pytest.mark.skipif(not REAL.is_dir(), reason="no ../shared/testdata/urdf: no real robots")
def test_an_imported_robot_is_checked_against_itself_like_its_urdf(page):
    """Check the ABB IRB 2400 with its SRDF and collision meshes against `robomesh robot check`."""
    model = REAL / "urdf" / "irb2400_12_155.urdf"
    files = {
        str(path.relative_to(REAL.parent)): page.upload(path.read_bytes(), path.name)
        for path in REAL.rglob("*")
        if path.is_file()
    }
    answer = page.post("/import", {"file": str(model.relative_to(REAL.parent)), "files": files})
    assert answer.status == 200, answer.text
    draft = {"description": answer.json["description"] | {"name": "imported"}, "files": answer.json["files"]}
    assert len([path for path in draft["files"] if "collision" in path]) == 7
    found = kinds(page, draft)

    # Rows have no linkages: these parts are fixed to the links that carry them.
    arm = ("base_link", *(f"link_{number}" for number in range(1, 7)))
    of_urdf = {
        frozenset(link.replace("base_link", "base") for link in each.links): each.kind
        for each in plan_of(load(model)).verdicts
        if set(each.links) <= set(arm)
    }
    assert found.keys() == of_urdf.keys()
    ignored = {pair for pair, kind in of_urdf.items() if kind in IGNORED}
    assert {pair for pair, kind in found.items() if kind in IGNORED} == ignored
    assert of_urdf[frozenset(("link_4", "link_6"))] == "srdf"
    assert found[frozenset(("link_4", "link_6"))] == "description"
    touching = {"touching", "no_surface", "not_studied"}
    assert touching.isdisjoint(of_urdf.values())
    assert touching.isdisjoint(found.values())

    # After saving, it is as the page showed it.
    assert page.post("/save", draft).status == 200
    saved = plan_of(load(page.folder / "robots" / "imported"))
    assert {frozenset(each.links): each.kind for each in saved.verdicts} == found


@pytest.mark.slow
def test_a_urdf_becomes_rows_that_put_every_link_where_it_was(page):
    draft = page.draft("puma560")
    description = load("puma560")
    text = to_urdf(description, shape_uri=lambda link: f"package://puma/meshes/{link}.stl")
    box = page.upload(trimesh.creation.box((0.1, 0.1, 0.1)).export(file_type="stl"))
    files = {"puma/puma.urdf": page.upload(text.encode())}
    for link in ("base", "column"):
        files[f"puma/meshes/{link}.stl"] = box
    answer = page.post("/import", {"file": "puma/puma.urdf", "files": files})
    assert answer.status == 200, answer.text
    found = answer.json
    assert {path.rsplit("/", 1)[-1] for path in found["missing"]} >= {"upper_arm.stl"}
    assert found["files"].keys() == {"meshes/base.glb", "meshes/column.glb"}
    found["description"]["name"] = "again"
    joints = {"joints": [10, 20, 30, 40, 50, 60]}
    one = page.post("/check", draft | joints).json
    other = page.post("/check", {**found, **joints}).json
    assert other["problems"] == []
    assert np.allclose(one["tool"], other["tool"], rtol=0, atol=1e-9)
    assert page.post("/save", {**found}).status == 200
    assert load(page.folder / "robots" / "again").joints[1].name == description.joints[1].name


OPENHRP = b"""#VRML V2.0 utf8
DEF ARM Humanoid { name "arm" humanoidBody [
  DEF ROOT Joint { jointType "fixed" children [
    DEF BASE Segment { children Shape { geometry Box { size 0.1 0.1 0.1 } } }
    DEF TURN Joint {
      jointType "rotate" jointId 0 jointAxis 0 0 1 translation 0 0 0.5 llimit -1 ulimit 1
      children [ DEF LINK Segment { children Shape { geometry Box { size 0.2 0.2 0.2 } } } ]
    }
  ] }
] }
"""


@pytest.mark.slow
def test_an_openhrp_file_gives_joints_axes_and_limits(page):
    answer = page.post("/import", {"file": "arm.wrl", "files": {"arm.wrl": page.upload(OPENHRP)}})
    assert answer.status == 200, answer.text
    (row,) = answer.json["description"]["joint"]
    assert row["limits"] == pytest.approx(np.degrees([-1.0, 1.0]))
    assert len(answer.json["files"]) == 2
    check = page.post("/check", answer.json).json
    assert check["problems"] == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"<robot", "is not XML"),
        (b'<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot>&x;</robot>', "DOCTYPE"),
        (b'<robot name="r"/>', "link"),
    ],
)
@pytest.mark.slow
def test_an_invalid_urdf_is_reported(page, text, words):
    answer = page.post("/import", {"file": "a.urdf", "files": {"a.urdf": page.upload(text)}})
    assert answer.status == 422
    assert words in answer.text
    assert str(page.folder) not in answer.text


@pytest.mark.slow
def test_no_urdf_shows_a_file_of_the_servers(page):
    secret = page.folder / "secret.stl"
    secret.write_bytes(trimesh.creation.box((1, 1, 1)).export(file_type="stl"))
    text = (
        '<robot name="r"><link name="base"><visual><geometry><mesh filename="{}"/></geometry></visual></link>'
        '<link name="arm"/><joint name="j" type="revolute"><parent link="base"/><child link="arm"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="0"/></joint></robot>'
    )
    for address in (str(secret), f"file://{secret}", "../../../secret.stl", "package://../../secret.stl"):
        sha = page.upload(text.format(address).encode())
        answer = page.post("/import", {"file": "a.urdf", "files": {"a.urdf": sha}})
        assert answer.status == 200, answer.text
        assert answer.json["files"] == {}
        assert answer.json["missing"] == [address]


@pytest.mark.slow
def test_a_saved_robot_by_urdf_is_listed_and_opened_as_rows(page):
    robot = page.folder / "robots" / "by-urdf"
    robot.mkdir(parents=True)
    (robot / "puma.urdf").write_text(to_urdf(load("puma560"), shape_uri=lambda link: f"{link}.stl"))
    (robot / "robot.toml").write_text('name = "by-urdf"\nurdf = "puma.urdf"\n')
    rows = {row["name"]: row for row in page.get("/robots").json["robots"]}
    assert rows["by-urdf"]["joints"] == 6
    opened = page.get("/robots/by-urdf").json
    assert len(opened["description"]["joint"]) == 6
    assert opened["notes"] is not None


def archive(files):
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as zipped:
        for path, content in files.items():
            zipped.writestr(path, content)
    return data.getvalue()


def stated(content, size):
    """Return an archive of one file whose directory states another size of it."""
    at = content.rindex(b"PK\x01\x02") + 24
    return content[:at] + size.to_bytes(4, "little") + content[at + 4 :]


def unzipped(page, content):
    return page.post("/unzip", {"file": "a.zip", "files": {"a.zip": page.upload(content)}})


@pytest.mark.slow
def test_a_downloaded_zip_opens_as_the_draft_that_it_was(page):
    draft = page.get("/robots/pt500").json
    draft["description"]["name"] = "mine"
    files = unzipped(page, page.post("/zip", draft).body).json["files"]
    assert files == {f"mine/{path}": sha for path, sha in draft["files"].items()} | {
        "mine/robot.toml": files["mine/robot.toml"]
    }
    opened = page.post("/import", {"file": "mine/robot.toml", "files": files}).json
    assert opened["description"] == draft["description"]
    assert opened["files"] == draft["files"]


@pytest.mark.parametrize(
    ("content", "code", "words"),
    [
        (lambda: b"", "define.not_zip", "is not a readable zip archive"),
        (lambda: b"PK\x03\x04 and no more", "define.not_zip", "is not a readable zip archive"),
        (lambda: archive({"../up.wrl": b"x"}), "define.path", "'../up.wrl' is not the path"),
        (lambda: archive({"/etc/x": b"x"}), "define.path", "'/etc/x' is not the path"),
        (
            lambda: archive({f"{number}.wrl": b"" for number in range(2001)}),
            "define.zip_too_large",
            "2001 files",
        ),
        (lambda: stated(archive({"bomb.wrl": b""}), 501_000_000), "define.zip_too_large", "501 MB"),
    ],
    ids=["empty", "cut", "up", "root", "many", "bomb"],
)
@pytest.mark.slow
def test_a_wrong_zip_is_refused_with_code_and_sentence(page, content, code, words):
    answer = unzipped(page, content())
    assert (answer.status, answer.code) == (422, code)
    assert words in answer.json["text"]


@pytest.mark.slow
def test_a_zip_whose_entry_is_larger_than_it_says_is_refused(page):
    answer = unzipped(page, stated(archive({"a.wrl": b"x" * 5000}), 10))
    assert answer.status == 422
    assert "is not a readable zip archive" in answer.text


@pytest.mark.slow
def test_a_robot_toml_in_a_dropped_folder_that_names_a_urdf_becomes_rows(page):
    urdf = to_urdf(load("puma560"), shape_uri=lambda link: f"{link}.stl").encode()
    files = {
        "puma/robot.toml": page.upload(b'name = "puma"\nurdf = "puma.urdf"\n'),
        "puma/puma.urdf": page.upload(urdf),
    }
    opened = page.post("/import", {"file": "puma/robot.toml", "files": files}).json
    assert len(opened["description"]["joint"]) == 6
