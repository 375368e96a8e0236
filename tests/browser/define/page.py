"""Actions on Define's page."""

import base64
import contextlib
import json

import numpy as np
from playwright.sync_api import expect

from robots.description import LIBRARY

SHAPES = LIBRARY / "pt500" / "meshes"


def drop(page, *files):
    """Drop files over the page, as from a file manager."""
    expect(page.locator(".define")).to_have_count(1)
    contents = [[name, base64.b64encode(content).decode()] for name, content in files]
    page.evaluate(
        """(files) => {
            const data = new DataTransfer();
            for (const [name, text] of files) {
                const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
                data.items.add(new File([bytes], name));
            }
            for (const kind of ["dragover", "drop"]) {
                const event = new DragEvent(kind, { dataTransfer: data, bubbles: true, cancelable: true });
                document.querySelector("main").dispatchEvent(event);
            }
        }""",
        contents,
    )


def shape(name):
    return name, (SHAPES / name).read_bytes()


def button(page, name):
    return page.get_by_role("button", name=name, exact=True)


def field(page, path):
    return page.locator(f'[data-path="{path}"]')


def tab(page, name):
    page.get_by_role("tab", name=name).click()


def choose(page, part):
    page.locator(f'.chain-row[data-part="{part}"]').click()


def opened(open_page, name, **settings):
    page = open_page(f"#/define/{name}", **settings)
    expect(page.locator(".dh-table")).to_have_count(1)
    return page


@contextlib.contextmanager
def held(page, address):
    """Delay the first request to an address until the end of the block; others pass."""
    waiting = []

    def hold(route):
        if waiting:
            route.fallback()
        else:
            waiting.append(route)

    page.route(address, hold)
    yield
    [route] = waiting
    with page.expect_response(lambda answer: answer.request == route.request):
        route.continue_()
    page.unroute(address, hold)


def settled(page):
    expect(page.locator(".tool-at")).to_have_attribute("data-checking", "false")


def tools(page):
    """Return the tool's placement (4, 4) [m]: as drawn, and as the server reports it."""
    settled(page)
    drawn = np.reshape(json.loads(page.locator(".define-scene canvas").get_attribute("data-tool")), (4, 4))
    return drawn, np.array(json.loads(page.locator(".tool-at").get_attribute("data-tool")))


def paste(field, text):
    """Paste a text into a field, as from a spreadsheet."""
    field.evaluate(
        """(element, text) => {
            const data = new DataTransfer();
            data.setData("text/plain", text);
            const how = { clipboardData: data, bubbles: true, cancelable: true };
            const event = new ClipboardEvent("paste", how);
            element.focus();
            if (element.dispatchEvent(event)) document.execCommand("insertText", false, text);
        }""",
        text,
    )
