//! Containers that are not supported, by their first bytes, with a command that converts each of them.

/// A container: its name, the offset of its signature, the signature, and how it is converted.
type Container = (&'static str, usize, &'static [u8], &'static str);

/// Advice for a format that the Python package reads, with the additional package that it needs.
macro_rules! of_python {
    ($package:literal) => {
        concat!(
            "python3 -c \"import ohmstrain, pyarrow.csv; pyarrow.csv.write_csv(ohmstrain.read('FILE'), 'out.csv')\", with the Python \
             packages ohmstrain and ",
            $package
        )
    };
}
const HDF5: &str = of_python!("h5py");
const MAT: &str = of_python!("scipy");
const BAG: &str = of_python!("rosbags");
const MCAP: &str = of_python!("mcap-ros2-support");
const PAGE: &str = "save the table in it as CSV";
const PICTURE: &str = "export the numbers behind it as CSV";

const KNOWN: [Container; 34] = [
    ("a MATLAB file of version 7.3", 0, b"MATLAB 7.3", HDF5),
    ("a MATLAB file", 0, b"MATLAB 5.0", MAT),
    ("HDF5", 0, b"\x89HDF\r\n\x1a\n", HDF5),
    ("HDF5", 512, b"\x89HDF\r\n\x1a\n", HDF5),
    (
        "netCDF",
        0,
        b"CDF\x01",
        "ncdump FILE, or `python3 -c \"import xarray; xarray.open_dataset('FILE').to_dataframe().to_csv('out.csv')\"`",
    ),
    ("a ROS 1 bag", 0, b"#ROSBAG V", BAG),
    ("MCAP", 0, b"\x89MCAP0\r\n", MCAP),
    (
        "an SQLite database (ROS 2 bags are some)",
        0,
        b"SQLite format 3\0",
        "sqlite3 -csv -header FILE 'select * from TABLE' > out.csv; of a ROS 2 bag ohmstrain.read('FILE') in Python, with the package rosbags",
    ),
    (
        "a LabVIEW TDMS file",
        0,
        b"TDSm",
        "python3 -c \"from nptdms import TdmsFile; TdmsFile('FILE').as_dataframe().to_csv('out.csv')\"",
    ),
    (
        "an Arrow or Feather file",
        0,
        b"ARROW1",
        "python3 -c \"import pandas; pandas.read_feather('FILE').to_csv('out.csv', index=False)\"",
    ),
    ("ORC", 0, b"ORC", "python3 -c \"import pandas; pandas.read_orc('FILE').to_csv('out.csv', index=False)\""),
    ("Avro", 0, b"Obj\x01", "java -jar avro-tools.jar tojson FILE > out.jsonl"),
    ("an R data file", 0, b"RDX", "Rscript -e 'load(\"FILE\"); write.csv(NAME, \"out.csv\")'"),
    ("an R data file", 0, b"X\n\0\0", "Rscript -e 'write.csv(readRDS(\"FILE\"), \"out.csv\")'"),
    ("a pickle of Python", 0, b"\x80\x02", PICKLE),
    ("a pickle of Python", 0, b"\x80\x03", PICKLE),
    ("a pickle of Python", 0, b"\x80\x04\x95", PICKLE),
    ("a pickle of Python", 0, b"\x80\x05\x95", PICKLE),
    (
        "a Stata file",
        0,
        b"<stata_dta>",
        "python3 -c \"import pandas; pandas.read_stata('FILE').to_csv('out.csv', index=False)\"",
    ),
    (
        "an SPSS file",
        0,
        b"$FL2",
        "python3 -c \"import pandas; pandas.read_spss('FILE').to_csv('out.csv', index=False)\"",
    ),
    ("a 7z archive", 0, b"7z\xbc\xaf\x27\x1c", "7z x FILE"),
    ("a RAR archive", 0, b"Rar!\x1a", "unrar x FILE"),
    ("a tar archive", 257, b"ustar", "tar xf FILE"),
    ("bzip2", 0, b"BZh", "bunzip2 FILE"),
    ("xz", 0, b"\xfd7zXZ\0", "unxz FILE"),
    ("Zstandard", 0, b"\x28\xb5\x2f\xfd", "unzstd FILE"),
    ("LZ4", 0, b"\x04\x22\x4d\x18", "unlz4 FILE"),
    ("a PDF", 0, b"%PDF-", PICTURE),
    ("a PNG picture", 0, b"\x89PNG\r\n", PICTURE),
    ("a JPEG picture", 0, b"\xff\xd8\xff", PICTURE),
    ("a sound or film", 0, b"RIFF", PICTURE),
    ("a web page", 0, b"<!DOCTYPE html", PAGE),
    ("a web page", 0, b"<html", PAGE),
    ("a Git LFS pointer, not the file itself", 0, b"version https://git-lfs", "git lfs pull"),
];
const PICKLE: &str =
    "python3 -c \"import pandas; pandas.DataFrame(pandas.read_pickle('FILE')).to_csv('out.csv', index=False)\"";

/// Returns the name of an unsupported format, and a way to convert the file.
pub(crate) fn refusal(bytes: &[u8], file: &str) -> Option<String> {
    let begins = |(_, place, magic, _): &&Container| bytes.get(*place..).is_some_and(|rest| rest.starts_with(magic));
    let (name, _, _, way) = KNOWN.iter().find(begins)?;
    let way = if [PAGE, PICTURE].contains(way) {
        (*way).to_owned()
    } else {
        format!("convert it with {}", way.replace("FILE", file))
    };
    Some(format!("is {name}, which is not read here: {way}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn containers_are_named_with_a_way_out() {
        let message = |bytes: &[u8]| refusal(bytes, "run.bin").unwrap_or_default();
        assert!(message(b"#ROSBAG V2.0\n").contains("ROS 1 bag") && message(b"#ROSBAG V2.0\n").contains("run.bin"));
        let line = "write_csv(ohmstrain.read('run.bin'), 'out.csv')\", with the Python packages ohmstrain and scipy";
        assert!(message(b"MATLAB 5.0 MAT-file").ends_with(line));
        assert!(message(b"SQLite format 3\0...").contains("sqlite3 -csv -header run.bin"));
        assert!(message(b"%PDF-1.7").contains("numbers behind it"));
        assert_eq!(message(b"time_s,resistance_ohm\n"), "");
        // No conversion takes more than a line, and no signature but that of 7z begins with a digit, as numbers do.
        assert!(
            KNOWN
                .iter()
                .all(|(.., magic, way)| !way.contains('\n') && !magic[0].is_ascii_digit() || magic.starts_with(b"7z"))
        );
    }
}
