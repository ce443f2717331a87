"""Damping: the Schuler, Foucault and 24 h oscillations of a free INS, calmed by networks or filters and a reference velocity."""
