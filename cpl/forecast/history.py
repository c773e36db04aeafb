"""The last few observations of every road: what the forecaster sees."""

import numpy as np
from numpy.typing import NDArray

from cpl.forecast.errors import HistoryShapeError

__all__ = ["History"]


class History:
    """The last `length` observations of n environments, oldest first.

    Shifting a few hundred bytes a road is cheaper than unrolling a ring before every forecast, so
    the ring is kept unrolled.

    Example:
        >>> history = History(2, length=2, width=1)
        >>> history.push(np.array([[1.0], [5.0]]))
        >>> history.ready.tolist()
        [False, False]
        >>> history.push(np.array([[2.0], [6.0]]))
        >>> history.flat.tolist()
        [[1.0, 2.0], [5.0, 6.0]]
        >>> history.reset(np.array([True, False]))
        >>> history.ready.tolist()
        [False, True]
    """

    def __init__(self, n: int, length: int = 5, width: int = 25) -> None:
        """Allocate an empty history.

        Args:
            n: environments [-], >= 1.
            length: observations that are remembered [-], >= 1; the paper's five.
            width: numbers in one observation [-], >= 1; five rows of five features.

        Raises:
            ValueError: if one of them is below 1.
        """
        for name, value in (("n", n), ("length", length), ("width", width)):
            if value < 1:
                raise ValueError(f"{name} must be >= 1, got {value!r}")
        self._kept = np.zeros((n, length, width), np.float32)
        self._count = np.zeros(n, np.int64)

    def reset(self, mask: NDArray[np.bool_] | None = None) -> None:
        """Forget everything, or the environments of a mask (n,)."""
        chosen = slice(None) if mask is None else self._mask(mask)
        self._kept[chosen] = 0.0
        self._count[chosen] = 0

    def push(self, obs: NDArray[np.floating]) -> None:
        """Remember one more observation of every environment.

        Args:
            obs: shape (n, rows, features) or (n, width).

        Raises:
            HistoryShapeError: if it is of another shape.
        """
        n, _, width = self._kept.shape
        new = np.asarray(obs)
        if new.ndim not in (2, 3) or new.shape[0] != n or new.size != n * width:
            raise HistoryShapeError(f"obs must hold ({n}, {width}) numbers, got shape {new.shape}")
        self._kept[:, :-1] = self._kept[:, 1:]
        self._kept[:, -1] = new.reshape(n, width)
        self._count += 1

    @property
    def ready(self) -> NDArray[np.bool_]:
        """Whether each environment has `length` observations since its reset, (n,)."""
        return self._count >= self._kept.shape[1]

    @property
    def flat(self) -> NDArray[np.float32]:
        """A view, float32 (n, length * width), of what the next push will change."""
        return self._kept.reshape(len(self._kept), -1)

    def _mask(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        array = np.asarray(mask)
        if array.shape != self._count.shape or array.dtype != np.bool_:
            raise ValueError(
                f"mask must be bool of shape {self._count.shape}, got {array.dtype} {array.shape}"
            )
        return array
