"""Old name of `robots.kinematics.joints`, which drivers of packages import; it will be gone."""

import warnings

from robots.kinematics.joints import JointType

__all__ = ["JointType"]

warnings.warn("robots.joints: import JointType from protocol_gateway.seam", FutureWarning, stacklevel=2)
