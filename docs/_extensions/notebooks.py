"""Bring the notebooks, which live beside the site's sources, among its pages."""

from pathlib import Path

from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.errors import ConfigError


def bring(app: Sphinx, config: Config) -> None:
    """Copy what has changed into ``notebooks/`` of the sources; git ignores the copies."""
    source = Path(app.srcdir).parent / "notebooks"
    if config.executed_notebooks:
        source = Path(config.executed_notebooks).resolve()
        config.nb_execution_mode = "off"
    found = sorted(source.glob("[0-9]*.ipynb"))
    if not found:
        raise ConfigError(f"there are no notebooks in {source}")
    target = Path(app.srcdir) / "notebooks"
    target.mkdir(exist_ok=True)
    for old in target.glob("*.ipynb"):
        if old.name not in {path.name for path in found}:
            old.unlink()
    for path in found:
        text, copy = path.read_bytes(), target / path.name
        if not copy.exists() or copy.read_bytes() != text:
            copy.write_bytes(text)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register it, and the name of the folder."""
    app.add_config_value("executed_notebooks", "", "env", (str,))
    app.connect("config-inited", bring)
    return {"parallel_read_safe": True}
