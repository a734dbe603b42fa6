"""Which effects explain a residual wrench, with which coefficients, and how surely."""
