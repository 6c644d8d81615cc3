//! What can be asked of a running launch.

use super::control::{Call, Request, Response};
use super::member::Duty;
use super::status::Status;
use super::{Counts, Manager, Newest, PendingGoal};
use crate::operator::viewer;
use crate::shell::page::SlotState;
use crossbeam_channel::Sender;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{
    Answer, Drive, GoalHeader, GoalKind, Mode, ReferenceState, Refusal, Waypoint, field_text,
};
use hilare_interfaces::wires::{self, Role};
use std::time::Instant;
use tracing::info;

impl Manager {
    pub(super) fn answer(&mut self, call: Call) {
        let by = self.who(call.from);
        let response = match call.request {
            Request::Status => Response { status: Some(self.status()), ..Response::done("") },
            Request::Measured => Response {
                status: Some(self.status()),
                measured: Some(self.measured()),
                ..Response::done("")
            },
            Request::Log { after } => Response { log: Some(self.log.since(after)), ..Response::done("") },
            Request::Arm if !self.up => Response::refused("the robot is still starting"),
            Request::Arm => match self.set_mode(Mode::Armed, by) {
                Ok(()) => Response::done("armed"),
                Err(why) => Response::refused(why),
            },
            Request::Stop => {
                let was = Mode::from_code(self.authority.mode);
                match (self.set_mode(Mode::Stop, by), was) {
                    (Err(why), _) => Response::refused(why),
                    (Ok(()), Some(Mode::EStop)) => {
                        Response::done("the emergency stop is on already (hilare reset releases it)")
                    }
                    (Ok(()), Some(Mode::Armed)) => Response::done("stopping; hilare arm lets it go on"),
                    (Ok(()), _) => Response::done("it is not armed; hilare arm lets it drive"),
                }
            }
            Request::Estop => {
                let _ = self.set_mode(Mode::EStop, by);
                Response::done("emergency stop; hilare reset releases it")
            }
            Request::Reset => {
                if self.mode() != Mode::EStop {
                    Response::done("no emergency stop is on; nothing to release")
                } else if let Err(why) = self.set_mode(Mode::Disarmed, by) {
                    Response::refused(why)
                } else {
                    Response::done("emergency stop released; the robot is disarmed (hilare arm)")
                }
            }
            Request::Down => {
                self.down = true;
                Response::done("going down")
            }
            Request::Join(role) => self.join(&role, call.peer),
            Request::Swap { role, driver, set } => {
                return self.begin_swap(&role, driver.as_deref(), &set, &call.reply);
            }
            Request::Set(set) => return self.begin_param(&set, &call.reply),
            Request::System => Response { system: Some(self.job.system.to_toml()), ..Response::done("") },
            Request::Standings(asked) => self.standings(asked),
            Request::Follow(points) => {
                let waypoint = |[x_m, y_m, bulge, crab_rad]: [f64; 4]| Waypoint { x_m, y_m, bulge, crab_rad };
                let waypoints = points.into_iter().map(waypoint).collect();
                let header = GoalHeader { kind: GoalKind::Follow.code(), ..GoalHeader::ZERO };
                return self.send_goal(header, waypoints, call.reply, by);
            }
            Request::Goal { x_m, y_m, theta_rad } => {
                let header = GoalHeader {
                    kind: GoalKind::Point.code(),
                    heading_rad: theta_rad.unwrap_or(0.0),
                    has_heading: u64::from(theta_rad.is_some()),
                    ..GoalHeader::ZERO
                };
                return self.send_goal(header, vec![Waypoint::straight(x_m, y_m)], call.reply, by);
            }
        };
        let _ = call.reply.send(response);
    }

    /// Hands a goal to the planner; its answer is passed on when it comes.
    pub(super) fn send_goal(
        &mut self,
        header: GoalHeader,
        waypoints: Vec<Waypoint>,
        reply: Sender<Response>,
        by: &'static str,
    ) {
        let id = self.next_goal;
        self.next_goal += 1;
        let header = GoalHeader { goal_id: id, ..header };
        match &waypoints[..] {
            [point] if header.kind == GoalKind::Point.code() => {
                info!("goal {id}, by {by}: {:.3}, {:.3} m", point.x_m, point.y_m);
            }
            path => info!("goal {id}, by {by}: a path of {} waypoints", path.len()),
        }
        self.goals.push_back(PendingGoal {
            id,
            unsent: Some(waypoints),
            header,
            reply,
            by,
            since: Instant::now(),
        });
        self.send_goals_that_wait();
    }

    /// Hands on what waits for the planner to be at work: it may just be starting again.
    pub(super) fn send_goals_that_wait(&mut self) {
        if !self.page.members(Role::Planner).any(|slot| self.page.state(slot) == SlotState::Working) {
            return;
        }
        for goal in &mut self.goals {
            let Some(waypoints) = goal.unsent.take() else { continue };
            if self.ports.goal.send(&goal.header, waypoints.into_iter()) {
                self.page.ring(&wires::GOAL);
            } else {
                let _ =
                    goal.reply.try_send(Response::refused("the goal could not be sent; is /dev/shm full?"));
            }
        }
    }

    /// The planner is gone: whoever has an answer to come gets it from launch.
    pub(super) fn refuse_goals_of_the_dead(&mut self) {
        let asked = self.goals.iter().filter(|goal| goal.unsent.is_none());
        for goal in asked {
            let _ = goal.reply.try_send(Response::refused("the planner died over it; ask again"));
        }
        self.goals.retain(|goal| goal.unsent.is_some());
    }

    /// An answer of the planner, to whoever asked.
    pub(super) fn pass_on(&mut self, answer: &Answer) {
        let Some(place) = self.goals.iter().position(|goal| goal.id == answer.goal_id) else { return };
        let Some(goal) = self.goals.remove(place) else { return };
        let text = field_text(&answer.text);
        let response = if answer.accepted == 1 {
            let hint = match Mode::from_code(self.authority.mode) {
                Some(Mode::Armed) => "",
                Some(Mode::EStop) => "; the emergency stop is on (hilare reset, hilare arm)",
                _ => "; the robot is not armed (hilare arm)",
            };
            info!("goal {}, by {}: accepted, {} waypoints", goal.id, goal.by, answer.waypoints);
            Response::done(format!("accepted: {} waypoints{hint}", answer.waypoints))
        } else {
            info!("goal {}, by {}: refused: {text}", goal.id, goal.by);
            Response::refused(text)
        };
        let _ = goal.reply.send(response);
    }

    /// Whom the log names for an order.
    fn who(&self, from: Option<u32>) -> &'static str {
        let page = self.members.iter().filter(|member| member.role == Role::Operator);
        let page = page.filter_map(|member| member.running.as_ref()).any(|running| Some(running.pid) == from);
        if page { "the page" } else { "the command line" }
    }

    /// Whose command was refused last, and why.
    fn last_refusal(&self) -> String {
        let steps = &self.newest.steps;
        let why = Refusal::from_code(steps.refusal).map_or("unknown", Refusal::label);
        let slot = usize::try_from(steps.refused_source).ok().and_then(|source| source.checked_sub(1));
        let member = slot.and_then(|slot| self.members.get(slot));
        let whose = match member.filter(|member| member.driver.is_some()) {
            Some(member) => member.name(),
            None => format!("a program that is none of the robot's (source {})", steps.refused_source),
        };
        format!("the last one, of {whose}: {why}")
    }

    /// Where the operator's page is, if there is one; with its token, if it needs one.
    pub fn page_url(&self) -> Option<&str> {
        self.page_url.as_deref()
    }

    /// Where Foxglove and Lichtblick connect to, if they can.
    pub fn foxglove_url(&self) -> Option<String> {
        let address = &self.job.system.foxglove;
        (!address.is_empty()).then(|| viewer::url(address))
    }

    /// Everything there is to know.
    pub fn status(&self) -> Status {
        let Newest { steps, pose, reference } = &self.newest;
        let twist = steps.commanded_twist();
        let label = |code: u64, decode: fn(u64) -> Option<Mode>| decode(code).map_or("unknown", Mode::label);
        Status {
            robot: self.job.system.robot.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            launch_pid: std::process::id(),
            uptime_s: self.born.elapsed().as_secs_f64(),
            clock: self.job.clock.to_string(),
            mode: if self.up { label(self.authority.mode, Mode::from_code) } else { "starting" }.to_owned(),
            drive: Drive::from_code(steps.drive).map_or("unknown", Drive::label).to_owned(),
            tick: steps.tick,
            path_state: ReferenceState::from_code(reference.state)
                .map_or("unknown", ReferenceState::label)
                .to_owned(),
            waypoint: reference.index,
            waypoints: reference.total,
            pose: pose.map(|pose| [pose.x_m, pose.y_m, pose.theta_rad]),
            speed_mps: twist.speed_mps(),
            omega_radps: twist.omega_radps,
            ticks_late: steps.ticks_late,
            commands_late: steps.commands_late,
            commands_rejected: steps.commands_rejected,
            last_refusal: (steps.refusal != Refusal::None.code()).then(|| self.last_refusal()),
            cycles_without_command: steps.cycles_without_command,
            commands_borrowed: steps.commands_borrowed,
            promotions: steps.promotions,
            swaps: self.swaps,
            paused_ticks: steps.paused_ticks,
            param_changes: self.params.made,
            last_param_change: self.params.last.clone(),
            fault: self.fault.clone().or_else(|| self.halted.clone()),
            halted: self.fault.is_none() && self.halted.is_some(),
            ended: self.ended().map(str::to_owned),
            system: self.systems.current,
            page: self.page_url.clone(),
            foxglove: self.foxglove_url(),
            processes: self
                .members
                .iter()
                .enumerate()
                .filter(|(_, member)| member.duty != Duty::Vacant)
                .map(|(slot, member)| {
                    let pid = member.running.as_ref().map_or(0, |running| running.pid);
                    let counts = Counts::of(&self.page, slot, pid);
                    member.status(slot, self.page.state(slot), steps.standby_answers > 0, counts)
                })
                .collect(),
        }
    }
}
