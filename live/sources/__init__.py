"""Sources of messages: one file a kind."""
