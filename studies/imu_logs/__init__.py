"""What a diagnosis makes of logs without a pose, or with a few positions a second beside an IMU."""
