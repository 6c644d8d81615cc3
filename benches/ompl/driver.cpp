// OMPL's PRM and LazyPRM on a problem exported by `benches/planner.rs`; CPU times as JSON lines.
//
//   driver first  PROBLEM RUNS SECONDS   fresh planner a run: first solution, then simplification
//   driver repeat PROBLEM SECONDS LIMIT  one planner for all queries: a first pass, then the timed pass; each
//                                        pass ends after LIMIT seconds of CPU time, and "tried" tells how far
//
// The validity check is as cheap as it can be: one look-up of the exported exact distance at the nearest
// cell centre. Motions are checked at steps of one cell, OMPL's own discrete motion validator. Time is
// CLOCK_PROCESS_CPUTIME_ID, so the sleeps of PRM's solution-checking thread are not counted.

#include <ompl/base/ProblemDefinition.h>
#include <ompl/base/SpaceInformation.h>
#include <ompl/base/objectives/PathLengthOptimizationObjective.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/geometric/PathGeometric.h>
#include <ompl/geometric/PathSimplifier.h>
#include <ompl/geometric/planners/prm/LazyPRM.h>
#include <ompl/geometric/planners/prm/PRM.h>
#include <ompl/util/Console.h>
#include <ompl/util/RandomNumbers.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

namespace ob = ompl::base;
namespace og = ompl::geometric;

static double cpu_us() {
    timespec t{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec * 1e6 + t.tv_nsec * 1e-3;
}

struct Query {
    double x0, y0, x1, y1;
};

struct Problem {
    int width = 0, height = 0;
    double resolution = 0, x = 0, y = 0, radius = 0;
    std::vector<Query> queries;
    std::vector<float> clearance;

    explicit Problem(const char *path) {
        std::ifstream in(path, std::ios::binary);
        std::string line;
        std::size_t count = 0;
        std::getline(in, line);
        std::istringstream(line) >> width >> height >> resolution >> x >> y;
        std::getline(in, line);
        std::istringstream(line) >> radius >> count;
        for (std::size_t i = 0; i < count; ++i) {
            Query q{};
            std::getline(in, line);
            std::istringstream(line) >> q.x0 >> q.y0 >> q.x1 >> q.y1;
            queries.push_back(q);
        }
        clearance.resize(std::size_t(width) * height);
        in.read(reinterpret_cast<char *>(clearance.data()), clearance.size() * sizeof(float));
        if (!in) {
            std::fprintf(stderr, "%s: not a problem file; write it with benches/planner.rs\n", path);
            std::exit(2);
        }
    }

    bool valid(const ob::State *state) const {
        const double *p = state->as<ob::RealVectorStateSpace::StateType>()->values;
        const int i = int((p[0] - x) / resolution), j = int((p[1] - y) / resolution);
        return i >= 0 && j >= 0 && i < width && j < height && clearance[std::size_t(j) * width + i] >= radius;
    }
};

static ob::SpaceInformationPtr make_space(const Problem &problem) {
    auto space = std::make_shared<ob::RealVectorStateSpace>(2);
    ob::RealVectorBounds bounds(2);
    bounds.setLow(0, problem.x);
    bounds.setLow(1, problem.y);
    bounds.setHigh(0, problem.x + problem.width * problem.resolution);
    bounds.setHigh(1, problem.y + problem.height * problem.resolution);
    space->setBounds(bounds);
    auto si = std::make_shared<ob::SpaceInformation>(space);
    si->setStateValidityChecker([&problem](const ob::State *s) { return problem.valid(s); });
    si->setStateValidityCheckingResolution(problem.resolution / space->getMaximumExtent());
    si->setup();
    return si;
}

static ob::ProblemDefinitionPtr define(const ob::SpaceInformationPtr &si, const Query &q) {
    auto pdef = std::make_shared<ob::ProblemDefinition>(si);
    ob::ScopedState<ob::RealVectorStateSpace> start(si->getStateSpace()), goal(si->getStateSpace());
    start[0] = q.x0, start[1] = q.y0, goal[0] = q.x1, goal[1] = q.y1;
    pdef->setStartAndGoalStates(start, goal);
    return pdef;
}

template <class P> static std::shared_ptr<P> make_planner(const ob::SpaceInformationPtr &si) {
    return std::make_shared<P>(si);
}

static double at(std::vector<double> v, double share) {
    if (v.empty()) return -1;
    std::sort(v.begin(), v.end());
    return v[std::size_t((v.size() - 1) * share + 0.5)];
}

static void print(const char *name, const std::vector<double> &v) {
    double mean = 0;
    for (double x : v) mean += x / v.size();
    std::printf(", \"%s_mean\": %.2f, \"%s_p50\": %.2f, \"%s_p99\": %.2f, \"%s_max\": %.2f", name, mean, name,
                at(v, 0.5), name, at(v, 0.99), name, at(v, 1));
}

template <class P> static void first(const char *name, const Problem &problem, int runs, double seconds) {
    std::vector<double> time, simplify, raw, length;
    auto si = make_space(problem);
    for (int run = 0; run < runs; ++run) {
        auto pdef = define(si, problem.queries[0]);
        auto planner = make_planner<P>(si);
        planner->setProblemDefinition(pdef);
        planner->setup();
        const double began = cpu_us();
        const auto status = planner->ob::Planner::solve(seconds);
        if (status != ob::PlannerStatus::EXACT_SOLUTION) continue;
        time.push_back(cpu_us() - began);
        auto &path = static_cast<og::PathGeometric &>(*pdef->getSolutionPath());
        raw.push_back(path.length() * 1e3);
        const double simplifying = cpu_us();
        og::PathSimplifier(si).simplifyMax(path);
        simplify.push_back(cpu_us() - simplifying);
        length.push_back(path.length() * 1e3);
    }
    std::printf("{\"side\": \"%s\", \"solved\": %zu, \"seeds\": %d", name, time.size(), runs);
    print("first_us", time);
    print("smoothing_us", simplify);
    print("first_raw_mm", raw);
    print("first_smoothed_mm", length);
    std::printf("}\n");
}

template <class P> static void repeat(const char *name, const Problem &problem, double seconds, double limit) {
    auto si = make_space(problem);
    auto planner = make_planner<P>(si);
    planner->setProblemDefinition(define(si, problem.queries[0]));
    planner->setup();
    std::vector<double> time, simplify, lengths;
    std::size_t tried = 0;
    for (int pass = 0; pass < 2; ++pass) {
        const double pass_began = cpu_us();
        for (const Query &q : problem.queries) {
            if (cpu_us() - pass_began > limit * 1e6) break;
            tried += pass;
            auto pdef = define(si, q);
            planner->clearQuery();
            planner->setProblemDefinition(pdef);
            const double began = cpu_us();
            const auto status = planner->ob::Planner::solve(seconds);
            const double solved = cpu_us();
            if (pass == 0) continue;
            if (status != ob::PlannerStatus::EXACT_SOLUTION) {
                lengths.push_back(-1);
                continue;
            }
            time.push_back(solved - began);
            auto &path = static_cast<og::PathGeometric &>(*pdef->getSolutionPath());
            og::PathSimplifier(si).simplifyMax(path);
            simplify.push_back(cpu_us() - solved);
            lengths.push_back(path.length());
        }
    }
    std::printf("{\"side\": \"%s\", \"solved\": %zu, \"tried\": %zu", name, time.size(), tried);
    print("search_us", time);
    print("smoothing_us", simplify);
    std::printf(", \"lengths_m\": [");
    for (std::size_t i = 0; i < lengths.size(); ++i) std::printf("%s%.4f", i ? ", " : "", lengths[i]);
    std::printf("]}\n");
}

int main(int argc, char **argv) {
    ompl::msg::setLogLevel(ompl::msg::LOG_ERROR);
    ompl::RNG::setSeed(1);
    const std::string verb = argc > 1 ? argv[1] : "";
    if (verb == "first" && argc == 5) {
        const Problem problem(argv[2]);
        first<og::PRM>("ompl PRM", problem, std::atoi(argv[3]), std::atof(argv[4]));
        first<og::LazyPRM>("ompl LazyPRM", problem, std::atoi(argv[3]), std::atof(argv[4]));
    } else if (verb == "repeat" && argc == 5) {
        const Problem problem(argv[2]);
        repeat<og::PRM>("ompl PRM", problem, std::atof(argv[3]), std::atof(argv[4]));
        repeat<og::LazyPRM>("ompl LazyPRM", problem, std::atof(argv[3]), std::atof(argv[4]));
    } else {
        std::fprintf(stderr, "usage: driver first PROBLEM RUNS SECONDS | driver repeat PROBLEM SECONDS LIMIT\n");
        return 2;
    }
}
