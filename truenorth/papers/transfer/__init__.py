"""System 2: transfer alignment with residual time delay and lever arm."""
