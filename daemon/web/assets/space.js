// A scene in machine coordinates (mm) that turns under the hand: three.js with OrbitControls. Keys:
// arrows turn, + and - zoom.

import { isDark, script } from "./charts.js";
import { h } from "./dom.js";

async function load() {
  await script("three.min.js");
  for (const part of ["OrbitControls.js", "ConvexHull.js", "ConvexGeometry.js"]) await script(part);
}

export class Space {
  /** `low`, `high`: opposite corners of the box that is shown, mm. `label`: what it shows. */
  static async create(place, low, high, label) {
    await load();
    return new Space(place, low, high, label);
  }

  constructor(place, low, high, label) {
    this.low = new THREE.Vector3(...low);
    this.high = new THREE.Vector3(...high);
    this.size = this.high.distanceTo(this.low) || 1;
    this.frame = h("div", { class: "space", tabindex: 0, role: "img",
      "aria-label": `${label}. Arrow keys turn it, + and - zoom.` });
    place.append(this.frame);
    this.scene = new THREE.Scene();
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.frame.append(this.renderer.domElement);
    this.#look();
    this.add(new THREE.Box3Helper(new THREE.Box3(this.low, this.high), this.lineColour()));
    for (const [i, name] of ["X", "Y", "Z"].entries()) this.#axisName(i, name);
    this.frame.addEventListener("keydown", (event) => this.#key(event));
    this.observer = new ResizeObserver(() => this.#resize());
    this.observer.observe(this.frame);
    this.redraw = () => this.draw();
    addEventListener("theme", this.redraw);
  }

  lineColour() {
    return isDark() ? 0x9aa7b4 : 0x57606a;
  }

  #look() {
    const centre = this.low.clone().add(this.high).multiplyScalar(0.5);
    this.camera = new THREE.PerspectiveCamera(40, 1, this.size / 100, this.size * 20);
    this.camera.up.set(0, 0, 1);
    this.camera.position.copy(centre).add(
      new THREE.Vector3(-0.6, -1.3, 0.75).multiplyScalar(this.size));
    this.controls = new THREE.OrbitControls(this.camera, this.renderer.domElement);
    this.controls.enableKeys = false;
    this.controls.target.copy(centre);
    this.controls.update();
    this.controls.addEventListener("change", () => this.draw());
  }

  #key(event) {
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] };
    const arm = this.camera.position.clone().sub(this.controls.target);
    if (turns[event.key]) {
      const [around, up] = turns[event.key];
      const at = new THREE.Spherical().setFromVector3(new THREE.Vector3(arm.x, arm.z, -arm.y));
      at.theta += around;
      at.phi = Math.min(Math.PI - 0.05, Math.max(0.05, at.phi + up));
      const turned = new THREE.Vector3().setFromSpherical(at);
      arm.set(turned.x, -turned.z, turned.y);
    } else if (event.key === "+" || event.key === "-") {
      arm.multiplyScalar(event.key === "+" ? 0.9 : 1.1);
    } else {
      return;
    }
    event.preventDefault();
    this.camera.position.copy(this.controls.target).add(arm);
    this.controls.update();
    this.draw();
  }

  #axisName(i, name) {
    const at = this.low.clone();
    at.setComponent(i, this.high.getComponent(i) + 0.06 * this.size);
    this.text(name, at);
  }

  /** A text that always faces the viewer. */
  text(words, at, colour = isDark() ? "#8fa1b3" : "#4d5761") {
    const canvas = h("canvas", { width: 256, height: 64 });
    const pen = canvas.getContext("2d");
    pen.font = "48px sans-serif";
    pen.fillStyle = colour;
    pen.textAlign = "center";
    pen.fillText(words, 128, 48);
    const material = new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), depthTest: false });
    const sprite = new THREE.Sprite(material);
    sprite.scale.set(0.24 * this.size, 0.06 * this.size, 1);
    sprite.position.copy(at);
    return this.add(sprite);
  }

  add(object) {
    this.scene.add(object);
    this.draw();
    return object;
  }

  remove(object) {
    if (!object) return;
    this.scene.remove(object);
    object.geometry?.dispose();
    object.material?.dispose();
  }

  /** A polyline through points [[x, y, z], ..]. */
  path(points, colour) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points.flat(), 3));
    return this.add(new THREE.Line(geometry, new THREE.LineBasicMaterial({ color: colour })));
  }

  /** Lines [[from, to], ..]. */
  segments(lines, colour) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(lines.flat(2), 3));
    return this.add(new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: colour })));
  }

  dots(points, colour, share = 0.012) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points.flat(), 3));
    return this.add(new THREE.Points(geometry,
      new THREE.PointsMaterial({ color: colour, size: share * this.size })));
  }

  ball(at, radius, colour) {
    const ball = new THREE.Mesh(new THREE.SphereBufferGeometry(radius, 24, 16),
      new THREE.MeshBasicMaterial({ color: colour }));
    ball.position.set(...at);
    return this.add(ball);
  }

  /** The edges of the convex hull of points. */
  hull(points, colour) {
    if (points.length < 4) return null;
    const hull = new THREE.ConvexGeometry(points.map((p) => new THREE.Vector3(...p)));
    const edges = new THREE.EdgesGeometry(hull, 1);
    hull.dispose();
    return this.add(new THREE.LineSegments(edges, new THREE.LineBasicMaterial({ color: colour })));
  }

  /** Draws in the next frame. */
  draw() {
    if (this.drawing) return;
    this.drawing = requestAnimationFrame(() => {
      this.drawing = 0;
      this.renderer.render(this.scene, this.camera);
    });
  }

  #resize() {
    const { clientWidth, clientHeight } = this.frame;
    if (clientWidth === 0) return;
    this.renderer.setSize(clientWidth, clientHeight);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  end() {
    removeEventListener("theme", this.redraw);
    this.observer.disconnect();
    cancelAnimationFrame(this.drawing);
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}
