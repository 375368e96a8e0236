"""A console with a certificate and no accounts: its pages act under the console's name only."""

from robomesh.schemas import robomesh_pb2 as schema
from tests.services.test_attach_keys import hall, mesh_of, secured
from tests.services.test_console import browse, console, page

__all__ = ["page", "secured"]  # fixtures
ACQUIRE = schema.LeaseRequest(action=schema.LeaseRequest.ACQUIRE).SerializeToString()
ARM = "robomesh/hall/arm"


async def test_a_page_without_accounts_acts_as_the_console_only(secured, page):
    folder, endpoint = secured
    asked = []

    async def lease(request):
        asked.append(request.chunk)
        return schema.LeaseAnswer(lease="secret")

    async def stop(request):
        asked.append(request.message.by)
        return schema.StopAnswer(sent=True)

    mesh = mesh_of(endpoint, folder.service("console"))
    async with hall(secured) as robot, console(mesh, page, site="hall") as (address, _):
        robot.answer("hall", "arm", "lease/request/*", lease)
        robot.answer("hall", "arm", "stop", stop)
        async with browse(address) as browser:
            await browser.until(lambda: browser.other)
            hello = browser.other[0].hello
            assert (hello.account, hello.operator, hello.may_command) == ("", "console.hall", True)
            answer = await browser.ask(1, f"{ARM}/lease/request/li.hall", ACQUIRE)
            assert answer.error == "this page may send requests only as console.hall, not as li.hall"
            assert (await browser.ask(2, f"{ARM}/lease/request/console.hall", ACQUIRE)).ok
            payload = schema.StopRequest(by="li.hall").SerializeToString()
            assert (await browser.ask(3, f"{ARM}/stop", payload)).ok
            assert asked == ["console.hall", "console.hall"]
