"""The vehicle of most tests."""

from windwrench.dynamics import load_vehicle

VEHICLE = load_vehicle("ardrone2")
