"""Flight logs: tables, readers of other forms, conventions recognised, screening."""
