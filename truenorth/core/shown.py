"""What can be done with any result: draw it, write it into a folder, read it back, show it in a notebook.

A result is data and imports neither figures nor reports. Who draws and writes each type stands in one table above, in
:mod:`truenorth.results`; the functions and the mixin here look it up when they are called.
"""

from __future__ import annotations

import base64
import io
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truenorth.core.errors import DataError, UsageError
from truenorth.core.paths import as_path

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

Write = Callable[[Path], object]
Lazy = str | Callable[..., Any] | None  # a function, or its "module:name", imported when it is needed

TABLE = "truenorth.results"
ARCHIVE = "result.npz"
REPORT = "report.html"
PICTURE_DPI = 75
PICTURE_COLOURS = 256, 96  # those of a drawing, edges of its lines and all; of one that is full of lines
PICTURE_SIZE = 72_000  # bytes: a notebook keeps every picture, a third larger as text
NO_FIGURES = "figures need matplotlib: pip install 'truenorth[plot]'"


@dataclass(frozen=True)
class Views:
    """How one type of result is drawn and written.

    Attributes
    ----------
    plot : function or "module:name", optional
        ``plot(result, **options) -> matplotlib Figure``.
    files : function or "module:name", optional
        ``files(result) -> {name: write(path)}``; None for a file of an earlier result that this one does not have.
    page : function or "module:name", optional
        ``page(result) -> str``: the text of report.html.
    archive : bool
        Whether the result is kept whole in result.npz, from which :func:`load` reads it.
    marker, load : str and function or "module:name", optional
        A file by which a folder of this type is known, and ``load(folder) -> result``.
    """

    plot: Lazy = None
    files: Lazy = None
    page: Lazy = None
    archive: bool = True
    marker: str = ARCHIVE
    load: Lazy = None


_VIEWS: dict[str, Views] = {}


def register_result(kind: type | str, views: Views) -> None:
    """Register how results of a type are drawn and written; a later registration replaces an earlier one.

    Parameters
    ----------
    kind : type or str
        The class, or its ``module:name``.
    views : Views
    """
    _VIEWS[kind if isinstance(kind, str) else name_of(kind)] = views


def plot(result: Any, **options: Any) -> Figure:
    """Draw a result.

    Parameters
    ----------
    result : Alignment, Navigation, Inspection, Advice, Simulation, Campaign or a registered type
    **options
        Of the type's own plotter.

    Returns
    -------
    matplotlib.figure.Figure
        Its `savefig` works without a display. A campaign gives several, by name.

    Raises
    ------
    UsageError
        A type that nothing draws; matplotlib is not installed.
    """
    if not can_draw():
        raise UsageError(NO_FIGURES)
    drawn: Figure = _view(result, "plot")(result, **options)
    _shown_in_notebooks()
    return drawn


def can_draw() -> bool:
    """Whether matplotlib is installed, which figures need and nothing else does."""
    try:
        return find_spec("matplotlib") is not None
    except ValueError:  # taken out of sys.modules
        return False


def _shown_in_notebooks() -> None:
    """Let a notebook show a figure that ends a cell, without a magic line and without pyplot."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if shell is not None:
        shell.display_formatter.formatters["image/png"].for_type_by_name("matplotlib.figure", "Figure", _png)


def _png(figure: Figure) -> bytes:
    """A picture for a notebook, which keeps every one: in as many colours as a drawing has."""
    from PIL import Image  # comes with matplotlib

    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=PICTURE_DPI)
    with Image.open(drawn) as opened:
        picture = opened.convert("RGB")
    # The first palette keeps pale grounds and thin lines as they are, the second covers all hues with fewer colours.
    for colours, palette in zip(PICTURE_COLOURS, (Image.Quantize.MEDIANCUT, Image.Quantize.MAXCOVERAGE), strict=True):
        small = io.BytesIO()
        picture.quantize(colours, palette, kmeans=1, dither=Image.Dither.NONE).save(small, "png", optimize=True)
        if small.tell() <= PICTURE_SIZE:
            break
    return small.getvalue()


def save(result: Any, folder: str | PathLike[str]) -> list[Path]:
    """Write a result into a folder: tables, summary, report, and result.npz from which :func:`load` reads it back.

    All files are written before the first takes its name, so that an interrupt leaves those of an earlier result together. A file
    of an earlier result that this one does not have is removed.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    UsageError
        A type that nothing writes, or a folder that cannot be written to.
    """
    from truenorth.core.archive import write_archive
    from truenorth.core.atomic import atomic_files, writable_folder, write_text

    views = views_of(result)
    files: dict[str, Write | None] = dict(_view(result, "files")(result))
    if views.page is not None:
        files[REPORT] = lambda path: write_text(path, _function(views.page)(result))
    if views.archive:
        files[ARCHIVE] = lambda path: write_archive(result, path)
    target = writable_folder(folder)
    with atomic_files() as file:
        for name, write in files.items():
            path = file(target / name, gone=write is None)
            if write is not None:
                write(path)
    return [target / name for name, write in files.items() if write is not None]


def load(folder: str | PathLike[str]) -> Any:
    """Read the result that :func:`save` wrote into a folder.

    Returns
    -------
    Alignment, Navigation, Inspection, Advice, Campaign or a registered type

    Raises
    ------
    DataError
        The folder holds no result, or one of another version.
    """
    from truenorth.core.archive import read_archive

    _own_table()
    path = as_path(folder, "folder")
    for views in _VIEWS.values():
        if views.load is not None and (path / views.marker).is_file():
            return _function(views.load)(path)
    if path.is_dir() and not (path / ARCHIVE).is_file():
        raise DataError(f"{path}: no {ARCHIVE} in this folder; expected a folder that truenorth.save wrote")
    return read_archive(path / ARCHIVE if path.is_dir() else path, more=_VIEWS)


def page_of(result: Any) -> str:
    """The text of the HTML page of a result.

    Raises
    ------
    UsageError
        A type that has no page.
    """
    return str(_view(result, "page")(result))


def views_of(result: Any) -> Views:
    """The registered views of a result's type, or of the nearest base class that has some.

    Raises
    ------
    UsageError
        Nothing is registered.
    """
    _own_table()
    for kind in type(result).__mro__:
        if (found := _VIEWS.get(name_of(kind))) is not None:
            return found
    raise UsageError(
        f"{type(result).__name__} is not a registered type of result; register it by truenorth.register_result"
    )


class Shown:
    """Mixin of results: `plot`, `save`, a short ``repr``, a picture and a short table in a notebook."""

    def in_brief(self) -> Mapping[str, str]:
        """The few facts that a person wants first, by name."""
        return {}

    def plot(self, **options: Any) -> Figure:
        """Draw the result; see :func:`truenorth.plot`."""
        return plot(self, **options)

    def save(self, folder: str | PathLike[str]) -> list[Path]:
        """Write the result into a folder and return the paths; see :func:`truenorth.save`."""
        return save(self, folder)

    def to_xarray(self) -> xarray.Dataset:
        """The table of `to_frame` as an xarray data set.

        Raises
        ------
        UsageError
            xarray is not installed.
        """
        return as_xarray(self.to_frame())  # type: ignore[attr-defined]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{key}: {text}' for key, text in self.in_brief().items())})"

    @cached_property
    def _picture(self) -> bytes | None:
        """PNG of the figure; None where the result has nothing to draw."""
        try:
            figure = plot(self)
        except (UsageError, ValueError):
            return None
        if not hasattr(figure, "savefig"):
            return None
        return _png(figure)

    def _repr_png_(self) -> bytes | None:
        return self._picture

    def _repr_html_(self) -> str:
        import html  # in notebooks alone

        rows = "".join(
            f"<tr><th style='text-align:left'>{html.escape(key)}</th><td style='text-align:left'>{html.escape(text)}</td></tr>"
            for key, text in self.in_brief().items()
        )
        picture = self._picture
        image = "" if picture is None else f"<img src='data:image/png;base64,{base64.b64encode(picture).decode()}'>"
        return f"<strong>{type(self).__name__}</strong><table>{rows}</table>{image}"


def as_xarray(frame: Any) -> xarray.Dataset:
    """A pandas table as an xarray data set.

    Raises
    ------
    UsageError
        xarray is not installed.
    """
    try:
        import xarray
    except ImportError:
        raise UsageError("xarray is not installed; install it (pip install xarray), or use to_frame()") from None
    return xarray.Dataset.from_dataframe(frame)


def name_of(kind: type) -> str:
    """``module:name`` of a type."""
    return f"{kind.__module__}:{kind.__qualname__}"


def _own_table() -> None:
    """Have the package's own types registered; by name, since the table stands above."""
    import_module(TABLE)


def _view(result: Any, which: str) -> Callable[..., Any]:
    found = getattr(views_of(result), which)
    if found is None:
        raise UsageError(f"{type(result).__name__}: nothing is registered for {which!r}")
    return _function(found)


def _function(lazy: Lazy) -> Callable[..., Any]:
    if not isinstance(lazy, str):
        assert lazy is not None
        return lazy
    module, _, name = lazy.partition(":")
    found: Callable[..., Any] = getattr(import_module(module), name)
    return found
