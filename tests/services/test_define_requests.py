"""Requests of the page's Define to the console, over real HTTP."""

import hashlib
import io
import json
import shutil
import socket
import zipfile
from concurrent.futures import ThreadPoolExecutor
from urllib.parse import unquote

import pytest
import zenoh
from starlette.requests import Request

from robomesh.contract.endpoints import router_config
from robomesh.wire.session import SessionSettings
from robots.descriptions.description import LIBRARY, load
from robots.descriptions.save_description import read_robot, write_folder
from services.command_line.service_settings.table import Options
from services.command_line.site import launch
from services.console.common.errors import RefusedRequest
from services.console.define import routes, store
from services.console.define.routes import Define
from services.console.define.settings import DefineSettings
from services.site_file.site import Define as DefinePart
from services.site_file.site import Site
from tests.ports import free_port
from tests.services.defining import defining
from tests.site import wait_until

TRIANGLE = (
    b"#VRML V2.0 utf8\n"
    b"Shape { geometry IndexedFaceSet { coord Coordinate { point [0 0 0, 2 0 0, 0 3 0] } "
    b"coordIndex [0 1 2 -1] } }\n"
)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    mesh = SessionSettings(connect=(endpoint,), wait_s=5.0)
    with (
        zenoh.open(router_config((endpoint,))),
        defining(mesh, tmp_path_factory.mktemp("define")) as page,
    ):
        yield page


@pytest.mark.parametrize(
    "path",
    ["files?name=a.wrl", "mesh", "check", "collisions", "import", "unzip", "save", "zip", "start", "stop"],
)
@pytest.mark.parametrize("origin", ["", "null", "http://evil.example", "http://127.0.0.1:1"])
def test_a_request_from_another_page_is_refused(page, path, origin):
    answer = page.post(f"/{path}", {}, Origin=origin)
    assert (answer.status, answer.code) == (403, "http.origin")


def test_a_foreign_host_name_is_refused(page):
    assert page.get("/robots", Host="evil.example").status == 421


def test_the_librarys_robots_can_be_opened(page):
    found = page.get("/robots").json
    assert {"name": "pt500", "title": "Pt500", "origin": "library", "joints": 5, "running": False} in found[
        "robots"
    ]
    assert found["can_start"]
    draft = page.get("/robots/pt500").json
    assert draft["description"]["joint"][1]["name"] == "shoulder"
    assert sorted(draft["files"])[0] == "meshes/base.wrl"


@pytest.mark.parametrize("name", ["none", "..", "%2e%2e", "..%2fpt500", ".git", "*"])
def test_a_missing_robot_is_reported(page, name):
    answer = page.get(f"/robots/{name}")
    code = "http.no_path" if "/" in unquote(name) else "define.no_robot"
    assert (answer.status, answer.code) == (404, code)


def test_a_file_is_kept_by_its_content(page):
    answer = page.post("/files?name=links/a.wrl", TRIANGLE)
    assert answer.json == {"sha": hashlib.sha256(TRIANGLE).hexdigest(), "size": len(TRIANGLE)}


@pytest.mark.parametrize("name", ["", "/etc/passwd", "../a.wrl", "a/../../b", "a%00b", "a%5cb"])
@pytest.mark.slow
def test_a_file_whose_name_leads_elsewhere_is_refused(page, name):
    answer = page.post(f"/files?name={name}", b"x")
    assert (answer.status, answer.code) == (422, "define.path")
    sha = page.upload(b"x")
    name = unquote(name)
    answer = page.post("/mesh", {"file": name, "files": {name: sha}})
    assert (answer.status, answer.code) == (422, "define.path")


@pytest.mark.parametrize("names", [("a", "a/b"), ("a/b", "a")])
def test_a_file_whose_name_is_anothers_folder_is_refused(page, names):
    answer = page.post("/check", {"description": {}, "files": dict.fromkeys(names, page.upload(b"x"))})
    assert (answer.status, answer.code) == (422, "define.file_is_folder")


@pytest.mark.slow
def test_a_shape_is_converted_in_its_own_units(page):
    answer = page.post("/mesh", {"file": "m/a.wrl", "files": {"m/a.wrl": page.upload(TRIANGLE)}}).json
    assert (answer["triangles"], answer["min"], answer["max"]) == (1, [0, 0, 0], [2, 3, 0])
    glb = page.get(f"/glb/{answer['glb']}")
    assert glb.body[:4] == b"glTF"
    assert hashlib.sha256(glb.body).hexdigest() == answer["glb"]


@pytest.mark.slow
def test_an_inlined_file_is_found_beside_the_other(page):
    outer = b'#VRML V2.0 utf8\nInline { url "parts/in ner.wrl" }\n'
    files = {"m/a.wrl": page.upload(outer), "m/parts/in ner.wrl": page.upload(TRIANGLE)}
    assert page.post("/mesh", {"file": "m/a.wrl", "files": files}).json["triangles"] == 1


@pytest.mark.slow
def test_a_broken_shape_is_reported_without_the_servers_folders(page):
    broken = page.post("/mesh", {"file": "a.wrl", "files": {"a.wrl": page.upload(TRIANGLE[:-9])}})
    assert (broken.status, broken.code) == (422, "define.unreadable")
    assert broken.json["text"].startswith("a.wrl")
    assert str(page.folder) not in broken.text


@pytest.mark.parametrize("address", ["{}/secret.wrl", "../../../secret.wrl", "file://{}/secret.wrl"])
@pytest.mark.slow
def test_no_shape_shows_a_file_of_the_servers(page, address):
    (page.folder / "secret.wrl").write_bytes(TRIANGLE)
    text = f'#VRML V2.0 utf8\nInline {{ url "{address.format(page.folder)}" }}\n'
    answer = page.post("/mesh", {"file": "a.wrl", "files": {"a.wrl": page.upload(text.encode())}})
    assert answer.status == 422 or answer.json["triangles"] == 0


@pytest.mark.slow
def test_no_description_names_a_file_of_the_servers(page):
    (page.folder / "secret.wrl").write_bytes(TRIANGLE)
    draft = page.draft()
    for mesh in (f"{page.folder}/secret.wrl", "../../../secret.wrl", "meshes/../../x.wrl"):
        draft["description"]["base"]["mesh"] = mesh
        (problem,) = page.post("/check", draft).json["problems"]
        assert problem["path"] == ["base", "mesh"]
        assert page.post("/save", draft).status == 422


@pytest.mark.slow
def test_a_right_draft_has_no_problems_and_its_tool_is_where_the_arm_ends(page):
    draft = page.draft()
    answer = page.post("/check", draft | {"joints": [0.0, 90.0, 0.0, 0.0, 0.0]}).json
    assert answer["problems"] == []
    # Straight up: 300 + 250 + 250 + 100 mm.
    assert [row[3] for row in answer["tool"]] == pytest.approx([0.0, 0.0, 0.9, 1.0], abs=1e-12)
    assert list(answer["links"]) == ["base", "column", "upper_arm", "forearm", "wrist", "flange"]


@pytest.mark.slow
def test_problems_have_places_and_the_links_are_still_shown(page):
    draft = page.draft() | {"files": {}}
    draft["description"] = draft["description"] | {"base": {}}
    answer = page.post("/check", draft).json
    assert ["joint", 0, "link", "mesh"] in [problem["path"] for problem in answer["problems"]]
    assert answer["tool"] is not None
    draft["description"]["joint"][2]["limits"] = [1, 0]
    answer = page.post("/check", draft).json
    assert ["joint", 2, "limits"] in [problem["path"] for problem in answer["problems"]]
    assert answer["tool"] is None


@pytest.mark.parametrize("joints", [[1.0], [0, 0, 0, 0, None], "home", [0, 0, 0, 0, 1e999]])
@pytest.mark.slow
def test_joints_of_another_robot_are_refused(page, joints):
    answer = page.post("/check", page.draft() | {"joints": joints})
    assert (answer.status, answer.code) == (422, "define.joints")
    assert answer.json["refusal"]["values"] == {"count": "5"}


@pytest.mark.parametrize(
    ("body", "status", "code", "words"),
    [
        (b"{", 400, "request.not_json", "not JSON"),
        (b"[" * 100_000, 400, "request.not_json", "not JSON"),
        (b"[]", 400, "request.not_json_object", "is not a JSON object"),
        (b'{"description": 5}', 422, "request.needs_object", "description"),
        (b'{"description": {}, "files": []}', 422, "define.files", "files"),
        (b'{"description": {}, "files": {"a.wrl": "../../x"}}', 410, "define.file_gone", "no longer stored"),
        (
            b'{"description": {}, "files": {"a.wrl": "' + b"0" * 64 + b'"}}',
            410,
            "define.file_gone",
            "a.wrl: no longer stored",
        ),
        (b" " * 4_000_001, 413, "request.too_large", "larger than 4000000 bytes"),
    ],
)
def test_a_wrong_request_is_refused_with_code_and_sentence(page, body, status, code, words):
    answer = page.post("/check", body)
    assert (answer.status, answer.code) == (status, code)
    assert words in answer.json["text"]


@pytest.mark.slow
def test_a_draft_is_saved_replaced_on_request_and_opened(page):
    draft = page.draft(name="saved")
    saved = page.post("/save", draft).json
    assert (saved["name"], saved["folder"]) == ("saved", f"{page.folder}/robots/saved")
    again = page.post("/save", draft)
    assert (again.status, again.code) == (409, "define.exists")
    assert (again.json["exists"], again.json["changed"]) == (True, False)
    draft["description"]["title"] = "Mine"
    assert page.post("/save", draft | {"overwrite": True}).status == 200
    assert load(page.folder / "robots" / "saved").title == "Mine"
    opened = page.get("/robots/saved").json
    assert opened["description"] == draft["description"]
    assert opened["files"] == draft["files"]
    assert [row for row in page.get("/robots").json["robots"] if row["origin"] == "site"] == [
        {"name": "saved", "title": "Mine", "origin": "site", "joints": 5, "running": False}
    ]


@pytest.mark.slow
def test_saving_over_another_clients_change_needs_confirmation(page):
    first = page.draft(name="shared")
    assert page.post("/save", first).status == 200
    one, other = page.get("/robots/shared").json, page.get("/robots/shared").json
    assert one["revision"] == other["revision"]
    one["description"]["title"] = "One's"
    after = page.post("/save", one)
    assert after.status == 200, "nobody had changed it"
    other["description"]["title"] = "The other's"
    asked = page.post("/save", other)
    assert (asked.status, asked.json["exists"], asked.json["changed"]) == (409, True, True)
    assert asked.code == "define.changed"
    assert load(page.folder / "robots" / "shared").title == "One's"
    # The client that saved last needs no confirmation.
    one["description"]["title"] = "One's again"
    again = page.post("/save", one | {"revision": after.json["revision"]})
    assert again.status == 200
    assert page.get("/robots/shared").json["revision"] == again.json["revision"]
    assert page.post("/save", other | {"overwrite": True}).status == 200


@pytest.mark.slow
def test_files_added_to_an_open_robots_folder_are_kept(page):
    page.post("/save", page.draft(name="visited"))
    opened = page.get("/robots/visited").json
    folder = page.folder / "robots" / "visited"
    (folder / "README.md").write_text("weeks of work")
    assert page.post("/save", opened).json["changed"] is True
    assert (folder / "README.md").read_text() == "weeks of work"
    assert page.post("/save", page.get("/robots/visited").json).status == 200
    assert (folder / "README.md").read_text() == "weeks of work"


@pytest.mark.slow
def test_two_that_save_over_the_same_at_once_do_not_both_win(page):
    page.post("/save", page.draft(name="raced"))
    opened = page.get("/robots/raced").json
    drafts = [{**opened, "description": opened["description"] | {"title": f"{n}"}} for n in range(4)]
    with ThreadPoolExecutor(4) as pool:
        statuses = list(pool.map(lambda draft: page.post("/save", draft).status, drafts))
    assert sorted(statuses) == [200, 409, 409, 409]
    assert load(page.folder / "robots" / "raced").title == str(statuses.index(200))


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("meshes/base.wrl", b"garbage"),
        ("meshes/base.3ds", b"junk"),
        ("meshes/base.wrl", b"#VRML V2.0 utf8\n"),
    ],
    ids=["garbage", "junk", "empty"],
)
@pytest.mark.slow
def test_a_draft_whose_shape_cannot_be_drawn_is_not_saved(page, file, content):
    draft = page.draft(name="unreadable")
    draft["files"][file] = page.upload(content)
    draft["description"]["base"] = {"mesh": file}
    answer = page.post("/save", draft)
    assert answer.status == 422
    (problem,) = answer.json["problems"]
    assert problem["path"] == ["base", "mesh"]
    assert problem["text"].startswith(f"{file}: ")
    assert str(page.folder) not in problem["text"]
    assert not (page.folder / "robots" / "unreadable").exists()


@pytest.mark.parametrize("value", ["1979-05-27", "nan", "[1.0, -inf]", "9" * 400])
@pytest.mark.slow
def test_a_saved_robot_with_invalid_values_is_reported(page, value):
    robot = page.folder / "robots" / "dated"
    robot.mkdir(parents=True, exist_ok=True)
    (robot / "robot.toml").write_text(f'name = "dated"\nprovenance = {value}\n')
    answer = page.get("/robots/dated")
    assert answer.status == 422
    assert "provenance" in answer.text
    dropped = {"dated/robot.toml": page.upload((robot / "robot.toml").read_bytes())}
    answer = page.post("/import", {"file": "dated/robot.toml", "files": dropped})
    assert answer.status == 422
    assert "provenance" in answer.text
    shutil.rmtree(robot)


@pytest.mark.parametrize(
    ("value", "words"),
    [("9" * 400, "a number of 400 digits"), ("[" * 900 + "]" * 900, "nested too deeply")],
    ids=["digits", "nested"],
)
def test_a_zip_of_invalid_values_is_refused(page, value, words):
    answer = page.post("/zip", f'{{"description": {{"name": "a", "title": {value}}}}}'.encode())
    assert answer.status in (400, 422)
    assert words in answer.text


def test_a_draft_of_one_file_under_many_names_is_not_grown(page):
    sha = page.upload(bytes(2_000_000))
    files = {f"{number}.bin": sha for number in range(251)}
    answer = page.post("/check", {"description": {}, "files": files})
    assert answer.status == 413
    assert answer.json["text"] == "251 files of 502 MB: at most 500 MB are possible"
    assert answer.code == "define.files_too_large"


@pytest.mark.slow
def test_a_wrong_draft_is_not_saved_and_its_problems_come_with_their_places(page):
    draft = page.draft(name="wrong")
    draft["description"]["joint"][0]["home"] = 500
    answer = page.post("/save", draft)
    assert answer.status == 422
    assert answer.json["problems"][0]["path"] == ["joint", 0, "home"]
    assert answer.code == "define.problems"
    assert not (page.folder / "robots" / "wrong").exists()


@pytest.mark.slow
def test_a_library_robots_name_is_not_taken(page):
    answer = page.post("/save", page.draft(name="pt500"))
    assert answer.status == 422
    assert answer.json["problems"][0]["path"] == ["name"]


def test_a_draft_comes_as_one_zip(page):
    answer = page.post("/zip", page.draft(name="mine"))
    assert answer.headers["Content-Type"] == "application/zip"
    with zipfile.ZipFile(io.BytesIO(answer.body)) as zipped:
        assert "mine/robot.toml" in zipped.namelist()
        assert "mine/meshes/base.wrl" in zipped.namelist()


@pytest.mark.slow
def test_half_a_character_is_refused_in_words(page):
    draft = page.draft()
    draft["description"]["title"] = "\ud800"
    assert page.post("/save", draft).status == 422
    assert page.post("/zip", draft).code == "request.half_character"


@pytest.mark.slow
def test_starting_writes_the_file_that_the_supervisor_follows(page):
    page.post("/save", page.draft(name="runner"))
    assert page.post("/start", {"name": "runner"}).json == {"site": "s", "robot": "runner"}
    started = page.folder / "robots" / "started.toml"
    assert 'model = "runner/robot.toml"' in started.read_text()
    assert page.post("/start", {"name": "runner"}).code == "define.runs"
    assert {row["name"] for row in page.get("/robots").json["robots"] if row["running"]} == {"runner"}
    assert page.post("/stop", {"name": "runner"}).status == 200
    assert "runner" not in started.read_text()
    assert page.post("/stop", {"name": "runner"}).code == "define.not_started"
    assert page.post("/stop", {"name": "arm"}).code == "define.in_site_file"


@pytest.mark.slow
def test_a_robot_of_the_sites_own_name_is_not_started(page):
    page.post("/save", page.draft(name="arm"))
    answer = page.post("/start", {"name": "arm"})
    assert (answer.status, answer.code) == (409, "define.site_has")


@pytest.mark.slow
def test_a_robot_whose_shape_cannot_be_read_is_not_started(page):
    assert page.post("/save", page.draft(name="torn")).status == 200
    (page.folder / "robots" / "torn" / "meshes" / "base.wrl").write_bytes(TRIANGLE[:-9])
    answer = page.post("/start", {"name": "torn"})
    assert answer.status == 422
    assert answer.json["text"].startswith("meshes/base.wrl")


def test_without_a_supervisor_the_refusal_has_the_lines_for_the_site_file(mesh, tmp_path):
    with defining(mesh, tmp_path, can_start=False) as page:
        assert page.get("/robots").json["can_start"] is False
        page.post("/save", page.draft(name="later"))
        answer = page.post("/start", {"name": "later"})
    assert (answer.status, answer.code) == (409, "define.no_supervisor")
    wanted = f'[[robot]]\nname = "later"\nmodel = "{tmp_path}/robots/later/robot.toml"'
    assert wanted in answer.json["text"]


def test_a_running_robot_of_the_pages_reads_its_own_folder_only(tmp_path, monkeypatch):
    begun = []
    monkeypatch.setattr(launch.service, "run", lambda serve, settings, **_: begun.append(settings))
    monkeypatch.setattr(launch.service, "log_to_stderr", lambda: None)
    robots = tmp_path / "robots"
    for folder in (robots / "mine", tmp_path / "own"):
        folder.mkdir(parents=True)
        values, files = read_robot(LIBRARY / "pt500")
        write_folder(values, files, folder / "pt500")
    (tmp_path / "site.toml").write_text(
        'site = "s"\n[define]\nfolder = "robots"\n'
        '[[robot]]\nname = "listed"\nmodel = "robots/mine/pt500/robot.toml"\ncontroller = "simulated"\n'
        '[[robot]]\nname = "own"\nmodel = "own/pt500/robot.toml"\ncontroller = "simulated"\n'
        '[[robot]]\nname = "known"\nmodel = "pt600"\ncontroller = "simulated"\n'
    )
    (robots / "started.toml").write_text(
        'site = "s"\n[[robot]]\nname = "mine"\nmodel = "mine/pt500/robot.toml"\ncontroller = "simulated"\n'
    )
    launch.launch("kinematics", Options(site_file=tmp_path / "site.toml"), "tcp/127.0.0.1:1")
    launch.launch("kinematics", Options(site_file=tmp_path / "site.toml", started="mine"), "tcp/127.0.0.1:1")
    found = {
        each.name: each.confined
        for settings in begun
        for robot in settings.robots
        for each in robot.cell_description.robots
    }
    assert found == {"listed": True, "own": False, "known": False, "mine": True}


@pytest.mark.parametrize("job", ["mesh", "collisions", "import_robot", "unzip"])
async def test_an_abandoned_job_delays_no_other(tmp_path, job):
    site = Site(site="s", define=DefinePart(folder=tmp_path / "robots"))

    define = Define(DefineSettings(site=site, store=tmp_path / "store"))
    asked = {"file": "a.wrl", "files": {"a.wrl": store.put(define.store, TRIANGLE)}, "description": {}}
    came = [{"type": "http.request", "body": json.dumps(asked).encode()}]

    async def receive():
        return came.pop() if came else {"type": "http.disconnect"}

    request = Request({"type": "http", "method": "POST", "headers": []}, receive)
    with pytest.raises(RefusedRequest, match="has disconnected"):
        await getattr(define, job)(request)
    assert define.workshop.slow.pids == []
    await define.close()


@pytest.mark.slow
def test_only_so_many_files_are_taken_at_once(page, monkeypatch):
    monkeypatch.setattr(routes, "_MOST_UPLOADS", 1)
    host, port = page.address.removeprefix("http://").split(":")

    def status():
        return page.post("/files?name=a.wrl", TRIANGLE).status

    assert [status(), status()] == [200, 200]
    with socket.create_connection((host, int(port))) as slow:
        head = f"POST /define/files?name=a.wrl HTTP/1.1\r\nHost: {host}:{port}\r\nOrigin: {page.address}\r\n"
        slow.sendall(f"{head}Content-Length: 100\r\n\r\nhalf".encode())
        wait_until(lambda: status() == 503, what="nobody was told to wait")
    wait_until(lambda: status() == 200, what="the place of a file that was broken off is still taken")
