"use strict";
// The player: reads the motion embedded in the page, runs forward kinematics and draws round-cone bodies with three.js.
// Conventions are the files': metres, seconds, Y up, quaternions w x y z, left blue and right orange.
(() => {
  const T = THREE;
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

  // ---------------------------------------------------------------- kinematics
  class Pose {
    constructor(clip) {
      this.clip = clip;
      const count = clip.parents.length;
      this.local = clip.parents.map(() => new T.Quaternion());
      this.world = clip.parents.map(() => new T.Quaternion());
      this.joints = clip.parents.map(() => new T.Vector3());
      this.next = new T.Quaternion();
      this.count = count;
    }

    quaternion(frame, joint, out) {
      const at = 4 * (frame * this.count + joint);
      const r = this.clip.rotations;
      return out.set(r[at + 1], r[at + 2], r[at + 3], r[at]).normalize();
    }

    // The pose at a time in seconds, between two frames by spherical interpolation.
    at(seconds) {
      const { clip } = this;
      const exact = Math.min(Math.max(seconds * clip.fps, 0), clip.frames - 1);
      const frame = Math.min(Math.floor(exact + 1e-6), Math.max(clip.frames - 2, 0));
      const share = exact - frame;
      const later = Math.min(frame + 1, clip.frames - 1);
      for (let j = 0; j < this.count; j++) {
        this.quaternion(frame, j, this.local[j]).slerp(this.quaternion(later, j, this.next), share);
        const parent = clip.parents[j];
        if (parent < 0) {
          this.world[j].copy(this.local[j]);
          const mix = (axis) => clip.root[3 * frame + axis] * (1 - share) + clip.root[3 * later + axis] * share;
          this.joints[j].set(mix(0), mix(1), mix(2));
        } else {
          this.world[j].multiplyQuaternions(this.world[parent], this.local[j]);
          this.joints[j].fromArray(clip.offsets[j]).applyQuaternion(this.world[parent]).add(this.joints[parent]);
        }
      }
      this.frame = Math.round(exact);
      return this;
    }
  }

  // ---------------------------------------------------------------- scene
  const PALETTE = {
    light: { paper: 0xfaf9f6, line: 0xbab5a9, muted: 0x767a81, parts: { left: 0x3886d6, right: 0xec7a30, middle: 0xcec8be, face: 0x968f85 }, sky: 0xffffff, ground: 0xcfc8bd, shadow: 0.2 },
    dark: { paper: 0x14161a, line: 0x4b505a, muted: 0x9a9ea6, parts: { left: 0x3886d6, right: 0xec7a30, middle: 0xcec8be, face: 0x968f85 }, sky: 0xe8ecf5, ground: 0x3a3d45, shadow: 0.5 },
  };

  let renderer;
  try {
    renderer = new T.WebGLRenderer({ canvas: $("view"), antialias: true, preserveDrawingBuffer: true });
  } catch (error) {
    $("failure").textContent = "This browser shows no WebGL, which the player draws with. Turn on hardware acceleration, or open the page in another browser.";
    $("failure").hidden = false;
    document.body.dataset.ready = "failed";
    throw error;
  }
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = T.PCFShadowMap;
  const scene = new T.Scene();
  const camera = new T.PerspectiveCamera(32, 1, 0.05, 200);
  const controls = new T.OrbitControls(camera, renderer.domElement);
  controls.enableDamping = true;
  controls.dampingFactor = 0.12;
  controls.maxPolarAngle = Math.PI * 0.52;
  controls.minDistance = 0.6;
  controls.maxDistance = 40;
  const sky = new T.HemisphereLight(0xffffff, 0xcfc8bd, 1.9);
  const sun = new T.DirectionalLight(0xffffff, 2.1);
  sun.castShadow = true;
  sun.shadow.mapSize.set(2048, 2048);
  sun.shadow.radius = 4;
  sun.shadow.normalBias = 0.01;
  Object.assign(sun.shadow.camera, { left: -2.4, right: 2.4, top: 2.4, bottom: -2.4, near: 0.5, far: 12 });
  scene.add(sky, sun, sun.target);

  // A grid of half metres (every second line stronger) that fades away from the figure.
  const grid = new T.Mesh(
    new T.PlaneGeometry(60, 60),
    new T.ShaderMaterial({
      transparent: true,
      depthWrite: false,
      uniforms: { colour: { value: new T.Color() }, centre: { value: new T.Vector2() }, reach: { value: 9 } },
      vertexShader: "varying vec2 p; void main() { vec4 w = modelMatrix * vec4(position, 1.); p = w.xz; gl_Position = projectionMatrix * viewMatrix * w; }",
      fragmentShader: `varying vec2 p; uniform vec3 colour; uniform vec2 centre; uniform float reach;
        float lines(float step) { vec2 q = p / step; vec2 w = fwidth(q); vec2 d = abs(fract(q - .5) - .5) / w; return (1. - min(min(d.x, d.y), 1.)) * (1. - clamp(max(w.x, w.y) * 2., 0., 1.)); }
        void main() { float near = 1. - smoothstep(.25, 1., length(p - centre) / reach);
          gl_FragColor = vec4(colour, max(lines(.5) * .3, lines(1.) * .7) * near);
          #include <colorspace_fragment>
        }`,
    }),
  );
  grid.rotation.x = -Math.PI / 2;
  const floor = new T.Mesh(new T.PlaneGeometry(60, 60), new T.ShadowMaterial({ opacity: 0.2 }));
  floor.rotation.x = -Math.PI / 2;
  floor.receiveShadow = true;
  scene.add(floor, grid);

  // A round cone along +Y, its first ball at the origin.
  function roundCone(length, first, second) {
    const profile = [];
    const slope = length > Math.abs(first - second) ? Math.asin((first - second) / length) : first > second ? Math.PI / 2 : -Math.PI / 2;
    const arc = (radius, centre, from, to) => {
      for (let k = 0; k <= 8; k++) {
        const angle = from + ((to - from) * k) / 8;
        profile.push(new T.Vector2(Math.max(radius * Math.cos(angle), 0), centre + radius * Math.sin(angle)));
      }
    };
    arc(first, 0, -Math.PI / 2, slope);
    arc(second, length, slope, Math.PI / 2);
    return new T.LatheGeometry(profile, 24);
  }

  const UP = new T.Vector3(0, 1, 0);
  class Figure {
    constructor(clip) {
      this.clip = clip;
      this.pose = new Pose(clip);
      this.meshes = [];
      const rest = new Pose({ ...clip, frames: 1, root: new Float32Array(3), rotations: new Float32Array(4 * clip.parents.length).map((_, i) => (i % 4 ? 0 : 1)) }).at(0);
      for (const limb of clip.limbs) {
        const [a, b] = this.ends(limb, rest).map((v) => v.clone());
        const material = new T.MeshStandardMaterial({ roughness: 0.78 });
        const mesh = new T.Mesh(roundCone(a.distanceTo(b), limb.radii[0], limb.radii[1]), material);
        mesh.castShadow = mesh.receiveShadow = true;
        this.meshes.push(mesh);
        scene.add(mesh);
      }
      this.lamps = clip.feet.map(() => {
        const lamp = new T.Mesh(new T.CircleGeometry(0.085, 32), new T.MeshBasicMaterial({ transparent: true, opacity: 0.5, depthWrite: false }));
        lamp.rotation.x = -Math.PI / 2;
        scene.add(lamp);
        return lamp;
      });
      const path = [];
      for (let t = 0; t < clip.frames; t++) path.push(clip.root[3 * t], 0, clip.root[3 * t + 2]);
      this.path = this.line(T.Line, path, 0.35);
      this.past = this.line(T.Line, path, 1);
      this.axes = this.line(T.LineSegments, new Array(18 * clip.parents.length).fill(0), 1);
      const tints = clip.parents.flatMap(() => [0xe0483e, 0x3fae5a, 0x3d74e8].flatMap((hex) => Array(2).fill(new T.Color(hex).toArray()).flat()));
      this.axes.geometry.setAttribute("color", new T.Float32BufferAttribute(tints, 3));
      Object.assign(this.axes.material, { vertexColors: true, depthTest: false });
      this.axes.renderOrder = 2;
    }

    line(Kind, points, opacity) {
      const geometry = new T.BufferGeometry();
      geometry.setAttribute("position", new T.Float32BufferAttribute(points, 3));
      const line = new Kind(geometry, new T.LineBasicMaterial({ transparent: true, opacity }));
      line.frustumCulled = false;
      scene.add(line);
      return line;
    }

    ends(limb, pose) {
      return [0, 1].map((k) => new T.Vector3(...limb.offsets[k]).applyQuaternion(pose.world[limb.joints[k]]).add(pose.joints[limb.joints[k]]));
    }

    show(visible) {
      for (const part of [...this.meshes, ...this.lamps, this.path, this.past, this.axes]) part.visible = visible;
    }

    paint(palette) {
      this.clip.limbs.forEach((limb, k) => this.meshes[k].material.color.set(palette.parts[limb.part]));
      this.lamps.forEach((lamp, k) => lamp.material.color.set(palette.parts[k < 2 ? "left" : "right"]));
      for (const line of [this.path, this.past]) line.material.color.set(palette.muted);
    }

    move(seconds, options) {
      const pose = this.pose.at(seconds);
      this.clip.limbs.forEach((limb, k) => {
        const [a, b] = this.ends(limb, pose);
        this.meshes[k].position.copy(a);
        this.meshes[k].quaternion.setFromUnitVectors(UP, b.sub(a).normalize());
      });
      this.lamps.forEach((lamp, k) => {
        const joint = pose.joints[this.clip.feet[k]];
        lamp.position.set(joint.x, 0.004 - this.clip.sole, joint.z);
        lamp.visible = this.clip.contacts[pose.frame * this.clip.feet.length + k] > 0;
      });
      this.path.visible = this.past.visible = options.trail;
      this.path.position.y = this.past.position.y = 0.006 - this.clip.sole;
      this.past.geometry.setDrawRange(0, pose.frame + 1);
      this.axes.visible = options.axes;
      if (options.axes) this.drawAxes(pose);
      return pose;
    }

    drawAxes(pose) {
      const position = this.axes.geometry.attributes.position;
      pose.joints.forEach((joint, j) => {
        for (let axis = 0; axis < 3; axis++) {
          const tip = new T.Vector3().setComponent(axis, 0.09).applyQuaternion(pose.world[j]).add(joint);
          position.setXYZ(6 * j + 2 * axis, joint.x, joint.y, joint.z);
          position.setXYZ(6 * j + 2 * axis + 1, tip.x, tip.y, tip.z);
        }
      });
      position.needsUpdate = true;
    }
  }

  // ---------------------------------------------------------------- state
  const state = { clip: 0, seconds: 0, playing: true, speed: 1, follow: true, trail: true, axes: false, theme: "light" };
  const figures = clips.map(() => null);
  const anchor = new T.Vector3();
  const clip = () => clips[state.clip];
  const figure = () => (figures[state.clip] ??= new Figure(clip()));

  function home() {
    const { root, height } = clip();
    anchor.set(root[0], 0, root[2]);
    controls.target.set(root[0], 0.5 * height, root[2]);
    const distance = 2.7 * height * Math.max(1, 0.9 / camera.aspect);
    const [azimuth, elevation] = [0.56, 0.2];
    camera.position.copy(controls.target).add(new T.Vector3(Math.sin(azimuth) * Math.cos(elevation), Math.sin(elevation), Math.cos(azimuth) * Math.cos(elevation)).multiplyScalar(distance));
    controls.update();
  }

  function select(index) {
    const before = figures[state.clip];
    if (before) before.show(false);
    state.clip = Math.min(Math.max(index, 0), clips.length - 1);
    state.seconds = 0;
    figure().show(true);
    figure().paint(PALETTE[state.theme]);
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
    document.documentElement.dataset.theme = name;
    const palette = PALETTE[name];
    scene.background = new T.Color(palette.paper);
    sky.color.set(palette.sky);
    sky.groundColor.set(palette.ground);
    grid.material.uniforms.colour.value.set(palette.line);
    floor.material.opacity = palette.shadow;
    figure().paint(palette);
    drawLanes();
    draw();
  }

  // ---------------------------------------------------------------- drawing
  function draw() {
    const pose = figure().move(state.seconds, state);
    const [x, z] = [pose.joints[0].x, pose.joints[0].z];
    if (state.follow) {
      const shift = new T.Vector3(x - anchor.x, 0, z - anchor.z);
      camera.position.add(shift);
      controls.target.add(shift);
    }
    anchor.set(x, 0, z);
    floor.position.set(x, -clip().sole, z);
    grid.position.set(x, 0.002 - clip().sole, z);
    grid.material.uniforms.centre.value.set(x, z);
    sun.target.position.set(x, 0.6, z);
    sun.position.set(x - 1.4, 5.6, z + 2.2);
    $("scrub").value = state.seconds;
    $("clock").textContent = `${state.seconds.toFixed(2)} / ${clip().length.toFixed(2)} s · frame ${pose.frame}`;
    Object.assign(document.body.dataset, { ready: "yes", clip: state.clip, frame: pose.frame });
    renderer.render(scene, camera);
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
    controls.update();
    draw();
    requestAnimationFrame(tick);
  }

  function resize() {
    camera.aspect = innerWidth / innerHeight;
    // The list of clips covers the left: look at the middle of what is free.
    const list = $("clips").offsetWidth;
    camera.setViewOffset(innerWidth, innerHeight, -list / 2, -10, innerWidth, innerHeight);
    camera.updateProjectionMatrix();
    renderer.setSize(innerWidth, innerHeight, false);
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
    state: () => ({ ...state, frame: figure().pose.frame, frames: clip().frames, clips: clips.length }),
    joints: () => figure().pose.joints.map((v) => v.toArray()),
  };

  // #clip=2&t=1.5&paused opens at that moment.
  const hash = new URLSearchParams(location.hash.slice(1));
  const wanted = document.documentElement.dataset.theme;
  state.theme = wanted !== "auto" ? wanted : matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
  resize();
  select(Number(hash.get("clip") ?? 0) || 0);
  theme(state.theme);
  play(!hash.has("paused"));
  if (hash.has("t")) seek(Number(hash.get("t")) || 0);
  requestAnimationFrame(tick);
})();
