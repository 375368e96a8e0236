"""Views on request: the renderer draws another size or rate, or a reduced view for a slow line."""

from collections import OrderedDict

from robomesh import reason_codes as codes
from robomesh.contract import keys
from robomesh.errors import RefusedError
from robomesh.schemas.robomesh_pb2 import ViewAnswer, ViewRequest
from robomesh.wire.session import Session

TIMEOUT_S = 3.0
_MOST_KNOWN = 512
_SMALLEST_PX = 64

# Reduction at each step, relative to the request: share of width and height, share of the rate, and highest
# bit rate [bit/s] (0: no limit).
_STEPS = ((1.0, 1.0, 0.0), (0.5, 0.5, 800e3), (0.375, 0.25, 250e3))
LOWEST_STEP = len(_STEPS) - 1


class Views:
    """Requests to the renderer, and its answers."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._known: OrderedDict[str, tuple[ViewRequest, ViewAnswer]] = OrderedDict()

    async def ask(self, robot_key: str, request: ViewRequest, asker: str) -> ViewAnswer:
        """Request a view in an asker's name, and return its topics.

        Raises:
            RefusedError: If the renderer rejects it.
            NoAnswerError: If no renderer answers.
        """
        answer = await self._session.ask(f"{robot_key}/views/{asker}", request, timeout_s=TIMEOUT_S)
        if not isinstance(answer, ViewAnswer) or not answer.topic:
            raise RefusedError(codes.VIEW_NO_ANSWER(key=robot_key))
        self.learn(robot_key, request, answer)
        return answer

    def learn(self, robot_key: str, request: ViewRequest, answer: ViewAnswer) -> None:
        """Remember a view's request, so that it can be reduced later."""
        key = f"{robot_key}/{answer.topic}"
        self._known[key] = (request, answer)
        self._known.move_to_end(key)
        while len(self._known) > _MOST_KNOWN:
            self._known.popitem(last=False)

    async def reduced(self, key: str, step: int, asker: str) -> str:
        """Return the key of a view's video, reduced by the given steps; all slow browsers share it.

        The request counts against the quota of the first asker.

        Raises:
            RefusedError: If it cannot be reduced, because it is a recording's.
            NoAnswerError: If no renderer answers.
        """
        if step == 0:
            return key
        robot_key, _, view = key.rpartition("/video/")
        known = self._known.get(key)
        if known is None:
            request = ViewRequest(of=view)
            known = request, await self.ask(robot_key, request, asker)
        answer = await self.ask(robot_key, reduced_request(*known, step), asker)
        return f"{robot_key}/{answer.topic}"


def reduced_request(request: ViewRequest, answer: ViewAnswer, step: int) -> ViewRequest:
    """Return a request for the same view, reduced from what `answer` says."""
    share, rate, bits = _STEPS[step]
    smaller = ViewRequest()
    smaller.CopyFrom(request)
    smaller.width, smaller.height = even(answer.width * share), even(answer.height * share)
    smaller.fps = max(answer.fps * rate, 1.0)
    smaller.most_bits_per_s = min(bits, request.most_bits_per_s or bits)
    return smaller


def even(pixels: float) -> int:
    """Return the nearest possible picture size [px]: H.264 halves the resolution of colour."""
    return max(2 * round(pixels / 2), _SMALLEST_PX)


def robot_key(site: str, robot: str) -> str:
    """Return `robomesh/<site>/<robot>`.

    Raises:
        KeyNameError: If a name is invalid.
    """
    return keys.robot_key(site, robot, "views").removesuffix("/views")
