"""Settings of the documentation site; `make docs` builds it into out/docs, offline, warnings as errors.

A line `<!-- generated: name -->` of a page stands for what `_generate.pages.PAGES[name]()` says of the
package as it is: such a part cannot go stale and is never written into the source tree.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))  # _generate
sys.path.insert(0, str(HERE.parent))

from _generate.docstrings import spread  # noqa: E402
from _generate.mathml import register  # noqa: E402
from _generate.pages import PAGES  # noqa: E402

import bayesid  # noqa: E402

project = "bayesid"
author = "bayesid authors"
copyright = "bayesid authors, MIT licence"
version = release = bayesid.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_generate"]
myst_enable_extensions = ["dollarmath", "deflist", "colon_fence", "attrs_inline"]
myst_heading_anchors = 3
smartquotes = False  # options begin with two hyphens

nitpicky = True
# types of the standard library, numpy and pandas, whose own pages cannot be asked offline
nitpick_ignore_regex = [("py:.*", ".*")]
# a folder may hold one page or none that another part of the project adds (raw logs)
suppress_warnings = ["toc.empty_glob"]

autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

html_theme = "furo"
html_title = "bayesid"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_last_updated_fmt = None
html_math_renderer = "mathml"

_GENERATED = re.compile(r"^<!-- generated: (\w+) -->$", re.MULTILINE)


def fill_generated(app, docname, source):
    """Put what the package says of itself in the place of each marker."""
    source[0] = _GENERATED.sub(lambda found: PAGES[found.group(1)](), source[0])


def spread_docstring(app, what, name, found, options, lines):
    """Docstrings of the house as numpydoc has them."""
    lines[:] = spread(lines)


def draw_gallery(app):
    """Run the scripts of the gallery whose picture is older than they are; their pictures are not kept."""
    folder = HERE / "gallery" / "made"
    folder.mkdir(exist_ok=True)
    environment = {**os.environ, "PYTHONPATH": str(HERE.parent)}
    for script in sorted((HERE / "gallery").glob("*.py")):
        picture = folder / f"{script.stem}.png"
        if not picture.exists() or picture.stat().st_mtime < script.stat().st_mtime:
            subprocess.run([sys.executable, str(script), str(picture)], check=True, env=environment)


def setup(app):
    register(app)
    app.connect("builder-inited", draw_gallery)
    app.connect("source-read", fill_generated)
    app.connect("autodoc-process-docstring", spread_docstring, priority=100)  # before napoleon
    return {"parallel_read_safe": True}
