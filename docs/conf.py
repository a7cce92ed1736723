"""The site of the documentation, made by `make docs`; what is special of it is in `_site/`."""

import os
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_site"), str(HERE.parent)]

from nldyn.base.version import software_version  # noqa: E402

project = "nldyn"
author = "the nldyn developers"
release = software_version()
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "from_sources",
]
root_doc = "README"
source_suffix = {".md": "markdown", ".py": "markdown"}  # of Python files only those of the gallery
exclude_patterns = ["conf.py", "_site", "examples"]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
autodoc_default_options = {"members": True}
autodoc_typehints = "none"  # the docstrings say types with shapes and units
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
maximum_signature_line_length = 88
suppress_warnings = ["ref.python"]  # names of attributes are no links
python_use_unqualified_type_names = True
toc_object_entries_show_parents = "hide"
viewcode_follow_imported_members = True
viewcode_line_numbers = True

if os.environ.get("NLDYN_DOCS_ONLINE"):  # links to types of others need their lists of names
    extensions.append("sphinx.ext.intersphinx")
    intersphinx_mapping = {
        "python": ("https://docs.python.org/3", None),
        "numpy": ("https://numpy.org/doc/stable", None),
        "scipy": ("https://docs.scipy.org/doc/scipy", None),
        "matplotlib": ("https://matplotlib.org/stable", None),
    }

html_theme = "furo"
html_title = f"nldyn {release}"
html_math_renderer = "mathml"  # browsers draw it without a script
html_show_copyright = False
html_copy_source = False
html_theme_options = {"sidebar_hide_name": False}
html_static_path = ["_site/static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
