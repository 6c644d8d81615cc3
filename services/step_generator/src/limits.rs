//! The input constraints, paper 1 eq. (9)–(24), and the stop ramp.
//!
//! They sit in the step generator because every command of every controller passes here and nothing
//! passes around it.

use hilare_interfaces::block::TICK_S;
use hilare_interfaces::chassis::{Chassis, DifferentialParams};
use hilare_interfaces::geometry::BodyTwist;
use hilare_interfaces::param_group;

param_group! {
    /// What a command may ask for, and how a stop decelerates.
    Limits {
        /// Least speed along x, v_min; negative allows reversing.
        v_min_mps: f64 = 0.0, "m/s", -10.0, 10.0;
        /// Greatest linear speed, v_max.
        v_max_mps: f64 = 0.041, "m/s", 0.0, 10.0;
        /// Least yaw rate that is carried out, ω_min; smaller ones are raised to it, 0 is kept.
        omega_min_radps: f64 = 0.0, "rad/s", 0.0, 50.0;
        /// Greatest yaw rate, ω_max.
        omega_max_radps: f64 = 0.747, "rad/s", 0.0, 50.0;
        /// Greatest change of the linear velocity while driving; 0 for none, as in the paper.
        accel_mps2: f64 = 0.0, "m/s^2", 0.0, 100.0;
        /// Greatest change of the yaw rate while driving; 0 for none, as in the paper.
        accel_radps2: f64 = 0.0, "rad/s^2", 0.0, 10000.0;
        /// Deceleration of a stop; the paper has none, a stepper loses steps without.
        stop_decel_mps2: f64 = 2.0, "m/s^2", 0.01, 100.0;
        /// Yaw deceleration of a stop.
        stop_decel_radps2: f64 = 40.0, "rad/s^2", 0.01, 10000.0;
    }
}

impl Limits {
    /// The twist that is carried out for a commanded one: inside v, ω and the motor diamond.
    pub fn constrain(&self, chassis: &Chassis, commanded: BodyTwist) -> BodyTwist {
        if let Chassis::Differential(wheels) = chassis {
            let [vx, omega] = self.constrain_differential(wheels, commanded.vx_mps, commanded.omega_radps);
            return BodyTwist::new(vx, 0.0, omega);
        }
        // As (15) for a chassis with a sideways speed: the vector is shortened, its direction kept.
        let speed = commanded.speed_mps().abs();
        let shorten = if speed > self.v_max_mps { self.v_max_mps / speed } else { 1.0 };
        let omega = self.constrain_turn(commanded.omega_radps);
        let clamped = BodyTwist::new(commanded.vx_mps * shorten, commanded.vy_mps * shorten, omega);
        // As (18)–(24).
        let motor_use = chassis.motor_use(clamped);
        if motor_use > 1.0 {
            BodyTwist::new(
                clamped.vx_mps / motor_use,
                clamped.vy_mps / motor_use,
                clamped.omega_radps / motor_use,
            )
        } else {
            clamped
        }
    }

    /// The same for two wheels, where there is a forward speed and a yaw rate only.
    #[inline]
    pub fn constrain_differential(&self, wheels: &DifferentialParams, vx: f64, omega: f64) -> [f64; 2] {
        // [MH18] (9)–(11), (15)
        let vx = vx.max(self.v_min_mps).min(self.v_max_mps);
        let omega = self.constrain_turn(omega);
        // [MH18] (18)–(24): outside the motor diamond both shrink alike, so the curvature is kept.
        let motor_use = wheels.motor_use(vx, omega);
        if motor_use > 1.0 { [vx / motor_use, omega / motor_use] } else { [vx, omega] }
    }

    /// [MH18] (12)–(14), (16), with g(0) = 0 so that a straight line stays straight.
    #[inline]
    fn constrain_turn(&self, omega: f64) -> f64 {
        let size = omega.abs().max(self.omega_min_radps).min(self.omega_max_radps);
        if omega == 0.0 { 0.0 } else { size.copysign(omega) }
    }

    /// `wanted` after one tick, starting from `from`: as near to it as the accelerations allow. Linear and
    /// angular part each take their own way, so that a turn does not wait for the speed.
    #[inline]
    pub fn ramp_to(&self, from: BodyTwist, wanted: BodyTwist) -> BodyTwist {
        let mut next = wanted;
        if self.accel_mps2 > 0.0 {
            let most = self.accel_mps2 * TICK_S;
            let (dx, dy) = (wanted.vx_mps - from.vx_mps, wanted.vy_mps - from.vy_mps);
            let change = libm::hypot(dx, dy);
            if change > most {
                next.vx_mps = from.vx_mps + dx / change * most;
                next.vy_mps = from.vy_mps + dy / change * most;
            }
        }
        if self.accel_radps2 > 0.0 {
            let most = self.accel_radps2 * TICK_S;
            let turn = wanted.omega_radps - from.omega_radps;
            if turn.abs() > most {
                next.omega_radps = from.omega_radps + most.copysign(turn);
            }
        }
        next
    }

    /// `twist` after one tick of decelerating along its own path, both rates within their limits.
    pub fn ramp_down(&self, twist: BodyTwist) -> BodyTwist {
        let share = |rate: f64, value: f64| if value == 0.0 { 1.0 } else { rate * TICK_S / value.abs() };
        let loss = share(self.stop_decel_mps2, twist.speed_mps())
            .min(share(self.stop_decel_radps2, twist.omega_radps));
        if loss >= 1.0 { BodyTwist::ZERO } else { twist.scaled(1.0 - loss) }
    }
}
