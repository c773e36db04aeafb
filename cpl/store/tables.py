"""How a table becomes bytes and comes back: Parquet, plain columns, nothing that can run.

A table here is a pandas frame with plain columns (booleans, integers, floats, text, bytes), its
rows numbered from 0. That is all a result needs, and it makes its digest and its reading safe.
Bytes are there for models: what they mean is for `cpl.store.models` to check, never for pandas.
"""

# pyright: standard
# pandas and pyarrow have no stubs: strict would report what they return on every line.

import hashlib
import io
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

__all__ = [
    "bytes_columns",
    "column_types",
    "decode_table",
    "encode_table",
    "same_table",
    "table_digest",
]

_NUMBERS = {
    "bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64",
    "float32", "float64",
}  # fmt: skip


def encode_table(table: pd.DataFrame) -> bytes:
    """Write a table as one Parquet file (zstd), without any metadata of pandas or Arrow.

    Args:
        table: Plain columns (booleans, integers, floats, text, bytes) with unique text names,
            numbered from 0.

    Raises:
        ValueError: If the table holds anything else; the message names the column.

    Examples:
        >>> encode_table(pd.DataFrame({"err": [True, False]}))[:4]
        b'PAR1'
    """
    _check_plain(table)
    arrow = pa.Table.from_pandas(table, preserve_index=False).replace_schema_metadata(None)
    sink = io.BytesIO()
    pq.write_table(arrow, sink, compression="zstd", store_schema=False)
    return sink.getvalue()


def decode_table(content: bytes) -> pd.DataFrame:
    """Read a table back; what is not a plain column is refused before it reaches pandas.

    The bytes should have been checked against a digest first. Even so nothing in them can run:
    metadata is dropped unread, and extension types, whose old form carried a pickle, are refused.

    Args:
        content: A Parquet file as bytes.

    Raises:
        ValueError: If the bytes are not Parquet or hold a column that is not plain.

    Examples:
        >>> decode_table(encode_table(pd.DataFrame({"q": [0.5, 1.0]})))["q"].tolist()
        [0.5, 1.0]
    """
    try:
        arrow = pq.ParquetFile(pa.BufferReader(content)).read()
    except (pa.ArrowException, OSError) as error:
        msg = f"content must be a Parquet table: {error}"
        raise ValueError(msg) from error
    for field in arrow.schema:
        if not _is_plain_type(field.type):
            msg = f"column {field.name!r} must be plain, got {field.type}"
            raise ValueError(msg)
    table = arrow.replace_schema_metadata(None).to_pandas(ignore_metadata=True)
    _check_plain(table)
    return table


def table_digest(table: pd.DataFrame) -> str:
    """Digest what a table says, not how a file of it happens to be written.

    SHA-256 over names, types and values in order. Another compression level or another version of
    Parquet gives the same digest; one changed value, type, name or order gives another. All NaN
    are one.

    Args:
        table: As for :func:`encode_table`.

    Returns:
        64 hexadecimal digits.

    Raises:
        ValueError: If the table holds anything but plain columns.

    Examples:
        >>> a, b = pd.DataFrame({"n": [1, 2]}), pd.DataFrame({"n": [1.0, 2.0]})
        >>> table_digest(a) == table_digest(a.copy()), table_digest(a) == table_digest(b)
        (True, False)
    """
    _check_plain(table)
    digest = hashlib.sha256(f"{len(table)} rows\n".encode())
    for name, column in _columns(table):
        kind = _SPELLED.get(_kind(column), column.dtype.name)
        digest.update(f"{name!r} {kind}\n".encode())
        digest.update(_number_bytes(column) if kind not in _BYTES else _BYTES[kind](column))
    return digest.hexdigest()


def same_table(
    table: pd.DataFrame, other: pd.DataFrame, *, rtol: float = 1e-9, atol: float = 1e-12
) -> str | None:
    """Compare two tables: what is discrete must be equal, floats to tolerance.

    Args:
        table: What was recomputed.
        other: What was stored.
        rtol: Relative tolerance of floats.
        atol: Absolute tolerance of floats.

    Returns:
        None if they agree, else one line that names the first column and row that differ.

    Examples:
        >>> same_table(pd.DataFrame({"n": [1, 2]}), pd.DataFrame({"n": [1, 3]}))
        "column 'n', row 1: 2 against 3"
    """
    if list(table.columns) != list(other.columns):
        return f"columns {list(table.columns)} against {list(other.columns)}"
    if len(table) != len(other):
        return f"{len(table)} rows against {len(other)}"
    for (name, mine), (_, theirs) in zip(_columns(table), _columns(other), strict=True):
        if _kind(mine) != _kind(theirs):
            return f"column {name!r}: {mine.dtype} against {theirs.dtype}"
        if _kind(mine) == "f":
            equal = np.isclose(mine, theirs, rtol=rtol, atol=atol, equal_nan=True)
        else:
            same = (mine == theirs).to_numpy(dtype=bool, na_value=False)
            equal = same | (mine.isna() & theirs.isna()).to_numpy(dtype=bool)
        if not equal.all():
            row = int(np.argmin(equal))
            if _kind(mine) == "y":
                return f"column {name!r}, row {row}: other bytes"
            return f"column {name!r}, row {row}: {mine.iloc[row]} against {theirs.iloc[row]}"
    return None


def column_types(table: pd.DataFrame) -> dict[str, str]:
    """Name the type of each column, in order.

    Examples:
        >>> column_types(pd.DataFrame({"n": [1], "q": [0.5], "rule": ["fixed"]}))
        {'n': 'int64', 'q': 'float64', 'rule': 'str'}
    """
    return {
        name: "bytes" if _kind(column) == "y" else str(column.dtype)
        for name, column in _columns(table)
    }


def bytes_columns(table: pd.DataFrame) -> tuple[str, ...]:
    """Name the columns that hold bytes.

    Examples:
        >>> bytes_columns(pd.DataFrame({"seed": [0], "model": [b"weights"]}))
        ('model',)
    """
    return tuple(name for name, column in _columns(table) if _kind(column) == "y")


def _check_plain(table: Any) -> None:  # noqa: ANN401 - whatever a caller brings
    if not isinstance(table, pd.DataFrame):
        msg = f"table must be a pandas DataFrame, got {type(table).__name__}"
        raise ValueError(msg)
    if not table.index.equals(pd.RangeIndex(len(table))) or table.index.nlevels > 1:
        msg = f"table must be numbered from 0 (use reset_index), got index {table.index!r}"
        raise ValueError(msg)
    if not table.columns.is_unique or not all(isinstance(name, str) for name in table.columns):
        msg = f"columns must have unique text names, got {list(table.columns)}"
        raise ValueError(msg)
    for name, column in _columns(table):
        if _kind(column) not in "ty" and column.dtype.name not in _NUMBERS:
            msg = f"column {name!r} must hold booleans, numbers, text or bytes, got {column.dtype}"
            raise ValueError(msg)


def _columns(table: pd.DataFrame) -> Iterator[tuple[str, pd.Series]]:
    return ((str(name), column) for name, column in table.items())


def _is_text(column: pd.Series) -> bool:
    if isinstance(column.dtype, pd.StringDtype):
        return True
    values = column.to_numpy() if column.dtype == object else ()
    return column.dtype == object and all(v is None or isinstance(v, str) for v in values)


def _is_bytes(column: pd.Series) -> bool:
    return column.dtype == object and all(isinstance(v, bytes) for v in column.to_numpy())


def _kind(column: pd.Series) -> str:
    """Return one letter: text, bytes (y), boolean, integer or float (of any width)."""
    if _is_text(column):
        return "t"
    if _is_bytes(column):
        return "y"
    return {"u": "i"}.get(column.dtype.kind, column.dtype.kind)


def _number_bytes(column: pd.Series) -> bytes:
    values = column.to_numpy()
    if values.dtype.kind == "f":
        values = np.where(np.isnan(values), np.asarray(np.nan, dtype=values.dtype), values)
    return values.astype(values.dtype.newbyteorder("<")).tobytes()


def _text_bytes(column: pd.Series) -> bytes:
    # Few texts stand in many rows: each is spelled once. A missing one has the code -1, the last.
    codes, texts = pd.factorize(column)
    raws = [str(text).encode() for text in texts]
    spelled = np.array([*(b"%d:%b;" % (len(raw), raw) for raw in raws), b"-;"], dtype=object)
    return b"".join(spelled[codes])


def _raw_bytes(column: pd.Series) -> bytes:
    return b"".join(b"%d:%b;" % (len(v), v) for v in column)


_SPELLED = {"t": "text", "y": "bytes"}
_BYTES = {"text": _text_bytes, "bytes": _raw_bytes}


def _is_plain_type(kind: pa.DataType) -> bool:
    return (
        pa.types.is_boolean(kind)
        or pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_string(kind)
        or pa.types.is_large_string(kind)
        or pa.types.is_binary(kind)
    )
