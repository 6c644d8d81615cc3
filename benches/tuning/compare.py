"""Tunes the same scenario three ways with the same number of evaluations and compares hypervolumes.

Hypervolume is pymoo's, up to the reference `hilare tune` has, as a share of the box. Prints the front's
points beside those a random search is known to find (spec 1).
"""
import argparse
import json
import subprocess
import tempfile

import numpy as np
from pymoo.algorithms.moo.mopso_cd import MOPSO_CD
from pymoo.core.problem import Problem
from pymoo.indicators.hv import HV
from pymoo.optimize import minimize

HILARE = "target/release/hilare"
SWARM, ARCHIVE = 50, 100
# mm and mm/s on the trapezoid: a random search's, and paper 1's point A in the rebuilt equations.
KNOWN = [(2.76, 1.63), (3.16, 1.35), (5.0, 0.94), (2.7699, 2.5822)]


class Simulation:
    """`hilare tune --evaluate`: candidates in, violation and objectives out."""

    def __init__(self, scenario):
        self.process = subprocess.Popen(
            [HILARE, "tune", scenario, "--evaluate"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        head = json.loads(self.process.stdout.readline())
        self.low = np.array([one["low"] for one in head["parameters"]])
        self.high = np.array([one["high"] for one in head["parameters"]])
        self.objectives = head["objectives"]
        self.reference = np.array(head["reference"])

    def __call__(self, candidates):
        self.process.stdin.write(json.dumps(np.asarray(candidates).tolist()) + "\n")
        self.process.stdin.flush()
        answer = np.array(json.loads(self.process.stdout.readline()))
        return answer[:, 1:], answer[:, 0]


class OfPymoo(Problem):
    def __init__(self, simulation):
        super().__init__(
            n_var=len(simulation.low),
            n_obj=len(simulation.reference),
            n_ieq_constr=1,
            xl=simulation.low,
            xu=simulation.high,
        )
        self.simulation = simulation

    def _evaluate(self, x, out, *args, **kwargs):
        objectives, violations = self.simulation(x)
        # Its archive does not look at constraints: what does not arrive must not look good.
        far = 10 * self.simulation.reference * (1 + violations[:, None])
        out["F"] = np.where(violations[:, None] > 0, far, objectives)
        out["G"] = violations[:, None]


def random_front(simulation, evaluations, seed):
    random = np.random.default_rng(seed)
    found = []
    for first in range(0, evaluations, 500):
        count = min(500, evaluations - first)
        x = random.uniform(simulation.low, simulation.high, (count, len(simulation.low)))
        objectives, violations = simulation(x)
        found.append(objectives[violations == 0])
    return np.concatenate(found)


def pymoo_front(simulation, evaluations, seed):
    algorithm = MOPSO_CD(pop_size=SWARM, archive_size=ARCHIVE)
    result = minimize(OfPymoo(simulation), algorithm, ("n_eval", evaluations), seed=seed)
    return np.empty((0, len(simulation.reference))) if result.F is None else np.atleast_2d(result.F)


def hilare_front(scenario, objectives, evaluations, seed):
    with tempfile.TemporaryDirectory() as out:
        command = [HILARE, "tune", scenario, "--json", "--out", out, "--swarm", str(SWARM)]
        command += ["--evaluations", str(evaluations), "--seed", str(seed)]
        answer = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
    return np.array([[point["objectives"][key] for key in objectives] for point in answer["front"]]), answer


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", default="trapezoid")
    parser.add_argument("--evaluations", type=int, default=20_000)
    parser.add_argument("--seeds", type=int, default=1)
    args = parser.parse_args()
    simulation = Simulation(args.scenario)
    share = HV(ref_point=np.ones(len(simulation.reference)))
    names = ["hilare tune", "random samples", "pymoo MOPSO_CD"]
    volumes = {name: [] for name in names}
    for seed in range(1, args.seeds + 1):
        ours, answer = hilare_front(args.scenario, simulation.objectives, args.evaluations, seed)
        fronts = [ours]
        fronts += [search(simulation, args.evaluations, seed) for search in (random_front, pymoo_front)]
        for name, front in zip(names, fronts):
            volumes[name].append(share(front / simulation.reference) if len(front) else 0.0)
        if args.scenario == "trapezoid":
            for point in KNOWN:
                at_least = (ours * 1e3 <= np.array(point)).all(axis=1).any()
                print(f"seed {seed}: {point[0]} mm, {point[1]} mm/s is {'' if at_least else 'not '}reached or beaten")
        print(f"seed {seed}: {answer['ticks_per_second'] / 1e6:.1f} million ticks/s", flush=True)
    print(f"{args.scenario}, {args.evaluations} evaluations, hypervolume as a share of the box up to the reference")
    for name in names:
        print(f"  {name:<18}{min(volumes[name]):.5f} worst, {np.median(volumes[name]):.5f} median")


main()
