//! Bounded queues that keep the latest items: in a full queue, a new item takes the place of the
//! oldest.

use heapless::Deque;

/// Appends `item` to `queue`; if the queue is full, its oldest item is removed first and returned.
pub(crate) fn keep<T, const N: usize>(queue: &mut Deque<T, N>, item: T) -> Option<T> {
    let oldest = if queue.is_full() {
        queue.pop_front()
    } else {
        None
    };
    // There is room now, unless N is 0.
    let _ = queue.push_back(item);
    oldest
}
