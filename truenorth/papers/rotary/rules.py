"""What paper 1 claims, what we claim against it, and how each claim is decided; heading in arcmin, coarse angles in deg."""

from __future__ import annotations

from truenorth.papers.claims import Rule, interval, paired

RULES = (
    Rule(
        "Coarse alignment levels within a few arcmin and finds heading within a few degrees.",
        (interval("A dual_vector coarse_level@120 < 0.1"), interval("A dual_vector coarse_heading@120 < 5")),
        "The sway does not integrate to zero at 50 s, as the paper has it: what is left of it is the heading error. The q-method "
        "over all seconds of the same integrals ends at {A q_method coarse_heading@120:.3f} deg.",
    ),
    Rule(
        "The conventional Kalman filter diverges.",
        (interval("A/per_sample kf heading@600 > 5"), interval("A_max_start kf heading@600 > 5")),
        "At 250 s it is at {A/per_sample kf heading@250:.2f}'. Its own sigma of {A/per_sample kf heading@600 sigma:.2f}' is far "
        "too large, as the sway is not white.",
    ),
    Rule(
        "All three adaptive filters converge within 250 s.",
        tuple(interval(f"A {method} heading@250 < 5") for method in ("sakf_r", "makf", "imakf")),
        "A memory of about two samples (rho = .95 in its eq. 50) takes every swing of the sway for a change of the state. "
        "A factor acted in {A sakf_r factor_share mean:.0%} (SAKF), {A makf factor_share mean:.0%} (MAKF) and "
        "{A imakf factor_share mean:.0%} (IMAKF) of the epochs.",
    ),
    Rule(
        "IMAKF is more precise than MAKF.",
        (paired("A imakf heading@600 < 0.99 * A makf heading@600"),),
        "A difference of less than 1 % counts as none: Q is nothing next to P where a factor acts.",
    ),
    Rule(
        "MAKF is more precise than SAKF.",
        (paired("A makf heading@600 < A sakf_r heading@600"),),
        "SAKF as the paper's introduction describes it: one factor on the measurement noise. With one factor on all of P (ours) "
        "it ends at {A sakf heading@600:.3g}'.",
    ),
    Rule(
        "Fading factors save a filter that the disturbance would ruin.",
        (
            interval("lever_arm_at_t1_kept kf heading@250 > 5"),
            paired("lever_arm_at_t1_kept imakf heading@250 < lever_arm_at_t1_kept kf heading@250"),
            paired("lever_arm_at_t1_kept imakf heading@600 < lever_arm_at_t1_kept kf heading@600"),
        ),
        "The lever arm's velocity at the start is left in, as the paper's eq. 29 has it (an offset of some m/s). With "
        "R = (.3 m/s)^2 a factor acts in {A_R_0.3 imakf factor_share mean:.0%} of the epochs, and IMAKF ends at "
        "{A_R_0.3 imakf heading@600:.3f}'.",
    ),
    Rule(
        "Rotation suppresses the errors that constant biases make.",
        (paired("rotation_off kf heading@600 > 2 * A/per_sample kf heading@600"),),
        "By the Kalman filter: {rotation_off kf heading@600:.3f}' without rotation, {A/per_sample kf heading@600:.4f}' with it.",
    ),
    Rule(
        "Sway as coloured noise is more precise than any of the paper's filters, with a sigma that can be believed.",
        (
            paired("A/per_sample coloured_noise_kf heading@250 < A kf_two_pass heading@250"),
            *(
                interval(f"{case} coloured_noise_kf heading@{time} rms_over_sigma < 1.5", runs=20)
                for case in ("B", "C")
                for time in (120, 250, 600)
            ),
        ),
        "Times are of the whole log, against times since the end of coarse alignment for the paper's filters.",
        "ours",
    ),
)
