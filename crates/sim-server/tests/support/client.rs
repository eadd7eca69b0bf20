//! A client of the HTTP API: one request a connection.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use serde_json::Value;

/// Status and body of a request.
pub fn ask(
    address: &str,
    method: &str,
    path: &str,
    more_headers: &str,
    body: &[u8],
) -> (u16, Value) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let host = if more_headers.contains("Host:") {
        String::new()
    } else {
        format!("Host: {}\r\n", address)
    };
    let length = if more_headers.contains("Content-Length:") {
        String::new()
    } else {
        format!("Content-Length: {}\r\n", body.len())
    };
    let kind = if more_headers.contains("Content-Type:") {
        ""
    } else {
        "Content-Type: application/json\r\n"
    };
    let head = format!(
        "{method} {path} HTTP/1.1\r\n{host}{more_headers}{length}{kind}Connection: close\r\n\r\n"
    );
    stream.write_all(&[head.as_bytes(), body].concat()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap_or_else(|| panic!("{answer}"));
    let status: u16 = head.split_whitespace().nth(1).unwrap().parse().unwrap();
    let kind = if status < 400 { "application/json" } else { "application/problem+json" };
    let head = head.to_ascii_lowercase();
    assert!(head.contains(&format!("content-type: {kind}")), "{head}");
    (status, serde_json::from_str(body).unwrap())
}

/// The body of an answer of any kind.
pub fn text(address: &str, path: &str) -> String {
    String::from_utf8(bytes(address, path, "").1).unwrap()
}

/// The status of an answer without a body.
pub fn status(address: &str, method: &str, path: &str) -> u16 {
    sent(address, method, path, "").0
}

/// Status and body of an answer of any kind.
pub fn bytes(address: &str, path: &str, more_headers: &str) -> (u16, Vec<u8>) {
    sent(address, "GET", path, more_headers)
}

fn sent(address: &str, method: &str, path: &str, more_headers: &str) -> (u16, Vec<u8>) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(90))).unwrap();
    let head = format!(
        "{method} {path} HTTP/1.1\r\nHost: {address}\r\n{more_headers}Connection: close\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let end = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
    let head = String::from_utf8_lossy(&answer[..end]).into_owned();
    let body = answer.split_off(end + 4);
    if head.to_ascii_lowercase().contains("transfer-encoding: chunked") {
        return (status_of(&head), unchunked(&body));
    }
    (status_of(&head), body)
}

fn status_of(head: &str) -> u16 {
    head.split_whitespace().nth(1).unwrap().parse().unwrap()
}

/// The body out of its chunks.
fn unchunked(mut body: &[u8]) -> Vec<u8> {
    let mut whole = Vec::new();
    loop {
        let line = body.windows(2).position(|two| two == b"\r\n").unwrap();
        let length = std::str::from_utf8(&body[..line]).unwrap();
        let length = usize::from_str_radix(length, 16).unwrap();
        if length == 0 {
            return whole;
        }
        whole.extend_from_slice(&body[line + 2..line + 2 + length]);
        body = &body[line + 2 + length + 2..];
    }
}
