"""Other programs: how each is told a robot, and its work; some need an interpreter of their own."""
