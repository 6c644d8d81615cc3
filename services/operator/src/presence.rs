//! Which pages are there, and what happens when the last that drove is gone.

use crate::Source;
use crate::message::Order;
use crate::orders::Desk;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::Notify;

/// Pages at once.
pub const MAX_PAGES: usize = 32;
/// Time in which a page that is lost may come back: it may be loaded anew.
const BACK_WITHIN: Duration = Duration::from_secs(2);
/// Time between two looks whether one is.
const LOOK: Duration = Duration::from_millis(200);

struct Page {
    id: u64,
    /// It has told the robot to do something.
    commanded: bool,
    end: Arc<Notify>,
}

#[derive(Default)]
struct Pages {
    pages: Vec<Page>,
    next: u64,
    /// Since when none is there of those that commanded.
    lost: Option<Instant>,
}

/// The pages there are, the oldest first.
#[derive(Default)]
pub struct Presence(Mutex<Pages>);

/// A page's stay; over when it is dropped.
pub struct Visit {
    presence: Arc<Presence>,
    id: u64,
    /// Told when it has to make room.
    pub end: Arc<Notify>,
}

impl Presence {
    fn pages(&self) -> MutexGuard<'_, Pages> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// One more page can come.
    pub fn has_room(&self) -> bool {
        let pages = self.pages();
        pages.pages.len() < MAX_PAGES || pages.pages.iter().any(|page| !page.commanded)
    }

    /// A page comes. Where there are too many the oldest goes that has never commanded; `None` if there is none.
    pub fn enter(self: &Arc<Self>) -> Option<Visit> {
        let mut pages = self.pages();
        if pages.pages.len() >= MAX_PAGES {
            let oldest = pages.pages.iter().position(|page| !page.commanded)?;
            pages.pages.remove(oldest).end.notify_one();
        }
        let (id, end) = (pages.next, Arc::new(Notify::new()));
        pages.next += 1;
        // Whoever comes now has the robot in view, as the one had that is lost.
        let commanded = pages.lost.take().is_some();
        pages.pages.push(Page { id, commanded, end: Arc::clone(&end) });
        drop(pages);
        Some(Visit { presence: Arc::clone(self), id, end })
    }

    /// True once after the last page that commanded has been lost for long enough.
    fn is_lost(&self, now: Instant) -> bool {
        let mut pages = self.pages();
        let lost = pages.lost.is_some_and(|since| now.duration_since(since) >= BACK_WITHIN);
        if lost {
            pages.lost = None;
        }
        lost
    }

    /// Stops the robot whenever the last page that commanded is lost while it is armed.
    pub async fn stop_when_lost(self: Arc<Self>, source: Arc<dyn Source>, desk: Arc<Desk>) {
        loop {
            tokio::time::sleep(LOOK).await;
            if self.is_lost(Instant::now()) && source.live().is_armed() {
                desk.carry_out(Order::Stop, Arc::new(AtomicBool::new(false))).await;
            }
        }
    }
}

impl Visit {
    /// The page has told the robot to do something.
    pub fn commands(&self) {
        let mut pages = self.presence.pages();
        pages.pages.iter_mut().filter(|page| page.id == self.id).for_each(|page| page.commanded = true);
        pages.lost = None;
    }
}

impl Drop for Visit {
    fn drop(&mut self) {
        let mut pages = self.presence.pages();
        let Some(place) = pages.pages.iter().position(|page| page.id == self.id) else { return };
        let gone = pages.pages.remove(place);
        if gone.commanded && !pages.pages.iter().any(|page| page.commanded) {
            pages.lost = Some(Instant::now());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn later() -> Instant {
        Instant::now() + BACK_WITHIN
    }

    #[test]
    fn a_page_that_commanded_is_missed_one_that_only_looked_is_not() {
        let presence = Arc::new(Presence::default());
        let (looks, commands) = (presence.enter().expect("room"), presence.enter().expect("room"));
        drop(looks);
        assert!(!presence.is_lost(later()));
        commands.commands();
        let another = presence.enter().expect("room");
        another.commands();
        drop(commands);
        assert!(!presence.is_lost(later()), "there is another");
        drop(another);
        assert!(!presence.is_lost(Instant::now()), "it may come back");
        assert!(presence.is_lost(later()));
        assert!(!presence.is_lost(later()), "once");
    }

    #[test]
    fn a_page_that_is_loaded_anew_is_not_missed_until_it_goes_for_good() {
        let presence = Arc::new(Presence::default());
        let page = presence.enter().expect("room");
        page.commands();
        drop(page);
        let again = presence.enter().expect("room");
        assert!(!presence.is_lost(later()));
        drop(again);
        assert!(presence.is_lost(later()));
    }

    #[test]
    fn a_crowd_keeps_nobody_out_who_drives() {
        let presence = Arc::new(Presence::default());
        let driver = presence.enter().expect("room");
        driver.commands();
        let crowd: Vec<_> = (0..3 * MAX_PAGES).map(|_| presence.enter().expect("room")).collect();
        assert_eq!(presence.pages().pages.len(), MAX_PAGES);
        assert!(presence.pages().pages.iter().any(|page| page.id == driver.id));
        crowd.iter().for_each(Visit::commands);
        assert!(presence.enter().is_none() && !presence.has_room(), "all of them drive");
        drop(crowd);
        assert!(presence.has_room());
        assert!(presence.enter().is_some());
    }
}
