"""Which option of the program offers a remedy that a piece of evidence asks for."""

from __future__ import annotations

from typing import Any

from truenorth.cli.wording import in_options

OPTIONS = {
    "end_before": "--to {end:.0f}",
    "still_part": "--from, --to",
    "begin_after": "--from {after:.0f}",
    "latitude": "--lat",
    "height": "--alt",
    "place": "--lat, --lon, --position-sigma",
    "units": "--units",
    "specification": "--imu",
    "slave_specification": "--imu",
    "imu_axes": "--axes",
    "slave_axes": "--axes",
    "mounting": "--mounting",
    "mounting_said": "--mounting",
    "baseline": "--baseline",
    "offset": "--offset {sensor}={offset:.3f}",
    "latency": "--latency {latency:.3f}",
    "estimate.lag": "--estimate latency",
    "estimate.scale": "--estimate scale",
    "estimate.mounting": "--estimate mounting",
    "arm.gnss": "--lever-arm",
    "arm.odometer": "--wheel-arm",
    "arm.velocity": "--wheel-arm",
    "height_sensor": "--altitude free",
    "level.apart": "--altitude gnss",
    "use_barometer": "--altitude baro",
    "part_of_logs": "--from, --to",
    "without_jump": "--from, --to",
    "transfer.delay": "--delay",
    "transfer.lever_arm": "--lever-arm",
    "transfer.mounting": "--mounting",
    "master_drift": "--master-sigma",
    "transfer_geometry": "--axes, --lever-arm, --mounting, --delay",
    "flexure": "--flexure",
    "bending": "--flexure '{size:deg|.2g} deg,{lasts:.2g} s'",
    "log_error": "--log-drift",
    "log_kind": "--log-kind",
    "log_arm": "--wheel-arm",
}
OF_A_START = {"place": "--position", "height": "--position"}  # of a navigation, which has no place but its start's


def reasons_of(result: Any) -> tuple[str, ...]:
    """The evidence of an alignment or a navigation in words, with the options of this program."""
    from truenorth.state.wording import sentences

    options = OPTIONS | (OF_A_START if hasattr(result, "track") else {})
    return tuple(in_options(text) for text in sentences(result.evidence, options))
