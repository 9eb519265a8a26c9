"""The symbols of an explanation, and the order and form in which expressions are printed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from ..errors import InvalidValueError, nearest_names
from ._angles import ROUNDING, Angle, Term, exact_turns, signed_sum, wrapped

_LONGEST = 100
"""A partial result with more symbols than this gets a name of its own, U1, U2, ..."""


@dataclass(frozen=True, slots=True)
class Constant:
    """A constant of the robot that has a symbol."""

    symbol: Any
    value: float
    unit: str
    meaning: str


@dataclass(frozen=True, slots=True)
class _Facts:
    """What decides about the order of the terms of a sum."""

    leaves: int  # symbols in it, counted as often as they are printed
    moves: bool  # whether it depends on q
    latest: int  # number of the last constant in it
    nested: bool  # whether it holds a sum


class Notation:
    """The symbols of one explanation: their names, meanings, values and order in print."""

    def __init__(self, frames: int, new_names: Mapping[str, str] | None) -> None:
        self.separator = "_" if frames > 9 else ""
        self.new_names = _checked_names(new_names)
        self.constants: list[Constant] = []
        self.abbreviations: dict[Any, Any] = {}
        self.meanings: dict[Any, tuple[str, str]] = {}  # of abbreviations: text, LaTeX
        self.latex: dict[Any, str] = {}
        self._symbols: dict[str, Any] = {}  # by the name given here
        self._rank: dict[Any, tuple[Any, ...]] = {}
        self._facts: dict[Any, _Facts] = {}
        self._short: dict[Any, Any] = {}
        self._printed: dict[tuple[Any, bool], str] = {}

    def _symbol(self, name: str, latex: str, rank: tuple[Any, ...], facts: _Facts) -> Any:
        import sympy

        new = self.new_names.get(name)
        symbol = sympy.Symbol(new or name)
        self._symbols[name] = symbol
        self.latex[symbol] = sympy.latex(symbol) if new else latex
        self._rank[symbol] = rank
        self._facts[symbol] = facts
        return symbol

    def variable(self, j: int, prismatic: bool) -> Any:
        """The joint variable of frame j."""
        name, latex = ("r", "r") if prismatic else ("theta", r"\theta")
        facts = _Facts(1, True, 0, False)
        return self._symbol(f"{name}{j}", f"{latex}_{{{j}}}", (2, j), facts)

    def joint_angle(self, j: int) -> Angle:
        """The angle theta_j of a revolute joint without its offset."""
        symbol = self._symbols[f"theta{j}"]
        return Angle((Term(symbol, str(j), self.latex[symbol], joint=j),))

    def stroke(self, j: int) -> Any:
        """The length r_j of a prismatic joint without its offset."""
        return self._symbols[f"r{j}"]

    def angle(self, name: str, latex: str, value: float, meaning: str) -> Angle:
        """A constant angle: exact, or a symbol."""
        exact = exact_turns(value)
        if exact is not None:
            return Angle(turns=wrapped(exact))
        symbol = self._constant(name, latex, value, "rad", meaning)
        return Angle((), (Term(symbol, name, self.latex[symbol], value=value),))

    def length(self, name: str, latex: str, value: float, meaning: str) -> Any:
        """A constant length: 0, or a symbol."""
        import sympy

        if abs(value) <= ROUNDING:
            return sympy.S.Zero
        return self._constant(name, latex, value, "m", meaning)

    def _constant(self, name: str, latex: str, value: float, unit: str, meaning: str) -> Any:
        number = len(self.constants) + 1
        symbol = self._symbol(name, latex, (3, number), _Facts(1, False, number, False))
        self.constants.append(Constant(symbol, float(value), unit, meaning))
        return symbol

    def cos_sin(self, angle: Angle) -> tuple[Any, Any]:
        """Cosine and sine of an angle: numbers, or plus or minus their symbols."""
        import sympy

        sign = angle.terms[0].sign if angle.terms else 1
        angle = angle.times(sign)
        if not angle.terms:
            return sympy.cos(sympy.pi * angle.turns), sympy.sin(sympy.pi * angle.turns)
        quarters = angle.turns * 2 if (angle.turns * 2).denominator == 1 else 0
        rest = Angle(angle.joints, angle.constants, angle.turns - Fraction(quarters, 2))
        C, S = self._named_cos_sin(rest)
        for _ in range(int(quarters) % 4):
            C, S = -S, C
        return C, sign * S

    def _named_cos_sin(self, angle: Angle) -> tuple[Any, Any]:
        import sympy

        parts = [("m" if t.sign < 0 else "") + t.letters for t in angle.terms]
        subscript = _subscript(angle, ", " if self.separator else "")
        if angle.turns:
            degrees = int(angle.turns * 180)
            parts.append(f"{'m' if degrees < 0 else 'p'}{abs(degrees)}")
        letters = self.separator.join(parts)
        if f"C{letters}" not in self._symbols:
            total = sympy.pi * angle.turns + sum(t.sign * t.symbol for t in angle.terms)
            moving = bool(angle.joints)
            rank = (0 if moving else 1, tuple(t.joint for t in angle.joints), letters)
            facts = _Facts(1, moving, 0, False)
            for letter, function in (("C", sympy.cos), ("S", sympy.sin)):
                symbol = self._symbol(
                    f"{letter}{letters}", f"{letter}_{{{subscript}}}", rank, facts
                )
                self.abbreviations[symbol] = function(total)
                self.meanings[symbol] = (
                    f"{function.__name__}({angle.text()})",
                    rf"\{function.__name__}\left({angle.text(latex=True)}\right)",
                )
        return self._symbols[f"C{letters}"], self._symbols[f"S{letters}"]

    def shortened(self, expr: Any) -> Any:
        """The expression, or a new symbol for it if it is long."""
        facts = self.facts(expr)
        if facts.leaves <= _LONGEST:
            return expr
        if expr not in self._short:
            number = len(self._short) + 1
            one = _Facts(1, facts.moves, 0, False)
            symbol = self._symbol(f"U{number}", f"U_{{{number}}}", (4, number), one)
            self.abbreviations[symbol] = expr
            self.meanings[symbol] = (self.text(expr), self.text(expr, latex=True))
            self._short[expr] = symbol
        return self._short[expr]

    def used_abbreviations(self, matrices: Sequence[Any]) -> tuple[tuple[Any, Any], ...]:
        """Those that occur, in an order in which each needs only earlier symbols."""
        needed = set().union(*(matrix.free_symbols for matrix in matrices))
        for symbol, meaning in reversed(self.abbreviations.items()):
            if symbol in needed:
                needed |= meaning.free_symbols
        return tuple(item for item in self.abbreviations.items() if item[0] in needed)

    def check_new_names(self) -> None:
        """Refuse new names for symbols that do not occur, and names given twice."""
        known = tuple(self._symbols)
        for name in self.new_names:
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
                f"symbols: {', '.join(map(repr, repeated))} would stand for two things; choose "
                "names that are not in use."
            )

    # how sums and products are ordered, and how they are printed

    def facts(self, expr: Any) -> _Facts:
        known = self._facts.get(expr)
        if known is None:
            parts = [expr.base] * int(expr.exp) if expr.is_Pow else expr.args
            of = [self.facts(arg) for arg in parts]
            known = _Facts(
                sum(f.leaves for f in of),
                any(f.moves for f in of),
                max((f.latest for f in of), default=0),
                expr.is_Add or any(f.nested for f in of),
            )
            self._facts[expr] = known
        return known

    def ordered_terms(self, total: Any) -> list[Any]:
        """Terms of a sum as the book orders them: constants first, then the longest first."""

        def key(term: Any) -> tuple[Any, ...]:
            facts = self.facts(term)
            names = sorted(str(s) for s in term.args or (term,) if s in self._rank)
            return facts.moves, -facts.leaves, -facts.latest, names

        return sorted(total.args, key=key)

    def times(self, factor: Any, expr: Any) -> Any:
        """A product, the sign of a sum drawn out where the book does so."""
        if expr.is_Add:
            terms = self.ordered_terms(expr)
            negative = [term.as_coeff_Mul()[0] < 0 for term in terms]
            plain = not any(self.facts(term).nested for term in terms)
            if all(negative) or (negative[0] and plain):
                return (-factor) * (-expr)
        return factor * expr

    def text(self, expr: Any, latex: bool = False) -> str:
        """An expression as the book writes it; the plain form is Python as well."""
        known = self._printed.get((expr, latex))
        if known is None:
            terms = self.ordered_terms(expr) if expr.is_Add else [expr]
            known = signed_sum(self._signed(term, latex) for term in terms)
            self._printed[expr, latex] = known
        return known

    def _signed(self, term: Any, latex: bool) -> tuple[int, str]:
        import sympy

        factors = [f for f in sympy.Mul.make_args(term) if not f.is_number]
        number = sympy.Mul(*[f for f in sympy.Mul.make_args(term) if f.is_number])
        sign, number = (-1, -number) if number.is_negative else (1, number)
        words = []
        if number != 1 or not factors:
            text = sympy.latex(number) if latex else str(number)
            words.append(text if latex or not factors or text.isalnum() else f"({text})")
        powers = [f.as_base_exp() for f in factors]
        symbols = sorted(
            ((f, k) for f, k in powers if f in self._rank), key=lambda power: self._rank[power[0]]
        )
        words += [_power(self.latex[f] if latex else str(f), k, latex) for f, k in symbols]
        left, right = (r"\left(", r"\right)") if latex else ("(", ")")
        sums = [(f, k) for f, k in powers if f not in self._rank]
        words += [_power(f"{left}{self.text(f, latex)}{right}", k, latex) for f, k in sums]
        return sign, (r" \, " if latex else "*").join(words)


def _power(base: str, exponent: Any, latex: bool) -> str:
    if exponent == 1:
        return base
    return f"{base}^{{{exponent}}}" if latex else f"{base}**{exponent}"


def _subscript(angle: Angle, comma: str) -> str:
    """LaTeX subscript of a sine or cosine: joints by number, constants by symbol."""
    if any(t.sign < 0 for t in angle.terms):
        comma = "+"  # all the signs: 12-4 reads as 12 minus 4
    out = ""
    for t in angle.terms:
        plus = comma if t.joint else "+"
        out += ("-" if t.sign < 0 else plus if out else "") + (t.letters if t.joint else t.latex)
    if angle.turns:
        degrees = int(angle.turns * 180)
        out += rf"{degrees:+d}^{{\circ}}"
    return out


def _checked_names(names: Mapping[str, str] | None) -> dict[str, str]:
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
