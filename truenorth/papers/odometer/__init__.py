"""System 5: odometer-aided alignment on the move, by nonlinear filters and by invariant errors."""
