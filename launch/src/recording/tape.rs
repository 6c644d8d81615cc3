//! The end of a recording that messages are given to: it copies them and never waits for the disk.
//!
//! Messages are collected until the end of a look at the wires, then handed to the writer's thread over a queue that is
//! bounded in bytes. If that is full, they are given up, counted by wire, and it is said at once. In virtual time, where
//! nobody waits in real time, it waits instead.

use super::audit::{Audit, Report};
use super::dating::Dating;
use super::info::RunInfo;
use super::settings::Settings;
use super::standings::Standings;
use super::wires::{Heard, RECORDED};
use super::writer::{self, Written};
use super::{RecordingError, STANDINGS_ATTACHMENT, cdr};
use crate::shell::worker::system_file;
use crossbeam_channel::{Receiver, Sender, TrySendError, bounded};
use hilare_interfaces::messages::{Journal, JournalKind};
use std::collections::BTreeSet;
use std::mem::take;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use tracing::warn;

/// Batches in the queue, whatever their size.
const MAX_BATCHES: usize = 8192;
/// Emptied batches that are kept for use.
const SPARE_BATCHES: usize = 64;
/// Emptied batches larger than this are let go.
const SPARE_BYTES: usize = 256 << 10;
/// Bytes after which a batch is handed over in virtual time.
const FULL_BATCH: usize = 128 << 10;
/// Time between two words about messages given up.
const WARN_EVERY: Duration = Duration::from_secs(1);

/// Messages on their way to the writer's thread.
#[derive(Debug, Default)]
pub(super) struct Batch {
    /// CDR, one after the other.
    pub(super) bytes: Vec<u8>,
    pub(super) items: Vec<Item>,
    /// Files, by their names.
    pub(super) files: Vec<(String, String)>,
}

/// One of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    /// Place of its wire in [`RECORDED`].
    pub(super) place: usize,
    pub(super) sequence: u32,
    pub(super) time_ns: u64,
    pub(super) start: usize,
    pub(super) end: usize,
}

impl Batch {
    pub(super) fn size(&self) -> usize {
        let files: usize = self.files.iter().map(|(_, text)| text.len()).sum();
        self.bytes.len() + self.items.len() * size_of::<Item>() + files
    }

    pub(super) fn clear(&mut self) {
        self.bytes.clear();
        self.items.clear();
        self.files.clear();
    }
}

/// A recording under way.
pub struct Tape {
    settings: Settings,
    audit: Audit,
    sequences: [u32; RECORDED.len()],
    dropped: [u64; RECORDED.len()],
    dating: Dating,
    batch: Batch,
    /// Where the robot's numbered system files are, and which of them are kept already.
    systems: Option<(PathBuf, BTreeSet<u64>)>,
    queue: Option<Sender<Batch>>,
    emptied: Receiver<Batch>,
    waiting: Arc<AtomicUsize>,
    failed: Arc<AtomicBool>,
    thread: JoinHandle<Written>,
    done: Receiver<()>,
    last_warning: Option<Instant>,
    dropped_since: u64,
}

impl Tape {
    /// Begins a recording: its first file is there when this comes back.
    pub fn begin(settings: Settings, info: RunInfo, system: String) -> Result<Self, RecordingError> {
        Self::begin_with(settings, info, system, || {})
    }

    /// The same; `hindrance` is called before each batch is written.
    pub(super) fn begin_with(
        settings: Settings,
        info: RunInfo,
        system: String,
        hindrance: impl FnMut() + Send + 'static,
    ) -> Result<Self, RecordingError> {
        let period_ticks = info.period_ticks;
        let failed = Arc::new(AtomicBool::new(false));
        let writer = writer::Writer::begin(settings.clone(), info, system, Arc::clone(&failed))?;
        let (queue, batches) = bounded(MAX_BATCHES);
        let (give_back, emptied) = bounded(SPARE_BATCHES);
        let (finished, done) = bounded(1);
        let waiting = Arc::new(AtomicUsize::new(0));
        let freed = Arc::clone(&waiting);
        let thread = thread::Builder::new()
            .name("recording".into())
            .spawn(move || {
                let written = writer.run(&batches, hindrance, |mut batch: Batch| {
                    freed.fetch_sub(batch.size(), Ordering::Release);
                    batch.clear();
                    if batch.bytes.capacity() <= SPARE_BYTES {
                        let _ = give_back.try_send(batch);
                    }
                });
                let _ = finished.send(());
                written
            })
            .map_err(|error| RecordingError::new(&settings.path, error))?;
        Ok(Self {
            audit: Audit::new(period_ticks),
            settings,
            sequences: [0; RECORDED.len()],
            dropped: [0; RECORDED.len()],
            dating: Dating::default(),
            batch: Batch::default(),
            systems: None,
            queue: Some(queue),
            emptied,
            waiting,
            failed,
            thread,
            done,
            last_warning: None,
            dropped_since: 0,
        })
    }

    /// Keeps each numbered system file of a robot's runtime directory that its journal names.
    pub fn keep_systems_of(&mut self, runtime_dir: &Path) {
        self.systems = Some((runtime_dir.to_owned(), BTreeSet::new()));
    }

    /// Takes a message.
    pub fn hear(&mut self, heard: Heard<'_>) {
        if let Heard::Journal(entry) = heard {
            self.keep_named(entry);
        }
        self.audit.hear(&heard);
        let place = heard.place();
        let time_ns = self.dating.of(heard.tick());
        let start = self.batch.bytes.len();
        cdr::write_message(&mut self.batch.bytes, heard.bytes(), heard.elements());
        let end = self.batch.bytes.len();
        // Also of one that is given up: whoever reads sees the gap.
        let sequence = self.sequences[place];
        self.sequences[place] = sequence.wrapping_add(1);
        self.batch.items.push(Item { place, sequence, time_ns, start, end });
        if self.settings.patient && self.batch.bytes.len() >= FULL_BATCH {
            self.hand_over();
        }
    }

    /// Keeps the system file that an entry of the journal names.
    fn keep_named(&mut self, entry: &Journal) {
        match JournalKind::from_code(entry.kind) {
            Some(JournalKind::Began) => self.keep_system(entry.words[2]),
            Some(JournalKind::Param) => self.keep_system(entry.words[1]),
            _ => {}
        }
    }

    /// Keeps where each box stands, and the system files that are in force in them.
    pub fn keep_standings(&mut self, standings: &Standings) {
        standings.stands.iter().for_each(|stand| self.keep_system(stand.system));
        self.batch.files.push((STANDINGS_ATTACHMENT.to_owned(), standings.to_text()));
    }

    fn keep_system(&mut self, number: u64) {
        let Some((dir, kept)) = &mut self.systems else { return };
        if kept.contains(&number) {
            return;
        }
        // Written whole before anybody is told its number.
        let file = dir.join(system_file(number));
        match std::fs::read_to_string(&file) {
            Ok(text) => self.batch.files.push((system_file(number), text)),
            Err(error) => warn!("{}: {error}: a replay will not know this system", file.display()),
        }
        kept.insert(number);
    }

    /// Hands what was heard to the writer's thread.
    pub fn hand_over(&mut self) {
        if self.batch.items.is_empty() && self.batch.files.is_empty() {
            return;
        }
        let size = self.batch.size();
        let has_room = |waiting: usize| waiting == 0 || waiting + size <= self.settings.queue_bytes;
        while self.settings.patient && !has_room(self.waiting()) && !self.thread.is_finished() {
            thread::sleep(Duration::from_micros(200));
        }
        let batch = take(&mut self.batch);
        let given_up = if has_room(self.waiting()) {
            self.waiting.fetch_add(size, Ordering::Release);
            self.send(batch).err().inspect(|_| {
                self.waiting.fetch_sub(size, Ordering::Release);
            })
        } else {
            Some(batch)
        };
        self.batch = match given_up {
            Some(mut batch) => {
                self.give_up(&batch);
                batch.clear();
                batch
            }
            None => self.emptied.try_recv().unwrap_or_default(),
        };
    }

    fn send(&self, batch: Batch) -> Result<(), Batch> {
        let Some(queue) = &self.queue else { return Err(batch) };
        if self.settings.patient {
            return queue.send(batch).map_err(|error| error.0);
        }
        queue.try_send(batch).map_err(|error| match error {
            TrySendError::Full(batch) | TrySendError::Disconnected(batch) => batch,
        })
    }

    fn give_up(&mut self, batch: &Batch) {
        for item in &batch.items {
            self.dropped[item.place] += 1;
        }
        self.dropped_since += batch.items.len() as u64;
        if self.last_warning.is_none_or(|last| last.elapsed() >= WARN_EVERY) {
            self.last_warning = Some(Instant::now());
            let path = self.settings.path.display();
            let mb = self.settings.queue_bytes / 1_000_000;
            warn!(
                "{path}: the disk is too slow, {} messages are not recorded; {mb} MB of them wait (recording.queue_mb)",
                self.dropped_since
            );
            self.dropped_since = 0;
        }
    }

    /// True once the disk has refused: nothing more will be written.
    pub fn has_failed(&self) -> bool {
        self.failed.load(Ordering::Acquire)
    }

    /// Bytes that wait for the disk.
    pub fn waiting(&self) -> usize {
        self.waiting.load(Ordering::Acquire)
    }

    /// Ends the recording; what is not written after `patience` is given up. What it came to.
    pub fn finish(mut self, patience: Option<Duration>) -> Report {
        self.hand_over();
        self.queue = None;
        let in_time = match patience {
            Some(patience) => self.done.recv_timeout(patience).is_ok(),
            None => self.done.recv().is_ok(),
        };
        let mut report = Report { wires: self.audit.wires(), ..Report::default() };
        let written = if in_time { self.thread.join().ok() } else { None };
        let lost = written.is_none().then(|| {
            let seconds = patience.unwrap_or_default().as_secs();
            format!("{}: the disk did not take the rest within {seconds} s", self.settings.path.display())
        });
        let written = written.unwrap_or_default();
        for (place, wire) in report.wires.iter_mut().enumerate() {
            wire.dropped = self.dropped[place];
            wire.refused = written.refused[place];
            wire.messages = wire.messages.saturating_sub(wire.dropped + wire.refused);
        }
        report.files = written.files.iter().map(|file| name_of(file)).collect();
        report.bytes = written.bytes;
        report.sum_up(lost.or(written.trouble).as_deref());
        report
    }
}

fn name_of(file: &Path) -> String {
    file.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
