//! Several controllers: standby, promotion, terms, trial, the change from one to the other.

use super::*;
use crate::whole::Whole;
use hilare_interfaces::layout::WireMessage;
use std::vec::Vec;

const ACTIVE: Pair = (3, 10);
const STANDBY: Pair = (5, 11);
const TRIAL: Pair = (6, 12);

type Pair = (u64, u64);

/// A generator under three controllers, each driving straight at its own speed.
struct Team {
    generator: StepGenerator,
    tick: Tick,
    authority: Authority,
    seq: [u64; 3],
}

impl Team {
    fn new() -> Self {
        Self::with(Limits::default())
    }

    fn with(limits: Limits) -> Self {
        let chassis = Chassis::Differential(DifferentialParams::default());
        let motors = Motors::Stepper(StepperParams::default());
        let generator = StepGenerator::new(chassis, motors, limits, GateParams::default());
        let authority = Authority {
            mode: Mode::Armed.code(),
            term: 1,
            source: ACTIVE.0,
            epoch: ACTIVE.1,
            standby_source: STANDBY.0,
            standby_epoch: STANDBY.1,
            trial_source: TRIAL.0,
            trial_epoch: TRIAL.1,
            ..Authority::ZERO
        };
        Self { generator, tick: 0, authority, seq: [0; 3] }
    }

    fn command(&mut self, of: usize, vx_mps: f64) -> Command {
        self.seq[of] += 1;
        let (source, epoch) = [ACTIVE, STANDBY, TRIAL][of];
        let pose_tick = self.tick / 5 * 5;
        Command {
            source,
            epoch,
            seq: self.seq[of],
            pose_tick,
            effective_tick: pose_tick + 5,
            vx_mps,
            ..Command::ZERO
        }
    }

    fn tick_with(&mut self, commands: &[Command]) -> Steps {
        self.authority.seq += 1;
        let inputs = StepInputs { authority: Some(&self.authority), commands, paused_ticks: 0 };
        let steps = self.generator.step(self.tick, inputs);
        self.tick += 1;
        steps
    }

    /// One control cycle; `speeds` of the controllers that answer in it.
    fn cycle(&mut self, speeds: [Option<f64>; 3]) -> [Steps; 5] {
        core::array::from_fn(|n| {
            let mut commands = Vec::new();
            for (of, speed) in speeds.iter().enumerate() {
                if let (0, Some(speed)) = (n, speed) {
                    commands.push(self.command(of, *speed));
                }
            }
            self.tick_with(&commands)
        })
    }

    fn cycles(&mut self, n: usize, speeds: [Option<f64>; 3]) -> Steps {
        (0..n).map(|_| self.cycle(speeds)).last().expect("a cycle")[4]
    }
}

#[test]
fn a_missing_command_is_the_standbys_of_the_same_tick() {
    let mut team = Team::new();
    team.cycles(4, [Some(0.02), Some(0.02), None]);
    // The active one answers nothing from here on; its last command acts in this cycle.
    let last = team.cycle([None, Some(0.03), None]);
    assert!(last.iter().all(|steps| steps.source == ACTIVE.0 && steps.twist[0] == 0.02));
    let borrowed = team.cycle([Some(0.02), Some(0.03), None]);
    assert_eq!(borrowed[0].source, STANDBY.0, "in the very tick that had none");
    assert_eq!((borrowed[4].commands_borrowed, borrowed[4].cycles_without_command), (1, 0));
    assert_eq!(borrowed[4].twist[0], 0.03);
    assert_eq!((borrowed[4].in_charge, borrowed[4].promotions), (ACTIVE.0, 0), "one miss only borrows");
    let back = team.cycle([Some(0.02), Some(0.03), None]);
    assert_eq!((back[0].source, back[4].commands_borrowed), (ACTIVE.0, 1));
}

#[test]
fn an_invalid_command_is_a_missing_one() {
    let mut team = Team::new();
    team.cycles(4, [Some(0.02), Some(0.02), None]);
    team.cycle([Some(f64::NAN), Some(0.02), None]);
    let steps = team.cycle([Some(0.02), Some(0.02), None])[0];
    assert_eq!((steps.source, steps.commands_rejected), (STANDBY.0, 1));
}

#[test]
fn several_misses_in_a_row_put_the_standby_in_charge_for_good() {
    let mut team = Team::new();
    team.cycles(4, [Some(0.02), Some(0.02), None]);
    team.cycles(1, [None, Some(0.02), None]);
    team.cycles(1, [None, Some(0.02), None]);
    let steps = team.cycle([None, Some(0.02), None])[0];
    assert_eq!((steps.in_charge, steps.epoch, steps.term), (STANDBY.0, STANDBY.1, 2));
    assert_eq!((steps.promotions, steps.cycles_without_command), (1, 0));
    // Launch does not know yet, and the old one comes back to life: neither changes anything.
    let steps = team.cycles(3, [Some(0.04), Some(0.02), None]);
    assert_eq!((steps.in_charge, steps.twist[0], steps.commands_rejected), (STANDBY.0, 0.02, 3));
    // Launch has seen it, and names another standby.
    team.authority = Authority {
        term: 2,
        source: STANDBY.0,
        epoch: STANDBY.1,
        standby_source: ACTIVE.0,
        standby_epoch: 99,
        ..team.authority
    };
    let steps = team.cycles(2, [Some(0.04), Some(0.02), None]);
    assert_eq!((steps.in_charge, steps.standby_answers, steps.commands_rejected), (STANDBY.0, 0, 5));
}

#[test]
fn a_successor_that_answers_two_cycles_at_once_goes_on_without_a_trace() {
    let commanded_next = |before: Option<f64>| {
        let mut team = Team::new();
        team.cycles(4, [Some(0.02), None, None]);
        team.cycle([Some(0.03), None, None]);
        // A process of its own in the same place; the command of the one before acts now.
        let epoch = 99;
        team.authority = Authority { term: 2, epoch, ..team.authority };
        let command = |seq: u64, effective_tick: u64, vx_mps: f64| Command {
            source: ACTIVE.0,
            epoch,
            seq,
            pose_tick: effective_tick - 5,
            effective_tick,
            vx_mps,
            ..Command::ZERO
        };
        let (now, mut commands) = (team.tick, Vec::new());
        commands.extend(before.map(|vx_mps| command(1, now, vx_mps)));
        commands.push(command(2, now + 5, 0.04));
        (0..5).for_each(|_| assert_eq!(team.tick_with(&[]).twist[0], 0.02));
        team.tick_with(&commands).twist[0]
    };
    assert_eq!(commanded_next(Some(0.02)), 0.04, "it changes its own command from 0.02 to 0.04");
    assert!(commanded_next(None) < 0.04, "nothing is known of how its commands go on");
}

#[test]
fn a_term_out_of_this_world_is_not_taken_over() {
    let mut team = Team::new();
    team.cycles(4, [Some(0.02), Some(0.02), None]);
    team.authority = Authority { term: u64::MAX, source: TRIAL.0, epoch: TRIAL.1, ..team.authority };
    let steps = team.cycles(4, [None, Some(0.02), Some(0.04)]);
    assert_eq!((steps.in_charge, steps.term, steps.twist[0]), (STANDBY.0, 2, 0.02));
    assert!(team.generator.save_state(&mut [0; 64]).is_some(), "its state can be kept");
}

#[test]
fn without_either_it_holds_and_ramps_as_with_one() {
    let mut team = Team::new();
    team.cycles(4, [Some(0.03), Some(0.03), Some(0.03)]);
    let held = team.cycles(3, [None, None, Some(0.03)]);
    assert_eq!((held.drive, held.twist[0]), (Drive::Hold.code(), 0.03));
    let ramp = team.cycle([None, None, Some(0.03)])[0];
    assert_eq!(ramp.drive, Drive::Ramp.code(), "a controller on trial never drives");
    assert_eq!((ramp.commands_borrowed, ramp.promotions), (0, 0));
}

#[test]
fn a_trial_is_judged_by_the_answers_it_has_in_time() {
    let mut team = Team::new();
    assert_eq!(team.cycles(5, [Some(0.02), None, Some(0.04)]).trial_answers, 4);
    assert_eq!(team.cycles(1, [Some(0.02), None, Some(f64::INFINITY)]).trial_answers, 5);
    assert_eq!(team.cycles(1, [Some(0.02), None, Some(0.04)]).trial_answers, 0, "one invalid: anew");
    // Late: it comes within the cycle it was for.
    let late = team.command(2, 0.04);
    team.cycles(1, [Some(0.02), None, None]);
    team.tick_with(&[]);
    let own = team.command(0, 0.02);
    assert_eq!(team.tick_with(&[late, own]).trial_answers, 0);
    assert_eq!(team.tick_with(&[]).commands_late, 0, "its lateness is no fault of the drive");
}

#[test]
fn a_swap_moves_charge_at_a_cycle_border_with_commands_that_wait() {
    let mut team = Team::new();
    team.cycles(6, [Some(0.02), None, Some(0.03)]);
    team.authority = Authority {
        term: 2,
        source: TRIAL.0,
        epoch: TRIAL.1,
        trial_source: 0,
        trial_epoch: 0,
        ..team.authority
    };
    let first = team.cycle([Some(0.02), None, Some(0.03)]);
    assert_eq!(first[0].in_charge, TRIAL.0);
    let steps = team.cycles(2, [None, None, Some(0.03)]);
    assert_eq!((steps.source, steps.cycles_without_command, steps.commands_late), (TRIAL.0, 0, 0));
}

#[test]
fn a_change_of_controller_changes_the_twist_no_faster_than_a_stop() {
    let mut team = Team::new();
    let mut speeds = std::vec![];
    for n in 0..40 {
        let active = (n % 20 < 10).then_some(0.04);
        let steps = team.cycle([active, Some(0.0), None]);
        team.authority.term = steps[4].term;
        if steps[4].in_charge != ACTIVE.0 {
            // Back to the first at once: the next change.
            team.authority.term += 1;
        }
        speeds.extend(steps.iter().filter(|steps| steps.tick > 6).map(|steps| steps.twist[0]));
    }
    let most = speeds.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    assert!((0.001..=0.002 + 1e-12).contains(&most), "{most}");
    assert!(speeds.contains(&0.0) && speeds.contains(&0.04), "each is reached in the end");
}

#[test]
fn a_standby_that_commands_the_same_leaves_no_bit_behind() {
    // A law that jumps, as Kanayama's does at a waypoint: what is not the handover's is not smoothed.
    let law = |n: u64| if n.is_multiple_of(3) { 0.037 } else { 0.011 };
    let drive = |alive: &dyn Fn(u64) -> bool| {
        let mut team = Team::new();
        let mut counts = std::vec![];
        for n in 0..60 {
            let steps = team.cycle([alive(n).then(|| law(n)), Some(law(n)), None]);
            counts.extend(steps.map(|steps| (steps.counts, steps.twist.map(f64::to_bits))));
        }
        counts
    };
    let whole = drive(&|_| true);
    for killed_at in 2..50 {
        assert!(drive(&|n| n < killed_at) == whole, "killed before cycle {killed_at}");
        assert!(drive(&|n| n != killed_at) == whole, "missed cycle {killed_at}");
        assert!(drive(&|n| n % 5 != killed_at % 5) == whole, "missed every fifth from {killed_at}");
    }
}

#[test]
fn the_virtual_clock_waits_for_whoever_answers() {
    let mut team = Team::new();
    team.cycles(2, [Some(0.02), Some(0.02), None]);
    let awaits = |team: &Team| team.generator.awaits_command(team.tick);
    assert!(!awaits(&team), "both are there");
    team.cycles(1, [Some(0.02), None, None]);
    assert!(awaits(&team), "the standby has answered before");
    let command = Command { pose_tick: team.tick - 5, effective_tick: team.tick, ..team.command(1, 0.02) };
    team.generator.take_in(team.tick, StepInputs { commands: &[command], ..StepInputs::default() });
    assert!(!awaits(&team), "nobody waits for a trial that never spoke");
    team.cycles(1, [None, Some(0.02), None]);
    assert!(awaits(&team));
}

proptest! {
    #[test]
    fn whatever_launch_and_controllers_write_nothing_breaks(
        raw in proptest::collection::vec((any::<[u64; 16]>(), any::<[f64; 3]>(), any::<bool>()), 1..200),
    ) {
        let mut team = Team::new();
        let small = |word: u64| if word.is_multiple_of(7) { word } else { word % 4 };
        for (words, twist, raw_ticks) in raw {
            let near = |word: u64| if raw_ticks { word } else { (team.tick / 5 * 5).saturating_add(word % 4 * 5) };
            let authority = Authority {
                seq: small(words[0]), mode: small(words[1]), term: small(words[2]),
                source: small(words[3]), epoch: small(words[4]),
                standby_source: small(words[5]), standby_epoch: small(words[6]),
                trial_source: small(words[7]), trial_epoch: small(words[8]),
            };
            let command = Command {
                source: small(words[9]), epoch: small(words[10]), seq: small(words[11]),
                pose_tick: near(words[12]), effective_tick: near(words[12]).saturating_add(5),
                vx_mps: twist[0], vy_mps: twist[1], omega_radps: twist[2], fallback: words[14],
            };
            let inputs = StepInputs {
                authority: Some(&authority),
                commands: &[command, command],
                paused_ticks: words[15] % 200,
            };
            let steps = team.generator.step(team.tick, inputs);
            team.tick += 1;
            prop_assert!(steps.wheel_speed_radps.iter().all(|w| w.abs() <= 3.25 + 1e-9));
            prop_assert!(steps.twist.iter().all(|part| part.is_finite()));
        }
    }
}

#[test]
fn a_successor_goes_on_with_tick_counts_and_counters_at_rest_and_disarmed() {
    let mut team = Team::new();
    team.cycles(20, [Some(0.04), Some(0.04), None]);
    let last = team.cycles(4, [None, Some(0.033), None]);
    let mut room = [0; 64];
    let used = team.generator.save_state(&mut room).expect("room");

    let mut successor = Team::new();
    assert!(successor.generator.load_state(&room[..used]));
    let state = *successor.generator.state();
    assert_eq!((state.tick, state.counts, state.term), (last.tick, last.counts, last.term));
    assert_eq!((state.commands_borrowed, state.promotions), (last.commands_borrowed, 1));
    assert_eq!((state.twist, state.drive), ([0.0; 3], Drive::Disarmed.code()));

    // What was owed to the wheels is not lost either.
    let mut again = [0; 64];
    assert_eq!(successor.generator.save_state(&mut again), Some(used));
    assert_eq!(again, room);
    (successor.tick, successor.authority.term, successor.authority.standby_source) = (team.tick, 9, 0);
    let steps = successor.cycles(10, [Some(0.04), None, None]);
    let rolled = steps.counts[0] - last.counts[0];
    assert!((9..=17).contains(&rolled), "{rolled} steps in 45 ms at 308 steps/s");
    assert!(!successor.generator.load_state(&room[..used - 1]));
    room[0] = u64::MAX;
    assert!(!successor.generator.load_state(&room[..used]), "no run is that long");
}

/// A generator with all that another one remembers.
fn copied(generator: &mut StepGenerator) -> (StepGenerator, usize) {
    let mut room = [0; 512];
    let used = Whole(generator).save_state(&mut room).expect("room");
    let mut other = Team::new().generator;
    assert!(Whole(&mut other).load_state(&room[..used]));
    for len in 0..used {
        assert!(!Whole(&mut Team::new().generator).load_state(&room[..len]), "{len}");
    }
    (other, used)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn in_the_middle_of_any_drive_a_whole_copy_goes_on_to_the_same_bits(
        cycles in proptest::collection::vec((0u8..8, -0.05..0.05f64, 0u8..6), 8..40),
        cut in 0usize..200,
        pauses in proptest::collection::vec(0u64..4, 200),
    ) {
        let mut team = Team::new();
        let mut copy = None;
        for (tick, paused_ticks) in (0..5 * cycles.len()).zip(pauses) {
            let (who, vx_mps, what) = cycles[tick / 5];
            let mut commands = Vec::new();
            if tick % 5 == usize::from(what % 4) {
                commands.extend((0..3).filter(|of| who >> of & 1 == 1).map(|of| team.command(of, vx_mps)));
            }
            if what == 5 && tick % 5 == 1 {
                let modes = [Mode::Armed, Mode::Stop, Mode::Armed, Mode::EStop, Mode::Disarmed];
                team.authority.mode = modes[tick / 5 % 5].code();
                team.authority.term += u64::from(who == 7);
            }
            team.authority.seq += 1;
            let authority = (tick % 3 == 0).then_some(&team.authority);
            if tick == cut {
                copy = Some(copied(&mut team.generator).0);
            }
            let inputs = StepInputs { authority, commands: &commands, paused_ticks };
            let steps = team.generator.step(team.tick, inputs);
            if let Some(copy) = &mut copy {
                let again = copy.step(team.tick, inputs);
                prop_assert!(again.as_bytes() == steps.as_bytes(), "{again:?} {steps:?}");
            }
            team.tick += 1;
        }
    }

    #[test]
    fn what_is_no_whole_state_is_refused_and_whatever_is_taken_on_can_be_stepped(
        changes in proptest::collection::vec((0usize..400, prop_oneof![0u64..8, any::<u64>()]), 1..4),
    ) {
        let mut team = Team::new();
        team.cycles(9, [Some(0.04), Some(0.04), Some(0.01)]);
        let mut room = [0; 512];
        let used = Whole(&mut team.generator).save_state(&mut room).expect("room");
        for (at, word) in changes {
            room[at % used] = word;
        }
        let mut other = Team::new();
        if Whole(&mut other.generator).load_state(&room[..used]) {
            other.tick = other.generator.state().tick;
            let steps = other.cycles(9, [Some(0.04), None, None]);
            prop_assert!(steps.twist.iter().all(|part| part.is_finite()));
        }
    }
}
