"""The motion that a log shows: smoothed and differentiated once, its residual wrench, its sensors'
noise.
"""
