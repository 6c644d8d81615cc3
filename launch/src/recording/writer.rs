//! The thread that writes: batches in, files out.

use super::RecordingError;
use super::info::{RunInfo, part_file};
use super::part::Part;
use super::ros::{self, Views};
use super::settings::Settings;
use super::tape::{Batch, Item};
use super::wires::{Entry, RECORDED};
use crate::shell::worker::system_number;
use crossbeam_channel::{Receiver, RecvTimeoutError};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tracing::warn;

/// Time between two looks at how long a chunk has been open.
const LOOK: Duration = Duration::from_millis(100);

/// What was written.
#[derive(Debug, Default)]
pub(super) struct Written {
    pub(super) files: Vec<PathBuf>,
    pub(super) bytes: u64,
    /// Messages of each wire that came after the files had failed.
    pub(super) refused: [u64; RECORDED.len()],
    /// What went wrong with the files.
    pub(super) trouble: Option<String>,
}

/// Writes part after part.
pub(super) struct Writer {
    settings: Settings,
    info: RunInfo,
    system: String,
    /// Numbered ones by name, which every further part has, too.
    systems: Vec<(String, String)>,
    // None once the disk has refused.
    part: Option<Part>,
    views: Views,
    view_sequences: Vec<u32>,
    written: Written,
    /// The disk has refused; whoever records for nothing else need not go on.
    failed: Arc<AtomicBool>,
}

impl Writer {
    /// Begins the first part, behind those that are there.
    pub(super) fn begin(
        settings: Settings,
        info: RunInfo,
        system: String,
        failed: Arc<AtomicBool>,
    ) -> Result<Self, RecordingError> {
        let views = Views::new(info.period_ticks, settings.body.clone());
        let mut writer = Self {
            settings,
            info,
            system,
            systems: Vec::new(),
            part: None,
            views,
            view_sequences: vec![0; ros::channels().len()],
            written: Written::default(),
            failed,
        };
        writer.next_part()?;
        Ok(writer)
    }

    fn next_part(&mut self) -> Result<(), RecordingError> {
        let path = loop {
            let path = part_file(&self.settings.path, self.info.part);
            if std::fs::symlink_metadata(&path).is_err() {
                break path;
            }
            self.info.part += 1;
        };
        let views = ros::channels();
        let mut part = Part::create(&path, &self.settings, &self.info, &self.system, &views)?;
        self.systems.iter().try_for_each(|(name, text)| part.write_file(name, text))?;
        self.part = Some(part);
        self.views.begin_again();
        self.info.part += 1;
        self.written.files.push(path);
        Ok(())
    }

    /// Writes until nobody sends any more.
    pub(super) fn run(
        mut self,
        batches: &Receiver<Batch>,
        mut hindrance: impl FnMut(),
        mut done: impl FnMut(Batch),
    ) -> Written {
        loop {
            match batches.recv_timeout(LOOK) {
                Ok(mut batch) => {
                    hindrance();
                    self.write(&mut batch);
                    done(batch);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            let tended = self.part.as_mut().map_or(Ok(()), Part::tend);
            if let Err(error) = tended {
                self.fail(&error);
            }
        }
        self.end_part();
        self.written
    }

    fn write(&mut self, batch: &mut Batch) {
        // Wires are read one after the other; in the file, messages of a tick stand together.
        batch.items.sort_by_key(|item| item.time_ns);
        for (name, text) in batch.files.drain(..) {
            let written = self.part.as_mut().map_or(Ok(()), |part| part.write_file(&name, &text));
            if system_number(&name).is_some() {
                self.systems.push((name, text));
            }
            if let Err(error) = written {
                self.fail(&error);
            }
        }
        for index in 0..batch.items.len() {
            let item = batch.items[index];
            if self.is_full(item.time_ns) {
                self.end_part();
                if self.written.trouble.is_none()
                    && let Err(error) = self.next_part()
                {
                    self.fail(&error);
                }
            }
            let cdr = &batch.bytes[item.start..item.end];
            let Self { part, views, view_sequences, .. } = self;
            let Some(part) = part else {
                self.written.refused[item.place] += 1;
                continue;
            };
            let written = part.write(item.place, item.sequence, item.time_ns, cdr);
            if written.is_err() {
                self.written.refused[item.place] += 1;
            }
            if let Err(error) = written.and_then(|()| write_views(part, views, view_sequences, &item, cdr)) {
                self.fail(&error);
            }
        }
    }

    fn is_full(&self, time_ns: u64) -> bool {
        let Settings { rotate_bytes, rotate_ns, .. } = self.settings;
        self.part.as_ref().is_some_and(|part| {
            let age_ns = part.first_time_ns().map_or(0, |first| time_ns.saturating_sub(first));
            (rotate_bytes > 0 && part.length() >= rotate_bytes) || (rotate_ns > 0 && age_ns >= rotate_ns)
        })
    }

    fn end_part(&mut self) {
        let Some(part) = self.part.take() else { return };
        let (in_place, path) = (part.is_in_place(), part.path().to_owned());
        let trouble = match part.finish() {
            Ok(bytes) => {
                self.written.bytes += bytes;
                (!in_place).then(|| RecordingError::new(&path, "somebody has taken the file away"))
            }
            Err(failed) => {
                let (error, lost) = *failed;
                self.written.refused.iter_mut().zip(lost).for_each(|(refused, lost)| *refused += lost);
                self.written.bytes += std::fs::metadata(&path).map_or(0, |file| file.len());
                Some(error)
            }
        };
        if let Some(trouble) = trouble {
            self.tell(&trouble);
        }
    }

    /// The disk refuses: what is written stays, the run goes on.
    fn fail(&mut self, error: &RecordingError) {
        self.tell(error);
        self.end_part();
    }

    fn tell(&mut self, error: &RecordingError) {
        if self.written.trouble.is_none() {
            warn!("{error}: recording ends here, the run goes on");
            self.failed.store(true, Ordering::Release);
            self.written.trouble = Some(error.to_string());
        }
    }
}

/// What other tools are told of a message.
fn write_views(
    part: &mut Part,
    views: &mut Views,
    sequences: &mut [u32],
    item: &Item,
    cdr: &[u8],
) -> Result<(), RecordingError> {
    let mut written = Ok(());
    let Some(entry) = Entry::decode(item.place, cdr) else { return written };
    views.of(&entry, item.time_ns, |view, time_ns, cdr| {
        let sequence = sequences[view];
        sequences[view] = sequence.wrapping_add(1);
        if written.is_ok() {
            written = part.write_view(view, sequence, time_ns, cdr);
        }
    });
    written
}
