"""From an answer and the evidence of its checks to an answer with a verdict: what it reached, and what contradicts it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.check import LogCheck
from truenorth.alignment.drift import Drift
from truenorth.alignment.result import Alignment, Status
from truenorth.analysis.chi_square import tail
from truenorth.core.attitude import UNIFORM_SIGMA
from truenorth.core.earth import EARTH_RATE, gravity_of_place, radii
from truenorth.core.errors import AlignmentError
from truenorth.quality.regimes import SEEN_LATE
from truenorth.state.evidence import ANY_EFFECT, NO_EFFECT, Effect, Evidence, Figure, contradiction, note
from truenorth.state.judge import Claim, Verdict, judge
from truenorth.state.layout import BA, DP, DV
from truenorth.state.limits import is_estimated, limit

Array = NDArray[np.float64]


HEIGHTS = (-500.0, 9000.0)  # m, at which bases stay


def no_attitude(source: str) -> AlignmentError:
    """What a log is refused with that gives no attitude at all."""
    return AlignmentError(f"{source}: the log gives no attitude: are sensors dead, or all their values the same?")


def judged(
    answer: Alignment,
    evidence: Sequence[Evidence],
    heading_limit: float,
    *,
    waiting: bool = True,
    remedies: tuple[str, ...] = (),
) -> Alignment:
    """An answer with its verdict; what the evidence adds to sigma is in its covariance.

    Parameters
    ----------
    answer : Alignment
    evidence : sequence of Evidence
    heading_limit : float, rad
        Largest one-sigma heading error of use.
    waiting : bool
        Whether more of the same data improves heading.
    remedies : tuple of str
        What a heading that is not good enough needs.

    Raises
    ------
    AlignmentError
        The attitude is no number.
    """
    if not (np.isfinite(answer.C_nb).all() and np.isfinite(answer.phi_covariance).all()):
        raise no_attitude(answer.source)
    _, floor = azimuth_sigmas(answer)
    lat = answer.position.lat
    bias = float(answer.gyro_bias_prior.max())
    stays = answer.moving is None and answer.transfer is None
    verdict = judge(
        Claim(
            sigma=claimed(answer),
            heading_limit=heading_limit,
            floor=floor,
            waiting=waiting,
            hidden=floor > heading_limit
            and math.cos(lat) < limit("pole")
            and bias / EARTH_RATE < heading_limit
            and stays,
            able=stays and bias < heading_limit * EARTH_RATE * math.cos(lat),
        ),
        [*evidence, *bias_evidence(answer)],
    )
    answer = grown(answer, verdict.added)
    reached = [] if verdict.finding == "inconsistent" else _reached(answer, verdict, heading_limit, remedies)
    status: Status = verdict.status("aligned")  # type: ignore[assignment]  # a finding, its good one so called
    taken = _taken_to_stay(answer) if stays and status == "aligned" else []
    if reached and -answer.C_nb[2, 2] > limit("upside down"):
        reached = [*reached, note("level.upside_down")]
    return replace(answer, status=status, evidence=(*reached, *verdict.evidence, *taken))


def claimed(answer: Alignment) -> Effect:
    """One sigma of what an alignment gives."""
    sigma, _ = azimuth_sigmas(answer)
    velocity = position = math.inf
    if answer.moving is not None:
        variance = np.diag(answer.moving.P)
        velocity, position = float(np.sqrt(variance[DV].max())), float(np.sqrt(variance[DP].max()))
    if answer.transfer is not None:  # its place is the master's
        velocity = float(np.sqrt(np.diag(answer.transfer.P)[DV].max()))
    return Effect(sigma, level_sigma(answer), velocity, position)


def level_sigma(answer: Alignment) -> float:
    """The larger axis of the error ellipse of level, rad."""
    a, b, c = (float(answer.phi_covariance[i]) for i in ((0, 0), (1, 1), (0, 1)))
    return math.sqrt(0.5 * (a + b) + math.hypot(0.5 * (a - b), c))


def azimuth_sigmas(answer: Alignment) -> tuple[float, float]:
    """Sigma and floor of heading, or near the vertical of the combination that stands for it."""
    if answer.near_vertical:
        return answer.azimuth[2], float(np.sqrt(answer.phi_floor[2, 2]))
    return float(answer.euler_sigma[0]), float(answer.euler_sigma_floor[0])


def grown(answer: Alignment, added: Effect) -> Alignment:
    """The same answer with an independent error in its covariance, its floor and its history.

    On the move velocity and position, and what navigation goes on from, have it too; of a slave its velocity, its place being its
    master's.
    """
    if added == NO_EFFECT:
        return answer
    more = np.diag([added.level, added.level, added.heading]) ** 2
    history = answer.history
    if history is not None:
        history = replace(history, phi_covariance=history.phi_covariance + more, phi_floor=history.phi_floor + more)
    moving, position, transfer, own = answer.moving, answer.position, answer.transfer, claimed(answer)
    if transfer is not None:
        fast = math.hypot(1.0, added.velocity / own.velocity) if own.velocity > 0.0 else 1.0
        transfer = transfer.less_sure(more, fast)
    if moving is not None:
        fast, far = (
            math.hypot(1.0, size / sigma) if sigma > 0.0 else 1.0
            for size, sigma in ((added.velocity, own.velocity), (added.position, own.position))
        )
        moving = moving.less_sure(added.heading**2, added.level**2, fast, far)
        wider = {"horizontal_sigma": far * position.horizontal_sigma, "vertical_sigma": far * position.vertical_sigma}
        position = replace(position, **wider)
    return replace(
        answer,
        phi_covariance=answer.phi_covariance + more,
        phi_floor=answer.phi_floor + more,
        history=history,
        moving=moving,
        transfer=transfer,
        position=position,
    )


def rate_evidence(check: LogCheck, bias: float, lat: float, imu: str, floor: float) -> list[Evidence]:
    """Mean rates that miss the earth's by more than gyros with this bias (rad/s) do; `floor` (rad) of heading is theirs."""
    found = []
    horizontal = EARTH_RATE * math.cos(lat)
    for axis, residual, misses in zip(("north", "up"), check.rate_residual, check.rate_misses(bias), strict=True):
        turned = min(abs(residual) / max(horizontal, 1e-12), UNIFORM_SIGMA)
        figures: dict[str, Figure] = {"axis": axis, "residual": float(residual), "allowed": bias, "imu": imu}
        if misses > limit("specification"):
            remedies = ("latitude", "imu_axes", "units", "specification", "base_stays")
            found.append(Evidence("rate.misses", figures, "bounded", Effect(heading=turned), remedies))
        elif misses > limit("doubt"):
            found.append(Evidence("rate.doubtful", figures, "known", Effect(heading=min(turned, misses * floor))))
    return found


def base_evidence(answer: Alignment, check: LogCheck, drift: Drift | None, *, settled: bool = True) -> list[Evidence]:
    """What contradicts a base that stays where it is, and the specification of the IMU on it.

    A gyro that misses along north by more than its specification may miss along east as much, where nobody sees it:
    that turns heading by ``residual / (w_ie cos L)``. So do accelerometers, which tilt by ``residual / g``. Biases that are k
    times as large make k times as much of heading's floor at the most: of an IMU that was turned, next to nothing.
    """
    place, (_, floor) = answer.position, azimuth_sigmas(answer)
    found = rate_evidence(check, float(answer.gyro_bias_prior.max()), place.lat, answer.imu_source, floor)
    # A scale factor error multiplies gravity: along the vertical it is a bias like any other.
    g = gravity_of_place(place.lat, place.alt)
    accel = math.hypot(float(answer.accel_bias_prior.max()), answer.imu.accel_scale_factor * g)
    if check.force_misses(accel) > limit("specification"):
        found.append(
            Evidence(
                "force.misses",
                {"residual": check.force_residual, "allowed": accel, "imu": answer.imu_source},
                "bounded",
                Effect(level=abs(check.force_residual) / g),
                (*_height(place.lat, g + check.force_residual), "units", "specification"),
            )
        )
    return found + base_speed(answer) + model_evidence(drift, settled=settled)


def _height(lat: float, gravity: float) -> tuple[str, ...]:
    """The remedy of a wrong height, where one at which a base stays has this gravity."""
    most, least = (gravity_of_place(lat, alt) for alt in HEIGHTS)
    return ("height",) if least < gravity < most else ()


def _taken_to_stay(answer: Alignment) -> list[Evidence]:
    """Which steady speed towards north would turn heading by its sigma, and leave nothing to be seen: ``R w_ie cos L sigma``."""
    sigma, lat = azimuth_sigmas(answer)[0], answer.position.lat
    return [note("base.stays", speed=float(radii(lat)[0]) * EARTH_RATE * math.cos(lat) * sigma)]


def base_speed(answer: Alignment) -> list[Evidence]:
    """That a base which stays would have to move as none does."""
    speed = float(answer.disturbance[:2].max())
    return [contradiction("base.fast", speed=speed)] if speed > limit("fastest base") else []


def model_evidence(drift: Drift | None, *, settled: bool) -> list[Evidence]:
    """What contradicts the model of a base that stays: it drifts, or the passes did not come to rest."""
    found = [] if drift is None or not drift.found else [drift.evidence()]
    return found if settled else [*found, contradiction("base.unsettled")]


def bias_evidence(answer: Alignment) -> list[Evidence]:
    """Estimated biases that are larger than the specification allows.

    The one that takes the blame may be right, and the model wrong; on a base that stays, heading is what a gyro spoils, and
    level what an accelerometer does. On the move, what scale factors and misalignments make of gravity is in the bias of an
    accelerometer.
    """
    found = []
    place = answer.position
    g = gravity_of_place(place.lat, place.alt)
    accel, accel_sigma = _acting_bias(answer)
    stays = answer.moving is None and answer.transfer is None
    gravity = np.zeros(3) if stays else answer.imu.acting_variance(answer.C_nb[2] * g)
    for kind, bias, sigma, prior in (
        ("gyro", answer.gyro_bias, answer.gyro_bias_sigma, answer.gyro_bias_prior),
        ("accel", accel, accel_sigma, np.sqrt(answer.accel_bias_prior**2 + gravity)),
    ):
        for axis in range(3):
            size, allowed = abs(float(bias[axis])), float(prior[axis])
            if size <= limit("specification") * math.hypot(allowed, float(sigma[axis])):
                continue
            effect = ANY_EFFECT
            if stays:
                effect = Effect(heading=UNIFORM_SIGMA) if kind == "gyro" else Effect(level=size / g)
            figures: dict[str, Figure] = {
                "axis": "xyz"[axis],
                "bias": size,
                "allowed": allowed,
                "imu": answer.imu_source,
            }
            other_axes = kind == "accel" and size - allowed > limit("other axes") * g
            suspects = ("imu_axes", "specification") if other_axes else ("specification",)
            found.append(Evidence(f"bias.{kind}", figures, "bounded", effect, suspects))
    return found + _biases_together(answer, gravity) if answer.moving is not None else found


def _acting_bias(answer: Alignment) -> tuple[Array, Array]:
    """What acts as the accelerometers' bias, and its one-sigma; on the move what gravity makes of their axes is in it."""
    moving = answer.moving or answer.transfer
    if moving is None or moving.acting_bias is None:
        return answer.accel_bias, answer.accel_bias_sigma
    return moving.acting_bias, np.sqrt(np.maximum(np.diag(moving.P)[BA], 0.0))


def _biases_together(answer: Alignment, gravity: Array) -> list[Evidence]:
    """Biases found on the move that are together larger than the specification allows, though none of them alone is.

    Normalised they are a chi-square of as many degrees of freedom as were found. Where chance does not give it, the IMU is as many
    times as poor as they are large in the mean, and so much larger is the sigma of heading and level: what nothing has shown of its
    biases and noise is as poor.
    """
    prior = np.concatenate([answer.gyro_bias_prior**2, answer.accel_bias_prior**2 + gravity])
    accel, accel_sigma = _acting_bias(answer)
    own = np.concatenate([answer.gyro_bias_sigma, accel_sigma]) ** 2
    seen = is_estimated(np.sqrt(own), np.sqrt(prior))
    count = int(seen.sum())
    if not count:
        return []
    bias = np.concatenate([answer.gyro_bias, accel])
    total = float(np.sum((bias**2 / (prior + own))[seen]))
    if tail(total, count) > math.erfc(limit("doubt") / math.sqrt(2.0)):
        return []
    factor = math.sqrt(total / count)
    grows = math.sqrt(factor**2 - 1.0)
    claims = claimed(answer)
    effect = Effect(heading=grows * claims.heading, level=grows * claims.level)
    figures: dict[str, Figure] = {"count": count, "factor": factor, "imu": answer.imu_source}
    return [Evidence("bias.together", figures, "known", effect, ("specification",))]


def leaves(time: float | None) -> list[Evidence]:
    """That a base moves from a time (s) on; nothing where it stays."""
    return [] if time is None else [contradiction("base.moves", "end_before", until=time, end=time - SEEN_LATE)]


def _reached(answer: Alignment, verdict: Verdict, wanted: float, remedies: tuple[str, ...]) -> list[Evidence]:
    """What the answer is good for, with figures."""
    sigma, floor = azimuth_sigmas(answer)
    level = level_sigma(answer)
    if level > limit("level"):
        if answer.moving is None and float(np.linalg.eigvalsh(answer.phi_floor[:2, :2]).max()) > limit("level") ** 2:
            bias = float(np.max(answer.accel_bias_prior))
            figures: dict[str, Figure] = {
                "level": level,
                "bias": bias,
                "imu": answer.imu_source,
                "limit": limit("level"),
            }
            return [Evidence("level.biased", figures, remedies=("level_specification",))]
        calmer = "record_calmer" if answer.moving is None else "record_longer"
        return [note("level.unknown", *(remedies or (calmer,)), level=level, limit=limit("level"))]
    coarse = level > math.radians(0.5)
    good_level = note("level.known" if coarse else "level.known_finely", level=level)
    if verdict.finding == "good":
        return _good(answer, sigma, floor, level)
    if answer.moving is not None or answer.transfer is not None:
        more = remedies or ("record_longer",)
        return [note("heading.wanted", *more, sigma=sigma, duration=answer.duration, limit=wanted), good_level]
    lat = answer.position.lat
    horizontal, bias = EARTH_RATE * math.cos(lat), float(np.max(answer.gyro_bias_prior))
    if verdict.finding == "not_observable":
        return [note("heading.hidden", lat=lat, horizontal=horizontal, bias=bias), good_level]
    if verdict.finding == "level_only":
        needed = horizontal * math.tan(min(wanted, 1.0))
        source = answer.imu_source
        return [note("heading.bias", bias=bias, imu=source, limit=wanted, lat=lat, needed=needed), good_level]
    if floor > wanted:  # by what evidence has added to it, which says what to do; a longer log does not take it off
        return [note("heading.wanted", *remedies, sigma=sigma, duration=answer.duration, limit=wanted), good_level]
    figures = {"sigma": sigma, "duration": answer.duration, "limit": wanted, "floor": floor}
    key = "heading.short"
    if answer.pays_until is not None and answer.pays_until > answer.duration:
        key, figures = "heading.short_until", figures | {"pays_until": answer.pays_until}
    return [Evidence(key, figures, remedies=("record_longer",)), good_level]


def _good(answer: Alignment, sigma: float, floor: float, level: float) -> list[Evidence]:
    if answer.transfer is not None:
        return [note("heading.known_with_level", sigma=sigma, level=level)]
    if answer.moving is not None:
        return [note("heading.known_from", sigma=sigma, source=answer.moving.heading_from)]
    found = [note("heading.known", sigma=sigma, floor=floor)]
    if answer.pays_until is not None and math.isfinite(answer.pays_until):
        key = "heading.paid" if answer.pays_until <= answer.duration else "heading.pays"
        found.append(note(key, pays_until=answer.pays_until, duration=answer.duration))
    if answer.near_vertical:
        found.append(note("heading.vertical"))
    return found
