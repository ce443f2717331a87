"""Coarse alignment: attitude from scratch, without linearisation."""

from truenorth.coarse.analytic import Means, analytic, means, two_position
from truenorth.coarse.inertial import CoarseAttitude, dual_vector, estimate_latitude, oba
from truenorth.coarse.uncertainty import coarse_covariance, latitude_sigma
from truenorth.coarse.wahba import q_method, triad

__all__ = [
    "CoarseAttitude",
    "Means",
    "analytic",
    "coarse_covariance",
    "dual_vector",
    "estimate_latitude",
    "latitude_sigma",
    "means",
    "oba",
    "q_method",
    "triad",
    "two_position",
]
