"""What paper 2 claims, its related work too, and how each claim is decided; angles in arcmin, level over the turn."""

from __future__ import annotations

from truenorth.papers.claims import Rule, interval, paired

RULES = (
    Rule(
        "With the space-time error modelled, the level misalignment fluctuates much less in the turn.",
        (paired("flat_turn states16 level@120-150 < 0.67 * flat_turn states12 level@120-150"),),
        "A filter that knows delay and lever arm reaches {flat_turn oracle level@120-150:.2f}'. NEES/3 in the turn: "
        "{flat_turn states16 nees@120-150 mean:.2f} with 16 states, {flat_turn states12 nees@120-150 mean:.1f} with 12. Where "
        "there is no such error, level is {flat_turn_no_error states16 level@120-150:.3f}' with 16 states and "
        "{flat_turn_no_error states12 level@120-150:.3f}' with 12.",
    ),
    Rule(
        "The estimate of the y gyro's bias becomes notably better.",
        (paired("flat_turn states16 gyro_bias_y@120-150 < 0.8 * flat_turn states12 gyro_bias_y@120-150"),),
    ),
    Rule(
        "Either filter completes the alignment in the end.",
        (
            interval("flat_turn states16 heading@200 < 5"),
            interval("flat_turn states12 heading@200 < 5"),
            interval("flat_turn states16 heading@200 rms_over_sigma < 1.5"),
            interval("flat_turn states12 heading@200 rms_over_sigma < 1.5"),
        ),
        "Complete: heading to 5', and a sigma that tells it.",
    ),
    Rule(
        "In the turn the heading converges fast.",
        (
            interval("flat_turn states16 heading@150 < 0.2 * flat_turn states16 heading@120"),
            interval("flat_turn states12 heading@150 < 0.2 * flat_turn states12 heading@120"),
        ),
    ),
    Rule(
        "In a turn, delay and lever arm can hardly be separated.",
        (
            interval(
                "flat_turn_random states16 lever_arm_y_and_speed_times_tau@200 < 0.5 * flat_turn_random states16 lever_arm_y@200"
            ),
            interval("flat_turn_random states16 lever_arm_y@200 > 0.5"),
        ),
        "In words: {flat_turn}. Delay and arm are drawn (.05 s, 1 m): r_forward + V tau is known to "
        "{flat_turn_random states16 lever_arm_y_and_speed_times_tau@200:.2f} m, r_forward alone to "
        "{flat_turn_random states16 lever_arm_y@200:.2f} m.",
    ),
    Rule(
        "In pure acceleration or wing rock the benefit is greater than in the turn.",
        (
            *(
                interval(f"{case} gain level@120-150 median > flat_turn gain level@120-150 median")
                for case in ("accelerate", "accelerate_10.5", "wing_rock", "wing_rock_10.5")
            ),
            *(
                interval(f"{case} gain_att level@120-150 median > flat_turn gain_att level@120-150 median")
                for case in ("accelerate", "accelerate_10.5", "wing_rock", "wing_rock_10.5")
            ),
        ),
        "The benefit is level of 12 states over level of 16, run by run. The turn has 10.5 m/s^2; acceleration and wing rock are "
        "flown with 4 m/s^2 (the rock: 20 deg in 4 s, about its own axis) and with as much as the turn. With attitude matching the "
        "delay is an attitude error wherever the vehicle rotates.",
    ),
    Rule(
        "For fast and accurate alignment the space-time error must be considered.",
        (
            paired("flat_turn states16 heading@150 < 0.5 * flat_turn states12 heading@150"),
            interval("flat_turn states12 heading@150 rms_over_sigma > 1.5"),
        ),
        "A master known to be 200 ms late, silent for 10 s of the turn: level {late_master states16 level@120-150:.2f}', heading "
        "at the end {late_master states16 heading@200:.2f}'.",
    ),
    Rule(
        "A seat that bends needs states of its own (rapid transfer alignment).",
        (paired("banked_turn_flexed flexure level@120-150 < banked_turn_flexed states16_att level@120-150"),),
        "Second-order Gauss-Markov states, velocity and attitude matching in a banked turn.",
        "related work",
    ),
    Rule(
        "In position and acceleration matching too the space-time error must be considered.",
        (
            paired("flat_turn position_states16 level@120-150 < 0.8 * flat_turn position_states12 level@120-150"),
            paired(
                "flat_turn acceleration_states16 level@120-150 < 0.8 * flat_turn acceleration_states12 level@120-150"
            ),
        ),
        "Level in the turn with 12 and 16 states: position {flat_turn position_states12 level@120-150:.2f} and "
        "{flat_turn position_states16 level@120-150:.2f}', acceleration {flat_turn acceleration_states12 level@120-150:.2f} and "
        "{flat_turn acceleration_states16 level@120-150:.2f}'; heading at its end with 16: "
        "{flat_turn position_states16 heading@150:.1f} and {flat_turn acceleration_states16 heading@150:.1f}', by velocity "
        "{flat_turn states16 heading@150:.1f}'.",
    ),
    Rule(
        "Velocity matching converges faster than position matching, acceleration matching faster than either.",
        (
            paired("flat_turn states16 heading@150 < flat_turn position_states16 heading@150"),
            paired("flat_turn acceleration_states16 heading@150 < flat_turn states16 heading@150"),
        ),
        "By the noise that we took: .2 m/s, 1 m, .02 m/s^2, ten rows a second.",
        "related work",
    ),
    Rule(
        "A delay that is known can be compensated, and need not be a state.",
        (interval("late_known past_state level@120-150 < 1.1 * late_known augmented level@120-150"),),
        "200 ms, known: level in the turn {late_known past_state level@120-150:.2f}' by the state of the past time, "
        "{late_known augmented level@120-150:.2f}' with the delay as a state of which nothing is known, "
        "{late_known ignored level@120-150:.1f}' with nothing done.",
    ),
    Rule(
        "Extrapolating what the master says compensates a known delay.",
        (
            paired("late_known extrapolated level@120-150 < 0.5 * late_known ignored level@120-150"),
            interval("late_known extrapolated level@120-150 < 1.1 * late_known past_state level@120-150"),
        ),
        "The second condition: as well as the state of the past time. Level in the turn "
        "{late_known extrapolated level@120-150:.2f}' along a line through the last second.",
        "related work",
    ),
    Rule(
        "Where the delay is known badly it must be a state.",
        (paired("late_rough augmented level@120-150 < 0.8 * late_rough past_state level@120-150"),),
        "30 of 230 ms not known: level in the turn {late_rough past_state level@120-150:.2f}' by the state of the past time, "
        "{late_rough extrapolated level@120-150:.2f}' extrapolated, {late_rough augmented level@120-150:.2f}' with the delay as a "
        "state.",
        "related work",
    ),
)
