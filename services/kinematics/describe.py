"""A robot's `description` message: everything that renderer, page and monitors know of it."""

import hashlib
from collections.abc import Mapping

import numpy as np

from bus.schemas import robomesh_pb2 as schema
from robots.description import RobotDescription
from robots.joints import FloatArray, JointType, joints_of
from robots.model import RobotModel, frame_placements, link_placements
from robots.views import views_of

_TYPES = {
    JointType.ROTARY: schema.Description.Joint.ROTARY,
    JointType.PRISMATIC: schema.Description.Joint.PRISMATIC,
}


def describe(
    description: RobotDescription,
    model: RobotModel,
    *,
    urdf: str,
    meshes: Mapping[str, bytes],
    base_to_site: FloatArray,
    cell: str,
    simulated: bool,
) -> schema.Description:
    """The message of a robot that stands somewhere.

    Args:
        meshes: GLB bytes by link name; a link that is not in it has no shape.
        base_to_site: (4, 4).
    """
    message = schema.Description(
        name=description.name,
        title=description.title or description.name,
        provenance=description.provenance,
        robot_toml=description.text,
        urdf=urdf,
        base_to_site=base_to_site.ravel().tolist(),
        cell=cell,
        simulated=simulated,
    )
    joints = joints_of(description)
    for index, name in enumerate(joints.names):
        message.joints.add(
            name=name,
            type=_TYPES[joints.types[index]],
            lower=joints.lower[index],
            upper=joints.upper[index],
            max_speed=joints.max_speed[index],
            home=joints.home[index],
            max_acceleration=joints.max_acceleration[index],
            max_jerk=joints.max_jerk[index],
        )
    bodies = (description.base, *(joint.link for joint in description.joints))
    for name, body in zip(description.link_names, bodies, strict=True):
        glb = meshes.get(name)
        message.links.add(
            name=name,
            mesh=name if glb is not None else "",
            mesh_sha256=hashlib.sha256(glb).hexdigest() if glb is not None else "",
            color=body.color or "",
        )
    _add_frames(message, description, model)
    for view in views_of(description):
        projection = schema.View.ORTHOGRAPHIC if view.orthographic else schema.View.PERSPECTIVE
        message.views.add(
            name=view.name,
            eye=_vector(view.eye),
            target=_vector(view.target),
            up=_vector(view.up),
            projection=projection,
        )
    for constraint in joints.constraints:
        message.constraints.add(
            joints=constraint.names,
            coefficients=[constraint.coefficients[joints.names.index(name)] for name in constraint.names],
            lower=constraint.lower,
            upper=constraint.upper,
        )
    return message


def _add_frames(message: schema.Description, description: RobotDescription, model: RobotModel) -> None:
    links = {frame.name: frame.link for frame in description.frames}
    home = model.joints.home
    placements = dict(zip(model.link_names, link_placements(model, home), strict=True))
    for name, frame_to_base in frame_placements(model, home).items():
        link = links.get(name, model.link_names[-1])
        frame_to_link = np.linalg.inv(placements[link]) @ frame_to_base
        message.frames.add(name=name, link=link, frame_to_link=frame_to_link.ravel().tolist())


def _vector(values: FloatArray) -> schema.Vector3:
    x, y, z = values.tolist()
    return schema.Vector3(x=x, y=y, z=z)
