"""What comes out while a log runs: JSON lines, NMEA sentences, a view for the terminal."""

from __future__ import annotations

import json
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from truenorth.core.units import significant
from truenorth.live.answer import Answer

if TYPE_CHECKING:
    from rich.table import Table

    from truenorth.live.aligner import Aligner
    from truenorth.live.navigator import Navigator

NOT_USED = ("inconsistent", "not_observable", "lost")
COLOURS = {"aligned": "green", "navigated": "green", "level_only": "yellow"}


def json_line(answer: Answer) -> str:
    """One JSON object on one line, see :meth:`Answer.summary`."""
    return json.dumps(answer.summary(), allow_nan=False)


def nmea_lines(answer: Answer) -> list[str]:
    """``$HEHDT`` (true heading) and ``$PASHR`` (heading, roll, pitch and their one-sigmas, deg); none without a heading.

    Roll is positive with the right side down, pitch with the nose up, as ours.
    """
    if not answer.heading_known:
        return []
    heading, pitch, roll = np.degrees(answer.euler)
    sigma = np.degrees(answer.sigma)
    minutes, ms = divmod(round(answer.time * 1000.0) % 86_400_000, 60_000)  # rounded first: no second is 60.000
    stamp = f"{minutes // 60:02d}{minutes % 60:02d}{ms / 1000.0:06.3f}"
    attitude = (
        f"{round(heading, 3) % 360.0:.3f},T,{roll:+.3f},{pitch:+.3f},,{sigma[2]:.3f},{sigma[1]:.3f},{sigma[0]:.3f},0,1"
    )
    return [_sentence(f"HEHDT,{round(heading, 4) % 360.0:.4f},T"), _sentence(f"PASHR,{stamp},{attitude}")]


def _sentence(text: str) -> str:
    """With the dollar sign and the checksum: all characters between, by exclusive or."""
    return f"${text}*{reduce(lambda total, letter: total ^ ord(letter), text, 0):02X}"


def angle(radians: float) -> str:
    """An angle in deg, arcmin or arcsec, whichever reads best."""
    for unit, factor in (("deg", 1.0), ("arcmin", 60.0)):
        value = np.degrees(radians) * factor
        if value >= 0.5:
            return f"{significant(value)} {unit}"
    return f"{significant(np.degrees(radians) * 3600.0)} arcsec"


def waiting(answer: Answer, goal: float) -> str:
    """How long until heading is as good as wished, in words; both in degrees, as wishes are written."""
    wish, floor = (f"{significant(float(np.degrees(value)))} deg" for value in (goal, answer.floor[0]))
    if answer.status in NOT_USED:
        return "heading may not be used; the findings say why"
    if answer.status == "navigated":
        return f"heading {'good' if answer.sigma[0] <= goal else 'not good'} to {wish}"
    left = answer.remaining(goal)
    if left is None:
        if answer.floor[0] >= goal:
            return f"{wish} is out of reach: the floor of these gyros is {floor}"
        return f"{wish} is not in sight yet"
    if left == 0.0:
        return f"good to {wish}"
    return f"about {significant(left, 2)} s more to {wish}"


def view(aligner: Aligner | Navigator, answer: Answer | None, goal: float, note: str = "") -> Table:
    """A small table for the terminal."""
    from rich.table import Table

    table = Table.grid(padding=(0, 2))
    rows = f"{aligner.intake.counts.taken} rows, {significant(aligner.log.rate)} Hz, {significant(aligner.duration)} s"
    if answer is None:
        table.add_row("heading", f"the first answer comes after {aligner.first_answer:g} s of log")
    else:
        heading, pitch, roll = np.degrees(answer.euler)
        sigma = [angle(value) for value in answer.sigma]
        colour = COLOURS.get(answer.status, "red")
        shown = f"{heading:9.4f} deg  ± {sigma[0]}" if answer.heading_known else "not known"
        table.add_row("heading", f"[bold {colour}]{shown}[/]")
        table.add_row("pitch, roll", f"{pitch:9.4f} deg ± {sigma[1]}, {roll:9.4f} deg ± {sigma[2]}")
        if answer.motion is not None:
            m = answer.motion
            lat, lon = np.degrees(m.position[:2])
            table.add_row(
                "place", f"{lat:.6f}, {lon:.6f} deg, {m.position[2]:.1f} m ± {significant(m.position_sigma.max())} m"
            )
            table.add_row("speed", f"{np.linalg.norm(m.v_n):.2f} m/s ± {significant(np.nanmax(m.v_sigma))} m/s")
        if answer.status != "navigated":
            table.add_row("floor", f"{angle(answer.floor[0])}: what waiting does not improve")
        table.add_row("verdict", f"[{colour}]{answer.status}[/]; {waiting(answer, goal)}")
        for reason in answer.reasons[:4]:
            table.add_row("", _plain(reason))
    table.add_row(
        "rows", rows + (f"; {_plain(aligner.intake.counts.words())}" if aligner.intake.counts.words() else "")
    )
    if note or aligner.failure:
        table.add_row("note", _plain("; ".join(filter(None, (note, aligner.failure)))))
    return table


def _plain(text: str) -> str:
    """Brackets stay brackets."""
    return text.replace("[", "\\[")
