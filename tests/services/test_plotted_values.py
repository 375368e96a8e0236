"""Numbers that the page plots: named and read as the recorder does."""

import base64

import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from robomesh.contract.messages import decode
from robomesh.contract.topics import SCHEMAS
from robomesh.recordings.series.values import live_topics, prismatic_joints, signal_units, unit_of, values_of
from robomesh.schemas import robomesh_pb2 as schema
from tests import page_modules
from web import build_page

pytestmark = pytest.mark.slow

READ = """
const { values, connection, gen, pb, layout } = await import(process.argv[1]);
const chunks = [];
for await (const chunk of process.stdin) chunks.push(chunk);
const asked = JSON.parse(Buffer.concat(chunks).toString());
const bytes = (text) => new Uint8Array(Buffer.from(text, "base64"));
connection.hello.value = { values: asked.topics ?? [], stale: [] };
const done = (answer) => process.stdout.write(JSON.stringify(answer), () => process.exit(0));
"""
VALUES = """
const description = pb.fromBinary(gen.DescriptionSchema, bytes(asked.description));
done(asked.messages.map(([topic, payload]) => {
  const found = [];
  const take = (name, value) => found.push([name, value, values.unitOf(name, description)]);
  values.readerOf(topic)(bytes(payload), take);
  return found;
}));
"""


@pytest.fixture(scope="module")
def module(tmp_path_factory):
    return page_modules.bundle(
        tmp_path_factory.mktemp("values"),
        values="mesh/state/values.ts",
        connection="mesh/console/connection.ts",
        gen="gen/robomesh_pb.ts",
        layout="ui/page/layout.ts",
        pb=build_page.MODULES / "@bufbuild/protobuf/dist/esm/index.js",
    )


def text(message):
    return base64.b64encode(message.SerializeToString()).decode()


def messages():
    joints = JointStates()
    joints.joints.add(name="waist", position=0.5, velocity=-0.25, acceleration=3.0, effort=12.5)
    joints.joints.add(name="rail/left", position=1.25)
    joints.joints.add(name="unknown")
    tilted = [0.36, 0.48, -0.8, 0.1, -0.8, 0.6, 0.0, 0.2, 0.48, 0.64, 0.6, 0.3, 0, 0, 0, 1]
    upright = [0, 0, 1, 0.1, 0, 1, 0, 0.2, -1, 0, 0, 0.3, 0, 0, 0, 1]
    kinematics = []
    for pose in (tilted, upright, []):
        state = schema.KinematicState(tool_to_base=pose, manipulability=0.0)
        state.linear_velocity.x = 3.0
        state.linear_velocity.y = 4.0
        state.clearance.distance = 0.25
        state.limit_margins.add(name="rail/left", lower=0.5, upper=0.25)
        state.limit_margins.add(name="waist", lower=1.0, upper=2.0)
        kinematics.append(("kinematics", state))
    controller = schema.ControllerState(link=2, read_only=True, rate_hz=100.0, speed_percent=0.0)
    controller.timestamp.GetCurrentTime()
    controller.health.jitter_s = 0.002
    controller.counters.units_received = 2**40
    controller.link_reasons.add(code="x")
    controller.program.held = True
    lease = schema.Lease(holder="li", motion=True)
    lease.asked_by.add(operator="wang")
    signals = schema.Signals()
    signals.signals.add(name="payload.mass", unit="kg", number=0.0)
    signals.signals.add(name="io.digital_in.3", on=False)
    signals.signals.add(name="io.digital_in.4", on=True)
    signals.signals.add(name="program.name", text="weld")
    signals.signals.add(name="joint.waist.current", unit="A", number=-1.5, age_s=2.0)
    program = schema.ProgramState(outcome=1, line=7, left_s=3.5)
    return [
        ("joints", joints),
        *kinematics,
        ("controller", controller),
        ("controller", schema.ControllerState()),
        ("lease", lease),
        ("program", program),
        ("signals", signals),
    ]


def test_the_page_reads_the_same_numbers_as_the_recorder_with_the_same_names_and_units(module):
    description = schema.Description()
    description.joints.add(name="waist")
    description.joints.add(name="rail/left", type=schema.Description.Joint.PRISMATIC)
    sent = messages()
    topics = [{"topic": topic, "schema": name} for topic, name in live_topics().items()]
    asked = {
        "topics": topics,
        "description": text(description),
        "messages": [(topic, text(message)) for topic, message in sent],
    }
    answers = page_modules.run(module, READ + VALUES, asked)
    slides = prismatic_joints(description)
    for (topic, message), found in zip(sent, answers, strict=True):
        name = message.DESCRIPTOR.full_name
        read = decode(SCHEMAS[name], message.SerializeToString())
        signals = signal_units(message) if topic == "signals" else {}
        expected = [
            (f"{topic}/{own}", pytest.approx(value, abs=1e-12), unit_of(f"{topic}/{own}", slides, signals))
            for own, value in values_of(name, read)
        ]
        assert [tuple(each) for each in found] == expected
    units = {name: unit for each in answers for name, _, unit in each}
    assert units["joints/waist/effort"] == "N·m"
    assert units["joints/rail/left/position"] == units["kinematics/margin/rail/left"] == "m"
    assert units["kinematics/tool/pitch"] == "rad"
    assert units["controller/health/jitter_s"] == "s"
    assert units["signals/joint.waist.current"] == "A"
    assert "signals/program.name" not in units


def test_every_topic_of_a_robot_that_has_numbers_can_be_plotted():
    assert set(live_topics()) >= {"joints", "kinematics", "controller", "lease", "program", "signals"}
    assert not {"frames", "joints/slow", "raw", "events", "description", "mesh"} & set(live_topics())


LAYOUTS = """
done(asked.map((text) => {
  const { layout: read, problem } = layout.readLayout(text);
  return { read, problem, text: layout.layoutText(read) };
}));
"""


@pytest.mark.parametrize(
    "text",
    [
        "",
        "plot=none",
        "plot=60",
        "plot=600,joints",
        "plot=3600,joints/waist/position,kinematics/tool/x&plot=10,controller/rate_hz",
        "plot=60,joints/a%2Cb%26c%3Fd/position,joints/%E8%85%B0/position",
        "video=close,large",
        "video=,inset",
        "camera=top",
        "camera=free,1.2,-1.69,0.72,0,0,0.5",
        "hide=video,plots",
        "plot=300,joints&video=top&camera=left&hide=plots",
    ],
)
def test_a_layout_is_the_same_after_it_was_read_and_written(module, text):
    (answer,) = page_modules.run(module, READ + LAYOUTS, [text])
    assert answer["problem"] is None
    assert answer["text"] == text


def test_an_invalid_layout_is_named_and_the_default_one_is_used(module):
    wrong = {
        "plot=61,joints/a/b": "layout_plot",
        "plot=60s": "layout_plot",
        "plot=": "layout_plot",
        "plot=060": "layout_plot",
        "plot=60,<script>": "layout_plot",
        "plot=60,a/b%00": "layout_plot",
        "plot=60,a/b%E2%80%AE": "layout_plot",
        "plot=60,a/%E0%A4%A": "layout_plot",
        "plot=60,a/b,a/b": "layout_plot",
        "plot=60," + ",".join(f"a/{i}" for i in range(21)): "layout_plot",
        "plot=60,a/" + "b" * 200: "layout_plot",
        "&".join(["plot=60"] * 7): "layout_plots",
        "plot=60&plot=none": "layout_plots",
        "video=front,huge": "layout_video",
        "video=../x": "layout_video",
        "camera=": "layout_camera",
        "camera=free,1,2,3": "layout_camera",
        "camera=free,1,2,3,1,2,3": "layout_camera",
        "camera=free,1e9,2,3,0,0,0": "layout_camera",
        "camera=free,NaN,2,3,0,0,0": "layout_camera",
        "camera=free,,,,,,": "layout_camera",
        "hide=stop": "layout_hide",
        "zoom=3": "layout_key",
        "__proto__=1": "layout_key",
        "plot": "layout_plot",
        "plot=60," + "a/b" * 9000: "layout_long",
    }
    answers = page_modules.run(module, READ + LAYOUTS, list(wrong))
    assert [each["problem"]["text"] for each in answers] == list(wrong.values())
    assert {each["text"] for each in answers} == {""}
