"""Where things lie, and the one way in which a file is written."""

import os
import tempfile
from pathlib import Path

from cpl.environ import kept_path

__all__ = ["atomic_write", "data_path", "project_root", "work_path"]


def project_root() -> Path:
    """Return the folder that holds ``book/``, ``cpl/`` and ``data/``.

    It is found through the package, never through the working directory, so that a chapter gives
    the same answer under papermill, in the book and in JupyterLab.

    Returns:
        The absolute path of the checkout that this package is imported from.

    Examples:
        >>> (project_root() / "cpl" / "store" / "paths.py").is_file()
        True
    """
    return Path(__file__).resolve().parents[2]


def data_path(*parts: str) -> Path:
    """Return a path below ``data/``, which is in git and read-only for chapters.

    Args:
        parts: Path components below ``data/``; none of them may be absolute or climb out of it.

    Raises:
        ValueError: If the path would leave ``data/``.

    Examples:
        >>> data_path("results", "coverage").relative_to(project_root()).as_posix()
        'data/results/coverage'
    """
    base = project_root() / "data"
    path = base.joinpath(*parts)
    if ".." in path.parts or not path.is_relative_to(base):
        msg = f"parts must stay below {base.name}/, got {parts!r}"
        raise ValueError(msg)
    return path


def work_path() -> Path:
    """Return the folder of the work layer: ``$CPL_STORE``, else ``_build/store`` of the project.

    Without a project, or where it cannot be written, it is in the user's data folder.
    """
    chosen = os.environ.get("CPL_STORE")
    return Path(chosen).resolve() if chosen else kept_path("store")


def atomic_write(path: Path | str, content: bytes | str) -> Path:
    """Write a whole file or nothing: a reader never sees half of it, not even after a kill.

    The content goes to a temporary file in the same folder, is flushed to the disk and then takes
    the name over in one step. Missing parent folders are made. Two writers of one path are safe:
    the last one wins, whole.

    Args:
        path: The file to write.
        content: Its bytes; a ``str`` is written as UTF-8, line ends as they are.

    Returns:
        The path written.

    Raises:
        OSError: If the disk is full or read-only; the old file is then untouched.
    """
    path = Path(path)
    payload = content.encode() if isinstance(content, str) else content
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".tmp")
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(payload)
            file.flush()
            os.fsync(file.fileno())
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    _sync_folder(path.parent)
    return path


def _umask() -> int:
    """Return the process's umask, read once at import: the only way to read it is to set it."""
    return _UMASK


def _sync_folder(folder: Path) -> None:
    """Flush the rename itself to the disk (a no-op where folders cannot be opened)."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


_UMASK = os.umask(0)
os.umask(_UMASK)
