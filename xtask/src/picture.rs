//! `cargo xtask picture`: a drawing as a viewer shows it, without a screen.
//!
//! The viewer runs headless with a software renderer, a folder of its own for its state, and a free port. It is
//! asked for the picture only after a while: first it loads, and shows notices over the views.

use crate::failure::Failure;
use crate::venv::{self, Venv};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

/// Asks a viewer, by its address, to write a picture. The viewer answers before it is written.
const ASK: &str = "import sys; from rerun.experimental import ViewerClient; \
                   ViewerClient.connect(sys.argv[1]).save_screenshot(sys.argv[2])";

/// Limit of a viewer's start, and of writing a picture.
const PATIENCE: Duration = Duration::from_secs(60);

struct Order {
    drawing: PathBuf,
    picture: PathBuf,
    size: String,
    wait: Duration,
}

/// Makes the picture.
pub(crate) fn run(args: &[String]) -> Result<ExitCode, Failure> {
    let order = order(args)?;
    renderer()?;
    let venv = venv::venv()?;
    // The viewer writes the file itself, and only the file shows that it has.
    let _ = std::fs::remove_file(&order.picture);
    let memory = std::env::temp_dir().join(format!("rohrpost-viewer-{}", std::process::id()));
    let (mut viewer, port) = viewer(&venv, &order, &memory)?;
    let made = take(&venv, &order, &mut viewer, port);
    // It may have ended by itself already.
    let _ = viewer.kill();
    let _ = viewer.wait();
    let _ = std::fs::remove_dir_all(&memory);
    made?;
    println!("{}", order.picture.display());
    Ok(ExitCode::SUCCESS)
}

fn order(args: &[String]) -> Result<Order, Failure> {
    const USAGE: &str = "usage: cargo xtask picture FILE.rrd OUT.png [--size WIDTHxHEIGHT] [--wait SECONDS]";
    let mut files = Vec::new();
    let (mut size, mut wait) = ("1600x1000".to_owned(), 8);
    let mut words = args.iter();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--size" => size.clone_from(words.next().ok_or(USAGE)?),
            "--wait" => wait = words.next().and_then(|seconds| seconds.parse().ok()).ok_or(USAGE)?,
            option if option.starts_with('-') => return Err(format!("no option `{option}`; {USAGE}")),
            file => files.push(file),
        }
    }
    let [drawing, picture] = files[..] else { return Err(USAGE.into()) };
    let drawing = std::fs::canonicalize(drawing).map_err(|error| format!("cannot read {drawing}: {error}"))?;
    let picture = std::path::absolute(picture).map_err(|error| format!("cannot write {picture}: {error}"))?;
    Ok(Order { drawing, picture, size, wait: Duration::from_secs(wait) })
}

/// Whether some Vulkan driver is there; without a graphics card that is Mesa's.
fn renderer() -> Result<(), Failure> {
    let folders = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"];
    let any = |folder: &&str| std::fs::read_dir(folder).is_ok_and(|mut drivers| drivers.next().is_some());
    if folders.iter().any(any) {
        return Ok(());
    }
    Err("the viewer needs a Vulkan driver; on Debian: apt-get update && apt-get install -y mesa-vulkan-drivers".into())
}

fn viewer(venv: &Venv, order: &Order, memory: &Path) -> Result<(Child, u16), Failure> {
    let address = TcpListener::bind("127.0.0.1:0").and_then(|socket| socket.local_addr());
    let port =
        address.map(|address| address.port()).map_err(|error| format!("no free port for the viewer: {error}"))?;
    let child = Command::new(&venv.rerun)
        .args(["--headless", "--bind", "127.0.0.1", "--renderer", "vulkan"])
        .args(["--port", &port.to_string(), "--window-size", &order.size])
        .arg(&order.drawing)
        .env("XDG_DATA_HOME", memory)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .map_err(|error| format!("cannot run {}: {error}", venv.rerun.display()))?;
    Ok((child, port))
}

fn take(venv: &Venv, order: &Order, viewer: &mut Child, port: u16) -> Result<(), Failure> {
    until("the viewer did not start", viewer, || TcpStream::connect(("127.0.0.1", port)).is_ok())?;
    std::thread::sleep(order.wait);
    let address = format!("rerun+http://127.0.0.1:{port}/proxy");
    let asked = Command::new(&venv.python).args(["-c", ASK, &address]).arg(&order.picture).status();
    if !asked.as_ref().is_ok_and(std::process::ExitStatus::success) {
        return Err(format!("the viewer did not take the order for a picture: {asked:?}"));
    }
    until("the viewer wrote no picture", viewer, || whole(&order.picture))
}

/// Whether a PNG is there up to its end mark.
fn whole(picture: &Path) -> bool {
    std::fs::read(picture).is_ok_and(|bytes| bytes.ends_with(b"IEND\xae\x42\x60\x82"))
}

fn until(failure: &str, viewer: &mut Child, ready: impl Fn() -> bool) -> Result<(), Failure> {
    let start = Instant::now();
    while !ready() {
        if let Ok(Some(status)) = viewer.try_wait() {
            return Err(format!("{failure}: it ended with {status}"));
        }
        if start.elapsed() > PATIENCE {
            return Err(format!("{failure} within {} s", PATIENCE.as_secs()));
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_names_two_files_and_may_say_more() {
        let words = |text: &str| text.split(' ').map(String::from).collect::<Vec<_>>();
        let full = order(&words("Cargo.toml out.png --size 800x600 --wait 3")).unwrap();
        assert_eq!((full.size.as_str(), full.wait), ("800x600", Duration::from_secs(3)));
        assert!(full.drawing.is_absolute() && full.picture.is_absolute());
        for (text, why) in [
            ("Cargo.toml", "usage:"),
            ("Cargo.toml out.png --size", "usage:"),
            ("Cargo.toml out.png --wait long", "usage:"),
            ("Cargo.toml out.png --tall", "no option `--tall`"),
            ("no-such.rrd out.png", "cannot read no-such.rrd"),
        ] {
            let failure = order(&words(text)).err().unwrap();
            assert!(failure.starts_with(why), "{text}: {failure}");
        }
    }

    #[test]
    fn half_a_picture_is_none() {
        let picture = std::env::temp_dir().join(format!("rohrpost-picture-{}.png", std::process::id()));
        for (bytes, is) in [(&b"\x89PNG"[..], false), (&b"\x89PNG ... IEND\xae\x42\x60\x82"[..], true)] {
            std::fs::write(&picture, bytes).unwrap();
            assert_eq!(whole(&picture), is);
        }
        std::fs::remove_file(picture).unwrap();
    }
}
