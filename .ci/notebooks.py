"""Check that every notebook is stripped, run it with this interpreter's kernel, export the page.

The pages are for looking at figures and scenes. Those of nbconvert take MathJax and other scripts
from the network, so that formulas stay plain text without it; the course as it is read is in the
site made from `docs`, which needs no network.
"""

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
from nbclient import NotebookClient
from nbconvert import HTMLExporter
from traitlets.config import Config

LONGEST = 600.0  # seconds for the whole course


def leftovers(notebook: nbformat.NotebookNode) -> list[int]:
    """Numbers of the cells that still carry an output or an execution count."""
    return [
        number
        for number, cell in enumerate(notebook.cells, start=1)
        if cell.cell_type == "code" and (cell.outputs or cell.execution_count is not None)
    ]


def complaints(notebook: nbformat.NotebookNode) -> list[str]:
    """Errors, and what went to the error stream: a course shows neither."""
    return [
        f"cell {number}: {output.get('text') or output.get('evalue')}"
        for number, cell in enumerate(notebook.cells, start=1)
        for output in cell.get("outputs", [])
        if output.output_type == "error" or output.get("name") == "stderr"
    ]


def run(path: Path, results: Path, sockets: Path) -> tuple[Path, float]:
    """Execute one notebook and write it, with outputs, as a notebook and as a page; its seconds."""
    start = time.perf_counter()
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    if cells := leftovers(notebook):
        sys.exit(f"{path.name} is not stripped: clear the outputs of cells {cells}")
    # sockets in a private folder: nothing listens on the network
    private = Config({"KernelManager": {"transport": "ipc", "ip": str(sockets / path.name[:2])}})
    where = {"metadata": {"path": str(results)}}  # so nothing lands in the checkout
    client = NotebookClient(
        notebook, timeout=LONGEST, kernel_name="python3", resources=where, config=private
    )
    client.execute()
    nbformat.write(notebook, results / path.name)
    page, _ = HTMLExporter().from_notebook_node(notebook)
    (results / path.with_suffix(".html").name).write_text(page, encoding="utf-8")
    if found := complaints(notebook):
        sys.exit("\n".join([f"{path.name} does not run in silence:", *found]))
    return path, time.perf_counter() - start


def main(folder: Path, results: Path) -> None:
    """Run the notebooks of ``folder`` and write what comes of them to ``results``."""
    paths = sorted(folder.glob("*.ipynb"))
    if not paths:
        sys.exit(f"no notebook in {folder}")
    total = 0.0
    with TemporaryDirectory() as work:
        # the list of fonts is made here: the caller's may be that of other fonts, and says so
        os.environ["MPLCONFIGDIR"] = work
        subprocess.run(
            [sys.executable, "-c", "import matplotlib.font_manager"],
            check=True,
            stderr=subprocess.DEVNULL,
        )
        with ThreadPoolExecutor(2) as pool:  # the kernels are processes: two run at a time
            for path, took in pool.map(lambda path: run(path, results, Path(work)), paths):
                total += took
                print(f"{path.name}: ran in {took:.1f} s", flush=True)
    print(f"{len(paths)} notebooks in {total:.0f} s")
    if total > LONGEST:
        sys.exit(f"the course may take {LONGEST:.0f} s")


main(Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve())
