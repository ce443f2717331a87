"""What paper 4 claims, its related work too, and how each claim is decided."""

from __future__ import annotations

from truenorth.papers.claims import Rule, exact, interval, paired

RULES = (
    Rule(
        "Eight states estimate the misalignment more precisely than ten.",
        (
            paired("literal states8 level@20 < literal states10 level@20"),
            paired("still states8 heading@600 < 0.97 * still states10 heading@600"),
        ),
        "The first condition is the paper's own scenario over many seeds, where R = .001 is (m/s)^2 for ten states and "
        "(m/s^2)^2 for eight, so that the filters never had the same data: tilts of ten and eight states at .5 s "
        "{literal states10 level@0.5:.2f} and {literal states8 level@0.5:.2f}', at 2 s {literal states10 level@2:.2f} and "
        "{literal states8 level@2:.2f}', at 10 s {literal states10 level@10:.2f} and {literal states8 level@10:.2f}', at 20 s "
        "{literal states10 level@20:.2f} and {literal states8 level@20:.2f}'. The second has noise that both know.",
    ),
    Rule(
        "Eight states converge faster than ten.",
        (
            paired("literal states8 level@0.5 < literal states10 level@0.5"),
            paired("literal states8 level@2 < literal states10 level@2"),
            paired("still states8 heading@60 < 0.97 * still states10 heading@60"),
            paired("sway states8 heading@120 < 0.97 * sway states10 heading@120"),
        ),
        "In the paper's scenario its early advantage comes from the unit of R. With a sway of 5 mm/s the accelerometers of "
        "eight states measure the sway differentiated.",
    ),
    Rule(
        "With the paper's P0, Q and R the misalignment angles are estimated within 20 s.",
        (
            interval("literal states8 level@20 < 1.0"),
            interval("literal states10 level@20 < 1.0"),
            interval("literal states8 heading@20 < 60.0"),
            interval("literal states10 heading@20 < 60.0"),
        ),
        "60' is the heading error at the start. The sigma of heading that eight states claim is still "
        "{literal states8 heading@20 sigma:.3g}', that of P0: the curve of the paper's figure is the filter's noise.",
    ),
    Rule("Eight states cost less.", (exact("still states10 runtime ratio > 1.05"),), "Side by side, compiled."),
    Rule(
        "Seven of ten states are observable on a stationary base, and five of eight.",
        (exact("still states10 rank value = 7.0"), exact("still states8 rank value = 5.0")),
        "With ten states (SI): {entangled}. Turned by 180 deg at half time: rank {two_position states10 rank value:.0f} of 10. "
        "The paper names no ranks.",
        "ours",
    ),
    Rule(
        "In one position the biases limit heading (the closed form); in two positions they do not.",
        (
            interval("still states10 heading@600 > 0.8 * still limit heading value"),
            paired("two_position states10 heading@600 < 0.8 * still states10 heading@600"),
        ),
        by="related work",
    ),
    Rule(
        "H-infinity helps where the noise is not known.",
        (
            paired("sway h_infinity heading@120 < sway kf_wrong heading@120"),
            paired("sway h_infinity heading@120 < 1.1 * sway kf_retuned heading@120"),
        ),
        "The sway is taken for 1 % of its size. The second condition asks whether it comes within 10 % of a Kalman filter with "
        "the right noise.",
        "related work",
    ),
    Rule(
        "From a large azimuth error an unscented or a particle filter aligns where an extended one does not.",
        (
            *(
                paired(f"large_180 {method} diverged@300 mean < large_180 ekf diverged@300 mean")
                for method in ("ukf", "ukf_rotation_vector", "ukf_quaternion", "particle")
            ),
            interval("large_180 particle diverged@300 mean < 0.05"),
        ),
        "Share of runs more than 1 deg off after 300 s, from any azimuth. What needs no start, goes over the log again, or takes "
        "several starts: oba {large_180 oba diverged@300 mean:.0%}, ekf_passes {large_180 ekf_passes diverged@300 mean:.0%}, "
        "gaussian_sum {large_180 gaussian_sum diverged@300 mean:.0%}, "
        "this library's align {large_180 product diverged@300 mean:.0%}; "
        "the classical loop with fixed gains {large_180 gyrocompass_loop diverged@300 mean:.0%}.",
        "related work",
    ),
)
