"""Navigation: from an alignment onward, free inertial or aided."""
