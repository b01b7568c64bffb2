//! The container of XLS, a compound file: streams as chains of sectors. This module reads one stream, and refuses endless chains.

/// First reserved sector number; such numbers mark ends of chains and free sectors.
const FIRST_RESERVED: u32 = 0xffff_fffa;
/// Sizes of the header, of an entry of the directory, and of a sector of short streams, bytes.
const HEADER: usize = 512;
const ENTRY: usize = 128;
const SHORT_SECTOR: usize = 64;
/// Size below which a stream is stored in short sectors, bytes.
const SHORT: usize = 4096;

/// Returns the stream with the first of these names that exists; `None` if there is none. Names are compared without case.
pub(crate) fn stream(bytes: &[u8], names: &[&str]) -> Result<Option<Vec<u8>>, String> {
    let file = File::new(bytes)?;
    let directory = file.sectors.chain(number(bytes, 48)?, &file.table)?;
    let entries = || directory.chunks_exact(ENTRY);
    let root = entries().next().ok_or_else(|| broken("an empty directory"))?;
    let short = file.sectors.chain(number(root, 116)?, &file.table)?;
    let short_table = numbers(&file.sectors.chain(number(bytes, 60)?, &file.table)?);
    let Some(entry) = names.iter().find_map(|wanted| entries().find(|entry| name(entry).eq_ignore_ascii_case(wanted)))
    else {
        return Ok(None);
    };
    let (start, len) = (number(entry, 116)?, number(entry, 120)? as usize);
    let mut stream = if len < SHORT {
        Sectors { bytes: &short, size: SHORT_SECTOR }.chain(start, &short_table)?
    } else {
        file.sectors.chain(start, &file.table)?
    };
    stream.truncate(len);
    Ok(Some(stream))
}

fn broken(found: &str) -> String {
    format!("expected a compound file, found {found}")
}

struct File<'a> {
    sectors: Sectors<'a>,
    /// Next sector of each sector.
    table: Vec<u32>,
}

#[derive(Clone, Copy)]
struct Sectors<'a> {
    bytes: &'a [u8],
    size: usize,
}

impl<'a> File<'a> {
    fn new(bytes: &'a [u8]) -> Result<Self, String> {
        let size = match bytes.get(30..32) {
            Some([9, 0]) => 512,
            Some([12, 0]) => 4096,
            _ => return Err(broken("sectors of another size than 512 or 4096 bytes")),
        };
        let sectors = Sectors { bytes: bytes.get(size..).unwrap_or_default(), size };
        // Sectors of the table: from the header, and from a chain whose sectors end with the number of the next one.
        let mut places = numbers(bytes.get(76..HEADER).unwrap_or_default());
        let (mut next, mut read) = (number(bytes, 68)?, 0);
        while next < FIRST_RESERVED {
            read += 1;
            if read > sectors.count() {
                return Err(broken("a chain without an end"));
            }
            places.extend(numbers(sectors.get(next)?));
            next = places.pop().unwrap_or(FIRST_RESERVED);
        }
        let mut table = Vec::new();
        for place in places.into_iter().filter(|place| *place < FIRST_RESERVED) {
            if table.len() > sectors.count() + size {
                return Err(broken("a table of more sectors than there are"));
            }
            table.extend(numbers(sectors.get(place)?));
        }
        Ok(Self { sectors, table })
    }
}

impl Sectors<'_> {
    const fn count(&self) -> usize {
        self.bytes.len().div_ceil(self.size)
    }

    /// Returns a sector; the last one may be short.
    fn get(&self, sector: u32) -> Result<&[u8], String> {
        let start = (sector as usize).saturating_mul(self.size);
        let rest = self.bytes.get(start..).filter(|rest| !rest.is_empty());
        rest.map(|rest| &rest[..rest.len().min(self.size)]).ok_or_else(|| broken("a sector beyond its end"))
    }

    /// Returns the bytes of a chain; none if there is no first sector.
    fn chain(&self, first: u32, table: &[u32]) -> Result<Vec<u8>, String> {
        let (mut out, mut next, mut read) = (Vec::new(), first, 0);
        while next < FIRST_RESERVED {
            read += 1;
            if read > self.count() {
                return Err(broken("a chain without an end"));
            }
            out.extend_from_slice(self.get(next)?);
            next = *table.get(next as usize).ok_or_else(|| broken("a chain that leads out of it"))?;
        }
        Ok(out)
    }
}

fn number(bytes: &[u8], at: usize) -> Result<u32, String> {
    let found = bytes.get(at..).and_then(|rest| rest.first_chunk());
    found.map(|bytes| u32::from_le_bytes(*bytes)).ok_or_else(|| broken("a header that is cut"))
}

fn numbers(bytes: &[u8]) -> Vec<u32> {
    bytes.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect()
}

/// Returns the name of an entry, in UTF-16 up to a NUL.
fn name(entry: &[u8]) -> String {
    let units = entry[..64].as_chunks().0.iter().map(|bytes| u16::from_le_bytes(*bytes));
    let units: Vec<u16> = units.take_while(|unit| *unit != 0).collect();
    String::from_utf16_lossy(&units)
}
