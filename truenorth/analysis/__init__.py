"""Noise, observability, consistency and bounds: of data, of linear systems, of estimates."""

from typing import TYPE_CHECKING

from truenorth.core.lazy import lazy

if TYPE_CHECKING:
    from truenorth.analysis.allan import AllanDeviation, NoiseCoefficients, overlapping_adev
    from truenorth.analysis.combinations import Entangled, entangled_states
    from truenorth.analysis.consistency import Consistency, chi_square_band, consistency, nees, nis, whiteness
    from truenorth.analysis.cramer_rao import CramerRao, cramer_rao
    from truenorth.analysis.error_budget import ErrorBudget, error_budget
    from truenorth.analysis.observability import (
        Observability,
        PiecewiseObservability,
        observability,
        piecewise_observability,
    )

__all__ = [
    "AllanDeviation",
    "Consistency",
    "CramerRao",
    "Entangled",
    "ErrorBudget",
    "NoiseCoefficients",
    "Observability",
    "PiecewiseObservability",
    "chi_square_band",
    "consistency",
    "cramer_rao",
    "entangled_states",
    "error_budget",
    "nees",
    "nis",
    "observability",
    "overlapping_adev",
    "piecewise_observability",
    "whiteness",
]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "AllanDeviation": "allan",
        "Consistency": "consistency",
        "CramerRao": "cramer_rao",
        "Entangled": "combinations",
        "ErrorBudget": "error_budget",
        "NoiseCoefficients": "allan",
        "Observability": "observability",
        "PiecewiseObservability": "observability",
        "chi_square_band": "consistency",
        "consistency": "consistency",
        "cramer_rao": "cramer_rao",
        "entangled_states": "combinations",
        "error_budget": "error_budget",
        "nees": "consistency",
        "nis": "consistency",
        "observability": "observability",
        "overlapping_adev": "allan",
        "piecewise_observability": "observability",
        "whiteness": "consistency",
    },
)
