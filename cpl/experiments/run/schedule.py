"""How long does a set of pieces take on many workers? Pure arithmetic, nothing is run.

Pieces have a duration and may need others. A driver, alone, hands each piece out and commits its
result, which takes it a fixed time a piece; so there is a number of workers beyond which more of
them do not help.
"""

from __future__ import annotations

import heapq
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

__all__ = ["Piece", "Schedule", "chains", "longest_path_s", "makespan", "one_after_another"]


Name = TypeVar("Name", bound=Hashable)


@dataclass(frozen=True, kw_only=True)
class Piece:
    """One piece of work.

    Attributes:
        seconds: How long a worker takes.
        needs: Names of the pieces whose results it takes.
    """

    seconds: float
    needs: tuple[Any, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """What a schedule comes to.

    Attributes:
        seconds: From the first start to the last commit.
        work_s: Seconds of all pieces together.
        bound_s: No schedule is shorter: work / workers, the longest chain of needs, the driver.
        busy: Share of the workers' time that is work.
    """

    seconds: float
    work_s: float
    bound_s: float
    busy: float


def makespan(
    pieces: Mapping[Name, Piece],
    workers: int,
    *,
    driver_s: float = 0.0,
    longest_first: bool = True,
) -> Schedule:
    r"""Hand pieces to workers as soon as their needs are committed and a worker is free.

    Of the pieces that could start, the one at the head of the longest chain starts first (the
    longest-processing-time rule for pieces with needs); or simply the first. With $W$ the work,
    $L$ the longest chain and $w$ workers, Graham's bound holds for any order if the driver costs
    nothing:

    $$\max(W / w, L) \le T \le W / w + (1 - 1 / w) L .$$

    Args:
        pieces: By name; the order counts without `longest_first`.
        workers: How many, at least 1.
        driver_s: Time of the driver for each piece [s].
        longest_first: Whether the order is by what hangs on a piece.

    Returns:
        The schedule's length and its bounds.

    Raises:
        ValueError: If a number is out of range, a need is unknown, or needs go round in circles.

    Examples:
        Three pieces of 2, 2 and 3 s, the last needing the first, on two workers:

        >>> parts = {"a": Piece(seconds=2.0), "b": Piece(seconds=2.0)}
        >>> parts["c"] = Piece(seconds=3.0, needs=("a",))
        >>> makespan(parts, 2).seconds
        5.0
        >>> makespan(parts, 1).seconds
        7.0
    """
    if workers < 1 or driver_s < 0:
        msg = f"workers must be >= 1 and driver_s >= 0, got {workers!r} and {driver_s!r}"
        raise ValueError(msg)
    ranks = chains(pieces)
    place = {name: number for number, name in enumerate(pieces)}
    waiting = {name: len(set(piece.needs)) for name, piece in pieces.items()}
    after = _after(pieces)
    ready = [
        (-ranks[name] if longest_first else 0.0, place[name], name)
        for name in pieces
        if not waiting[name]
    ]
    heapq.heapify(ready)
    running: list[tuple[float, int, Name]] = []
    commits: list[tuple[float, int, Name]] = []
    now, driver_free, free = 0.0, 0.0, workers
    while ready or running or commits:
        while ready and free:
            _, number, name = heapq.heappop(ready)
            heapq.heappush(running, (now + pieces[name].seconds, number, name))
            free -= 1
        if running and (not commits or running[0][0] <= commits[0][0]):
            now, number, name = heapq.heappop(running)
            free += 1
            driver_free = max(driver_free, now) + driver_s
            heapq.heappush(commits, (driver_free, number, name))
        else:
            now, _, name = heapq.heappop(commits)
            for other in after[name]:
                waiting[other] -= 1
                if not waiting[other]:
                    rank = -ranks[other] if longest_first else 0.0
                    heapq.heappush(ready, (rank, place[other], other))
    work = sum(piece.seconds for piece in pieces.values())
    bound = max(work / workers, max(ranks.values(), default=0.0), driver_s * len(pieces))
    return Schedule(
        seconds=now, work_s=work, bound_s=bound, busy=work / (workers * now) if now else 1.0
    )


def one_after_another(
    stages: Sequence[Mapping[Name, Piece]], workers: int, *, driver_s: float = 0.0
) -> Schedule:
    """Run stages in turn, each in its own order and only when the last is wholly committed.

    That is what one command after the other does; needs between stages are then met.

    Examples:
        >>> stage = {"a": Piece(seconds=2.0), "b": Piece(seconds=1.0)}
        >>> one_after_another([stage, stage], 2).seconds
        4.0
    """
    inside = [
        {name: Piece(seconds=piece.seconds) for name, piece in stage.items()} for stage in stages
    ]
    each = [makespan(stage, workers, driver_s=driver_s, longest_first=False) for stage in inside]
    seconds, work = sum(s.seconds for s in each), sum(s.work_s for s in each)
    return Schedule(
        seconds=seconds,
        work_s=work,
        bound_s=sum(s.bound_s for s in each),
        busy=work / (workers * seconds) if seconds else 1.0,
    )


def longest_path_s(pieces: Mapping[Name, Piece]) -> float:
    """Return how long the longest chain of needs takes: no number of workers is faster.

    Examples:
        >>> longest_path_s({"a": Piece(seconds=2.0), "b": Piece(seconds=1.0, needs=("a",))})
        3.0
    """
    return max(chains(pieces).values(), default=0.0)


def _after(pieces: Mapping[Name, Piece]) -> dict[Name, list[Name]]:
    after: dict[Name, list[Name]] = {name: [] for name in pieces}
    for name, piece in pieces.items():
        for need in set(piece.needs):
            if need not in after:
                msg = f"needs must name pieces, got {need!r} in {name!r}"
                raise ValueError(msg)
            after[need].append(name)
    return after


def chains(pieces: Mapping[Name, Piece]) -> dict[Name, float]:
    """Return how long the longest chain is that begins with each piece."""
    after = _after(pieces)
    left = {name: len(followers) for name, followers in after.items()}
    ends = [name for name, count in left.items() if not count]
    found: dict[Name, float] = {}
    while ends:
        name = ends.pop()
        found[name] = pieces[name].seconds + max((found[a] for a in after[name]), default=0.0)
        for need in set(pieces[name].needs):
            left[need] -= 1
            if not left[need]:
                ends.append(need)
    if len(found) < len(pieces):
        msg = f"needs must not go round in circles, got {sorted(map(str, pieces.keys() - found))}"
        raise ValueError(msg)
    return found
