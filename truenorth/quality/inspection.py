"""Everything that a record shows about itself, in one object."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from truenorth.core.language import translated as _
from truenorth.core.shown import Shown
from truenorth.core.units import parse_unit
from truenorth.quality.held import at_own_rate, sampled_findings
from truenorth.quality.one_pace import at_one_pace
from truenorth.quality.plausibility import Turning, check_plausibility
from truenorth.quality.regimes import KINDS, Kind, MotionSummary, Regime, motion_summary
from truenorth.quality.rounded_stamps import at_even_steps
from truenorth.quality.sampling import Finding, Sampling, check_sampling
from truenorth.records import ImuRecord

if TYPE_CHECKING:
    import pandas as pd
    from rich.table import Table

    from truenorth.analysis.allan import NoiseCoefficients

SHORTEST_REST = 15.0  # s at rest, from which noise densities are given
REST_MARGIN = 2.0  # s between a motion and a stretch at rest
SLOW_TERMS = ("bias_instability", "rate_random_walk")
SEVERITIES = ("error", "warning", "note")


@dataclass(frozen=True, repr=False)
class Inspection(Shown):
    """Health, noise and motion of one record; all figures in SI.

    Parameters
    ----------
    source : str
        Where the record came from.
    samples : int
    start, stop, duration, interval : float, s
        Clock of the record; `interval` is the median step.
    sampling : Sampling
        Jitter, gaps, repeated rows, frozen and saturated channels.
    motion : MotionSummary
        How the base moved, second by second.
    turning : Turning
        How far the gyros explain the turning of gravity.
    gyro_noise, accel_noise : NoiseCoefficients or None
        From the longest stretch at rest (`noise_from`); None where no 15 s are at rest.
    noise_from : Regime or None
        That stretch; its kind is ``disturbed`` where no still one is long enough: the noise is then an upper bound.
    findings : tuple of Finding
        Errors first.
    record : ImuRecord or None
        What was inspected; the figure shows it. None where the inspection was read from a file.
    """

    source: str
    samples: int
    start: float
    stop: float
    duration: float
    interval: float
    sampling: Sampling
    motion: MotionSummary
    turning: Turning
    gyro_noise: NoiseCoefficients | None
    accel_noise: NoiseCoefficients | None
    noise_from: Regime | None
    findings: tuple[Finding, ...]
    record: ImuRecord | None = field(compare=False, metadata={"archive": False})

    @property
    def regimes(self) -> tuple[Regime, ...]:
        """Stretches of one kind of motion, in order."""
        return self.motion.regimes

    @property
    def overall(self) -> Kind:
        """The strongest kind of motion that over 5 % of the seconds show."""
        return self.motion.overall

    @property
    def still_fraction(self) -> float:
        """Share of seconds without motion above the sensor's noise, 0..1."""
        return self.motion.still_fraction

    @property
    def rate_rms(self) -> float:
        """RMS of the norm of the one-second mean rates, bias taken out, rad/s."""
        return self.motion.rate_rms

    @property
    def angular_amplitude(self) -> float:
        """Amplitude of the angular oscillation, rad."""
        return self.motion.angular_amplitude

    @property
    def force_rms(self) -> float:
        """RMS deviation of the one-second mean specific force from its mean, m/s^2."""
        return self.motion.force_rms

    @property
    def ok(self) -> bool:
        """Whether there is no finding of severity ``error``."""
        return all(finding.severity != "error" for finding in self.findings)

    def in_brief(self) -> dict[str, str]:
        """Span, rate, motion and findings."""
        return {
            "source": self.source,
            "span": f"{self.start:.1f} to {self.stop:.1f} s, {self.samples} samples at {1.0 / self.interval:.4g} Hz",
            "motion": self.overall,
            "findings": "; ".join(f"{f.severity}: {f.message}" for f in self.findings) or "none",
        }

    def to_frame(self) -> pd.DataFrame:
        """The stretches of one kind of motion: start, stop (s) and kind, one row each."""
        import pandas as pd

        return pd.DataFrame([(r.start, r.stop, r.kind) for r in self.regimes], columns=["start_s", "stop_s", "kind"])

    def to_dict(self) -> dict[str, Any]:
        """Everything in datasheet units, ready for JSON: a figure that does not exist is None, never NaN."""
        sampling, motion = self.sampling, self.motion
        return {
            "source": self.source,
            "samples": self.samples,
            "start_s": self.start,
            "stop_s": self.stop,
            "duration_s": self.duration,
            "rate_hz": 1.0 / self.interval,
            "jitter_rms_ms": sampling.jitter_rms * 1e3,
            "jitter_max_ms": sampling.jitter_max * 1e3,
            "gaps": [
                {"time_s": float(time), "length_s": float(length)}
                for time, length in zip(sampling.gap_times, sampling.gap_lengths)
            ],
            "repeated_rows": sampling.repeated_rows,
            "longest_equal_run": sampling.longest_runs.tolist(),
            "saturated_rows": sampling.saturated_rows.tolist(),
            "motion": {
                "overall": motion.overall,
                "fractions": {kind: motion.fraction(kind) for kind in KINDS},
                "regimes": [{"start_s": r.start, "stop_s": r.stop, "kind": r.kind} for r in motion.regimes],
                "rate_rms_deg_s": _figure(np.degrees(motion.rate_rms)),
                "angular_amplitude_deg": _figure(np.degrees(motion.angular_amplitude)),
                "force_rms_m_s2": _figure(motion.force_rms),
                "acceleration_rms_m_s2": _figure(motion.acceleration_rms),
            },
            "gyro_against_gravity": {
                "scale": _figure(self.turning.scale),
                "agreement": _figure(self.turning.agreement),
            },
            "noise": self._noise(),
            "findings": [{"severity": f.severity, "code": f.code, "message": f.message} for f in self.findings],
        }

    def _noise(self) -> dict[str, Any] | None:
        if self.gyro_noise is None or self.accel_noise is None or self.noise_from is None:
            return None
        table: dict[str, Any] = {
            "from_s": self.noise_from.start,
            "to_s": self.noise_from.stop,
            "motion": self.noise_from.kind,
        }
        for key, _words, noise, name, unit in _noise_rows(self.gyro_noise, self.accel_noise):
            factor, of_motion = parse_unit(unit)[0], self._of_motion(name)
            for column, values in ((key, getattr(noise, name)), (f"{key}_sigma", getattr(noise, f"{name}_sigma"))):
                table[column] = [None if of_motion else _figure(value / factor) for value in values]
        return table

    def _of_motion(self, term: str) -> bool:
        """Whether what looks like this term of the noise is the motion of the base, and says nothing of the sensors."""
        return self.noise_from is not None and self.noise_from.kind != "still" and term in SLOW_TERMS

    def table(self) -> Table:
        """Figures as a rich table: sampling, motion, noise."""
        from rich.table import Table

        table = Table("figure", "value", title=self.source, title_justify="left", show_header=False)
        sampling, motion = self.sampling, self.motion
        span = _("{duration:.3f} s, {samples} samples from {start:.3f} s")
        table.add_row(_("duration"), span.format(duration=self.duration, samples=self.samples, start=self.start))
        pace = _("{rate:.4g} Hz, jitter {rms:.3f} ms RMS, {most:.3f} ms at most")
        jitter = {"rms": sampling.jitter_rms * 1e3, "most": sampling.jitter_max * 1e3}
        table.add_row(_("rate"), pace.format(rate=1.0 / self.interval, **jitter))
        table.add_row(_("gaps"), str(sampling.gap_times.size))
        table.add_row(_("repeated rows"), f"{sampling.repeated_rows} ({sampling.repeated_rows / self.samples:.1%})")
        table.add_row(_("saturated rows"), str(int(sampling.saturated_rows.sum())))
        shares = {kind: motion.fraction(kind) for kind in (*KINDS, "unknown")}
        table.add_row(_("motion"), ", ".join(f"{_(kind)} {share:.0%}" for kind, share in shares.items() if share > 0.0))
        if motion.time.size:
            table.add_row(_("angular amplitude"), f"{np.degrees(motion.angular_amplitude):.3g} deg")
            table.add_row(_("rate, RMS of 1 s means"), f"{np.degrees(motion.rate_rms):.3g} deg/s")
            table.add_row(_("acceleration, RMS of 1 s means"), f"{motion.acceleration_rms:.3g} m/s^2")
        if self.gyro_noise is not None and self.accel_noise is not None and self.noise_from is not None:
            rest = self.noise_from
            where = _("{kind}, {start} to {stop} s")
            where = where.format(kind=_(rest.kind), start=round(rest.start), stop=round(rest.stop))
            still = rest.kind == "still"
            table.add_row(_("noise x, y, z from") if still else _("noise x, y, z at most, from"), where)
            for _key, words, noise, name, unit in _noise_rows(self.gyro_noise, self.accel_noise):
                factor = parse_unit(unit)[0]
                values = getattr(noise, name) / factor
                if np.any(values > 0.0) and not self._of_motion(name):
                    shown = ", ".join(f"{value:.3g}" if value > 0.0 else "-" for value in values)
                    table.add_row(f"  {_(words)}", f"{shown} {unit}")
        return table


def inspect(record: ImuRecord, lat: float | None = None) -> Inspection:
    """Look for what is wrong with a record, and measure its noise and motion.

    Parameters
    ----------
    record : ImuRecord or DataFrame
    lat : float, rad, optional
        Latitude; lets the earth's rate be checked by its vertical part too.
    """
    written = ImuRecord.of(record)
    samples = at_even_steps(at_own_rate(written))
    record = at_one_pace(samples)
    motion = motion_summary(record)
    sampling, findings = check_sampling(record)
    turning, doubts = check_plausibility(record, motion, lat)
    findings = [*findings, *doubts, *sampled_findings(record)]
    sampling = replace(sampling, repeated_rows=sampling.repeated_rows + len(written) - len(samples))
    gyro_noise, accel_noise, rest = _noise_at_rest(record, motion, findings)
    findings.sort(key=lambda finding: SEVERITIES.index(finding.severity))
    return Inspection(
        source=record.source,
        samples=len(written),
        start=float(written.time[0]),
        stop=float(written.time[-1]),
        duration=written.duration,
        interval=written.interval,
        sampling=sampling,
        motion=motion,
        turning=turning,
        gyro_noise=gyro_noise,
        accel_noise=accel_noise,
        noise_from=rest,
        findings=tuple(findings),
        record=record,
    )


def _noise_at_rest(
    record: ImuRecord, motion: MotionSummary, findings: list[Finding]
) -> tuple[NoiseCoefficients | None, NoiseCoefficients | None, Regime | None]:
    """Noise of the longest still stretch, else of the longest disturbed one; gaps cut a stretch."""
    from truenorth.analysis.allan import SHORTEST_RECORD
    from truenorth.quality.noise import noise_coefficients

    kind: Kind
    for kinds, kind in ((("still",), "still"), (("still", "disturbed"), "disturbed")):
        for rest in sorted(motion.stretches(*kinds), key=lambda run: -run.duration):
            if rest.duration < SHORTEST_REST:
                break
            # A motion begins softly: its first and last moments are left to it.
            start = rest.start if rest.start <= record.time[0] else rest.start + REST_MARGIN
            stop = rest.stop if rest.stop >= record.time[-1] else rest.stop - REST_MARGIN
            first, last = np.searchsorted(record.time, start, "left"), np.searchsorted(record.time, stop, "right")
            if last - first < SHORTEST_RECORD:
                continue  # inside a gap, or nearly so
            part = _longest_without_gap(record[first:last])
            if part.duration < SHORTEST_REST or len(part) < SHORTEST_RECORD:
                continue
            gyro, accel = noise_coefficients(part)
            return gyro, accel, Regime(float(part.time[0] - part.interval), float(part.time[-1]), kind)
    findings.append(
        Finding(
            "note",
            "no_rest",
            f"no {SHORTEST_REST:.0f} s at rest; noise densities are not given: record some minutes with the base still",
        )
    )
    return None, None, None


def _longest_without_gap(record: ImuRecord) -> ImuRecord:
    edges = np.concatenate([[0], record.gaps, [len(record)]])
    longest = int(np.argmax(np.diff(edges)))
    first, last = int(edges[longest]), int(edges[longest + 1])
    return record[first:last] if last - first >= 2 else record


def _noise_rows(
    gyro: NoiseCoefficients, accel: NoiseCoefficients
) -> list[tuple[str, str, NoiseCoefficients, str, str]]:
    """JSON key, words, coefficients, attribute and datasheet unit of each figure."""
    return [
        ("angle_random_walk_deg_sqrt_h", "angle random walk", gyro, "random_walk", "deg/sqrt(h)"),
        ("gyro_bias_instability_deg_h", "gyro bias instability", gyro, "bias_instability", "deg/h"),
        ("gyro_rate_random_walk_deg_h_sqrt_h", "gyro rate random walk", gyro, "rate_random_walk", "deg/h/sqrt(h)"),
        ("gyro_quantisation_arcsec", "gyro quantisation", gyro, "quantisation", "arcsec"),
        ("velocity_random_walk_ug_sqrt_hz", "velocity random walk", accel, "random_walk", "ug/sqrt(Hz)"),
        ("accel_bias_instability_ug", "accel bias instability", accel, "bias_instability", "ug"),
        ("accel_random_walk_ug_sqrt_s", "accel random walk", accel, "rate_random_walk", "ug/sqrt(s)"),
        ("accel_quantisation_mm_s", "accel quantisation", accel, "quantisation", "mm/s"),
    ]


def _figure(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
