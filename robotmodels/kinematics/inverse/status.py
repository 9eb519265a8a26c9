"""What became of a twist: a small number per row whose value is a sentence."""

from __future__ import annotations

from ..._outcomes import Outcome


class IKMStatus(Outcome):
    """Outcome of an inverse kinematic model for one row; fits int8.

    Joint velocities come with every status; what they miss is in the ``error`` of the result.

    Attributes
    ----------
    sentence : str
        What a person reads.

    Examples
    --------
    >>> IKMStatus.MET.sentence
    'The motion is met.'
    >>> IKMStatus(4)
    <IKMStatus.LIMITED: 4>
    """

    MET = 0, "The motion is met."
    IN_PART = 1, "The motion is met in part: its weak directions are kept slow near a singularity."
    SINGULAR = 2, "The motion has a part that cannot be produced at this singular position."
    TOO_FEW_JOINTS = (
        3, "The motion has a part that cannot be produced: too few degrees of freedom.",
    )  # fmt: skip
    LIMITED = 4, "The motion is kept within the limits of the joints, which cannot follow it."
