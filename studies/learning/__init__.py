"""The learning study: policies trained and compared, and the leaderboard page."""
