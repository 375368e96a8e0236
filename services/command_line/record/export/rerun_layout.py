"""Layout of an exported recording in the Rerun viewer."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from renderer.scene.cameras import Camera
from services.command_line.record.export.plots import Panel

if TYPE_CHECKING:
    import rerun.blueprint as rrb

# Timelines: the publisher's time as in the CSV table, and the recorder's.
PUBLISHER_TIME, RECEIVE_TIME = "publisher_time", "receive_time"
# Rerun's lens is wider than that of the view `free`, so its camera is closer.
_CLOSER = 0.45
# Views above each other; with more, a legend hides its plot.
_MOST_IN_COLUMN = 3


def blueprint(
    path: Callable[[Iterable[str]], str],
    site: str,
    views: Sequence[str],
    panels: Sequence[Panel],
    eye: Camera | None,
) -> rrb.Blueprint:
    """Return the layout: the arm and the events on the left, then video and plots.

    Args:
        path: Returns the path of an entity below the robot.
        site: Name of the site's frame.
        views: Topics of the recorded video.
        panels: The plots.
        eye: Camera of the 3-D view; None: Rerun's own.
    """
    import rerun.blueprint as rrb

    controls = None
    if eye is not None:
        position = eye.target + _CLOSER * (eye.eye - eye.target)
        controls = rrb.EyeControls3D(position=position, look_target=eye.target)
    body = rrb.Spatial3DView(
        name="arm",
        origin=path([]),
        contents=[f"$origin/{each}/**" for each in ("links", "fixtures", "named_frames")],
        spatial_information=rrb.SpatialInformation(target_frame=site),
        eye_controls=controls,
    )
    events = rrb.TextLogView(name="events", origin=path(["events"]))
    video = [rrb.Spatial2DView(name=name, origin=path(name.split("/"))) for name in views]
    plots = [
        rrb.TimeSeriesView(
            name=panel.title,
            origin=path([]),
            contents=[path(value.split("/")) for value in panel.values],
            axis_x=rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
        )
        for panel in panels
    ]
    others: list[rrb.Container | rrb.View] = [*([rrb.Tabs(*video)] if video else []), *plots]
    columns = [
        rrb.Vertical(*others[at : at + _MOST_IN_COLUMN]) for at in range(0, len(others), _MOST_IN_COLUMN)
    ]
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Vertical(body, events, row_shares=[3, 1]), *columns),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=PUBLISHER_TIME),
    )
