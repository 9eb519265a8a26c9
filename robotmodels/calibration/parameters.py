"""The parameters that a calibration may estimate: deviations of elements of the extended table."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Rebuilt, as_vector, read_only
from .._choices import chosen
from ..errors import InvalidValueError, nearest_names
from ..geometry import FIXED, PRISMATIC, REVOLUTE
from ..model import RobotModel
from .elements import Compliance, Element, ErrorLaw
from .loads import gravity_loads
from .skeleton import Frame, Skeleton, skeleton_of

NEARLY_PARALLEL = 0.05
"""Sine of the angle between consecutive axes below which r_j gives way to beta_j (Hayati)."""
_TURNS = (Element.GAMMA, Element.BETA, Element.ALPHA)
"""Turns about the axes z, y, x of the frame that a row stands on."""


@dataclass(frozen=True, slots=True)
class GeometricParameter:
    """One parameter: the deviation of an element of a row, times its law.

    A compliance that is the same about several axes acts on further elements as well.

    Parameters
    ----------
    row : int
        Row of the extended table: 0 the base, 1 to f the frames, then the ends.
    element : Element
        Which of the seven elementary motions.
    law : ErrorLaw
        How it depends on the configuration.
    source : int
        Row of the joint that the law reads, or whose load bends; the row's own for constant errors.
    also : tuple of (int, Element, int)
        Further rows and elements that it acts on alike, each with the row of its source.

    Examples
    --------
    >>> GeometricParameter(3, Element.THETA, ErrorLaw.GAIN, 3).name
    'gain3'
    >>> GeometricParameter(6, Element.THETA, ErrorLaw.GAIN, 5).name
    'gain6_5'
    """

    row: int
    element: Element
    law: ErrorLaw = ErrorLaw.CONSTANT
    source: int = -1
    also: tuple[tuple[int, Element, int], ...] = ()

    @property
    def actions(self) -> tuple[tuple[int, Element, int], ...]:
        """All rows and elements that it acts on, and rows of the sources."""
        return ((self.row, self.element, self.source), *self.also)

    @property
    def moves_own_joint(self) -> bool:
        """Whether it adds to the variable of a joint alone."""
        own = self.element in (Element.THETA, Element.R)
        return own and not self.also and self.law is not ErrorLaw.CONSTANT

    @property
    def name(self) -> str:
        """``alpha3``, ``gain5``, ``gain6_5``: element or law, row, and the row of the source."""
        if self.law is ErrorLaw.CONSTANT:
            return f"{self.element.word}{self.row}"
        sources = {source for _, _, source in self.actions}
        if self.also:
            return f"{self.law.value}{self.source if len(sources) == 1 else '_joints'}"
        if self.law is ErrorLaw.COMPLIANCE and not self.moves_own_joint:
            return f"{self.law.value}_{self.element.word}{self.row}"
        other = "" if self.source == self.row else f"_{self.source}"
        return f"{self.law.value}{self.row}{other}"

    @property
    def unit(self) -> str:
        """Unit of the deviation, for a law that reads a revolute joint unless it is constant."""
        own = "m" if self.element.is_length else "rad"
        return {ErrorLaw.GAIN: "1", ErrorLaw.COMPLIANCE: f"{own}/N m"}.get(self.law, own)


@dataclass(frozen=True, slots=True, eq=False)
class GeometricParameters(Rebuilt):
    """Parameters of a robot, in the order in which they are preferred.

    Where two of them act alike the earlier is kept and the later regrouped into it: first the
    ends and the base, which are the least known and may be far off, then the variables of the
    joints, the rest of the table, and last what depends on the configuration.

    Parameters
    ----------
    skeleton : Skeleton
        The extended table.
    entries : tuple of GeometricParameter
        The parameters.

    References
    ----------
    Seed book section 1.4.2.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> candidate_parameters(load("rx90")).names[11:15]
    ('theta0', 'theta1', 'theta2', 'theta3')
    """

    skeleton: Skeleton
    entries: tuple[GeometricParameter, ...]
    names: tuple[str, ...] = field(init=False)
    """Names, shape (P,)."""
    actions: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]] = field(init=False)
    """Parameter, row and element of each action, shapes (A,): a parameter has one or more."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(entry.name for entry in self.entries))
        found = [
            (k, row, int(element))
            for k, entry in enumerate(self.entries)
            for row, element, _ in entry.actions
        ]
        columns = np.array(found, dtype=np.int64).reshape(-1, 3).T
        object.__setattr__(self, "actions", tuple(read_only(c, np.int64) for c in columns))

    @property
    def model(self) -> RobotModel:
        """The nominal robot."""
        return self.skeleton.model

    def __len__(self) -> int:
        return len(self.entries)

    def __repr__(self) -> str:
        """Names alone: the extended table holds the whole robot."""
        return f"<GeometricParameters of {self.model.name}: {', '.join(self.names)}>"

    @property
    def rows(self) -> NDArray[np.int64]:
        """Row of each parameter, shape (P,)."""
        return np.array([entry.row for entry in self.entries], dtype=np.int64)

    @property
    def nominal(self) -> Array:
        """Nominal value of each, rad or m; 0 for those that depend on the configuration."""
        values = self.skeleton.nominal
        return read_only([
            values[e.row, e.element] if e.law is ErrorLaw.CONSTANT else 0.0 for e in self.entries
        ])  # fmt: skip

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each deviation."""
        return tuple(entry.unit for entry in self.entries)

    def index(self, names: Iterable[str], what: str = "parameters") -> NDArray[np.int64]:
        """Positions of parameters by name.

        Parameters
        ----------
        names : iterable of str
            Names among `names`.
        what : str
            Used in the error message.

        Returns
        -------
        ndarray of int
            Positions.

        Raises
        ------
        InvalidValueError
            An unknown name; the message gives the nearest ones.
        """
        known = {name: k for k, name in enumerate(self.names)}
        found = []
        for name in as_names(names):
            if name not in known:
                near = ", ".join(nearest_names(str(name), known)) or ", ".join(self.names)
                raise InvalidValueError(
                    f"{what}: {name!r} is not a parameter of this calibration; near it: {near}."
                )
            found.append(known[name])
        return np.array(found, dtype=np.int64)

    def subset(self, names: Iterable[str]) -> Self:
        """Only some of the parameters, in this order of preference.

        Parameters
        ----------
        names : iterable of str
            Which.

        Returns
        -------
        GeometricParameters
            The subset.

        Raises
        ------
        InvalidValueError
            An unknown name.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> candidate_parameters(load("rx90")).subset(["d3", "theta2"]).names
        ('theta2', 'd3')
        """
        return replace(self, entries=tuple(self.entries[k] for k in sorted(self.index(names))))

    def preferring(self, names: Iterable[str]) -> Self:
        """The same parameters, some of them before the others.

        Parameters
        ----------
        names : iterable of str
            Which are preferred, in this order.

        Returns
        -------
        GeometricParameters
            In another order.

        Raises
        ------
        InvalidValueError
            An unknown name.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> candidate_parameters(load("rx90")).preferring(["d3"]).names[0]
        'd3'
        """
        first = [self.entries[k] for k in self.index(names)]
        rest = [entry for entry in self.entries if entry not in first]
        return replace(self, entries=(*first, *rest))

    def without(self, names: Iterable[str]) -> Self:
        """All but some of the parameters.

        Parameters
        ----------
        names : iterable of str
            Which to leave out: they stay at their nominal values.

        Returns
        -------
        GeometricParameters
            The others.

        Raises
        ------
        InvalidValueError
            An unknown name.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> full = candidate_parameters(load("rx90"))
        >>> len(full) - len(full.without(["r4"]))
        1
        """
        left_out = set(self.index(names).tolist())
        kept = tuple(e for k, e in enumerate(self.entries) if k not in left_out)
        return replace(self, entries=kept)

    def factors(self, q: ArrayLike) -> Array:
        """What each deviation is multiplied by at each configuration.

        Parameters
        ----------
        q : array_like, shape (N, n)
            Readings of the joints, rad or m.

        Returns
        -------
        ndarray, shape (N, A)
            For each of `actions`: 1 for constant errors; else by `ErrorLaw`.
        """
        q = np.atleast_2d(as_vector(q, self.model.n, "q"))
        owner, rows, elements = self.actions
        factor = np.ones((len(q), len(owner)))
        laws = [self.entries[k].law for k in owner]
        sources = [source for entry in self.entries for _, _, source in entry.actions]
        loaded = [c for c, law in enumerate(laws) if law is ErrorLaw.COMPLIANCE]
        if loaded:
            bent = [(int(rows[c]), Element(int(elements[c])), sources[c]) for c in loaded]
            factor[:, loaded] = gravity_loads(self.skeleton, q, bent)
        for c, law in enumerate(laws):
            if law in _LAWS:
                factor[:, c] = _LAWS[law](q[:, self.skeleton.joint[sources[c]]])
        return factor


_LAWS = {
    ErrorLaw.GAIN: lambda x: x,
    ErrorLaw.SINE: np.sin,
    ErrorLaw.COSINE: np.cos,
    ErrorLaw.SINE_2: lambda x: np.sin(2.0 * x),
    ErrorLaw.COSINE_2: lambda x: np.cos(2.0 * x),
}


def as_names(names: str | Iterable[str]) -> tuple[str, ...]:
    """Names at the border: one or several.

    Parameters
    ----------
    names : str or iterable of str
        What a caller passed; a text is one name.

    Returns
    -------
    tuple of str
        Names.

    Examples
    --------
    >>> as_names("r4")
    ('r4',)
    """
    return (names,) if isinstance(names, str) else tuple(names)


def candidate_parameters(
    model: RobotModel,
    frames: Sequence[Frame] = (None,),
    *,
    base: bool = True,
    tool: bool = True,
    gains: bool = False,
    couplings: Iterable[tuple[int, int]] = (),
    compliance: Compliance | str = Compliance.NONE,
    eccentricity: bool = False,
) -> GeometricParameters:
    """All parameters that a calibration of this robot may look at, by the book's rules.

    Each frame of the table has alpha, d, theta and r; where its axis is parallel to the one
    before, or nearly so, beta takes the place of r (Hayati), because the common perpendicular is
    then anywhere. The first row has theta and r alone, as the place of the robot says the rest.
    Branches have gamma and b as well. Base and tools have the book's six.

    Parameters
    ----------
    model : RobotModel
        The robot.
    frames : sequence of str, int or None
        The measured ends; None is the tool.
    base, tool : bool
        Whether the place of the robot, and those of the ends, may be off.
    gains : bool
        Whether ``q = K q_c + q_0`` has errors in the diagonal of K.
    couplings : iterable of (int, int)
        Pairs (j, i) of frames: the reading of joint i moves joint j.
    compliance : Compliance or str
        What gives way under gravity: ``"none"``, ``"joints"``, ``"links"``,
        ``"isotropic"`` or ``"uniform"`` (see `Compliance`).
    eccentricity : bool
        Whether readings have errors in the sine and cosine of the joint and of twice its value.

    Returns
    -------
    GeometricParameters
        Candidates in the order of preference.

    Raises
    ------
    InvalidValueError, FrameNotFoundError
        Not a model; unknown frames; a coupling of a frame that does not move; compliance asked of
        a robot without masses.

    References
    ----------
    Seed book section 1.4.2; S. Hayati, IEEE CDC 1983.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> candidate_parameters(load("rx90"), base=False, tool=False).names[5:9]
    ('theta6', 'r1', 'alpha2', 'd2')
    """
    skeleton = skeleton_of(model, frames)
    on_path = sorted({int(r) for frame in skeleton.frames for r in skeleton.path(frame)})
    table_rows = [r for r in on_path if 1 <= r <= model.f]
    moving = [r for r in table_rows if skeleton.sigma[r] != FIXED]
    own = {REVOLUTE: Element.THETA, PRISMATIC: Element.R}
    # lengths first: three of them place a point whatever the angles, also near the last axis
    six = [Element.B, Element.D, Element.R, Element.GAMMA, Element.ALPHA, Element.THETA]
    places = [(r, e) for r in on_path if r > model.f for e in six] if tool else []
    places += [(0, e) for e in six] if base else []
    rest = [(r, own[int(skeleton.sigma[r])]) for r in moving]
    for row in table_rows:
        rest += [(row, element) for element in _elements_of(skeleton, row, on_path)]
    entries = [GeometricParameter(r, e, source=r) for r, e in dict.fromkeys([*places, *rest])]
    laws: list[ErrorLaw] = []
    if eccentricity:
        laws += [ErrorLaw.SINE, ErrorLaw.COSINE, ErrorLaw.SINE_2, ErrorLaw.COSINE_2]
    if gains:
        laws.append(ErrorLaw.GAIN)
    compliance = chosen(Compliance, compliance, "compliance")
    if compliance is not Compliance.NONE and not model.inertia.values.any():
        raise InvalidValueError(
            "compliance: the robot gives way under gravity, but this one has no masses. "
            "Give it inertial parameters (with_inertia), or leave compliance out."
        )
    if compliance in (Compliance.JOINTS, Compliance.LINKS):
        laws.append(ErrorLaw.COMPLIANCE)
    for law in laws:
        for r in moving:
            kind = int(skeleton.sigma[r])
            if kind == PRISMATIC and law not in (ErrorLaw.GAIN, ErrorLaw.COMPLIANCE):
                continue  # a linear scale has no turn to be off its axis
            entries.append(GeometricParameter(r, own[kind], law, r))
    if compliance is Compliance.LINKS:
        bent = [(0, e, 0) for e in _TURNS]
        bent += [
            (s, e, r) for r in moving for s in _successors(skeleton, on_path, r) for e in _TURNS[1:]
        ]
        entries += [GeometricParameter(s, e, ErrorLaw.COMPLIANCE, r) for s, e, r in bent]
    if compliance in (Compliance.ISOTROPIC, Compliance.UNIFORM):
        at_mount = [(0, e, 0) for e in _TURNS]
        at_joints = [
            [(s, e, r) for s in _successors(skeleton, on_path, r) for e in _TURNS] for r in moving
        ]
        if compliance is Compliance.UNIFORM:
            at_joints = [[action for actions in at_joints for action in actions]]
        for (row, element, source), *also in [at_mount, *at_joints]:
            law = ErrorLaw.COMPLIANCE
            entries.append(GeometricParameter(row, element, law, source, tuple(also)))
    for j, i in couplings:
        if j not in moving or i not in moving or i == j:
            raise InvalidValueError(
                f"couplings: expected pairs of two different moving frames among {moving}, got "
                f"({j}, {i})."
            )
        entries.append(GeometricParameter(j, own[int(skeleton.sigma[j])], ErrorLaw.GAIN, i))
    return GeometricParameters(skeleton, tuple(entries))


def _successors(skeleton: Skeleton, on_path: list[int], row: int) -> list[int]:
    return [s for s in on_path if skeleton.antecedent[s] == row]


def _elements_of(skeleton: Skeleton, row: int, on_path: list[int]) -> list[Element]:
    """Elements of a row of the table that may be off, besides its joint's own."""
    antecedent = int(skeleton.antecedent[row])
    siblings = [r for r in on_path if skeleton.antecedent[r] == antecedent]
    branch = row != siblings[0]
    if antecedent == 0 and not branch:
        return [Element.THETA, Element.R]
    elements = [Element.ALPHA, Element.D, Element.THETA, Element.R]
    beta, alpha = skeleton.nominal[row, [Element.BETA, Element.ALPHA]]
    along = abs(np.cos(beta) * np.cos(alpha))
    if along > np.sqrt(1.0 - NEARLY_PARALLEL**2):
        elements.insert(2, Element.BETA)
        if skeleton.sigma[row] != PRISMATIC:
            elements.remove(Element.R)
    if branch:
        elements += [Element.GAMMA, Element.B]
    return elements
