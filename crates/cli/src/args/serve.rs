use std::path::PathBuf;

use clap::Args as ClapArgs;

/// Flags of `serve`.
#[derive(Debug, ClapArgs)]
pub struct ServeArgs {
    /// The page, instead of the one in the program: `scripts/web.sh` makes web/dist/index.html
    pub page: Option<PathBuf>,
    /// Port on 127.0.0.1; a browser keeps recordings for each port; 0 stands for any that is free
    #[arg(long, value_name = "NUMBER", default_value_t = 8476)]
    pub port: u16,
}
