"""Filters and smoothers for linear and nonlinear systems; they know nothing of navigation."""

from typing import TYPE_CHECKING

from truenorth.core.lazy import lazy

if TYPE_CHECKING:
    from truenorth.filters.drive import History, NoFilterError, Running
    from truenorth.filters.extended import extended, iterated
    from truenorth.filters.fading import fading
    from truenorth.filters.feedback import feedback
    from truenorth.filters.fusion import (
        Federated,
        Fused,
        covariance_intersection,
        cross_covariance,
        diagonal_weighted,
        federated,
        fuse,
    )
    from truenorth.filters.gains import Gains, filter_gains
    from truenorth.filters.gaussian_sum import GaussianSum, Hypotheses, around_circle, gaussian_sum, split
    from truenorth.filters.h_infinity import h_infinity, smallest_bound
    from truenorth.filters.information import (
        InformationEstimates,
        InformationState,
        information,
        information_behind,
        no_information,
        two_filter_smoother,
    )
    from truenorth.filters.innovation_adaptive import innovation_adaptive
    from truenorth.filters.jacobians import JacobianCheck, check_jacobians
    from truenorth.filters.kalman import kalman
    from truenorth.filters.nonlinear import Guarded
    from truenorth.filters.nonlinear_system import NonlinearSystem, matrix_function, vector_function
    from truenorth.filters.particle import cloud_in, particle
    from truenorth.filters.robust import Gate, gated, robust
    from truenorth.filters.sage_husa import sage_husa
    from truenorth.filters.sigma_points import cubature, gauss_hermite, unscented
    from truenorth.filters.smoother import Smoothed, smoother
    from truenorth.filters.square_root import square_root
    from truenorth.filters.steady_state import SteadyState, steady_state
    from truenorth.filters.strong_tracking import StrongTracking, strong_tracking
    from truenorth.filters.system import Estimates, FilterState, LinearSystem
    from truenorth.filters.variational import variational

__all__ = [
    "Estimates",
    "Federated",
    "FilterState",
    "Fused",
    "Gains",
    "Gate",
    "GaussianSum",
    "Guarded",
    "History",
    "Hypotheses",
    "InformationEstimates",
    "InformationState",
    "JacobianCheck",
    "LinearSystem",
    "NoFilterError",
    "NonlinearSystem",
    "Running",
    "Smoothed",
    "SteadyState",
    "StrongTracking",
    "around_circle",
    "check_jacobians",
    "cloud_in",
    "covariance_intersection",
    "cross_covariance",
    "cubature",
    "diagonal_weighted",
    "extended",
    "fading",
    "federated",
    "feedback",
    "filter_gains",
    "fuse",
    "gated",
    "gauss_hermite",
    "gaussian_sum",
    "h_infinity",
    "information",
    "information_behind",
    "innovation_adaptive",
    "iterated",
    "kalman",
    "matrix_function",
    "no_information",
    "particle",
    "robust",
    "sage_husa",
    "smallest_bound",
    "smoother",
    "split",
    "square_root",
    "steady_state",
    "strong_tracking",
    "two_filter_smoother",
    "unscented",
    "variational",
    "vector_function",
]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "Estimates": "system",
        "Federated": "fusion",
        "FilterState": "system",
        "Fused": "fusion",
        "Gains": "gains",
        "Gate": "robust",
        "GaussianSum": "gaussian_sum",
        "Guarded": "nonlinear",
        "History": "drive",
        "Hypotheses": "gaussian_sum",
        "InformationEstimates": "information",
        "InformationState": "information",
        "JacobianCheck": "jacobians",
        "LinearSystem": "system",
        "NoFilterError": "drive",
        "NonlinearSystem": "nonlinear_system",
        "Running": "drive",
        "Smoothed": "smoother",
        "SteadyState": "steady_state",
        "StrongTracking": "strong_tracking",
        "around_circle": "gaussian_sum",
        "check_jacobians": "jacobians",
        "cloud_in": "particle",
        "covariance_intersection": "fusion",
        "cross_covariance": "fusion",
        "cubature": "sigma_points",
        "diagonal_weighted": "fusion",
        "extended": "extended",
        "fading": "fading",
        "federated": "fusion",
        "feedback": "feedback",
        "filter_gains": "gains",
        "fuse": "fusion",
        "gated": "robust",
        "gauss_hermite": "sigma_points",
        "gaussian_sum": "gaussian_sum",
        "h_infinity": "h_infinity",
        "information": "information",
        "information_behind": "information",
        "innovation_adaptive": "innovation_adaptive",
        "iterated": "extended",
        "kalman": "kalman",
        "matrix_function": "nonlinear_system",
        "no_information": "information",
        "particle": "particle",
        "robust": "robust",
        "sage_husa": "sage_husa",
        "smallest_bound": "h_infinity",
        "smoother": "smoother",
        "split": "gaussian_sum",
        "square_root": "square_root",
        "steady_state": "steady_state",
        "strong_tracking": "strong_tracking",
        "two_filter_smoother": "information",
        "unscented": "sigma_points",
        "variational": "variational",
        "vector_function": "nonlinear_system",
    },
)
