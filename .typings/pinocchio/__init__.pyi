# The `pin` wheel has no type information: everything read from it is Any.
from typing import Any

def __getattr__(name: str) -> Any: ...
