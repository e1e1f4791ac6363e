//! What a module follows of others by the names of modules and data. As long as one of them has not described itself,
//! a timer wakes the module to look again.

use crate::error::NativeError;
use nix::sys::time::{TimeSpec, TimeValLike};
use nix::sys::timerfd::{ClockId, Expiration, TimerFd, TimerFlags, TimerSetTimeFlags};
use rohrpost_mailbox::{Interest, Name, OverflowPolicy, RecordPlace, Shape, Watch, local};
use rohrpost_modules::description::{DescriptionRequest, noted};
use rohrpost_modules::runtime::{Context, Moment, Rate, Received, StreamSubscription, Subscription};
use rohrpost_schema::{DataItem, DataKind, Description};
use std::io;
use std::rc::Rc;
use std::time::Duration;

/// A module that has not described itself is looked for again after so long, ms.
const LOOK_MS: i64 = 100;
/// The module's mailbox of data of which only the newest counts.
const NEWEST: u8 = local::DATA + 1;

/// What of it a module wants.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum FollowRate {
    /// Each value, as data.
    Each,
    /// The newest value once in this time, as data.
    Every(Duration),
    /// Of values that wait only the newest, as data.
    Newest,
    /// Each record of a stream of this node, where it lies.
    Records,
}

/// Something that came of what a module follows.
pub struct FollowedData<'a> {
    /// What [`crate::NativeContext::follow`] returned.
    pub follow: usize,
    /// Name, number and type of the data.
    pub item: Rc<DataItem>,
    /// The value, postcard of the type that the description says; nobody has looked whether it is.
    pub value: &'a [u8],
    /// Where it lies, if it is a stream's record.
    pub place: Option<RecordPlace>,
    /// When it was true, ns since 1970.
    pub stamp_ns: u64,
    /// The same, to look for in a stream.
    pub moment: Moment,
    /// Its number: of a subscription, or the lower bits of a record's.
    pub sequence: u32,
    /// Values missed before it; of a stream, records lost so far.
    pub missed: u32,
}

/// How it comes.
enum Way {
    Data(Subscription<()>),
    Records(StreamSubscription<()>),
}

/// One thing that is followed.
struct Follow {
    from: Name,
    /// The module, as the author wrote it.
    module: String,
    item: String,
    rate: FollowRate,
    request: DescriptionRequest,
    found: Option<(Way, Rc<DataItem>)>,
    /// It is known that it cannot be had, and that was told.
    is_hopeless: bool,
}

/// All that a module follows.
#[derive(Default)]
pub(crate) struct Following {
    list: Vec<Follow>,
    timer: Option<(TimerFd, Watch)>,
    has_newest: bool,
}

impl Following {
    /// Follows an item of a module; which one it is.
    pub(crate) fn follow(
        &mut self,
        context: &mut Context,
        module: &str,
        item: &str,
        rate: FollowRate,
    ) -> Result<usize, NativeError> {
        let from = context.publisher(module)?;
        if rate == FollowRate::Newest && !self.has_newest {
            open_newest(context)?;
            self.has_newest = true;
        }
        let request = DescriptionRequest::default();
        let (module, item) = (module.to_owned(), item.to_owned());
        let mut follow = Follow { from, module, item, rate, request, found: None, is_hopeless: false };
        follow.look(context)?;
        self.list.push(follow);
        if let Err(error) = self.keep_time(context) {
            self.list.pop();
            return Err(error);
        }
        Ok(self.list.len() - 1)
    }

    /// Looks for modules that have not described themselves; whether the descriptor was this one's.
    pub(crate) fn ready(&mut self, context: &mut Context, watch: Watch) -> Result<bool, NativeError> {
        let Some((timer, _)) = self.timer.as_ref().filter(|(_, own)| *own == watch) else { return Ok(false) };
        timer.wait().map_err(|errno| failed("a timer", errno.into()))?;
        self.look(context)?;
        Ok(true)
    }

    fn look(&mut self, context: &mut Context) -> Result<(), NativeError> {
        for follow in &mut self.list {
            // The others are none the worse for it.
            if let Err(error) = follow.look(context) {
                follow.give_up(&error);
            }
        }
        self.keep_time(context)
    }

    /// Has the timer run as long as it is needed.
    fn keep_time(&mut self, context: &mut Context) -> Result<(), NativeError> {
        let is_waiting = self.list.iter().any(Follow::is_waiting);
        match &self.timer {
            None if is_waiting => self.timer = Some(started(context).map_err(|error| failed("a timer", error))?),
            Some((_, watch)) if !is_waiting => {
                context.unwatch(*watch);
                self.timer = None;
            }
            _ => {}
        }
        Ok(())
    }

    /// To which of them data belong.
    pub(crate) fn of<'a>(&self, data: &Received<'a>) -> Option<FollowedData<'a>> {
        let (follow, (_, item)) = self.list.iter().enumerate().find_map(|(at, follow)| {
            let found = follow.found.as_ref()?;
            let is_its = match &found.0 {
                Way::Data(subscription) => data.is_of(subscription),
                Way::Records(subscription) => data.is_of(subscription),
            };
            is_its.then_some((at, found))
        })?;
        Some(FollowedData {
            follow,
            item: item.clone(),
            value: data.value,
            place: data.place(),
            stamp_ns: data.head.stamp_ns,
            moment: data.moment(),
            sequence: data.head.sequence,
            missed: data.head.missed,
        })
    }
}

impl Follow {
    fn is_waiting(&self) -> bool {
        self.found.is_none() && !self.is_hopeless
    }

    fn look(&mut self, context: &mut Context) -> Result<(), NativeError> {
        if !self.is_waiting() {
            return Ok(());
        }
        let Some(description) = self.description(context) else { return Ok(()) };
        match item_of(&description, &self.module, &self.item, self.rate == FollowRate::Records) {
            Ok(item) => self.found = Some((self.subscribe(context, &item, description.hash())?, Rc::new(item))),
            // A module that is replaced by another is found by its subscribers when they begin anew.
            Err(error) => self.give_up(&error),
        }
        Ok(())
    }

    fn give_up(&mut self, error: &NativeError) {
        tracing::error!("{error}");
        self.is_hopeless = true;
    }

    fn description(&mut self, context: &Context) -> Option<Description> {
        let own = context.installation().node_of(context.me());
        let its = context.installation().node_of(self.from);
        match its.is_some() && its == own {
            true => noted(context.link().borrow().participant().node(), self.from),
            false => self.request.poll(context, self.from),
        }
    }

    fn subscribe(&self, context: &mut Context, item: &DataItem, interface: u32) -> Result<Way, NativeError> {
        let (mailbox, rate) = match self.rate {
            FollowRate::Records => {
                return Ok(Way::Records(context.subscribe_stream_untyped(self.from, item, interface)?));
            }
            FollowRate::Each => (local::DATA, Rate::Each),
            FollowRate::Every(period) => (local::DATA, Rate::Every(period)),
            FollowRate::Newest => (NEWEST, Rate::Each),
        };
        Ok(Way::Data(context.subscribe_untyped(mailbox, self.from, item.number, interface, rate)?))
    }
}

/// An item of a module's description by its name.
pub(crate) fn item_of(
    description: &Description,
    module: &str,
    item: &str,
    as_stream: bool,
) -> Result<DataItem, NativeError> {
    let (module, name) = (module.to_owned(), item.to_owned());
    let Some(found) = description.data_item(item) else {
        let names: Vec<&str> = description.data.iter().map(|item| item.field.name.as_str()).collect();
        let known = if names.is_empty() { "none".into() } else { names.join(", ") };
        return Err(NativeError::NoItem { module, item: name, known });
    };
    match found.kind {
        DataKind::Data if as_stream => Err(NativeError::NoStream { module, item: name }),
        _ => Ok(found.clone()),
    }
}

/// A mailbox as that for data is, but for what happens when something newer comes.
fn open_newest(context: &mut Context) -> Result<(), NativeError> {
    let configured = context.installation().module(context.me()).map(|module| module.mailboxes.data);
    let mut shape = Shape { full: OverflowPolicy::Latest, ..Shape::default() };
    if let Some(spec) = configured {
        shape.slots = spec.slots;
        shape.body_bytes_max = u16::try_from(spec.size).unwrap_or(u16::MAX);
        (shape.max_age, shape.claims) = (spec.max_age, spec.claims);
    }
    let opened = context.open_mailbox(NEWEST, shape);
    opened.map_err(|error| failed("a mailbox for the newest data", io::Error::other(error)))
}

fn started(context: &mut Context) -> io::Result<(TimerFd, Watch)> {
    let timer = TimerFd::new(ClockId::CLOCK_MONOTONIC, TimerFlags::TFD_CLOEXEC)?;
    timer.set(Expiration::Interval(TimeSpec::milliseconds(LOOK_MS)), TimerSetTimeFlags::empty())?;
    let watch = context.watch(&timer, Interest::Read)?;
    Ok((timer, watch))
}

fn failed(what: &'static str, error: io::Error) -> NativeError {
    NativeError::System(what, error)
}
