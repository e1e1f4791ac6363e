//! start
mod cases;
use cases::{many::Many, startup::*};
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let main_ns = rohrpost_mailbox::monotonic_ns();
    let args: Vec<String> = std::env::args().skip(1).collect();
    if args.first().is_some_and(|a| a == ROLE) {
        return program(&args[1..], main_ns);
    }
    let q = |v: &mut Vec<u64>, p: f64| {
        v.sort_unstable();
        v[(v.len() as f64 * p) as usize] as f64 / 1e3
    };
    let runs: usize = args.get(1).map_or(51, |x| x.parse().unwrap_or(51));
    {
        let mut set: nix::sched::CpuSet = nix::sched::CpuSet::new();
        set.set(0)?;
        let h = std::thread::scope(|s| {
            s.spawn(move || -> Result<(), String> {
                if std::env::var_os("FIFO").is_some() {
                    nix::sched::sched_setaffinity(nix::unistd::Pid::from_raw(0), &set).map_err(|e| e.to_string())?;
                    unsafe {
                        libc::sched_setscheduler(0, libc::SCHED_FIFO, &libc::sched_param { sched_priority: 50 });
                    }
                }
                let mut grounds: [(&str, Box<dyn Ground>); 2] = [
                    ("mailbox", Box::new(Mailboxes::new().map_err(|e| e.to_string())?)),
                    ("mq", Box::new(Queues::new().map_err(|e| e.to_string())?)),
                ];
                for start in Start::ALL {
                    let mut v = vec![vec![]; 4];
                    for _ in 0..runs {
                        for (i, (_, g)) in grounds.iter_mut().enumerate() {
                            let s = g.start(start).map_err(|e| e.to_string())?;
                            v[i].push(s.from_exec_ns);
                            v[i + 2].push(s.from_main_ns);
                        }
                    }
                    for (i, w) in ["exec", "main"].iter().enumerate() {
                        for (j, (n, _)) in grounds.iter().enumerate() {
                            let x = &mut v[2 * i + j];
                            println!("{} from {w}: {n} p50 {:.1} us p99 {:.1}", start.name(), q(x, 0.5), q(x, 0.99));
                        }
                    }
                }
                Ok(())
            })
            .join()
        });
        if let Ok(r) = h {
            r?;
        }
    }
    let mut many = Many::new(1000)?;
    let mut v = many.first_sends_ns()?;
    println!(
        "1000: open+first send p50 {:.1} us p99 {:.1} max {:.1}",
        q(&mut v, 0.5),
        q(&mut v, 0.99),
        q(&mut v, 0.9999)
    );
    let mut v: Vec<u64> = (0..20).map(|_| many.survey_ns()).collect::<Result<_, _>>()?;
    println!("survey p50 {:.1} us max {:.1}", q(&mut v, 0.5), q(&mut v, 0.99));
    if let Some(r) = args.first() {
        let mut v: Vec<u64> = (0..10).map(|_| many.list_ns(r.as_ref())).collect::<Result<_, _>>()?;
        println!("list p50 {:.1} us max {:.1}", q(&mut v, 0.5), q(&mut v, 0.99));
    }
    Ok(())
}
