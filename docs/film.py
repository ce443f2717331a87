"""The film of a heading converging, docs/assets/heading.svg: an animated picture of one alignment, a few kilobytes.

Run from the repository: ``python docs/film.py``. It uses the package's sample of a ring-laser IMU (``truenorth example rlg``).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

import truenorth as tn
from truenorth.formats.samples import write_sample

HERE = Path(__file__).resolve().parent
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 860, 400, 62, 16, 74, 44
FRAMES, RUN, HOLD = 60, 9.0, 3.0  # pictures of the counter; seconds of the film, and of its end
SPAN = 0.7  # deg above and below the answer that the axis shows
FAR = 20.0  # spans, up to which a line goes on outside of the frame: a picture needs no larger figures
KNOWN = 10.0  # deg of sigma, below which a heading is worth showing
FOREVER = f'dur="{RUN + HOLD}s" repeatCount="indefinite"'

Array = NDArray[np.float64]


def recording() -> tuple[tn.ImuRecord, tn.Position, str]:
    """A record of 300 s, its place, and what it is."""
    with TemporaryDirectory() as folder:
        (log, *_) = write_sample("rlg", folder)
        record = tn.read_imu(log)
    return record, tn.Position.from_degrees(34.246, 108.910, 380.0), "ring-laser IMU, people moving a parked vehicle"


@dataclass(frozen=True)
class Axes:
    """Where seconds and degrees stand in the picture."""

    start: float
    stop: float
    middle: float

    def x(self, t: Array) -> Array:
        """Pixels from the left."""
        return LEFT + (WIDTH - LEFT - RIGHT) * (np.asarray(t) - self.start) / (self.stop - self.start)

    def y(self, value: Array) -> Array:
        """Pixels from the top; what lies outside is cut off, some spans away, by the frame."""
        inside = np.clip(value, self.middle - FAR * SPAN, self.middle + FAR * SPAN)
        return TOP + (HEIGHT - TOP - BOTTOM) * (self.middle + SPAN - inside) / (2 * SPAN)


def film(answer: tn.Alignment, what: str) -> str:
    """The SVG text: a band and a line that are uncovered from left to right, and a counter."""
    history = answer.history
    assert history is not None
    values, sigmas = answer.convergence
    t, heading, sigma = history.time, np.degrees(values[:, 0]), np.degrees(sigmas[:, 0])
    axes = Axes(float(t[0]), float(t[-1]), float(heading[-1]))
    rows = np.unique(np.linspace(0, len(t) - 1, 400).astype(int))
    x = axes.x(t[rows])
    line = _points(x, axes.y(heading[rows]))
    edges = axes.y(heading[rows] + sigma[rows]), axes.y(heading[rows] - sigma[rows])
    band = f"{_points(x, edges[0])} {_points(x[::-1], edges[1][::-1])}"
    share, full, inside = RUN / (RUN + HOLD), WIDTH - LEFT, HEIGHT - TOP - BOTTOM
    shown = f'<animate attributeName="width" {FOREVER} values="0;{full};{full}" keyTimes="0;{share:.4f};1"/>'
    final = f"{heading[-1] % 360:.2f} degrees, one sigma {sigma[-1]:.2f}"
    look = ".big{font-size:24px;font-weight:700;fill:#0072b2} .title{font-size:17px;font-weight:600}"
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="system-ui, sans-serif"',
            f' font-size="12" fill="#6a7480"><style>{look}</style>',
            f"<title>Heading of a base over {t[-1]:.0f} s: {final}</title>",
            f'<text x="{LEFT}" y="26" class="title">Heading, as known after each second</text>',
            f'<text x="{LEFT}" y="50">{what}; band: one sigma</text>',
            *_scales(axes),
            f'<clipPath id="seen"><rect x="{LEFT}" y="{TOP}" height="{inside}" width="{full}">{shown}</rect></clipPath>',
            f'<g clip-path="url(#seen)"><polygon points="{band}" fill="#0072b2" fill-opacity="0.2"/>',
            f'<polyline points="{line}" fill="none" stroke="#0072b2" stroke-width="2"/></g>',
            *_counter(t, heading, sigma, share),
            "</svg>\n",
        ]
    )


def _points(x: Array, y: Array) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


def _scales(axes: Axes) -> list[str]:
    """Degrees on the left, seconds beneath."""
    marks = []
    for value in np.arange(np.ceil((axes.middle - SPAN) * 5) / 5, axes.middle + SPAN, 0.2):
        y = float(axes.y(value))
        marks.append(f'<text x="{LEFT - 8}" y="{y:.1f}" dy="4" text-anchor="end">{value:.1f}°</text>')
        marks.append(f'<path d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}" stroke="#8884" fill="none"/>')
    for second in np.arange(50.0, axes.stop + 1, 50.0):
        marks.append(f'<text x="{axes.x(second):.1f}" y="{HEIGHT - 22}" text-anchor="middle">{second:.0f} s</text>')
    return marks


def _counter(t: Array, heading: Array, sigma: Array, share: float) -> list[str]:
    """The answer so far in words, one text for each picture of the film; the last one stays."""
    texts = []
    for k in range(FRAMES):
        row = round((len(t) - 1) * (k + 1) / FRAMES)
        words = f"{heading[row] % 360:.2f}° ± {sigma[row]:.2f}°" if sigma[row] < KNOWN else "not known yet"
        begin, last = share * k / FRAMES, k == FRAMES - 1
        steps = [("visible" if k == 0 else "hidden", 0.0)]
        steps += [] if k == 0 else [("visible", begin)]
        steps += [] if last else [("hidden", share * (k + 1) / FRAMES)]
        values, times = ";".join(v for v, _ in steps), ";".join(f"{at:.4f}" for _, at in steps)
        texts.append(
            f'<text x="{WIDTH - RIGHT}" y="52" text-anchor="end" class="big" visibility="{"visible" if last else "hidden"}">'
            f'{t[row]:.0f} s: {words}<animate attributeName="visibility" {FOREVER} calcMode="discrete" '
            f'values="{values}" keyTimes="{times}"/></text>'
        )
    return texts


def main() -> None:
    """Align, and write the film."""
    record, place, what = recording()
    target = HERE / "assets" / "heading.svg"
    target.write_text(film(tn.align(record, place), what), encoding="utf-8")
    print(f"wrote {target} ({target.stat().st_size / 1e3:.0f} kB)")


if __name__ == "__main__":
    main()
