"""Postures and targets that bring a calibrated robot where it is sent (section 1.4.6)."""
