"""The motion in a log: smoothed and differentiated, its residual wrench, its sensors' noise."""
