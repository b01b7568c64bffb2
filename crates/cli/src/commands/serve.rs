use tiny_http::{Header, Method, Request, Response, Server};

use crate::args::ServeArgs;
use crate::error::CliError;
use crate::messages::Messages;
use crate::output::print;
use crate::whole_file;

/// The page, if the program was built with it.
const PAGE: Option<&[u8]> = include!(concat!(env!("OUT_DIR"), "/page.rs"));

/// Answers a browser on this computer with the page until it is stopped.
pub fn run(args: &ServeArgs, messages: &Messages) -> Result<(), CliError> {
    let page = match (&args.page, PAGE) {
        (Some(path), _) => whole_file::bytes(path)?,
        (None, Some(page)) => page.to_vec(),
        (None, None) => {
            let why = "this program was built without the page: name its file, web/dist/index.html, which scripts/web.sh makes";
            return Err(CliError::Arguments(why.into()));
        }
    };
    let server = Server::http(("127.0.0.1", args.port)).map_err(|error| {
        CliError::Other(format!("cannot listen on port {} of 127.0.0.1: {error}; --port names another", args.port))
    })?;
    print(|out| Ok(writeln!(out, "http://{}/", server.server_addr())?))?;
    messages.remark("open this address in a browser on this computer; Ctrl-C ends");
    for request in server.incoming_requests() {
        answer(request, &page, messages);
    }
    Ok(())
}

/// Answers with the page, or with an error for any other path or method.
fn answer(request: Request, page: &[u8], messages: &Messages) {
    let asked = format!("{} {}", request.method(), request.url());
    let is_page = ["/", "/index.html"].contains(&request.url());
    let answered = match request.method() {
        Method::Get | Method::Head if is_page => {
            let headers = [("Content-Type", "text/html; charset=utf-8"), ("Cache-Control", "no-cache")];
            let headers = headers.into_iter().filter_map(|(name, value)| Header::from_bytes(name, value).ok());
            request.respond(Response::new(200.into(), headers.collect(), page, Some(page.len()), None))
        }
        Method::Get | Method::Head => {
            request.respond(Response::from_string("there is one page here: /\n").with_status_code(404))
        }
        _ => request.respond(Response::from_string("the page is read, and nothing else\n").with_status_code(405)),
    };
    match answered {
        Ok(()) => messages.detail(&asked),
        Err(error) => messages.detail(&format!("{asked}: {error}")),
    }
}
