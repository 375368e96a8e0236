"""Session with a server that can only read: its methods browse, read and subscribe.

A second guard refuses to send any request that is not in `ALLOWED`.
"""

from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import AbstractContextManager, asynccontextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from asyncua import Client, ua
from asyncua.observer import Observer

from controllers.opcua.reader.problems import ReadingError

ALLOWED = frozenset(
    {
        *("GetEndpointsRequest", "CreateSessionRequest", "ActivateSessionRequest", "CloseSessionRequest"),
        *("BrowseRequest", "BrowseNextRequest", "ReadRequest"),
        *("CreateSubscriptionRequest", "CreateMonitoredItemsRequest", "PublishRequest"),
    }
)
"""Services that are used, besides opening and closing the secure channel."""

TIMEOUT_S = 5.0
# A server may allow fewer in one request.
_MOST_AT_ONCE = 100
_MOST_REFERENCES = 10_000
_KEEP_ALIVE_S = 0.3
# Without a request for this long the server ends the subscription, and after _SESSION_S the session.
_LIFETIME_S, _SESSION_S = 10.0, 30.0

NAMESPACES = ua.NodeId(2255, 0)
HIERARCHICAL = ua.NodeId(33, 0)
HAS_SUBTYPE = ua.NodeId(45, 0)
_LIMITS = (ua.NodeId(11705, 0), ua.NodeId(11710, 0), ua.NodeId(11714, 0))
"""MaxNodesPerRead, MaxNodesPerBrowse, MaxMonitoredItemsPerCall."""
_T = TypeVar("_T")


class ReadOnlyGuard(Observer):  # type: ignore[misc]  # the library is not typed
    """Guard that sees each request before it is sent."""

    def observe_request(self, request: Any) -> AbstractContextManager[None]:
        """Refuse a request that is not allowed."""
        name = type(request).__name__
        if name not in ALLOWED:
            raise ReadingError(f"{name} is not sent: the session only reads")
        passed: AbstractContextManager[None] = super().observe_request(request)
        return passed


@dataclass(frozen=True, slots=True)
class Sampled:
    """A variable to subscribe to.

    Attributes:
        each_s: Requested sampling interval.
        stamps: Report a new SourceTimestamp also without a new value.
    """

    node: ua.NodeId
    each_s: float
    stamps: bool = False


@dataclass(frozen=True, slots=True)
class Changes:
    """A notification.

    Attributes:
        values: Number of the variable, and its value; empty: a keep-alive.
        ended: Why the server has ended the subscription; empty: it has not.
    """

    values: Sequence[tuple[int, ua.DataValue]] = ()
    ended: str = ""


class ReadOnlySession:
    """Reading services of a connected client."""

    def __init__(self, client: Client) -> None:
        self._session = client.uaclient.session
        self._at_once = [_MOST_AT_ONCE] * 3
        self._pending: list[tuple[int, ua.DataValue]] = []

    async def read_limits(self) -> None:
        """Read how much the server takes in one request."""
        values = await self.values(_LIMITS)
        self._at_once = [
            min(value, _MOST_AT_ONCE) if isinstance(value, int) and value > 0 else _MOST_AT_ONCE
            for value in values
        ]

    async def references(
        self,
        nodes: Sequence[ua.NodeId],
        kind: ua.NodeId = HIERARCHICAL,
        direction: ua.BrowseDirection = ua.BrowseDirection.Forward,
    ) -> list[list[ua.ReferenceDescription]]:
        """Return the references of each node; none of a node that the server does not know."""
        found: list[list[ua.ReferenceDescription]] = []
        for some in _parts(nodes, self._at_once[1]):
            descriptions = [
                ua.BrowseDescription(
                    NodeId=node,
                    BrowseDirection=direction,
                    ReferenceTypeId=kind,
                    IncludeSubtypes=True,
                    NodeClassMask=ua.NodeClass(0),
                    ResultMask=ua.BrowseResultMask(63),
                )
                for node in some
            ]
            parameters = ua.BrowseParameters(NodesToBrowse=descriptions)
            for result in await self._session.browse(parameters):
                references = [*(result.References or ())]
                point = result.ContinuationPoint
                while point and len(references) < _MOST_REFERENCES:
                    (more,) = await self._session.browse_next(
                        ua.BrowseNextParameters(ContinuationPoints=[point])
                    )
                    references += more.References or ()
                    point = more.ContinuationPoint
                found.append(references)
        return found

    async def values(self, nodes: Sequence[ua.NodeId]) -> list[Any]:
        """Return the value of each variable; None: it has no good one."""
        found: list[Any] = []
        for some in _parts(nodes, self._at_once[0]):
            wanted = [ua.ReadValueId(NodeId=node, AttributeId=ua.AttributeIds.Value) for node in some]
            for data in await self._session.read(ua.ReadParameters(NodesToRead=wanted)):
                good = data.StatusCode is None or data.StatusCode.is_good()
                found.append(data.Value.Value if good and data.Value is not None else None)
        return found

    async def subscribe(
        self, variables: Sequence[Sampled], each_s: float, on_changes: Callable[[Changes], None]
    ) -> list[float | str]:
        """Subscribe to variables.

        Args:
            each_s: Requested interval of notifications.
            on_changes: Called with each notification.

        Returns:
            The server's sampling interval of each [s], or why it cannot be read.
        """
        parameters = ua.CreateSubscriptionParameters(
            RequestedPublishingInterval=each_s * 1e3,
            RequestedLifetimeCount=max(3, round(_LIFETIME_S / each_s)),
            RequestedMaxKeepAliveCount=max(1, round(_KEEP_ALIVE_S / each_s)),
            MaxNotificationsPerPublish=0,
            PublishingEnabled=True,
            Priority=0,
        )
        self._pending = []
        created = await self._session.create_subscription(
            parameters, lambda result: self._on_publish(result, on_changes)
        )
        found: list[float | str] = []
        numbered = [*enumerate(variables)]
        for some in _parts(numbered, self._at_once[2]):
            results = await self._create_items(created.SubscriptionId, some, with_filter=True)
            if any(_refuses_filter(result) for result in results):
                again = [each for each, result in zip(some, results, strict=True) if _refuses_filter(result)]
                plain = iter(await self._create_items(created.SubscriptionId, again, with_filter=False))
                results = [next(plain) if _refuses_filter(result) else result for result in results]
            for (_, variable), result in zip(some, results, strict=True):
                if not result.StatusCode.is_good():
                    found.append(result.StatusCode.name)
                    continue
                revised_s = result.RevisedSamplingInterval * 1e-3
                # Negative: as often as notifications; 0: with each change.
                floor_s = created.RevisedPublishingInterval * 1e-3
                found.append(revised_s if revised_s > 0 else max(floor_s, variable.each_s))
        return found

    async def _create_items(
        self, subscription: int, variables: Sequence[tuple[int, Sampled]], *, with_filter: bool
    ) -> list[ua.MonitoredItemCreateResult]:
        requests: list[ua.MonitoredItemCreateRequest] = []
        for number, variable in variables:
            stamps = ua.DataChangeFilter(Trigger=ua.DataChangeTrigger.StatusValueTimestamp)
            requests.append(
                ua.MonitoredItemCreateRequest(
                    ItemToMonitor=ua.ReadValueId(NodeId=variable.node, AttributeId=ua.AttributeIds.Value),
                    MonitoringMode=ua.MonitoringMode.Reporting,
                    RequestedParameters=ua.MonitoringParameters(
                        ClientHandle=number,
                        SamplingInterval=variable.each_s * 1e3,
                        Filter=stamps if with_filter and variable.stamps else None,
                        QueueSize=1,
                        DiscardOldest=True,
                    ),
                )
            )
        parameters = ua.CreateMonitoredItemsParameters(
            SubscriptionId=subscription,
            TimestampsToReturn=ua.TimestampsToReturn.Source,
            ItemsToCreate=requests,
        )
        created: list[ua.MonitoredItemCreateResult] = await self._session.create_monitored_items(parameters)
        return created

    def _on_publish(self, result: ua.PublishResult, on_changes: Callable[[Changes], None]) -> None:
        for notification in result.NotificationMessage.NotificationData or ():
            if isinstance(notification, ua.StatusChangeNotification):
                on_changes(
                    Changes(ended=f"the server has ended the subscription: {notification.Status.name}")
                )
                return
            if isinstance(notification, ua.DataChangeNotification):
                self._pending += [(each.ClientHandle, each.Value) for each in notification.MonitoredItems]
        if result.MoreNotifications:
            return  # the rest of the same moment follows
        values, self._pending = self._pending, []
        on_changes(Changes(values))


def _refuses_filter(result: ua.MonitoredItemCreateResult) -> bool:
    return result.StatusCode.name in (
        "BadMonitoredItemFilterUnsupported",
        "BadFilterNotAllowed",
        "BadMonitoredItemFilterInvalid",
    )


def _parts(values: Sequence[_T], length: int) -> Iterator[Sequence[_T]]:
    for begin in range(0, len(values), length):
        yield values[begin : begin + length]


@asynccontextmanager
async def connected(client: Client) -> AsyncIterator["ReadOnlySession"]:
    """Connect a client, yield its session, and disconnect."""
    client.uaclient.observer = ReadOnlyGuard()
    client.session_timeout = round(_SESSION_S * 1e3)
    await client.connect()
    try:
        session = ReadOnlySession(client)
        await session.read_limits()
        yield session
    finally:
        await client.disconnect()
