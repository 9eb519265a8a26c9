"""Methods that solve the equations, on one data object."""
