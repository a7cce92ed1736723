"""What the site takes from elsewhere: lists of pages, docstrings, the gallery, formulas.

The pages stay plain Markdown that can be read in the repository. Before Sphinx parses them, the
list of pages becomes the navigation, ``{public}`` becomes the table of a room's names, and a script
of the gallery becomes a page and a notebook.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

import jupytext
from docutils import nodes
from latex2mathml.converter import convert
from public import PUBLIC, table, write_pages
from scene_search import SceneDomain, with_places
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

DOCS = Path(__file__).resolve().parents[1]
LISTED = re.compile(r"^\*\*([\w ]+)\*\*:(.*?)(?:\n\n|\Z)", flags=re.M | re.S)
FRONT = '<!doctype html><meta http-equiv="refresh" content="0; url=README.html">'


def navigation(text: str) -> str:
    """The list of pages as hidden tables of contents, one for each paragraph of it."""
    for caption, body in LISTED.findall(text):
        pages = "\n".join(re.findall(r"\]\(([\w/-]+)\.md\)", body))
        text += f"\n\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{pages}\n```\n"
    return text


def parts_of(script: str) -> tuple[str, str, str]:
    """Title, text and code of a script of the gallery."""
    title, _, text = (ast.get_docstring(ast.parse(script)) or "").partition("\n")
    code = script.split('"""', 2)[2].strip()
    return title.rstrip("."), text.strip(), code


def gallery_page(script: str, name: str) -> str:
    """A script of the gallery as a page."""
    title, text, code = parts_of(script)
    return (
        f"# {title}\n\n{text}\n\n![{title}](images/{name}.png)\n\n```python\n{code}\n```\n\n"
        f'<a href="{name}.ipynb" download>As a notebook</a>, '
        f'<a href="{name}.py" download>as a script</a>. [All examples](README.md)\n'
    )


def notebook(script: str) -> str:
    """A script of the gallery as a notebook, as JSON."""
    title, text, code = parts_of(script)
    said = "\n".join(f"# {line}".rstrip() for line in f"# {title}\n\n{text}".splitlines())
    cells = jupytext.reads(f"{said}\n\n{code}\n", "py:light")  # a cell for each paragraph
    return jupytext.writes(cells, "ipynb")


def without_far_links(text: str, folder: Path) -> str:
    """The text without links to folders, programs and other files that are no part of the site."""

    def kept(link: re.Match[str]) -> str:
        target = folder / link[2]
        program = target.suffix == ".py" and target.parent.name != "gallery"
        outside = DOCS not in target.resolve().parents
        return link[1] if target.is_dir() or program or outside else link[0]

    return re.sub(r"(?<!!)\[([^\]]*)\]\(([\w./-]+)\)", kept, text)


def plain_references(*event: Any) -> None:
    """Numbers of references as text: docutils takes them for links, which are no one's own."""
    lines = event[-1]
    lines[:] = [re.sub(r"\[(\d+)\]_", r"[\1]", line) for line in lines]
    lines[:] = [re.sub(r"^\.\. \[(\d+)\]", r"*  [\1]", line) for line in lines]


def read_source(app: Sphinx, page: str, source: list[str]) -> None:
    """Make Markdown of what is not yet."""
    path = Path(app.env.doc2path(page))
    if page == app.config.root_doc:
        source[0] = navigation(source[0])
    elif path.suffix == ".py":
        source[0] = gallery_page(source[0], path.stem)
    elif page == "reference/scene":
        source[0] = with_places(source[0])[0]
    elif page == "gallery/README":
        source[0] += "\n```{toctree}\n:hidden:\n:glob:\n\n[!R]*\n```\n"
    source[0] = without_far_links(source[0], path.parent)
    source[0] = PUBLIC.sub(lambda found: table(found[1], page), source[0])


def finish(app: Sphinx, exception: Exception | None) -> None:
    """Write the front page, and scripts and notebooks of the gallery."""
    if exception:
        return
    (app.outdir / "index.html").write_text(FRONT, encoding="utf-8")
    for path in (app.srcdir / "gallery").glob("*.py"):
        script = path.read_text(encoding="utf-8")
        (app.outdir / "gallery" / path.name).write_text(script, encoding="utf-8")
        book = (app.outdir / "gallery" / path.name).with_suffix(".ipynb")
        book.write_text(notebook(script), encoding="utf-8")


def inline_formula(translator: HTML5Translator, node: nodes.math) -> None:
    """A formula within a line."""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def formula(translator: HTML5Translator, node: nodes.math_block) -> None:
    """A formula on a line of its own."""
    translator.body.append(convert(node.astext(), display="block"))
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Take part in the build."""
    write_pages(DOCS)
    app.add_domain(SceneDomain)
    app.connect("source-read", read_source)
    app.connect("build-finished", finish)
    app.connect("autodoc-process-docstring", plain_references, priority=1000)
    app.add_html_math_renderer("mathml", (inline_formula, None), (formula, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
