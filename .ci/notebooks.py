"""Check that every notebook is stripped, and run it with this interpreter's kernel."""

import sys
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient


def leftovers(notebook: nbformat.NotebookNode) -> list[int]:
    """Numbers of the cells that still carry an output or an execution count."""
    return [
        number
        for number, cell in enumerate(notebook.cells, start=1)
        if cell.cell_type == "code" and (cell.outputs or cell.execution_count is not None)
    ]


def main(folder: Path, results: Path) -> None:
    """Execute the notebooks of ``folder`` and write them, with outputs, to ``results``."""
    paths = sorted(folder.glob("*.ipynb"))
    if not paths:
        sys.exit(f"no notebook in {folder}")
    for path in paths:
        notebook = nbformat.read(path, as_version=4)
        nbformat.validate(notebook)
        if cells := leftovers(notebook):
            sys.exit(f"{path.name} is not stripped: clear the outputs of cells {cells}")
        start = time.perf_counter()
        where = {"metadata": {"path": str(results)}}  # so nothing lands in the checkout
        NotebookClient(notebook, timeout=600, kernel_name="python3", resources=where).execute()
        nbformat.write(notebook, results / path.name)
        print(f"{path.name}: ran in {time.perf_counter() - start:.1f} s")


main(Path(sys.argv[1]), Path(sys.argv[2]))
