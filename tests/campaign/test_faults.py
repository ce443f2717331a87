"""Faults of drawn sizes: those that passed in silence once are flagged, or harmless; sound logs are left alone."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.runs import few_and_all, some
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.campaign.fault_limits import LEAST_RATIO, UNSEEN, ratio_on_sway, unseen
from truenorth.campaign.fault_pages import keeper, page, read_trials
from truenorth.campaign.faults import FAULTS, SOUND, Trial, faults_of, run_faults, table
from truenorth.cli import app
from truenorth.core.errors import UsageError
from truenorth.quality.encoder import encoder_evidence
from truenorth.quality.gnss import gnss_evidence, turn_evidence
from truenorth.quality.tilt import check_tilt
from truenorth.quality.whiteness import whiteness
from truenorth.records.specified import seen_in

SEED = 11
# Procedure and faults that gave a wrong answer without a word before there was one judge.
ONCE_SILENT = {
    "swaying": ("noisy for a while", "gyro axes exchanged", "gyro sign", "late gyros"),
    "rotary": ("gyro axes exchanged", "gyro sign", "encoder axes exchanged", "encoder sign", "held rows", "clock rate"),
    "gnss": ("grid north", "clock rate", "clock jumps", "accel scale"),
    "transfer": (
        "accel axes exchanged",
        "master's V_E and V_N exchanged",
        "turned master",
        "clock rate",
        "gyro bias step",
        "late gyros",
    ),
    "navigate": ("accel bias step", "grid north", "damaged start", "late GNSS", "slowly spoofed"),
    "odometer": ("gyro bias step",),
    "still": ("accel bias step", "dead sensor", "clipped gyro"),
}


def silent(trials: list[Trial]) -> list[Trial]:
    return [trial for trial in trials if trial.outcome in ("silent", "crash")]


@few_and_all(4, few=1)
@pytest.mark.parametrize(
    "procedure", some(["still"], ["navigate", "swaying", "transfer", "rotary", "gnss", "odometer"])
)
def test_nothing_that_passed_in_silence_does_so_again(procedure, runs):
    assert silent(run_faults([procedure], ONCE_SILENT[procedure], runs=runs, seed=SEED)) == []


@pytest.mark.slow
@pytest.mark.parametrize("procedure", BENCHES)
def test_a_sound_log_is_left_alone(procedure):
    trials = run_faults([procedure], [SOUND], runs=2, seed=SEED)
    assert [trial.outcome for trial in trials] == ["harmless"] * 2, trials


@pytest.mark.slow
@pytest.mark.parametrize("procedure", BENCHES)
def test_the_whole_campaign(procedure):
    """Ten draws of every fault: silent are those alone that a log cannot show."""
    assert silent(run_faults([procedure], runs=10, seed=SEED + 1, workers=os.cpu_count())) == []


@pytest.mark.slow
def test_workers_find_what_one_process_finds():
    asked = (["unspecified", "still"], [SOUND, "gyro sign", "dead sensor"])
    kept = []
    alone, shared = (run_faults(*asked, runs=2, seed=SEED, workers=count, keep=kept.append) for count in (1, 2))
    assert [repr(trial) for trial in shared] == [repr(trial) for trial in alone]  # a worst that is no number
    assert sorted(map(repr, kept[len(alone) :])) == sorted(map(repr, alone))


@pytest.mark.slow
def test_what_a_swaying_base_can_show_of_a_ramp():
    """Seed 8301: 90 ug from a fifth of the log on, heading 6 sigmas off, and not beyond chance; twice as much would be."""
    inputs, _ = BENCHES["swaying"].draw(8301, 0)
    record, answer = inputs["record"], BENCHES["swaying"].align(inputs)
    assert record.kind == "increments"
    course = record.interval * np.maximum(np.arange(len(record)) / len(record) - 0.2, 0.0) / 0.8
    ratio, twice = (
        ratio_on_sway(replace(record, accel=record.accel + np.outer(size * course, np.eye(3)[0])), record, answer)
        for size in (8.85e-4, 2 * 8.85e-4)
    )
    assert 0.0 < ratio < LEAST_RATIO < twice
    (trial,) = run_faults(["swaying"], ["accel bias ramp"], runs=1, seed=8301)
    assert trial.outcome == "unseen", trial


@pytest.mark.parametrize("procedure", ["swaying", "rotary"])
def test_tilt_finds_which_order_sign_and_delay(procedure):
    """What was done to the gyros is named, and undone the reading is the one given."""
    inputs, _ = BENCHES[procedure].draw(SEED, 0)
    record, rng = inputs["record"], np.random.default_rng(5)
    faults = {fault.name: fault for fault in FAULTS}
    C_sb = None
    if procedure == "rotary":
        from truenorth.alignment.encoder_angles import reading

        C_sb = reading(inputs["encoder"], ("z", "x"), np.eye(2))
    sound = check_tilt(record, C_sb)
    assert sound is not None
    assert sound.evidence() == []
    assert sound.axes == "+x +y +z"
    spoilt, order = faults["gyro axes exchanged"].apply(inputs, rng)
    found = check_tilt(spoilt["record"], C_sb)
    # Column i holds what axis order[i] measured.
    assert [name[1] for name in found.axes.split()] == list(order)
    assert found.evidence()[0].kind == "unknown"
    spoilt, late = faults["late gyros"].apply(inputs, rng)
    found = check_tilt(spoilt["record"], C_sb)
    assert found.evidence()[0].key == "tilt.gyros_late"
    assert found.delay == pytest.approx(float(late.split()[0]), abs=0.04)


def test_a_base_that_does_not_turn_says_nothing_of_its_gyros():
    inputs, _ = BENCHES["still"].draw(SEED, 0)
    assert check_tilt(inputs["record"]) is None


def test_an_indexer_whose_angles_are_right_is_believed():
    inputs, _ = BENCHES["rotary"].draw(SEED, 1)
    from truenorth.alignment.encoder_angles import orders, reading

    readings = {name: reading(inputs["encoder"], ("z", "x"), order) for name, order in orders(2).items()}
    given = readings.pop("given")
    assert encoder_evidence(inputs["record"], given, readings) == []
    wrong = readings.pop("exchanged")
    (found,) = encoder_evidence(inputs["record"], wrong, {"exchanged": given})
    assert found.figures["reading"] == "exchanged"


@pytest.mark.parametrize("degrees", [-2.0, 0.0, 0.6])
def test_velocities_turned_against_positions(degrees):
    """Both ways; within three of its own sigmas."""
    inputs, _ = BENCHES["gnss"].draw(SEED, 0)
    assert gnss_evidence(inputs["gnss"]) == []
    angle = np.radians(degrees)
    time = np.arange(0.0, 400.0)
    v_n = np.stack([20 * np.sin(time / 60), 20 * np.cos(time / 60), 0 * time], axis=1)
    way = np.cumsum(v_n, axis=0) - 0.5 * v_n
    noise = np.random.default_rng(2).standard_normal((400, 2))
    lat, lon = 0.5 + (way[:, 1] + noise[:, 0]) / 6.36e6, (way[:, 0] + noise[:, 1]) / 6.38e6 / np.cos(0.5)
    turned = v_n[:, 0] + 1j * v_n[:, 1]
    turned = turned * np.exp(1j * angle)
    found = turn_evidence("gnss", time, lat, lon, np.stack([turned.real, turned.imag, 0 * time], axis=1))
    assert bool(found) == (degrees != 0.0)
    if found:
        assert abs(found[0].figures["angle"] - angle) < 3.0 * found[0].figures["sigma"] + 1e-3


@pytest.mark.slow
def test_an_encoder_that_is_off_wobbles():
    """Through a sway of degrees zero and discs are found to a hundredth of a degree and less; a sound encoder is left alone."""
    from dataclasses import replace

    for run in range(3):
        inputs, _ = BENCHES["rotary"].draw(SEED, run)
        angles = inputs["encoder"].angles

        def found(off, inputs=inputs):
            answer = BENCHES["rotary"].align(inputs | {"encoder": replace(inputs["encoder"], angles=off)})
            return {item.key: item.figures for item in answer.evidence if item.key.startswith("encoder.")}

        assert not found(angles)
        assert np.degrees(found(angles + np.radians([0.0, 0.1]))["encoder.zero"]["off"]) == pytest.approx(0.1, abs=0.01)
        for axis in range(2):
            key = ("encoder.disc_or_sway", "encoder.disc")[
                axis
            ]  # the outer axis turns at one rate: a sway may look the same
            disc = found(angles + np.radians(0.3) * np.sin(angles) * np.eye(2)[axis])[key]
            assert disc["axis"] == str(axis + 1)
            assert np.degrees(disc["size"]) == pytest.approx(0.3, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("run", [1, 0])
def test_a_late_encoder_is_in_sigma_or_refused(run):
    """20 ms, while both axes go on turning: level was up to 80 sigmas off, and heading 15, without a word."""
    from dataclasses import replace

    inputs, truth = BENCHES["rotary"].draw(SEED, run)
    late = replace(inputs["encoder"], time=inputs["encoder"].time + 0.02)
    cut = inputs["record"].between(0.1, None)
    answer = BENCHES["rotary"].align(inputs | {"encoder": late, "record": cut})
    if answer.status == "aligned":
        assert max(np.abs(x).max() for x in misses(answer, truth).values()) < 4.0
    else:
        assert any("encoder" in reason for reason in answer.reasons)


def test_noise_of_each_stretch_is_separated_from_sway():
    """To a twentieth, though the sway's differences are thousands of times larger; a louder stretch is found where it is."""
    from dataclasses import replace

    from truenorth.quality.density import bursts, noise_densities

    inputs, _ = BENCHES["swaying"].draw(SEED, 0)
    record, spec = inputs["record"], seen_in(inputs["imu"], inputs["record"])
    _, density = noise_densities(record)
    said = np.repeat([spec.gyro_random_walk, spec.accel_random_walk], 3)
    assert np.nanmedian(density, axis=0) == pytest.approx(said, rel=0.05)
    assert not bursts(record)[1].any()
    rows = (record.time > 100.0) & (record.time < 130.0)
    loud = 30.0 * spec.gyro_random_walk * np.sqrt(record.interval)
    noise = np.random.default_rng(4).standard_normal(record.gyro.shape) * rows[:, None] * loud
    edges, extra = bursts(replace(record, gyro=record.gyro + noise))
    found = edges[1:][extra[:, :3].any(axis=1)]
    assert extra[:, :3].max() == pytest.approx(30.0 * spec.gyro_random_walk, rel=0.2)
    assert 100.0 <= found.min() <= 116.0
    assert 130.0 <= found.max() <= 142.0


def test_exchanged_velocities_fit_no_turn():
    time = np.arange(0.0, 400.0)
    v_n = np.stack([20 * np.sin(time / 60), 20 * np.cos(time / 60), 0 * time], axis=1)
    way = np.cumsum(v_n, axis=0)
    (found,) = turn_evidence("master", time, 0.5 + way[:, 1] / 6.36e6, way[:, 0] / 5.6e6, v_n[:, [1, 0, 2]])
    assert found.key == "master.velocity"


@pytest.mark.slow
def test_white_innovations_leave_sigma_alone_and_others_make_it_grow():
    """White: chance is exceeded in less than one of 300 series. Of a first-order process the mean errs by a known factor."""
    rng = np.random.default_rng(1)
    white = [whiteness(rng.standard_normal((400, 3))) for _ in range(300)]
    assert sum(w.sure for w in white) <= 1
    assert whiteness(1.5 * rng.standard_normal((400, 3))).growth == pytest.approx(1.5, rel=0.1)
    rho, growth = 0.8, []
    for _ in range(50):
        x = np.zeros((4000, 1))
        for k in range(1, len(x)):
            x[k] = rho * x[k - 1] + np.sqrt(1 - rho**2) * rng.standard_normal()
        growth.append(whiteness(x).growth)
    assert np.mean(growth) == pytest.approx(np.sqrt((1 + rho) / (1 - rho)), rel=0.15)


def test_every_fault_has_a_procedure_that_meets_it():
    met = {fault.name for bench in BENCHES.values() for fault in faults_of(bench.draw(0, 0)[0])}
    assert met == {fault.name for fault in FAULTS}


def test_the_command_goes_on_where_it_was(tmp_path):
    """Trials that a folder holds are not done again, a line that was cut off is, and the page counts them all."""
    arguments = ["faults", "--procedure", "still", "--fault", "none", "--runs", "1", "-o", str(tmp_path)]
    result = CliRunner().invoke(app, [*arguments, "--fault", "gyro in another unit"])
    assert result.exit_code == 0, result.output
    whole = read_trials(tmp_path / "trials.csv")
    assert [t.fault for t in whole] == ["none", "gyro in another unit"]
    lines = (tmp_path / "trials.csv").read_text().splitlines()
    marked = lines[1].replace("harmless", "refused")
    (tmp_path / "trials.csv").write_text("\n".join([lines[0], marked, lines[2][:9]]))
    assert CliRunner().invoke(app, [*arguments, "--fault", "gyro in another unit"]).exit_code == 0
    again = read_trials(tmp_path / "trials.csv")
    assert [t.outcome for t in again] == ["refused", whole[1].outcome]
    assert "| still |" in (tmp_path / "faults.md").read_text()
    assert (tmp_path / "faults.csv").read_text().startswith("procedure,fault,refused,flagged,harmless,unseen,silent")


def test_the_page_compares_with_an_earlier_version(tmp_path):
    now = [Trial("still", "gyro sign", 1, k, "", outcome, 5.0, "") for k, outcome in enumerate(("flagged", "silent"))]
    before = [Trial("still", "gyro sign", 1, 0, "", "silent", 9.0, "")]
    keeper(tmp_path / "trials.csv", before)
    text = page([*now, Trial("still", SOUND, 1, 0, "", "flagged", 1.0, "why")], read_trials(tmp_path / "trials.csv"))
    assert "| still |  | 1 |  |  | 1 |  | 1 of 1 |" in text
    assert "Sound logs: 1, of which 1 were not accepted. still (seed 1, run 0): flagged, why" in text
    assert "| still | gyro sign | 1 of 2 | 5.0 |" in text
    assert all(item.why in text for item in UNSEEN)


def test_names_that_are_not_known():
    with pytest.raises(UsageError, match="choose of still, unspecified"):
        run_faults(["flying"])
    with pytest.raises(UsageError, match="fault 'rust'"):
        run_faults(faults=["rust"])
    with pytest.raises(UsageError, match="workers 0"):
        run_faults(workers=0)


def test_the_table_counts():
    rows = table(
        [Trial("still", "x", 0, k, "", outcome, 9.0, "") for k, outcome in enumerate(("silent", "flagged", "silent"))]
    )
    assert rows == [
        {
            "procedure": "still",
            "fault": "x",
            "refused": 0,
            "flagged": 1,
            "harmless": 0,
            "unseen": 0,
            "silent": 2,
            "crash": 0,
            "worst": 9.0,
        }
    ]


@pytest.mark.slow
def test_a_scale_factor_under_gravity_is_no_bias_beyond_its_specification():
    """Drawn: 164 ug of bias and 130 ppm of scale factor, where both are 50: 283 ug as the filter finds it."""
    inputs, _ = BENCHES["odometer"].draw(8204, 7)
    assert BENCHES["odometer"].align(inputs).status == "aligned"


def test_the_page_has_what_no_log_can_show_as_the_command_writes_it():
    rows = page([]).strip().split("\n\n")[-1]
    assert rows.startswith("| cannot be seen |")
    assert rows in (Path(__file__).parents[2] / "docs/faults.md").read_text(encoding="utf-8")


def test_the_scale_of_a_gyro_on_a_sway_is_never_unseen():
    """A motion fitted to the spoilt log takes a part of it up: by the filter of the answer it may seem that none is there."""
    assert unseen("swaying", "gyro scale", "1.100 of z", -245.0) is None
    assert unseen("swaying", "gyro bias step", "", 10.0)
