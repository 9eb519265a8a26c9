"""Real bodies and drives that explain a log: the convex torque fit, its bounds and its price."""
