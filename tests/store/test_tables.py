import hashlib
import io
import pickle

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.store import bytes_columns, decode_table, encode_table, same_table, table_digest


@pytest.fixture
def table():
    return pd.DataFrame(
        {
            "err": [True, False, True],
            "n": np.array([1, -2, 3], dtype=np.int64),
            "small": np.array([1, 2, 255], dtype=np.uint8),
            "q": [0.1, np.nan, -0.0],
            "rule": ["fixed", None, "π;:"],
        }
    )


def test_round_trip(table):
    back = decode_table(encode_table(table))
    assert same_table(back, table, rtol=0, atol=0) is None
    assert table_digest(back) == table_digest(table)
    assert [str(t) for t in back.dtypes] == [str(t) for t in table.dtypes]


def test_an_empty_table_round_trips():
    empty = pd.DataFrame({"n": np.array([], dtype=np.int64)})
    assert table_digest(decode_table(encode_table(empty))) == table_digest(empty)


@given(
    st.lists(
        st.tuples(st.integers(-(2**63), 2**63 - 1), st.floats(width=64), st.text(max_size=5)),
        max_size=8,
    )
)
def test_any_plain_values_round_trip(rows):
    table = pd.DataFrame(rows, columns=["i", "f", "s"]).astype({"i": "int64", "f": "float64"})
    table["s"] = table["s"].astype("str")
    assert table_digest(decode_table(encode_table(table))) == table_digest(table)


def test_the_digest_is_of_the_content_not_of_the_file(table):
    sink = io.BytesIO()
    pq.write_table(pa.Table.from_pandas(table), sink, compression="none", row_group_size=1)
    assert sink.getvalue() != encode_table(table)
    assert table_digest(decode_table(sink.getvalue())) == table_digest(table)


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.assign(n=[1, -2, 4]),
        lambda t: t.assign(q=[0.1, np.nan, 0.0]),
        lambda t: t.assign(n=t.n.astype("int32")),
        lambda t: t.assign(rule=["fixed", "", "π;:"]),
        lambda t: t.assign(err=t.err.astype("uint8")),
        lambda t: t[["n", "err", "small", "q", "rule"]],
        lambda t: t.rename(columns={"n": "m"}),
        lambda t: t.iloc[::-1].reset_index(drop=True),
        lambda t: t.iloc[:2],
    ],
    ids=["value", "zero-sign", "width", "missing-text", "type", "order", "name", "rows", "fewer"],
)
def test_any_change_of_content_changes_the_digest(table, change):
    assert table_digest(change(table)) != table_digest(table)


@pytest.mark.parametrize("dtype", ["str", "string[python]", object])
@given(
    texts=st.lists(
        st.none() | st.sampled_from(["", "a", "a\0", "π;:", "-"]) | st.text(), max_size=9
    )
)
def test_text_is_spelled_cell_by_cell(texts, dtype):
    column = pd.Series(texts, dtype=dtype)
    column = pd.concat([column, column[::-1]], ignore_index=True)  # two pieces in memory
    cells = [*texts, *reversed(texts)]
    spelled = "".join("-;" if t is None else f"{len(t.encode())}:{t};" for t in cells)
    said = f"{len(cells)} rows\n'rule' text\n{spelled}"
    digest = hashlib.sha256(said.encode()).hexdigest()
    assert table_digest(pd.DataFrame({"rule": column})) == digest


def test_text_cannot_be_shifted_between_rows():
    first, second = pd.DataFrame({"a": ["ab", "c"]}), pd.DataFrame({"a": ["a", "bc"]})
    assert table_digest(first) != table_digest(second)


@pytest.mark.parametrize(
    ("bad", "named"),
    [
        (pd.DataFrame({"x": [{1}]}), "column 'x'"),
        (pd.DataFrame({"x": pd.to_datetime(["2026-01-01"])}), "column 'x'"),
        (pd.DataFrame({"x": pd.Categorical(["a"])}), "column 'x'"),
        (pd.DataFrame({"x": [1j]}), "column 'x'"),
        (pd.DataFrame({"x": [1]}, index=[5]), "numbered from 0"),
        (pd.DataFrame([[1, 2]], columns=["x", "x"]), "unique"),
        (pd.DataFrame({0: [1]}), "text names"),
        ([1, 2], "DataFrame"),
    ],
)
def test_tables_that_are_not_plain_are_refused(bad, named):
    for function in (encode_table, table_digest):
        with pytest.raises(ValueError, match=named):
            function(bad)


def test_same_table_is_exact_for_what_is_discrete_and_tolerant_for_floats(table):
    assert same_table(table.assign(q=table.q * (1 + 1e-12)), table) is None
    assert "column 'q', row 0" in str(same_table(table.assign(q=table.q * 1.001), table))
    assert "column 'err'" in str(same_table(table.assign(err=~table.err), table))
    assert "column 'rule', row 1" in str(
        same_table(table.assign(rule=["fixed", "x", "π;:"]), table)
    )
    assert "against 2" in str(same_table(table, table.iloc[:2]))
    assert "columns" in str(same_table(table, table.drop(columns="n")))
    assert "column 'n'" in str(same_table(table.assign(n=table.n * 1.0), table))


@pytest.mark.parametrize("content", [b"", b"PAR1", b"\x80\x04N.", b"PAR1" + b"\0" * 64 + b"PAR1"])
def test_what_is_not_parquet_is_refused(content):
    with pytest.raises(ValueError, match="content must be a Parquet table"):
        decode_table(content)


class Bomb:
    exploded = False

    def __reduce__(self):
        return (setattr, (Bomb, "exploded", True))


@pytest.mark.parametrize("name", [b"arrow.py_extension_type", b"cpl.unknown"])
def test_a_pickle_in_the_metadata_is_never_loaded(name):
    """The way in of CVE-2023-47248, and its neighbours in the metadata of pandas."""
    bomb = pickle.dumps(Bomb())
    field = pa.field(
        "x",
        pa.int64(),
        metadata={b"ARROW:extension:name": name, b"ARROW:extension:metadata": bomb},
    )
    schema = pa.schema([field], metadata={b"pandas": bomb})
    sink = io.BytesIO()
    pq.write_table(pa.table([pa.array([1])], schema=schema), sink)
    assert decode_table(sink.getvalue())["x"].tolist() == [1]
    assert not Bomb.exploded


def test_nested_columns_are_refused_before_pandas_sees_them():
    for values in ([[1]], [{"a": 1}]):
        sink = io.BytesIO()
        pq.write_table(pa.table({"x": values}), sink)
        with pytest.raises(ValueError, match="column 'x' must be plain"):
            decode_table(sink.getvalue())


def test_bytes_round_trip_and_count_in_the_digest():
    table = pd.DataFrame({"seed": [0, 1], "model": [b"", bytes(range(256))]})
    back = decode_table(encode_table(table))
    assert back["model"].tolist() == table["model"].tolist()
    assert table_digest(back) == table_digest(table)
    other = table.assign(model=[b"", bytes(256)])
    assert table_digest(other) != table_digest(table)
    assert same_table(other, table) == "column 'model', row 1: other bytes"
    assert bytes_columns(table) == ("model",)


def test_bytes_and_text_differ_in_the_digest():
    text, raw = pd.DataFrame({"x": ["ab"]}), pd.DataFrame({"x": [b"ab"]})
    assert table_digest(text) != table_digest(raw)


def test_a_column_of_bytes_and_text_is_refused():
    with pytest.raises(ValueError, match="column 'x' must hold"):
        encode_table(pd.DataFrame({"x": np.array([b"a", "b"], dtype=object)}))
