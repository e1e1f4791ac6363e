//! Exceptions of the package, with the words of Rust.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rohrpost_native::{CallError, Fault, NativeError, ToolError};

/// An exception of `rohrpost.errors`.
fn exception(py: Python<'_>, class: &str, text: &str) -> PyErr {
    let made = py.import("rohrpost.errors").and_then(|errors| errors.getattr(class)?.call1((text,)));
    made.map_or_else(|_| PyRuntimeError::new_err(text.to_owned()), PyErr::from_value)
}

/// A mistake of the program.
pub(crate) fn misuse(py: Python<'_>, text: &str) -> PyErr {
    exception(py, "Misuse", text)
}

/// What cannot be had.
pub(crate) fn failure(py: Python<'_>, error: NativeError) -> PyErr {
    match error {
        NativeError::Call(error) => call_failure(py, &error),
        NativeError::Context(error) if error.is_configuration() => exception(py, "Misconfigured", &error.to_string()),
        NativeError::Context(_) | NativeError::Read(_) | NativeError::System(..) => {
            exception(py, "RohrpostError", &error.to_string())
        }
        NativeError::NoItem { .. }
        | NativeError::NoStream { .. }
        | NativeError::NoNumber(_)
        | NativeError::RecordOpen
        | NativeError::NoRecordOpen => misuse(py, &error.to_string()),
    }
}

/// Why a program beside the robot cannot have something.
pub(crate) fn tool_failure(py: Python<'_>, error: &ToolError) -> PyErr {
    match error {
        ToolError::Call(error) => call_failure(py, error),
        ToolError::NotHere(_) => exception(py, "NoConnection", &error.to_string()),
        ToolError::Configuration(_) => exception(py, "Misconfigured", &error.to_string()),
        ToolError::Name(_) => exception(py, "Misuse", &error.to_string()),
        ToolError::Join(_) | ToolError::Mailbox(_) | ToolError::Stream(_) => {
            exception(py, "RohrpostError", &error.to_string())
        }
    }
}

/// Why a call has no result: the exception that the client by TCP raises, too.
pub(crate) fn call_failure(py: Python<'_>, error: &CallError) -> PyErr {
    let mut seconds = 0.0;
    let (kind, to, fault) = match error {
        CallError::Timeout(to, time) => {
            seconds = time.as_secs_f64();
            ("timeout", to.raw(), Vec::new())
        }
        CallError::NotSent(_) => ("not sent", 0, Vec::new()),
        CallError::TooMany(to) => ("too many", to.raw(), Vec::new()),
        CallError::Fault(to, fault) => ("fault", to.raw(), fault_bytes(fault)),
        CallError::BadReply(to, _) => ("bad reply", to.raw(), Vec::new()),
        CallError::BadArguments(_) => ("bad arguments", 0, Vec::new()),
        CallError::Module(_, never) => match *never {},
    };
    let words = (kind, to, fault, error.to_string(), seconds);
    let made = py.import("rohrpost.node.failures").and_then(|failures| failures.getattr("call_failure")?.call1(words));
    made.map_or_else(|error| error, PyErr::from_value)
}

/// A fault as it stands in a reply.
fn fault_bytes(fault: &Fault) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Writing to a growing vector does not fail.
    let _ = rohrpost_native::append(&mut bytes, fault);
    bytes
}
