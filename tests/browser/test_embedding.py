"""Pictures and video of a console in pages of other origins, in Chromium."""

import asyncio
import http.server
import threading

import pytest
from playwright.async_api import Error, async_playwright

from tests.browser.conftest import ARGUMENTS, CHROMIUM, LAUNCH_MS, PATIENCE_MS
from tests.conftest import run
from tests.services.test_console import page  # noqa: F401
from tests.services.test_console_pictures import rendered
from web import build_page

pytestmark = pytest.mark.browser

EMBEDDING = """<!doctype html><img id="moving" src="http://{0}/video/s/r/front.mjpeg">
<img id="still" src="http://{0}/image/s/r/front.jpg"><img id="shared" crossorigin src="http://{0}/image/s/r/front.png">
<video id="video" muted autoplay oncanplay="this.play()" src="http://{0}/video/s/r/front.mp4"></video>"""
SHOWN = """() => ["moving", "still", "shared"].every((id) => document.getElementById(id).naturalWidth > 0)
  && document.getElementById("video").currentTime > 0.2"""
FRAMES = """<!doctype html><iframe id="view" src="http://{0}/view/s/r/front?theme=light&language=en"></iframe>
<iframe id="page" src="http://{0}/"></iframe><iframe id="trick" src="http://{0}/view/..%2Findex.html"></iframe>"""
VIEW_SHOWN = """() => document.querySelector(".frame:not(.stale) img")?.naturalWidth > 0"""
NAMES = ("view", "page", "trick")
FAILED = """() => new Promise((resolve) => {
  const image = new Image();
  image.onload = () => resolve("shown");
  image.onerror = () => resolve("refused");
  image.src = ADDRESS;
})"""


@pytest.fixture
def intranet():
    """Yield the ports of two servers of the same pages, and the pages by path."""
    pages = {}

    class Pages(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            body = pages.get(self.path, "<!doctype html>").encode()
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_):
            pass

    servers = [http.server.ThreadingHTTPServer(("127.0.0.1", 0), Pages) for _ in range(2)]
    threads = [threading.Thread(target=server.serve_forever) for server in servers]
    for thread in threads:
        thread.start()
    yield [f"http://127.0.0.1:{server.server_port}" for server in servers], pages
    for server, thread in zip(servers, threads, strict=True):
        server.shutdown()
        thread.join()
        server.server_close()


@pytest.mark.long
def test_pages_of_listed_origins_show_pictures_and_video_and_others_do_not(mesh, page, intranet):  # noqa: F811
    (listed, other), pages = intranet

    async def main():
        async with rendered(mesh, page, embed=(listed,)) as (address, _), async_playwright() as playwright:
            pages["/wall"] = EMBEDDING.format(address)
            browser = await playwright.chromium.launch(
                executable_path=str(CHROMIUM), args=ARGUMENTS, timeout=LAUNCH_MS
            )
            tab = await browser.new_page()
            await until_shown(tab, f"{listed}/wall")
            for origin, result in ((listed, "shown"), (other, "refused")):
                await tab.goto(f"{origin}/", timeout=PATIENCE_MS)
                script = FAILED.replace("ADDRESS", f"'http://{address}/image/s/r/front.jpg'")
                assert await tab.evaluate(script) == result
            await browser.close()
            await asyncio.sleep(0)

    run(main(), timeout_s=300.0)


async def until_shown(tab, address):
    """Open a page until its pictures are there: a browser does not ask again for one that came too late."""
    for last in (False, False, True):
        await tab.goto(address, wait_until="commit")
        try:
            await tab.wait_for_function(SHOWN, timeout=PATIENCE_MS)
        except Error:
            if last:
                raise
        else:
            return


def test_a_listed_page_frames_one_view_without_controls_and_nothing_else(mesh, intranet):
    (listed, other), pages = intranet
    build_page.build()

    async def main():
        async with (
            rendered(mesh, build_page.DIST, embed=(listed,)) as (address, renderer),
            async_playwright() as playwright,
        ):
            pages["/frames"] = FRAMES.format(address)
            browser = await playwright.chromium.launch(
                executable_path=str(CHROMIUM), args=ARGUMENTS, timeout=LAUNCH_MS
            )
            tab = await browser.new_page()
            await tab.goto(f"{listed}/frames", timeout=PATIENCE_MS)
            frames = {name: await (await tab.query_selector(f"#{name}")).content_frame() for name in NAMES}
            await frames["view"].wait_for_function(VIEW_SHOWN, timeout=PATIENCE_MS)
            assert await frames["view"].locator("a, button, input, form, [onclick], [tabindex]").count() == 0
            assert (await frames["view"].get_by_role("strong").inner_text()).endswith("r")
            for name in ("page", "trick"):
                assert frames[name].url.startswith("chrome-error:")
            renderer.playing.cancel()
            await frames["view"].get_by_role("alert").filter(has_text="stale").wait_for(timeout=PATIENCE_MS)
            await tab.goto(f"{other}/frames", timeout=PATIENCE_MS)
            for name in NAMES:
                frame = await (await tab.query_selector(f"#{name}")).content_frame()
                assert frame.url.startswith("chrome-error:")
            await browser.close()

    run(main(), timeout_s=180.0)
