"""How the kernels are compiled: one decorator, and where the machine code is kept.

Compiled code is cached by numba in `__pycache__` beside these modules or, where that is not
writable, in the user's cache folder; NUMBA_CACHE_DIR moves it anywhere else. Under
NUMBA_DISABLE_JIT=1, for a debugger or a coverage tool, Python runs the same functions to the same
bits, a thousand times slower.
"""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, njit, types
from numba.extending import intrinsic
from numba.np.unsafe.ndarray import to_fixed_tuple

from cpl import portable

__all__ = ["bits_of", "float_of", "fma", "inlined", "inner", "kernel", "merged", "tuple_of"]

# Reference counting is switched off: kernels allocate nothing, and counting the references to
# array views cost more than half of a step. The option has no public spelling in numba.
_OPTIONS: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "boundscheck": False,
    "_nrt": False,
}


# What only kernels call is compiled into them: it needs no way in from Python, whose unboxing of
# forty arrays took longer to compile than the function itself, and no cache of its own.
_INNER = {**_OPTIONS, "cache": False, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that Python calls, and keep the machine code.

    Args:
        function: Function over scalars and arrays that allocates nothing.

    Returns:
        The compiled function.
    """
    if config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]
        return np.errstate(all="ignore")(function)  # overflow is meant, as in machine code
    return _stamped(njit(**_OPTIONS)(function))


def inner(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that only kernels call.

    Args:
        function: Function over scalars and arrays that allocates nothing.

    Returns:
        The compiled function.
    """
    return njit(**_INNER)(function)


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that only kernels call into each of its callers.

    Args:
        function: Function over scalars and arrays that allocates nothing.

    Returns:
        The compiled function.
    """
    return njit(forceinline=True, **_INNER)(function)


def merged(function: Callable[..., Any]) -> Callable[..., Any]:
    """Paste a function that only kernels call into its caller before anything is compiled.

    For the few functions that hold a frame together: compiled one by one, each would optimise
    everything below it again.

    Args:
        function: Function over scalars and arrays that allocates nothing.

    Returns:
        The compiled function.
    """
    return njit(inline="always", **_INNER)(function)


def _stamped(dispatcher: Any) -> Any:  # noqa: ANN401
    """Tie cached machine code to all kernels' sources.

    numba looks at a function's own file only, but its callees are compiled into it: without this,
    an edit of one module would leave stale code in the others.
    """
    dispatcher._cache._cache_file._source_stamp = _sources_digest()
    return dispatcher


@cache
def _sources_digest() -> str:
    digest = hashlib.sha256()
    elsewhere = Path(portable.__file__)  # compiled into the kernels like their own modules
    for path in [elsewhere, *sorted(Path(__file__).parent.glob("*.py"))]:
        source = path.read_bytes()
        if (
            path == elsewhere
            or b"cpl.highway._compile" in source
            or path.name == Path(__file__).name
        ):
            digest.update(source)
    return digest.hexdigest()


def _fma(typing_context, a, b, c):  # noqa: ANN001, ANN202
    signature = types.float64(types.float64, types.float64, types.float64)

    def generate(context, builder, signature, arguments):  # noqa: ANN001, ANN202
        double = ir.DoubleType()
        kind = ir.FunctionType(double, [double, double, double])
        name = "llvm.fma.f64"
        function = builder.module.globals.get(name) or ir.Function(builder.module, kind, name)
        return builder.call(function, arguments)

    return signature, generate


def _bits_of(typing_context, x):  # noqa: ANN001, ANN202
    def generate(context, builder, signature, arguments):  # noqa: ANN001, ANN202
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.int64(types.float64), generate


def _float_of(typing_context, bits):  # noqa: ANN001, ANN202
    def generate(context, builder, signature, arguments):  # noqa: ANN001, ANN202
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.int64), generate


def _fma_in_python(a: float, b: float, c: float) -> float:
    if not (math.isfinite(a) and math.isfinite(b) and math.isfinite(c)):
        return a * b + c
    exact = Fraction(a) * Fraction(b) + Fraction(c)
    return float(exact) if exact else a * b + c  # the sign of a zero


def _bits_in_python(x: float) -> int:
    return struct.unpack("<q", struct.pack("<d", x))[0]


def _float_in_python(bits: int) -> float:
    return struct.unpack("<d", struct.pack("<q", bits))[0]


def _either(compiled: Callable[..., Any], plain: Callable[..., Any]) -> Any:  # noqa: ANN401
    return plain if config.DISABLE_JIT else intrinsic(compiled)  # pyright: ignore[reportAttributeAccessIssue]


fma: Any = _either(_fma, _fma_in_python)
"""Fused multiply-add fma(a, b, c) = a b + c, rounded once, on any processor."""

bits_of: Any = _either(_bits_of, _bits_in_python)
"""The 64 bits of a float as a signed integer."""

float_of: Any = _either(_float_of, _float_in_python)
"""The float of 64 bits."""

tuple_of: Any = (lambda values, _: tuple(values)) if config.DISABLE_JIT else to_fixed_tuple  # pyright: ignore[reportAttributeAccessIssue]
"""The tuple of all values of an array, whose number is known when the kernel is compiled."""
