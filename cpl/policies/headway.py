"""A driver with two rules of thumb, to have something on the road before anything is learned."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["FASTER", "IDLE", "LANE_LEFT", "LANE_RIGHT", "SLOWER", "Headway"]

# highway-env's DiscreteMetaAction
LANE_LEFT, IDLE, LANE_RIGHT, FASTER, SLOWER = range(5)

_LANE_WIDTH = 4.0  # [m]
_CAR_LENGTH = 5.0  # [m]


@dataclass(frozen=True, kw_only=True)
class Headway:
    """Accelerate while the lane ahead is free, overtake when it is not, else brake.

    "Free" is counted in seconds of the car's own travel, the two-second rule of driving schools.

    Attributes:
        time_gap_s: free time wanted ahead in the own lane [s], > 0.
        lanes_count: lanes of the road, >= 1.
    """

    time_gap_s: float
    lanes_count: int

    def __post_init__(self) -> None:
        """Refuse settings that no driver could follow."""
        if not (np.isfinite(self.time_gap_s) and self.time_gap_s > 0):
            raise ValueError(f"time_gap_s must be finite and > 0 s, not {self.time_gap_s!r}")
        if self.lanes_count < 1:
            raise ValueError(f"lanes_count must be >= 1, not {self.lanes_count!r}")

    def __call__(self, observation: npt.ArrayLike) -> int:
        """Choose an action from one observation in metres.

        Args:
            observation: rows (presence, x, y, vx, vy), shape (n, 5); row 0 the ego vehicle on the
                road, the others relative to it [m, m/s]; rows with presence 0 are empty.

        Returns:
            The action, an index of highway-env's DiscreteMetaAction.

        Raises:
            ValueError: if the observation does not have that shape.

        A free road:

        >>> drive = Headway(time_gap_s=1.5, lanes_count=4)
        >>> drive([[1, 0, 4, 25, 0]]) == FASTER
        True

        A slower car 20 m ahead, nothing to the left:

        >>> drive([[1, 0, 4, 25, 0], [1, 20, 0, -5, 0]]) == LANE_LEFT
        True
        """
        rows = np.asarray(observation, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != 5 or rows.shape[0] == 0:
            raise ValueError(f"observation must have shape (n, 5), not {rows.shape}")
        ego, cars = rows[0], rows[1:][rows[1:, 0] > 0]
        wanted = self.time_gap_s * ego[3] + _CAR_LENGTH
        if _gap(cars, 0.0) > wanted:
            return FASTER
        lane = round(ego[2] / _LANE_WIDTH)
        if lane > 0 and _gap(cars, -_LANE_WIDTH) > wanted:
            return LANE_LEFT
        if lane < self.lanes_count - 1 and _gap(cars, _LANE_WIDTH) > wanted:
            return LANE_RIGHT
        return SLOWER


def _gap(cars: npt.NDArray[np.float64], dy: float) -> float:
    """Distance along the road to the next car in the lane `dy` metres aside [m]; 0 if alongside."""
    in_lane = cars[np.abs(cars[:, 2] - dy) < _LANE_WIDTH / 2, 1]
    ahead = in_lane[in_lane > -2 * _CAR_LENGTH]
    return float(max(ahead.min(), 0.0)) if ahead.size else np.inf
