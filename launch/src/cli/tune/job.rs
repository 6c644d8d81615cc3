//! What a search is: the plan that is kept beside its log, and all that comes of it.

use super::TuneArgs;
use crate::cli::flags::set_with_drivers;
use crate::cli::run::path_of;
use crate::cli::{refused, warn};
use crate::config::{Scenario, System};
use crate::manager::Failure;
use crate::tuning::judge::Judge;
use crate::tuning::objectives::{OBJECTIVES, Objective, STANDARD, parse, parse_numbers};
use crate::tuning::parameters::{Tuned, parameters};
use crate::tuning::problem::{Course, Figures, Problem};
use hilare_tuner::{Mopso, Settings, Space};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::Path;

/// What is tuned on when no scenario is named: the path of paper 1's gain search.
const STANDARD_SCENARIO: &str = "trapezoid";
/// Law and scenarios of paper 1: their hypervolume counts up to 6 mm and 3 mm/s.
const PAPER_1_LAW: &str = "kanayama";
const PAPER_1: [&str; 5] = ["trapezoid", "rectangle", "rectangle-open", "so", "platform"];
const PAPER_1_REFERENCE: [f64; 2] = [0.006, 0.003];
/// Other references are as many times what the robot does as it is.
const REFERENCE_FACTOR: f64 = 2.0;
/// The plan's file in the directory of a search.
pub const PLAN_FILE: &str = "plan.json";

/// What a search is: kept beside its log, so that it can be resumed.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Built-in names, or files by their absolute paths.
    pub scenarios: Vec<String>,
    /// Law.
    pub controller: Option<String>,
    /// `--parameter`.
    pub parameters: Vec<String>,
    /// `--set`.
    pub set: Vec<String>,
    /// Names.
    pub objectives: String,
    /// `--reference`.
    pub reference: Option<String>,
    /// Runs of each scenario.
    pub seeds: u64,
    /// As `scenarios`.
    pub held_out: Vec<String>,
    /// In all.
    pub evaluations: u64,
    /// Particles.
    pub swarm: u64,
    /// Of the search.
    pub seed: u64,
    /// `--weights`.
    pub weights: Option<String>,
}

/// A plan worked out.
pub struct Job {
    /// The plan.
    pub plan: Plan,
    /// What judges.
    pub judge: Judge,
    /// Up to where hypervolume counts.
    pub reference: Vec<f64>,
    /// By which the point of the front is chosen.
    pub weights: Vec<f64>,
    /// Scenarios that are only reported.
    pub held_out: Vec<Problem>,
    /// Figures of the robot as it is, if it arrives.
    pub untuned: Option<Figures>,
    /// The search, not begun.
    pub search: Mopso,
}

impl Plan {
    /// What the options ask for.
    pub fn new(args: &TuneArgs) -> Result<Self, Failure> {
        let mut scenarios = [args.scenarios.as_slice(), args.more.as_slice()].concat();
        if scenarios.is_empty() {
            scenarios.push(STANDARD_SCENARIO.to_owned());
        }
        // A search may be resumed from elsewhere.
        let absolute = |name: &String| -> Result<String, Failure> {
            if !name.ends_with(".toml") {
                return Ok(name.clone());
            }
            let path = std::path::absolute(name).map_err(|error| refused(format!("{name}: {error}")))?;
            path.into_os_string().into_string().map_err(|_| refused(format!("{name:?}: not UTF-8")))
        };
        Ok(Self {
            scenarios: scenarios.iter().map(absolute).collect::<Result<_, _>>()?,
            controller: args.controller.clone(),
            parameters: args.parameters.clone(),
            set: args.set.clone(),
            objectives: args.objectives.clone(),
            reference: args.reference.clone(),
            seeds: args.seeds,
            held_out: args.held_out.iter().map(absolute).collect::<Result<_, _>>()?,
            evaluations: args.evaluations.unwrap_or(20_000),
            swarm: args.swarm,
            seed: args.seed,
            weights: args.weights.clone(),
        })
    }

    /// The plan of a search that was stopped; some options may change.
    pub fn resumed(dir: &Path, args: &TuneArgs) -> Result<Self, Failure> {
        let path = dir.join(PLAN_FILE);
        let wrong = |what: String| refused(format!("--resume {}: {what}", dir.display()));
        let text = fs::read_to_string(&path).map_err(|error| wrong(format!("{PLAN_FILE}: {error}")))?;
        let mut plan: Self =
            serde_json::from_str(&text).map_err(|error| wrong(format!("{PLAN_FILE}: {error}")))?;
        plan.evaluations = args.evaluations.unwrap_or(plan.evaluations);
        plan.weights = args.weights.clone().or(plan.weights);
        Ok(plan)
    }
}

fn course(plan: &Plan, name: &str) -> Result<Course, Failure> {
    let mut scenario = Scenario::load(name).map_err(refused)?;
    set_with_drivers(&mut scenario.system, &plan.set, plan.controller.as_deref(), None)?;
    if !scenario.system.controller.exec.is_empty() {
        return Err(refused(format!("{name}: controller.exec: an executable has no parameters to tune")));
    }
    let kind = scenario.system.chassis.name();
    let law = scenario.system.controller.law;
    if !law.chassis.contains(&kind) {
        return Err(refused(format!("{name}: {} does not drive its {kind} chassis", law.name)));
    }
    warn(&scenario.warnings());
    let map = scenario.system.load_map().map_err(refused)?;
    let waypoints = path_of(&scenario, map.as_ref())?;
    Ok(Course { scenario, waypoints })
}

impl Job {
    /// Loads everything the plan names and checks that it fits together.
    pub fn new(plan: Plan) -> Result<Self, Failure> {
        let places = parse(&plan.objectives).map_err(refused)?;
        let objectives: Vec<&'static Objective> = places.iter().map(|place| &OBJECTIVES[*place]).collect();
        let numbers = |flag, text: &Option<String>| {
            let numbers = text.as_ref().map(|text| parse_numbers(flag, text, places.len()));
            numbers.transpose().map_err(refused)
        };
        let weights = numbers("--weights", &plan.weights)?.unwrap_or_else(|| vec![1.0; places.len()]);
        let given_reference = numbers("--reference", &plan.reference)?;
        let courses = plan.scenarios.iter().map(|name| course(&plan, name)).collect::<Result<Vec<_>, _>>()?;
        let first = &courses[0].scenario;
        let tuned = parameters(&first.system, &plan.parameters, &plan.set).map_err(refused)?;
        let fits = |course: &Course| -> Result<(), Failure> {
            let (name, system) = (&course.scenario.name, &course.scenario.system);
            let law = first.system.controller.law.name;
            if system.controller.law.name != law {
                return Err(refused(format!(
                    "{name}: driven by {}, not by {law}; choose with --controller",
                    system.controller.law.name
                )));
            }
            let missing = tuned.iter().find(|one| system.number_key(&one.parameter.name).is_none());
            missing.map_or(Ok(()), |one| {
                Err(refused(format!("{name}: its robot has no {}", one.parameter.name)))
            })
        };
        courses.iter().try_for_each(fits)?;
        let held_out = plan
            .held_out
            .iter()
            .map(|name| {
                let course = course(&plan, name)?;
                fits(&course)?;
                Problem::new(vec![course], plan.seeds, tuned.clone()).map_err(refused)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let is_paper_1 = PAPER_1.contains(&plan.scenarios[0].as_str())
            && plan.objectives == STANDARD
            && first.system.controller.law.name == PAPER_1_LAW;
        let space = Space::new(tuned.iter().map(|one| one.parameter.clone()).collect()).map_err(refused)?;
        let problem = Problem::new(courses, plan.seeds, tuned).map_err(refused)?;
        let untuned = problem.figures(&problem.untuned()).ok();
        let within_paper_1 = untuned.is_none_or(|figures| {
            places.iter().zip(PAPER_1_REFERENCE).all(|(place, limit)| figures[*place] < limit)
        });
        let reference = given_reference
            // With slip or a wrong start its robot is beyond: then nothing would count.
            .or_else(|| (is_paper_1 && within_paper_1).then(|| PAPER_1_REFERENCE.to_vec()))
            .or_else(|| {
                let twice =
                    |figures: Figures| places.iter().map(|n| REFERENCE_FACTOR * figures[*n]).collect();
                untuned.map(twice).filter(|twice: &Vec<f64>| twice.iter().all(|limit| *limit > 0.0))
            })
            .ok_or_else(|| refused("--reference: the robot does not arrive as it is; give one".to_owned()))?;
        let start = space.encode(&problem.untuned()).map(|_| problem.untuned());
        let settings = Settings {
            swarm: plan.swarm as usize,
            starts: start.into_iter().collect(),
            reference: Some(reference.clone()),
            ..Settings::new(objectives.len(), plan.seed)
        };
        let search = Mopso::new(space, settings).map_err(refused)?;
        let judge = Judge::new(problem, places);
        Ok(Self { plan, judge, reference, weights, held_out, untuned, search })
    }

    /// What the robot as it is is called.
    pub fn untuned_name(&self) -> &'static str {
        let scenario = &self.judge.problem.courses()[0].scenario;
        let system = &scenario.system;
        let is_point_a = System::load("epuck").is_ok_and(|e_puck| {
            let same = |one: &Tuned| system.get(&one.parameter.name) == e_puck.get(&one.parameter.name);
            system.controller.law.name == e_puck.controller.law.name
                && system.chassis == e_puck.chassis
                && self.judge.problem.tuned().iter().all(same)
        });
        if is_point_a { "point A" } else { "untuned" }
    }
}
