//! What a demo with a killed router says of it: how long the router was away, and what was lost by that.

use rohrpost_routers::inbound::SOCKET_MAX_NS;
use rohrpost_testbed::stalls::Late;
use std::collections::BTreeMap;
use std::panic::catch_unwind;
use std::time::{Duration, Instant};

/// The cycle of the configuration.
pub(super) const CYCLE: Duration = Duration::from_millis(5);
/// A master that stands still for so long is replaced.
pub(super) const REPLACED: Duration = CYCLE.saturating_mul(3);
/// The shortest time that a caller gives a call: the pilot's to its motor.
const CALL: Duration = Duration::from_millis(200);
/// The pilot sends its motor a call no more often.
const CALL_EACH: Duration = Duration::from_millis(90);
/// Data that waited longer in the kernel for an absent router are not delivered; so it is to be there again before.
const DATA: Duration = Duration::from_nanos(SOCKET_MAX_NS);

/// Losses that modules have counted so far: the module that counts, the other one, and whether they are data.
pub(super) type Before = BTreeMap<(String, String, bool), u64>;

/// A router that was killed.
pub(super) struct Kill {
    /// It was found to be the master,
    pub(super) looked: Instant,
    /// it ran for the last time,
    pub(super) ran: Instant,
    /// it was dead,
    pub(super) dead: Instant,
    /// and all was settled again.
    pub(super) settled: Instant,
    /// Slots that one node left out from its death until then, at most.
    pub(super) left_out: u64,
    /// How long what brings it back had no processor meanwhile.
    pub(super) waited: Duration,
}

impl Kill {
    /// What a computer that stood still for `by` explains, between the death and `until`.
    pub(super) fn late(&self, what: String, until: Instant, by: Duration) -> Late {
        Late { what, since: self.ran, until, by }
    }
}

/// How long each router was away, as the demo says. One that was away for longer than data wait is late, unless that is
/// how long it, and what brings it back, waited for a processor.
fn check_away(said: &str, kills: &[Kill]) -> Result<Vec<Duration>, Late> {
    let away = away(said);
    assert_eq!(away.len(), kills.len(), "{said}");
    for (kill, away) in kills.iter().zip(&away) {
        let beyond = away.saturating_sub(DATA + kill.waited);
        if !beyond.is_zero() {
            let waited = kill.waited;
            let what = format!("a router was away for {away:?}, {DATA:?} at most and {waited:?} without a processor");
            return Err(kill.late(what, kill.dead + *away, beyond));
        }
    }
    Ok(away)
}

/// What came of the declared flows of a demo.
///
/// A package that found no router, or no slot, for longer than it may wait is lost: a call of the first moments of a
/// death, if the router was away for longer than a call takes; they are no more than begin in that time. In slots that
/// were left out more are lost: by a computer that stood still, or by mistake. Nothing else may be lost, but for what a
/// router had taken for a slot when it died: it holds that for less than a thousandth of the time. Losses that were
/// counted before the first death are `before`.
pub(super) fn check_losses(said: &str, kills: &[Kill], before: &Before) -> Result<(), Late> {
    let away = check_away(said, kills)?;
    let gap = |(kill, away): (&Kill, &Duration)| *away + CYCLE * kill.left_out as u32;
    let (worst, gap) = kills.iter().zip(&away).map(|both| (both.0, gap(both))).max_by_key(|(_, gap)| *gap).unwrap();
    let mut unexplained = 0;
    for Loss { row, lost, is_data, .. } in losses(said) {
        let limit = if is_data { DATA } else { CALL };
        let beyond = away.iter().filter_map(|away| away.checked_sub(limit)).filter(|beyond| !beyond.is_zero());
        let by_absence: u64 = beyond.map(|beyond| 1 + (beyond.as_nanos() / CALL_EACH.as_nanos()) as u64).sum();
        let earlier = before.get(&counted_by(row)).copied().unwrap_or(0);
        let more = lost.saturating_sub(earlier + by_absence);
        if more > 0 && gap > limit && worst.left_out > 0 {
            let what = format!("{} slots were left out, {away:?} without a router; {lost} lost: {row}", worst.left_out);
            return Err(worst.late(what, worst.settled, REPLACED));
        }
        unexplained += more;
    }
    let most = kills.len() as u64 / 20;
    assert!(unexplained <= most, "{unexplained} lost by {} kills, nothing for {gap:?}:\n{said}", kills.len());
    Ok(())
}

/// Packages sealed to the dead incarnation are lost, and nothing can be sealed to the next before it has joined: of
/// each flow a second of eight, and for as long as the demo reports that there was no router. In slots that were left
/// out more are lost: by a computer that stood still, or by mistake.
pub(super) fn check_lost_of_sealed(said: &str, kill: &Kill) -> Result<(), Late> {
    let away = check_away(said, std::slice::from_ref(kill))?[0];
    for Loss { row, packages, lost, .. } in losses(said) {
        let most = |gap| packages as f64 * (Duration::from_secs(1) + gap).as_secs_f64() / 8.0;
        if lost as f64 <= most(away) {
            continue;
        }
        let with_slots = most(away + CYCLE * kill.left_out as u32);
        assert!(lost as f64 <= with_slots, "{lost} of {packages} lost, {with_slots:.1} at most: {row}\n{said}");
        let what = format!("{} slots were left out, {away:?} without a router; {lost} lost: {row}", kill.left_out);
        return Err(kill.late(what, kill.settled, REPLACED));
    }
    Ok(())
}

/// Slots that one node left out since then, at most. Its router began to count anew on the node `dead`.
pub(super) fn most_left_out(mut before: [u64; 3], dead: usize, after: [u64; 3]) -> u64 {
    before[dead] = 0;
    before.iter().zip(after).map(|(before, after)| after.saturating_sub(*before)).max().unwrap_or(0)
}

/// How long each router was away that died.
fn away(said: &str) -> Vec<Duration> {
    let words = said.split("); there again ").skip(1);
    words.map(|words| duration(words.split(" later").next().unwrap())).collect()
}

/// As the demo writes it.
fn duration(text: &str) -> Duration {
    let (number, unit) = text.split_once(' ').unwrap_or_else(|| panic!("{text}"));
    let unit = match unit {
        "µs" => 1e-6,
        "ms" => 1e-3,
        "s" => 1.0,
        _ => panic!("{text}"),
    };
    Duration::from_secs_f64(number.parse::<f64>().unwrap() * unit)
}

/// The module that counts a row of the table of losses, of which other one: the caller, or the receiver of data.
fn counted_by(row: &str) -> (String, String, bool) {
    let words: Vec<&str> = row.split_whitespace().collect();
    let [from, _, to, what, ..] = words[..] else { panic!("{row}") };
    let (by, of) = if what == "commands" { (from, to) } else { (to, from) };
    (by.into(), of.into(), what == "data")
}

/// A row of the table of losses from end to end.
struct Loss<'a> {
    row: &'a str,
    packages: u64,
    lost: u64,
    is_data: bool,
}

fn losses(said: &str) -> Vec<Loss<'_>> {
    let flows = said.split("from end to end").nth(1).unwrap_or_else(|| panic!("no flows:\n{said}"));
    let rows: Vec<&str> = flows.lines().skip(3).take_while(|line| !line.is_empty()).collect();
    assert!(rows.iter().any(|row| row.starts_with("laser.0 → pilot.0") && row.contains("data")), "{said}");
    assert!(rows.iter().any(|row| row.starts_with("pilot.0 → motor.0") && row.contains("commands")), "{said}");
    let loss = |row| {
        let words: Vec<&str> = str::split_whitespace(row).collect();
        let [.., packages, _, _, lost] = words[..] else { panic!("{row}") };
        let [packages, lost] = [packages, lost].map(|count| count.parse().unwrap());
        Loss { row, packages, lost, is_data: words.contains(&"data") }
    };
    rows.into_iter().map(loss).collect()
}

/// The end of a demo with a kill, after which the router was away for so long; so many commands were lost, and data.
fn sample(away: &str, commands: u64, data: u64) -> String {
    format!(
        "The router of base died 3.0 s after the beginning (process 7, killed on purpose); there again {away} later \
         (process 8).\n\nDeclared flows from end to end\n\n\
         flow                   what       packages  sent again  too late  lost\n\
         laser.0 → pilot.0      data scan        62           -         -  {data}\n\
         pilot.0 → motor.0      commands         63           0         0  {commands}\n\n"
    )
}

#[test]
fn a_loss_that_nothing_explains_is_found_however_many_slots_were_left_out() {
    let (now, ms) = (Instant::now(), Duration::from_millis);
    let kill_after =
        |left_out, waited| Kill { looked: now, ran: now, dead: now + ms(1), settled: now + ms(2000), left_out, waited };
    let kill = |left_out| kill_after(left_out, ms(0));
    let check = |away, commands, data, left_out| {
        let said = sample(away, commands, data);
        let late = |late: Late| (late.by, late.until - late.since);
        catch_unwind(|| check_losses(&said, &[kill(left_out)], &Before::new()).map_err(late)).map_err(drop)
    };
    assert_eq!(check("44 ms", 0, 0, 1000), Ok(Ok(())));
    assert_eq!(check("44 ms", 1, 0, 31), Err(()), "it was repeated in time");
    assert_eq!(check("250 ms", 1, 0, 0), Ok(Ok(())), "no router for longer than a call takes");
    assert_eq!(check("250 ms", 0, 1, 0), Err(()), "data wait for longer than that");
    let slots = (REPLACED, ms(2000));
    assert_eq!(check("250 ms", 2, 0, 0), Err(()), "so many calls do not begin in 50 ms");
    assert_eq!(check("250 ms", 2, 0, 1), Ok(Err(slots)));
    assert_eq!(check("300 ms", 2, 0, 0), Ok(Ok(())));
    assert_eq!(check("400 ms", 0, 0, 0), Ok(Ok(())));
    assert_eq!(check("450 ms", 0, 0, 0), Ok(Err((ms(50), ms(451)))), "a restart that takes too long fails by itself");
    let waited = |ms_waited| check_losses(&sample("450 ms", 0, 0), &[kill_after(0, ms(ms_waited))], &Before::new());
    assert_eq!([49, 50].map(|ms_waited| waited(ms_waited).map_err(|late| late.by)), [Err(ms(1)), Ok(())]);
    assert_eq!(check("44 ms", 1, 0, 40), Ok(Err(slots)), "a stall has to explain the slots");
    assert_eq!(check("44 ms", 0, 1, 80), Ok(Err(slots)));
    let before = Before::from([(("pilot.0".into(), "motor.0".into(), false), 1)]);
    assert_eq!(check_losses(&sample("44 ms", 1, 0), &[kill(0)], &before), Ok(()), "not by the kill");
    let sealed = |away, lost, left_out| {
        catch_unwind(|| check_lost_of_sealed(&sample(away, lost, 0), &kill(left_out)).is_ok()).ok()
    };
    let of_eight = [0, 8, 9].map(|lost| sealed("44 ms", lost, 0));
    assert_eq!(of_eight, [Some(true), Some(true), None], "a second of eight");
    assert_eq!(
        [8, 9, 13].map(|lost| sealed("44 ms", lost, 100)),
        [Some(true), Some(false), None],
        "slots need a stall"
    );
    assert_eq!(sealed("450 ms", 0, 0), Some(false), "also with sealing");
    assert_eq!(most_left_out([7, 900, 5], 1, [9, 3, 6]), 3, "the next incarnation counts anew");
}
