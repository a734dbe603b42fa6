"""Flown episodes and their comparison: benchmark, statistics, pictures and leaderboard."""
