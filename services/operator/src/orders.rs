//! Orders on their way: who waits for whom, and who for nobody.
//!
//! Each kind has threads of its own, so that a STOP never stands behind a plan, nor behind a launch that is slow to
//! answer one.

use crate::Source;
use crate::message::{Answer, Order, parse};
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::spawn_blocking;
use tokio::time::sleep;

/// Stops on their way at once.
const STOPS: usize = 8;
/// Orders that launch answers at once.
const QUICK: usize = 4;
/// Orders that somebody has to think about.
const SLOW: usize = 4;
/// Questions that are computed here.
const QUESTIONS: usize = 1;
/// Long messages that are read at once.
const READING: usize = 1;
/// Threads all of them need at most.
pub const THREADS: usize = STOPS + QUICK + SLOW + QUESTIONS + READING;

/// Messages longer than that are not read beside the others.
const LONG: usize = 16 << 10;
/// Time between two looks whether somebody still waits for an answer.
const LOOK: Duration = Duration::from_millis(20);
/// A newer one came.
const OVERTAKEN: &str = "overtaken by a newer one";

/// Passes orders on to those who carry them out.
pub struct Desk {
    source: Arc<dyn Source>,
    stops: Arc<Semaphore>,
    quick: Arc<Semaphore>,
    slow: Arc<Semaphore>,
    questions: Arc<Semaphore>,
    reading: Arc<Semaphore>,
}

impl Desk {
    pub fn new(source: Arc<dyn Source>) -> Self {
        let room = |most| Arc::new(Semaphore::new(most));
        Self {
            source,
            stops: room(STOPS),
            quick: room(QUICK),
            slow: room(SLOW),
            questions: room(QUESTIONS),
            reading: room(READING),
        }
    }

    /// Carries an order out, whether or not somebody waits for the answer.
    pub async fn carry_out(&self, order: Order, cancelled: Arc<AtomicBool>) -> Answer {
        let room = match &order {
            Order::Stop | Order::Estop => &self.stops,
            Order::Arm | Order::Reset => &self.quick,
            Order::Predict(_) | Order::Roadmap => &self.questions,
            Order::Swap(_) | Order::Follow(_) | Order::Goal(_) => &self.slow,
        };
        let mut turn = pin!(Arc::clone(room).acquire_owned());
        let permit = loop {
            tokio::select! {
                biased;
                permit = &mut turn => break permit,
                () = sleep(LOOK) => {}
            }
            if cancelled.load(Ordering::Relaxed) {
                return Answer::refused(OVERTAKEN);
            }
        };
        if cancelled.load(Ordering::Relaxed) {
            return Answer::refused(OVERTAKEN);
        }
        let source = Arc::clone(&self.source);
        blocking(permit.ok(), move || {
            let answer = source.order(&order, &cancelled);
            if cancelled.load(Ordering::Relaxed) { Answer::refused(OVERTAKEN) } else { answer }
        })
        .await
        .unwrap_or_else(|| Answer::refused("the page failed over it; its log says why"))
    }

    /// What a message asks for.
    pub async fn read(
        &self,
        text: impl AsRef<str> + Send + 'static,
    ) -> Result<(u64, Order), (Option<u64>, String)> {
        if text.as_ref().len() <= LONG {
            return parse(text.as_ref());
        }
        let permit = Arc::clone(&self.reading).acquire_owned().await;
        let read = blocking(permit.ok(), move || parse(text.as_ref())).await;
        read.unwrap_or_else(|| Err((None, "it could not be read".to_owned())))
    }
}

/// Runs where it may block; the permit is held until it is done, whoever has gone meanwhile.
async fn blocking<T: Send + 'static>(
    permit: Option<OwnedSemaphorePermit>,
    work: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    let held = move || {
        let done = work();
        drop(permit);
        done
    };
    spawn_blocking(held).await.ok()
}

/// How much of something there may be in a second.
pub struct Rate {
    per_s: f64,
    most: f64,
    left: f64,
    at: Instant,
}

impl Rate {
    /// `per_s` a second, and `most` at once after a rest.
    pub fn new(per_s: f64, most: f64) -> Self {
        Self { per_s, most, left: most, at: Instant::now() }
    }

    fn refill(&mut self, now: Instant) {
        self.left = self.most.min(self.left + now.duration_since(self.at).as_secs_f64() * self.per_s);
        self.at = now;
    }

    /// True if there is room for one more.
    pub fn take(&mut self, now: Instant) -> bool {
        self.refill(now);
        let room = self.left >= 1.0;
        if room {
            self.left -= 1.0;
        }
        room
    }

    /// Takes so much in any case; how long whoever sends it has to wait for that.
    pub fn owe(&mut self, amount: f64, now: Instant) -> Duration {
        self.refill(now);
        self.left -= amount;
        Duration::from_secs_f64((-self.left).max(0.0) / self.per_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn so_many_a_second_and_no_more() {
        let mut rate = Rate::new(50.0, 50.0);
        let start = rate.at;
        assert_eq!((0..1000).filter(|_| rate.take(start)).count(), 50);
        assert_eq!((0..1000).filter(|_| rate.take(start + Duration::from_millis(100))).count(), 5);
        assert_eq!((0..1000).filter(|_| rate.take(start + Duration::from_secs(100))).count(), 50);
        let mut bytes = Rate::new(1000.0, 4000.0);
        assert_eq!(bytes.owe(4000.0, bytes.at), Duration::ZERO);
        assert_eq!(bytes.owe(500.0, bytes.at), Duration::from_millis(500));
    }
}
