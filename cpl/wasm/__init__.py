"""The road as one WebAssembly module: the native engine's kernels, where numba does not run.

`cpl.wasm.lower` compiles the kernels of the road, the tracker's loop and the networks' forward pass
through LLVM; `python -m cpl.wasm` writes the module to `data/wasm/`, from where the book takes it.
It runs on the engine's own arithmetic (`cpl.highway.paths`), which gives the same bits everywhere.
"""

from cpl.wasm._exports import BLOCK, NETWORKS, RIDE
from cpl.wasm.artefact import AGREEMENT, MODULE, make, module_bytes, note, stale

__all__ = [
    "AGREEMENT",
    "BLOCK",
    "MODULE",
    "NETWORKS",
    "RIDE",
    "make",
    "module_bytes",
    "note",
    "stale",
]
