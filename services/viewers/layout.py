"""Layout of a robot for Foxglove and Lichtblick: the arm, its video, joints, events, and commands.

Its topics have the same names on the live mesh and in recordings.
"""

from typing import Any

from robomesh.contract.keys import robot_key
from robomesh.schemas.robomesh_pb2 import Description

Json = dict[str, Any]

_COMMANDS = (
    ("stop", "Stop request", '{"reason": "from the viewer"}'),
    ("home", "Home", "{}"),
    ("hold", "Hold", "{}"),
    ("resume", "Resume", "{}"),
    ("reset", "Reset the stop", "{}"),
)
_STOP_COLOR = "#c62828"
_DISTANCE_M, _HEIGHT_M = 2.4, 0.4


def viewer_layout(site: str, robot: str, description: Description) -> Json:
    """Return the layout of a robot, as Lichtblick and Foxglove import it.

    The commands call the services of `robomesh foxglove --operator NAME`; without an operator only stop is
    offered.
    """

    def key(topic: str) -> str:
        return robot_key(site, robot, topic)

    # Every robot has it, and a recording has it by default.
    video = "free"
    panels: Json = {
        "3D!arm": _scene(site, description),
        "Image!video": {"imageMode": {"imageTopic": key(f"video/{video}")}, **_titled(video)},
        "Plot!joints": _plot(
            "Joints",
            {
                f'{key("joints")}.joints[:]{{name=="{joint.name}"}}.position': joint.name
                for joint in description.joints
            },
        ),
        "Plot!tool": _plot(
            "Tool and clearance [m]",
            {
                f"{key('kinematics')}.tool_to_base[3]": "x",
                f"{key('kinematics')}.tool_to_base[7]": "y",
                f"{key('kinematics')}.tool_to_base[11]": "z",
                f"{key('kinematics')}.clearance.distance": "clearance",
            },
        ),
        "RosOut!log": {"topicToRender": key("log"), "minLogLevel": 1, "searchTerms": []},
        "RawMessages!controller": {"topicPath": key("controller")},
    }
    for name, text, request in _COMMANDS:
        panels[f"CallService!{name}"] = {
            "serviceName": key(name),
            "requestPayload": request,
            "buttonText": text,
            "layout": "horizontal",
            **_titled(text),
            **({"buttonColor": _STOP_COLOR} if name == "stop" else {}),
        }
    commands: str | Json = f"CallService!{_COMMANDS[-1][0]}"
    for number, (name, _, _) in reversed(list(enumerate(_COMMANDS[:-1]))):
        commands = _split("row", f"CallService!{name}", commands, 100 / (len(_COMMANDS) - number))
    left = _split("column", "3D!arm", _split("row", "Plot!joints", "Plot!tool", 55), 62)
    right = _split("column", "Image!video", _split("column", "RosOut!log", "RawMessages!controller", 55), 40)
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("column", _split("row", left, right, 64), commands, 79),
    }


def _scene(site: str, description: Description) -> Json:
    """Return the 3-D panel, which looks at the robot from the front right."""
    base = description.base_to_site
    x, y, z = (base[3], base[7], base[11]) if len(base) == 16 else (0.0, 0.0, 0.0)
    return {
        "cameraState": {
            "perspective": True,
            "distance": _DISTANCE_M,
            "phi": 65,
            "thetaOffset": 45,
            "target": [0, 0, 0],
            "targetOffset": [round(x, 3), round(y, 3), round(z + _HEIGHT_M, 3)],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.01,
            "far": 500,
        },
        "followMode": "follow-pose",
        "followTf": site,
        "scene": {"transforms": {"showLabel": False, "axisScale": 0, "lineWidth": 0}},
        "topics": {"/robot_description": {"visible": True}},
        "layers": {
            "grid": {
                "layerId": "foxglove.Grid",
                "instanceId": "grid",
                "visible": True,
                "size": 4,
                "divisions": 8,
            }
        },
        "transforms": {},
        "publish": {},
        "imageMode": {},
    }


def _plot(title: str, paths: dict[str, str]) -> Json:
    return {
        **_titled(title),
        "paths": [
            {"value": path, "label": label, "enabled": True, "timestampMethod": "receiveTime"}
            for path, label in paths.items()
        ],
        "showLegend": True,
        "legendDisplay": "left",
        "sidebarDimension": 110,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
    }


def _titled(title: str) -> Json:
    return {"foxglovePanelTitle": title, "lichtblickPanelTitle": title}


def _split(direction: str, first: str | Json, second: str | Json, percent: float) -> Json:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": round(percent, 1)}
