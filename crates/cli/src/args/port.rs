use std::path::PathBuf;

use clap::Args as ClapArgs;

use super::positive;

/// Port that readings come from.
#[derive(Debug, ClapArgs)]
pub struct PortArgs {
    /// Serial port, pipe, or a recording to play back; - for stdin
    #[arg(long, value_name = "DEV|-", required_unless_present_any = ["udp", "tcp"], conflicts_with_all = ["udp", "tcp"])]
    pub port: Option<PathBuf>,
    /// Take datagrams of one or more lines at this port: :9000 from any network, 127.0.0.1:9000 from this computer alone
    #[arg(long, value_name = "[ADDRESS]:PORT", value_parser = address, conflicts_with = "tcp")]
    pub udp: Option<String>,
    /// Take lines by TCP: HOST:PORT connects to a device, and again when it has gone; :PORT waits for devices to connect, one at a time
    #[arg(long, value_name = "[HOST]:PORT", value_parser = address)]
    pub tcp: Option<String>,
    /// Bits per second of a serial port
    #[arg(long, value_name = "BPS", default_value_t = 115_200)]
    pub baud: u32,
    /// Names of the columns of a stream that has no header line, or was joined after it: time_us,adc for instance;
    /// without a time column rows have the time at which they arrive
    #[arg(long, value_name = "COLUMNS")]
    pub header: Option<String>,
    /// Play a recording back X times as fast as it was recorded
    #[arg(long, value_name = "X", default_value = "1", allow_negative_numbers = true, value_parser = positive)]
    pub speed: f64,
}

impl PortArgs {
    /// Returns the name of the source in messages.
    pub fn source(&self) -> String {
        match (&self.port, &self.udp, &self.tcp) {
            (Some(port), ..) => port.display().to_string(),
            (None, Some(udp), _) => format!("udp {udp}"),
            (None, None, tcp) => format!("tcp {}", tcp.as_deref().unwrap_or_default()),
        }
    }
}

/// An address with a port; one without a host begins with the colon.
fn address(text: &str) -> Result<String, String> {
    let port = text.rsplit_once(':').and_then(|(_, port)| port.parse::<u16>().ok());
    port.map(|_| text.to_owned()).ok_or_else(|| "expected :PORT or HOST:PORT, :9000 for instance".into())
}
