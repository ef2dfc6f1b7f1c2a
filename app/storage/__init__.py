"""What the service remembers: missions, their events, presets, logins and the audit, in one SQL database."""
