//! A module in Python, as the runtime calls it. All of its functions are those of the class `Bridge` of
//! `rohrpost.node`, which raise nothing: what went wrong comes back as a text.

use crate::fails::misuse;
use crate::lent::{lend, require_own_process};
use crate::values::value;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rohrpost_native::schema::{Description, Field};
use rohrpost_native::{
    CommandFailure, Fault, FollowedData, ModuleError, NativeContext, NativeInterface, NativeModule, NativeParameter,
    Ready, Start, StartError,
};

/// Runs a module until it is told to end; the number with which its process is to end.
///
/// `parameters`: of each the bytes of its field and of its default; `settings`: names of the others.
#[pyfunction]
pub(crate) fn run(
    py: Python<'_>,
    arguments: Vec<String>,
    description: &[u8],
    parameters: Vec<(Vec<u8>, Vec<u8>)>,
    settings: Vec<String>,
    bridge: Py<PyAny>,
) -> PyResult<u8> {
    require_own_process(py)?;
    let description = Description::from_bytes(description).map_err(|error| misuse(py, &error.to_string()))?;
    let parameter = |(field, default): (Vec<u8>, Vec<u8>)| {
        let field = Field::from_bytes(&field).map_err(|error| misuse(py, &error.to_string()))?;
        Ok(NativeParameter { field, default })
    };
    let parameters = parameters.into_iter().map(parameter).collect::<PyResult<_>>()?;
    let interface = NativeInterface { description, parameters, settings };
    Ok(py.detach(|| rohrpost_native::tell_exit(started(arguments, interface, bridge))))
}

fn started(arguments: Vec<String>, interface: NativeInterface, bridge: Py<PyAny>) -> Result<(), StartError> {
    let start = Start::from_arguments(arguments.into_iter())?;
    let names = interface.parameters.iter().map(|parameter| parameter.field.name.clone()).collect();
    rohrpost_native::run(start, interface, move |context| {
        let module = PythonModule { bridge, names, fields: Vec::new() };
        module.make(context)?;
        Ok(Box::new(module))
    })
}

struct PythonModule {
    bridge: Py<PyAny>,
    /// Of its parameters.
    names: Vec<String>,
    /// Bytes of the fields that it follows, once something came of them: made once, since Python tells types by them.
    fields: Vec<Option<Py<PyBytes>>>,
}

impl PythonModule {
    /// Calls a method of the bridge, with the interpreter's lock.
    fn call<T>(
        &self,
        context: &mut NativeContext<'_>,
        part: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>,
    ) -> Result<T, ModuleError> {
        lend(context, || {
            Python::attach(|py| part(self.bridge.bind(py)).map_err(|error| ModuleError::new(error.to_string())))
        })
    }

    /// One that returns nothing, or what went wrong.
    fn work(
        &self,
        context: &mut NativeContext<'_>,
        part: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<Py<PyAny>>,
    ) -> Result<(), ModuleError> {
        let failed = self.call(context, |bridge| {
            let failed = part(bridge)?.into_bound(bridge.py());
            if failed.is_none() { Ok(None) } else { told(&failed).map(Some) }
        })?;
        failed.map_or(Ok(()), Err)
    }

    fn make(&self, context: &mut NativeContext<'_>) -> Result<(), ModuleError> {
        let settings = context.settings().to_owned();
        let me = context.installation().classes.format(context.me());
        let values = self.values(context);
        let failed = self.call(context, |bridge| {
            bridge.call_method1("make", (me, settings, values))?.extract::<Option<(String, bool)>>()
        })?;
        match failed {
            None => Ok(()),
            Some((text, true)) => Err(ModuleError::configuration(text)),
            Some((text, false)) => Err(ModuleError::new(text)),
        }
    }

    /// The bytes of the field of what came.
    fn field(&mut self, data: &FollowedData<'_>) -> Py<PyBytes> {
        if self.fields.len() <= data.follow {
            self.fields.resize_with(data.follow + 1, || None);
        }
        let known = &mut self.fields[data.follow];
        Python::attach(|py| {
            known.get_or_insert_with(|| PyBytes::new(py, &data.item.field.to_bytes()).unbind()).clone_ref(py)
        })
    }

    /// All parameters' values.
    fn values(&self, context: &NativeContext<'_>) -> Vec<(String, Vec<u8>)> {
        let value = |name: &String| Some((name.clone(), context.parameter(name)?.to_vec()));
        self.names.iter().filter_map(value).collect()
    }
}

/// What went wrong in the author's code, in words that may have a number of the kernel's error.
fn told(words: &Bound<'_, PyAny>) -> PyResult<ModuleError> {
    let errno = words.getattr_opt("errno")?.map(|number| number.extract::<Option<u16>>()).transpose()?.flatten();
    Ok(ModuleError::new(words.extract::<String>()?).with_errno(errno))
}

impl NativeModule for PythonModule {
    fn on(&mut self, context: &mut NativeContext<'_>) -> Result<(), ModuleError> {
        self.work(context, |bridge| Ok(bridge.call_method0("on")?.unbind()))
    }

    fn off(&mut self, context: &mut NativeContext<'_>) {
        if let Err(error) = self.work(context, |bridge| Ok(bridge.call_method0("off")?.unbind())) {
            let text = format!("on the way to its safe state: {error}");
            rohrpost_native::say(rohrpost_native::SayLevel::Error, &text, error.errno());
        }
    }

    fn tick(&mut self, context: &mut NativeContext<'_>) -> Result<(), ModuleError> {
        self.work(context, |bridge| Ok(bridge.call_method0("tick")?.unbind()))
    }

    fn received(&mut self, context: &mut NativeContext<'_>, data: &FollowedData<'_>) -> Result<(), ModuleError> {
        let field = self.field(data);
        self.work(context, |bridge| {
            let py = bridge.py();
            let value = value(py, data.value, data.place.clone())?;
            let arguments = (data.follow, field, value, data.stamp_ns, data.sequence, data.missed);
            Ok(bridge.call_method1("received", arguments)?.unbind())
        })
    }

    fn ready(&mut self, context: &mut NativeContext<'_>, ready: Ready) -> Result<(), ModuleError> {
        let arguments = (ready.watch.number(), ready.readable, ready.writable);
        self.work(context, |bridge| Ok(bridge.call_method1("ready", arguments)?.unbind()))
    }

    fn command(
        &mut self,
        context: &mut NativeContext<'_>,
        number: u16,
        arguments: &[u8],
        reply: &mut Vec<u8>,
    ) -> Result<(), CommandFailure> {
        let answered = self.call(context, |bridge| {
            let arguments = PyBytes::new(bridge.py(), arguments);
            let answer = bridge.call_method1("command", (number, arguments))?;
            let (result, is_refused, words) = answer.extract::<(Option<Vec<u8>>, bool, Bound<'_, PyAny>)>()?;
            Ok((result, is_refused, told(&words)?))
        });
        match answered.map_err(CommandFailure::Module)? {
            (Some(result), ..) => {
                reply.extend_from_slice(&result);
                Ok(())
            }
            (None, true, error) => Err(CommandFailure::Fault(Fault::Arguments(error.to_string()))),
            (None, false, error) => Err(CommandFailure::Module(error)),
        }
    }

    fn parameters_changed(&mut self, context: &mut NativeContext<'_>, _: &[&str]) -> Result<(), ModuleError> {
        let values = self.values(context);
        self.work(context, |bridge| Ok(bridge.call_method1("parameters_set", (values,))?.unbind()))
    }
}
