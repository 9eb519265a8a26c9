"""Units of files, as the commands that read files declare them."""

from __future__ import annotations

from typing import Any


def add_units(files: Any) -> None:
    """Add the options for the units of angles and lengths.

    Parameters
    ----------
    files : argparse parser or group
        Where to add them.

    Examples
    --------
    >>> import argparse
    >>> parser = argparse.ArgumentParser()
    >>> add_units(parser)
    >>> parser.parse_args(["--angles", "deg"]).angles
    'deg'
    """
    for option, units, of in (
        ("--angles", ("rad", "deg"), "angles"),
        ("--lengths", ("m", "mm"), "lengths, also of prismatic joints,"),
    ):
        files.add_argument(option, choices=units, default=units[0],
                           help=f"unit of {of} in the files (default: %(default)s)")  # fmt: skip
