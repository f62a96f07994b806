"use strict";
// Frames of a live stream: read from their bytes (shared/marey/streams/frames.py), and delayed a little, so that drawn
// motion is even although frames arrive unevenly.
const MareyFrames = (() => {
  const [MAGIC, VERSION, HEADER, LAST] = [0x4d46, 1, 24, 1 << 4];

  // One frame; `turns` are w x y z of each joint, times 32,767.
  function decode(data, joints) {
    const head = new DataView(data);
    if (data.byteLength < HEADER || head.getUint16(0) !== MAGIC) throw new Error("not a frame of a Marey stream");
    if (head.getUint8(2) !== VERSION) throw new Error(`a frame of version ${head.getUint8(2)}; this page reads ${VERSION}: load it again`);
    const count = head.getUint16(8, true);
    if (count !== joints || data.byteLength !== HEADER + 8 * count) throw new Error(`a frame of ${count} joints and ${data.byteLength} bytes, not of ${joints} joints`);
    const flags = head.getUint8(3);
    return {
      number: head.getUint32(4, true),
      prompt: head.getUint16(10, true),
      contacts: [0, 1, 2, 3].map((bit) => (flags >> bit) & 1),
      last: Boolean(flags & LAST),
      root: new Float32Array(data, 12, 3),
      turns: new Int16Array(data, HEADER, 4 * count),
    };
  }

  const DELAY = 0.25; // s behind the newest frame: five frames may come late or at once
  const FASTEST = 3; // times the stream's rate, when behind
  const SLOWEST = 0.8;
  const LEAP = 5; // s behind beyond which missed frames are skipped
  const STEADY = 0.5; // s over which the lag is averaged; otherwise the speed would jitter with every frame
  const WINDOW = 2; // s over which the arriving frames are counted

  class Buffer {
    // next: the number that the next frame should have.
    constructor(fps, next = 0) {
      Object.assign(this, { fps, next, frames: [], at: null, lag: DELAY, waiting: true, over: false });
      Object.assign(this, { received: 0, gaps: 0, missed: 0, arrivals: [] });
    }

    get newest() {
      return this.frames[this.frames.length - 1];
    }

    // Seconds from what is drawn to the newest frame.
    get buffered() {
      return this.frames.length ? (this.newest.number - this.at) / this.fps : 0;
    }

    // Frames a second over the last two seconds; 0 when none came for one.
    rate(now) {
      this.arrivals = this.arrivals.filter((time) => now - time < WINDOW);
      const [first, last] = [this.arrivals[0], this.arrivals[this.arrivals.length - 1]];
      return this.arrivals.length > 2 && now - last < 1 ? (this.arrivals.length - 1) / (last - first) : 0;
    }

    // These frames will not come.
    gap(first, count) {
      if (first + count <= this.next) return;
      this.gaps += 1;
      this.missed += first + count - this.next;
      this.next = first + count;
    }

    // False for a frame that was here before: a worker that takes a stream over may send some again.
    push(frame, now) {
      if (frame.number < this.next) return false;
      if (frame.number > this.next) this.gap(this.next, frame.number - this.next);
      this.next = frame.number + 1;
      this.received += 1;
      this.over = frame.last;
      this.arrivals.push(now);
      this.frames.push(frame);
      this.at ??= frame.number;
      return true;
    }

    // After `seconds` more: the two frames to draw between, the share of the way, and the frames passed since
    // the last time. Null before the first frame.
    advance(seconds) {
      if (!this.frames.length) return null;
      if (this.buffered > LEAP) [this.at, this.lag] = [this.newest.number - DELAY * this.fps, DELAY];
      if (this.buffered >= DELAY || this.over) this.waiting = false;
      if (!this.waiting) {
        const speed = this.over ? 1 : Math.min(Math.max(1 + this.lag - DELAY, SLOWEST), FASTEST);
        this.at = Math.min(this.at + seconds * this.fps * speed, this.newest.number);
        this.lag += (this.buffered - this.lag) * Math.min(seconds / STEADY, 1);
        // Empty (a pause, a slow network): fill up again before continuing, instead of stuttering.
        if (this.at >= this.newest.number) [this.waiting, this.lag] = [true, DELAY];
      }
      const past = this.frames.findLastIndex((frame) => frame.number <= this.at);
      const passed = this.frames.splice(0, Math.max(past, 0));
      const [frame, later = frame] = this.frames;
      const steps = later.number - frame.number;
      // A long gap is not interpolated: playback continues after it.
      if (steps > this.fps) this.at = Math.max(this.at, later.number);
      return { frame, later, passed, share: steps ? Math.min(Math.max((this.at - frame.number) / steps, 0), 1) : 0 };
    }
  }

  return { Buffer, decode, DELAY };
})();
