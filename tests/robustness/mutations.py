"""Good files damaged at random: tokens of text, bytes, arrays and rows of tables.

Every function takes a ``random.Random`` (or Hypothesis's) and is a pure function of it.
"""

import copy
import io
import re

import numpy as np

NUMBERS = (
    "0", "-0", "1", "-1", "1e999999", "-1e999999", "1e308", "-1.7e308", "1e-320", "nan", "inf",
    "-Infinity", "1e", "0x10", "1_0", "١", "1,5", "1.5.2", "--1", "+1", "1 2", "", " ", "1e200",
    "1e16", "True", "None", "9" * 400, "1d3", "½",
)  # fmt: skip
WORDS = (
    "", "\x00", "\x7f", "é", "base", "tool", "world", "joint_1", "../../etc/passwd", "${x}",
    "file:///etc/hosts", "package://../../x", "a" * 3000, "<", "&amp;", "'", '"', "%s", "{x}", "\\",
    "\n", "\u202e", "(", ")", "}", ",", ";", "=", "#", "revolute", "planar", "th1", "-th1", "1/0",
    "sqrt(-1)", "9**9**9**9", "(-8)**(1/3)", "__import__('os')", "(" * 200, "q1", "time [ms]",
    "q[99999999999]", "header.stamp.secs", "[1, 2]", "</link>", "<mimic/>", "<!DOCTYPE r>",
)  # fmt: skip
TOKEN = re.compile(r"[\w.+-]+|\s+|.", re.DOTALL)


def number(random):
    """A number as text, seldom a kind one."""
    if random.random() < 0.3:
        return repr(random.choice((1.0, -1.0)) * 10.0 ** random.randint(-330, 308))
    return random.choice(NUMBERS)


def text_of(random, text, most=3):
    """Bytes of a text with tokens replaced, lost and exchanged, and lines lost and doubled."""
    for _ in range(random.randint(1, most)):
        lines = text.split("\n")
        k, kind = random.randrange(len(lines)), random.randrange(8)
        tokens = TOKEN.findall(lines[k]) or [""]
        i, j = random.randrange(len(tokens)), random.randrange(len(tokens))
        if kind <= 1:
            numbers = [m for m, token in enumerate(tokens) if token.strip(".+-").isnumeric()]
            tokens[random.choice(numbers or [i])] = number(random)
        elif kind == 2:
            tokens[i] = random.choice(WORDS)
        elif kind == 3:
            del tokens[i]
        elif kind == 4:
            tokens[i], tokens[j] = tokens[j], tokens[i]
        elif kind == 5:
            tokens[i] = random.choice(TOKEN.findall(text))
        lines[k : k + 1] = [] if kind == 6 else ["".join(tokens)] * (1 + (kind == 7))
        text = "\n".join(lines) or " "
    kind = random.randrange(20)
    if kind == 0:
        return bytes_of(random, text.encode("utf-8", "replace"))
    return text.encode("utf-16" if kind == 1 else "utf-8", "replace")


def bytes_of(random, data, most=8):
    """Some bytes changed, doubled, cut or put elsewhere."""
    data = bytearray(data)
    for _ in range(random.randint(1, most)):
        if not data:
            break
        k, kind = random.randrange(len(data)), random.randrange(5)
        if kind == 0:
            data[k] = random.randrange(256)
        elif kind == 1:
            del data[k : k + random.randint(1, 16)]
        elif kind == 2:
            data[k:k] = data[k : k + random.randint(1, 64)]
        elif kind == 3:
            data[k : k + 4] = random.choice((b"\xff\xff\xff\xff", b"\x00\x00\x00\x80"))
        else:
            del data[k:]
    return bytes(data)


def arrays(random, good):
    """A mapping of arrays, some of another shape, kind or name."""
    changed = dict(good)
    for _ in range(random.randint(1, 3)):
        name = random.choice(sorted(changed))
        value = np.asarray(changed[name])
        bad = random.choice((np.nan, np.inf, 1e308, -1e308, 5e-324, 1e150, 0.0))
        others = (
            lambda v=value: v.T,
            lambda v=value: v[..., None],
            lambda v=value: v[: len(v) // 2] if v.ndim else v,
            lambda v=value: v[::-1] if v.ndim else v,
            lambda v=value: np.nan_to_num(v, posinf=1.0).astype(random.choice((np.int64, "S3"))),
            lambda v=value, bad=bad: np.where(np.arange(v.size).reshape(v.shape) == 3, bad, v),
            lambda v=value, bad=bad: np.full(v.shape, bad),
            lambda: np.array(random.choice((0.0, 1, "word", True))),
            lambda: np.zeros((2, 2, 2)),
        )
        if value.dtype.kind == "f":
            with np.errstate(all="ignore"):
                value = random.choice(others)()
        changed[random.choice((name, name, "q", "tau", "t", "x", "position"))] = value
        if random.random() < 0.1 and len(changed) > 1:
            del changed[name]
    return changed


def npz(random, good):
    """Bytes of an NPZ with arrays and then perhaps bytes changed."""
    stream = io.BytesIO()
    np.savez(stream, **arrays(random, good))
    return bytes_of(random, stream.getvalue()) if random.random() < 0.3 else stream.getvalue()


def mat(random, good):
    """Bytes of a MAT file with arrays changed; of damaged bytes SciPy's reader may crash."""
    from scipy.io import savemat

    changed = arrays(random, good)
    stream = io.BytesIO()
    savemat(stream, {"log": changed} if random.random() < 0.2 else changed)
    return stream.getvalue()


VALUES = (
    None, True, False, 0, 1, -1, 2, 3, 10**400, 1e308, -1e308, 5e-324, float("nan"), float("inf"),
    1j, "", "0", "1.5", "nan", b"1", [], [1.0], (1.0, 2.0), {}, {"a": 1}, object, np.float32(1.0),
    np.int8(3), np.array(1.0), np.array([1.0]), np.zeros((2, 2)), np.array("a"), np.ma.masked,
)  # fmt: skip
KEYS = ("sigma", "alpha", "d", "theta", "r", "gamma", "b", "beta", "antecedent", "mu", "name",
        "lower", "upper", "velocity", "effort", "x", "Theta", 3)  # fmt: skip


def rows(random, good):
    """Rows of a geometric table with entries changed."""
    changed = copy.deepcopy(good)
    for _ in range(random.randint(1, 3)):
        k = random.randrange(len(changed))
        row = changed[k]
        if not isinstance(row, dict) or random.random() < 0.2:
            changed[k] = random.choice(VALUES)
        elif row and random.random() < 0.2:
            del row[random.choice(sorted(row, key=str))]
        else:
            row[random.choice(KEYS)] = random.choice(VALUES)
    return changed
