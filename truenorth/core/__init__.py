"""The ground floor: attitude, earth, units, small matrices, compiled functions, exceptions, files written whole."""
