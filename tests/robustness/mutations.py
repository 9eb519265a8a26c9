"""Good files damaged at random, with their structure known: trees, lists, cells, arrays, bytes.

Every function takes a ``random.Random`` (or Hypothesis's) and is a pure function of it.
"""

import copy
import io
import re
import xml.etree.ElementTree as ET
import zipfile

import numpy as np

NUMBERS = (
    "0", "-0", "1", "-1", "1e999999", "-1e999999", "1e308", "-1.7e308", "1e-320", "5e-324", "nan",
    "inf", "-Infinity", "1e", "0x10", "1_0", "١", "1,5", "1.5.2", "--1", "+1", "1 2", "", " ",
    "1e200", "1e100", "1e16", "3.14159265358979", "1e-9", "True", "None", "9" * 400, "1d3", "½",
)  # fmt: skip
WORDS = (
    "", " ", "\x00", "\x7f", "é", "\ud83e\udd16".encode("utf-16", "surrogatepass").decode("utf-16"),
    "base", "tool", "world", "joint_1", "../../etc/passwd", "file:///etc/hosts",
    "http://localhost/x.stl", "package://a/b.stl", "package://../../x", "${x}", "$(find x)",
    "a" * 3000, "<", "&amp;", "'", '"', "nan", "0", "%s", "{0}", "{x}", "\\", "\n", "\u202e",
)  # fmt: skip
TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar", "mimic", "")


def number(random):
    """A number as text, seldom a kind one."""
    if random.random() < 0.3:
        return repr(random.choice((1.0, -1.0)) * 10.0 ** random.randint(-330, 308))
    return random.choice(NUMBERS)


def bytes_of(random, data, most=8):
    """Some bytes changed, doubled, cut or put elsewhere."""
    data = bytearray(data)
    for _ in range(random.randint(1, most)):
        if not data:
            break
        k, kind = random.randrange(len(data)), random.randrange(6)
        if kind == 0:
            data[k] = random.randrange(256)
        elif kind == 1:
            data[k] ^= 1 << random.randrange(8)
        elif kind == 2:
            del data[k : k + random.randint(1, 16)]
        elif kind == 3:
            data[k:k] = data[k : k + random.randint(1, 64)]
        elif kind == 4:
            data[k : k + 4] = random.choice((b"\xff\xff\xff\xff", b"\x00\x00\x00\x00",
                                             b"\x7f\xff\xff\xff", b"\x00\x00\x00\x80"))  # fmt: skip
        else:
            del data[k:]
    return bytes(data)


# --- URDF -------------------------------------------------------------------------------------


def urdf(random, text):
    """A tree of XML with elements and attributes changed."""
    root = ET.fromstring(text)
    for _ in range(random.randint(1, 4)):
        _change_element(random, root)
    changed = ET.tostring(root, encoding="unicode")
    if random.random() < 0.08:
        raw = bytes_of(random, changed.encode("utf-8", "replace"))
        changed = raw.decode("utf-8", "replace")
    if random.random() < 0.03:
        changed = '<!DOCTYPE r [<!ENTITY a "aaa">]>' + changed
    return changed


def _change_element(random, root):
    everything = list(root.iter())
    element = random.choice(everything)
    parents = {child: parent for parent in everything for child in parent}
    kind = random.randrange(9)
    if kind <= 3 and element.attrib:
        key = random.choice(sorted(element.attrib))
        element.set(key, _attribute(random, key, element.get(key), everything))
    elif kind == 4 and element in parents:
        parents[element].remove(element)
    elif kind == 5 and element in parents:
        parents[element].insert(random.randrange(len(parents[element]) + 1), copy.deepcopy(element))
    elif kind == 6:
        other = random.choice(everything)
        if element in parents and element not in other.iter() and other not in element.iter():
            other.append(copy.deepcopy(element))
    elif kind == 7 and element.attrib:
        del element.attrib[random.choice(sorted(element.attrib))]
    elif kind == 8:
        element.tag = random.choice(
            ("robot", "link", "joint", "mimic", "origin", "x", "geometry", "mesh", "sphere", "box")
        )


def _attribute(random, key, value, everything):
    if key in ("name", "link", "joint"):
        known = [e.get(key) or e.get("name") or "" for e in everything]
        return random.choice((random.choice(known), _printable(random.choice(WORDS))))
    if key == "type":
        return random.choice(TYPES)
    if key == "filename":
        return _printable(random.choice(WORDS))
    cells = value.split()
    if cells and random.random() < 0.8:
        cells[random.randrange(len(cells))] = number(random)
        return " ".join(cells)
    return random.choice((number(random), _printable(random.choice(WORDS))))


def _printable(word):
    return "".join(letter for letter in word if letter >= " ")


# --- SYMORO -----------------------------------------------------------------------------------


def par(random, text):
    """Lines of a ``.par`` file with entries changed, doubled and lost."""
    lines = text.split("\n")
    for _ in range(random.randint(1, 4)):
        k, kind = random.randrange(len(lines)), random.randrange(8)
        if kind <= 3 and "{" in lines[k]:
            head, _, rest = lines[k].partition("{")
            cells = rest.rstrip().rstrip("}").split(",")
            cells[random.randrange(len(cells))] = _entry(random)
            lines[k] = head + "{" + ",".join(cells) + "}"
        elif kind == 4:
            lines.insert(random.randrange(len(lines) + 1), lines[k])
        elif kind == 5 and len(lines) > 1:
            del lines[k]
        elif kind == 6 and "=" in lines[k]:
            lines[k] = lines[k].partition("=")[0] + "= " + number(random)
        else:
            place = random.randrange(len(lines[k]) + 1)
            lines[k] = lines[k][:place] + random.choice("{}()=,;*^\\\n\"'#") + lines[k][place:]
        if not lines:
            break
    return "\n".join(lines)


def _entry(random):
    return random.choice((
        number(random), "pi", "th1", "th1 + pi/2", "-th1", "2*th1", "1/0", "sqrt(-1)", "0**-1",
        "9**9**9", "9**9**9**9", "1e200*1e200", "(-8)**(1/3)", "atan2(0,0)", "tan(pi/2)",
        "__import__('os')", "lambda: 0", "[1]", "x.y", "sin(", "(" * 200, "-" * 900 + "1",
        "(" * 90 + "1" + ")" * 90, "+".join(["1"] * 400), "10**400", "10**400*0.0", "cos(1e400)",
        "sin(10**400)", "1 if 1 else 2", "é", "D3", "1j", "'a'", "True", "0x1F", "1_000", "\x0c",
    ))  # fmt: skip


# --- tables of numbers --------------------------------------------------------------------------


def table(random, text):
    """A CSV with cells, rows, header and delimiters changed."""
    rows = [line.split(",") for line in text.split("\n")]
    for _ in range(random.randint(1, 5)):
        k, kind = random.randrange(len(rows)), random.randrange(9)
        column = random.randrange(len(rows[k]))
        if kind <= 2:
            rows[k][column] = random.choice((number(random), random.choice(WORDS), "[1, 2]", "#"))
        elif kind == 3 and len(rows) > 1:
            del rows[k]
        elif kind == 4:
            rows.insert(k, list(rows[k]))
        elif kind == 5 and len(rows[k]) > 1:
            del rows[k][column]
        elif kind == 6:
            rows[0][random.randrange(len(rows[0]))] = random.choice((
                "q1", "q2", "tau1", "t", "time [ms]", "q1 [deg]", "tau1 [mNm]", "position", "name",
                "%time", "header.stamp.secs", "header.stamp.nsecs", "q[99999999999]", "q²", "q٣",
                "x", "q", "", '"q1', "q1 (", "v1", "dq2", "joint_1_position", "a/b/position", "/",
            ))  # fmt: skip
        elif kind == 7:
            for row in rows:
                row[:] = row[: column + 1]
        else:
            value = number(random)
            for row in rows[1:]:
                if column < len(row):
                    row[column] = value
    mark = random.choice((",", ",", ",", ",", ";", "\t", " "))
    text = random.choice(("\n", "\n", "\n", "\r\n", "\r")).join(mark.join(row) for row in rows)
    kind = random.randrange(20)
    if kind == 0:
        return bytes_of(random, text.encode("utf-8", "replace"))
    if kind == 1:
        return text.encode("utf-16")
    if kind == 2:
        return b"\xef\xbb\xbf" + text.encode("utf-8", "replace")
    return text.encode("utf-8", "replace")


# --- arrays -------------------------------------------------------------------------------------


def arrays(random, good):
    """A mapping of arrays, some of another shape, kind or name."""
    with np.errstate(all="ignore"):
        return _arrays(random, good)


def _arrays(random, good):
    changed = dict(good)
    for _ in range(random.randint(1, 3)):
        name = random.choice(sorted(changed))
        value = np.asarray(changed[name])
        kind = random.randrange(12)
        if kind == 0:
            changed[name] = value.T
        elif kind == 1:
            changed[name] = value[..., None]
        elif kind == 2 and value.ndim:
            changed[name] = value[:0]
        elif kind == 3:
            changed[name] = value.astype(random.choice(
                (np.float32, np.float16, np.int8, np.uint64, np.bool_, np.complex128, "S3", "U2")
            )) if value.dtype.kind == "f" and np.isfinite(value).all() else value  # fmt: skip
        elif kind == 4 and value.size and value.dtype.kind == "f":
            changed[name] = value = value.copy()
            bad = random.choice((np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324, 1e200))
            value.reshape(-1)[random.randrange(value.size)] = bad
        elif kind == 5 and value.dtype.kind == "f":
            changed[name] = np.full_like(
                value, random.choice((0.0, 1e308, -1e308, 1e-320, 1e150, np.nan, 3.0))
            )
        elif kind == 6 and len(changed) > 1:
            del changed[name]
        elif kind == 7:
            changed[
                random.choice(("q", "tau", "t", "q1", "time", "v", "name", "x", "position"))
            ] = value
        elif kind == 8:
            changed[name] = np.array(random.choice((0.0, 1, "word", True, 1e308)))
        elif kind == 9 and value.ndim and len(value) > 2:
            changed[name] = value[: len(value) // 2]
        elif kind == 10:
            changed[name] = np.zeros((2, 2, 2))
        elif kind == 11 and value.dtype.kind == "f" and value.ndim:
            changed[name] = value[::-1]
    return changed


def npz(random, good):
    """Bytes of an NPZ with arrays and then perhaps bytes changed."""
    stream = io.BytesIO()
    save = np.savez_compressed if random.random() < 0.3 else np.savez
    save(stream, **arrays(random, good))
    data = stream.getvalue()
    kind = random.randrange(8)
    if kind <= 1:
        return bytes_of(random, data)
    if kind == 2:  # a header of an array that promises other things
        return _npy_header(random, good)
    return data


def _npy_header(random, good):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, value in good.items():
            array = io.BytesIO()
            np.save(array, value)
            raw = array.getvalue()
            if random.random() < 0.6:
                old = re.search(rb"\{.*?\}", raw)[0]
                new = random.choice((
                    b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000, 1000), }",
                    b"{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }",
                    b"{'descr': '|O', 'fortran_order': False, 'shape': (3,), }",
                    b"{'descr': '<U9', 'fortran_order': 1, 'shape': (3,), }",
                    b"{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (3,), }",
                    b"{'descr': '<M8[ns]', 'fortran_order': False, 'shape': (3,), }",
                    b"{'shape': 3}", b"", b"[" * 300, b"{'descr': " + b"(" * 90,
                ))  # fmt: skip
                raw = raw.replace(old, new.ljust(len(old))[: max(len(old), len(new))])
            archive.writestr(name + ".npy", raw)
    return stream.getvalue()


def mat(random, good):
    """Bytes of a MAT file with arrays changed; of damaged bytes SciPy's reader may crash."""
    from scipy.io import savemat

    changed = {
        name: value for name, value in arrays(random, good).items()
        if np.asarray(value).dtype.kind != "f" or np.asarray(value).dtype.itemsize > 2
    }  # fmt: skip
    if random.random() < 0.2:
        changed = {"log": changed, "list": [1, "a", np.zeros(3)]}
    stream = io.BytesIO()
    savemat(stream, changed or {"x": 1.0}, do_compression=random.random() < 0.3)
    return stream.getvalue()


def parquet(random, good):
    """Bytes of a Parquet file with columns and then perhaps bytes changed."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = {}
    for name, value in arrays(random, good).items():
        value = np.asarray(value)
        if value.dtype.kind in "cS" or value.ndim > 2:
            value = np.zeros(len(value)) if value.ndim else np.zeros(3)
        if value.dtype.kind == "u":  # Arrow makes signed ones of Python's numbers
            value = value.astype(np.float64)
        cells = value.tolist() if value.ndim else [value.item()]
        if cells and random.random() < 0.15:
            cells[random.randrange(len(cells))] = None
        if cells and isinstance(cells[-1], list) and random.random() < 0.15:
            cells[-1] = cells[-1][:-1]
        columns[name] = cells
    length = max(map(len, columns.values()))
    columns = {name: (cells + [None] * length)[:length] for name, cells in columns.items()}
    if random.random() < 0.1:
        columns["stamp"] = [np.datetime64(k, "ms") for k in range(length)]
    stream = io.BytesIO()
    pq.write_table(pa.table(columns), stream, compression=random.choice(("none", "snappy")))
    return bytes_of(random, stream.getvalue()) if random.random() < 0.4 else stream.getvalue()


# --- rows and JSON --------------------------------------------------------------------------------

VALUES = (
    None, True, False, 0, 1, -1, 2, 3, 10**400, 1e308, -1e308, 5e-324, float("nan"), float("inf"),
    1j, "", "0", "1.5", "nan", b"1", [], [1.0], (1.0, 2.0), {}, {"a": 1}, object, np.nan,
    np.float32(1.0), np.int8(3), np.array(1.0), np.array([1.0]), np.array([]), np.zeros((2, 2)),
    np.array(1j), np.array("a"), np.array([None]), np.ma.masked, np.datetime64("2020"),
)  # fmt: skip


def rows(random, good):
    """Rows of a geometric table with entries changed."""
    changed = copy.deepcopy(good)
    for _ in range(random.randint(1, 3)):
        k, kind = random.randrange(len(changed)), random.randrange(6)
        row = changed[k]
        keys = ("sigma", "alpha", "d", "theta", "r", "gamma", "b", "beta", "antecedent", "mu",
                "name", "lower", "upper", "velocity", "effort", "x", "Theta", 3)  # fmt: skip
        if kind <= 3 and isinstance(row, dict):
            row[random.choice(keys)] = random.choice(VALUES)
        elif kind == 4:
            changed[k] = random.choice(VALUES)
        elif isinstance(row, dict) and row:
            del row[random.choice(sorted(row, key=str))]
        if not changed:
            break
    return changed


def json_value(random, value):
    """A tree of JSON with a value somewhere changed."""
    value = copy.deepcopy(value)
    for _ in range(random.randint(1, 3)):
        _change_json(random, value)
    return value


def _change_json(random, value):
    while True:
        keys = sorted(value) if isinstance(value, dict) else range(len(value))
        if not keys:
            return
        key = random.choice(keys)
        inner = value[key]
        if isinstance(inner, dict | list) and random.random() < 0.7:
            value = inner
            continue
        if random.random() < 0.25:
            del value[key]
        else:
            value[key] = random.choice((
                None, True, 0, -1, 1, 1e308, -1e308, 10**400, float("nan"), float("inf"), "", "1",
                "word", [], [1.0], [[1.0]], {}, {"a": 1}, "a" * 1000,
            ))  # fmt: skip
        return
