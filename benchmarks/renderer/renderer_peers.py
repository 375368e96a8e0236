"""Peers on the same meshes, cameras and sizes: `renderer` runs this with a Python that has them.

    PEERS_PYTHON benchmarks/renderer/renderer_peers.py vtk|pyrender|mujoco SCENE.npz

It imports no module of the project. Each line of standard input asks for one row in JSON. The answer is a
line with the milliseconds of each turn (every view drawn and read back to NumPy), by the clock and of
processor time of all threads; the share of the last picture that is not background; OpenGL's name of the
device; and the process's memory. If a peer cannot be imported or cannot draw a row, the line has the reason
instead.
Smooth normals, one light from the camera, no shadows, no reflections: the least that each can do.
"""

import json
import os
import resource
import sys
import time
from collections.abc import Callable
from typing import Any

os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

import numpy as np

Render = Callable[[np.ndarray, int], np.ndarray]
Stage = tuple[Render, Callable[[], None], str]

BACKGROUND = (0.75, 0.78, 0.81)
WARM_UP = 3


def main() -> None:
    peer, scene = sys.argv[1], dict(np.load(sys.argv[2]))
    try:
        make = {"vtk": vtk_, "pyrender": pyrender_, "mujoco": mujoco_}[peer]
        version = make(scene, None)
    # Not only ImportError: pyrender's window library without X, and MuJoCo with pyrender's old PyOpenGL, fail
    # with AttributeError.
    except Exception as error:
        print(json.dumps({"missing": reason(error)}), flush=True)
        return
    print(json.dumps({"ready": version}), flush=True)
    serve(lambda row: make(scene, row), scene)


def serve(make: Callable[[dict[str, Any]], Stage], scene: dict[str, Any]) -> None:
    """Answer rows until standard input ends."""
    for line in sys.stdin:
        try:
            answer = drawn(make, scene, json.loads(line))
        except Exception as error:
            answer = {"missing": reason(error)}
        print(json.dumps(answer), flush=True)


def drawn(make: Callable[[dict[str, Any]], Stage], scene: dict[str, Any], row: dict[str, Any]) -> Any:
    """Draw a row's turns and return their times."""
    render, close, device = make(row)
    times, spent, picture = [], [], None
    for turn in range(row["turns"] + WARM_UP):
        placements = scene["placements"][turn % len(scene["placements"])]
        start, begun = time.perf_counter(), time.process_time()
        for view in range(row["views"]):
            picture = render(placements, view)
        times.append((time.perf_counter() - start) * 1e3)
        spent.append((time.process_time() - begun) * 1e3)
    assert picture is not None
    corner = picture[2, 2].astype(int)
    foreground = np.abs(picture.astype(int) - corner).max(axis=2) > 12
    answer = {
        "ms": times[WARM_UP:],
        "cpu_ms": spent[WARM_UP:],
        "drawn": float(foreground.mean()),
        "device": device,
        "shape": picture.shape,
        "rss_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    close()
    return answer


def reason(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"


def links(scene: dict[str, Any], count: str) -> list[dict[str, Any]]:
    """Return the positions, normals, triangles and colour of each link."""
    names = ("positions", "normals", "triangles", "color")
    return [
        {name: scene[f"{count}/{number}/{name}"] for name in names} for number in range(int(scene["links"]))
    ]


def vtk_(scene: dict[str, Any], row: dict[str, Any] | None) -> Any:
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

    if row is None:
        return f"vtk {vtk.vtkVersion().GetVTKVersion()}"
    width, height = row["size"]
    renderer, window = vtk.vtkRenderer(), vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(row["samples"])
    window.SetSize(width, height)
    window.AddRenderer(renderer)
    renderer.SetBackground(*BACKGROUND)
    matrices, kept = [], []
    for link in links(scene, row["count"]):
        data, points, cells = vtk.vtkPolyData(), vtk.vtkPoints(), vtk.vtkCellArray()
        points.SetData(numpy_to_vtk(link["positions"], deep=1))
        ids = numpy_to_vtkIdTypeArray(link["triangles"].astype(np.int64).ravel(), deep=1)
        cells.SetData(3, ids)
        data.SetPoints(points)
        data.SetPolys(cells)
        data.GetPointData().SetNormals(numpy_to_vtk(link["normals"], deep=1))
        mapper, actor, matrix = vtk.vtkPolyDataMapper(), vtk.vtkActor(), vtk.vtkMatrix4x4()
        mapper.SetInputData(data)
        mapper.StaticOn()
        actor.SetMapper(mapper)
        actor.GetProperty().SetColor(*link["color"].tolist())
        actor.GetProperty().BackfaceCullingOn()
        actor.SetUserMatrix(matrix)
        renderer.AddActor(actor)
        matrices.append(matrix)
        kept += [data, mapper, actor]
    camera = renderer.GetActiveCamera()
    pixels = vtk.vtkUnsignedCharArray()

    def render(placements: np.ndarray, view: int) -> np.ndarray:
        for matrix, placement in zip(matrices, placements, strict=True):
            matrix.DeepCopy(placement.ravel().tolist())
        eye, target = scene["eyes"][view], scene["target"]
        camera.SetPosition(*eye)
        camera.SetFocalPoint(*target)
        camera.SetViewUp(0, 0, 1)
        camera.SetViewAngle(float(np.degrees(scene["field_of_view"])))
        camera.SetClippingRange(0.5, 6.0)
        window.Render()
        window.GetPixelData(0, 0, width - 1, height - 1, 1, pixels, 0)
        return vtk_to_numpy(pixels).reshape(height, width, 3)[::-1].copy()

    if "EGL_DEVICE_ID" in os.environ:
        window.SetDeviceIndex(int(os.environ["EGL_DEVICE_ID"]))
    window.Render()
    lines = window.ReportCapabilities().splitlines()
    name = next((line.partition(":")[2].strip() for line in lines if "renderer string" in line), "")
    return render, window.Finalize, name


def pyrender_(scene: dict[str, Any], row: dict[str, Any] | None) -> Any:
    if not hasattr(np, "infty"):
        np.infty = np.inf  # type: ignore[attr-defined]
    import pyrender

    if row is None:
        return f"pyrender {pyrender.__version__}, always 4x"
    width, height = row["size"]
    stage = pyrender.Scene(bg_color=(*BACKGROUND, 1.0), ambient_light=(0.3, 0.3, 0.3))
    nodes = []
    for link in links(scene, row["count"]):
        material = pyrender.MetallicRoughnessMaterial(
            baseColorFactor=(*link["color"].tolist(), 1.0), metallicFactor=0.0, roughnessFactor=0.6
        )
        primitive = pyrender.Primitive(
            positions=link["positions"],
            normals=link["normals"],
            indices=link["triangles"],
            material=material,
            mode=4,
        )
        nodes.append(stage.add(pyrender.Mesh([primitive])))
    camera = stage.add(pyrender.PerspectiveCamera(yfov=float(scene["field_of_view"]), znear=0.5, zfar=6.0))
    light = stage.add(pyrender.DirectionalLight(intensity=4.0))
    renderer = pyrender.OffscreenRenderer(width, height)

    def render(placements: np.ndarray, view: int) -> np.ndarray:
        for node, placement in zip(nodes, placements, strict=True):
            stage.set_pose(node, placement)
        pose = looking(scene["eyes"][view], scene["target"])
        stage.set_pose(camera, pose)
        stage.set_pose(light, pose)
        color, _ = renderer.render(stage)
        return color

    renderer._platform.make_current()
    return render, renderer.delete, device_name()


def mujoco_(scene: dict[str, Any], row: dict[str, Any] | None) -> Any:
    import mujoco

    if row is None:
        return f"mujoco {mujoco.__version__}"
    width, height = row["size"]
    spec = mujoco.MjSpec()
    for number, link in enumerate(links(scene, row["count"])):
        mesh = spec.add_mesh(name=f"mesh{number}")
        mesh.uservert = link["positions"].ravel().tolist()
        mesh.usernormal = link["normals"].ravel().tolist()
        mesh.userface = link["triangles"].astype(int).ravel().tolist()
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        body = spec.worldbody.add_body(name=f"link{number}", mocap=True)
        geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"mesh{number}")
        geom.rgba = [*link["color"].tolist(), 1.0]
        geom.contype = geom.conaffinity = 0
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    spec.visual.quality.offsamples = row["samples"]
    spec.visual.global_.fovy = float(np.degrees(scene["field_of_view"]))
    spec.visual.map.znear, spec.visual.map.zfar = 0.05, 50.0
    model = spec.compile()
    data = mujoco.MjData(model)
    renderer = mujoco.Renderer(model, height, width)
    for flag in ("SHADOW", "REFLECTION", "SKYBOX", "HAZE", "FOG"):
        renderer.scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = 0
    camera = mujoco.MjvCamera()

    def render(placements: np.ndarray, view: int) -> np.ndarray:
        for number, placement in enumerate(placements):
            data.mocap_pos[number] = placement[:3, 3]
            mujoco.mju_mat2Quat(data.mocap_quat[number], placement[:3, :3].ravel())
        mujoco.mj_kinematics(model, data)
        away = scene["eyes"][view] - scene["target"]
        camera.lookat[:] = scene["target"]
        camera.distance = float(np.linalg.norm(away))
        camera.azimuth = float(np.degrees(np.arctan2(-away[1], -away[0])))
        camera.elevation = -float(np.degrees(np.arcsin(away[2] / camera.distance)))
        renderer.update_scene(data, camera)
        return renderer.render()

    renderer._gl_context.make_current()
    return render, renderer.close, device_name()


def device_name() -> str:
    from OpenGL import GL

    return GL.glGetString(GL.GL_RENDERER).decode()


def looking(eye: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return (4, 4) camera to world; the camera looks along its -z."""
    backward = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0.0, 0.0, 1.0], backward)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(backward, right), backward], axis=1)
    pose[:3, 3] = eye
    return pose


if __name__ == "__main__":
    main()
