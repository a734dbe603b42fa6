"""Episodes flown and compared: the benchmark, its statistics, pictures and the leaderboard."""
