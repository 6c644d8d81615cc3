//! The terminal of `hilare top`: taken over, given back whatever happens.

use crossterm::cursor::{Hide, MoveTo, Show};
use crossterm::queue;
use crossterm::style::{Attribute, SetAttribute};
use crossterm::terminal::{
    BeginSynchronizedUpdate, Clear, ClearType, DisableLineWrap, EnableLineWrap, EndSynchronizedUpdate,
    EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode, size,
};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io::{self, IsTerminal, Read, Write};
use std::sync::Once;
use std::thread::sleep;
use std::time::Duration;

/// Columns and rows where a terminal does not say.
const DEFAULT_SIZE: (u16, u16) = (80, 24);
/// Ctrl-C, where the terminal does not make a signal of it.
const CTRL_C: u8 = 3;

/// A terminal that was taken over.
pub struct Terminal {
    /// Standard input is a terminal too, and open: its keys come at once and unseen.
    keys: bool,
}

impl Terminal {
    /// Takes over the terminal on standard output; `None` if there is none that can be drawn on.
    pub fn take_over() -> io::Result<Option<Self>> {
        static RESTORED_ON_PANIC: Once = Once::new();
        let dumb = std::env::var_os("TERM").is_none_or(|term| term.is_empty() || term == "dumb");
        if !io::stdout().is_terminal() || dumb {
            return Ok(None);
        }
        RESTORED_ON_PANIC.call_once(|| {
            let report = std::panic::take_hook();
            std::panic::set_hook(Box::new(move |panic| {
                // First: on the screen that is left, nobody would read it.
                give_back();
                report(panic);
            }));
        });
        let taken = Self { keys: io::stdin().is_terminal() };
        if taken.keys {
            enable_raw_mode()?;
        }
        let mut out = io::stdout().lock();
        queue!(out, EnterAlternateScreen, Hide, DisableLineWrap)?;
        out.flush()?;
        Ok(Some(taken))
    }

    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        let (columns, rows) = size().ok().filter(|size| size.0 > 0 && size.1 > 0).unwrap_or(DEFAULT_SIZE);
        (columns.into(), rows.into())
    }

    /// Puts lines on it, in one write.
    pub fn draw(&self, lines: &[String]) -> io::Result<()> {
        let mut frame = Vec::new();
        queue!(frame, BeginSynchronizedUpdate)?;
        for (row, line) in lines.iter().enumerate() {
            queue!(frame, MoveTo(0, row.try_into().unwrap_or(u16::MAX)))?;
            frame.extend_from_slice(line.as_bytes());
            queue!(frame, SetAttribute(Attribute::Reset), Clear(ClearType::UntilNewLine))?;
        }
        if self.size().1 > lines.len() {
            queue!(frame, MoveTo(0, lines.len() as u16), Clear(ClearType::FromCursorDown))?;
        }
        queue!(frame, EndSynchronizedUpdate)?;
        let mut out = io::stdout().lock();
        out.write_all(&frame)?;
        out.flush()
    }

    /// Waits for a key or until the time is over. True for one that means the end.
    pub fn wait_for_the_end(&mut self, patience: Duration) -> bool {
        if !self.keys {
            sleep(patience);
            return false;
        }
        let stdin = io::stdin();
        let mut fds = [PollFd::new(&stdin, PollFlags::IN)];
        let patience = Timespec::try_from(patience).ok();
        if !matches!(poll(&mut fds, patience.as_ref()), Ok(1..)) {
            // Over, or interrupted by a signal, which is looked at elsewhere.
            return false;
        }
        let mut bytes = [0; 64];
        match stdin.lock().read(&mut bytes) {
            // Whoever closed it presses no key any more.
            Ok(0) | Err(_) => {
                self.keys = false;
                false
            }
            Ok(count) => bytes[..count].iter().any(|byte| [b'q', b'Q', CTRL_C].contains(byte)),
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        give_back();
    }
}

/// As it was before; once too often does no harm. Whoever sat there may be gone.
fn give_back() {
    let _ = disable_raw_mode();
    let mut out = io::stdout();
    let _ = queue!(out, SetAttribute(Attribute::Reset), EnableLineWrap, Show, LeaveAlternateScreen);
    let _ = out.flush();
}
