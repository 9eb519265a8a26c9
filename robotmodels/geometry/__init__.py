"""The geometric description: the Khalil-Kleinfinger table and its transforms."""

from .. import _docs
from .joint_kinds import FIXED, PRISMATIC, REVOLUTE
from .names import NOT_XML, constant_names
from .table import DHTable
from .transforms import constant_factors, link_transforms

__all__ = [
    "DHTable",
    "FIXED",
    "NOT_XML",
    "PRISMATIC",
    "REVOLUTE",
    "constant_factors",
    "constant_names",
    "link_transforms",
]

_docs.document(__name__)
