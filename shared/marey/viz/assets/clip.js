"use strict";
// Finished clips: reads those embedded in a page (root float32, rotations float16, contacts a byte each) and plays one
// on a stage of scene.js.
const MareyClips = (() => {
  const { Figure } = MareyScene;
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));

  function halves(text) {
    const view = new DataView(bytes(text).buffer);
    const out = new Float32Array(view.byteLength / 2);
    for (let i = 0; i < out.length; i++) {
      const h = view.getUint16(2 * i, true);
      const exponent = (h >> 10) & 31;
      const fraction = h & 1023;
      const size = exponent ? 2 ** (exponent - 15) * (1 + fraction / 1024) : 2 ** -14 * (fraction / 1024);
      out[i] = h & 0x8000 ? -size : size;
    }
    return out;
  }

  // The clips of a document {bodies, clips}, each with its body and its length in seconds.
  function read({ bodies, clips }) {
    return clips.map((c) => ({
      ...c,
      ...bodies[c.body],
      root: new Float32Array(bytes(c.root).buffer),
      rotations: halves(c.rotations),
      contacts: bytes(c.contacts),
      length: (c.frames - 1) / c.fps,
    }));
  }

  // A figure that plays one clip, with the trail of its root.
  class Player extends Figure {
    constructor(stage, clip) {
      super(stage, clip);
      this.clip = clip;
      const path = [];
      for (let t = 0; t < clip.frames; t++) path.push(clip.root[3 * t], 0, clip.root[3 * t + 2]);
      this.path = stage.line(THREE.Line, path, 0.35);
      this.past = stage.line(THREE.Line, path, 1);
    }

    show(visible) {
      super.show(visible);
      this.path.visible = this.past.visible = visible;
    }

    paint(palette) {
      super.paint(palette);
      for (const line of [this.path, this.past]) line.material.color.set(palette.muted);
    }

    read(frame) {
      const { root, rotations, parents } = this.clip;
      const turns = 4 * parents.length;
      return { root: root.subarray(3 * frame, 3 * frame + 3), turns: rotations.subarray(turns * frame, turns * (frame + 1)) };
    }

    // Show a time in seconds, between two frames by spherical interpolation.
    seek(seconds, options) {
      const { clip } = this;
      const exact = Math.min(Math.max(seconds * clip.fps, 0), clip.frames - 1);
      const frame = Math.min(Math.floor(exact + 1e-6), Math.max(clip.frames - 2, 0));
      this.pose.between(this.read(frame), this.read(Math.min(frame + 1, clip.frames - 1)), exact - frame);
      this.frame = Math.round(exact);
      this.move(clip.contacts.subarray(this.frame * clip.feet.length, (this.frame + 1) * clip.feet.length), options.axes);
      this.path.visible = this.past.visible = options.trail;
      this.path.position.y = this.past.position.y = 0.006 - clip.sole;
      this.past.geometry.setDrawRange(0, this.frame + 1);
    }
  }

  return { Player, read };
})();
