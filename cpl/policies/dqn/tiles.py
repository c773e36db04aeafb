"""Matrix products of a mini-batch, tile by tile in vector registers.

A product C = A B is cut into tiles of 8 rows and 32 columns of C. A tile's 16 vectors of 16 numbers
stay in registers while the sum runs, and every number of C is one chain of fused multiply-adds in
the order of the sum: the result does not depend on the tiling, the number of threads or the
processor, which a BLAS library does not promise. (It is faster, too: a library re-packs the
matrices at every call, which pays for large ones only.)
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from cpl.policies.dqn.config import LANES

__all__ = ["address", "kernel", "multiply"]

_ROWS = 8
_BYTES = 4  # of a float32


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function over arrays and keep the machine code.

    Args:
        function: Function that numba can compile.

    Returns:
        The compiled function.
    """
    if config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]
        return _refused
    compiled: Any = njit(cache=True, nogil=True, error_model="numpy", boundscheck=False)(function)
    # numba looks at a function's own file, but what it calls is compiled into it.
    compiled._cache._cache_file._source_stamp = _sources_digest()
    return compiled


def _refused(*_: object) -> None:
    msg = "the learner works on addresses, which Python cannot: unset NUMBA_DISABLE_JIT"
    raise RuntimeError(msg)


@cache
def _sources_digest() -> str:
    sources = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()


def _tile(rows: int, vectors: int) -> Any:  # noqa: ANN401 - numba's intrinsic
    """Return a compiled function that computes a tile of `rows` by 16 `vectors` numbers."""

    def tile(typing_context, a, a_row, a_k, b, b_k, c, c_row, start, count):  # noqa: ANN001, ANN202
        return types.void(*[types.int64] * 9), generate

    def generate(context, builder, signature, arguments):  # noqa: ANN001, ANN202
        a, a_row, a_k, b, b_k, c, c_row, start, count = arguments
        tools = _Vectors(builder)
        starts = [tools.spread(start, tools.number(r)) for r in range(rows)]
        sums = [[cgutils.alloca_once_value(builder, s) for _ in range(vectors)] for s in starts]
        with cgutils.for_range(builder, count) as loop:
            right = [tools.load(b, tools.place(loop.index, b_k, v)) for v in range(vectors)]
            for r in range(rows):
                place = builder.add(
                    builder.mul(loop.index, a_k), builder.mul(tools.number(r), a_row)
                )
                left = tools.spread(a, place)
                for v in range(vectors):
                    total = builder.load(sums[r][v])
                    builder.store(tools.fma(left, right[v], total), sums[r][v])
        for r in range(rows):
            for v in range(vectors):
                place = tools.place(tools.number(r), c_row, v)
                tools.store(builder.load(sums[r][v]), c, place)
        return context.get_dummy_value()

    return intrinsic(tile)


class _Vectors:
    """LLVM's instructions for vectors of float32 at addresses that are integers."""

    def __init__(self, builder: Any) -> None:  # noqa: ANN401 - llvmlite's builder
        self._builder = builder
        self._float = ir.FloatType()
        self._vector = ir.VectorType(self._float, LANES)
        kind = ir.FunctionType(self._vector, [self._vector] * 3)
        name = f"llvm.fma.v{LANES}f32"
        module = builder.module
        self._fma = module.globals.get(name) or ir.Function(module, kind, name)

    @staticmethod
    def number(value: int) -> Any:  # noqa: ANN401
        return ir.IntType(64)(value)

    def place(self, row: Any, stride: Any, vector: int) -> Any:  # noqa: ANN401
        return self._builder.add(self._builder.mul(row, stride), self.number(LANES * vector))

    def load(self, base: Any, place: Any) -> Any:  # noqa: ANN401
        value = self._builder.load(self._pointer(base, place, self._vector))
        value.align = _BYTES
        return value

    def store(self, value: Any, base: Any, place: Any) -> None:  # noqa: ANN401
        self._builder.store(value, self._pointer(base, place, self._vector)).align = _BYTES

    def spread(self, base: Any, place: Any) -> Any:  # noqa: ANN401
        """Load one number into all lanes."""
        value = self._builder.load(self._pointer(base, place, self._float))
        empty = ir.Constant(self._vector, ir.Undefined)
        first = self._builder.insert_element(empty, value, ir.IntType(32)(0))
        zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        return self._builder.shuffle_vector(first, empty, zeros)

    def fma(self, a: Any, b: Any, c: Any) -> Any:  # noqa: ANN401
        return self._builder.call(self._fma, [a, b, c])

    def _pointer(self, base: Any, place: Any, kind: Any) -> Any:  # noqa: ANN401
        bytes_ = self._builder.mul(place, self.number(_BYTES))
        return self._builder.inttoptr(self._builder.add(base, bytes_), kind.as_pointer())


_tile_8x2, _tile_8x1 = _tile(_ROWS, 2), _tile(_ROWS, 1)
_tile_1x2, _tile_1x1 = _tile(1, 2), _tile(1, 1)


@kernel
def address(array: np.ndarray, place: int) -> int:
    """Return the address of a number of a contiguous float32 array."""
    return array.ctypes.data + _BYTES * place


@kernel
def multiply(
    a: int, a_row: int, a_k: int, b: int, b_k: int, c: int, start: int, rows: int, cols: int, n: int
) -> None:
    r"""Compute a matrix product on top of a start value for each row.

    $$ C_{ij} = s_i + \sum_{k<n} A_{ik} B_{kj} $$

    Args:
        a: Address of A, whose (i, k) is `i * a_row + k * a_k` numbers on.
        a_row: See `a`.
        a_k: See `a`.
        b: Address of B, whose rows are contiguous and `b_k` numbers apart.
        b_k: See `b`.
        c: Address of C, contiguous.
        start: Address of s.
        rows: Rows of C.
        cols: Columns of C, a multiple of 16.
        n: Terms of the sum.
    """
    whole = rows // _ROWS * _ROWS
    for j in range(0, cols, 2 * LANES):
        wide = j + 2 * LANES <= cols
        at_b = b + _BYTES * j
        for i in range(0, whole, _ROWS):
            at_a = a + _BYTES * i * a_row
            at_c = c + _BYTES * (i * cols + j)
            if wide:
                _tile_8x2(at_a, a_row, a_k, at_b, b_k, at_c, cols, start + _BYTES * i, n)
            else:
                _tile_8x1(at_a, a_row, a_k, at_b, b_k, at_c, cols, start + _BYTES * i, n)
        for i in range(whole, rows):
            at_a = a + _BYTES * i * a_row
            at_c = c + _BYTES * (i * cols + j)
            if wide:
                _tile_1x2(at_a, a_row, a_k, at_b, b_k, at_c, cols, start + _BYTES * i, n)
            else:
                _tile_1x1(at_a, a_row, a_k, at_b, b_k, at_c, cols, start + _BYTES * i, n)
