//! What is sound of a file, and in words what is not.

use mcap::McapError;
use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::path::Path;

/// Opcode and length of a record.
pub(super) const RECORD_PREFIX: u64 = 9;

/// What is wrong with the record at an offset, and what to do.
pub(super) fn in_words(file: &Path, offset: u64, error: &McapError) -> String {
    let what = match error {
        McapError::BadChunkCrc { .. } => "a chunk is not what its checksum says".to_owned(),
        McapError::BadAttachmentCrc { .. } => "an attachment is not what its checksum says".to_owned(),
        McapError::Io(_) | McapError::DecompressionError(_) => "a chunk cannot be unpacked".to_owned(),
        McapError::RecordTooLarge { len, .. } => format!("no record has {len} bytes"),
        other => other.to_string(),
    };
    let file = file.display();
    format!("is damaged at byte {offset}: {what}; mcap recover {file} -o whole.mcap keeps what is sound")
}

/// True if a chunk can be unpacked and is what its checksum says. Its records' lengths are not taken on trust.
pub(super) fn is_sound(chunk: &[u8], longest: usize) -> bool {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(longest);
    let mut reader = LinearReader::new_with_options(options);
    let mut whole = vec![op::CHUNK];
    whole.extend((chunk.len() as u64).to_le_bytes());
    whole.extend(chunk);
    let mut rest = &whole[..];
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(size)) => {
                let (now, later) = rest.split_at(size.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            Ok(LinearReadEvent::Record { .. }) => {}
            // There is nothing but the chunk.
            Err(McapError::UnexpectedEof) => return rest.is_empty(),
            Err(_) => return false,
        }
    }
    true
}

/// Name and text of an attachment whose lengths and checksum are right.
pub(super) fn attachment(data: &[u8]) -> Option<(String, String)> {
    const TIMES: usize = 16;
    let text = |data: &[u8]| -> Option<(usize, String)> {
        let (length, rest) = data.split_first_chunk()?;
        let text = rest.get(..u32::from_le_bytes(*length) as usize)?;
        Some((size_of::<u32>() + text.len(), String::from_utf8(text.to_vec()).ok()?))
    };
    let (body, crc) = data.split_last_chunk()?;
    let crc = u32::from_le_bytes(*crc);
    let (name_len, name) = text(body.get(TIMES..)?)?;
    let (type_len, _) = text(body.get(TIMES + name_len..)?)?;
    let (length, rest) = body.get(TIMES + name_len + type_len..)?.split_first_chunk()?;
    if u64::from_le_bytes(*length) != rest.len() as u64 || (crc != 0 && crc != crc32(body)) {
        return None;
    }
    Some((name, String::from_utf8(rest.to_vec()).ok()?))
}

/// CRC-32 as zip has it, bit by bit: for a few kilobytes.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    })
}
