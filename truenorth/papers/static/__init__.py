"""System 4: Kalman filters for the alignment of a stationary base, with ten and with eight states."""
