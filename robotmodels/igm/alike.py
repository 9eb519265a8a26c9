"""A family prepared for a chain that differs from another in its numbers only.

What was chosen and tested for the other is taken over: no search, no self-test. Families register
how; those that do not are prepared as new.
"""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch

import numpy as np

from .. import se3
from .._arrays import read_only
from .chain import canonical_frames
from .closed_form import ClosedForm, prepare_closed_form
from .general import GeneralArm
from .loop import JointChain
from .solver import Prepare, Solver


@singledispatch
def prepare_alike(known: Solver, chain: JointChain, prepare: Prepare) -> Solver | None:
    """Prepare a solver for a chain of the same structure as a prepared one."""
    return prepare(chain)


@prepare_alike.register
def _(known: ClosedForm, chain: JointChain, prepare: Prepare) -> Solver | None:
    return prepare_closed_form(chain) or prepare(chain)


@prepare_alike.register
def _(known: GeneralArm, chain: JointChain, prepare: Prepare) -> Solver | None:
    structured = prepare_closed_form(chain)
    if structured is not None:
        return structured
    # the same representations of the loop, with this chain's links
    D, unit = canonical_frames(chain)
    inverse = np.array([se3.inverse(T) for T in D])
    ways = tuple(
        replace(
            way,
            links=read_only(
                np.array([D[j + 1] if way.direction == 1 else inverse[j] for j in way.joints])
            ),
        )
        for way in known.solver.representations
    )
    solver = replace(known.solver, D=read_only(D), unit=unit, representations=ways)
    return GeneralArm(chain, solver)
