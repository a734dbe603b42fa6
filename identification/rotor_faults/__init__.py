"""A rotor that lost thrust during a flight: which, when and how much, from gyro, accelerometer and
motor commands alone.
"""
