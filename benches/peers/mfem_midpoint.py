"""P1 by MFEM's implicit midpoint: `mfem_midpoint.py n steps newton_tolerance linear_tolerance out.npy`
writes the displacements at T and prints the seconds of stepping as JSON.

The stage is solved as in MFEM's example 10 (unknown: the acceleration), with the settings that serve
it best here: one quadrature point (exact for linear tetrahedra; its default has 14, ten times as expensive),
conjugate gradients with a Gauss-Seidel preconditioner, Newton started from the last acceleration.
The package on PyPI brings no sparse direct solver. MFEM's neo-Hookean energy is
mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2, not the logarithmic one of `variational`: each program's error
is against a reference of its own energy on the same mesh (`--check`: its force equals that energy's).
"""
import json
import sys
import time
from importlib.metadata import version

import mfem.ser as mfem
import numpy as np

from problem import DENSITY, END, GRAVITY, LAMBDA, MU, Block

LAW = "neo-hookean-isochoric"


class Discretisation:
    """Elastic force, lumped mass, clamped degrees of freedom."""

    def __init__(self, n):
        self.block = block = Block(n)
        self.mesh = mesh = mfem.Mesh(3, len(block.points), len(block.tets), 0, 3)
        for point in block.points:
            mesh.AddVertex(*map(float, point))
        for tet in block.tets:
            mesh.AddTet(*map(int, tet))
        mesh.FinalizeTetMesh(1, 0, False)
        self.collection = mfem.H1_FECollection(1, 3)
        self.space = mfem.FiniteElementSpace(mesh, self.collection, 3, mfem.Ordering.byVDIM)
        self.clamped = mfem.intArray([int(3 * node + axis) for node in block.fixed for axis in range(3)])
        self.law = mfem.NeoHookeanModel(MU, LAMBDA + 2 * MU / 3)
        integrator = mfem.HyperelasticNLFIntegrator(self.law)
        integrator.SetIntRule(mfem.IntRules.Get(mfem.Geometry.TETRAHEDRON, 1))
        self.elastic = mfem.NonlinearForm(self.space)
        self.elastic.AddDomainIntegrator(integrator)
        self.elastic.SetEssentialTrueDofs(self.clamped)
        self.density = mfem.ConstantCoefficient(DENSITY)
        self.mass_form = mfem.BilinearForm(self.space)
        self.mass_form.AddDomainIntegrator(mfem.LumpedIntegrator(mfem.VectorMassIntegrator(self.density)))
        self.mass_form.Assemble(0)
        self.mass_form.Finalize(0)
        self.mass = self.mass_form.SpMat()
        weight = np.zeros(block.points.shape)
        weight[block.free] = block.mass[block.free, None] * GRAVITY
        self.weight = mfem.Vector(weight.ravel())


class Stage(mfem.PyOperator):
    """r(a) = M a + dV/dx(x + h (v + h a)) - weight."""

    def __init__(self, problem):
        super().__init__(problem.mass.Height())
        self.problem = problem
        self.position = mfem.Vector(self.Height())
        self.velocity = mfem.Vector(self.Height())

    def start(self, h, v, x):
        self.h, self.v, self.x = h, v, x

    def move(self, a):
        mfem.add_vector(self.v, self.h, a, self.velocity)
        mfem.add_vector(self.x, self.h, self.velocity, self.position)

    def Mult(self, a, residual):
        self.move(a)
        self.problem.elastic.Mult(self.position, residual)
        self.problem.mass.AddMult(a, residual)
        residual.Add(-1.0, self.problem.weight)
        residual.SetSubVector(self.problem.clamped, 0.0)

    def GetGradient(self, a):
        self.move(a)
        stiffness = mfem.Opr2SparseMat(self.problem.elastic.GetGradient(self.position))
        self.jacobian = mfem.Add(1.0, self.problem.mass, self.h * self.h, stiffness)
        return self.jacobian


class Motion(mfem.PyTimeDependentOperator):
    """d(v, x)/dt for MFEM's implicit integrators."""

    def __init__(self, problem, newton_tolerance, linear_tolerance):
        size = problem.mass.Height()
        super().__init__(2 * size, 0.0)
        self.size, self.stage = size, Stage(problem)
        self.linear, self.preconditioner = mfem.CGSolver(), mfem.GSSmoother()
        self.linear.SetRelTol(linear_tolerance)
        self.linear.SetAbsTol(0.0)
        self.linear.SetMaxIter(5000)
        self.linear.SetPrintLevel(-1)
        self.linear.SetPreconditioner(self.preconditioner)
        self.linear.iterative_mode = False
        self.newton = mfem.NewtonSolver()
        self.newton.SetSolver(self.linear)
        self.newton.SetOperator(self.stage)
        self.newton.SetRelTol(newton_tolerance)
        self.newton.SetAbsTol(0.0)
        self.newton.SetMaxIter(20)
        self.newton.SetPrintLevel(-1)
        self.newton.iterative_mode = True
        self.zero, self.acceleration = mfem.Vector(), mfem.Vector(size)
        self.acceleration.Assign(0.0)
        self.newton_iterations = 0

    def ImplicitSolve(self, h, state, rate):
        size = self.size
        v, x = mfem.Vector(state, 0, size), mfem.Vector(state, size, size)
        v_rate, x_rate = mfem.Vector(rate, 0, size), mfem.Vector(rate, size, size)
        self.stage.start(h, v, x)
        self.newton.Mult(self.zero, self.acceleration)
        if not self.newton.GetConverged():
            raise RuntimeError("Newton's method did not converge")
        self.newton_iterations += self.newton.GetNumIterations()
        v_rate.Assign(self.acceleration)
        mfem.add_vector(v, h, v_rate, x_rate)


def run(n, steps, newton_tolerance, linear_tolerance):
    problem = Discretisation(n)
    motion = Motion(problem, newton_tolerance, linear_tolerance)
    state = mfem.Vector(2 * motion.size)
    state.Assign(0.0)
    mfem.Vector(state, motion.size, motion.size).Assign(mfem.Vector(problem.block.points.ravel()))
    midpoint = mfem.ImplicitMidpointSolver()
    midpoint.Init(motion)
    cpu, wall, t = time.process_time(), time.perf_counter(), 0.0
    for _ in range(steps):
        t, _ = midpoint.Step(state, t, END / steps)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    x = np.array(state.GetDataArray()[motion.size :]).reshape(-1, 3)
    return x - problem.block.points, cpu, wall, motion.newton_iterations


def check(n=2):
    """The largest difference between the elastic force of MFEM and that of the energy above, over the largest force."""
    problem = Discretisation(n)
    block = problem.block
    u = np.zeros(block.points.shape)
    u[block.free] = 0.05 * np.sin(3 * block.points[block.free])
    position, force = mfem.Vector((block.points + u).ravel()), mfem.Vector(u.size)
    problem.elastic.Mult(position, force)
    theirs = force.GetDataArray().reshape(-1, 3)[block.free]
    ours = block.elastic_gradient(u, LAW)[block.free]
    return np.abs(theirs - ours).max() / np.abs(ours).max()


if __name__ == "__main__":
    if sys.argv[1] == "--check":
        print(json.dumps({"version": version("mfem"), "force_difference": check()}))
    else:
        n, steps = map(int, sys.argv[1:3])
        u, cpu, wall, iterations = run(n, steps, float(sys.argv[3]), float(sys.argv[4]))
        np.save(sys.argv[5], u)
        print(json.dumps({"cpu": cpu, "wall": wall, "newton_iterations": iterations}))
