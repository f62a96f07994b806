"use strict";
// The player: reads the motion embedded in the page and plays it on the stage of scene.js.
(() => {
  const T = THREE;
  const { Figure, Stage } = MareyScene;
  const $ = (id) => document.getElementById(id);

  // ---------------------------------------------------------------- data
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

  const document_ = JSON.parse($("motion").textContent);
  const clips = document_.clips.map((c) => ({
    ...c,
    ...document_.bodies[c.body],
    root: new Float32Array(bytes(c.root).buffer),
    rotations: halves(c.rotations),
    contacts: bytes(c.contacts),
    length: (c.frames - 1) / c.fps,
  }));

  // ---------------------------------------------------------------- figures
  const stage = new Stage($("view"), $("failure"));

  // A figure that plays one clip, with the trail of its root.
  class Player extends Figure {
    constructor(clip) {
      super(stage, clip);
      this.clip = clip;
      const path = [];
      for (let t = 0; t < clip.frames; t++) path.push(clip.root[3 * t], 0, clip.root[3 * t + 2]);
      this.path = stage.line(T.Line, path, 0.35);
      this.past = stage.line(T.Line, path, 1);
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

  // ---------------------------------------------------------------- state
  const state = { clip: 0, seconds: 0, playing: true, speed: 1, follow: true, trail: true, axes: false, theme: "light" };
  const figures = clips.map(() => null);
  const clip = () => clips[state.clip];
  const figure = () => (figures[state.clip] ??= new Player(clip()));

  function home() {
    const { root, height } = clip();
    stage.home(root[0], root[2], height);
  }

  function select(index) {
    const before = figures[state.clip];
    if (before) before.show(false);
    state.clip = Math.min(Math.max(index, 0), clips.length - 1);
    state.seconds = 0;
    figure().show(true);
    figure().paint(stage.theme(state.theme));
    $("caption").textContent = clip().caption || clip().name;
    $("facts").textContent = clip().facts;
    document.title = `${clip().caption || clip().name} · Marey`;
    $("scrub").max = clip().length || 1;
    [...$("clips").children].forEach((b, k) => {
      b.setAttribute("aria-current", String(k === state.clip));
      if (k === state.clip) b.scrollIntoView({ block: "nearest" });
    });
    home();
    drawLanes();
    draw();
  }

  function seek(seconds) {
    state.seconds = Math.min(Math.max(seconds, 0), clip().length);
    draw();
  }

  function play(on) {
    if (on && state.seconds >= clip().length) state.seconds = 0;
    state.playing = on;
    $("play").dataset.playing = String(on);
    $("play").setAttribute("aria-label", on ? "Pause" : "Play");
  }

  function speed(value) {
    state.speed = value;
    $("speed").value = String(value);
  }

  function toggle(option) {
    state[option] = !state[option];
    $(option).setAttribute("aria-pressed", String(state[option]));
    draw();
  }

  function theme(name) {
    state.theme = name;
    figure().paint(stage.theme(name));
    drawLanes();
    draw();
  }

  // ---------------------------------------------------------------- drawing
  function draw() {
    figure().seek(state.seconds, state);
    const { frame, pose } = figure();
    stage.track(pose.joints[0], clip().sole, state.follow);
    $("scrub").value = state.seconds;
    $("clock").textContent = `${state.seconds.toFixed(2)} / ${clip().length.toFixed(2)} s · frame ${frame}`;
    Object.assign(document.body.dataset, { ready: "yes", clip: state.clip, frame });
    stage.render();
  }

  // Foot contact over time: left above right; the fuller the colour, the more of the foot is down.
  function drawLanes() {
    const canvas = $("lanes");
    const width = (canvas.width = Math.max(canvas.clientWidth, 1) * devicePixelRatio);
    const height = (canvas.height = Math.max(canvas.clientHeight, 1) * devicePixelRatio);
    const pen = canvas.getContext("2d");
    const style = getComputedStyle(document.documentElement);
    const { feet, contacts, frames } = clip();
    if (!feet.length) return;
    ["left", "right"].forEach((side, lane) => {
      const [y, tall] = [lane * height * 0.55, height * 0.38];
      pen.globalAlpha = 1;
      pen.fillStyle = style.getPropertyValue("--line");
      pen.fillRect(0, y, width, tall);
      pen.fillStyle = style.getPropertyValue(`--${side}`);
      for (let t = 0; t < frames; t++) {
        const down = contacts[4 * t + 2 * lane] + contacts[4 * t + 2 * lane + 1];
        const [from, to] = [t - 0.5, t + 0.5].map((f) => (Math.min(Math.max(f, 0), frames - 1) / Math.max(frames - 1, 1)) * width);
        pen.globalAlpha = down / 2;
        if (down) pen.fillRect(Math.round(from), y, Math.round(to) - Math.round(from), tall);
      }
    });
  }

  let last = null;
  function tick(now) {
    const passed = last === null ? 0 : Math.min((now - last) / 1000, 0.1);
    last = now;
    if (state.playing && clip().length > 0) {
      state.seconds += passed * state.speed;
      if (state.seconds > clip().length) state.seconds = state.seconds % clip().length;
    }
    stage.controls.update();
    draw();
    requestAnimationFrame(tick);
  }

  function resize() {
    // The list of clips covers the left: look at the middle of what is free.
    stage.resize($("clips").offsetWidth / 2, 10);
    drawLanes();
  }

  // ---------------------------------------------------------------- controls
  if (clips.length > 1) {
    clips.forEach((c, k) => {
      const button = document.createElement("button");
      const text = document.createElement("span");
      text.textContent = c.caption || c.name;
      button.append(text);
      button.title = c.caption;
      button.onclick = () => select(k);
      $("clips").append(button);
    });
  }
  for (const option of ["follow", "trail", "axes"]) $(option).onclick = () => toggle(option);
  $("home").onclick = home;
  $("theme").onclick = () => theme(state.theme === "dark" ? "light" : "dark");
  $("help").onclick = () => {
    $("keys").hidden = !$("keys").hidden;
    $("help").setAttribute("aria-expanded", String(!$("keys").hidden));
  };
  $("play").onclick = () => play(!state.playing);
  $("scrub").oninput = (event) => {
    play(false);
    seek(Number(event.target.value));
  };
  $("speed").onchange = (event) => speed(Number(event.target.value));

  const step = (frames) => {
    play(false);
    seek((Math.round(state.seconds * clip().fps) + frames) / clip().fps);
  };
  const KEYS = {
    " ": () => play(!state.playing),
    ArrowLeft: (event) => step(event.shiftKey ? -10 : -1),
    ArrowRight: (event) => step(event.shiftKey ? 10 : 1),
    ArrowUp: () => select(state.clip - 1),
    ArrowDown: () => select(state.clip + 1),
    Home: () => step(-Infinity),
    End: () => step(Infinity),
    1: () => speed(0.25),
    2: () => speed(0.5),
    3: () => speed(1),
    4: () => speed(2),
    f: () => toggle("follow"),
    t: () => toggle("trail"),
    a: () => toggle("axes"),
    r: home,
    d: () => $("theme").click(),
    "?": () => $("help").click(),
  };
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
    const action = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action(event);
  });
  addEventListener("resize", resize);

  // What a page around this one, or a test, may call.
  window.marey = {
    select,
    seek,
    play: () => play(true),
    pause: () => play(false),
    state: () => ({ ...state, frame: figure().frame, frames: clip().frames, clips: clips.length }),
    joints: () => figure().pose.joints.map((v) => v.toArray()),
  };

  // #clip=2&t=1.5&paused opens at that moment.
  const hash = new URLSearchParams(location.hash.slice(1));
  state.theme = stage.wantedTheme();
  resize();
  select(Number(hash.get("clip") ?? 0) || 0);
  theme(state.theme);
  play(!hash.has("paused"));
  if (hash.has("t")) seek(Number(hash.get("t")) || 0);
  requestAnimationFrame(tick);
})();
