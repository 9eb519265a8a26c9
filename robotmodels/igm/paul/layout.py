"""Layout of a plan as the kernel reads it; see `program.Program`.

The words ``_compile import`` make this file one of those whose change empties the kernels' cache.
"""

# head of the instructions: sizes, then the beginnings of its parts and of those of the numbers
JOINTS, STEPS, REGISTERS, UNKNOWNS, MOST = range(5)
STEP_TABLE, STARTS, OPERATIONS, RESULTS, SIGMA = range(5, 10)
INITIAL, REFERENCES, SIDES, LEVER, SCALES, TOLERANCES, LIMITS, LABELS = range(10, 18)
HEAD = 18

# one row of the table of steps
CODE, FIRST, SECOND, REFERENCE, COEFFICIENTS = 0, 1, 2, 3, 5
STEP = COEFFICIENTS + 7

# codes of the kernel's equations; the first unknown is a length from LENGTH on
ANGLE, OPPOSITE_ANGLES, ONE_EQUATION, TWO_EQUATIONS, TWO_ANGLES, QUARTIC = range(6)
LENGTH, POLYNOMIAL, LENGTH_TIMES_ANGLE, LENGTH_AND_ANGLE = range(6, 10)
RARE = (QUARTIC, POLYNOMIAL, LENGTH_TIMES_ANGLE, LENGTH_AND_ANGLE)

# bits of what a step reports, and of a pose: some error above rounding
DOUBLE, FREE_1, FREE_2, SMALL, ROUGH = 1, 2, 4, 8, 16

# bits of the mode of a call
GIVEN, WITHIN_LIMITS, UNORDERED = 1, 2, 4
NEEDS_CHECK = -1000
"""Result of the kernel for a pose or reference that the checks in Python must look at."""
AT_LIMIT = 1e-9
"""What rounding may carry a solution over its limits [rad, m]."""
