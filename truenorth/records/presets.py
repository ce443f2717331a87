"""Specifications that ship with the library: one IMU of each class, as a file holds it."""

from __future__ import annotations

from typing import Any

PRESETS: dict[str, dict[str, Any]] = {
    "navigation": {
        "gyro": {
            "bias": "0.01 deg/h",
            "random_walk": "0.001 deg/sqrt(h)",
            "bias_instability": "0.001 deg/h",
            "scale_factor": "5 ppm",
            "misalignment": "2 arcsec",
        },
        "accel": {
            "bias": "50 ug",
            "random_walk": "10 ug/sqrt(Hz)",
            "bias_instability": "5 ug",
            "scale_factor": "50 ppm",
            "misalignment": "5 arcsec",
        },
    },
    "tactical": {
        "gyro": {
            "bias": "1 deg/h",
            "random_walk": "0.05 deg/sqrt(h)",
            "bias_instability": "0.3 deg/h",
            "scale_factor": "150 ppm",
            "misalignment": "60 arcsec",
        },
        "accel": {
            "bias": "1 mg",
            "random_walk": "50 ug/sqrt(Hz)",
            "bias_instability": "50 ug",
            "scale_factor": "300 ppm",
            "misalignment": "60 arcsec",
        },
    },
    "industrial": {
        "gyro": {
            "bias": "100 deg/h",
            "random_walk": "0.3 deg/sqrt(h)",
            "bias_instability": "5 deg/h",
            "scale_factor": "1000 ppm",
            "misalignment": "3 arcmin",
        },
        "accel": {
            "bias": "8 mg",
            "random_walk": "100 ug/sqrt(Hz)",
            "bias_instability": "100 ug",
            "scale_factor": "1000 ppm",
            "misalignment": "3 arcmin",
        },
    },
    "consumer": {
        "gyro": {
            "bias": "1000 deg/h",
            "random_walk": "1 deg/sqrt(h)",
            "bias_instability": "30 deg/h",
            "scale_factor": "1 %",
            "misalignment": "30 arcmin",
        },
        "accel": {
            "bias": "30 mg",
            "random_walk": "300 ug/sqrt(Hz)",
            "bias_instability": "300 ug",
            "scale_factor": "1 %",
            "misalignment": "30 arcmin",
        },
    },
}
