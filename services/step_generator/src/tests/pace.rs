//! Pulses at a driver's pace: pauses, emergency stops, arrears.

use super::*;
use hilare_interfaces::state::STATE_WORDS;

/// Two ticks from pulse to pulse, three of set-up, four of hold; wheels as fast as the pulses, either way.
fn slow_driver() -> Rig {
    let stepper = StepperParams {
        pulse_length_s: 0.001,
        pulse_space_s: 0.001,
        direction_setup_s: 0.003,
        direction_hold_s: 0.003,
        invert_left: true,
        ..StepperParams::default()
    };
    let chassis = Chassis::Differential(DifferentialParams::default());
    let limits = Limits { v_min_mps: -0.065, v_max_mps: 0.065, ..Limits::default() };
    let generator = StepGenerator::new(chassis, Motors::Stepper(stepper), limits, GateParams::default());
    let mut rig = Rig { generator, ..Rig::new() };
    rig.mode(Mode::Armed);
    rig
}

#[test]
fn the_message_before_the_first_sets_dir_and_a_reversal_waits_for_it() {
    let mut rig = slow_driver();
    assert_eq!(rig.generator.state().dir_level, [1, 0, 0, 0], "forward, the left one inverted");
    rig.drive(10, 0.065, 0.0);
    let mut ticks = std::vec![*rig.generator.state()];
    while ticks.len() <= 60 {
        let command = rig.tick.is_multiple_of(5).then(|| rig.command(-0.065, 0.0));
        ticks.push(rig.tick_with(command.as_slice()));
    }
    let turned = ticks.iter().position(|steps| steps.dir_level == [0, 1, 0, 0]).expect("it turns");
    let pulses: std::vec::Vec<usize> =
        (1..ticks.len()).filter(|at| ticks[*at].counts[0] != ticks[*at - 1].counts[0]).collect();
    let last = pulses.iter().rfind(|at| **at < turned).expect("forward until then");
    let first = pulses.iter().find(|at| **at >= turned).expect("backward from then");
    assert_eq!((turned - last, first - turned), (4, 3), "{pulses:?}");
    assert!(pulses.windows(2).all(|pair| pair[1] - pair[0] >= 2), "{pulses:?}");
}

#[test]
fn pauses_of_any_length_cost_time_and_no_pulse() {
    let course = |paused: fn(u64) -> u64| {
        let mut rig = slow_driver();
        let mut counts = std::vec::Vec::new();
        for tick in 0..2000 {
            let speed = if tick / 300 % 2 == 0 { 0.06 } else { -0.06 };
            let command = rig.tick.is_multiple_of(5).then(|| rig.command(speed, 0.0));
            let inputs = StepInputs {
                authority: Some(&rig.authority),
                commands: command.as_slice(),
                paused_ticks: paused(tick),
            };
            let steps = rig.generator.step(tick, inputs);
            (rig.authority.seq, rig.tick) = (rig.authority.seq + 1, tick + 1);
            counts.push((steps.counts, steps.dir_level));
        }
        (counts, *rig.generator.state())
    };
    let (smooth, _) = course(|_| 0);
    // 1 to 99 ms, one after the other; 100 would stop the robot.
    let (paused, state) = course(|tick| if tick % 7 == 0 { 1 + tick / 7 % 99 } else { 0 });
    assert!(state.paused_ticks > 10_000 && state.ticks_late > 280, "{state:?}");
    assert_eq!(smooth, paused, "the ticks are the same, only later");
    let burst = paused.windows(2).any(|pair| (pair[1].0[0] - pair[0].0[0]).abs() > 1);
    assert!(!burst && paused[299].0[0] > 100);
}

/// In arrears: it has just been turned round at full speed.
fn in_arrears() -> Rig {
    let mut rig = slow_driver();
    rig.drive(10, 0.065, 0.0);
    rig.drive(3, -0.065, 0.0);
    rig
}

#[test]
fn an_emergency_stop_makes_no_pulse_that_is_owed() {
    let mut rig = in_arrears();
    rig.mode(Mode::EStop);
    let stopped = rig.generator.state().counts;
    for _ in 0..50 {
        assert_eq!(rig.tick_with(&[]).counts, stopped);
    }
}

#[test]
fn what_is_owed_by_a_robot_that_stands_is_made_up_for_when_it_goes_on() {
    let generator = slow_driver().generator;
    let full_radps = 3.25;
    let course = |stood: usize| {
        let mut train = generator.pulses.clone();
        let mut counts = std::vec![train.counts()[0]];
        for (speed, ticks) in
            [(full_radps, 101), (-full_radps, 8), (0.0, stood), (-full_radps / 2.0, 200), (0.0, 50)]
        {
            train.set_speeds([speed, speed, 0.0, 0.0]);
            for _ in 0..ticks {
                train.tick();
                counts.push(train.counts()[0]);
            }
        }
        counts
    };
    let (straight, stopped) = (course(0), course(50));
    // It would have gone back from the 105th tick on, but for the driver.
    assert!(stopped[109..=159].iter().all(|count| *count == stopped[109]) && stopped[109] > 46);
    assert_eq!(straight.last(), stopped.last());
    let pulses = |at: usize| stopped[at].abs_diff(stopped[at - 1]) + stopped[at + 1].abs_diff(stopped[at]);
    assert!((1..stopped.len() - 1).all(|at| pulses(at) <= 1), "no two in a row: {stopped:?}");
}

#[test]
fn a_state_that_owes_more_than_can_be_is_none() {
    let mut rig = in_arrears();
    let mut room = [0; STATE_WORDS];
    let used = rig.generator.save_state(&mut room).expect("a state");
    let mut fresh = slow_driver().generator;
    assert!(fresh.load_state(&room[..used]));
    assert_eq!(fresh.state().counts, rig.generator.state().counts);
    assert_eq!(fresh.state().dir_level, rig.generator.state().dir_level);
    // Behind the four counters and the four counts.
    room[8] = 1e9f64.to_bits();
    assert!(!slow_driver().generator.load_state(&room[..used]));
    room[8] = 0;
    room[12] = 2;
    assert!(!slow_driver().generator.load_state(&room[..used]), "neither forward nor backward");
}
