"""The symbols of an explanation, the order of terms in print, and LaTeX of the printed text."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import InvalidValueError, nearest_names
from ..geometry import PRISMATIC, DHTable, constant_names
from .angles import ROUNDING, Angle, Term, exact_turns, greek, signed_sum, wrapped

_LONGEST = 100
"""A partial result with more symbols than this is named U1, U2, ..."""
_TOKEN = re.compile(
    r"(?P<fraction>(?:sqrt\(\d+\)|\d*π|\d+)/\d+)|(?P<frame>\d+[TJR]\d*(?:,\w+)?)"
    r"|(?P<number>\d+(?:\.\d+)?(?:e[+-]?\d+)?)|(?P<words>[a-z]{2,}(?: [a-z]{2,})*)(?![\w(])"
    r"|(?P<name>[^\W\d]\w*)|(?P<power>\*\*-?\d+)|(?P<other>.)"
)
_MATH = {"*": r" \, ", "±": r"\pm ", "π": r"\pi"}
_FUNCTIONS = {name: rf"\{name}" for name in ("sin", "cos")} | {
    "acos": r"\arccos", "atan2": r"\operatorname{atan2}", "det": r"\det",
    "Rot": r"\mathbf{Rot}", "Trans": r"\mathbf{Trans}",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Constant:
    """A constant of the robot that has a symbol."""

    symbol: Any
    value: float
    unit: str
    meaning: str


@dataclass(frozen=True, slots=True)
class _Facts:
    """Properties of an expression that decide its place in a sum."""

    leaves: int  # symbols in it, counted as often as they are printed
    moves: bool = False  # whether it depends on q
    latest: int = 0  # number of the last constant in it
    nested: bool = False  # whether it holds a sum


class Notation:
    """The symbols of one explanation: their names, meanings, values and order in print."""

    def __init__(self, table: DHTable, new_names: Mapping[str, str] | None) -> None:
        self.separator = "_" if table.f > 9 else ""
        self._given_names = checked_names(new_names)
        self.new_names = dict(constant_names(table.symbols)) | self._given_names
        self.constants: list[Constant] = []
        self.abbreviations: dict[Any, Any] = {}
        self.meanings: dict[Any, str] = {}  # of abbreviations
        self._symbols: dict[str, Any] = {}  # by the name before renaming
        self._latex: dict[str, str] = {}  # by the printed name
        self._rank: dict[Any, tuple[Any, ...]] = {}
        self._facts: dict[Any, _Facts] = {}
        self._short: dict[Any, Any] = {}
        self._printed: dict[Any, str] = {}
        variables = []
        for row in table.joint_rows:
            j = int(row) + 1
            name, latex = ("r", "r") if table.sigma[row] == PRISMATIC else ("theta", r"\theta")
            rank, facts = (2, j), _Facts(1, moves=True)
            variables.append(self._symbol(f"{name}{j}", f"{latex}_{{{j}}}", rank, facts))
        self.variables = tuple(variables)

    def _symbol(self, name: str, latex: str, rank: tuple[Any, ...], facts: _Facts) -> Any:
        import sympy

        new = self.new_names.get(name)
        symbol = sympy.Symbol(new or name)
        self._symbols[name] = symbol
        self._latex[greek(symbol.name)] = sympy.latex(symbol) if new else latex
        self._rank[symbol] = rank
        self._facts[symbol] = facts
        return symbol

    def joint_angle(self, j: int) -> Angle:
        """The angle theta_j of a revolute joint without its offset."""
        return Angle((Term(self._symbols[f"theta{j}"], str(j), joint=j),))

    def stroke(self, j: int) -> Any:
        """The length r_j of a prismatic joint without its offset."""
        return self._symbols[f"r{j}"]

    def angle(self, name: str, latex: str, value: float, meaning: str) -> Angle:
        """A constant angle: exact, or a symbol."""
        exact = exact_turns(value)
        if exact is not None:
            return Angle(turns=wrapped(exact))
        symbol = self._constant(name, latex, value, "rad", meaning)
        return Angle((Term(symbol, name, value=value),))

    def length(self, name: str, latex: str, value: float, meaning: str) -> Any:
        """A constant length: 0, or a symbol."""
        import sympy

        if abs(value) <= ROUNDING:
            return sympy.S.Zero
        return self._constant(name, latex, value, "m", meaning)

    def _constant(self, name: str, latex: str, value: float, unit: str, meaning: str) -> Any:
        number = len(self.constants) + 1
        symbol = self._symbol(name, latex, (3, number), _Facts(1, latest=number))
        self.constants.append(Constant(symbol, float(value), unit, meaning))
        return symbol

    def cos_sin(self, angle: Angle) -> tuple[Any, Any]:
        """Cosine and sine of an angle: numbers, or plus or minus their symbols."""
        import sympy

        sign = angle.terms[0].sign if angle.terms else 1
        angle = angle.times(sign)
        if not angle.terms:
            return sympy.cos(sympy.pi * angle.turns), sympy.sin(sympy.pi * angle.turns)
        rest = angle.without_quarters()
        C, S = self._named_cos_sin(rest)
        for _ in range(int(2 * (angle.turns - rest.turns)) % 4):
            C, S = -S, C
        return C, sign * S

    def _named_cos_sin(self, angle: Angle) -> tuple[Any, Any]:
        import sympy

        parts = [("m" if t.sign < 0 else "") + t.letters for t in angle.terms]
        if angle.turns:
            degrees = int(angle.turns * 180)
            parts.append(f"{'m' if degrees < 0 else 'p'}{abs(degrees)}")
        letters = self.separator.join(parts)
        if f"C{letters}" not in self._symbols:
            total = sympy.pi * angle.turns + sum(t.sign * t.symbol for t in angle.terms)
            moving = bool(angle.joints)
            rank = (0 if moving else 1, angle.joints, letters)
            subscript = self._subscript(angle)
            for letter, function in (("C", sympy.cos), ("S", sympy.sin)):
                latex = f"{letter}_{{{subscript}}}"
                symbol = self._symbol(f"{letter}{letters}", latex, rank, _Facts(1, moving))
                self.abbreviations[symbol] = function(total)
                self.meanings[symbol] = f"{function.__name__}({angle.text()})"
        return self._symbols[f"C{letters}"], self._symbols[f"S{letters}"]

    def _subscript(self, angle: Angle) -> str:
        """LaTeX subscript of a sine or cosine: joints by number, constants by symbol."""
        comma = ", " if self.separator else ""
        if any(t.sign < 0 for t in angle.terms):
            comma = "+"  # all the signs: 12-4 reads as 12 minus 4
        out = ""
        for t in angle.terms:
            plus = comma if t.joint else "+"
            out += "-" if t.sign < 0 else plus if out else ""
            out += t.letters if t.joint else self._latex[t.symbol.name]
        if angle.turns:
            out += rf"{int(angle.turns * 180):+d}^{{\circ}}"
        return out

    def shortened(self, expr: Any) -> Any:
        """The expression, or a new symbol for it if it is long."""
        facts = self._facts_of(expr)
        if facts.leaves <= _LONGEST:
            return expr
        if expr not in self._short:
            n = len(self._short) + 1
            symbol = self._symbol(f"U{n}", f"U_{{{n}}}", (4, n), _Facts(1, facts.moves))
            self.abbreviations[symbol] = expr
            self.meanings[symbol] = self.text(expr)
            self._short[expr] = symbol
        return self._short[expr]

    def used_abbreviations(self, expressions: Iterable[Any]) -> tuple[tuple[Any, Any], ...]:
        """The abbreviations that occur, each after those that it needs."""
        needed = set().union(*(expr.free_symbols for expr in expressions))
        for symbol, meaning in reversed(self.abbreviations.items()):
            if symbol in needed:
                needed |= meaning.free_symbols
        return tuple(item for item in self.abbreviations.items() if item[0] in needed)

    def check_new_names(self) -> None:
        """Refuse new names for symbols that do not occur, and names given twice."""
        known = tuple(self._symbols)
        for name in self._given_names:
            if name not in known:
                near = nearest_names(name, known)
                hint = f" Did you mean {near[0]!r}?" if near else ""
                raise InvalidValueError(
                    f"symbols: {name!r} does not occur in these formulas.{hint} "
                    f"Known: {', '.join(known)}."
                )
        final = [symbol.name for symbol in self._symbols.values()]
        repeated = sorted({name for name in final if final.count(name) > 1})
        if repeated:
            raise InvalidValueError(
                f"symbols: {', '.join(map(repr, repeated))} would denote two quantities; choose "
                "names that are not in use."
            )

    # order and text of sums and products

    def _facts_of(self, expr: Any) -> _Facts:
        known = self._facts.get(expr)
        if known is None:
            parts = [expr.base] * int(expr.exp) if expr.is_Pow else expr.args
            of = [self._facts_of(arg) for arg in parts]
            known = self._facts[expr] = _Facts(
                sum(f.leaves for f in of),
                any(f.moves for f in of),
                max((f.latest for f in of), default=0),
                expr.is_Add or any(f.nested for f in of),
            )
        return known

    def size(self, expr: Any) -> tuple[int, int]:
        """Number of printed symbols, and of characters."""
        return self._facts_of(expr).leaves, len(self.text(expr))

    def _ordered_terms(self, total: Any) -> list[Any]:
        """Terms of a sum as the book orders them: constants first, then the longest first."""

        def key(term: Any) -> tuple[Any, ...]:
            facts = self._facts_of(term)
            names = sorted(str(s) for s in term.args or (term,) if s in self._rank)
            return facts.moves, -facts.leaves, -facts.latest, names

        return sorted(total.args, key=key)

    def times(self, factor: Any, expr: Any) -> Any:
        """A product; the sign of a sum is factored out where the book does so."""
        if expr.is_Add:
            terms = self._ordered_terms(expr)
            negative = [term.as_coeff_Mul()[0] < 0 for term in terms]
            plain = not any(self._facts_of(term).nested for term in terms)
            if all(negative) or (negative[0] and plain):
                return (-factor) * (-expr)
        return factor * expr

    def text(self, expr: Any) -> str:
        """An expression as the book writes it; the text is Python as well."""
        known = self._printed.get(expr)
        if known is None:
            terms = self._ordered_terms(expr) if expr.is_Add else [expr]
            known = self._printed[expr] = signed_sum(map(self._signed, terms))
        return known

    def _signed(self, term: Any) -> tuple[int, str]:
        import sympy

        factors = sympy.Mul.make_args(term)
        number = sympy.Mul(*[f for f in factors if f.is_number])
        powers = [f.as_base_exp() for f in factors if not f.is_number]
        sign, number = (-1, -number) if number.is_negative else (1, number)
        words = [str(number)] if number != 1 or not powers else []
        if words and powers and not words[0].isalnum():
            words = [f"({words[0]})"]
        powers.sort(key=lambda power: (power[0] not in self._rank, self._rank.get(power[0], ())))
        for base, k in powers:
            text = str(base) if base in self._rank else f"({self.text(base)})"
            words.append(text if k == 1 else f"{text}**{k}")
        return sign, "*".join(words)

    def tex(self, text: str) -> str:
        """LaTeX of a printed formula: symbols typeset, words upright."""
        # a number before a product needs no parentheses: its fraction is typeset
        text = re.sub(r"\(((?:sqrt\(\d+\)|\d+)(?:/\d+)?)\)(?=\*)", r"\1", text)
        out, closing = "", []
        for token in _TOKEN.finditer(text):
            kind, word = token.lastgroup, token[0]
            called = text[token.end() : token.end() + 1] == "("
            if word in self._latex:
                out += self._latex[word]
            elif word in _MATH:
                out += _MATH[word]
            elif kind == "fraction":
                top, under = word.rsplit("/", 1)
                out += rf"\frac{{{self.tex(top)}}}{{{under}}}"
            elif kind == "frame":
                of, letter, index = re.split("([TJR])", word)
                out += rf"{{}}^{{{of}}}" if index else ""
                out += rf"\mathbf{{{letter}}}_{{{index or of}}}"
            elif kind == "number":
                out += re.sub(r"e([+-]?\d+)", lambda m: rf" \cdot 10^{{{int(m[1])}}}", word)
            elif kind == "power":
                out += f"^{{{word[2:]}}}"
            elif kind == "words" and not called:
                out += rf"\text{{ {word} }}"
            elif word == "sqrt":
                out += r"\sqrt"
            elif word in _FUNCTIONS and called:
                out += (r" \, " if out and word[0] in "RT" else "") + _FUNCTIONS[word]
            elif kind == "name":
                out += rf"\mathbf{{{word}}}"
            elif word == "(":
                root = out.endswith(r"\sqrt")
                closing.append("}" if root else r"\right)")
                out += "{" if root else r"\left("
            elif word == ")":
                out += closing.pop()
            else:
                out += word
        return out


def checked_names(names: Mapping[str, str] | None) -> dict[str, str]:
    """Names of symbols before and after renaming."""
    if names is None:
        return {}
    if not isinstance(names, Mapping):
        raise InvalidValueError(
            "symbols: expected a mapping of old names to new ones such as {'RL1': 'l1'}, got "
            f"{type(names).__name__}."
        )
    for old, new in names.items():
        if not isinstance(new, str) or not new.isidentifier():
            raise InvalidValueError(
                f"symbols: the new name of {old!r} must be letters, digits and underscores that "
                f"do not begin with a digit, got {new!r}."
            )
    return dict(names)
