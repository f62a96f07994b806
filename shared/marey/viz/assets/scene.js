"use strict";
// Shared drawing code of all pages: a stage (camera, light, floor, palette), a figure of round cones, forward kinematics.
// Conventions are the files': metres, seconds, Y up, quaternions w x y z, left blue and right orange.
const MareyScene = (() => {
  const T = THREE;
  const UP = new T.Vector3(0, 1, 0);
  const PARTS = { left: 0x3886d6, right: 0xec7a30, middle: 0xcec8be, face: 0x968f85 };
  const PALETTE = {
    light: { paper: 0xfaf9f6, line: 0xbab5a9, muted: 0x767a81, parts: PARTS, sky: 0xffffff, ground: 0xcfc8bd, shadow: 0.2 },
    dark: { paper: 0x14161a, line: 0x4b505a, muted: 0x9a9ea6, parts: PARTS, sky: 0xe8ecf5, ground: 0x3a3d45, shadow: 0.5 },
  };
  const NO_WEBGL = "This browser shows no WebGL, which the player draws with. Turn on hardware acceleration, or open the page in another browser.";

  // ---------------------------------------------------------------- kinematics
  // A body is {parents, offsets, feet, height, sole, limbs}; a frame {root, turns}: 3 metres, and w x y z of each joint,
  // of any length but 0.
  class Pose {
    constructor(body) {
      this.body = body;
      this.local = body.parents.map(() => new T.Quaternion());
      this.world = body.parents.map(() => new T.Quaternion());
      this.joints = body.parents.map(() => new T.Vector3());
      this.next = new T.Quaternion();
    }

    static read({ turns }, joint, out) {
      const at = 4 * joint;
      return out.set(turns[at + 1], turns[at + 2], turns[at + 3], turns[at]).normalize();
    }

    // The pose a share of the way from one frame to another.
    between(frame, later, share) {
      const { parents, offsets } = this.body;
      for (let j = 0; j < parents.length; j++) {
        Pose.read(frame, j, this.local[j]).slerp(Pose.read(later, j, this.next), share);
        const parent = parents[j];
        if (parent < 0) {
          this.world[j].copy(this.local[j]);
          const mix = (axis) => frame.root[axis] * (1 - share) + later.root[axis] * share;
          this.joints[j].set(mix(0), mix(1), mix(2));
        } else {
          this.world[j].multiplyQuaternions(this.world[parent], this.local[j]);
          this.joints[j].fromArray(offsets[j]).applyQuaternion(this.world[parent]).add(this.joints[parent]);
        }
      }
      return this;
    }

    // No joint turned, the root `root` metres from the origin.
    rest(root) {
      const turns = this.body.parents.flatMap(() => [1, 0, 0, 0]);
      return this.between({ root, turns }, { root, turns }, 0);
    }
  }

  // ---------------------------------------------------------------- figure
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

  class Figure {
    constructor(stage, body) {
      this.body = body;
      this.pose = new Pose(body);
      const rest = new Pose(body).rest([0, 0, 0]);
      this.meshes = body.limbs.map((limb) => {
        const [a, b] = this.ends(limb, rest);
        const material = new T.MeshStandardMaterial({ roughness: 0.78 });
        const mesh = new T.Mesh(roundCone(a.distanceTo(b), limb.radii[0], limb.radii[1]), material);
        mesh.castShadow = mesh.receiveShadow = true;
        stage.scene.add(mesh);
        return mesh;
      });
      this.lamps = body.feet.map(() => {
        const lamp = new T.Mesh(new T.CircleGeometry(0.085, 32), new T.MeshBasicMaterial({ transparent: true, opacity: 0.5, depthWrite: false }));
        lamp.rotation.x = -Math.PI / 2;
        stage.scene.add(lamp);
        return lamp;
      });
      this.axes = stage.line(T.LineSegments, new Array(18 * body.parents.length).fill(0), 1);
      const tints = body.parents.flatMap(() => [0xe0483e, 0x3fae5a, 0x3d74e8].flatMap((hex) => Array(2).fill(new T.Color(hex).toArray()).flat()));
      this.axes.geometry.setAttribute("color", new T.Float32BufferAttribute(tints, 3));
      Object.assign(this.axes.material, { vertexColors: true, depthTest: false });
      this.axes.renderOrder = 2;
    }

    ends(limb, pose) {
      return [0, 1].map((k) => new T.Vector3(...limb.offsets[k]).applyQuaternion(pose.world[limb.joints[k]]).add(pose.joints[limb.joints[k]]));
    }

    show(visible) {
      for (const part of [...this.meshes, ...this.lamps, this.axes]) part.visible = visible;
    }

    paint(palette) {
      this.body.limbs.forEach((limb, k) => this.meshes[k].material.color.set(palette.parts[limb.part]));
      this.lamps.forEach((lamp, k) => lamp.material.color.set(palette.parts[k < 2 ? "left" : "right"]));
    }

    // Take the shape of `this.pose`; a lamp shines under each foot whose contact is on.
    move(contacts, axes) {
      const { pose } = this;
      this.body.limbs.forEach((limb, k) => {
        const [a, b] = this.ends(limb, pose);
        this.meshes[k].position.copy(a);
        this.meshes[k].quaternion.setFromUnitVectors(UP, b.sub(a).normalize());
      });
      this.lamps.forEach((lamp, k) => {
        const joint = pose.joints[this.body.feet[k]];
        lamp.position.set(joint.x, 0.004 - this.body.sole, joint.z);
        lamp.visible = contacts[k] > 0;
      });
      this.axes.visible = axes;
      if (axes) this.drawAxes();
    }

    drawAxes() {
      const position = this.axes.geometry.attributes.position;
      this.pose.joints.forEach((joint, j) => {
        for (let axis = 0; axis < 3; axis++) {
          const tip = new T.Vector3().setComponent(axis, 0.09).applyQuaternion(this.pose.world[j]).add(joint);
          position.setXYZ(6 * j + 2 * axis, joint.x, joint.y, joint.z);
          position.setXYZ(6 * j + 2 * axis + 1, tip.x, tip.y, tip.z);
        }
      });
      position.needsUpdate = true;
    }
  }

  // ---------------------------------------------------------------- stage
  // A grid of half metres (every second line stronger) that fades away from the figure.
  function gridOfHalfMetres() {
    const material = new T.ShaderMaterial({
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
    });
    const grid = new T.Mesh(new T.PlaneGeometry(60, 60), material);
    grid.rotation.x = -Math.PI / 2;
    return grid;
  }

  class Stage {
    // The renderer of a canvas. Throws without WebGL, after displaying the reason in the element `failure`.
    static renderer(canvas, failure) {
      let renderer;
      try {
        renderer = new T.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
      } catch (error) {
        failure.textContent = NO_WEBGL;
        failure.hidden = false;
        document.body.dataset.ready = "failed";
        throw error;
      }
      renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
      renderer.shadowMap.enabled = true;
      renderer.shadowMap.type = T.PCFShadowMap;
      return renderer;
    }

    // Several stages of one page may share a renderer; each then has a canvas of its own to turn the view on.
    constructor(canvas, failure, renderer = Stage.renderer(canvas, failure)) {
      this.renderer = renderer;
      this.scene = new T.Scene();
      this.camera = new T.PerspectiveCamera(32, 1, 0.05, 200);
      this.controls = new T.OrbitControls(this.camera, canvas);
      Object.assign(this.controls, { enableDamping: true, dampingFactor: 0.12, maxPolarAngle: Math.PI * 0.52, minDistance: 0.6, maxDistance: 40 });
      this.anchor = new T.Vector3(); // where on the floor the figure was drawn last
      this.sky = new T.HemisphereLight(0xffffff, 0xcfc8bd, 1.9);
      this.sun = new T.DirectionalLight(0xffffff, 2.1);
      this.sun.castShadow = true;
      this.sun.shadow.mapSize.set(2048, 2048);
      this.sun.shadow.radius = 4;
      this.sun.shadow.normalBias = 0.01;
      Object.assign(this.sun.shadow.camera, { left: -2.4, right: 2.4, top: 2.4, bottom: -2.4, near: 0.5, far: 12 });
      this.grid = gridOfHalfMetres();
      this.floor = new T.Mesh(new T.PlaneGeometry(60, 60), new T.ShadowMaterial({ opacity: 0.2 }));
      this.floor.rotation.x = -Math.PI / 2;
      this.floor.receiveShadow = true;
      this.scene.add(this.sky, this.sun, this.sun.target, this.floor, this.grid);
    }

    line(Kind, points, opacity) {
      const geometry = new T.BufferGeometry();
      geometry.setAttribute("position", new T.Float32BufferAttribute(points, 3));
      const line = new Kind(geometry, new T.LineBasicMaterial({ transparent: true, opacity }));
      line.frustumCulled = false;
      this.scene.add(line);
      return line;
    }

    // Paint all but the figure; gives the palette, for that.
    theme(name) {
      document.documentElement.dataset.theme = name;
      const palette = PALETTE[name];
      this.scene.background = new T.Color(palette.paper);
      this.sky.color.set(palette.sky);
      this.sky.groundColor.set(palette.ground);
      this.grid.material.uniforms.colour.value.set(palette.line);
      this.floor.material.opacity = palette.shadow;
      return palette;
    }

    // Look from the front left at a figure of this height that stands at x, z.
    home(x, z, height) {
      this.anchor.set(x, 0, z);
      this.controls.target.set(x, 0.5 * height, z);
      const distance = 2.7 * height * Math.max(1, 0.9 / this.camera.aspect);
      const [azimuth, elevation] = [0.56, 0.2];
      const way = new T.Vector3(Math.sin(azimuth) * Math.cos(elevation), Math.sin(elevation), Math.cos(azimuth) * Math.cos(elevation));
      this.camera.position.copy(this.controls.target).add(way.multiplyScalar(distance));
      this.controls.update();
    }

    // Keep floor, grid and sun under a figure at x, z; the camera goes along if it follows.
    track({ x, z }, sole, follow) {
      if (follow) {
        const shift = new T.Vector3(x - this.anchor.x, 0, z - this.anchor.z);
        this.camera.position.add(shift);
        this.controls.target.add(shift);
      }
      this.anchor.set(x, 0, z);
      this.floor.position.set(x, -sole, z);
      this.grid.position.set(x, 0.002 - sole, z);
      this.grid.material.uniforms.centre.value.set(x, z);
      this.sun.target.position.set(x, 0.6, z);
      this.sun.position.set(x - 1.4, 5.6, z + 2.2);
    }

    // Fill the window, its middle `x` pixels to the right and `y` down from the view's.
    resize(x, y) {
      if (innerWidth !== this.width || innerHeight !== this.height) {
        [this.width, this.height] = [innerWidth, innerHeight];
        this.renderer.setSize(innerWidth, innerHeight, false);
      }
      this.aim(innerWidth, innerHeight, x, y);
    }

    // Look at a picture of so many pixels, its middle `x` pixels to the right and `y` down from the view's.
    aim(width, height, x = 0, y = 0) {
      this.camera.aspect = width / height;
      this.camera.setViewOffset(width, height, -x, -y, width, height);
      this.camera.updateProjectionMatrix();
    }

    render() {
      this.renderer.render(this.scene, this.camera);
    }
  }

  return { Figure, Pose, Stage };
})();
