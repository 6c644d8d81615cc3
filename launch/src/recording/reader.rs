//! A recording read back, message by message, bit for bit what was on the wires.
//!
//! Streamed: a chunk at a time is in memory, however long the file. A file without its end (`kill -9`, a disk that was
//! taken away) is read up to its last whole chunk. Every chunk is checked before a message of it is given out.

use super::damage::{self, attachment};
use super::info::{RunInfo, first_of, parts_there};
use super::inside::Inside;
use super::wires::{Entry, RECORDED, place_of};
use super::{METADATA, RECORDING_FILE, RecordingError, SYSTEM_ATTACHMENT};
use mcap::McapError;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Longest record, longest chunk (compressed or not): what is longer is no recording of ours, and not read into memory.
const MAX_RECORD: usize = 128 << 20;
/// Read at once.
const READ_BYTES: usize = 256 << 10;
const READ_AT_MOST: usize = 4 << 20;
const END_MAGIC_LEN: i64 = mcap::MAGIC.len() as i64;

/// A recording: all its parts in order.
#[derive(Clone, Debug)]
pub struct Recording {
    parts: Vec<PathBuf>,
    info: RunInfo,
    system: Option<String>,
    unfinished: Option<PathBuf>,
}

/// A message and when it was.
#[derive(Clone, Debug, PartialEq)]
pub struct Timed {
    /// Time in the recording, ns since 1970 (see [`super`]).
    pub log_time_ns: u64,
    /// Counts up by one a message of its wire; a gap is a message that was given up.
    pub sequence: u32,
    /// The message.
    pub entry: Entry,
}

impl Recording {
    /// Opens a run's directory or a file of a recording: the parts beside it belong to it, those before a part that is
    /// named do not.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let named = if path.is_dir() { path.join(RECORDING_FILE) } else { path.to_owned() };
        let (first, from) = first_of(&named);
        let mut parts: Vec<PathBuf> =
            parts_there(&first).into_iter().filter(|(part, _)| *part >= from).map(|(_, file)| file).collect();
        if path.is_dir() && parts.is_empty() {
            return Err(RecordingError::new(
                path,
                format!("no recording in it ({RECORDING_FILE}); hilare run and hilare record make one"),
            ));
        }
        if !path.is_dir() && !parts.contains(&named) {
            // Whatever it is called.
            parts = vec![named];
        }
        let survey = Survey::of(&parts[0])?;
        let mut unfinished = (!survey.finished).then(|| parts[0].clone());
        for part in parts.split_off(1) {
            // Of another recording, a file may lie beside this one.
            let next = Survey::of(&part)?;
            if next.info.recording == survey.info.recording {
                unfinished = unfinished.or((!next.finished).then(|| part.clone()));
                parts.push(part);
            }
        }
        Ok(Self { parts, info: survey.info, system: survey.system, unfinished })
    }

    /// Its files, in order.
    pub fn files(&self) -> &[PathBuf] {
        &self.parts
    }

    /// What was recorded.
    pub fn info(&self) -> &RunInfo {
        &self.info
    }

    /// The resolved system file of the robot, if the recording has it.
    pub fn system(&self) -> Option<&str> {
        self.system.as_deref()
    }

    /// The files in it by name, but for the system file; what a file lost with its end is missing.
    pub fn inside(&self) -> Result<Inside, RecordingError> {
        let mut inside = Inside::default();
        for part in &self.parts {
            let mut records = Records::open(part, true)?;
            let mut keep = |opcode, data: &[u8]| {
                if opcode == op::ATTACHMENT {
                    inside.keep(data);
                }
                Ok(())
            };
            while records.next(&mut keep)?.is_some() {}
        }
        Ok(inside)
    }

    /// The first file that has no end: what came after its last whole chunk is lost.
    pub fn truncated(&self) -> Option<&Path> {
        self.unfinished.as_deref()
    }

    /// Every message, in the order of the files: by time within a look at the wires, so nearly by time. After an error
    /// nothing more comes.
    pub fn entries(&self) -> Entries {
        Entries { parts: self.parts.clone().into_iter(), part: None, over: false }
    }
}

/// The messages of a recording.
pub struct Entries {
    parts: std::vec::IntoIter<PathBuf>,
    part: Option<PartReader>,
    over: bool,
}

impl Iterator for Entries {
    type Item = Result<Timed, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        while !self.over {
            let next = match &mut self.part {
                Some(part) => part.next_message(),
                None => match self.parts.next() {
                    Some(file) => {
                        match PartReader::open(&file) {
                            Ok(part) => self.part = Some(part),
                            Err(error) => return self.end_with(error),
                        }
                        continue;
                    }
                    None => break,
                },
            };
            match next {
                Ok(Some(timed)) => return Some(Ok(timed)),
                Ok(None) => self.part = None,
                Err(error) => return self.end_with(error),
            }
        }
        self.over = true;
        None
    }
}

impl Entries {
    fn end_with(&mut self, error: RecordingError) -> Option<Result<Timed, RecordingError>> {
        self.over = true;
        Some(Err(error))
    }
}

/// Records of a file, one after the other.
struct Records {
    path: Arc<Path>,
    file: File,
    reader: LinearReader,
    /// It ends as a file should.
    finished: bool,
    started: bool,
    /// Chunks come as they are in the file.
    whole_chunks: bool,
    /// Then: where the next record begins.
    offset: u64,
}

impl Records {
    fn open(path: &Path, whole_chunks: bool) -> Result<Self, RecordingError> {
        let failed = |error: io::Error| match error.kind() {
            io::ErrorKind::NotFound => RecordingError::new(
                path,
                "there is no such recording; hilare run puts its own into runs/, hilare record makes one",
            ),
            _ => RecordingError::new(path, error),
        };
        let mut file = File::open(path).map_err(failed)?;
        let kind = file.metadata().map_err(failed)?;
        if !kind.is_file() {
            return Err(RecordingError::new(path, "is no file"));
        }
        if kind.len() == 0 {
            return Err(RecordingError::new(path, "is empty: nothing was recorded"));
        }
        let mut end = [0; mcap::MAGIC.len()];
        let finished = kind.len() >= 2 * END_MAGIC_LEN as u64
            && file.seek(SeekFrom::End(-END_MAGIC_LEN)).and_then(|_| file.read_exact(&mut end)).is_ok()
            && end == mcap::MAGIC;
        file.rewind().map_err(failed)?;
        let options = LinearReaderOptions::default()
            .with_emit_chunks(whole_chunks)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(MAX_RECORD);
        let reader = LinearReader::new_with_options(options);
        Ok(Self {
            path: path.into(),
            file,
            reader,
            finished,
            started: false,
            whole_chunks,
            offset: mcap::MAGIC.len() as u64,
        })
    }

    /// Where a file is damaged: the first record that cannot be read, or chunk that cannot be unpacked.
    fn first_damage(path: &Path) -> Option<u64> {
        let mut records = Self::open(path, true).ok()?;
        loop {
            let offset = records.offset;
            match records.next(|opcode, data| Ok(opcode != op::CHUNK || damage::is_sound(data, MAX_RECORD))) {
                Ok(Some(true)) => {}
                Ok(Some(false)) | Err(_) => return Some(offset),
                Ok(None) => return None,
            }
        }
    }

    /// Gives the next record to `read`; `None` at the end, also at that of a file without one.
    fn next<R>(
        &mut self,
        mut read: impl FnMut(u8, &[u8]) -> Result<R, RecordingError>,
    ) -> Result<Option<R>, RecordingError> {
        loop {
            let Some(event) = self.reader.next_event() else { return Ok(None) };
            match event {
                Ok(LinearReadEvent::ReadRequest(size)) => {
                    // What a damaged length asks for is not taken on trust.
                    let size = size.clamp(READ_BYTES, READ_AT_MOST);
                    let got = self.file.read(self.reader.insert(size));
                    let got = got.map_err(|error| RecordingError::new(&self.path, error))?;
                    self.reader.notify_read(got);
                }
                Ok(LinearReadEvent::Record { opcode, data }) => {
                    self.started = true;
                    self.offset += damage::RECORD_PREFIX + data.len() as u64;
                    // What a file system leaves where nothing was written.
                    if opcode == 0 && !self.finished {
                        return Ok(None);
                    }
                    return read(opcode, data).map(Some);
                }
                Err(error) => {
                    let over = matches!(error, McapError::UnexpectedEof) && !self.finished && self.started;
                    return if over { Ok(None) } else { Err(self.in_words(&error)) };
                }
            }
        }
    }

    fn in_words(&self, error: &McapError) -> RecordingError {
        let what = match error {
            McapError::BadMagic => "is no MCAP file".to_owned(),
            McapError::UnexpectedEof if !self.started => "is no MCAP file".to_owned(),
            McapError::UnsupportedCompression(name) => {
                format!(
                    "is compressed with {name:?}, which hilare does not read; mcap compress --compression lz4"
                )
            }
            // Whoever looks for the place asks for whole chunks.
            _ if self.whole_chunks => damage::in_words(&self.path, self.offset, error),
            _ => match Self::first_damage(&self.path) {
                Some(offset) => damage::in_words(&self.path, offset, error),
                None => format!("is damaged: {error}"),
            },
        };
        RecordingError::new(&self.path, what)
    }
}

fn parse<'a>(path: &Path, opcode: u8, data: &'a [u8]) -> Result<Record<'a>, RecordingError> {
    mcap::parse_record(opcode, data)
        .map_err(|error| RecordingError::new(path, format!("is damaged: {error}")))
}

/// What a file says of itself.
struct Survey {
    info: RunInfo,
    system: Option<String>,
    finished: bool,
}

impl Survey {
    fn of(path: &Path) -> Result<Self, RecordingError> {
        let mut records = Records::open(path, true)?;
        let mut survey = Self { info: RunInfo::default(), system: None, finished: records.finished };
        let (mut known, mut told) = (false, false);
        let path = path.to_owned();
        // Ours say it before the first chunk; what another tool has made of them may say it later.
        while let Some(enough) = records.next(|opcode, data| {
            match opcode {
                op::CHUNK => return Ok(known),
                op::METADATA => {
                    if let Record::Metadata(metadata) = parse(&path, opcode, data)?
                        && metadata.name == METADATA
                    {
                        survey.info = RunInfo::from_metadata(&metadata.metadata);
                        known = true;
                    }
                }
                op::ATTACHMENT => {
                    if let Some((name, text)) = attachment(data)
                        && name == SYSTEM_ATTACHMENT
                    {
                        survey.system = Some(text);
                    }
                }
                op::CHANNEL => {
                    if let Record::Channel(channel) = parse(&path, opcode, data)? {
                        told = true;
                        known |= place_of(&channel.topic).is_some();
                    }
                }
                _ => {}
            }
            Ok(false)
        })? {
            if enough {
                break;
            }
        }
        // A file that tells its channels at its end need not be unpacked to know that none is ours.
        if !known && (told || !Self::has_our_channels(&path)?) {
            return Err(RecordingError::new(
                &path,
                "is no recording of hilare: it has no channels /hilare/...",
            ));
        }
        Ok(survey)
    }

    fn has_our_channels(path: &Path) -> Result<bool, RecordingError> {
        let mut part = PartReader::open(path)?;
        while part.next_record()?.is_some() {
            if !part.channels.is_empty() {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Messages of a file.
struct PartReader {
    records: Records,
    /// Place in [`RECORDED`] of each channel that is ours.
    channels: BTreeMap<u16, usize>,
}

impl PartReader {
    fn open(path: &Path) -> Result<Self, RecordingError> {
        Ok(Self { records: Records::open(path, false)?, channels: BTreeMap::new() })
    }

    /// The next message of one of our wires.
    fn next_message(&mut self) -> Result<Option<Timed>, RecordingError> {
        while let Some(seen) = self.next_record()? {
            if let Some(timed) = seen {
                return Ok(Some(timed));
            }
        }
        Ok(None)
    }

    /// The next record: a message of ours, or another.
    fn next_record(&mut self) -> Result<Option<Option<Timed>>, RecordingError> {
        let Self { records, channels } = self;
        let path = Arc::clone(&records.path);
        records.next(|opcode, data| match opcode {
            op::CHANNEL => {
                channels.extend(read_channel(&path, parse(&path, opcode, data)?)?);
                Ok(None)
            }
            op::MESSAGE => read_message(&path, channels, parse(&path, opcode, data)?),
            _ => Ok(None),
        })
    }
}

/// The number of a channel that is ours, and its place.
fn read_channel(path: &Path, record: Record<'_>) -> Result<Option<(u16, usize)>, RecordingError> {
    let Record::Channel(channel) = record else { return Ok(None) };
    // A wire of another version is passed over; one that both know has to be the same.
    let Some(place) = place_of(&channel.topic) else { return Ok(None) };
    let ours = RECORDED[place];
    let said = |key: &str| channel.metadata.get(key).cloned().unwrap_or_else(|| "?".to_owned());
    if said("layout") != ours.layout() || channel.message_encoding != "cdr" {
        return Err(RecordingError::new(
            path,
            format!(
                "{} is {} with layout {} there, {} with layout {} here; read it with the hilare that wrote it",
                channel.topic,
                said("message"),
                said("layout"),
                ours.message(),
                ours.layout()
            ),
        ));
    }
    Ok(Some((channel.id, place)))
}

fn read_message(
    path: &Path,
    channels: &BTreeMap<u16, usize>,
    record: Record<'_>,
) -> Result<Option<Timed>, RecordingError> {
    let Record::Message { header, data } = record else { return Ok(None) };
    let Some(place) = channels.get(&header.channel_id) else { return Ok(None) };
    let entry = Entry::decode(*place, &data).ok_or_else(|| {
        RecordingError::new(
            path,
            format!("is damaged: a message of {} bytes on {}", data.len(), RECORDED[*place].topic()),
        )
    })?;
    Ok(Some(Timed { log_time_ns: header.log_time, sequence: header.sequence, entry }))
}
