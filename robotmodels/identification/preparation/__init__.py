"""From a log to signals: choices, filters, delay, and whether joints are what they are said."""
