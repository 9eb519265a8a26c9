"""Logs with and without a load: drive gains and payloads."""
