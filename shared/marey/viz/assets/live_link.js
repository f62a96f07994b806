"use strict";
// The socket of a live stream (docs/reference/streams.md): opened again, from the frame after the last one, when it breaks off.
const MareyLink = (() => {
  const PROTOCOL = "marey.stream.v1";
  const FIRST = 0.25; // s before the first try to come back; each further one waits twice as long
  const LONGEST = 8;
  const OVER = 1000;
  const OPENING = [4401, 4403, 4404, 4422]; // it would be closed the same way again

  class Link {
    // address(): the URL, with the frame to go on from.
    // on: {frame(ArrayBuffer), message(object), open(), lost(reason, seconds to the next try),
    //      refused(code, reason)}; reasons are the server's, and may be empty.
    constructor(address, key, on) {
      Object.assign(this, { address, key, on, wait: FIRST, done: false });
      this.connect();
    }

    get open() {
      return this.socket.readyState === WebSocket.OPEN;
    }

    connect() {
      const socket = (this.socket = new WebSocket(this.address(), [PROTOCOL, `marey.key.${this.key}`]));
      socket.binaryType = "arraybuffer";
      socket.onopen = () => this.on.open();
      socket.onmessage = ({ data }) => {
        if (this.done) return;
        this.wait = FIRST; // it works: not merely opened, to be closed at once
        try {
          if (data instanceof ArrayBuffer) this.on.frame(data);
          else this.hear(JSON.parse(data));
        } catch (error) {
          console.error(error);
          this.refuse(0, `What the server sent cannot be read: ${error.message}.`);
        }
      };
      socket.onclose = ({ code, reason }) => this.closed(code, reason);
    }

    hear(message) {
      if (message.type === "end") this.done = true;
      this.on.message(message);
    }

    closed(code, reason) {
      if (this.done) return;
      if (OPENING.includes(code)) {
        this.refuse(code, reason);
        return;
      }
      // Not all at the same moment when a server comes back: half of the wait is drawn.
      const seconds = this.wait * (0.5 + 0.5 * Math.random());
      this.wait = Math.min(2 * this.wait, LONGEST);
      this.timer = setTimeout(() => this.connect(), 1000 * seconds);
      this.on.lost(reason, seconds);
    }

    refuse(code, reason) {
      this.close();
      this.on.refused(code, reason);
    }

    // False when it could not be sent.
    send(message) {
      if (!this.open) return false;
      this.socket.send(JSON.stringify(message));
      return true;
    }

    close() {
      this.done = true;
      clearTimeout(this.timer);
      this.socket.close(OVER);
    }
  }

  return { Link };
})();
