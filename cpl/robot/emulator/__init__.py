"""A Go1 and a T265 for those who have neither: they speak the real protocols on loopback.

The body and the eyes are the kinematic twin's; the datagrams are the robot's and the bridge's, and
are checked as the robot and the vendor's SDK check them. Faults come on demand.
"""

from cpl.robot.emulator.body import Ideal
from cpl.robot.emulator.faults import FAULTS, STRANGERS, Fault, Faults
from cpl.robot.emulator.go1 import Endpoint
from cpl.robot.emulator.lockstep import LockStep, StepClock
from cpl.robot.emulator.twin import Emulation, rehearsal_world

__all__ = [
    "FAULTS",
    "STRANGERS",
    "Emulation",
    "Endpoint",
    "Fault",
    "Faults",
    "Ideal",
    "LockStep",
    "StepClock",
    "rehearsal_world",
]
