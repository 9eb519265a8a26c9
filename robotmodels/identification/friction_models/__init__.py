"""Friction beyond viscous and Coulomb: Stribeck's curve, friction by load, what a log supports."""
