"""Which recipe aligns what: chosen by the types of the aids. A recipe of your own is one call of :func:`register_recipe`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from os import PathLike
from typing import Any

import numpy as np

import truenorth.aiding as aiding
from truenorth.alignment.result import Alignment
from truenorth.core.attitude import euler_from_dcm
from truenorth.core.errors import AlignmentError, UsageError
from truenorth.core.plugins import plugin, plugins
from truenorth.core.position import Position
from truenorth.quality.held import as_sampled, epoch_sampled
from truenorth.records import ImuRecord
from truenorth.records.calibration import Calibration
from truenorth.records.specified import epoch_felt
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.state.evidence import Evidence


@dataclass(frozen=True)
class Request:
    """What is asked of a recipe.

    Attributes
    ----------
    record : ImuRecord
        Body axes RFU.
    place : Position or None
    imu : ImuSpec, str, path, mapping or None
        As :func:`truenorth.imu_spec` takes it.
    aids : mapping of type to aid
    method : str
    at : float or None, s
    calibration : Calibration or None
    heading_limit : float, rad
    progress : callable or None
    options : mapping
        Of the recipe alone.
    """

    record: ImuRecord
    place: Position | None
    imu: ImuSpec | str | PathLike[str] | dict[str, Any] | None
    aids: Mapping[type, Any]
    method: str
    at: float | None
    calibration: Calibration | None
    heading_limit: float
    progress: Callable[[str], None] | None
    options: Mapping[str, Any]

    @property
    def epoch(self) -> float | None:
        """For when, s: in a log whose sensors are late not after the last moment that they felt."""
        if self.at is None or self.imu is None:
            return self.at
        return epoch_felt(self.at, self.record, imu_spec(self.imu))

    @property
    def common(self) -> dict[str, Any]:
        """What all recipes take by the same name."""
        return {"heading_limit": self.heading_limit, "progress": self.progress, **self.options}

    def needed_place(self) -> Position:
        """The place, where the recipe cannot do without.

        Raises
        ------
        UsageError
            None was given.
        """
        if self.place is None:
            misnamed = next((name for name in self.options if MEANT.get(name) == PLACE), None)
            if misnamed is not None:
                raise _no_option(misnamed, "")
            raise UsageError("place is missing; expected a Position, or (lat, lon, alt) in degrees and metres")
        return self.place


Run = Callable[[Request], Alignment]

PLACE, IMU, AT = "place=(lat_deg, lon_deg, alt_m)", "imu=", "at="
# What people who know other programs, or the procedures behind the recipes, write for an argument of `align`.
MEANT = {
    **dict.fromkeys(("position", "pos", "location", "origin", "lat", "latitude", "lon", "alt"), PLACE),
    **dict.fromkeys(("spec", "specification", "imu_spec", "sensor"), IMU),
    **dict.fromkeys(("epoch", "time"), AT),
    **dict.fromkeys(("aids", "aiding", "sources"), "aid=[...]"),
    **dict.fromkeys(("axes", "units", "columns"), "record=read_imu(path, axes=..., units=..., columns=...)"),
    "gnss": "aid=Gnss(record)",
    "odometer": "aid=Odometer(record)",
    "velocity": "aid=VelocityLog(record)",
    "master": "aid=Master(record)",
    **dict.fromkeys(("encoder", "indexer"), "aid=Indexer(record)"),
}


@dataclass(frozen=True)
class Recipe:
    """One way to align.

    Attributes
    ----------
    name : str
    run : function or "module:name"
    aids : tuple of types, or of names in :mod:`truenorth.aiding`
        One at least of these is given, and no other; empty: none is given.
    methods : bool
        Whether a method can be asked for; the recipe checks its name.
    at : bool
        Whether another epoch than the last sample can be asked for.
    own : bool
        Whether sensors of attitude, and aids of a user's own module, may be given besides these.
    """

    name: str
    run: Run | str
    aids: tuple[type | str, ...] = ()
    methods: bool = False
    at: bool = False
    own: bool = False

    def fits(self, kinds: set[type]) -> bool:
        """Whether it takes aids of these types."""
        kinds = {kind for kind in kinds if not (self.own and _further(kind))}
        return kinds <= set(self.kinds) if kinds else not self.aids

    @property
    def kinds(self) -> tuple[type, ...]:
        """The types of the aids: those that are given by name are loaded where it is asked for them."""
        return tuple(getattr(aiding, aid) if isinstance(aid, str) else aid for aid in self.aids)

    def __call__(self, request: Request) -> Alignment:
        """Align."""
        if isinstance(self.run, str):
            module, _, name = self.run.partition(":")
            run: Run = getattr(import_module(module), name)
            return run(request)
        return self.run(request)


def _further(kind: type) -> bool:
    """Whether aids of this type bring their measurements themselves: sensors of attitude, or of a user's own module."""
    return hasattr(kind, "sources") and kind not in (aiding.Gnss, aiding.Odometer, aiding.VelocityLog, aiding.Barometer)


def on_base(r: Request) -> Alignment:
    """A base that stays where it is: still, shaken or swaying."""
    from truenorth.alignment.procedure import align_base

    method: Any = r.method  # checked by `align`
    return align_base(r.record, r.needed_place(), r.imu, method, at=r.epoch, calibration=r.calibration, **r.common)


def in_motion(r: Request) -> Alignment:
    """A vehicle under way, by odometer or velocity log, GNSS or both."""
    from truenorth.alignment.in_motion import align_in_motion
    from truenorth.errors.log import LogErrors, log_errors
    from truenorth.estimate.own_clock import on_its_clock

    odometer, log, gnss = r.aids.get(aiding.Odometer), r.aids.get(aiding.VelocityLog), r.aids.get(aiding.Gnss)
    wheel = odometer or log
    if r.imu is None:
        raise UsageError(
            "on the move the errors of the IMU cannot be found from the log; expected imu: navigation, tactical, industrial, "
            "consumer, a YAML file or an ImuSpec"
        )
    aligned = partial(
        align_in_motion,
        r.record,
        r.imu,
        odometer=None if odometer is None else odometer.record,
        velocity=None if log is None else log.record,
        velocity_errors=LogErrors() if log is None else log_errors(log.errors, "body"),
        position=r.place,
        wheel=None if wheel is None else wheel.mounting,
        antenna=None if gnss is None else gnss.mounting,
        sources=[source for kind, a in r.aids.items() if _further(kind) for source in a.sources("free")],
        method=r.method,
        calibration=r.calibration,
        **r.common,
    )
    found = on_its_clock(lambda rows: aligned(gnss=rows), r.record, None if gnss is None else gnss.record)
    return found if log is None else replace(found, evidence=(*found.evidence, *log.unsaid))


def by_master(r: Request) -> Alignment:
    """Against a master INS on the same vehicle."""
    from truenorth.alignment.transfer import ON_MASTER, align_transfer

    master = r.aids[aiding.Master]
    m = master.mounting or ON_MASTER
    return align_transfer(
        r.record,
        master.record,
        r.imu,
        matching=master.matching,
        lever_arm=tuple(-m.lever_arm),  # the recipe's own goes from the master to the IMU
        lever_arm_sigma=m.lever_arm_sigma,
        delay=m.latency,
        delay_sigma=m.latency_sigma,
        mounting=tuple(float(x) for x in euler_from_dcm(m.C_mb)),
        mounting_sigma=m.angle_sigma,
        flexure=master.flexure,
        master_errors=master.errors,
        velocity_noise=master.velocity_noise,
        attitude_noise=master.attitude_noise,
        position_noise=master.position_noise,
        acceleration_noise=master.acceleration_noise,
        position=r.place,
        heading=master.heading,
        calibration=r.calibration,
        **r.common,
    )


def on_indexer(r: Request) -> Alignment:
    """An IMU that turns on an indexer."""
    from truenorth.alignment.rotary import align_rotary

    indexer = r.aids[aiding.Indexer]
    return align_rotary(
        r.record if r.calibration is None else r.calibration.apply(r.record),
        indexer.record,
        r.needed_place(),
        r.imu,
        axes=indexer.axes,
        lever_arm=None if indexer.lever_arm is None else -np.asarray(indexer.lever_arm, dtype=np.float64),
        angle_sigma=indexer.angle_sigma,
        offset_sigma=indexer.offset_sigma,
        latency_sigma=indexer.latency_sigma,
        at=r.epoch,
        method=r.method,
        **r.common,
    )


def on_table(r: Request) -> Alignment:
    """Positions of a turntable."""
    from truenorth.alignment.positions import align_positions

    positions = r.aids[aiding.Positions]
    return align_positions(
        r.record, r.needed_place(), r.imu, calibration=r.calibration, arm_sigma=positions.arm_sigma, **r.common
    )


RECIPES = [
    Recipe("a base that stays", on_base, methods=True, at=True),
    Recipe("a vehicle on the move", in_motion, ("Odometer", "VelocityLog", "Gnss"), methods=True, own=True),
    Recipe("a master INS", by_master, ("Master",)),
    Recipe("an IMU on an indexer", on_indexer, ("Indexer",), methods=True, at=True),
    Recipe("a turntable", on_table, ("Positions",)),
]
LIBRARY = tuple(RECIPES)  # those that infer what is not said of an IMU from its log


def register_recipe(recipe: Recipe) -> None:
    """Register a recipe; among those that fit the same aids the last one registered is taken."""
    RECIPES.insert(0, recipe)


def align(
    record: ImuRecord,
    place: Position | tuple[float, ...] | None = None,
    imu: ImuSpec | str | PathLike[str] | dict[str, Any] | None = None,
    *,
    aid: Any = (),
    method: str | Run = "auto",
    at: float | None = None,
    calibration: Calibration | None = None,
    heading_limit: float = np.radians(5.0),
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> Alignment:
    """Find pitch, roll and true heading of an IMU.

    Without aids the base stays where it is: still, shaken or swaying. On the move an odometer, a velocity log in body axes or a
    GNSS receiver aids; against a master INS its solution; on an indexer its encoder; on a turntable say :class:`Positions`.

    Parameters
    ----------
    record : ImuRecord or DataFrame
        Body axes RFU; heading is that of the y axis, clockwise from true north. A table has columns gyro_x .. accel_z (rad/s,
        m/s^2) and the index, or a column, ``time`` (s).
    place : Position or (lat, lon[, alt]), optional
        Of numbers: degrees and metres. Not needed where GNSS or the master has positions.
    imu : ImuSpec, str, path or mapping, optional
        Specification, a preset's name, or a YAML file. On a base that stays the scale of the errors is inferred from the log when
        it is left out, or names no bias of the gyros; other errors that it does not name are taken as usual
        (:mod:`truenorth.alignment.unsaid`).
    aid : aid or sequence of aids
        :class:`Odometer`, :class:`VelocityLog`, :class:`Gnss`, :class:`Master`, :class:`Indexer`, :class:`Positions`; on the
        move also :class:`Attitude`, :class:`Magnetometer`, or one of your own, as navigation takes it.
    method : str or callable
        ``auto``, or one of the recipe. On a base: ``analytic`` (TRIAD on mean rate and specific force, still base only),
        ``inertial`` (dual vector in the inertial frame), ``oba`` (optimisation-based alignment), ``kalman`` (coarse, then a Kalman
        filter on velocity, re-linearised), ``swaying`` (the same with the base's motion and the lever arm as states). On the move:
        ``gyrocompass`` or ``motion``. Published filters (docs/published.md): ``kf``, ``sakf``, ``makf``, ``imakf``, ``states10``,
        ``states8``; on the move with an odometer ``ekf``, ``ukf``, ``ckf``, ``gh3``, ``gh5``, ``gh7``, ``sgkf``. A plug-in's
        name, or a callable of one's own ``method(request) -> Alignment``.
    at : float, s, optional
        Epoch of the answer on the record's clock; the last sample when left out. Base and indexer only.
    calibration : Calibration, optional
        Known bias, scale factor and misalignment, taken off first.
    heading_limit : float, rad
        Largest one-sigma heading error that still counts as `aligned`.
    progress : callable, optional
        Called with a word about each stage.
    **options
        Of the recipe alone, such as ``passes=2`` on the move.

    Raises
    ------
    UsageError
        Aids that no recipe takes together, an unknown method, an epoch outside the record, a limit that is not positive.
    DataError
        A gap in the log that cannot be bridged; aiding logs that do not overlap.
    AlignmentError
        Too short a log for any answer.
    """
    if not isinstance(method, str) and not callable(method):
        raise UsageError(f"method is {method!r}; expected a name, such as 'auto', or a callable")
    given = tuple(aid) if isinstance(aid, list | tuple) else (aid,)
    aids = {type(a): a for a in given}
    if len(aids) < len(given):
        raise UsageError(
            f"aid holds two of one type: {', '.join(type(a).__name__ for a in given)}; expected one of each"
        )
    log, unsaid = as_sampled(record), tuple[Evidence, ...]()
    if imu is not None and (said := imu_spec(imu)).unsaid:
        from truenorth.alignment.unsaid import completed

        own = callable(method) or method in plugins("truenorth.methods") or _fitting(set(aids)) not in LIBRARY
        imu, unsaid = completed(said, log, stays=not own and aids.keys() <= {aiding.Indexer, aiding.Positions})
    request = Request(
        log,
        None if place is None else Position.of(place),
        imu,
        aids,
        method if isinstance(method, str) else getattr(method, "__name__", "own"),
        epoch_sampled(at, record, log),
        calibration,
        heading_limit,
        progress,
        options,
    )
    if callable(method):
        return _checked(method(request), request.method)
    recipe = _recipe(set(aids))
    if method != "auto" and method in plugins("truenorth.methods"):
        return _checked(plugin("truenorth.methods", method)(request), method)
    if method != "auto" and not recipe.methods:
        raise UsageError(f"method {method!r} with {recipe.name}; expected auto: it has a method of its own")
    if at is not None and not recipe.at:
        raise UsageError(
            f"at={at:g}: with {recipe.name} the attitude holds at the log's end; cut the log there instead"
        )
    try:
        answer = recipe(request)
        return replace(answer, evidence=(*answer.evidence, *unsaid)) if unsaid else answer
    except TypeError as error:
        texts = ("unexpected keyword argument", "multiple values for argument", "multiple values for keyword argument")
        wrong = next((name for name in options if any(f"{said} '{name}'" in str(error) for said in texts)), None)
        if wrong is None:
            raise
        raise _no_option(wrong, recipe.name) from None


def _no_option(name: str, of: str) -> UsageError:
    if name in MEANT:
        return UsageError(f"{name!r} is no option of an alignment; write {MEANT[name]}")
    return UsageError(f"{name!r} is no option of an alignment of {of}")


def _fitting(kinds: set[type]) -> Recipe | None:
    return next((recipe for recipe in RECIPES if recipe.fits(kinds)), None)


def _recipe(kinds: set[type]) -> Recipe:
    found = _fitting(kinds)
    if found is None:
        sets = "; ".join(f"{' and/or '.join(k.__name__ for k in r.kinds)} ({r.name})" for r in RECIPES if r.aids)
        names = ", ".join(sorted(kind.__name__ for kind in kinds))
        raise UsageError(f"aid: no recipe takes {names} together; expected one of: {sets}")
    return found


def _checked(answer: Any, method: str) -> Alignment:
    if not isinstance(answer, Alignment):
        raise AlignmentError(f"method {method!r} returned {type(answer).__name__}; expected an Alignment")
    return replace(answer, method=method) if answer.method == "" else answer
