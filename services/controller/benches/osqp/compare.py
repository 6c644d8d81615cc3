"""Solves the dumped problems with OSQP as a controller would: set up once, updated in place, warm.

A problem is ten lines: P (upper triangle) by columns in three, q, A by columns in three, b, our solution, one
to 1e-10; the first `equations` rows (a leading line) are equations, the others A x <= b. OSQP's time is its own
(update and solve, measured in C), so Python is not in it.
"""

import sys
from pathlib import Path

import numpy as np
import osqp
from scipy import sparse

# Absolute and relative tolerance: the default, and what the first input needs.
TOLERANCES = (1e-3, 1e-6)
MOST_ITERATIONS = 20000
# Problems in a row in a dump (qp.rs); the first has no forerunner to start from and is not timed.
BURST = 50


def problems(path):
    """Yields (P, q, A, lower, upper, ours, exact) in the order of the run."""
    lines = path.read_text().splitlines()
    for at in range(0, len(lines), 11):
        equations = int(lines[at])
        numbers = [np.array(line.split(), dtype=float) for line in lines[at + 1 : at + 11]]
        pp, pi, px, q, ap, ai, ax, b, ours, exact = numbers
        hessian = sparse.csc_matrix((px, pi.astype(int), pp.astype(int)), shape=(q.size, q.size))
        matrix = sparse.csc_matrix((ax, ai.astype(int), ap.astype(int)), shape=(b.size, q.size))
        lower = np.where(np.arange(b.size) < equations, b, -np.inf)
        yield hessian, q, matrix, lower, b, ours, exact


def first_input(name, x):
    """As shares of the range, as in qp.rs."""
    if name.startswith("differential"):
        slowness = x[x.size // 2]
        return np.array([1.0 / slowness, 0.5 * x[0] / slowness])
    return 0.5 * x[:3]


def run(name, path, tolerance):
    solver, times, iterations, errors, unsolved = None, [], [], [], 0
    for count, (hessian, q, matrix, lower, upper, _, exact) in enumerate(problems(path)):
        if solver is None:
            solver = osqp.OSQP()
            solver.setup(hessian, q, matrix, lower, upper, verbose=False, eps_abs=tolerance,
                         eps_rel=tolerance, max_iter=MOST_ITERATIONS, polishing=False, warm_starting=True)
            solver.solve()
            continue
        solver.update(q=q, l=lower, u=upper, Px=hessian.data, Ax=matrix.data)
        result = solver.solve()
        if count % BURST == 0:
            continue
        unsolved += result.info.status_val != osqp.SolverStatus.OSQP_SOLVED
        times.append(1e6 * (result.info.update_time + result.info.solve_time))
        iterations.append(result.info.iter)
        if result.x is not None and np.all(np.isfinite(result.x)):
            errors.append(np.max(np.abs(first_input(name, result.x) - first_input(name, exact))))
    row = (len(times), *np.percentile(times, (50, 99)), max(times), np.mean(iterations), unsolved)
    median, worst = np.median(errors), max(errors)
    print(f"{name:<22} {tolerance:>7.0e} {row[0]:>6} {row[1]:>7.0f} {row[2]:>7.0f} {row[3]:>7.0f} "
          f"{row[4]:>7.1f} {row[5]:>5} {median:>9.1e} {worst:>9.1e}")


def main():
    print(f"\nOSQP {osqp.__version__}, a tenth of the problems, in place and warm")
    print(f"{'':<22} {'eps':>7} {'solves':>6} {'p50us':>7} {'p99us':>7} {'max us':>7} {'iter':>7} {'uns.':>5} "
          f"{'u0 median':>9} {'u0 worst':>9}")
    for path in map(Path, sys.argv[1:]):
        for tolerance in TOLERANCES:
            run(path.stem, path, tolerance)


if __name__ == "__main__":
    main()
