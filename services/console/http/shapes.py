"""Link shapes for the page: requested from their gateways, cached by their hash."""

import hashlib
from collections import OrderedDict

from starlette.requests import Request
from starlette.responses import Response

from robomesh import reason_codes as codes
from robomesh.contract import keys
from robomesh.errors import QuotaError, RobomeshError
from robomesh.wire.repeated_requests import ask_repeatedly
from robomesh.wire.session import Session
from services.console.common.error_responses import as_text, refused_on_the_mesh
from services.console.common.errors import RefusedRequest

_MOST_BYTES = 256 * 1024 * 1024
# A busy machine may lose a reply; a retry is better than an arm without a link.
_TIMEOUTS_S = (2.0, 5.0, 10.0)


class ShapeCache:
    """GLB bytes by their SHA-256; evicts the least recently used."""

    def __init__(self) -> None:
        self._shapes: OrderedDict[str, bytes] = OrderedDict()
        self._bytes = 0

    def get(self, sha256: str) -> bytes | None:
        """Return the bytes with that hash, or None."""
        if sha256 in self._shapes:
            self._shapes.move_to_end(sha256)
        return self._shapes.get(sha256)

    def put(self, sha256: str, data: bytes) -> None:
        """Store bytes, and evict others if there are too many."""
        if sha256 not in self._shapes:
            self._shapes[sha256] = data
            self._bytes += len(data)
        while self._bytes > _MOST_BYTES and len(self._shapes) > 1:
            self._bytes -= len(self._shapes.popitem(last=False)[1])


async def shape_response(request: Request, session: Session, cache: ShapeCache) -> Response:
    """Handle `GET /mesh/<site>/<robot>/<name>?sha=<SHA-256>`.

    A shape with another hash is an error, so a browser may cache the response for good.
    """
    wanted = request.query_params.get("sha", "")
    data = cache.get(wanted)
    if data is None:
        try:
            path = request.path_params
            name = keys.check_chunk(path["name"], "mesh")
            key = keys.robot_key(path["site"], path["robot"], f"mesh/{name}")
            data = await ask_repeatedly(
                session, key, lambda timeout_s: session.ask_bytes(key, timeout_s=timeout_s), _TIMEOUTS_S
            )
        except RobomeshError as error:
            refused = refused_on_the_mesh(error)
            # Pages ask again after 503 and 504.
            if isinstance(error, QuotaError):
                refused.status = 503
            elif refused.reason.code == codes.NO_SERVICE.name:  # kinematics that starts again
                refused.status = 504
            return as_text(refused)
        sha256 = hashlib.sha256(data).hexdigest()
        if wanted and wanted != sha256:
            reason = codes.MESH_CHANGED(key=key, sha256=sha256, wanted=wanted)
            return as_text(RefusedRequest(409, reason))
        cache.put(sha256, data)
    lasting = "private, max-age=31536000, immutable" if wanted else "no-store"
    return Response(data, media_type="model/gltf-binary", headers={"Cache-Control": lasting})
