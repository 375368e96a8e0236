"""Sites linked as a tree, as a ring and to two hubs: each receives the others' messages once."""

import contextlib
import time
from collections import Counter
from collections.abc import Iterator

import pytest
import zenoh

from robomesh.contract.endpoints import client_config, router_config
from tests.ports import free_port

# Links of each site.
TREE = {"hub": (), "a": ("hub",), "b": ("hub",), "c": ("b",)}
RING = {"a": (), "b": ("a",), "c": ("b", "a")}
TWO_HUBS = {"hub1": (), "hub2": ("hub1",), "a": ("hub1", "hub2"), "b": ("hub1", "hub2")}
DEADLINE_S = 60.0


class Sites:
    """A router for each site, and a client of each router that counts received texts."""

    def __init__(self, links: dict[str, tuple[str, ...]], stack: contextlib.ExitStack) -> None:
        at = {name: f"tcp/127.0.0.1:{free_port()}" for name in links}
        self.routers = {
            name: stack.enter_context(zenoh.open(router_config((at[name],), tuple(at[to] for to in others))))
            for name, others in links.items()
        }
        self.clients = {
            name: stack.enter_context(zenoh.open(client_config((endpoint,)))) for name, endpoint in at.items()
        }
        self.received: dict[str, Counter[str]] = {name: Counter() for name in links}
        for name, client in self.clients.items():
            client.declare_subscriber(
                "robomesh/**", lambda s, n=name: self._receive(n, s.payload.to_string())
            )

    def _receive(self, name: str, text: str) -> None:
        self.received[name][text] += 1

    def publish(self, names: list[str], text: str) -> None:
        """Publish repeatedly from each site until every site has received all texts."""
        deadline = time.monotonic() + DEADLINE_S
        number = 0
        while True:
            for name in names:
                self.clients[name].put(f"robomesh/{name}/arm/joints", f"{name} {text} {number}")
            number += 1
            if all(
                any(f"{of} {text}" in each for each in dict(self.received[at]))
                for of in names
                for at in names
            ):
                return
            assert time.monotonic() < deadline, self.received
            time.sleep(0.05)

    def duplicates(self) -> list[str]:
        """Return the texts that a client received more than once."""
        return [
            text for received in self.received.values() for text, count in dict(received).items() if count > 1
        ]


@pytest.fixture
def sites(request) -> Iterator[Sites]:
    with contextlib.ExitStack() as stack:
        yield Sites(request.param, stack)


@pytest.mark.parametrize("sites", [TREE, RING, TWO_HUBS], indirect=True, ids=["tree", "ring", "two hubs"])
def test_every_site_receives_every_message_once(sites):
    names = list(sites.routers)
    sites.publish(names, "first")
    for number in range(5):
        sites.publish(names, f"round {number}")
    # While routes change, a message may travel on two of them.
    assert [text for text in sites.duplicates() if "round 4" in text] == []


@pytest.mark.parametrize("sites", [TWO_HUBS], indirect=True, ids=["two hubs"])
def test_one_of_two_hubs_may_fail(sites):
    sites.publish(list(sites.routers), "both")
    sites.clients["hub1"].close()
    sites.routers["hub1"].close()
    sites.publish(["hub2", "a", "b"], "one")


@pytest.mark.parametrize("sites", [TREE], indirect=True, ids=["tree"])
def test_site_without_its_hub_still_works(sites):
    sites.publish(list(sites.routers), "all")
    sites.clients["hub"].close()
    sites.routers["hub"].close()
    sites.publish(["a"], "alone")
    sites.publish(["b", "c"], "what is left")


def test_client_with_two_routers_switches_to_the_second():
    first, second = (f"tcp/127.0.0.1:{free_port()}" for _ in range(2))
    heard = Counter[str]()
    with (
        zenoh.open(router_config((first,))) as dying,
        zenoh.open(router_config((second,), (first,))),
        zenoh.open(client_config((second,))) as publisher,
        zenoh.open(client_config((first, second))) as monitor,
    ):
        monitor.declare_subscriber("robomesh/**", lambda sample: heard.update([sample.payload.to_string()]))
        for text in ("before", "after"):
            deadline = time.monotonic() + DEADLINE_S
            while text not in heard:
                publisher.put("robomesh/a/arm/joints", text)
                assert time.monotonic() < deadline
                time.sleep(0.02)
            if text == "before":
                dying.close()
                heard.clear()
