//! One file of a recording: written chunk by chunk, each whole before the next begins, so that what is written is
//! readable however it ends.
//!
//! Room for the end of the file (the index) is reserved ahead of every chunk. So a full disk is known before anything
//! is lost, and the file is ended as any other.

use super::info::RunInfo;
use super::settings::Settings;
use super::wires::RECORDED;
use super::{METADATA, RecordingError, SYSTEM_ATTACHMENT, cdr, schemas};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, McapError, WriteOptions};
use rustix::fs::{FallocateFlags, fallocate};
use rustix::io::Errno;
use rustix::process::{Resource, getrlimit};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, Permissions};
use std::io::{self, Seek, SeekFrom, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// A chunk is closed after so long: all but that survives whatever ends the process.
const CHUNK_TIME: Duration = Duration::from_millis(900);
/// Asked of the file system at once, if it has that much.
const ROOM: u64 = 1 << 20;
/// Bytes of the index a chunk and a channel have in it, at most.
const INDEX_OF_CHUNK: u64 = 128;
const INDEX_OF_CHANNEL: u64 = 16;
/// What a record says beside the message.
const RECORD_HEADER: u64 = 31;

/// A file under way.
pub struct Part {
    path: PathBuf,
    file: Arc<Shared>,
    // None once it is over.
    writer: Option<mcap::Writer<Sink>>,
    channels: Vec<u16>,
    views: Vec<u16>,
    chunk_bytes: u64,
    in_chunk: u64,
    chunk_since: Option<Instant>,
    chunks: u64,
    /// Bytes of schemas and channels, which are told again at the end.
    told: u64,
    /// Length of the file when the last chunk was whole.
    whole: u64,
    first_time: Option<u64>,
    /// Messages of each wire since then.
    open: [u64; RECORDED.len()],
}

/// A channel, as files and viewers know it: CDR, told in [`schemas::LANGUAGE`].
pub struct View {
    /// Its topic.
    pub topic: String,
    /// Its ROS type, `nav_msgs/msg/Odometry`.
    pub type_name: String,
    /// The definition of that.
    pub definition: String,
}

/// A file in the recording.
fn attachment(name: String, text: &str) -> Attachment<'_> {
    let data = Cow::Borrowed(text.as_bytes());
    let kind = if name.ends_with(".toml") { "toml" } else { "json" };
    Attachment { log_time: 0, create_time: 0, name, media_type: format!("application/{kind}"), data }
}

impl Part {
    /// Begins a file that must not be there yet.
    pub fn create(
        path: &Path,
        settings: &Settings,
        info: &RunInfo,
        system: &str,
        views: &[View],
    ) -> Result<Self, RecordingError> {
        let failed = |error: &dyn std::fmt::Display| RecordingError::new(path, error);
        let file = OpenOptions::new().write(true).create_new(true).open(path).map_err(|e| failed(&e))?;
        if let Some(mode) = settings.mode {
            file.set_permissions(Permissions::from_mode(mode)).map_err(|e| failed(&e))?;
        }
        let options = WriteOptions::new()
            .compression(Some(Compression::Lz4))
            .profile("ros2")
            .library(format!("hilare {}", env!("CARGO_PKG_VERSION")))
            .chunk_size(None)
            .disable_seeking(true);
        let begun = |error: McapError| failed(&plain(&error));
        let file = Arc::new(Shared { file, length: AtomicU64::new(0), room: AtomicU64::new(0) });
        let writer = options.create(Sink::new(&file)).map_err(begun)?;
        let mut part = Self {
            path: path.to_owned(),
            file,
            writer: Some(writer),
            channels: Vec::new(),
            views: Vec::new(),
            chunk_bytes: settings.chunk_bytes,
            in_chunk: 0,
            chunk_since: None,
            chunks: 0,
            told: 0,
            whole: 0,
            first_time: None,
            open: [0; RECORDED.len()],
        };
        let begun = part.begin(info, system, views).and_then(|()| part.make_room(0));
        match begun {
            Ok(()) => Ok(part),
            Err(error) => {
                let _ = part.abandon();
                let _ = std::fs::remove_file(path);
                Err(failed(&error))
            }
        }
    }

    fn begin(&mut self, info: &RunInfo, system: &str, views: &[View]) -> Result<(), String> {
        let mut told = system.len() as u64;
        let writer = self.writer.as_mut().ok_or("over")?;
        let (mut channels, mut view_channels) = (Vec::new(), Vec::new());
        let mut begin = || -> Result<(), McapError> {
            writer.write_metadata(&Metadata { name: METADATA.to_owned(), metadata: info.to_metadata() })?;
            writer.attach(&attachment(SYSTEM_ATTACHMENT.to_owned(), system))?;
            // Whoever reads a file without a message knows at least what it was to be.
            writer.flush()?;
            let mut tell = |view: &View, said: &[(&str, String)]| {
                told += view.type_name.len() as u64 + view.definition.len() as u64 + 128;
                let schema =
                    writer.add_schema(&view.type_name, schemas::LANGUAGE, view.definition.as_bytes())?;
                writer.add_channel(schema, &view.topic, cdr::ENCODING, &metadata(said))
            };
            for recorded in RECORDED {
                let said = [("message", recorded.message()), ("layout", recorded.layout())];
                channels.push(tell(&schemas::view(&recorded), &said)?);
            }
            for view in views {
                view_channels.push(tell(view, &[])?);
            }
            Ok(())
        };
        begin().map_err(|error| plain(&error))?;
        (self.channels, self.views, self.told) = (channels, view_channels, told);
        self.in_chunk = told;
        self.whole = self.length();
        Ok(())
    }

    /// Writes a file.
    pub fn write_file(&mut self, name: &str, text: &str) -> Result<(), RecordingError> {
        let failed = |path: &Path, why: String| RecordingError::new(path, why);
        if self.in_chunk > 0 {
            self.end_chunk()?;
        }
        self.told += RECORD_HEADER + text.len() as u64;
        self.make_room(self.told).map_err(|why| failed(&self.path, why))?;
        let writer = self.writer.as_mut().ok_or_else(|| failed(&self.path, "is closed".to_owned()))?;
        let written = writer.attach(&attachment(name.to_owned(), text));
        written.map_err(|error| failed(&self.path, plain(&error)))?;
        self.whole = self.length();
        Ok(())
    }

    /// Writes a message of a wire of [`RECORDED`].
    pub fn write(
        &mut self,
        place: usize,
        sequence: u32,
        time_ns: u64,
        cdr: &[u8],
    ) -> Result<(), RecordingError> {
        self.put(self.channels[place], sequence, time_ns, cdr)?;
        self.open[place] += 1;
        Ok(())
    }

    /// Writes a message of a view.
    pub fn write_view(
        &mut self,
        view: usize,
        sequence: u32,
        time_ns: u64,
        cdr: &[u8],
    ) -> Result<(), RecordingError> {
        self.put(self.views[view], sequence, time_ns, cdr)
    }

    fn put(
        &mut self,
        channel_id: u16,
        sequence: u32,
        time_ns: u64,
        cdr: &[u8],
    ) -> Result<(), RecordingError> {
        let size = cdr.len() as u64 + RECORD_HEADER;
        if self.in_chunk > 0 && self.in_chunk + size > self.chunk_bytes {
            self.end_chunk()?;
        }
        if self.in_chunk == 0 {
            self.make_room(size).map_err(|why| RecordingError::new(&self.path, why))?;
        }
        let header = MessageHeader { channel_id, sequence, log_time: time_ns, publish_time: time_ns };
        let writer = self.writer.as_mut().ok_or_else(|| RecordingError::new(&self.path, "is closed"))?;
        let written = writer.write_to_known_channel(&header, cdr);
        written.map_err(|error| RecordingError::new(&self.path, plain(&error)))?;
        self.in_chunk += size;
        self.chunk_since.get_or_insert_with(Instant::now);
        self.first_time.get_or_insert(time_ns);
        Ok(())
    }

    /// Closes the chunk if it has been open for long enough.
    pub fn tend(&mut self) -> Result<(), RecordingError> {
        match self.chunk_since {
            Some(since) if since.elapsed() >= CHUNK_TIME => self.end_chunk(),
            _ => Ok(()),
        }
    }

    fn end_chunk(&mut self) -> Result<(), RecordingError> {
        if let Some(writer) = &mut self.writer {
            writer.flush().map_err(|error| RecordingError::new(&self.path, plain(&error)))?;
        }
        self.chunks += 1;
        self.whole = self.length();
        self.in_chunk = 0;
        self.chunk_since = None;
        self.open = [0; RECORDED.len()];
        Ok(())
    }

    /// Sees to it that there is room for the next chunk, at least `size` long, and the end of the file after it.
    fn make_room(&mut self, size: u64) -> Result<(), String> {
        // What cannot be compressed grows a little; the places of its messages come after it.
        let chunk = self.chunk_bytes.max(size).max(self.in_chunk);
        let chunk = chunk + chunk / 3 + (64 << 10);
        let channels = (self.channels.len() + self.views.len()) as u64;
        let index = (self.chunks + 2) * (INDEX_OF_CHUNK + channels * INDEX_OF_CHANNEL);
        self.file.make_room(self.whole, chunk + index + 2 * self.told)
    }

    /// Bytes in the file so far.
    pub fn length(&self) -> u64 {
        self.file.length.load(Ordering::Relaxed)
    }

    /// Time of its first message.
    pub fn first_time_ns(&self) -> Option<u64> {
        self.first_time
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Ends the file with its index, and says how long it has become; or why that failed, and how many messages of each
    /// wire are lost with it.
    pub fn finish(mut self) -> Result<u64, Box<(RecordingError, [u64; RECORDED.len()])>> {
        let ended = self.end_chunk().and_then(|()| {
            let Some(mut writer) = self.writer.take() else { return Ok(()) };
            let ended = writer.finish().map(drop).and_then(|()| Ok(writer.into_inner().flush()?));
            ended.map_err(|error| RecordingError::new(&self.path, plain(&error)))
        });
        match ended {
            Ok(()) => {
                self.file.give_back_room(self.length());
                Ok(self.length())
            }
            Err(error) => {
                self.abandon();
                Err(Box::new((error, self.open)))
            }
        }
    }

    /// Leaves the file with what was whole; its length then.
    pub fn abandon(&mut self) -> u64 {
        if let Some(writer) = self.writer.take() {
            // Not dropped: that would write the end of the file after a hole.
            writer.into_inner().forget();
        }
        self.file.give_back_room(self.whole);
        self.whole
    }

    /// True if the file is still where it was put.
    pub fn is_in_place(&self) -> bool {
        let here = self.file.file.metadata();
        let there = std::fs::metadata(&self.path);
        matches!((here, there), (Ok(here), Ok(there)) if (here.dev(), here.ino()) == (there.dev(), there.ino()))
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        if self.writer.is_some() {
            self.abandon();
        }
    }
}

fn metadata(pairs: &[(&str, String)]) -> BTreeMap<String, String> {
    pairs.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect()
}

/// What went wrong, without the library's words where the system has its own.
fn plain(error: &McapError) -> String {
    match error {
        McapError::Io(error) => in_words(error),
        other => other.to_string(),
    }
}

fn in_words(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::StorageFull => "the disk is full".to_owned(),
        io::ErrorKind::QuotaExceeded => "the disk quota is used up".to_owned(),
        io::ErrorKind::FileTooLarge => "files may not become larger (ulimit -f)".to_owned(),
        _ => error.to_string(),
    }
}

/// The file itself, shared by the library that writes it and by us who look after its room.
struct Shared {
    file: File,
    /// Bytes that are written.
    length: AtomicU64,
    /// Up to where room is reserved.
    room: AtomicU64,
}

impl Shared {
    /// Reserves room for `size` bytes from `from` on; more at once, so that it is not asked for often. What is wrong
    /// if there is none. Where the file system knows no such thing, there is nothing to be known before.
    fn make_room(&self, from: u64, size: u64) -> Result<(), String> {
        if getrlimit(Resource::Fsize).current.is_some_and(|most| from + size > most) {
            return Err(in_words(&io::ErrorKind::FileTooLarge.into()));
        }
        if from + size <= self.room.load(Ordering::Relaxed) {
            return Ok(());
        }
        let mut refused = None;
        for size in [size + ROOM, size] {
            match fallocate(&self.file, FallocateFlags::KEEP_SIZE, from, size) {
                Ok(()) => {
                    self.room.store(from + size, Ordering::Relaxed);
                    return Ok(());
                }
                Err(error @ (Errno::NOSPC | Errno::DQUOT | Errno::FBIG | Errno::IO)) => refused = Some(error),
                Err(_) => return Ok(()),
            }
        }
        refused.map_or(Ok(()), |error| Err(in_words(&error.into())))
    }

    /// Cuts the file to `length`, and what was reserved beyond.
    fn give_back_room(&self, length: u64) {
        let _ = self.file.set_len(length);
        self.length.store(length, Ordering::Relaxed);
    }
}

/// Collects what the library writes in small pieces.
struct Sink {
    shared: Arc<Shared>,
    buffer: Vec<u8>,
    /// Where the next byte comes to lie.
    position: u64,
}

/// Bytes collected at most.
const SINK_BYTES: usize = 256 << 10;

impl Sink {
    fn new(shared: &Arc<Shared>) -> Self {
        Self { shared: Arc::clone(shared), buffer: Vec::with_capacity(SINK_BYTES), position: 0 }
    }

    fn forget(mut self) {
        self.buffer.clear();
    }

    fn pass_on(&mut self, bytes: &[u8]) -> io::Result<()> {
        (&self.shared.file).write_all(bytes)?;
        self.shared.length.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        Ok(())
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.buffer.len() + bytes.len() > SINK_BYTES {
            self.flush()?;
        }
        if bytes.len() > SINK_BYTES {
            self.pass_on(bytes)?;
        } else {
            self.buffer.extend_from_slice(bytes);
        }
        self.position += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let mut buffer = std::mem::take(&mut self.buffer);
        let passed_on = self.pass_on(&buffer);
        buffer.clear();
        self.buffer = buffer;
        passed_on
    }
}

/// Only asked where it is.
impl Seek for Sink {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.position),
            SeekFrom::Start(place) if place == self.position => Ok(place),
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}
