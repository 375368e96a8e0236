"""Actions on Define's page."""

import base64
import json
import re

import numpy as np
from playwright.sync_api import expect

from robots.descriptions.description import LIBRARY
from tests.browser.robot_page import region

SHAPES = LIBRARY / "pt500" / "meshes"


def drop(page, *files):
    """Drop files over the page, as from a file manager."""
    expect(page.get_by_role("heading", level=1)).to_be_visible()  # it takes dropped files now
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


def field(page, path):
    """Return the field of a value of the description, by the path that the server's problems have."""
    return page.locator(f'[data-path="{path}"]')


def tab(page, name):
    page.get_by_role("tab", name=name).click()


def choose(page, part):
    chain_row(page, part).get_by_role("button").click()


def chain(page):
    """Return the list of the base, the joints and the tool."""
    return page.get_by_role("list", name="Chain", exact=True)


def chain_rows(page):
    return chain(page).get_by_role("listitem")


def chain_row(page, part):
    """Return the row of "base", "tool", or of a joint, counted from 0."""
    rows = chain_rows(page)
    return rows.first if part == "base" else rows.last if part == "tool" else rows.nth(part + 1)


def table(page):
    """Return the table of D-H rows."""
    return page.get_by_role("table", name="D-H rows, limits and speeds", exact=True)


def table_rows(page):
    """Return the head of each joint's row."""
    return table(page).get_by_role("rowheader")


def drawing(page):
    """Return the 3-D picture, which says in `data-shapes` how many shapes it has."""
    return page.get_by_role("img", name=re.compile(r"^3-D\."))


def checks(page):
    """Return what the server says about the draft."""
    return region(page, "Checks")


def problems(page):
    return checks(page).get_by_role("button")


def save_state(page):
    return page.get_by_role("toolbar").get_by_role("status")


def missing_files(page):
    return page.get_by_role("alert", name="Files that others refer to are missing", exact=True)


def robots(page):
    """Return the robots from which a new one can begin."""
    return region(page, "From a robot").get_by_role("link")


def opened(open_page, name, **settings):
    page = open_page(f"#/define/{name}", **settings)
    expect(table(page)).to_be_attached()
    return page


def tool_at(page):
    return page.get_by_label("Tool at", exact=True)


def settled(page):
    expect(tool_at(page)).to_have_attribute("aria-busy", "false")


def tools(page):
    """Return the tool's placement (4, 4) [m]: as drawn, and as the server reports it."""
    settled(page)
    drawn = np.reshape(json.loads(drawing(page).get_attribute("data-tool")), (4, 4))
    return drawn, np.array(json.loads(tool_at(page).get_attribute("data-tool")))
