"""Status of a pose: a small number per pose whose value is a sentence."""

from __future__ import annotations

from .._outcomes import Outcome


class IGMStatus(Outcome):
    """Outcome of an inverse geometric model for one pose; fits int8.

    ``REACHED``, ``REACHED_FAMILY`` and ``INCOMPLETE`` come with solutions, the others state
    why there is none.

    Attributes
    ----------
    sentence : str
        The status as a sentence.

    Examples
    --------
    >>> IGMStatus.TOO_FAR.sentence
    'The position is out of reach: too far.'
    >>> IGMStatus(0)
    <IGMStatus.REACHED: 0>
    """

    REACHED = 0, "The pose is reached."
    REACHED_FAMILY = 1, "The pose is reached by an infinite family of postures."
    OUTSIDE_LIMITS = 2, "The pose is reached only outside the joint limits."
    TOO_FAR = 3, "The position is out of reach: too far."
    TOO_NEAR = 4, "The position is out of reach: too near."
    ORIENTATION_NOT_AVAILABLE = (
        5, "The position is reached, but the orientation is not available there.",
    )  # fmt: skip
    NOT_CONVERGED = 6, "No posture was found that meets the pose."
    INCOMPLETE = 7, "The pose is reached; other postures may be missing."
