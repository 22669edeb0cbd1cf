"""The problem P1 that every program of the comparison solves, and a reference solution of our peers' kind:
written with numpy and scipy alone, independent of the code that is measured.

P1: a block 1 x 0.25 x 0.25 m of (4n x n x n) cubes, six tetrahedra each (Kuhn's cut, all around the
diagonal from corner 0 to corner 7), clamped at x = 0, under gravity along -y, from rest to T = 1 s;
E = 1e6 Pa, nu = 0.3, density 1000 kg/m^3, lumped mass (a quarter of each tetrahedron's to a corner).
"""
import numpy as np
import scipy.sparse as sp
from scipy.integrate import solve_ivp

SIZE = np.array([1.0, 0.25, 0.25])
YOUNG, POISSON, DENSITY = 1e6, 0.3, 1000.0
GRAVITY = np.array([0.0, -9.81, 0.0])
END = 1.0
MU = YOUNG / (2 * (1 + POISSON))
LAMBDA = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
KUHN = np.array([[0, 1, 3, 7], [0, 5, 1, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 6, 4, 7]])


class Block:
    """Mesh, lumped mass and discrete gradient of P1 with n cells across."""

    def __init__(self, n):
        cells = np.array([4 * n, n, n])
        lattice = cells + 1
        k, j, i = np.meshgrid(*(np.arange(c) for c in lattice[::-1]), indexing="ij")
        grid = np.stack([i.ravel(), j.ravel(), k.ravel()], axis=1)
        self.points = SIZE * (grid / cells)
        k, j, i = np.meshgrid(*(np.arange(c) for c in cells[::-1]), indexing="ij")
        corner = np.arange(8)
        at = lambda a, bit: a.ravel()[:, None] + ((corner >> bit) & 1)
        cubes = at(i, 0) + lattice[0] * (at(j, 1) + lattice[1] * at(k, 2))
        self.tets = cubes[:, KUHN].reshape(-1, 4)
        self.fixed = np.flatnonzero(self.points[:, 0] == 0.0)
        self.free = np.flatnonzero(self.points[:, 0] != 0.0)

        edges = self.points[self.tets[:, 1:]] - self.points[self.tets[:, :1]]  # rows: edge vectors
        self.volume = np.linalg.det(edges) / 6.0
        assert (self.volume > 0).all()
        gradient = np.empty((len(self.tets), 4, 3))  # of the four shape functions
        gradient[:, 1:] = np.linalg.inv(edges).transpose(0, 2, 1)
        gradient[:, 0] = -gradient[:, 1:].sum(axis=1)
        count = len(self.tets)
        rows = np.repeat(np.arange(3 * count).reshape(count, 1, 3), 4, axis=1)
        columns = np.repeat(self.tets[:, :, None], 3, axis=2)
        shape = (3 * count, len(self.points))
        self.gradient = sp.csr_matrix((gradient.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
        weighted = np.repeat(self.volume, 3)
        self.divergence = (self.gradient.T @ sp.diags(weighted)).tocsr()
        self.mass = np.bincount(
            self.tets.ravel(), np.repeat(DENSITY * self.volume / 4, 4), minlength=len(self.points)
        )

    def elastic_gradient(self, u, law):
        """dV/du of the elastic energy at nodal displacements u (node_count x 3), N."""
        identity = np.eye(3)
        f = identity + (self.gradient @ u).reshape(-1, 3, 3).transpose(0, 2, 1)
        if law == "st-venant-kirchhoff":
            e = 0.5 * (f.transpose(0, 2, 1) @ f - identity)
            trace = np.trace(e, axis1=1, axis2=2)[:, None, None]
            stress = f @ (LAMBDA * trace * identity + 2 * MU * e)
        else:
            inverse_transpose = np.linalg.inv(f).transpose(0, 2, 1)
            j = np.linalg.det(f)[:, None, None]
            if law == "neo-hookean":  # mu/2 (I1 - 3 - 2 ln J) + lambda/2 ln^2 J
                stress = MU * (f - inverse_transpose) + LAMBDA * np.log(j) * inverse_transpose
            elif law == "neo-hookean-isochoric":  # mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2, MFEM's
                bulk = LAMBDA + 2 * MU / 3
                trace = (f * f).sum(axis=(1, 2))[:, None, None]
                isochoric = MU * j ** (-2 / 3) * (f - trace / 3 * inverse_transpose)
                stress = isochoric + bulk * (j - 1) * j * inverse_transpose
            else:
                raise ValueError(law)
        return self.divergence @ stress.transpose(0, 2, 1).reshape(-1, 3)

    def error(self, u, reference):
        """||u - reference||_M / ||reference||_M."""
        norm = lambda w: np.sqrt(np.sum(self.mass[:, None] * w * w))
        return norm(u - reference) / norm(reference)


def reference(n, law, tolerance, method="DOP853"):
    """Displacements at T by a Runge-Kutta pair of order 8 with local error control."""
    block = Block(n)
    free, shape = block.free, block.points.shape
    mass = block.mass[free, None]

    def rate(_, y):
        u = np.zeros(shape)
        u[free], v = y.reshape(2, -1, 3)
        a = GRAVITY - block.elastic_gradient(u, law)[free] / mass
        return np.concatenate([v.ravel(), a.ravel()])

    y = np.zeros(6 * len(free))
    solution = solve_ivp(rate, (0.0, END), y, method=method, rtol=tolerance, atol=1e-3 * tolerance, t_eval=[END])
    if not solution.success:
        raise RuntimeError(solution.message)
    u = np.zeros(shape)
    u[free] = solution.y[:, -1].reshape(2, -1, 3)[0]
    return u, solution.nfev
