//! The demo's simulation is killed again and again: readers of its streams go on by themselves, and each accounts for
//! all that was written.

use crate::harness::{PATIENCE, Place, Robot, json_lines, signal, times, until, wait};
use crate::process::Running;
use nix::sys::signal::Signal;
use rohrpost::Name;
use rohrpost::description::noted;
use rohrpost::schema::{DataItem, decode};
use rohrpost_mailbox::{HeldRecord, Next, Participant, RecordInfo, StreamId, StreamInfo, StreamReader};
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

const DEMO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo.toml");
const MAP: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/building.map");
/// The stream of pictures keeps one record less: a reader that comes after so many has lost some.
const RECORDS_BETWEEN_KILLS: usize = 9;

/// The demo without its GUI, with a simulation that is never given up. The mapper begins before the simulation: so it
/// accounts for each record that is ever written.
fn demo(place: &Place) -> PathBuf {
    let mut demo: toml::Table = toml::from_str(&std::fs::read_to_string(DEMO).unwrap()).unwrap();
    demo.remove("gui").unwrap();
    demo.insert("scheduling".into(), toml::toml! { real-time-from = 256 }.into());
    let modules = demo["module"].as_array_mut().unwrap();
    let is = |module: &toml::Value, name: &str| module["name"].as_str() == Some(name);
    modules.retain(|module| !is(module, "gui.0"));
    modules.sort_by_key(|module| (!is(module, "output.0"), !is(module, "mapper.0")));
    let sim = modules.iter_mut().find(|module| is(module, "motor.0")).unwrap().as_table_mut().unwrap();
    sim["settings"]["map"] = MAP.into();
    let restart = toml::toml! {
        backoff = "50 ms"
        at-most = 1000
        within = "50 ms"
    };
    sim.insert("restart".into(), restart.into());
    place.write("demo.toml", toml::to_string(&demo).unwrap())
}

/// A stream, and what its readers in this test have seen of it.
struct ObservedStream {
    module: &'static str,
    id: StreamId,
    /// What the description of its module says of it.
    item: DataItem,
    /// Of each record: what is said of it, and the hash of its bytes.
    records: BTreeMap<u64, (RecordInfo, u64)>,
}

impl ObservedStream {
    /// The one stream of a module.
    fn of(robot: &Robot, module: &'static str) -> Self {
        let name = robot.name(module);
        let item = noted(&robot.node, name).unwrap().streams().next().unwrap().clone();
        Self { module, id: StreamId { name, number: item.number }, item, records: BTreeMap::new() }
    }

    fn info(&self, robot: &Robot) -> StreamInfo {
        robot.node.inspect_stream(self.id).unwrap().unwrap()
    }

    /// A record is whole, and the same whenever and by whichever reader it is read.
    fn check(&mut self, record: &HeldRecord<'_>) {
        let (module, info, body) = (self.module, record.info(), record.body());
        if let Err(error) = decode(&self.item.field.ty, body) {
            panic!("{module}: {info:?} is not what the description says: {error}");
        }
        let mut hasher = DefaultHasher::new();
        body.hash(&mut hasher);
        let seen = (info, hasher.finish());
        assert_eq!(*self.records.entry(info.sequence).or_insert(seen), seen, "{module}");
        let (first, _) = self.records.first_key_value().unwrap().1;
        assert_eq!(info.len_bytes, first.len_bytes, "all values of {module} have one size: {info:?}");
    }
}

/// A reader in this test, which is never made anew.
struct StreamFollower {
    reader: StreamReader,
    /// Its position at first.
    began: u64,
    /// The last record.
    last: Option<RecordInfo>,
    /// Incarnations of the writer so far.
    incarnations: u32,
}

impl StreamFollower {
    fn new(stream: &ObservedStream, participant: &Arc<Participant>) -> Self {
        let reader = participant.stream_reader(stream.id).unwrap();
        let began = reader.position();
        Self { reader, began, last: None, incarnations: 0 }
    }

    /// The next record, or how many were lost; false when nothing comes.
    fn step(&mut self, stream: &mut ObservedStream, timeout: Duration) -> bool {
        let (module, at) = (stream.module, self.reader.position());
        let came = match self.reader.next_timeout(timeout).unwrap() {
            Next::Nothing => return false,
            Next::Lost(lost) => lost,
            Next::Record(record) => {
                stream.check(&record);
                let info = record.info();
                assert_eq!(info.sequence, at, "{module}: no record is left out");
                let is_after = |last: RecordInfo| {
                    let [last, now] = [last, info].map(|of| (of.incarnation, of.written_ns, of.stamp));
                    last.0 <= now.0 && last.1 <= now.1 && last.2 <= now.2
                };
                assert!(self.last.is_none_or(is_after), "{module}: {info:?} after {:?}", self.last);
                self.incarnations += u32::from(self.last.is_none_or(|last| last.incarnation != info.incarnation));
                self.last = Some(info);
                1
            }
        };
        assert!(came > 0 && self.reader.position() == at + came, "{module}: {came} from {at} on");
        let (read, lost) = self.reader.accounts();
        assert_eq!(read + lost, self.reader.position() - self.began, "{module}: {read} read, {lost} lost");
        true
    }

    /// The writer's, of the last record.
    fn incarnation(&self) -> Option<u32> {
        self.last.map(|last| last.incarnation)
    }

    /// Until so many records of the next incarnation have come; sleeps in between.
    fn read_next_incarnation(&mut self, stream: &mut ObservedStream) {
        let (before, mut came, start) = (self.incarnation(), 0, Instant::now());
        while came < RECORDS_BETWEEN_KILLS {
            let last = self.last;
            assert!(self.step(stream, PATIENCE), "{}: nothing comes after {last:?}", stream.module);
            assert!(start.elapsed() < PATIENCE, "{}: no other incarnation than of {last:?}", stream.module);
            came += usize::from(self.last != last && self.incarnation() != before);
        }
    }

    /// Until nothing is left.
    fn read_rest(&mut self, stream: &mut ObservedStream) {
        while self.step(stream, Duration::ZERO) {}
    }
}

/// All readers in this test, of a simulation that runs.
struct Readers {
    /// Of pictures the ring is the shortest, so they are read first.
    streams: [ObservedStream; 3],
    /// One of each stream, which reads on all the time.
    followers: [StreamFollower; 3],
    /// Reads pictures only when all others have read.
    late: StreamFollower,
}

impl Readers {
    fn new(robot: &Robot, participant: &Arc<Participant>) -> Self {
        let streams = ["camera.0", "laser.0", "odometry.0"].map(|module| ObservedStream::of(robot, module));
        let new = |stream: &ObservedStream| StreamFollower::new(stream, participant);
        Self { followers: streams.each_ref().map(new), late: new(&streams[0]), streams }
    }

    /// Each goes on with the next incarnation of the simulation; then there were so many.
    fn read_next_incarnation(&mut self, incarnations: u32) {
        let Self { streams, followers, late } = self;
        for (stream, follower) in streams.iter_mut().zip(&mut *followers) {
            follower.read_next_incarnation(stream);
            assert_eq!(follower.incarnations, incarnations, "{}", stream.module);
        }
        let (_, lost_before) = late.reader.accounts();
        late.read_rest(&mut streams[0]);
        let (_, lost) = late.reader.accounts();
        assert!(incarnations == 1 || lost > lost_before, "as many were written as the ring keeps, and one more");
        assert_eq!(late.incarnations, incarnations, "each time it comes to the newest");
    }

    /// Nobody writes any more: each comes to the end, and accounts for all.
    fn read_rest(&mut self, robot: &Robot, kills: u32) {
        let Self { streams, followers, late } = self;
        for (index, follower) in [0, 1, 2, 0].into_iter().zip(followers.iter_mut().chain([late])) {
            let stream = &mut streams[index];
            follower.read_rest(stream);
            let StreamInfo { written, adoptions, refused, .. } = stream.info(robot);
            let (read, lost) = follower.reader.accounts();
            assert_eq!(read + lost, written - follower.began, "{}: {read} read, {lost} lost", stream.module);
            assert_eq!((adoptions, refused), (kills, 0), "{}", stream.module);
        }
    }

    /// Seats in use, of each stream.
    fn seats(&self, robot: &Robot) -> [u16; 3] {
        self.streams.each_ref().map(|stream| stream.info(robot).readers)
    }
}

/// Waits until the mapper publishes the pose of a scan of this time or later.
fn wait_mapped(place: &Place, stamp_ns: u64) {
    wait("the mapper maps scans of the new incarnation", || {
        let pose = place.say(&["echo", "mapper.0", "pose", "--count", "1", "--json"]).json();
        pose["time_ns"].as_u64().filter(|time_ns| *time_ns >= stamp_ns)
    });
}

/// Scans that came to the mapper, or that it was told it lost.
fn mapper_accounts(robot: &Robot) -> u64 {
    let mut tool = robot.tool(PATIENCE);
    let exchanges = tool.exchange(robot.name("mapper.0")).unwrap();
    tool.close();
    let scans = exchanges.iter().find(|exchange| exchange.module == "laser.0" && exchange.data.is_some()).unwrap();
    scans.packages + scans.lost
}

/// A tool that reads odometry from its first record on.
fn start_tool(place: &Place) -> Running {
    let words = ["stream", "read", "odometry.0", "odometry", "--from", "0", "--next", "1000000", "--json"];
    place.start(&words)
}

/// Ends the tool once it has come to the end; what it printed is what this test has seen.
fn check_tool(tool: Running, odometry: &ObservedStream, written: u64) {
    wait("the tool comes to the end", || {
        let out = tool.out();
        let (whole, _) = out.rsplit_once('\n')?;
        json_lines(whole.lines().last()?)[0]["sequence"].as_u64().filter(|sequence| sequence + 1 == written)
    });
    tool.signal(Signal::SIGINT);
    let mut at = 0;
    for object in json_lines(&tool.said().ok()) {
        if let [Some(lost), Some(sampled), Some(passed_over)] =
            ["lost", "sampled", "passed_over"].map(|cause| object[cause].as_u64())
        {
            at += lost + sampled + passed_over;
            continue;
        }
        assert_eq!(object["sequence"], at, "no record is left out");
        assert!(object["value"]["pose"]["x_m"].is_number(), "{object}");
        if let Some((info, _)) = odometry.records.get(&at) {
            let told = (&object["stamp_ns"], &object["len_bytes"]);
            assert_eq!(told, (&info.stamp.ns.into(), &info.len_bytes.into()), "{info:?}");
        }
        at += 1;
    }
    assert_eq!(at, written, "read and lost are what was written");
}

/// The value of a short time ago lies between two records, both of the last incarnation.
fn check_value_at_a_time(place: &Place, odometry: &mut ObservedStream, follower: &mut StreamFollower) {
    let found = place.say(&["stream", "interp", "odometry.0", "odometry", "--at", "-0.2s", "--json"]).json();
    follower.read_rest(odometry);
    let [before, after] = ["before", "after"].map(|side| {
        let (info, _) = odometry.records[&found[side]["sequence"].as_u64().unwrap()];
        assert_eq!((&found[side]["stamp_ns"], follower.incarnation()), (&info.stamp.ns.into(), Some(info.incarnation)));
        info
    });
    assert!(after.sequence - before.sequence <= 1, "{found:#}");
    let at_ns = found["stamp_ns"].as_u64().unwrap();
    assert!((before.stamp.ns..=after.stamp.ns).contains(&at_ns), "{found:#}");
    assert!(found["value"]["pose"]["x_m"].is_number(), "{found:#}");
}

#[test]
fn a_simulation_that_is_killed_again_and_again_loses_no_reader_and_each_record_is_accounted_for() {
    let place = Place::new();
    let config = demo(&place);
    let (mut launch, robot) = place.launched_from(&config);
    let participant = Participant::join(&robot.node, Name::NONE).unwrap();
    let mut readers = Readers::new(&robot, &participant);
    let [mut holder, mut keeper] = [(); 2].map(|()| participant.stream_reader(readers.streams[0].id).unwrap());
    let mut tool = start_tool(&place);
    // Those of this test; the mapper looks at scans and odometry, the tool at odometry.
    let seats = [4, 2, 3];
    until("the tool has its seat", || readers.seats(&robot) == seats);
    let others = || ["mapper.0", "pilot.0", "output.0"].map(|module| robot.pid(module));
    let pids = others();
    readers.read_next_incarnation(1);
    // Held until the end, the other over one kill each.
    let kept = keeper.newest().unwrap().unwrap();
    readers.streams[0].check(&kept);
    // For a long run: `ROHRPOST_KILLS=100 cargo test -p rohrpost-cli --test e2e streams_killed`.
    let kills = times("ROHRPOST_KILLS", 10);
    for kill in 1..=kills {
        let held = holder.newest().unwrap().unwrap();
        readers.streams[0].check(&held);
        let sim = robot.pid("motor.0");
        // Each time at another moment of its period, which is 50 ms.
        std::thread::sleep(Duration::from_millis(u64::from(kill) * 7 % 50));
        signal(sim, Signal::SIGKILL);
        assert_eq!(robot.wait_restarted("motor.0", sim).restarts, kill, "its successor takes over at once");
        readers.read_next_incarnation(kill + 1);
        [&held, &kept].into_iter().for_each(|record| readers.streams[0].check(record));
        wait_mapped(&place, readers.followers[1].last.unwrap().stamp.ns);
        tool.assert_runs();
        assert_eq!((others(), readers.seats(&robot)), (pids, seats), "nobody else is started again");
    }
    check_value_at_a_time(&place, &mut readers.streams[2], &mut readers.followers[2]);
    place.say(&["stop", "motor.0"]).ok();
    readers.read_rest(&robot, kills);
    let [_, scans, odometry] = readers.streams.each_ref().map(|stream| stream.info(&robot).written);
    until("the mapper has come to all scans", || mapper_accounts(&robot) >= scans);
    assert_eq!(mapper_accounts(&robot), scans, "read and lost are what was written");
    check_tool(tool, &readers.streams[2], odometry);
    drop(kept);
    drop((holder, keeper, readers, participant, robot));
    let out = launch.stop();
    assert!(!out.contains("is written by"), "no successor finds another writer: {out}");
    place.assert_empty();
}
