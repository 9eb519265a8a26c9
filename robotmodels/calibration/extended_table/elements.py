"""The seven elementary motions of a row of the table, and how an error of one acts."""

from __future__ import annotations

from enum import Enum, IntEnum


class Element(IntEnum):
    """Elementary motions of a row, in the order in which they follow each other.

    ``Rot(z, gamma) Trans(z, b) Rot(y, beta) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r)``

    References
    ----------
    Seed book section 1.4.2, eq. [1.3]; S. Hayati, IEEE CDC 1983, for beta.

    Examples
    --------
    >>> Element.D.is_length, Element.D.word
    (True, 'd')
    """

    GAMMA = 0
    B = 1
    BETA = 2
    ALPHA = 3
    D = 4
    THETA = 5
    R = 6

    @property
    def is_length(self) -> bool:
        """Whether it is a translation, in metres."""
        return self in (Element.B, Element.D, Element.R)

    @property
    def word(self) -> str:
        """Name of the element as in the table's columns."""
        return self.name.lower()


class ErrorLaw(Enum):
    """How the error of an element depends on the configuration.

    A member's value is what the names of its parameters begin with; a constant error is called by
    its element. Every law is linear in its parameter, whose factor is

    ============  =============================================================
    CONSTANT      1
    GAIN          the reading of a joint (rad or m); of another joint: coupling
    COMPLIANCE    minus the gravity torque of a joint (N m or N)
    SINE, COSINE  of the reading: an encoder that is mounted off its axis
    SINE_2, ...   of twice the reading: a graduated disc that is not flat
    ============  =============================================================

    Examples
    --------
    >>> ErrorLaw.GAIN.value
    'gain'
    """

    CONSTANT = ""
    GAIN = "gain"
    COMPLIANCE = "compliance"
    SINE = "sine"
    COSINE = "cosine"
    SINE_2 = "sine_2_"
    COSINE_2 = "cosine_2_"


class Compliance(Enum):
    """What gives way under gravity, in proportion to its moment there.

    Examples
    --------
    >>> Compliance.ISOTROPIC.value
    'joints and mount, the same about all axes'
    """

    NONE = "nothing"
    JOINTS = "joints about their axes"
    LINKS = "joints, links about alpha and beta, and the mount, each for itself"
    ISOTROPIC = "joints and mount, the same about all axes"
    UNIFORM = "one for all joints and one for the mount, the same about all axes"
