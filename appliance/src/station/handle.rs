//! The handle: the one place where the station meets a clock, a mutex and channels.

use std::future::Future;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tokio::sync::watch;
use tokio::time::MissedTickBehavior;

use super::clock::Micros;
use super::control::{ConnectionEdges, ControlWrite, RefusedWrite};
use super::event::{Effect, Event};
use super::machine::Station;
use super::snapshot::Snapshot;
use super::step::step;

/// Carries out effects, in order. Called with the station locked, so it only passes effects on and
/// never waits. An event that it returns is taken before the snapshot is published.
pub type EffectSink = Box<dyn FnMut(Effect) -> Option<Event> + Send>;

struct Guarded {
    station: Station,
    sink: EffectSink,
}

/// Access to the station for the worker, Modbus and the page. Cheap to clone; clones share the
/// station.
#[derive(Clone)]
pub struct StationHandle {
    guarded: Arc<Mutex<Guarded>>,
    snapshots: watch::Sender<Arc<Snapshot>>,
    start: Instant,
}

impl StationHandle {
    /// Takes a station made for `Micros(0)`; the time runs from `start`.
    pub fn new(
        station: Station,
        start: Instant,
        sink: impl FnMut(Effect) -> Option<Event> + Send + 'static,
    ) -> Self {
        let (snapshots, _) = watch::channel(Arc::new(station.snapshot()));
        let guarded = Arc::new(Mutex::new(Guarded {
            station,
            sink: Box::new(sink),
        }));
        Self {
            guarded,
            snapshots,
            start,
        }
    }

    /// Time since the start.
    pub fn now(&self) -> Micros {
        Micros(u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX))
    }

    /// Applies one write of the PLC as a unit and answers with the snapshot after it.
    ///
    /// # Errors
    /// A value is refused (see [`ControlWrite::check`]): then nothing was applied and `edges` are
    /// as before.
    pub fn write(
        &self,
        edges: &mut ConnectionEdges,
        write: ControlWrite,
    ) -> Result<Arc<Snapshot>, RefusedWrite> {
        write.check()?;
        let rising = edges.rise(write.control);
        let client = edges.client();
        Ok(self.event(Event::Write {
            write,
            rising,
            client,
        }))
    }

    /// The latest snapshot.
    pub fn snapshot(&self) -> Arc<Snapshot> {
        self.snapshots.borrow().clone()
    }

    /// Every snapshot from now on, the latest first.
    pub fn subscribe(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.snapshots.subscribe()
    }

    /// Takes an event, carries out its effects, and answers with the snapshot after it.
    pub fn event(&self, event: Event) -> Arc<Snapshot> {
        let mut guarded = self.lock();
        let mut next = Some(event);
        while let Some(event) = next.take() {
            // Read under the lock, so that events are numbered in the order in which they are
            // taken.
            let (station, effects) = step(guarded.station.clone(), event, self.now());
            guarded.station = station;
            for effect in effects {
                // One event stores at most one number, and nothing else is answered.
                next = (guarded.sink)(effect).or(next);
            }
        }
        let snapshot = Arc::new(guarded.station.snapshot());
        self.snapshots.send_replace(snapshot.clone());
        snapshot
    }

    fn lock(&self) -> MutexGuard<'_, Guarded> {
        // After a panic in the sink the station is still consistent: it is stored before its
        // effects are carried out.
        self.guarded.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Lets the station's time pass: a [`Event::Tick`] every 100 ms until `shutdown`.
///
/// `utc_us` answers with the time in µs since 1970 UTC if the clock is synchronised.
pub async fn tick(
    handle: StationHandle,
    utc_us: impl Fn() -> Option<u64>,
    shutdown: impl Future<Output = ()>,
) {
    let mut interval = tokio::time::interval(Duration::from_millis(100));
    interval.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut shutdown = std::pin::pin!(shutdown);
    loop {
        tokio::select! {
            () = &mut shutdown => return,
            _ = interval.tick() => { handle.event(Event::Tick { utc_us: utc_us() }); }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::super::event::Request;
    use super::super::recipes::RecipeKey;
    use super::super::tests::settings;
    use super::*;

    #[tokio::test]
    async fn ticking_moves_the_heartbeat_and_ends_with_its_shutdown() {
        let handle =
            StationHandle::new(Station::new(settings(), Micros(0)), Instant::now(), |_| {
                None
            });
        let mut snapshots = handle.subscribe();
        let (end, ended) = tokio::sync::oneshot::channel::<()>();
        let ticking = tokio::spawn(tick(handle.clone(), || Some(1), async {
            drop(ended.await)
        }));
        let beaten = snapshots
            .wait_for(|snapshot| snapshot.heartbeat >= 2)
            .await
            .unwrap();
        assert!(beaten.at >= Micros::from_millis(200));
        drop(beaten);
        drop(end);
        ticking.await.unwrap();
    }

    #[test]
    fn effects_reach_the_sink_in_order_before_the_write_returns() {
        let (sink, effects) = channel();
        let station = Station::new(settings(), Micros(0));
        let handle = StationHandle::new(station, Instant::now(), move |effect| {
            sink.send(effect).unwrap();
            None
        });
        handle.event(Event::Started);
        let after = handle.event(Event::Request(Request::Load(RecipeKey::Number(3))));
        assert_eq!((after.state, handle.snapshot()), (4, after.clone()));
        assert!(matches!(
            effects.try_recv(),
            Ok(Effect::Load {
                key: RecipeKey::Number(3),
                ..
            })
        ));
    }

    #[test]
    fn a_refused_write_changes_neither_the_station_nor_the_edges() {
        let handle =
            StationHandle::new(Station::new(settings(), Micros(0)), Instant::now(), |_| {
                None
            });
        let mut edges = ConnectionEdges::default();
        let write = ControlWrite {
            control: super::super::Masked::<u16>::all(0x0202),
            ..Default::default()
        };
        let before = handle.snapshot();
        assert_eq!(
            handle.write(&mut edges, write),
            Err(RefusedWrite::ReservedBits(0x0202))
        );
        assert_eq!(
            (edges, handle.snapshot()),
            (ConnectionEdges::default(), before)
        );
    }
}
