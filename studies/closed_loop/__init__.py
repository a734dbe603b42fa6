"""The loop closed in flight: an undeclared effect is flown, diagnosed, declared and flown again."""
