"""What is wrong with a record: gaps, units, axes, noise, and how the base moved."""
