"""Three-vectors and matrices as tuples of scalars, which the compiler keeps in registers.

A vector is (x, y, z); a 3x3 matrix is its nine entries row by row.
"""

from ._compile import Floats, compiled

Vector = tuple[float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]


@compiled()
def vector(array: Floats, i: int) -> Vector:
    """Row i of ``array (m, 3)``."""
    return (array[i, 0], array[i, 1], array[i, 2])


@compiled()
def matrix(array: Floats, i: int) -> Matrix:
    """Matrix i of ``array (m, 3, 3)``."""
    return (
        array[i, 0, 0],
        array[i, 0, 1],
        array[i, 0, 2],
        array[i, 1, 0],
        array[i, 1, 1],
        array[i, 1, 2],
        array[i, 2, 0],
        array[i, 2, 1],
        array[i, 2, 2],
    )


@compiled()
def whole_vector(array: Floats) -> Vector:
    """Entries of ``array (3,)``."""
    return (array[0], array[1], array[2])


@compiled()
def whole_matrix(array: Floats) -> Matrix:
    """Entries of ``array (3, 3)``."""
    return (
        array[0, 0],
        array[0, 1],
        array[0, 2],
        array[1, 0],
        array[1, 1],
        array[1, 2],
        array[2, 0],
        array[2, 1],
        array[2, 2],
    )


@compiled()
def put_vector(array: Floats, i: int, a: Vector) -> None:
    """Write vector a into row i of ``array (m, 3)``."""
    array[i, 0] = a[0]
    array[i, 1] = a[1]
    array[i, 2] = a[2]


@compiled()
def put_matrix(array: Floats, i: int, m: Matrix) -> None:
    """Write matrix m into ``array[i]``, ``array (m, 3, 3)``."""
    array[i, 0, 0] = m[0]
    array[i, 0, 1] = m[1]
    array[i, 0, 2] = m[2]
    array[i, 1, 0] = m[3]
    array[i, 1, 1] = m[4]
    array[i, 1, 2] = m[5]
    array[i, 2, 0] = m[6]
    array[i, 2, 1] = m[7]
    array[i, 2, 2] = m[8]


@compiled()
def add(a: Vector, b: Vector) -> Vector:
    """Sum of two vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@compiled()
def subtract(a: Vector, b: Vector) -> Vector:
    """Difference of two vectors."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@compiled()
def scale(s: float, a: Vector) -> Vector:
    """Vector a times the number s."""
    return (s * a[0], s * a[1], s * a[2])


@compiled()
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled()
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@compiled()
def times(m: Matrix, a: Vector) -> Vector:
    """Matrix times vector: to outer coordinates when m is the rotation of the inner frame."""
    return (
        m[0] * a[0] + m[1] * a[1] + m[2] * a[2],
        m[3] * a[0] + m[4] * a[1] + m[5] * a[2],
        m[6] * a[0] + m[7] * a[1] + m[8] * a[2],
    )


@compiled()
def transpose_times(m: Matrix, a: Vector) -> Vector:
    """Transposed matrix times vector: to the inner frame's coordinates when m is its rotation."""
    return (
        m[0] * a[0] + m[3] * a[1] + m[6] * a[2],
        m[1] * a[0] + m[4] * a[1] + m[7] * a[2],
        m[2] * a[0] + m[5] * a[1] + m[8] * a[2],
    )


@compiled()
def product(m: Matrix, k: Matrix) -> Matrix:
    """Matrix product m k."""
    return (
        m[0] * k[0] + m[1] * k[3] + m[2] * k[6],
        m[0] * k[1] + m[1] * k[4] + m[2] * k[7],
        m[0] * k[2] + m[1] * k[5] + m[2] * k[8],
        m[3] * k[0] + m[4] * k[3] + m[5] * k[6],
        m[3] * k[1] + m[4] * k[4] + m[5] * k[7],
        m[3] * k[2] + m[4] * k[5] + m[5] * k[8],
        m[6] * k[0] + m[7] * k[3] + m[8] * k[6],
        m[6] * k[1] + m[7] * k[4] + m[8] * k[7],
        m[6] * k[2] + m[7] * k[5] + m[8] * k[8],
    )


@compiled()
def product_transpose(m: Matrix, k: Matrix) -> Matrix:
    """Matrix product m k^T."""
    return (
        m[0] * k[0] + m[1] * k[1] + m[2] * k[2],
        m[0] * k[3] + m[1] * k[4] + m[2] * k[5],
        m[0] * k[6] + m[1] * k[7] + m[2] * k[8],
        m[3] * k[0] + m[4] * k[1] + m[5] * k[2],
        m[3] * k[3] + m[4] * k[4] + m[5] * k[5],
        m[3] * k[6] + m[4] * k[7] + m[5] * k[8],
        m[6] * k[0] + m[7] * k[1] + m[8] * k[2],
        m[6] * k[3] + m[7] * k[4] + m[8] * k[5],
        m[6] * k[6] + m[7] * k[7] + m[8] * k[8],
    )
