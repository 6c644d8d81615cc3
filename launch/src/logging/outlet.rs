//! Text on its way out of launch, written by a thread of its own.
//!
//! A terminal that was stopped (Ctrl-S), a pipe that nobody reads or a disk that hangs costs lines. Launch renews
//! the robot's lease: it never waits for any of them.

use super::head;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, TrySendError, bounded};
use indicatif::{ProgressDrawTarget, TermLike};
use rustix::termios::tcgetwinsize;
use std::io::{self, Write};
use std::mem;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Pieces of text that may wait to be written; what comes then is left out.
const WAITING_MAX: usize = 1024;
/// Longest wait for what is still to be written when launch ends.
const PATIENCE: Duration = Duration::from_secs(2);
/// Pictures of the progress bar a second.
const DRAWN_HZ: u8 = 20;

/// Where text leaves launch.
#[derive(Clone, Debug)]
pub(super) struct Outlet {
    queue: Sender<Piece>,
    left_out: Arc<AtomicU64>,
    /// It was waited for in vain.
    stuck: Arc<AtomicBool>,
}

enum Piece {
    Text(String),
    /// All that came before is written: the sender is dropped.
    End(#[expect(dead_code, reason = "dropping it is the message")] Sender<()>),
}

impl Outlet {
    /// Everything goes to `to`; what cannot be written is lost.
    pub fn new(to: impl Write + Send + 'static) -> io::Result<Self> {
        let (queue, pieces) = bounded(WAITING_MAX);
        let left_out = Arc::new(AtomicU64::new(0));
        let counted = Arc::clone(&left_out);
        std::thread::Builder::new().name("log".to_owned()).spawn(move || write(to, &pieces, &counted))?;
        Ok(Self { queue, left_out, stuck: Arc::default() })
    }

    /// A line; counted if there is no room for it.
    pub fn line(&self, line: &str) {
        if let Err(TrySendError::Full(_)) = self.queue.try_send(Piece::Text(format!("{line}\n"))) {
            self.left_out.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// A progress bar that is drawn here.
    pub fn draw_target(&self) -> ProgressDrawTarget {
        let screen = Screen { outlet: self.clone(), frame: Mutex::default() };
        ProgressDrawTarget::term_like_with_hz(Box::new(screen), DRAWN_HZ)
    }

    /// Waits until everything is written; not for ever, and not twice for one that is stuck.
    pub fn flush(&self) {
        let (done, written) = bounded(0);
        let patience = if self.stuck.load(Ordering::Relaxed) { Duration::ZERO } else { PATIENCE };
        let deadline = Instant::now() + patience;
        let sent = self.queue.send_deadline(Piece::End(done), deadline).is_ok();
        let in_time = sent && written.recv_deadline(deadline) == Err(RecvTimeoutError::Disconnected);
        self.stuck.store(!in_time, Ordering::Relaxed);
    }
}

fn write(mut to: impl Write, pieces: &Receiver<Piece>, left_out: &AtomicU64) {
    for piece in pieces {
        let Piece::Text(text) = piece else { continue };
        // A full disk costs the log, not the drive.
        let _ = to.write_all(text.as_bytes());
        let count = left_out.swap(0, Ordering::Relaxed);
        if count > 0 {
            let _ = writeln!(to, "{} {count} lines left out, nobody took them", head("WARN", "launch"));
        }
    }
}

/// The terminal as a progress bar sees it. A picture goes to the outlet whole; one there is no room for is not
/// shown.
#[derive(Debug)]
struct Screen {
    outlet: Outlet,
    frame: Mutex<String>,
}

impl Screen {
    fn add(&self, text: &str) -> io::Result<()> {
        self.frame.lock().unwrap_or_else(PoisonError::into_inner).push_str(text);
        Ok(())
    }

    /// Moves the cursor by `n`, in the direction of an ECMA-48 control sequence.
    fn go(&self, n: usize, direction: char) -> io::Result<()> {
        if n == 0 { Ok(()) } else { self.add(&format!("\x1b[{n}{direction}")) }
    }
}

impl TermLike for Screen {
    fn width(&self) -> u16 {
        tcgetwinsize(io::stderr()).map(|size| size.ws_col).ok().filter(|width| *width > 0).unwrap_or(80)
    }

    fn height(&self) -> u16 {
        tcgetwinsize(io::stderr()).map(|size| size.ws_row).ok().filter(|height| *height > 0).unwrap_or(24)
    }

    fn move_cursor_up(&self, n: usize) -> io::Result<()> {
        self.go(n, 'A')
    }

    fn move_cursor_down(&self, n: usize) -> io::Result<()> {
        self.go(n, 'B')
    }

    fn move_cursor_right(&self, n: usize) -> io::Result<()> {
        self.go(n, 'C')
    }

    fn move_cursor_left(&self, n: usize) -> io::Result<()> {
        self.go(n, 'D')
    }

    fn write_line(&self, text: &str) -> io::Result<()> {
        self.add(text)?;
        self.add("\n")
    }

    fn write_str(&self, text: &str) -> io::Result<()> {
        self.add(text)
    }

    fn clear_line(&self) -> io::Result<()> {
        self.add("\r\x1b[2K")
    }

    fn flush(&self) -> io::Result<()> {
        let frame = mem::take(&mut *self.frame.lock().unwrap_or_else(PoisonError::into_inner));
        if !frame.is_empty() {
            let lines = frame.matches('\n').count() as u64;
            if let Err(TrySendError::Full(_)) = self.outlet.queue.try_send(Piece::Text(frame)) {
                self.outlet.left_out.fetch_add(lines, Ordering::Relaxed);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crossbeam_channel::unbounded;

    /// Hands on what is written, once it may.
    struct Stopped {
        go_on: Receiver<()>,
        written: Sender<Vec<u8>>,
    }

    impl Write for Stopped {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let _ = self.go_on.recv();
            self.written.send(bytes.to_vec()).unwrap();
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn whoever_speaks_never_waits_and_what_is_lost_is_counted() {
        let ((go_on, stop), (written, output)) = (unbounded(), unbounded());
        let outlet = Outlet::new(Stopped { go_on: stop, written }).unwrap();
        let said = 3 * WAITING_MAX;
        (0..said).for_each(|n| outlet.line(&format!("line {n}")));
        drop(go_on);
        outlet.flush();
        let text: Vec<u8> = output.try_iter().flatten().collect();
        let text = String::from_utf8(text).unwrap();
        let kept = text.lines().filter(|line| line.starts_with("line ")).count();
        assert!((WAITING_MAX..=WAITING_MAX + 1).contains(&kept), "{kept} lines");
        let lost = said - kept;
        assert!(text.contains(&format!("{lost} lines left out")), "not counted: {lost}");
    }

    #[test]
    fn a_bar_is_drawn_in_whole_pictures() {
        let ((go_on, stop), (written, output)) = (unbounded(), unbounded());
        drop(go_on);
        let outlet = Outlet::new(Stopped { go_on: stop, written }).unwrap();
        let bar = indicatif::ProgressBar::with_draw_target(Some(3), outlet.draw_target());
        bar.set_position(1);
        bar.println("above");
        bar.finish_and_clear();
        outlet.flush();
        let text: Vec<u8> = output.try_iter().flatten().collect();
        let text = String::from_utf8(text).unwrap();
        assert!(text.contains("1/3") && text.contains("above"), "{text:?}");
    }
}
