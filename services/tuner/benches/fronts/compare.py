"""Runs the same problems with other libraries, the same budget each, and prints all of it in one table.

Overhead is the processor time of a search less that of its objective, an evaluation; theirs is measured about
every call of the objective. Hypervolume (reference 1.1 in each objective) of theirs is pymoo's.
"""
import argparse
import json
import logging
import math
import random
import statistics
import sys
import time

import numpy as np
from jmetal.algorithm.multiobjective.omopso import OMOPSO
from jmetal.algorithm.multiobjective.smpso import SMPSO
from jmetal.core.problem import FloatProblem
from jmetal.operator.mutation import NonUniformMutation, PolynomialMutation, UniformMutation
from jmetal.util.archive import CrowdingDistanceArchive
from jmetal.util.termination_criterion import StoppingByEvaluations
from pymoo.algorithms.moo.mopso_cd import MOPSO_CD
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from pymoo.indicators.hv import HV
from pymoo.optimize import minimize

EVALUATIONS, SWARM, ARCHIVE = 20_000, 50, 100


def zdt(h):
    """ZDT with the front's shape h(f1, g); rows are candidates."""

    def evaluate(x):
        g = 1 + 9 * x[:, 1:].sum(axis=1) / (x.shape[1] - 1)
        return np.column_stack([x[:, 0], g * h(x[:, 0], g)])

    return evaluate


def dtlz2(x):
    g = ((x[:, 2:] - 0.5) ** 2).sum(axis=1)
    a, b = x[:, 0] * math.pi / 2, x[:, 1] * math.pi / 2
    return np.column_stack(
        [(1 + g) * np.cos(a) * np.cos(b), (1 + g) * np.cos(a) * np.sin(b), (1 + g) * np.sin(a)]
    )


PROBLEMS = {
    "ZDT1": (30, 2, zdt(lambda f, g: 1 - np.sqrt(f / g))),
    "ZDT2": (30, 2, zdt(lambda f, g: 1 - (f / g) ** 2)),
    "ZDT3": (30, 2, zdt(lambda f, g: 1 - np.sqrt(f / g) - f / g * np.sin(10 * np.pi * f))),
    "DTLZ2": (12, 3, dtlz2),
}


class Clock:
    """Processor time spent in the objective."""

    def __init__(self, evaluate):
        self.evaluate, self.seconds, self.evaluations = evaluate, 0.0, 0

    def __call__(self, x):
        start = time.process_time()
        f = self.evaluate(x)
        self.seconds += time.process_time() - start
        self.evaluations += len(x)
        return f


class OfPymoo(Problem):
    def __init__(self, variables, objectives, clock):
        super().__init__(n_var=variables, n_obj=objectives, xl=0.0, xu=1.0)
        self.clock = clock

    def _evaluate(self, x, out, *args, **kwargs):
        out["F"] = self.clock(x)


class OfJmetal(FloatProblem):
    def __init__(self, variables, objectives, clock):
        super().__init__()
        self.lower_bound, self.upper_bound = [0.0] * variables, [1.0] * variables
        self.obj_directions = [self.MINIMIZE] * objectives
        self.obj_labels = [f"f{n}" for n in range(objectives)]
        self.clock = clock

    def number_of_objectives(self):
        return len(self.obj_directions)

    def number_of_variables(self):
        return len(self.lower_bound)

    def number_of_constraints(self):
        return 0

    def name(self):
        return "problem"

    def evaluate(self, solution):
        solution.objectives = self.clock(np.array([solution.variables]))[0].tolist()
        return solution


def pymoo(make):
    def run(variables, objectives, clock, seed):
        result = minimize(OfPymoo(variables, objectives, clock), make(), ("n_eval", EVALUATIONS), seed=seed)
        return result.F

    return run


def jmetal(make):
    def run(variables, objectives, clock, seed):
        random.seed(seed)
        np.random.seed(seed)
        algorithm = make(OfJmetal(variables, objectives, clock), variables)
        algorithm.run()
        return np.array([solution.objectives for solution in algorithm.result()])

    return run


def smpso(problem, variables):
    return SMPSO(
        problem=problem,
        swarm_size=SWARM,
        mutation=PolynomialMutation(probability=1.0 / variables, distribution_index=20),
        leaders=CrowdingDistanceArchive(ARCHIVE),
        termination_criterion=StoppingByEvaluations(EVALUATIONS),
    )


def omopso(problem, variables):
    return OMOPSO(
        problem=problem,
        swarm_size=SWARM,
        epsilon=0.0075,
        uniform_mutation=UniformMutation(probability=1.0 / variables, perturbation=0.5),
        non_uniform_mutation=NonUniformMutation(
            1.0 / variables, perturbation=0.5, max_iterations=EVALUATIONS // SWARM
        ),
        leaders=CrowdingDistanceArchive(ARCHIVE),
        termination_criterion=StoppingByEvaluations(EVALUATIONS),
    )


THEIRS = {
    "pymoo MOPSO_CD": pymoo(lambda: MOPSO_CD(pop_size=SWARM, archive_size=ARCHIVE)),
    # NSGA-II has no archive: its population is the front, so it gets the archive's size.
    "pymoo NSGA-II": pymoo(lambda: NSGA2(pop_size=ARCHIVE)),
    "jMetalPy SMPSO": jmetal(smpso),
    "jMetalPy OMOPSO": jmetal(omopso),
}


def measure(run, name, seeds):
    variables, objectives, evaluate = PROBLEMS[name]
    hypervolume = HV(ref_point=np.full(objectives, 1.1))
    volumes, overheads = [], []
    for seed in range(1, seeds + 1):
        clock = Clock(evaluate)
        start = time.process_time()
        front = run(variables, objectives, clock, seed)
        whole = time.process_time() - start
        volumes.append(hypervolume(front))
        overheads.append((whole - clock.seconds) / clock.evaluations * 1e6)
    return min(volumes), statistics.median(volumes), statistics.median(overheads)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    logging.disable()
    parser.add_argument("--ours", required=True, help="what the bench printed")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--problems", default=",".join(PROBLEMS))
    args = parser.parse_args()
    chosen = args.problems.split(",")
    if unknown := set(chosen) - set(PROBLEMS):
        sys.exit(f"--problems: there is no {', '.join(sorted(unknown))}")
    with open(args.ours, encoding="utf-8") as file:
        ours = {row["problem"]: row for row in map(json.loads, file)}
    print(f"{EVALUATIONS} evaluations, swarm {SWARM}, archive {ARCHIVE}; ours 10 seeds, theirs {args.seeds}")
    print(f"{'':<7}{'':<18}{'hypervolume worst':>18}{'median':>10}{'overhead':>13}{'times ours':>12}")
    for name in chosen:
        row = ours[name]
        base = row["overhead_us"]
        worst, median = row["hypervolume_worst"], row["hypervolume_median"]
        print(f"{name:<7}{'hilare':<18}{worst:>18.5f}{median:>10.5f}{base:>10.2f} us{1:>12}", flush=True)
        for library, run in THEIRS.items():
            worst, median, overhead = measure(run, name, args.seeds)
            ratio = f"{overhead / base:.0f}"
            print(f"{'':<7}{library:<18}{worst:>18.5f}{median:>10.5f}{overhead:>10.2f} us{ratio:>12}", flush=True)


main()
