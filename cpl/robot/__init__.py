"""From the book to a robot: drivers, a guard, a watchdog, and emulators to rehearse with.

`cpl robot check|rehearse|run|replay|train` is the way in. Nothing here needs a vendor's library to
be imported. The emulators (:mod:`cpl.robot.emulator`) need OpenCV, the extra `quadruped`.

Nothing in this package has ever driven a physical robot.
"""

from cpl.robot.agreement import AgreementConfig
from cpl.robot.clock import Clock, RealClock, Timing, boottime, histogram, urgent
from cpl.robot.envelope import Envelope, clamp, within
from cpl.robot.go1 import GO1, LOCAL_PORT, Go1Base, vendor_version
from cpl.robot.guard import SUPERVISOR, GuardConfig, GuardState, RobotFacts, Ruling, Stop, guard
from cpl.robot.interfaces import Base, BaseState, Fix, Localizer, Mode, RobotError
from cpl.robot.lease import LeaseConfig
from cpl.robot.loop import OUTCOMES, PERIOD_S, Robot, drive, halt, prepare
from cpl.robot.ports import Address, address, free_port, is_loopback
from cpl.robot.replay import replay, replayed
from cpl.robot.session import Plan, Walked, collection, evaluation, perform
from cpl.robot.t265 import Mount, T265Localizer
from cpl.robot.view import View
from cpl.robot.watched import WatchdogConfig, WatchedBase

__all__ = [
    "GO1",
    "LOCAL_PORT",
    "OUTCOMES",
    "PERIOD_S",
    "SUPERVISOR",
    "Address",
    "AgreementConfig",
    "Base",
    "BaseState",
    "Clock",
    "Envelope",
    "Fix",
    "Go1Base",
    "GuardConfig",
    "GuardState",
    "LeaseConfig",
    "Localizer",
    "Mode",
    "Mount",
    "Plan",
    "RealClock",
    "Robot",
    "RobotError",
    "RobotFacts",
    "Ruling",
    "Stop",
    "T265Localizer",
    "Timing",
    "View",
    "Walked",
    "WatchdogConfig",
    "WatchedBase",
    "address",
    "boottime",
    "clamp",
    "collection",
    "drive",
    "evaluation",
    "free_port",
    "guard",
    "halt",
    "histogram",
    "is_loopback",
    "perform",
    "prepare",
    "replay",
    "replayed",
    "urgent",
    "vendor_version",
    "within",
]
