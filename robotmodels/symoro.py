"""Reading SYMORO's ``.par`` files: SYMORO+ (Windows) and OpenSYMORO spell them differently.

Facts about the format: keywords stand before ``= {entry, entry, ...}``, comments between ``(*``
and ``*)``. NL links and NJ joints make B = NJ - NL loops; the frames are NF = NL + 2 B, of which
NL + 1 to NJ sit on the cut joints and the rest are their second, fixed frames. Geometric lists
have NF entries, dynamic ones NL, starting with row 1. ``G`` is the acceleration of gravity in
frame 0, ``Z`` the pose of frame 0 row by row. W. Khalil, A. Vijayalingam, B. Khomutenko, I.
Mukhanov, P. Lemoine and G. Ecorchard, "OpenSYMORO: an open-source software package for symbolic
modelling of robots", IEEE/ASME AIM 2014.
"""

from __future__ import annotations

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import se3
from ._arrays import Array, as_floats
from .drive import DriveParameters
from .errors import (
    InvalidValueError,
    ParFileError,
    RobotModelsError,
    RobotModelsWarning,
    nearest_names,
)
from .geometry import FIXED, PRISMATIC, DHTable
from .inertia import PARAMETERS, InertialParameters
from .model import GRAVITY, RobotModel

_INTEGERS = ("ant", "sigma", "mu")
_GEOMETRY = ("gamma", "b", "alpha", "d", "theta", "r")
_DRIVES = ("IA", "FV", "FS")
_DYNAMICS = (*PARAMETERS, *_DRIVES)
_WRENCHES = ("FX", "FY", "FZ", "CX", "CY", "CZ")
_BASE_MOTION = ("W0", "WP0", "V0", "VP0")
_LISTS = (*_INTEGERS, *_GEOMETRY, *_DYNAMICS, *_WRENCHES, *_BASE_MOTION, "G", "Z",
          "eta", "k", "QP", "QDP", "GAM")  # fmt: skip
_SCALARS = ("NL", "NJ", "NF", "Type", "is_floating", "is_mobile")
_REQUIRED = ("NL", "NJ", "ant", "sigma", "alpha", "d", "theta", "r")
# SYMORO+ writes Ant, Sigma, B, R, ...; no two keywords differ only in case
_KEYWORDS = {keyword.lower(): keyword for keyword in (*_LISTS, *_SCALARS)}

# XX3, and XXR3 or XX3R in files of base parameters: a name that stands for itself
_STANDARD_NAME = re.compile(rf"({'|'.join(_DYNAMICS)})(R?\d+|\d+R)")
_COMMENT = re.compile(r"\(\*.*?\*\)", re.DOTALL)
_ROBOT_NAME = re.compile(r"\(\*\s*Robotname\s*=\s*(['\"])(.*?)\1", re.IGNORECASE)
_HEAD = re.compile(r"(\w+)\s*=[ \t]*")

_LONGEST = 1000
_OPERATORS: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_SIGNS: dict[type, float] = {ast.UAdd: 1.0, ast.USub: -1.0}
_FUNCTIONS: dict[str, tuple[int, Callable[..., float]]] = {
    "sqrt": (1, math.sqrt),
    "cos": (1, math.cos),
    "sin": (1, math.sin),
    "tan": (1, math.tan),
    "atan2": (2, math.atan2),
}


def read_par(
    path: str | Path,
    values: Mapping[str, float] | None = None,
    gravity: ArrayLike | None = None,
) -> RobotModel:
    """Read a SYMORO ``.par`` file; SYMORO+'s and OpenSYMORO's spelling are both understood.

    The symbol in a joint's own column (theta if revolute, r if prismatic) is its variable,
    whatever its name; what is added to it is the offset, so ``q`` is SYMORO's. A number alone in
    that column is an offset. All other symbols get numbers from ``values``. Dynamic parameters
    that only stand for themselves (``XX1``, ``FV2``) and are not in ``values`` are 0; a warning
    and the model's ``notes`` say which. Frames with sigma 2 and mu are kept.

    Parameters
    ----------
    path : str or Path
        The file. UTF-8 or Latin-1.
    values : mapping of str to float, optional
        Numbers for the file's symbols, e.g. ``{"D3": 0.45}``: metres, radians, SI.
    gravity : array_like, shape (3,), optional
        Acceleration in the world frame, m/s^2, instead of the file's. The file's ``G`` is the
        acceleration of gravity in frame 0: ``{0, 0, G3}`` with z0 upwards needs ``G3 = -9.81``.
        If it is symbolic along a vertical z0 and not in ``values``, it is 9.81 downwards.

    Returns
    -------
    RobotModel
        Named as the file says, else after the file; ``Z`` is its base, ``IA``, ``FV``, ``FS``
        are its ``Ia``, ``Fv``, ``Fc``. The tip is the last frame.

    Raises
    ------
    ParFileError
        The file is missing or not a ``.par`` file; lists of the wrong length, entries that are
        not expressions, symbols without a number, a variable with another sign or factor than
        +1; loops, floating or mobile bases, flexible joints.
    TableError
        Antecedents that do not come before their successors.
    InvalidValueError
        A value that is not a finite number.

    Warns
    -----
    RobotModelsWarning
        Lists dynamic parameters without numbers and keywords that are not SYMORO's.

    References
    ----------
    W. Khalil and D. Creusot, "SYMORO+: a system for the symbolic modelling of robots", Robotica
    15, 1997. Seed book section 1.2.1, Table 1.1.

    Examples
    --------
    >>> import tempfile
    >>> text = '''(* Robotname = 'elbow' *)
    ... NL = 2
    ... NJ = 2
    ... NF = 2
    ... Type = 0 (* Simple *)
    ... Ant = {0, 1}
    ... Sigma = {0, 0}
    ... B = {0, 0}
    ... d = {0, D2}
    ... R = {0.3, 0}
    ... gamma = {0, 0}
    ... Alpha = {0, Pi/2}
    ... Mu = {1, 1}
    ... Theta = {t1, t2 + Pi/2}
    ... '''
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "elbow.par"
    ...     _ = path.write_text(text)
    ...     model = read_par(path, values={"D2": 0.4})
    >>> model.name, model.table.d, model.table.theta
    ('elbow', array([0. , 0.4]), array([0. , 1.57079633]))
    """
    file = _ParFile(Path(path))
    numbers = _Numbers(file, _checked_values(values, file))
    links, f = _counts(file)
    columns = _geometry(file, numbers, links, f)
    inertia, drive, silent = _dynamics(file, numbers, links, columns["sigma"])
    base = _base(file, numbers)
    acceleration, gravity_notes = _gravity(file, numbers, base, gravity)
    _check_rigid_fixed(file, numbers)
    numbers.check_complete()
    table = DHTable(**columns)

    alarms = [f"{word!r} is not a keyword of SYMORO and is left out" for word in file.unknown]
    if silent:
        alarms.append(
            f"{_listed_parameters(silent, links)} have no numbers and are 0 (pass values="
            f"{{{silent[0]!r}: ...}} for the dynamic models)"
        )
    if alarms:
        warnings.warn(f"{file.label}: {'; '.join(alarms)}.", RobotModelsWarning, stacklevel=2)
    notes = [f"{alarm[0].upper()}{alarm[1:]}." for alarm in alarms]
    notes += gravity_notes + _left_out(file, numbers, columns["sigma"])
    model = RobotModel.from_table(
        table, inertia=inertia, drive=drive, base=base, gravity=acceleration, name=file.name
    )
    return replace(model, notes=tuple(notes))


@dataclass(frozen=True, slots=True)
class _Entry:
    """One entry of a list: an expression, and the place that a message can point at."""

    text: str
    place: str
    tree: ast.expr
    symbols: tuple[str, ...]

    def value(self, numbers: Mapping[str, float]) -> float:
        try:
            value = _evaluate(self.tree, numbers)
        except (ArithmeticError, ValueError, RecursionError) as error:
            raise ParFileError(
                f"{self.place}: {self.text!r} has no value ({error}); write a number."
            ) from None
        if not isinstance(value, float) or not math.isfinite(value):
            raise ParFileError(
                f"{self.place}: {self.text!r} is {value}; expected a finite real number."
            )
        return value


class _ParFile:
    """The statements of a file, with nothing evaluated yet."""

    def __init__(self, path: Path) -> None:
        self.label = path.name or str(path)
        text = _decoded(path)
        named = _ROBOT_NAME.search(text)
        self.name = (named[2].strip() if named else "") or path.stem
        text = _COMMENT.sub(lambda found: " " + "\n" * found[0].count("\n"), text)
        if "(*" in text:
            line = text.count("\n", 0, text.index("(*")) + 1
            raise self.error("a comment that begins with (* has no end: close it with *).", line)
        # the line break alone continues a list, so a backslash in front of it can go
        self._text = re.sub(r"\\[ \t]*(?=\n)", "", text)
        self._scalars: dict[str, tuple[str, int]] = {}
        self._lists: dict[str, tuple[_Entry, ...]] = {}
        self._lines: dict[str, int] = {}
        self.unknown: list[str] = []
        seen: dict[str, str] = {}
        for word, body, line, start in self._statements():
            keyword = _KEYWORDS.get(word.lower())
            if keyword is None:
                self.unknown.append(word)
                continue
            flat = "".join(body.split())
            if seen.setdefault(keyword, flat) != flat:
                raise self.error(
                    f"{keyword} stands here again, with other entries than on line "
                    f"{self._lines[keyword]}; keep one of the two.",
                    line,
                )
            self._lines[keyword] = line
            self._store(keyword, body, line, start)
        self.names = {s for entries in self._lists.values() for e in entries for s in e.symbols}
        missing = [keyword for keyword in _REQUIRED if keyword not in self._lines]
        if missing:
            close = [near for k in missing for near in nearest_names(k, self.unknown)]
            raise self.error(
                f"expected the keywords {', '.join(missing)}, which are not there"
                + (f" ({', '.join(map(repr, dict.fromkeys(close)))} is none)" if close else "")
                + "; a .par file of SYMORO holds lists such as ant = {0, 1, 2}."
            )

    def error(self, message: str, line: int | None = None) -> ParFileError:
        return ParFileError(f"{self.label}{f', line {line}' if line else ''}: {message}")

    def line(self, keyword: str) -> int | None:
        return self._lines.get(keyword)

    def integer(self, keyword: str, default: int) -> int:
        if keyword not in self._scalars:
            return default
        text, line = self._scalars[keyword]
        if not re.fullmatch(r"\d{1,6}", text):
            raise self.error(f"{keyword}: expected a whole number, got {text!r}.", line)
        return int(text)

    def flag(self, keyword: str) -> bool:
        text, line = self._scalars.get(keyword, ("0", 0))
        if text.lower() not in ("0", "1", "true", "false"):
            raise self.error(f"{keyword}: expected True or False, got {text!r}.", line)
        return text.lower() in ("1", "true")

    def entries(self, keyword: str, count: int, why: str) -> tuple[_Entry, ...]:
        entries = self._lists.get(keyword, ())
        if entries and len(entries) != count:
            raise self.error(
                f"{keyword}: expected {count} entries ({why}), got {len(entries)}.",
                self.line(keyword),
            )
        return entries

    def all_entries(self, keyword: str) -> tuple[_Entry, ...]:
        return self._lists.get(keyword, ())

    def _statements(self) -> Iterator[tuple[str, str, int, int]]:
        """Keyword, body, line and start of the body; the body of a list keeps its braces."""
        text, at = self._text, 0
        while True:
            while at < len(text) and (text[at].isspace() or text[at] == ";"):
                at += 1
            if at == len(text):
                return
            line = text.count("\n", 0, at) + 1
            head = _HEAD.match(text, at)
            if head is None:
                got = text[at:].split("\n", 1)[0].strip()
                raise self.error(
                    f"expected 'keyword = ...', got {got[:60]!r}. Is this a .par file of SYMORO? "
                    "Comments stand between (* and *).",
                    line,
                )
            start = head.end()
            bare = text[start:].lstrip()
            if bare.startswith("{"):
                start = len(text) - len(bare)
                end = text.find("}", start) + 1
                if end == 0 or re.search(r"[={]", text[start + 1 : end - 1]):
                    raise self.error(f"the list {head[1]} has no end: close it with }}.", line)
            else:
                end = text.find("\n", start)
                end = len(text) if end < 0 else end
            yield head[1], text[start:end], line, start
            at = end

    def _store(self, keyword: str, body: str, line: int, start: int) -> None:
        is_list = body.startswith("{")
        if keyword in _SCALARS:
            if is_list:
                raise self.error(f"{keyword}: expected one value, got a list.", line)
            self._scalars[keyword] = (body.strip(" \t\r;,"), line)
            return
        if not is_list:
            raise self.error(
                f"{keyword}: expected a list in braces such as {{0, 1}}, got {body.strip()!r}.",
                line,
            )
        entries, at = [], start + 1
        for i, text in enumerate(_split(body[1:-1]), start=1):
            # white space before an entry may hold line breaks
            first = at + len(text) - len(text.lstrip())
            here = self._text.count("\n", 0, first) + 1
            entries.append(_parsed(text, f"{self.label}, line {here}: {keyword}, entry {i}"))
            at += len(text) + 1
        self._lists[keyword] = tuple(entries)


class _Numbers:
    """Turns entries into numbers and gathers the symbols that have none."""

    def __init__(self, file: _ParFile, values: Mapping[str, float]) -> None:
        self.values = dict(values)
        self.variables: dict[str, int] = {}
        self._file = file
        self._missing: dict[str, str] = {}

    def free(self, entry: _Entry) -> list[str]:
        return [symbol for symbol in entry.symbols if symbol not in self.values]

    def number(self, entry: _Entry, zero: Iterable[str] = ()) -> float:
        """The entry's value; with ``zero`` symbols taken as 0, with missing ones remembered."""
        zero = set(zero)
        missing = [symbol for symbol in self.free(entry) if symbol not in zero]
        for symbol in missing:
            if symbol in self.variables:
                raise ParFileError(
                    f"{entry.place}: {symbol!r} is the variable of joint "
                    f"{self.variables[symbol]} and cannot stand here as well: every other "
                    "parameter is a constant of the table. Replace it by a number."
                )
            self._missing.setdefault(symbol, entry.place)
        return 0.0 if missing else entry.value({**self.values, **dict.fromkeys(zero, 0.0)})

    def integer(self, entry: _Entry) -> int:
        value = self.number(entry)
        if not value.is_integer():
            raise ParFileError(f"{entry.place}: expected a whole number, got {entry.text!r}.")
        return int(value)

    def offset(self, entry: _Entry, j: int) -> float:
        """The constant part of the own column of joint j; its symbol becomes a variable."""
        free = self.free(entry)
        if not free:
            if entry.symbols:  # a file that is read for one posture is another robot
                raise ParFileError(
                    f"{entry.place}: {entry.text!r} has no symbol left to be the variable of joint "
                    f"{j}; take that one ({', '.join(entry.symbols)}) out of values."
                )
            return entry.value({})
        # R4 and RL4 are lengths, r4 is a variable
        likely = [s for s in entry.symbols if re.fullmatch(rf"((?i:th|theta|t|q)|r)_?{j}", s)]
        fixed = [s for s in likely if s not in free]
        likely = [s for s in likely if s in free]
        if fixed and not likely:
            raise ParFileError(
                f"{entry.place}: {fixed[0]!r} is the variable of joint {j}; take it out of values."
            )
        variable = free if len(free) == 1 else likely
        if len(variable) != 1:
            raise ParFileError(
                f"{entry.place}: which of {', '.join(free)} is the variable of joint {j}? Pass "
                "numbers for the others: values={...}."
            )
        q = variable[0]
        if self.variables.setdefault(q, j) != j:
            raise ParFileError(
                f"{entry.place}: {q!r} is already the variable of joint {self.variables[q]}; "
                "coupled joints are not a matter of the table: give each joint its own symbol "
                "and couple them with a Transmission."
            )
        others = [s for s in free if s != q]
        for symbol in others:
            self._missing.setdefault(symbol, entry.place)
        if others:
            return 0.0
        at_0, at_1, at_3 = (entry.value({**self.values, q: x}) for x in (0.0, 1.0, 3.0))
        slope = at_1 - at_0
        rounding = 1e-12 * max(1.0, abs(at_0))
        if abs(slope - 1.0) > rounding or abs(at_3 - at_0 - 3.0) > 3.0 * rounding:
            what = "has the sign of its variable turned" if abs(slope + 1.0) <= rounding else (
                "is not its variable plus a constant"
            )  # fmt: skip
            raise ParFileError(
                f"{entry.place}: {entry.text!r} {what}; the table keeps the sign and scale of q, "
                f"so write it as {q} + constant and measure joint {j} that way."
            )
        return at_0

    def check_complete(self) -> None:
        if self._missing:
            names = list(self._missing)
            example = ", ".join(f"{name!r}: ..." for name in names)
            raise ParFileError(
                f"{self._missing[names[0]]}: no number for {', '.join(names)}. Pass "
                f"values={{{example}}} to read_par, in metres and radians."
            )


def _decoded(path: Path) -> str:
    try:
        raw = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ParFileError(
            f"cannot read {str(path)!r}: {reason}. Give the path of a .par file."
        ) from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")  # SYMORO+ signs with an accent
    if "\0" in text:
        raise ParFileError(f"{path.name}: this is not text, so not a .par file of SYMORO.")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _split(body: str) -> list[str]:
    """Split at the commas outside parentheses: atan2(y, x) is one entry."""
    parts, depth = [""], 0
    for letter in body:
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth <= 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def _parsed(text: str, place: str) -> _Entry:
    text = " ".join(text.split())
    problem = "" if text else "is empty"
    if len(text) > _LONGEST:
        problem = f"is longer than {_LONGEST} letters"
    tree: ast.expr | None = None
    symbols: list[str] = []
    if not problem:
        try:
            tree = ast.parse(text.replace("^", "**"), mode="eval").body
            symbols = list(dict.fromkeys(_symbols(tree)))
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            problem = "is not an expression"
    if problem or tree is None:
        raise ParFileError(
            f"{place}: {text[:60]!r} {problem}. Numbers, symbols, pi, + - * / **, parentheses and "
            f"{', '.join(_FUNCTIONS)} can be read."
        )
    return _Entry(text, place, tree, tuple(symbols))


def _symbols(node: ast.expr) -> Iterator[str]:
    """Every symbol of an expression; anything else than arithmetic is a ValueError."""
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return
    if isinstance(node, ast.Name):
        if node.id.lower() != "pi":
            yield node.id
    elif isinstance(node, ast.UnaryOp) and type(node.op) in _SIGNS:
        yield from _symbols(node.operand)
    elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        yield from _symbols(node.left)
        yield from _symbols(node.right)
    elif isinstance(node, ast.Call) and _is_function(node):
        for argument in node.args:
            yield from _symbols(argument)
    else:
        raise ValueError(ast.dump(node))


def _is_function(node: ast.Call) -> bool:
    if not isinstance(node.func, ast.Name) or node.keywords:
        return False
    arity, _ = _FUNCTIONS.get(node.func.id.lower(), (-1, None))
    return arity == len(node.args)


def _evaluate(node: Any, numbers: Mapping[str, float]) -> float:
    """Value of a tree that `_symbols` has accepted."""
    if isinstance(node, ast.Constant):
        return float(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        return math.pi if node.id.lower() == "pi" else numbers[node.id]
    if isinstance(node, ast.UnaryOp):
        return _SIGNS[type(node.op)] * _evaluate(node.operand, numbers)
    if isinstance(node, ast.BinOp):
        left, right = _evaluate(node.left, numbers), _evaluate(node.right, numbers)
        return _OPERATORS[type(node.op)](left, right)
    _, function = _FUNCTIONS[node.func.id.lower()]
    return function(*(_evaluate(argument, numbers) for argument in node.args))


def _checked_values(values: Mapping[str, float] | None, file: _ParFile) -> dict[str, float]:
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise InvalidValueError(
            "values: expected a mapping from symbols to numbers such as {'D3': 0.45}, got "
            f"{type(values).__name__}."
        )
    checked = {}
    for symbol, value in values.items():
        if symbol not in file.names:
            close = nearest_names(str(symbol), file.names)
            raise file.error(
                f"values has a number for {symbol!r}, but no such symbol stands in the file"
                + (f". Did you mean {', '.join(map(repr, close))}?" if close else ".")
            )
        number = as_floats(value, f"values[{symbol!r}]")
        if number.ndim:
            raise InvalidValueError(f"values[{symbol!r}]: expected one number, got {value!r}.")
        checked[symbol] = float(number)
    return checked


def _counts(file: _ParFile) -> tuple[int, int]:
    """Number of links and of frames, of a file that is a tree on a fixed base."""
    links, joints, kind = file.integer("NL", 0), file.integer("NJ", 0), file.integer("Type", 0)
    f = file.integer("NF", max(links, 2 * joints - links))
    for keyword, what in (("is_floating", "floating"), ("is_mobile", "mobile")):
        if file.flag(keyword):
            raise file.error(
                f"a robot on a {what} base is not supported yet; set {keyword} = False, take entry "
                "0 out of the dynamic lists and read the arm on a fixed base.",
                file.line(keyword),
            )
    if joints > links:
        cut, second = range(links + 1, joints + 1), range(joints + 1, f + 1)
        raise file.error(
            f"{file.name!r} has closed loops, which are not supported yet: with NL = {links} links "
            f"and NJ = {joints} joints, its loops are cut at {_numbered('joint', cut)}"
            + (f" (second: {_numbered('frame', second)})" if second else "")
            + f". Give the spanning tree: keep the first {links} entries of the geometric, dynamic "
            f"and joint lists and set NJ = NF = {links} and Type = 1.",
            file.line("NJ"),
        )
    if kind == 2:
        raise file.error(
            f"Type = 2 says that {file.name!r} has closed loops, which are not supported yet, but "
            f"NL = NJ = {links} cuts no joint; set Type = 1 if the file is the spanning tree.",
            file.line("Type"),
        )
    if links < 1 or joints < links or f < links:
        raise file.error(
            f"NL = {links} links, NJ = {joints} joints and NF = {f} frames do not fit: a tree has "
            "as many of each, at least one, and fixed frames (sigma 2) count as joints too.",
            file.line("NL"),
        )
    return links, f


def _geometry(file: _ParFile, numbers: _Numbers, links: int, f: int) -> dict[str, Any]:
    rows = {k: file.entries(k, f, f"NF = {f} frames") for k in (*_INTEGERS, *_GEOMETRY)}
    columns: dict[str, Any] = {
        _column(k): [numbers.integer(entry) for entry in rows[k]] for k in _INTEGERS if rows[k]
    }
    numbers.check_complete()
    legal = {
        "ant": (range(f + 1), f"the number of a frame, 0 (the base) to {f}"),
        "sigma": ((0, PRISMATIC, FIXED), "0 (revolute), 1 (prismatic) or 2 (fixed)"),
        "mu": ((0, 1), "1 (actuated) or 0 (passive)"),
    }
    for key, (allowed, expected) in legal.items():
        for entry, value in zip(rows[key], columns.get(_column(key), ()), strict=True):
            if value not in allowed:
                raise ParFileError(f"{entry.place}: expected {expected}, got {value}.")
    if any(kind != FIXED for kind in columns["sigma"][links:]):
        raise file.error(
            f"NF = {f} frames, but NL = {links} links: without loops only fixed frames (sigma 2) "
            "may come after the links.",
            file.line("NF") or file.line("sigma"),
        )
    own = {0: "theta", PRISMATIC: "r"}
    offsets = {  # first, so that a variable elsewhere is known as one
        (key, j): numbers.offset(rows[key][j], j + 1)
        for j, kind in enumerate(columns["sigma"])
        if (key := own.get(kind, "")) and rows[key]
    }
    for key in _GEOMETRY:
        if rows[key]:
            columns[key] = [
                offsets[key, j] if (key, j) in offsets else numbers.number(entry)
                for j, entry in enumerate(rows[key])
            ]
    return columns


def _column(keyword: str) -> str:
    """Name of a geometric list in the table."""
    return "antecedent" if keyword == "ant" else keyword


def _dynamics(
    file: _ParFile, numbers: _Numbers, links: int, sigma: list[int]
) -> tuple[InertialParameters, DriveParameters, list[str]]:
    """Inertia of all frames, drives of all joints, and the names that have no number."""
    parameters = np.zeros((len(sigma), len(_DYNAMICS)))
    silent: dict[str, None] = {}
    for column, key in enumerate(_DYNAMICS):
        for j, entry in enumerate(file.entries(key, links, f"NL = {links} links")):
            if key in _DRIVES and sigma[j] == FIXED:
                continue
            own = [s for s in numbers.free(entry) if _STANDARD_NAME.fullmatch(s)]
            parameters[j, column] = numbers.number(entry, zero=own)
            silent |= dict.fromkeys(own)
    moving = np.array(sigma) != FIXED
    Ia, Fv, Fc = parameters[moving, -3:].T
    return InertialParameters(parameters[:, :-3]), DriveParameters(Ia=Ia, Fv=Fv, Fc=Fc), [*silent]


def _base(file: _ParFile, numbers: _Numbers) -> Array:
    entries = file.entries("Z", 16, "a 4x4 matrix row by row")
    if not entries:
        return np.eye(4)
    if any(set(numbers.free(entry)) for entry in entries):
        for entry in entries:
            numbers.number(entry)
        return np.eye(4)
    Z = np.array([numbers.number(entry) for entry in entries]).reshape(4, 4)
    try:
        return se3.as_single_pose(Z, "Z")
    except RobotModelsError as error:
        raise file.error(
            f"{error} Z holds the pose of frame 0 in the world, row by row.", file.line("Z")
        ) from None


def _gravity(
    file: _ParFile, numbers: _Numbers, base: Array, gravity: ArrayLike | None
) -> tuple[ArrayLike, list[str]]:
    entries = file.entries("G", 3, "x, y and z in frame 0")
    if gravity is not None:
        return gravity, []
    if not entries:
        return GRAVITY, ["Gravity is not in the file; it is 9.81 m/s^2 downwards."]
    free = [bool(numbers.free(entry)) for entry in entries]
    if not any(free):
        return base[:3, :3] @ [numbers.number(entry) for entry in entries], []
    sideways = [not free[i] and numbers.number(entries[i]) != 0.0 for i in (0, 1)]
    upright = np.allclose(base[:3, 2], (0.0, 0.0, 1.0), atol=1e-12)
    if not free[2] or any(sideways) or not upright:
        for entry in entries:
            numbers.number(entry)
        return GRAVITY, []
    written = ", ".join(entry.text for entry in entries)
    return GRAVITY, [
        f"Gravity is symbolic in the file, G = {{{written}}}; it is 9.81 m/s^2 downwards."
    ]


def _check_rigid_fixed(file: _ParFile, numbers: _Numbers) -> None:
    for keyword in _BASE_MOTION:
        for entry in file.entries(keyword, 3, "x, y and z"):
            if numbers.free(entry) or numbers.number(entry):
                raise ParFileError(
                    f"{entry.place}: the base moves ({entry.text}), which is not supported yet; "
                    "write 0."
                )
    for entry in file.all_entries("eta"):
        if numbers.number(entry):
            raise ParFileError(
                f"{entry.place}: flexible joints are not supported yet; write 0 to read the robot "
                "as rigid."
            )


def _left_out(file: _ParFile, numbers: _Numbers, sigma: list[int]) -> list[str]:
    """Sentences about numbers that have no place in a model."""
    notes = []
    for key in _DRIVES:
        for j, entry in enumerate(file.all_entries(key)):
            if sigma[j] == FIXED and not numbers.free(entry) and numbers.number(entry):
                notes.append(
                    f"{key}{j + 1} = {entry.text} is left out: frame {j + 1} is fixed and has no "
                    "drive."
                )
    loads = [
        key
        for key in _WRENCHES
        if any(not numbers.free(e) and numbers.number(e) for e in file.all_entries(key))
    ]
    if loads:
        notes.append(
            f"The external wrenches {', '.join(loads)} are left out: they are arguments of the "
            "dynamic models."
        )
    return notes


def _listed_parameters(names: list[str], links: int) -> str:
    """Names in short: a parameter that is missing for every link only once."""
    by_key: dict[str, list[str]] = {}
    for name in names:
        found = _STANDARD_NAME.fullmatch(name)
        by_key.setdefault(found[1] if found else name, []).append(name)
    whole = [key for key, members in by_key.items() if len(members) >= links > 1]
    single = [name for key, members in by_key.items() if key not in whole for name in members]
    parts = [f"{' '.join(whole)} of all links"] if whole else []
    return " and ".join([*parts, ", ".join(single)] if single else parts)


def _numbered(what: str, numbers: range) -> str:
    listed = ", ".join(map(str, numbers))
    return f"{what} {listed}" if len(numbers) == 1 else f"{what}s {listed}"
