"""Forms of the equations: torques, power, energy, momenta."""
