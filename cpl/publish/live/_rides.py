"""Recorded rides, packed for the replay viewer: whole decimetres, and differences between frames.

A *scene* is one speed range and one seed with the rides of all policies. The index names all
scenes with their outcomes; the one that the book opens with is in it whole, and every other scene
is a script of its own, which the viewer loads when it is chosen.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cpl.experiments.listen.replays import Config
from cpl.publish.live._script import as_script

__all__ = ["FRAMES_PER_SECOND", "opening_moments", "ride_scripts", "scenes"]

FRAMES_PER_SECOND = 3
_WORDS = {
    "rules": {
        "speed": "hasty rule of thumb",
        "switch": "the switch between them",
        "safe": "careful rule of thumb",
    },
    "learned": {
        "speed": "fast policy",
        "switch": "switch",
        "safe": "careful policy",
        "agent": "agent that hears q",
    },
}
_NOTES = {
    "rules": "Simulated with two rules of thumb as drivers and the forecast that nothing changes;"
    " nothing here is learned.",
    "learned": "Simulated; policies and forecaster are those of one training seed.",
}


def ride_scripts(table: pd.DataFrame, config: Config) -> dict[str, str]:
    """Return the scripts of all scenes.

    Args:
        table: What `cpl.experiments.listen.replays` returns.
        config: The configuration it was computed with.

    Returns:
        Text by file name: `rides.js`, and `ride-<key>.js` for each scene.
    """
    packed = scenes(table, config)
    opening = _opening(packed)
    index = {
        "note": _NOTES[config.drivers],
        "rate": FRAMES_PER_SECOND,
        "scenes": [_summary(scene) for scene in packed],
        "opening": opening["key"],
        "crashes": _crashes(packed),
    }
    scripts = {
        f"ride-{scene['key']}.js": as_script(f"ride-{scene['key']}", scene) for scene in packed
    }
    first = as_script(f"ride-{opening['key']}", opening)
    return {"rides.js": as_script("rides", index) + first, **scripts}


def scenes(table: pd.DataFrame, config: Config) -> list[dict[str, Any]]:
    """Pack the rides, a scene for each speed range and seed, in that order."""
    words = _WORDS[config.drivers]
    found = []
    pairs = table[["top_speed_mps", "seed"]].drop_duplicates().itertuples(index=False, name=None)
    for top, seed in sorted(pairs):
        rides = table.loc[(table["top_speed_mps"] == top) & (table["seed"] == seed)]
        packed = [_ride(rides.loc[rides["policy"] == name], name, words[name]) for name in words]
        found.append(
            {
                "key": f"{top:g}-{seed}",
                "low": config.low_speed_mps,
                "top": float(top),
                "seed": int(seed),
                "q_safe": float(rides["q_safe"].iloc[0]),
                "rides": packed,
            }
        )
    return found


def opening_moments(table: pd.DataFrame, config: Config) -> dict[str, pd.DataFrame]:
    """Return the opening scene at the end of its shortest ride, policy by policy.

    Args:
        table: What `cpl.experiments.listen.replays` returns.
        config: The configuration it was computed with.

    Returns:
        Frames for `cpl.figures.road.moments`, by what they show.
    """
    opening = _opening(scenes(table, config))
    shown = [ride for ride in opening["rides"] if ride["policy"] in ("speed", "switch")]
    time = min(ride["duration_s"] for ride in shown)
    here = (table["top_speed_mps"] == opening["top"]) & (table["seed"] == opening["seed"])
    now = table.loc[here & (table["time_s"] == time)].rename(columns={"car": "vehicle"})
    return {
        f"{ride['words']}, after {time:g} s": now.loc[now["policy"] == ride["policy"]]
        for ride in shown
    }


def _ride(table: pd.DataFrame, policy: str, words: str) -> dict[str, Any]:
    frame = np.round(table["time_s"].to_numpy() * FRAMES_PER_SECOND).astype(int)
    table = table.assign(frame=frame, x=_tenths(table["x_m"]), y=_tenths(table["y_m"]))
    ego = table.loc[table["car"] == 0].sort_values("frame")
    decided = ego.loc[ego["action"].notna()]
    series = {
        name: [None if np.isnan(v) else round(v, 3) for v in decided[name].tolist()]
        for name in ("l_tilde", "l_hat", "q")
    }
    duration = float(ego["time_s"].max())
    distance = float(ego["x_m"].iloc[-1] - ego["x_m"].iloc[0])
    return {
        "policy": policy,
        "words": words,
        "crashed": bool(ego["crashed"].any()),
        "duration_s": duration,
        "speed_mps": round(distance / duration, 1),
        "distance_m": round(distance),
        "frames": len(ego),
        "ego": {
            "x": _steps(ego["x"]),
            "y": _steps(ego["y"]),
            "v": _tenths(ego["speed_mps"]).tolist(),
        },
        "cars": list(_cars(table.loc[table["car"] != 0])),
        "safe": decided["safe"].astype(int).tolist(),
        **series,
    }


def _cars(table: pd.DataFrame) -> Iterator[list[Any]]:
    """Yield [first frame, x, y, first frame crashed or -1] for each stay of a car in sight."""
    for _, rows in table.sort_values(["car", "frame"]).groupby("car"):
        stay = (rows["frame"].diff() != 1).cumsum()
        for _, seen in rows.groupby(stay):
            hit = seen.loc[seen["crashed"], "frame"]
            first = int(seen["frame"].iloc[0])
            crashed = int(hit.iloc[0]) if len(hit) else -1
            yield [first, _steps(seen["x"]), _steps(seen["y"]), crashed]


def _tenths(values: object) -> NDArray[np.int64]:
    return np.round(np.asarray(values, np.float64) * 10).astype(np.int64)


def _steps(values: object) -> list[int]:
    """Return the first value and the differences."""
    return np.diff(np.asarray(values, np.int64), prepend=0).tolist()


def _summary(scene: Mapping[str, Any]) -> dict[str, Any]:
    rides = [
        {name: ride[name] for name in ("policy", "words", "crashed", "duration_s", "speed_mps")}
        for ride in scene["rides"]
    ]
    return {**{name: scene[name] for name in ("key", "low", "top", "seed")}, "rides": rides}


def _opening(packed: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the first scene of the widest range in which speed crashes and the switch does not.

    The first scene of the widest range if there is none: nothing is staged.
    """
    widest = max(scene["top"] for scene in packed)
    candidates = [scene for scene in packed if scene["top"] == widest]
    for scene in candidates:
        crashed = {ride["policy"]: ride["crashed"] for ride in scene["rides"]}
        if crashed["speed"] and not crashed["switch"]:
            return scene
    return candidates[0]


def _crashes(packed: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Count, by speed range and policy, how many of the recorded rides end with a crash."""
    counts: dict[tuple[float, str], list[int]] = {}
    for scene in packed:
        for ride in scene["rides"]:
            counts.setdefault((scene["top"], ride["words"]), []).append(int(ride["crashed"]))
    return [
        {"top": top, "words": words, "crashed": sum(crashed), "rides": len(crashed)}
        for (top, words), crashed in counts.items()
    ]
