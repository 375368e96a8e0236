"""Layouts of robots for Foxglove and Lichtblick, as files to import."""

from urllib.parse import quote

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from robomesh.client.robot.robot import AsyncRobot
from robomesh.errors import RobomeshError
from robomesh.wire.session import Session
from services.console.common.error_responses import as_text, refused_on_the_mesh
from services.viewers.layout import viewer_layout


async def layout_response(request: Request, session: Session) -> Response:
    """Handle `GET /layout/<site>/<robot>.json`."""
    site, robot = request.path_params["site"], request.path_params["robot"]
    try:
        description = await AsyncRobot(session, site, robot).description()
    except RobomeshError as error:
        return as_text(refused_on_the_mesh(error))
    saved = quote(f"{site}-{robot}-layout.json")
    headers = {
        "Cache-Control": "no-cache",
        "Content-Disposition": f"attachment; filename*=UTF-8''{saved}",
    }
    return JSONResponse(viewer_layout(site, robot, description), headers=headers)
