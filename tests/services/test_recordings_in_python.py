"""`import robomesh` reading recordings from a recorder: the same arrays as from the file itself."""

import itertools
import os

import pytest
import zenoh

import robomesh
from robomesh import reason_codes as codes
from robomesh.client.recordings.descriptions import recording_info
from robomesh.client.recordings.recorder_file import RecorderFile
from robomesh.client.recordings.sources import MeshSource
from robomesh.contract.endpoints import client_config
from robomesh.errors import QuotaError
from robomesh.recordings.layout import layout_of
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from tests.conftest import run
from tests.recordings import Written, joints, write_recording
from tests.services.test_recordings_served import served


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "arm").mkdir()
    write_recording(tmp_path / "arm" / "trial.mcap")
    return tmp_path


def read(mesh, folder, use, *, name="trial.mcap"):
    """Run `await use(recording)` with a recording of a recorder."""

    async def main():
        async with served(mesh, folder) as session:
            file = RecorderFile(session, "site", name, asker="li")
            info = recording_info(await file.describe(), "site")
            return await use(robomesh.AsyncRecording(MeshSource(file, info)))

    return run(main())


def test_the_mesh_and_the_disk_give_equal_arrays_values_events_and_messages(mesh, folder, monkeypatch):
    monkeypatch.setattr("robomesh.client.recordings.recorder_file._MESSAGES", 7)  # many answers
    names = ("joints/waist/position", "controller/rate_hz")

    async def use(recording):
        return (
            await recording.joints(start_s=0.5, end_s=2.0),
            await recording.values(*names),
            await recording.events(),
            [sample async for sample in recording.messages("video/front", end_s=1.0)],
            await recording.value_names(),
        )

    states, values, events, pictures, known = read(mesh, folder, use)
    own = robomesh.open_recording(folder / "arm" / "trial.mcap")
    same = own.joints(start_s=0.5, end_s=2.0)
    for field in ("time_ns", "time_s", "received_ns", "sequence", "positions"):
        assert getattr(states, field).tolist() == getattr(same, field).tolist()
    assert len(states) == 151
    assert [values[name].values.tolist() for name in names] == [
        each.values.tolist() for each in own.values(*names).values()
    ]
    assert events == own.events()
    assert pictures == list(own.messages("video/front", end_s=1.0))
    assert known == own.value_names()


def test_a_used_up_quota_makes_a_reader_wait(mesh, folder, monkeypatch):
    monkeypatch.setattr("robomesh.client.recordings.recorder_file._MESSAGES", 100)
    monkeypatch.setattr("robomesh.client.recordings.recorder_file._LONGEST_WAIT_S", 0.1)
    refusals = [None, QuotaError("more than one name may have: ask again in 30.0 s", again_s=30.0)]

    def check(quota, asker):
        if refusals and (error := refusals.pop(0)):
            raise error

    monkeypatch.setattr("robomesh.contract.quotas.Quota.check", check)
    assert len(read(mesh, folder, robomesh.AsyncRecording.joints)) == 400
    assert not refusals


def test_a_file_that_is_replaced_while_it_is_read_is_noticed(mesh, folder, monkeypatch):
    monkeypatch.setattr("robomesh.client.recordings.recorder_file._MESSAGES", 50)

    async def use(recording):
        pages = recording.sample_pages("joints")
        assert len(await anext(pages)) == 50
        with Written(folder / "new.mcap") as file:
            for number in range(400):
                file.put("joints", joints(waist=-number), number / 100)
        (folder / "new.mcap").replace(folder / "arm" / "trial.mcap")
        with pytest.raises(robomesh.RecordingError) as changed:
            await anext(pages)
        return changed.value.code

    assert read(mesh, folder, use) == codes.RECORDING_CHANGED.name


@pytest.mark.parametrize("times", [1, 9])
def test_a_file_that_gets_its_index_during_a_fetch_is_fetched_again(
    mesh, folder, tmp_path, monkeypatch, times
):
    monkeypatch.setattr("robomesh.client.recordings.recorder_file._PIECE", 20_000)
    (tmp_path / "out").mkdir()
    shares = []

    def replace(share):
        shares.append(share)
        if len(shares) <= times:  # with a shorter file
            write_recording(tmp_path / "new.mcap", seconds=0.5, video=False).replace(
                folder / "arm" / "trial.mcap"
            )

    async def main():
        async with served(mesh, folder) as session:
            file = RecorderFile(session, "site", "trial.mcap", asker="li")
            return await file.fetch(tmp_path / "out", on_progress=replace)

    if times == 1:
        run(main())
        copy, original = tmp_path / "out" / "trial.mcap", folder / "arm" / "trial.mcap"
        assert copy.read_bytes() == original.read_bytes()
        assert list((tmp_path / "out").iterdir()) == [copy]
    else:
        with pytest.raises(robomesh.RecordingError) as changed:
            run(main())
        assert changed.value.code == codes.RECORDING_CHANGED.name
        assert list((tmp_path / "out").iterdir()) == []


def test_messages_longer_than_one_answer_are_read_one_after_the_other(mesh, folder):
    with Written(folder / "arm" / "long.mcap") as file:
        for number in range(5):
            file.put("joints", joints(**{f"{number}{'x' * (3 << 20)}": number}), 0.5)

    async def use(recording):
        return [sample.message.joints[0].position async for sample in recording.messages("joints")]

    assert read(mesh, folder, use, name="long.mcap") == [0, 1, 2, 3, 4]


def test_refusals_of_the_recorder_have_their_code(mesh, folder):
    async def use(recording):
        with pytest.raises(robomesh.RecordingError) as refused:
            await recording.joints(start_s=100.0)
        (folder / "arm" / "trial.mcap").unlink()
        with pytest.raises(robomesh.RecordingError) as gone:
            await recording.joints()
        return refused.value.code, gone.value.code

    assert read(mesh, folder, use) == (codes.RECORDING_OUTSIDE.name, codes.RECORDING_UNKNOWN.name)


def test_a_damaged_chunk_is_an_error_not_a_shorter_result(mesh, folder):
    path = folder / "arm" / "trial.mcap"
    data = bytearray(path.read_bytes())
    at = layout_of(path).blocks[3].offset + 100  # in a chunk's data
    data[at : at + 64] = bytes(64)
    path.write_bytes(data)

    async def use(recording):
        with pytest.raises(robomesh.RecordingError) as refused:
            await recording.joints()
        return refused.value.code

    assert read(mesh, folder, use) == "recording.unreadable"
    with pytest.raises(robomesh.RecordingError) as own:
        robomesh.open_recording(path).joints()
    assert own.value.code == "recording.unreadable"


def test_nonsense_of_a_recorder_is_an_error(mesh, tmp_path):
    """A recorder sends messages backwards, more bytes than requested, and names that are no file names."""
    range_key, piece_key = (f"robomesh/site/-/recordings/{name}/li" for name in ("range", "piece"))
    pages = itertools.count(1000, -1)

    def answer(query):
        with query:
            message = schema.RecordedMessages(schema="foxglove.JointStates", more=True)
            message.messages.add().received.FromSeconds(next(pages))
            piece = schema.Piece(data=bytes(1000), total=10, version="1")
            key = str(query.key_expr)
            query.reply(key, (message if key == range_key else piece).SerializeToString())

    async def main():
        async with open_session(mesh) as session:
            with zenoh.open(client_config(mesh.connect)) as plain:
                declared = [plain.declare_queryable(key, answer) for key in (range_key, piece_key)]
                file = RecorderFile(session, "site", "trial.mcap", asker="li")
                with pytest.raises(robomesh.RecordingError):
                    async for _ in file.pages("robomesh/site/arm/joints"):
                        pass
                with pytest.raises(robomesh.RecordingError):
                    await file.fetch(tmp_path)
                for name in ("../trial.mcap", "a\0b", "a\x1b[2J", ""):
                    with pytest.raises(robomesh.RecordingError, match="not a plain file name"):
                        await RecorderFile(session, "site", name, asker="li").fetch(tmp_path)
                os.mkfifo(tmp_path / "pipe")
                with pytest.raises(robomesh.RecordingError, match="is not a file"):
                    await file.fetch(tmp_path / "pipe")
                for each in declared:
                    each.undeclare()

    run(main())
    assert [each.name for each in tmp_path.iterdir()] == ["pipe"]
