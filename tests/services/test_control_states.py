"""Control of a robot from a page: the steps between its states, without a browser."""

import pytest

from tests import page_modules

pytestmark = pytest.mark.slow

SCRIPT = """
const sockets = [];
const sent = []; // requests of the lease without an answer
globalThis.WebSocket = class {
  static OPEN = 1;
  readyState = 1;
  constructor() { sockets.push(this); }
  close() {}
  send(bytes) {
    const { message } = page.fromBinary(page.FromPageSchema, bytes);
    if (message.value.key?.includes("/lease/request/"))
      sent.push({ id: message.value.id, ...page.fromBinary(page.LeaseRequestSchema, message.value.payload) });
  }
};
const ROBOT = "robomesh/hall/arm";
const until = async (holds) => { while (!holds()) await new Promise((resolve) => setTimeout(resolve, 5)); };
const at = (ms) => page.timestampFromMs(1e12 + ms);
const request = async () => { await until(() => sent.length); return sent.shift(); };
const reply = (id, value) => page.receive(page.toBinary(page.ToPageSchema, page.create(page.ToPageSchema, {
  message: { case: "answer", value: { id, ...value } },
})));
const grant = (id) => reply(id, { ok: true, payload: page.toBinary(page.LeaseAnswerSchema,
  page.create(page.LeaseAnswerSchema, { lease: "l", since: at(0), now: at(0), until: at(60_000) })) });
const published = (holder, since, more = {}) =>
  page.handleLease(ROBOT, { holder, since: at(since), timestamp: at(since + 1), ended: "", ...more });
const state = () => [page.heldLease.value?.lease ?? null, page.controlNotice.value?.text ?? null];
const take = async () => {
  const taken = page.take(ROBOT);
  const { id, action } = await request();
  return { taken, id, action: page.LeaseRequest_Action[action] };
};
const hold = async () => { const { taken, id } = await take(); grant(id); await taken; };
const next = async () => page.LeaseRequest_Action[(await request()).action];
const watching = [];
document.addEventListener = (name, act) => name === "visibilitychange" && watching.push(act);
const hide = (hidden) => { document.hidden = hidden; for (const act of watching) act(); };

page.followThisTab();
page.keepConnected(async () => true, () => {});
await until(() => sockets.length);
sockets[0].onopen();
page.lostAt.value = null;
page.setOperator("li");
"""


@pytest.fixture(scope="module")
def module(tmp_path_factory):
    protobuf = page_modules.build_page.MODULES / "@bufbuild" / "protobuf" / "dist" / "esm"
    return page_modules.bundle(
        tmp_path_factory.mktemp("control"),
        control="mesh/control/control.ts",
        connection="mesh/console/connection.ts",
        messages="gen/robomesh_pb.ts",
        protobuf=protobuf / "index.js",
        times=protobuf / "wkt" / "index.js",
    )


@pytest.fixture
def steps(module):
    return lambda script: page_modules.ask(module, SCRIPT + script, None)


def test_a_lease_is_renewed_until_it_is_released(steps):
    script = """
    await hold();
    const first = await next();
    void page.release();
    answer([first, await next(), ...state()]);
    """
    assert steps(script) == ["RENEW", "RELEASE", None, "Control released."]


def test_a_refused_request_leaves_this_tab_without_a_lease(steps):
    script = 'const { taken, id } = await take(); reply(id, { error: "no" }); await taken; answer(state());'
    lease, text = steps(script)
    assert lease is None
    assert "no" in text


def test_a_release_before_the_answer_gives_the_lease_back(steps):
    script = """
    const { id } = await take();
    void page.release();
    grant(id);
    answer([await next(), ...state()]);
    """
    assert steps(script) == ["RELEASE", None, "Control released."]


def test_a_page_that_is_hidden_gives_its_lease_back_with_the_cause(steps):
    script = """
    const cause = async () => page.LeaseRequest_Cause[(await request()).cause];
    const { taken, id } = await take();
    hide(true);
    hide(false);
    grant(id);
    const early = await cause();
    await hold();
    hide(true);
    answer([early, await cause(), ...state()]);
    """
    assert steps(script) == ["HIDDEN", "HIDDEN", None, "Control released because this page was hidden."]


def test_only_one_request_is_on_its_way(steps):
    script = "const { id } = await take(); await page.take(ROBOT); answer(sent.length);"
    assert steps(script) == 0


def test_the_message_of_a_lost_lease_stays_until_control_changes_again(steps):
    script = """
    await hold();
    published("wang", 10, { ended: "taken over by wang" });
    const lost = state();
    published("wang", 10);
    const kept = state();
    published("", 20);
    answer([lost, kept, state()]);
    """
    lost, kept, gone = steps(script)
    assert lost[0] is None
    assert "taken over by wang" in lost[1]
    assert kept == lost
    assert gone == [None, None]


def test_control_that_was_offered_is_handed_over(steps):
    script = 'await hold(); void page.offer("wang"); await next(); published("wang", 10); answer(state());'
    lease, text = steps(script)
    assert lease is None
    assert "wang" in text
    assert "lost" not in text.lower()


def test_a_lost_connection_ends_control(steps):
    lease, text = steps("await hold(); page.lostAt.value = 1; answer(state());")
    assert lease is None
    assert "lost" in text.lower()
