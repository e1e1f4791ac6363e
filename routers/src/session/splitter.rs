//! Cuts a stream of bytes into frames, wherever it is split. Memory grows with what came, never with what a head
//! promises.

use super::frame::{BadSessionFrame, HEAD_BYTES, SessionFrameHead, is_tls};

/// One direction of one connection.
#[derive(Debug, Default)]
pub(super) struct Splitter {
    /// A frame that came in pieces, as far as it is there.
    partial: Vec<u8>,
    /// It was handed out.
    is_done: bool,
    /// When its first byte came, ns.
    began_ns: u64,
}

impl Splitter {
    /// The next whole frame of what is kept and then of `input`, from which it is taken. None: all is taken, and none
    /// is whole.
    pub(super) fn next<'a, 'b: 'a>(
        &'a mut self,
        now_ns: u64,
        length_max: usize,
        input: &mut &'b [u8],
    ) -> Result<Option<(SessionFrameHead, &'a [u8])>, BadSessionFrame> {
        if self.is_done {
            self.is_done = false;
            // What one large frame took is not kept for ever.
            self.partial = Vec::new();
        }
        if self.partial.is_empty() {
            if let Some((head, frame, rest)) = whole(input, length_max)? {
                *input = rest;
                return Ok(Some((head, frame)));
            }
            if !input.is_empty() {
                self.began_ns = now_ns;
                self.partial.extend_from_slice(std::mem::take(input));
            }
            return Ok(None);
        }
        self.take(HEAD_BYTES, input);
        let Some(bytes) = self.partial.first_chunk() else { return Ok(None) };
        let head = SessionFrameHead::parse(bytes, length_max)?;
        self.take(HEAD_BYTES + head.length, input);
        self.is_done = self.partial.len() == HEAD_BYTES + head.length;
        Ok(self.is_done.then(|| (head, &self.partial[HEAD_BYTES..])))
    }

    /// When the frame began that is not whole yet, ns.
    pub(super) fn waits_since(&self) -> Option<u64> {
        (!self.partial.is_empty() && !self.is_done).then_some(self.began_ns)
    }

    /// Whether what came last, less than a head, began as TLS does: what its other end says before it closes is that
    /// short.
    pub(super) fn hears_tls(&self) -> bool {
        !self.is_done && is_tls(&self.partial)
    }

    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        self.partial.capacity()
    }

    /// Moves bytes over until so many are here.
    fn take(&mut self, up_to: usize, input: &mut &[u8]) {
        let count = up_to.saturating_sub(self.partial.len()).min(input.len());
        let (now, rest) = input.split_at(count);
        self.partial.extend_from_slice(now);
        *input = rest;
    }
}

type CompleteFrame<'a> = (SessionFrameHead, &'a [u8], &'a [u8]);

fn whole(input: &[u8], length_max: usize) -> Result<Option<CompleteFrame<'_>>, BadSessionFrame> {
    let Some((head, rest)) = input.split_first_chunk::<HEAD_BYTES>() else { return Ok(None) };
    let head = SessionFrameHead::parse(head, length_max)?;
    Ok(rest.split_at_checked(head.length).map(|(frame, rest)| (head, frame, rest)))
}

#[cfg(test)]
mod tests {
    use super::super::frame::{LENGTH_MAX, SessionMessage};
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_head_that_promises_much_takes_no_memory() {
        let mut splitter = Splitter::default();
        let bytes = [0xff, 0xff, 0, 0, 6, 0, 0, 0, 1, 2, 3];
        assert_eq!(splitter.next(7, LENGTH_MAX, &mut &bytes[..]), Ok(None));
        assert!(splitter.bytes() < 64 && splitter.waits_since() == Some(7));
        let mut splitter = Splitter::default();
        assert_eq!(
            splitter.next(0, 0xfffe, &mut &bytes[..]),
            Err(BadSessionFrame::TooLong(0xffff)),
            "told from the head"
        );
    }

    proptest! {
        #[test]
        fn frames_come_out_however_the_stream_is_split(asked: Vec<u64>, cuts: Vec<proptest::sample::Index>) {
            let mut stream = Vec::new();
            asked.iter().for_each(|asked_ns| SessionMessage::Ask(*asked_ns).write(&mut stream));
            let mut cuts: Vec<usize> = cuts.iter().map(|cut| cut.index(stream.len() + 1)).collect();
            cuts.extend([0, stream.len()]);
            cuts.sort_unstable();
            let (mut splitter, mut found) = (Splitter::default(), Vec::new());
            for piece in cuts.windows(2) {
                let mut input = &stream[piece[0]..piece[1]];
                while let Some((head, rest)) = splitter.next(0, LENGTH_MAX, &mut input).unwrap() {
                    match SessionMessage::parse(head, rest) {
                        Ok(SessionMessage::Ask(asked_ns)) => found.push(asked_ns),
                        other => prop_assert!(false, "{other:?}"),
                    }
                }
                prop_assert!(input.is_empty());
            }
            prop_assert_eq!(found, asked);
            prop_assert_eq!(splitter.waits_since(), None);
        }
    }
}
