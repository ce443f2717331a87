"""A chart as plain data: traces and layout in plotly's terms, drawn by the page's own script.

No plotting library runs here. Colours are names (``c0`` to ``c5``, ``ref``) that the page resolves, so that one chart serves
light, dark and print. Arrays travel as base64 of their bytes, which are a third of their decimal text.
"""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.figures.thinning import evenly, thin

Array = NDArray[np.float64]

POINTS = 1500  # of a line; more than a screen shows
LIMIT_POINTS = 300  # of a limit, which is smooth
ROW = 170  # pixels a row of axes
TICKS: tuple[tuple[float, str | float], ...] = (
    (0.6, "D1"),
    (2.0, "D2"),
    (6.0, 1.0),
)  # of an axis of at most these decades


class Chart:
    """Rows of axes over one horizontal axis.

    Parameters
    ----------
    rows : sequence of str
        Title of each vertical axis, unit included.
    over : str
        Title of the horizontal axis.
    height : int, optional
        Pixels.
    """

    def __init__(self, rows: Sequence[str], over: str, height: int | None = None) -> None:
        self.data: list[dict[str, Any]] = []
        self._spans: dict[int, tuple[float, float]] = {}  # of the positive values on a row of axes
        self.layout: dict[str, Any] = {
            "height": height or max(300, ROW * len(rows) + 70),
            "xaxis": {"title": {"text": over}, "anchor": f"y{len(rows)}" if len(rows) > 1 else "y"},
        }
        gap = 0.06 if len(rows) > 1 else 0.0
        share = (1.0 - gap * (len(rows) - 1)) / len(rows)
        for i, title in enumerate(rows):
            top = 1.0 - i * (share + gap)
            self.layout[f"yaxis{i + 1}" if i else "yaxis"] = {
                "title": {"text": title},
                "domain": [max(0.0, top - share), top],
            }

    def line(
        self, row: int, x: ArrayLike, y: ArrayLike, colour: str, name: str, *, dash: str = "solid", key: bool = False
    ) -> None:
        """Draw a line, thinned to what the eye can tell; NaN breaks it. With `key` it stands in the legend."""
        t, v = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        rows = thin(t, v, POINTS)
        self._add(
            row,
            x=_bytes(t[rows], "f8"),
            y=_bytes(v[rows], "f4"),
            mode="lines",
            line={"color": colour, "width": 1.5, "dash": dash},
            name=name,
            showlegend=key,
            hovertemplate="%{y:.5g}",
        )
        self._saw(row, v)

    def band(self, row: int, x: ArrayLike, low: ArrayLike, high: ArrayLike, colour: str, alpha: float = 0.18) -> None:
        """Fill between two lines."""
        t, below, above = (np.asarray(v, dtype=np.float64) for v in (x, low, high))
        rows = evenly(len(t), POINTS)
        rows = rows[np.isfinite(below[rows] + above[rows])]
        self._add(
            row,
            x=_bytes(np.concatenate([t[rows], t[rows][::-1]]), "f8"),
            y=_bytes(np.concatenate([above[rows], below[rows][::-1]]), "f4"),
            fill="toself",
            fillcolor=f"{colour}/{alpha}",
            mode="none",
            hoverinfo="skip",
            showlegend=False,
        )

    def limit_line(self, x: ArrayLike, y: ArrayLike, colour: str = "ref/0.6", dash: str = "solid") -> None:
        """Draw a thin line that is no function of x, in the first row, without a name."""
        line = {"color": colour, "width": 1.0, "dash": dash}
        self._add(0, x=_bytes(x, "f8"), y=_bytes(y, "f4"), mode="lines", line=line, hoverinfo="skip", showlegend=False)

    def limit(self, row: int, x: ArrayLike, y: ArrayLike, dash: str) -> None:
        """Draw a limit: seen, but not in the way of the pointer."""
        t, v = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        rows = evenly(len(t), LIMIT_POINTS)
        self._add(
            row,
            x=_bytes(t[rows], "f8"),
            y=_bytes(v[rows], "f4"),
            mode="lines",
            line={"color": "ref", "width": 1.0, "dash": dash},
            hoverinfo="skip",
            showlegend=False,
        )

    def points(
        self,
        row: int,
        x: ArrayLike,
        y: ArrayLike,
        colour: str,
        name: str,
        *,
        symbol: str = "circle",
        size: float = 4.0,
        key: bool = False,
        error: tuple[ArrayLike, ArrayLike] | None = None,
        joined: bool = False,
    ) -> None:
        """Draw markers, with bars (below, above) where `error` is given, joined by a line where asked."""
        extra: dict[str, Any] = {}
        if error is not None:
            below, above = error
            extra["error_y"] = {"array": _bytes(above, "f4"), "arrayminus": _bytes(below, "f4"), "color": colour}
        self._add(
            row,
            x=_bytes(x, "f8"),
            y=_bytes(y, "f4"),
            mode="lines+markers" if joined else "markers",
            marker={"color": colour, "size": size, "symbol": symbol},
            line={"color": colour, "width": 1.5},
            name=name,
            showlegend=key,
            hovertemplate="%{y:.5g}",
            **extra,
        )
        self._saw(row, np.asarray(y, dtype=np.float64))

    def _saw(self, row: int, values: Array) -> None:
        positive = values[np.isfinite(values) & (values > 0.0)]
        if positive.size:
            low, high = self._spans.get(row, (np.inf, 0.0))
            self._spans[row] = min(low, float(positive.min())), max(high, float(positive.max()))

    def violin(self, row: int, name: str, values: ArrayLike, sigma: float, colour: str) -> None:
        """Draw the distribution of values over a name, with bars at plus and minus one claimed sigma."""
        axis = f"y{row + 1}" if row else "y"
        v = np.asarray(values, dtype=np.float64)
        shape: dict[str, Any] = {
            "fillcolor": f"{colour}/0.3",
            "line": {"color": colour},
            "points": "all" if v.size < 40 else False,
        }
        shape |= {"marker": {"color": colour, "size": 3}, "spanmode": "hard", "showlegend": False, "hoveron": "violins"}
        x = {"x": [name] * v.size}
        self.data.append({"type": "violin", "yaxis": axis, "y": _bytes(v, "f4"), "name": name, **x, **shape})
        ticks: dict[str, Any] = {"color": "ink", "size": 26, "symbol": "line-ew-open", "line": {"width": 2}}
        bars: dict[str, Any] = {
            "x": [name, name],
            "y": _bytes([-sigma, sigma], "f4"),
            "mode": "markers",
            "marker": ticks,
        }
        self.data.append({"type": "scatter", "yaxis": axis, "showlegend": False, "hovertemplate": "%{y:.4g}", **bars})

    def axis(self, row: int, **options: Any) -> None:
        """Set options of a vertical axis, in plotly's terms."""
        self.layout[f"yaxis{row + 1}" if row else "yaxis"] |= options

    def _ticked(self) -> dict[str, Any]:
        """The layout, with numbers on logarithmic vertical axes that do not run into each other."""
        layout = dict(self.layout)
        for row, (low, high) in self._spans.items():
            name = f"yaxis{row + 1}" if row else "yaxis"
            axis = dict(layout[name])
            if axis.get("type") == "log" and "dtick" not in axis and "nticks" not in axis:
                low, high = axis.get("range", (np.log10(low), np.log10(high)))
                # Nine numbers a decade, three (1, 2, 5), one, or one in several.
                axis["dtick"] = next(
                    (tick for widest, tick in TICKS if high - low <= widest), float(np.ceil((high - low) / 6.0))
                )
                layout[name] = axis
        return layout

    def across(self, **options: Any) -> None:
        """Set options of the horizontal axis."""
        if options.get("type") == "log":
            options.setdefault("dtick", "D2")  # 1, 2, 5: with all nine the numbers run into each other
        self.layout["xaxis"] |= options

    def shade(self, start: float, stop: float) -> None:
        """Mark a stretch without data, on all rows."""
        box = {"type": "rect", "xref": "x", "yref": "paper", "x0": start, "x1": stop, "y0": 0, "y1": 1}
        box |= {"fillcolor": "ref/0.15", "line": {"width": 0}, "layer": "below"}
        self.layout.setdefault("shapes", []).append(box)

    def _add(self, row: int, **trace: Any) -> None:
        self.data.append({"type": "scatter", "yaxis": f"y{row + 1}" if row else "y", **trace})

    def to_json(self) -> str:
        """Text for the page; no ``</`` in it can end the script element that holds it."""
        text = json.dumps({"data": self.data, "layout": self._ticked()}, allow_nan=False, separators=(",", ":"))
        return text.replace("</", "<\\/")


def _bytes(values: ArrayLike, kind: str) -> dict[str, str]:
    raw = np.ascontiguousarray(values, dtype=np.dtype(kind).newbyteorder("<"))
    return {kind: b64encode(raw.tobytes()).decode()}
