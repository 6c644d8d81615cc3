//! One tick seen from outside: authority, holding, ramps, latches, limits.

mod pace;
mod standby;

use super::*;
use hilare_interfaces::chassis::DifferentialParams;
use hilare_interfaces::messages::{Mode, Refusal};
use hilare_interfaces::motors::StepperParams;
use proptest::prelude::*;

#[derive(Clone)]
struct Rig {
    generator: StepGenerator,
    tick: Tick,
    seq: u64,
    authority: Authority,
}

impl Rig {
    fn new() -> Self {
        let chassis = Chassis::Differential(DifferentialParams::default());
        let motors = Motors::Stepper(StepperParams::default());
        let generator = StepGenerator::new(chassis, motors, Limits::default(), GateParams::default());
        Self { generator, tick: 0, seq: 0, authority: Authority::ZERO }
    }

    fn mode(&mut self, mode: Mode) {
        self.authority = Authority {
            seq: self.authority.seq + 1,
            mode: mode.code(),
            term: 1,
            source: 1,
            epoch: 1,
            ..self.authority
        };
        let inputs = StepInputs { authority: Some(&self.authority), ..StepInputs::default() };
        self.generator.take_in(self.tick, inputs);
    }

    fn command(&mut self, vx_mps: f64, omega_radps: f64) -> Command {
        self.seq += 1;
        let pose_tick = self.tick / 5 * 5;
        Command {
            source: 1,
            epoch: 1,
            seq: self.seq,
            pose_tick,
            effective_tick: pose_tick + 5,
            vx_mps,
            omega_radps,
            ..Command::ZERO
        }
    }

    fn tick_with(&mut self, commands: &[Command]) -> Steps {
        self.authority.seq += 1;
        let steps = self
            .generator
            .step(self.tick, StepInputs { authority: Some(&self.authority), commands, paused_ticks: 0 });
        self.tick += 1;
        steps
    }

    /// Drives `cycles` control cycles with a command in each.
    fn drive(&mut self, cycles: u64, vx_mps: f64, omega_radps: f64) -> Steps {
        let mut steps = *self.generator.state();
        for _ in 0..cycles * 5 {
            let command = self.tick.is_multiple_of(5).then(|| self.command(vx_mps, omega_radps));
            steps = self.tick_with(command.as_slice());
        }
        steps
    }
}

#[test]
fn a_command_acts_one_period_after_its_pose() {
    let mut rig = Rig::new();
    rig.mode(Mode::Armed);
    let first = rig.drive(1, 0.04, 0.0);
    assert_eq!(first.twist[0], 0.0, "ticks 0 to 4 have no command yet");
    let next = rig.tick_with(&[]);
    assert_eq!((next.tick, next.twist[0]), (6, 0.04));
    assert_eq!((next.commands_late, next.cycles_without_command), (0, 0));
}

#[test]
fn without_commands_it_holds_two_cycles_then_ramps_within_the_limit() {
    let mut rig = Rig::new();
    rig.mode(Mode::Armed);
    rig.drive(4, 0.04, 0.3);
    // The last command, of cycle 15, acts in ticks 20 to 24; cycles 25 and 30 are held.
    let mut speeds = std::vec::Vec::new();
    for _ in 0..60 {
        speeds.push(rig.tick_with(&[]));
    }
    assert!(speeds[..15].iter().all(|s| s.twist[0] == 0.04), "held");
    assert_eq!(speeds[5].drive, Drive::Hold.code());
    assert_eq!(speeds[15].drive, Drive::Ramp.code());
    for pair in speeds[14..].windows(2) {
        let (dv, dw) = (pair[0].twist[0] - pair[1].twist[0], pair[0].twist[2] - pair[1].twist[2]);
        assert!((0.0..=0.002 + 1e-12).contains(&dv) && (0.0..=0.04 + 1e-12).contains(&dw), "{dv} {dw}");
    }
    assert_eq!(speeds[59].twist, [0.0; 3]);
    assert_eq!(speeds[59].cycles_without_command, 10);
}

#[test]
fn it_resumes_when_commands_return() {
    let mut rig = Rig::new();
    rig.mode(Mode::Armed);
    rig.drive(4, 0.04, 0.0);
    for _ in 0..100 {
        rig.tick_with(&[]);
    }
    let steps = rig.drive(2, 0.03, 0.0);
    assert_eq!((steps.twist[0], steps.drive), (0.03, Drive::Command.code()));
}

#[test]
fn a_late_command_acts_when_it_comes_and_is_counted() {
    let mut rig = Rig::new();
    rig.mode(Mode::Armed);
    rig.drive(4, 0.04, 0.0);
    let late = rig.command(0.02, 0.0);
    for _ in 0..7 {
        rig.tick_with(&[]);
    }
    let steps = rig.tick_with(&[late]);
    assert_eq!((steps.twist[0], steps.commands_late), (0.02, 1));
    let after = rig.tick_with(&[]);
    assert_eq!((after.commands_late, after.cycles_without_command), (1, 0));
}

#[test]
fn a_controller_that_wakes_with_a_backlog_is_heard_in_the_cycle_to_come() {
    let mut rig = Rig::new();
    rig.mode(Mode::Armed);
    rig.drive(4, 0.04, 0.0);
    let mut missed = std::vec::Vec::new();
    for _ in 0..50 {
        missed.extend(rig.tick.is_multiple_of(5).then(|| rig.command(0.01, 0.0)));
        rig.tick_with(&[]);
    }
    missed.push(rig.command(0.02, 0.0));
    let waiting = rig.tick_with(&missed);
    for _ in 0..4 {
        rig.tick_with(&[]);
    }
    let steps = rig.tick_with(&[]);
    assert_eq!((steps.drive, steps.commands_rejected), (Drive::Command.code(), 0));
    assert_eq!(steps.cycles_without_command, waiting.cycles_without_command);
}

#[test]
fn invalid_old_repeated_and_foreign_commands_are_refused_and_counted() {
    let mut rig = Rig::new();
    rig.mode(Mode::Armed);
    rig.drive(4, 0.04, 0.0);
    let good = rig.command(0.01, 0.0);
    let for_tick = |pose_tick, effective_tick| Command { pose_tick, effective_tick, ..good };
    let (pose, effective) = (good.pose_tick, good.effective_tick);
    let bad = [
        (Command { vx_mps: f64::NAN, ..good }, Refusal::NotFinite),
        (Command { omega_radps: f64::INFINITY, ..good }, Refusal::NotFinite),
        (Command { source: 2, ..good }, Refusal::Stranger),
        (Command { epoch: 0, ..good }, Refusal::Stranger),
        (Command { epoch: 7, ..good }, Refusal::Stranger),
        (Command { seq: 1, ..good }, Refusal::OldSeq),
        (for_tick(pose, effective + 1), Refusal::OffGrid),
        (for_tick(pose, effective + 5), Refusal::NotOnePeriod),
        (for_tick(pose + 50, effective + 50), Refusal::TooFarAhead),
        (for_tick(u64::MAX, u64::MAX), Refusal::TooFarAhead),
        (for_tick(0, 5), Refusal::OldTick),
    ];
    // In one tick each is refused for the reason it would be refused for alone: `good` has not come yet.
    for (count, (command, why)) in bad.iter().enumerate() {
        let mut alone = rig.clone();
        let steps = alone.tick_with(&[*command]);
        assert_eq!(Refusal::from_code(steps.refusal), Some(*why), "command {count}: {command:?}");
        assert_eq!((steps.commands_rejected, steps.refused_source), (1, command.source));
    }
    let steps = rig.tick_with(&bad.map(|(command, _)| command));
    assert_eq!(steps.commands_rejected, bad.len() as u64);
    let steps = rig.tick_with(&[good, good]);
    assert_eq!(steps.commands_rejected, bad.len() as u64 + 1, "the repeated one");
    let steps = rig.drive(1, 0.01, 0.0);
    assert_eq!(steps.twist[0], 0.01);
}

#[test]
fn stop_ramps_and_stays_until_armed() {
    let mut rig = Rig::new();
    rig.mode(Mode::Armed);
    rig.drive(4, 0.04, 0.0);
    rig.mode(Mode::Stop);
    let steps = rig.drive(10, 0.04, 0.0);
    assert_eq!((steps.twist[0], steps.drive), (0.0, Drive::Stop.code()));
    rig.mode(Mode::Armed);
    let steps = rig.drive(2, 0.04, 0.0);
    assert_eq!(steps.twist[0], 0.04);
}

#[test]
fn e_stop_acts_on_the_next_tick_and_only_a_reset_releases_it() {
    let mut rig = Rig::new();
    rig.mode(Mode::Armed);
    rig.drive(4, 0.04, 0.0);
    rig.mode(Mode::EStop);
    assert_eq!(rig.tick_with(&[]).twist, [0.0; 3]);
    for refused in [Mode::Armed, Mode::Stop] {
        rig.mode(refused);
        assert_eq!(rig.drive(3, 0.04, 0.0).drive, Drive::EStop.code());
    }
    rig.mode(Mode::Disarmed);
    rig.mode(Mode::Armed);
    assert_eq!(rig.drive(3, 0.04, 0.0).twist[0], 0.04);
}

#[test]
fn a_lost_lease_stops_within_a_hundred_ticks() {
    let mut rig = Rig::new();
    rig.mode(Mode::Armed);
    rig.drive(4, 0.04, 0.7);
    let mut still_after = None;
    for n in 1..=200 {
        let command = rig.tick.is_multiple_of(5).then(|| rig.command(0.04, 0.7));
        let inputs = StepInputs { commands: command.as_slice(), ..StepInputs::default() };
        let steps = rig.generator.step(rig.tick, inputs);
        rig.tick += 1;
        if steps.twist == [0.0; 3] && still_after.is_none() {
            still_after = Some(n);
            assert_eq!(steps.drive, Drive::LeaseLost.code());
        }
    }
    assert!(still_after.is_some_and(|n| n <= 100), "{still_after:?}");
}

#[test]
fn pauses_are_counted_and_a_long_one_stops() {
    let mut rig = Rig::new();
    rig.mode(Mode::Armed);
    rig.drive(4, 0.04, 0.0);
    let pause = |rig: &mut Rig, paused_ticks| {
        let steps = rig.generator.step(rig.tick, StepInputs { paused_ticks, ..StepInputs::default() });
        rig.tick += 1;
        steps
    };
    let short = pause(&mut rig, 30);
    assert_eq!((short.ticks_late, short.paused_ticks, short.paused_max_ticks), (1, 30, 30));
    assert_ne!(short.drive, Drive::PauseStop.code());
    let long = pause(&mut rig, 100);
    assert_eq!((long.paused_ticks, long.drive), (130, Drive::PauseStop.code()));
    rig.mode(Mode::Stop);
    rig.mode(Mode::Armed);
    let slow = rig.tick_with(&[]).twist[0];
    let next = rig.drive(3, 0.04, 0.0).twist[0];
    assert!(slow < 0.04 && next > slow && next - slow <= 15.0 * 0.002 + 1e-12, "{slow} {next}: no jump");
    assert_eq!(rig.drive(8, 0.04, 0.0).twist[0], 0.04);
}

proptest! {
    #[test]
    fn no_command_leaves_the_constraint_set(
        vx in -1.0..1.0f64, omega in -20.0..20.0f64,
        v_min in -0.05..0.0f64, v_max in 0.0..0.1f64, omega_max in 0.0..2.0f64,
    ) {
        let chassis = Chassis::Differential(DifferentialParams::default());
        let limits = Limits { v_min_mps: v_min, v_max_mps: v_max, omega_max_radps: omega_max, ..Limits::default() };
        let commanded = BodyTwist::new(vx, 0.0, omega);
        let twist = limits.constrain(&chassis, commanded);
        prop_assert!(twist.vx_mps >= v_min && twist.vx_mps <= v_max);
        prop_assert!(twist.omega_radps.abs() <= omega_max);
        prop_assert!(chassis.motor_use(twist) <= 1.0 + 1e-12);
        prop_assert!(twist.omega_radps * omega >= 0.0);
        for (speed, limit) in chassis.wheel_speeds(twist).iter().zip([3.25, 3.25]) {
            prop_assert!(speed.abs() <= limit + 1e-9);
        }
        // What was inside v and ω but outside the diamond keeps its curvature.
        if (v_min..=v_max).contains(&vx) && omega.abs() <= omega_max {
            prop_assert!((twist.vx_mps * omega - twist.omega_radps * vx).abs() < 1e-9);
        }
    }

    #[test]
    fn whatever_arrives_wheels_stay_within_their_limit(
        raw in proptest::collection::vec((any::<[u64; 5]>(), any::<[f64; 3]>()), 1..200),
    ) {
        let mut rig = Rig::new();
        rig.mode(Mode::Armed);
        for (words, twist) in raw {
            let garbage = Command {
                source: words[0] % 3, epoch: words[1] % 3, seq: words[2],
                pose_tick: words[3] % 1000, effective_tick: words[4] % 1000,
                vx_mps: twist[0], vy_mps: twist[1], omega_radps: twist[2], fallback: 0,
            };
            let steps = rig.tick_with(&[garbage, garbage]);
            prop_assert!(steps.wheel_speed_radps.iter().all(|w| w.abs() <= 3.25 + 1e-9));
        }
    }
}

#[test]
fn accelerations_are_bounded_where_they_are_asked_to_be() {
    let limits = Limits { accel_mps2: 0.5, accel_radps2: 2.0, ..Limits::default() };
    let mut twist = BodyTwist::ZERO;
    let wanted = BodyTwist::new(0.04, 0.0, -0.7);
    for tick in 1..=1000 {
        let next = limits.ramp_to(twist, wanted);
        assert!((next.vx_mps - twist.vx_mps).abs() <= 0.5e-3 + 1e-15);
        assert!((next.omega_radps - twist.omega_radps).abs() <= 2e-3 + 1e-15);
        twist = next;
        if tick == 80 {
            assert!((twist.vx_mps - 0.04).abs() < 1e-12 && twist.omega_radps > -0.17);
        }
    }
    assert_eq!(twist, wanted);
    assert_eq!(Limits::default().ramp_to(BodyTwist::ZERO, wanted), wanted, "none in the paper");
    // Sideways, the vector changes along a straight line.
    let next = limits.ramp_to(BodyTwist::new(0.3, 0.0, 0.0), BodyTwist::new(0.0, 0.3, 0.0));
    assert!((libm::hypot(next.vx_mps - 0.3, next.vy_mps) - 0.5e-3).abs() < 1e-12 && next.vy_mps > 0.0);
}
