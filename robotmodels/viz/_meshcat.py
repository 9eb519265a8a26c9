"""The files of meshcat that describe scenes, without its server.

``import meshcat`` brings IPython, tornado and ZeroMQ for a server that no page needs. Its modules
``commands``, ``geometry``, ``animation`` and ``path`` need none of them: they are imported from its
folder as parts of this module.
"""

from importlib.util import find_spec
from pathlib import Path

from ..errors import MissingExtraError

_found = find_spec("meshcat")  # imports nothing
if _found is None or not _found.submodule_search_locations:
    raise MissingExtraError("pictures need meshcat; run: pip install 'meshcat>=0.3.2'")
__path__ = list(_found.submodule_search_locations)
VIEWER = Path(__path__[0]) / "viewer" / "dist" / "main.min.js"
"""The script of the viewer."""
