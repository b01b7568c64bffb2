//! Arrays of NumPy, `.npy`, and several of them in a zip, `.npz`: numbers of every size, dates, and records of these.

use crate::import::bytes::cell::{Cell, Cells};
use crate::import::bytes::parquet::RawColumn;

/// First bytes of such a file.
pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";
/// Largest number of columns of an array; one with more of them is not a recording.
const MOST_COLUMNS: usize = 1000;

/// Returns the columns of an array, which is a table or a list of records; `name` is that of the array, if it has one.
pub(crate) fn columns(bytes: &[u8], name: &str) -> Result<Vec<RawColumn>, String> {
    let (header, data) = header(bytes).ok_or("expected the header of a NumPy array, found another")?;
    let header = header.as_str();
    let shape = shape(header).ok_or("expected the shape of a NumPy array, found none")?;
    let fields = fields(header).ok_or_else(|| {
        format!("expected an array of numbers, found one of {}", entry(header, "descr").unwrap_or("objects"))
    })?;
    let size: usize = fields.iter().map(|field| field.kind.size).sum();
    let (rows, across) = match shape[..] {
        [rows] => (rows, 1),
        // A single line is also a column.
        [1, rows] => (rows, 1),
        [rows, across] => (rows, across),
        _ => return Err(format!("expected an array of one or two dimensions, found {}", shape.len())),
    };
    let expected =
        rows.checked_mul(across).and_then(|cells| cells.checked_mul(size)).filter(|bytes| *bytes <= data.len());
    if expected.is_none() || across * fields.len() > MOST_COLUMNS {
        return Err(format!("expected {rows} × {across} numbers of {size} bytes, found {} bytes", data.len()));
    }
    let is_by_column = entry(header, "fortran_order").is_some_and(|order| order.starts_with("True"));
    let mut out = Vec::new();
    for column in 0..across {
        let mut offset = 0;
        for field in &fields {
            let mut cells = Cells::default();
            for row in 0..rows {
                let place = if is_by_column { column * rows + row } else { row * across + column };
                cells.push_cell(&field.kind.cell(&data[place * size + offset..]));
            }
            offset += field.kind.size;
            let heading = match (name.is_empty(), across, field.name.is_empty()) {
                (_, _, false) => field.name.clone(),
                (true, _, _) => String::new(),
                (false, 1, _) => name.to_owned(),
                _ => format!("{name}.{}", column + 1),
            };
            out.push(RawColumn { heading, unit: field.kind.unit(), cells });
        }
    }
    Ok(out)
}

/// Returns the text of the header, a Python dictionary, and the bytes after it.
fn header(bytes: &[u8]) -> Option<(String, &[u8])> {
    let behind = bytes.strip_prefix(MAGIC)?;
    let (length, start) = match behind.first()? {
        1 => (usize::from(u16::from_le_bytes(*behind.get(2..)?.first_chunk()?)), 4),
        _ => (u32::from_le_bytes(*behind.get(2..)?.first_chunk()?) as usize, 6),
    };
    let (header, data) = behind.get(start..)?.split_at_checked(length)?;
    // Versions 1 and 2 are in Latin-1, version 3 in UTF-8.
    let latin_1 = || header.iter().copied().map(char::from).collect();
    Some((String::from_utf8(header.to_vec()).unwrap_or_else(|_| latin_1()), data))
}

/// Returns the text after a key of the header.
fn entry<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let (_, behind) = header.split_once(&format!("'{key}':"))?;
    Some(behind.trim_start())
}

fn shape(header: &str) -> Option<Vec<usize>> {
    let (inside, _) = entry(header, "shape")?.strip_prefix('(')?.split_once(')')?;
    inside.split(',').map(str::trim).filter(|part| !part.is_empty()).map(|part| part.parse().ok()).collect()
}

/// A number in each element, with its name in a record.
struct Field {
    name: String,
    kind: Kind,
}

fn fields(header: &str) -> Option<Vec<Field>> {
    let described = entry(header, "descr")?;
    if let Some(kind) = described.strip_prefix('\'') {
        return Some(vec![Field { name: String::new(), kind: Kind::of(kind.split('\'').next()?)? }]);
    }
    // [('time', '<f8'), ('R', '<f4')]
    let (list, _) = described.strip_prefix('[')?.split_once(']').filter(|(list, _)| !list.contains('['))?;
    let texts: Vec<&str> = list.split('\'').skip(1).step_by(2).collect();
    let field = |pair: &[&str]| Some(Field { name: pair[0].to_owned(), kind: Kind::of(pair.get(1)?)? });
    // A field with a shape of its own is more than a single number.
    let are_numbers = list.matches("('").count() * 2 == texts.len() && !list.contains("', (");
    are_numbers.then(|| texts.chunks(2).map(field).collect())?
}

/// A type of numbers: `<f8`, `|u1`, `>i4`, `<M8[ms]`.
struct Kind {
    is_big_endian: bool,
    letter: char,
    size: usize,
    unit: Option<String>,
}

impl Kind {
    fn of(text: &str) -> Option<Self> {
        let mut letters = text.chars();
        let is_big_endian = letters.next()? == '>';
        let letter = letters.next()?;
        let rest = letters.as_str();
        let (size, unit) = rest
            .split_once('[')
            .map_or((rest, None), |(size, unit)| (size, Some(unit.trim_end_matches(']').to_owned())));
        let size: usize = size.parse().ok()?;
        let is_known = match letter {
            'f' => [2, 4, 8].contains(&size),
            'i' | 'u' => [1, 2, 4, 8].contains(&size),
            'b' => size == 1,
            'M' | 'm' => size == 8,
            _ => false,
        };
        is_known.then_some(Self { is_big_endian, letter, size, unit })
    }

    /// Returns the unit of dates and durations.
    fn unit(&self) -> Option<String> {
        let unit = self.unit.as_deref()?;
        ["s", "ms", "us", "ns"].contains(&unit).then(|| unit.to_owned())
    }

    /// Reads the number at the start of the bytes.
    fn cell(&self, bytes: &[u8]) -> Cell<'static> {
        let mut word = [0; 8];
        for (place, out) in word.iter_mut().take(self.size).enumerate() {
            *out = bytes[if self.is_big_endian { self.size - 1 - place } else { place }];
        }
        let bits = u64::from_le_bytes(word);
        let whole = (bits << (64 - 8 * self.size)) as i64 >> (64 - 8 * self.size);
        match (self.letter, self.size) {
            ('f', 8) => Cell::Number(f64::from_bits(bits)),
            // Single precision is read by its own shortest decimal digits: 0.1 means 0.1.
            ('f', 4) => f32::from_bits(bits as u32).to_string().parse().map_or(Cell::Empty, Cell::Number),
            ('f', _) => Cell::Number(half(bits as u16)),
            ('u' | 'b', _) => i64::try_from(bits).map_or_else(|_| Cell::Text(bits.to_string().into()), Cell::count),
            // NaT, which is not a time.
            ('M' | 'm', _) if whole == i64::MIN => Cell::Empty,
            _ => Cell::count(whole),
        }
    }
}

/// Decodes a 16-bit float.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023) / 1024.0);
    let size = match exponent {
        0 => fraction * 2.0_f64.powi(-14),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction) * 2.0_f64.powi(exponent - 15),
    };
    if bits >> 15 == 1 { -size } else { size }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns an array as NumPy writes it.
    fn array(described: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': {described}, 'fortran_order': {order}, 'shape': {shape}, }}\n");
        [MAGIC, &[1, 0], &(header.len() as u16).to_le_bytes(), header.as_bytes(), data].concat()
    }

    fn cells(bytes: &[u8]) -> Vec<(String, Vec<String>)> {
        let columns = columns(bytes, "run").unwrap_or_else(|error| panic!("{error}"));
        columns.into_iter().map(|column| (column.heading, column.cells.iter().map(str::to_owned).collect())).collect()
    }

    #[test]
    fn tables_lists_and_records() {
        let numbers: Vec<u8> =
            [1.5_f64, 2.0, 3.0, 4.0, 5.0, -6.0].iter().flat_map(|number| number.to_le_bytes()).collect();
        let by_row = cells(&array("'<f8'", "False", "(3, 2)", &numbers));
        assert_eq!(
            by_row,
            [
                ("run.1".into(), ["1.5", "3", "5"].map(Into::into).to_vec()),
                ("run.2".into(), ["2", "4", "-6"].map(Into::into).to_vec())
            ]
        );
        let by_column = cells(&array("'<f8'", "True", "(3, 2)", &numbers));
        assert_eq!(by_column[1].1, ["4", "5", "-6"]);
        assert_eq!(cells(&array("'>i2'", "False", "(2,)", &[0xff, 0xfe, 0, 7]))[0].1, ["-2", "7"]);
        assert_eq!(cells(&array("'<f2'", "False", "(1, 2)", &[0, 0x3e, 0, 0xc0]))[0].1, ["1.5", "-2"]);
        let record = [&0.1_f32.to_le_bytes()[..], &[200]].concat();
        let records = cells(&array("[('t', '<f4'), ('R', '|u1')]", "False", "(1,)", &record));
        assert_eq!(records, [("t".into(), vec!["0.1".into()]), ("R".into(), vec!["200".into()])]);
    }

    #[test]
    fn what_is_no_table_is_refused() {
        for bytes in [
            array("'<f8'", "False", "(9, 2)", &[0; 16]),
            array("'|O'", "False", "(1,)", &[0; 8]),
            array("'<f8'", "False", "(1, 1, 1)", &[0; 8]),
            array("'<f8'", "False", "(18446744073709551615, 2)", &[0; 16]),
            b"\x93NUMPY\x01".to_vec(),
        ] {
            assert!(columns(&bytes, "").is_err());
        }
    }
}
