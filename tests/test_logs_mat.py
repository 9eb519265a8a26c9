"""MAT files byte by byte: what is read as SciPy reads it, and every damage by its sentence."""

import struct
import zlib

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from robotmodels.errors import InvalidValueError
from robotmodels.logs.mat_file import read_mat

MATRIX, COMPRESSED = 14, 15
INT8, INT32, UINT32, DOUBLE, UTF8, UTF16 = 1, 5, 6, 9, 16, 17
CELL, STRUCTURE, CHARACTERS, NUMBERS = 1, 2, 4, 6


def element(kind, data, order="<", size=None):
    size = len(data) if size is None else size
    padding = b"" if kind == COMPRESSED else b"\0" * (-len(data) % 8)
    return struct.pack(f"{order}II", kind, size) + data + padding


def integers(*values, order="<", kind=INT32):
    return element(kind, struct.pack(f"{order}{len(values)}i", *values), order)


def doubles(*values, order="<"):
    return element(DOUBLE, struct.pack(f"{order}{len(values)}d", *values), order)


def matrix(*parts, name=b"q", shape=(1, 2), kind=NUMBERS, order="<"):
    head = [
        element(UINT32, struct.pack(f"{order}II", kind, 0), order),
        integers(*shape, order=order), element(INT8, name, order),
    ]  # fmt: skip
    return element(MATRIX, b"".join([*head, *parts]), order)


def packed(data, order="<", level=6):
    return element(COMPRESSED, zlib.compress(data, level), order)


def written(path, *elements, order="<"):
    mark = b"IM" if order == "<" else b"MI"
    path.write_bytes(b" " * 124 + struct.pack(f"{order}H", 0x100) + mark + b"".join(elements))
    return path


GOOD = matrix(doubles(1.0, 2.0))


@pytest.mark.parametrize("order", ["<", ">"])
def test_both_orders_of_bytes(tmp_path, order):
    q = matrix(doubles(*range(6), order=order), shape=(2, 3), order=order)
    both = written(tmp_path / "a.mat", q, packed(
        matrix(doubles(7.0, order=order), name=b"t", shape=(1, 1), order=order), order
    ), order=order)  # fmt: skip
    found = read_mat(both)
    assert np.array_equal(found["q"], [[0.0, 2.0, 4.0], [1.0, 3.0, 5.0]])
    assert found["t"] == 7.0


@pytest.mark.parametrize("compressed", [False, True])
def test_all_that_scipy_writes(tmp_path, compressed):
    values = {
        "whole": np.arange(-3, 4, dtype=np.int16).reshape(1, -1),
        "single": np.array([[0.1, 0.2]], dtype=np.float32),
        "complex": np.array([[1.0 + 2.0j], [3.0 - 4.0j]]),
        "cube": np.arange(24.0).reshape(2, 3, 4),
        "empty": np.zeros((0, 3)),
        "word": np.array(["time"]),
        "words": np.array(["abc", "xyz"]),
    }
    savemat(tmp_path / "a.mat", values, do_compression=compressed)
    found, expected = read_mat(tmp_path / "a.mat"), loadmat(tmp_path / "a.mat")
    for name in values:
        if not name.startswith("word"):
            assert np.array_equal(found[name], expected[name])
            assert found[name].dtype == expected[name].dtype
    assert found["word"].tolist() == ["time"]
    assert found["words"].tolist() == ["abc", "xyz"]


def test_names_in_cells_and_structures(tmp_path):
    cells = np.array([["q1", "q2", 3.0]], dtype=object)
    savemat(tmp_path / "a.mat", {"names": cells, "log": {"arm": {"q": [1.0, 2.0]}, "unit": "rad"}})
    found = read_mat(tmp_path / "a.mat")
    assert found["names"].tolist() == ["q1", "q2", "3.0"]
    assert found["log.arm.q"].tolist() == [[1.0, 2.0]]
    assert found["log.unit"].tolist() == ["rad"]


def test_what_no_log_is_made_of_is_left_out(tmp_path):
    several = np.array([(1.0,), (2.0,)], dtype=[("q", "f8")])
    savemat(tmp_path / "a.mat", {"several": several, "t": [0.0, 0.1]})
    assert list(read_mat(tmp_path / "a.mat")) == ["t"]
    nothing = matrix(element(MATRIX, b""), kind=CELL, shape=(1, 1), name=b"empty")
    found = read_mat(written(tmp_path / "b.mat", element(7, b"\0" * 4), nothing, GOOD, b"\0" * 4))
    assert found["empty"].size == 1
    assert found["q"].tolist() == [[1.0, 2.0]]


@pytest.mark.parametrize("kind", [3, 5, 16, 17])
def test_objects_of_another_layout_are_left_out(tmp_path, kind):
    # a table or a function has texts where arrays have their shape
    parts = element(UINT32, struct.pack("<II", kind, 0)) + element(INT8, b"table")
    odd = element(MATRIX, parts + element(INT8, b"MCOS"))
    assert list(read_mat(written(tmp_path / "a.mat", odd, GOOD))) == ["q"]


def test_letters_of_two_bytes(tmp_path):
    for order in "<>":
        text = "µ°".encode("utf-16-le" if order == "<" else "utf-16-be")
        letters = element(UTF16, text, order)
        path = written(
            tmp_path / "a.mat", matrix(letters, kind=CHARACTERS, order=order), order=order
        )
        assert read_mat(path)["q"].tolist() == ["µ°"]


def field_names(width, letters):
    return integers(width), element(INT8, letters)


def nested(depth):
    inner = GOOD
    for _ in range(depth):
        inner = matrix(*field_names(2, b"a\0"), inner, kind=STRUCTURE, shape=(1, 1), name=b"")
    return inner


short = struct.pack("<HH", INT32, 8) + b"\0" * 4
DAMAGES = {
    "it ends within a tag": [GOOD, b"\1\0\0\0"],
    "8 bytes in a tag of four": [short],
    "an element of 100 bytes where 8 are left": [element(MATRIX, b"\0" * 8, size=100)],
    "compressed data within compressed data": [packed(packed(GOOD))],
    "compressed data without a tag": [packed(b"\0" * 4)],
    "become more than": [packed(struct.pack("<II", MATRIX, 1 << 31) + b"\0" * 64)],
    "of another length than is said": [packed(element(MATRIX, b"\0" * 8, size=64))],
    "structures 16 deep": [nested(18)],
    "an array without its class": [element(MATRIX, element(UINT32, b""))],
    "an array that is cut off": [element(MATRIX, element(UINT32, b"\6\0\0\0\0\0\0\0"))],
    r"an array of shape \(2,\)": [matrix(doubles(1.0, 2.0), shape=(2,))],
    r"an array of shape \(1, -2\)": [matrix(doubles(1.0, 2.0), shape=(1, -2))],
    "2 numbers for an array of 3": [matrix(doubles(1.0, 2.0), shape=(1, 3))],
    "1 cells for a shape": [matrix(GOOD, kind=CELL)],
    "names of fields of another length": [
        matrix(*field_names(3, b"ab\0\0"), GOOD, kind=STRUCTURE, shape=(1, 1))
    ],
    "the field ab has no array": [
        matrix(*field_names(3, b"ab\0"), doubles(1.0), kind=STRUCTURE, shape=(1, 1))
    ],
    "numbers of a type 77 that does not exist": [matrix(element(77, b"\0" * 16))],
    "9 bytes of numbers of 8 bytes": [matrix(element(DOUBLE, b"\0" * 9))],
    "sizes that are no whole numbers": [
        element(MATRIX, element(UINT32, b"\6\0\0\0\0\0\0\0") + doubles(1.0, 2.0))
    ],
    "letters of a type 9": [matrix(doubles(1.0), kind=CHARACTERS, shape=(1, 1))],
    "incorrect header check": [element(COMPRESSED, b"no such thing")],
}


@pytest.mark.parametrize("words", DAMAGES)
def test_damages_are_named(tmp_path, words):
    path = written(tmp_path / "a.mat", *DAMAGES[words])
    with pytest.raises(InvalidValueError, match=rf"damaged \(.*{words}.*write it again"):
        read_mat(path)


def test_a_file_that_is_cut_off_anywhere_is_refused_or_read_as_far(tmp_path):
    whole = b"".join([GOOD, packed(matrix(doubles(3.0, 4.0), name=b"t")), nested(2)])
    for size in range(len(whole)):
        try:
            found = read_mat(written(tmp_path / "a.mat", whole[:size]))
        except InvalidValueError as error:
            assert "damaged" in str(error)  # noqa: PT017
        else:
            assert set(found) <= {"q", "t", "a.a.q"}
