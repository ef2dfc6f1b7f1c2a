"""Who may reach the service, and what they may do there."""
