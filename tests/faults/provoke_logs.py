"""Logs whose bytes are whole and whose content is not: the faults of `tests/logs`, counted.

Those tests say what each fault must be called and what must be left; here the same forgeries are
only asked whether anything wrong got through without a word.
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path

from cpl.logs import LogError, RunInfo, read_run, write_run
from tests.faults.frame import Row, tally
from tests.logs.conftest import Forger, make_rows
from tests.logs.test_faults import NUMBERS, POSE, SURVIVED, UNUSABLE, scaled

_INFO = RunInfo(provenance="simulated-kinematic", config={"kp": 1.5}, seed=17)
_BAD_CELLS = ("nan", "inf", "-inf", "1e999", "abc", "", "1;2", "0x10", "1_000", "1,5")


def provoke(count: int) -> Iterator[Row]:
    """Try every semantic fault once, and bad cells of a CSV in `count` places at most."""
    folder = Path(tempfile.mkdtemp(prefix="cpl-faults-"))
    good = read_run(write_run(folder / "good.mcap", make_rows(40), _INFO)).table
    survived = (_forged(folder, spoil[0], name, good) for name, spoil in SURVIVED.items())
    yield tally("log (MCAP)", "a row that cannot be", survived)
    unusable = (_forged(folder, spoil[0], name, good) for name, spoil in UNUSABLE.items())
    yield tally("log (MCAP)", "a description that cannot be", unusable)
    wrong = (_scaled(folder, change) for change, _, _ in NUMBERS.values())
    yield tally("log (MCAP)", "numbers in another unit", wrong)
    yield tally("recording (CSV)", "a cell that is no number", _cells(folder, count))


def _forged(folder: Path, spoil, name: str, good) -> str:
    log = Forger(_INFO)
    if name == "quaternion of length 0":
        log.body(POSE, 7)["pose"]["orientation"] = dict.fromkeys("xyzw", 0.0)
    else:
        spoil(log)
    return _judged(log.save(folder / "forged.mcap"), good)


def _judged(path: Path, good) -> str:
    try:
        run = read_run(path)
    except LogError:
        return "refused"
    if run.recovery.faults:
        kept = good.loc[run.table.index, run.table.columns]
        return "recovered" if run.table.equals(kept) else "silent"
    return "harmless" if run.table.equals(good) else "silent"


def _scaled(folder: Path, change) -> str:
    path = folder / "scaled.mcap"
    path.unlink(missing_ok=True)
    rows = make_rows(100)
    return _judged(write_run(path, scaled(rows, *change), _INFO), read_run_of(folder, rows))


def read_run_of(folder: Path, rows):
    """Return the table of sound rows."""
    path = folder / "sound.mcap"
    path.unlink(missing_ok=True)
    return read_run(write_run(path, rows, _INFO)).table


def _cells(folder: Path, count: int) -> Iterator[str]:
    header = "t_s,x_m,y_m,z_m,qx,qy,qz,qw"
    lines = [f"{0.1 * k:.1f},{0.05 * k:.3f},0,0,0,0,0,1" for k in range(30)]
    path = folder / "poses.csv"
    words = {"provenance": "simulated-kinematic", "axes": "ros"}
    path.write_text("\n".join([header, *lines]) + "\n")
    good = read_run(path, **words).table
    places = [(column, cell) for column in range(8) for cell in _BAD_CELLS]
    for column, cell in places[:count]:
        cells = lines[12].split(",")
        cells[column] = cell
        path.write_text("\n".join([header, *lines[:12], ",".join(cells), *lines[13:]]) + "\n")
        try:
            run = read_run(path, **words)
        except LogError:
            yield "refused"
            continue
        if run.recovery.faults:
            kept = good.loc[run.table.index, run.table.columns]
            yield "recovered" if run.table.equals(kept) else "silent"
        else:
            yield "harmless" if run.table.equals(good) else "silent"
