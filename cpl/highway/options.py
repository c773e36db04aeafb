"""highway-env's option names, nested or flat, read into the engine's `Config`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

from cpl.highway.config import Config

__all__ = [
    "RENDER_OPTIONS",
    "change_config",
    "fixed_options",
    "highway_env_options",
    "make_config",
]

RENDER_OPTIONS: dict[str, object] = {
    "screen_width": 600,  # [px]
    "screen_height": 150,  # [px]
    "centering_position": (0.3, 0.5),  # [-] where the ego is held in the picture
    "scaling": 5.5,  # [px/m]
}
"""highway-env's options that change the picture and nothing else, with its defaults."""


def make_config(**options: Any) -> tuple[Config, dict[str, object]]:  # noqa: ANN401
    """Read highway-env's options, flat or nested, into a configuration and the picture's options.

    Flat names are the fields of `Config`. The dictionaries that highway-env nests are taken apart:
    `config={...}` holds any options, `observation={...}` the observation's (its `vehicles_count`
    is the field `observation_vehicles_count`) and `action={...}` the speed levels.

    Args:
        **options: highway-env's options by name.

    Returns:
        The configuration, and `RENDER_OPTIONS` with what was given of them.

    Raises:
        ValueError: Naming an option that is unknown, given twice, or that has a value which the
            engine does not simulate (another kind of action, vehicle or observation).

    Example:
        >>> config, picture = make_config(
        ...     lanes_count=3, observation={"type": "Kinematics", "vehicles_count": 7}
        ... )
        >>> config.lanes_count, config.observation_vehicles_count, picture["scaling"]
        (3, 7, 5.5)
        >>> make_config(lane_count=3)
        Traceback (most recent call last):
            ...
        ValueError: unknown option lane_count=3
    """
    return change_config(Config(), RENDER_OPTIONS, options)


def change_config(
    config: Config, picture: Mapping[str, object], options: Mapping[str, Any]
) -> tuple[Config, dict[str, object]]:
    """Change some options of a configuration and its picture; the others keep their values.

    Args:
        config: the engine's configuration.
        picture: the picture's options.
        options: what changes, as in `make_config`.

    Returns:
        The new configuration and picture.

    Raises:
        ValueError: as `make_config`.

    Example:
        >>> config = change_config(Config(lanes_count=3), {}, {"observation": {"clip": False}})[0]
        >>> config.lanes_count, config.clip
        (3, False)
    """
    flat: dict[str, Any] = {}
    _flatten(options, flat)
    known = {field.name for field in fields(Config)}
    settings: dict[str, Any] = {}
    drawn = dict(picture)
    for name, value in flat.items():
        if name in known:
            settings[name] = value
        elif name in RENDER_OPTIONS:
            drawn[name] = value
        elif name not in _FIXED:
            raise ValueError(f"unknown option {name}={value!r}")
        elif value not in _FIXED[name]:
            allowed = " or ".join(repr(choice) for choice in _FIXED[name])
            raise ValueError(f"{name} must be {allowed} in cpl/highway-v0, got {value!r}")
    for name in ("features", "target_speeds"):
        if name in settings and settings[name] is None:
            settings[name] = getattr(Config(), name)  # highway-env's "the usual ones"
    return replace(config, **settings), drawn


def highway_env_options(config: Config) -> dict[str, Any]:
    """Write a configuration as the nested dictionary of highway-env.

    The other cars' parameters are constants of classes in highway-env, not options; they are left
    out, as are the noise and the dropout of the observation, which it does not have.

    Args:
        config: the engine's configuration.

    Returns:
        The dictionary that `highway_env` takes as its `config`.

    Example:
        >>> highway_env_options(Config())["observation"]["vehicles_count"]
        5
    """
    options = {name: getattr(config, name) for name in _ROAD}
    ranges = config.features_range
    options["observation"] = {
        "type": "Kinematics",
        "vehicles_count": config.observation_vehicles_count,
        "features": list(config.features),
        "features_range": None if ranges is None else {n: list(r) for n, r in dict(ranges).items()},
        **{name: getattr(config, name) for name in _OBSERVATION},
    }
    options["action"] = {"type": "DiscreteMetaAction", "target_speeds": list(config.target_speeds)}
    options["reward_speed_range"] = list(config.reward_speed_range)
    return options


def fixed_options() -> dict[str, object]:
    """Return highway-env's options that have one meaning here, with what it reports for them.

    Example:
        >>> fixed_options()["manual_control"]
        False
    """
    return {name: allowed[-1] for name, allowed in _FIXED.items() if "." not in name}


_ROAD = (
    *("lanes_count", "vehicles_count", "initial_lane_id", "duration", "ego_spacing"),
    *("vehicles_density", "collision_reward", "right_lane_reward", "high_speed_reward"),
    *("lane_change_reward", "normalize_reward", "offroad_terminal"),
    *("simulation_frequency", "policy_frequency"),
)
_OBSERVATION = ("see_behind", "absolute", "normalize", "clip", "order")

# Options of highway-env that have one meaning here, or none: what may be passed for each, and last
# what is reported.
_FIXED: dict[str, tuple[object, ...]] = {
    "controlled_vehicles": (1,),
    "other_vehicles_type": ("highway_env.vehicle.behavior.IDMVehicle",),
    "manual_control": (False,),
    "real_time_rendering": (False,),
    "render_agent": (True,),
    "show_trajectories": (False,),
    "offscreen_rendering": (None, True),
    "neighbour_vehicles_connected_lanes": (True, False),  # a straight road has no other segment
    "observation.type": ("Kinematics",),
    "observation.observe_intentions": (False, True),  # without routes the columns are 0 anyway
    "observation.include_obstacles": (True, False),  # there are none
    "action.type": ("DiscreteMetaAction",),
    "action.longitudinal": (True,),
    "action.lateral": (True,),
}


def _flatten(options: Mapping[str, Any], flat: dict[str, Any]) -> None:
    for name, value in options.items():
        if name == "config" and value is None:
            continue
        if name not in ("config", "observation", "action"):
            _put(flat, name, value)
        elif not isinstance(value, Mapping):
            raise ValueError(f"{name} must be a dictionary of options, got {value!r}")
        elif name == "config":
            _flatten(value, flat)
        else:
            for inner, item in value.items():
                _put(flat, _inner_name(name, inner), item)


def _inner_name(group: str, name: str) -> str:
    if group == "observation" and name == "vehicles_count":
        return "observation_vehicles_count"
    if group == "observation" and name in (*_OBSERVATION, "features", "features_range"):
        return name
    if group == "action" and name == "target_speeds":
        return name
    return f"{group}.{name}"


def _put(flat: dict[str, Any], name: str, value: Any) -> None:  # noqa: ANN401
    if name in flat:
        raise ValueError(f"option {name} is given twice: {flat[name]!r} and {value!r}")
    flat[name] = value
