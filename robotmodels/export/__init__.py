"""Flat code of models in C, Python, NumPy, CasADi and MATLAB.

`program` writes a model of a robot once, as straight-line operations; a `Program` runs, counts its
operations and prints itself in five languages, and `write` makes a file.
"""

from .. import _docs
from .models import program
from .source import Program, write
from .tape import OperationCount

__all__ = ["OperationCount", "Program", "program", "write"]

_docs.document(__name__)
