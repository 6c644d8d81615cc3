//! A load on the machine, for tests of what must not feel it.

use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Work on every processor that never rests, until it is dropped.
pub struct Load {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Load {
    /// Begins to work.
    pub fn start() -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let work = |stops: Arc<AtomicBool>| {
            move || {
                let mut words = vec![1u64; 1 << 20];
                while !stops.load(Ordering::Relaxed) {
                    words.iter_mut().for_each(|word| *word = word.rotate_left(7) ^ 5);
                    black_box(&mut words);
                }
            }
        };
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = (0..cores).map(|_| std::thread::spawn(work(Arc::clone(&stop)))).collect();
        Self { stop, threads }
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.threads.drain(..).for_each(|thread| drop(thread.join()));
    }
}
