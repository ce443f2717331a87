"""Poor gyros on an indexer: what its encoder shows of them, and what comes of an alignment that begins with it."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from tests.runs import some
from truenorth.aiding.aids import Indexer
from truenorth.alignment import align
from truenorth.alignment.coarse_sensors import calibrated, known_sensors, matrix_evidence, shown_biases
from truenorth.alignment.encoder_angles import angles_at
from truenorth.alignment.fine import CoarseStart
from truenorth.alignment.swaying import Mount
from truenorth.alignment.task import make_task
from truenorth.alignment.turning import infer_turning
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.core.attitude import misalignment
from truenorth.core.indexing import C_bs_from_angles, indexer_turns
from truenorth.core.position import Position
from truenorth.errors.staying import PHI, StaticModel
from truenorth.estimate.staying import StayingLog, prior_of
from truenorth.records.specs import imu_spec
from truenorth.simulation.scenario import read_scenario
from truenorth.strapdown.inertial import integrate

SPIN = BENCHES["rotary"].scenario
NOISELESS = {
    "name": "consumer without noise",
    "unnamed": "zero",
    "gyro": {"bias": "1000 deg/h", "scale_factor": "1 %", "misalignment": "30 arcmin"},
    "accel": {"bias": "30 mg", "scale_factor": "1 %", "misalignment": "30 arcmin"},
}
EIGHT = {"scheme": "8", "dwell": "25 s", "encoder": {"resolution": "1 arcsec"}}


def still(made):
    return {name: made[name] for name in made if name != "lever_arm"} | {
        "motion": {"kind": "rest", "heading": "70 deg", "pitch": "1.5 deg", "roll": "-2 deg"}
    }


def one_axis(made):
    return made | {"indexer": made["indexer"] | {"axes": made["indexer"]["axes"][:1]}}


def drawn(imu, seed, run, change=lambda made: made):
    """What an alignment begins from, the mount, and the true errors (15,) of the gyros as their states stand."""
    built = read_scenario(change(dict(SPIN(np.random.default_rng([seed, run])))) | {"imu": imu})
    simulated, spec = built.simulate(seed=seed, run=run), built.imu_spec
    encoder = built.simulate_aiding(seed=seed, run=run)["encoder"].record
    axes = ("z", "x")[: encoder.angles.shape[1] if encoder.angles.ndim == 2 else 1]
    integrals = integrate(simulated.record)
    angles = angles_at(encoder, integrals.start + integrals.time, axes)
    place = Position(built.position.lat, built.position.lon, 0.0)
    P_bias = np.diag(spec.bias_variance)
    start = CoarseStart(simulated.record, np.eye(3), place, StaticModel.of(spec), P_bias, 1.0)
    gyro = simulated.errors.gyro
    true = np.append(gyro.constant_bias, (np.diag(gyro.scale_factor) + gyro.misalignment).ravel())
    return start, Mount(np.zeros(3), 0.0, np.swapaxes(C_bs_from_angles(axes, angles), 1, 2)), spec, true


@pytest.mark.parametrize("change", [dict, still, one_axis, lambda made: made | {"indexer": EIGHT}])
@pytest.mark.parametrize("seed", some([3], [4]))
def test_an_encoder_shows_the_gyros_errors(change, seed):
    """To what a sway of some degrees leaves: the attitude goes off by that, and by the turn of the earth in 240 s."""
    start, mount, spec, true = drawn(NOISELESS, seed, 0, change)
    known = known_sensors(start, mount.C_sb, spec)
    gyro = [*range(3), *range(6, 15)]
    off = (known.mean[gyro] - true) / np.sqrt(np.diag(known.P)[gyro])
    assert np.abs(off).max() < 4.0
    right = known._replace(mean=np.concatenate([true[:3], np.zeros(3), true[3:], np.zeros(9)]))
    C_ib, *others = (
        integrate(start._replace(sensors=sensors).right_record(), 1.0).C_ib for sensors in (right, known, None)
    )
    found, before = (np.abs(misalignment(C, C_ib)).max() for C in others)
    assert found < np.radians(2.5)
    assert found < 0.15 * before


def test_gyros_that_see_the_earth_turn_stay_as_they_are():
    for imu in ("navigation", "tactical"):
        start, mount, spec, _ = drawn(imu, 3, 0)
        assert calibrated(start, mount, spec) is start
        wide = start._replace(P_bias=1e6 * start.P_bias)  # as a log without a specification may leave them
        assert calibrated(wide, mount, spec) is wide
    start, mount, spec, _ = drawn("industrial", 3, 0)
    assert calibrated(start, replace(mount, C_sb=None), spec) is start
    assert calibrated(start, mount, None).sensors.mean.shape == (6,)


def test_turns_of_an_indexer():
    angles = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.2]])
    C_sb = np.swapaxes(C_bs_from_angles(("z", "x"), angles), 1, 2)
    assert np.allclose(indexer_turns(C_sb), [[0.0, 0.0, 0.1], [0.2, 0.0, 0.0]], atol=1e-15)


def test_a_sway_shows_no_error_of_a_sensor_in_the_averaged_system():
    """A bias and a scale factor of an axis that turns at one rate act as one in it; their difference shows nowhere."""
    start, mount, spec, _ = drawn(NOISELESS, 3, 0)
    prior = prior_of(start.P_bias, spec=spec)
    log = StayingLog(start.record, start.C_n0_i, start.position, start.model, prior, 1.0, sways=False, C_sb=mount.C_sb)
    rate = indexer_turns(mount.C_sb)[:, 0] / log.integrals.intervals
    assert np.ptp(rate) < 1e-3 * rate.mean()
    bias, scale = 6, prior.groups["matrices"].start
    for system, same in ((log.averaged(), True), (log.linearise(), False)):
        turn = system.Phi[:, PHI]
        off = np.abs(turn[:, :, scale] - rate.mean() * turn[:, :, bias]).max()
        assert (off < 1e-3 * np.abs(turn[:, :, scale]).max()) == same


@pytest.mark.slow
@pytest.mark.parametrize(
    ("imu", "run", "said"),
    [(imu, run, said) for imu in ("consumer", "industrial") for run in range(12) for said in (True, False)],
)
def test_a_sound_log_of_poor_gyros_is_answered(imu, run, said):
    """Of six logs of a consumer IMU three were refused, and levels were 4.7 sigmas off, 18.7 without its biases."""
    bench = BENCHES["rotary"]
    inputs, truth = replace(bench, scenario=lambda rng: {**SPIN(rng), "imu": imu}).draw(1101, run)
    spec = imu_spec(imu)
    given = (
        spec if said else {name: {"random_walk": spec.to_mapping()[name]["random_walk"]} for name in ("gyro", "accel")}
    )
    answer = align(inputs["record"], inputs["place"], given, aid=Indexer(inputs["encoder"]))
    assert answer.status in ("aligned", "level_only", "not_converged"), answer.reasons
    off = misalignment(answer.C_nb, truth(answer.time).C_nb) / np.sqrt(np.diag(answer.phi_covariance))
    assert np.abs(off).max() < 4.0, misses(answer, truth)


@pytest.mark.slow
@pytest.mark.parametrize("spoilt", [None, (0, -1.0), (2, 1.1)])  # 10 % of the slower axis passes for a bias
def test_gyros_that_turn_as_gravity_does_without_their_biases(spoilt):
    """At rest on an indexer: by raw rates of .3 deg/s too much gravity swings, and 2 of 8 sound logs were refused for it."""
    bench = BENCHES["rotary"]
    inputs, truth = replace(bench, scenario=lambda rng: still(SPIN(rng)) | {"imu": "consumer"}).draw(7, 0)
    record, spec = inputs["record"], imu_spec("consumer")
    if spoilt is None:
        answer = align(record, inputs["place"], spec, aid=Indexer(inputs["encoder"]))
        assert answer.status in ("level_only", "not_converged"), answer.reasons
        assert np.abs(misses(answer, truth)["level"]).max() < 4.0
        return
    axis, factor = spoilt
    gyro = record.gyro * np.where(np.arange(3) == axis, factor, 1.0)
    wrong = align(replace(record, gyro=gyro), inputs["place"], spec, aid=Indexer(inputs["encoder"]))
    (item,) = (item for item in wrong.evidence if item.key == "encoder.gyro_matrix")
    assert item.figures["axis"] == item.figures["about"] == "xyz"[axis]
    assert wrong.status == "inconsistent"


def test_a_slow_sway_is_no_matrix_of_the_gyros():
    """Of a body that turns by 30 deg in a minute entries of 4 to 20 of their sigmas are found, and none is shown."""
    tone = {"amplitude": "30 deg", "period": "60 s", "phase": "40 deg"}
    for run in range(3):
        start, mount, spec, _ = drawn(
            "consumer", 5, run, lambda made: made | {"motion": made["motion"] | {"tones": {"heading": [tone]}}}
        )
        start = start._replace(sensors=known_sensors(start, mount.C_sb, spec))
        assert matrix_evidence(start, spec) == []


@pytest.mark.parametrize(("imu", "seed"), [("navigation", 3), ("consumer", 4)])
def test_an_encoder_shows_how_large_biases_are_of_which_nothing_is_said(imu, seed):
    """An indexer's own turns, 5 deg/s and more, were allowed as biases: of sound logs of 60 s of a ship 8 of 12 were refused.

    Poor gyros keep such a prior.
    """
    start, mount, _, true = drawn(imu, seed, 0)
    task = replace(make_task(start.record, start.position, None), interval=start.interval)
    shown = partial(shown_biases, task, start.C_n0_i, mount.C_sb)
    mean, sigma = shown(start.model)
    assert np.abs((mean - true[:3]) / sigma).max() < 4.0
    assert (infer_turning(task, shown).gyro_bias < 1e-5) == (imu == "navigation")
