"""Settings of a training run of seconds, with checkpoints in its middle."""

TINY = [
    *("steps=240", "environments=2", "net=[8]", "checkpoint=60"),
    *("learner.learning_starts=40", "learner.batch_size=16"),
    *("validation.every=120", "validation.episodes=1"),
]
