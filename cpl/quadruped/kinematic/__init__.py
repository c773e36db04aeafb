"""Twin A: a kinematic robot in a painted hall whose visual odometry really loses track.

Needs OpenCV: the extra `quadruped`.
"""

from cpl.quadruped.kinematic.body import Body
from cpl.quadruped.kinematic.camera import FisheyeCamera
from cpl.quadruped.kinematic.odometry import Odometry, OdometryConfig, SlamError
from cpl.quadruped.kinematic.room import Room
from cpl.quadruped.kinematic.sensor import ImuConfig
from cpl.quadruped.kinematic.world import KinematicWorld, WorldConfig

__all__ = [
    "Body",
    "FisheyeCamera",
    "ImuConfig",
    "KinematicWorld",
    "Odometry",
    "OdometryConfig",
    "Room",
    "SlamError",
    "WorldConfig",
]
