"""What the package asks of the process and the machine that it runs in.

It may lie in a checkout or in site-packages, in a folder that cannot be written, under a HOME that
does not exist. What it keeps goes where it may, and nowhere else.
"""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
from pathlib import Path

__all__ = [
    "ONE_THREAD",
    "in_checkout",
    "keep_compiled_code",
    "kept_path",
    "one_thread",
    "spell_paths",
]

PACKAGE = Path(__file__).resolve().parent
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""What tells linear algebra how many threads it may start."""


def in_checkout() -> bool:
    """Say whether the package lies in the repository, beside its book."""
    root = PACKAGE.parent
    return (root / "pyproject.toml").is_file() and (root / "book").is_dir()


def kept_path(*parts: str) -> Path:
    """Return where something that a person makes is kept; nothing is created.

    Args:
        parts: Path components.

    Returns:
        A path below `_build` of a checkout that can be written, else below the user's data folder.
    """
    build = PACKAGE.parent / "_build"
    if in_checkout() and os.access(build if build.exists() else build.parent, os.W_OK):
        return build.joinpath(*parts)
    from platformdirs import user_data_path

    return user_data_path("cpl", appauthor=False).joinpath(*parts)


def one_thread() -> None:
    """Keep linear algebra to one thread in this process and its children, unless told otherwise.

    Networks and systems here are small: a second thread only waits, and on a busy machine for very
    long. It has no effect on what has been loaded already.
    """
    if not any(name in os.environ for name in ONE_THREAD):
        os.environ.update(dict.fromkeys(ONE_THREAD, "1"))


def spell_paths() -> None:
    """Start a command anew in UTF-8 mode where Python cannot spell the folder that it lies in.

    A locale that knows ASCII alone leaves a path with an umlaut as bytes in disguise; Python opens
    it, numba cannot name its compiled code by it. The mode comes with the start of a process only.
    """
    try:
        str(PACKAGE).encode()
    except UnicodeEncodeError:
        words = [sys.executable, "-X", "utf8", "-m", "cpl", *sys.argv[1:]]
        os.execv(sys.executable, words)


def keep_compiled_code() -> None:
    """Let numba keep machine code beside the sources of a checkout, else in the user's cache.

    Where neither can be written, it is kept for as long as this process lives: numba would refuse
    to import the kernels at all. NUMBA_CACHE_DIR, if set, is obeyed.
    """
    if "NUMBA_CACHE_DIR" in os.environ or (in_checkout() and os.access(PACKAGE, os.W_OK)):
        return
    from platformdirs import user_cache_path

    folder = user_cache_path("cpl", appauthor=False) / "numba"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError:
        folder = Path(tempfile.mkdtemp(prefix="cpl-numba-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    if "numba" in sys.modules:  # it has read its environment
        sys.modules["numba"].config.CACHE_DIR = str(folder)
