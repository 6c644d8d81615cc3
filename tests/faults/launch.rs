//! Launch as the rig has it: who is in charge, what is started again, the lease.
//!
//! It decides as the manager does and knows as little: it sees a death a little later, the step generator's
//! state when that comes, and both may decide at the same time.

use super::controller::Post;
use super::life::Life;
use super::plan::{Line, Plan, Process};
use super::wire::Link;
use hilare_interfaces::block::Tick;
use hilare_interfaces::layout::WireField;
use hilare_interfaces::messages::{Authority, Mode, Steps};
use hilare_interfaces::wires;

/// Ticks between two authority messages.
pub const LEASE_TICKS: Tick = 20;

/// How launch deals with what dies or stands still.
#[derive(Clone, Copy, Debug)]
pub struct Policy {
    /// Ticks from a death to the moment launch knows.
    pub notice_ticks: Tick,
    /// Ticks from then until the successor is connected; `None`: nothing is started again.
    pub respawn_ticks: Option<Tick>,
    /// Ticks a process may stand still before it is replaced.
    pub liveness_ticks: Tick,
}

impl Policy {
    /// Whether a successor of `life` is due; kills whoever stands still for too long.
    pub fn replaces(&self, life: &mut Life, now: Tick) -> bool {
        let Some(respawn_ticks) = self.respawn_ticks else { return false };
        if life.stopped_for(now).is_some_and(|ticks| ticks >= self.liveness_ticks) {
            life.kill(now);
        }
        life.died().is_some_and(|died| now >= died + self.notice_ticks + respawn_ticks)
    }

    /// Launch has seen it die.
    pub fn knows_dead(&self, life: &Life, now: Tick) -> bool {
        life.died().is_some_and(|died| now >= died + self.notice_ticks)
    }
}

/// The process.
pub struct Launch {
    /// Whether it is there.
    pub life: Life,
    /// The step generator's state.
    pub steps: Link<Steps>,
    policy: Policy,
    authority: Authority,
    newest: Steps,
    next_epoch: u64,
    lease_due: Tick,
    /// Who was in charge when the step generator put the standby there.
    deposed: (u64, u64),
}

impl Launch {
    /// With the first of `posts` in charge and the second, if there is one, as its standby; armed.
    pub fn new(plan: &Plan, seed: u64, policy: Policy, posts: &[Post]) -> Self {
        let pair = |n: usize| posts.get(n).map_or((0, 0), Post::pair);
        let ((source, epoch), (standby_source, standby_epoch)) = (pair(0), pair(1));
        Self {
            life: Life::new(plan, Process::Launch),
            steps: Link::new(&wires::STEPS, Line::StepsToLaunch, plan, seed),
            policy,
            authority: Authority {
                mode: Mode::Armed.code(),
                term: 1,
                source,
                epoch,
                standby_source,
                standby_epoch,
                ..Authority::ZERO
            },
            newest: Steps::ZERO,
            next_epoch: posts.iter().map(|post| post.pair().1).max().unwrap_or(0) + 1,
            lease_due: 0,
            deposed: (0, 0),
        }
    }

    /// What it wants the robot to do.
    pub fn mode(&self) -> Mode {
        Mode::from_code(self.authority.mode).expect("a mode it has set")
    }

    /// The operator wants something; refused where the manager refuses it.
    pub fn want(&mut self, mode: Mode) {
        let refused = matches!(
            (self.mode(), mode),
            (Mode::EStop, Mode::Armed | Mode::Stop) | (Mode::Disarmed, Mode::Stop)
        );
        if !refused {
            self.authority.mode = mode.code();
            self.lease_due = 0;
        }
    }

    /// Launch says so whatever it has said before, as a launch that has forgotten would.
    pub fn insist(&mut self, mode: Mode) {
        self.authority.mode = mode.code();
        self.lease_due = 0;
    }

    /// The step generator has died: whatever comes after it is not to move by itself. An emergency stop
    /// stays one.
    pub fn disarm(&mut self) {
        if self.mode() != Mode::EStop {
            self.want(Mode::Disarmed);
        }
    }

    /// One look at everybody.
    pub fn step(&mut self, now: Tick, posts: &mut [Post], authority: &mut Link<Authority>) {
        while let Some(steps) = self.steps.next(now) {
            self.newest = steps;
        }
        let before = self.authority;
        self.follow_the_generator();
        self.look_after(now, posts);
        self.choose(now, posts);
        if self.authority != before || now >= self.lease_due {
            self.lease_due = now + LEASE_TICKS;
            self.authority.seq += 1;
            authority.send(now, &self.authority);
        }
    }

    /// The step generator may have put the standby in charge; of equal terms its own came first.
    fn follow_the_generator(&mut self) {
        let ours = (self.authority.source, self.authority.epoch);
        let theirs = (self.newest.in_charge, self.newest.epoch);
        if theirs.0 != 0 && self.newest.term >= self.authority.term && theirs != ours {
            self.deposed = ours;
            self.authority.term = self.newest.term;
            (self.authority.source, self.authority.epoch) = theirs;
        }
    }

    /// Replaces what is dead, stands still or is not heard any more.
    fn look_after(&mut self, now: Tick, posts: &mut [Post]) {
        for post in posts {
            if self.policy.respawn_ticks.is_some() && post.pair() == self.deposed {
                post.life.kill(now);
            }
            if self.policy.replaces(&mut post.life, now) {
                post.start(now, self.next_epoch);
                self.next_epoch += 1;
            }
        }
    }

    /// Who is in charge, and who stands by.
    fn choose(&mut self, now: Tick, posts: &[Post]) {
        let able = |post: &&Post| !self.policy.knows_dead(&post.life, now) && post.pair() != self.deposed;
        let pairs: Vec<_> = posts.iter().filter(able).map(Post::pair).collect();
        let in_charge = (self.authority.source, self.authority.epoch);
        let standby = (self.authority.standby_source, self.authority.standby_epoch);
        if !pairs.contains(&in_charge) {
            let next = pairs.iter().find(|pair| **pair == standby).or(pairs.first());
            if let Some(next) = next {
                (self.authority.source, self.authority.epoch) = *next;
                self.authority.term += 1;
            }
        }
        let in_charge = (self.authority.source, self.authority.epoch);
        let other = pairs.iter().find(|pair| **pair != in_charge);
        (self.authority.standby_source, self.authority.standby_epoch) = *other.unwrap_or(&(0, 0));
    }
}
