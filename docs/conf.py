"""How the site is built: ``sphinx-build -W -q docs site`` from the checkout.

The notebooks are executed by the build. Where they have run already (CI runs them), name the
folder with the executed ones: ``sphinx-build -W -q -D executed_notebooks=FOLDER docs site``; with
``-D nb_execution_mode=off`` they appear without their results. Nothing of the site is asked from
another server: MathJax comes from a wheel, the search index is local.
"""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_extensions"))
sys.path.insert(0, str(HERE.parent))  # the checkout that is described, installed or not

import robotmodels  # noqa: E402

project = "robotmodels"
author = "the robotmodels authors"
project_copyright = author
release = robotmodels.__version__
version = release

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "numpydoc",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",
    "names",
    "notebooks",
]
exclude_patterns = ["_extensions", "**/.ipynb_checkpoints"]

# --- docstrings ----------------------------------------------------------------------------------

default_role = "py:obj"  # a name in backticks is a link where the reference has it
add_module_names = False
toc_object_entries_show_parents = "hide"
python_use_unqualified_type_names = True
autodoc_typehints = "none"  # the docstrings say types, shapes and units
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
numpydoc_show_class_members = False  # autodoc lists them, those with a docstring
numpydoc_class_members_toctree = False

# --- pages ---------------------------------------------------------------------------------------

myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence"]
myst_heading_anchors = 4
myst_dmath_double_inline = True
nb_execution_mode = "force"
nb_execution_timeout = 600
nb_execution_in_temp = True  # nothing lands in the checkout
nb_execution_raise_on_error = True
nb_ipywidgets_js = {}  # no notebook has widgets; their scripts would come from elsewhere
nb_merge_streams = True

# --- looks ---------------------------------------------------------------------------------------

html_theme = "furo"
html_title = f"robotmodels {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
pygments_style = "default"
pygments_dark_style = "monokai"
