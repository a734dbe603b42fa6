"""What gyro and accelerometer are worth beside a slow pose, and whether the filter knows it."""
