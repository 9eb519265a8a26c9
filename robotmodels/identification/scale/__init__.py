"""Equations reduced in pieces, by one or many workers, with the same bits."""
