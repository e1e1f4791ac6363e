//! Writes pictures in place, and a number beside each, which is too small to lie there.

use rohrpost_modules::call::Fault;
use rohrpost_native::schema::{DataItem, DataKind, Description, Field, Function, Members, Named, Type};
use rohrpost_native::{
    CommandFailure, ModuleError, NativeContext, NativeInterface, NativeModule, NativeParameter, RecordRoom,
};
use std::time::Duration;

pub(crate) const LOOK: u16 = 16;
pub(crate) const PICTURE: u16 = 1;
pub(crate) const COUNT: u16 = 2;
pub(crate) const WIDTH_BYTES: usize = 40_000;

pub(crate) fn description() -> Description {
    let fields = vec![Field::new("width", Type::U32), Field::new("pixels", Type::Bytes)];
    let picture = Type::Struct(Named::new("Picture", Members::Fields(fields)));
    let counted = Type::Struct(Named::new("Counted", Members::Fields(vec![Field::new("bytes", Type::Bytes)])));
    let stream = |number, field| DataItem { number, kind: DataKind::Stream, field };
    Description {
        name: "Eye".into(),
        class: "eye".into(),
        text: "Sees.".into(),
        functions: vec![Function {
            number: LOOK,
            name: "look".into(),
            text: String::new(),
            idempotent: false,
            arguments: vec![Field::new("at", Type::U8)],
            result: Type::Tuple(vec![Type::U8, Type::U8]),
        }],
        data: vec![stream(PICTURE, Field::new("picture", picture)), stream(COUNT, Field::new("count", counted))],
    }
}

pub(crate) fn interface() -> NativeInterface {
    let bytes = |number: f64| number.to_le_bytes().to_vec();
    let field = Field::new("speed", Type::F64).said("", "m/s").bounded(Some(bytes(0.0)), Some(bytes(0.2)));
    let parameters = vec![NativeParameter { field, default: bytes(0.05) }];
    NativeInterface { description: description(), parameters, settings: vec!["port".into()] }
}

pub(crate) struct Eye {
    written: u8,
}

impl Eye {
    pub(crate) fn make(context: &mut NativeContext<'_>) -> Result<Box<dyn NativeModule>, ModuleError> {
        context.set_period(Duration::from_millis(5));
        Ok(Box::new(Self { written: 0 }))
    }

    /// Fills a record of this stream with a number, wherever its bytes are.
    fn fill(&self, context: &mut NativeContext<'_>, number: u16, front: &[u8], len: usize) -> Result<u64, ModuleError> {
        let filled = vec![self.written; len];
        match context.begin(number, None, front, len)? {
            RecordRoom::Shared(place, range) => {
                assert_eq!((number, range.len()), (PICTURE, len));
                assert!(context.publish(COUNT, None, &[0]).is_err(), "one record at a time");
                let room = place.address().as_ptr();
                // SAFETY: the record is being filled, so these bytes of its stream's memory are this module's alone.
                unsafe { room.add(range.start).copy_from(filled.as_ptr(), len) };
                Ok(context.finish(&[])?)
            }
            RecordRoom::Own(room) => {
                assert_eq!((number, room), (COUNT, len));
                Ok(context.finish(&filled)?)
            }
        }
    }
}

impl NativeModule for Eye {
    fn tick(&mut self, context: &mut NativeContext<'_>) -> Result<(), ModuleError> {
        self.fill(context, COUNT, &[0], 3)?;
        // Given up, and nothing happened.
        context.begin(PICTURE, None, &[5, 0], 10)?;
        context.abandon();
        assert!(context.finish(&[]).is_err());
        let sequence = self.fill(context, PICTURE, &[5, 0], WIDTH_BYTES)?;
        assert_eq!(sequence as u8, self.written);
        self.written = self.written.wrapping_add(1);
        Ok(())
    }

    fn command(
        &mut self,
        _: &mut NativeContext<'_>,
        number: u16,
        arguments: &[u8],
        reply: &mut Vec<u8>,
    ) -> Result<(), CommandFailure> {
        match (number, arguments) {
            (LOOK, []) => Err(CommandFailure::Module(ModuleError::new("it sees nothing"))),
            (LOOK, arguments) => {
                reply.extend_from_slice(arguments);
                reply.push(0xee);
                Ok(())
            }
            _ => Err(CommandFailure::Fault(Fault::Busy)),
        }
    }

    fn parameters_changed(&mut self, context: &mut NativeContext<'_>, changed: &[&str]) -> Result<(), ModuleError> {
        assert_eq!(changed, ["speed"]);
        let is_fast = context.parameter("speed") == Some(&0.2_f64.to_le_bytes()[..]);
        if is_fast { Err(ModuleError::new("too fast")) } else { Ok(()) }
    }
}
