"""Damping: the Schuler, Foucault and 24 h oscillations of a free INS, calmed by networks or filters and a reference velocity."""

from truenorth.damping.course import errors_of
from truenorth.damping.filters import Estimate, Filter, Fusion, run_filters
from truenorth.damping.loop import Loop, Mode, eigenvalues, in_words, network_correction
from truenorth.damping.navigation import Damping, damp_navigation
from truenorth.damping.networks import NO_NETWORK, Network, first_order, second_order
from truenorth.damping.options import Damper
from truenorth.damping.poles import filter_modes
from truenorth.damping.prior import carried_prior, paper_prior
from truenorth.damping.reference import Reference, cleaned, reference_of
from truenorth.damping.spectrum import Spectrum, earth_line, schuler_lines, spectrum

__all__ = [
    "NO_NETWORK",
    "Damper",
    "Damping",
    "Estimate",
    "Filter",
    "Fusion",
    "Loop",
    "Mode",
    "Network",
    "Reference",
    "Spectrum",
    "carried_prior",
    "cleaned",
    "damp_navigation",
    "earth_line",
    "eigenvalues",
    "errors_of",
    "filter_modes",
    "first_order",
    "in_words",
    "network_correction",
    "paper_prior",
    "reference_of",
    "run_filters",
    "schuler_lines",
    "second_order",
    "spectrum",
]
