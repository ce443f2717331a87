"""Mechanisation: from increments of angle and velocity to attitude, velocity and position, in several frames."""
