"""Arrays over plain addresses: how an exported function finds its arguments.

A host hands over one number: where a *block* of 32-bit words lies. Words are counts, or addresses
of arrays in the module's linear memory. numba's own `carray` does the same, but not without its
reference counting.
"""

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np import arrayobj

__all__ = ["bools", "floats", "longs", "singles", "unsigned", "words"]


def _view_of(kind: Any) -> Any:  # noqa: ANN401
    def view(typing_context, address, shape):  # noqa: ANN001, ANN202
        result = types.Array(kind, len(shape), "C")

        def generate(context, builder, signature, arguments):  # noqa: ANN001, ANN202
            place, sizes = arguments
            data = builder.inttoptr(place, context.get_data_type(kind).as_pointer())
            lengths = [
                context.cast(builder, size, given, types.intp)
                for size, given in zip(
                    cgutils.unpack_tuple(builder, sizes), signature.args[1], strict=True
                )
            ]
            item = context.get_constant(
                types.intp, kind.bitwidth // 8 if kind != types.bool_ else 1
            )
            strides = [item]
            for length in reversed(lengths[1:]):
                strides.insert(0, builder.mul(strides[0], length))
            array = arrayobj.make_array(result)(context, builder)
            arrayobj.populate_array(
                array, data=data, shape=lengths, strides=strides, itemsize=item, meminfo=None
            )
            return array._getvalue()

        return result(types.int32, shape), generate

    return intrinsic(view)


words: Any = _view_of(types.int32)
"""View int32 at an address, `words(address, shape)`."""
longs: Any = _view_of(types.int64)
"""View int64."""
unsigned: Any = _view_of(types.uint64)
"""View uint64."""
floats: Any = _view_of(types.float64)
"""View float64."""
singles: Any = _view_of(types.float32)
"""View float32."""
bools: Any = _view_of(types.bool_)
"""View bool."""
