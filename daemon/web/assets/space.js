// A scene in mm that turns under the hand: three.js with OrbitControls. Keys: arrows turn, + and -
// zoom. One finger turns it left and right, and scrolls the page up and down (touch-action in
// style.css); two fingers turn it in every direction and zoom.

import { script } from "./charts.js";
import { h } from "./dom.js";
import { withoutOverlap } from "./labels.js";
import { onPalette, palette } from "./palette.js";

const kFov = 40;  // degrees, vertical
const kLeastAspect = 1.2;  // in which the box is seen from all sides
const kFont = "48px sans-serif";

async function load() {
  await script("three.min.js");
  for (const part of ["OrbitControls.js", "ConvexHull.js", "ConvexGeometry.js"]) await script(part);
}

/** `role`: a name of palette(). */
function paint(material, role) {
  material.color.set(palette()[role]);
  material.userData.role = role;
  return material;
}

/** A picture of a text. */
function picture(words) {
  const canvas = h("canvas", { width: 256, height: 64 });
  const pen = canvas.getContext("2d");
  pen.font = kFont;
  pen.fillStyle = palette().text;
  pen.textAlign = "center";
  pen.fillText(words, 128, 48);
  return new THREE.CanvasTexture(canvas);
}

/** Width of a text as a share of its picture. */
function widthOf(words) {
  const pen = h("canvas").getContext("2d");
  pen.font = kFont;
  return Math.min(1, pen.measureText(words).width / 256);
}

/** Colours are names of palette(): they follow theme and contrast. */
export class Space {
  /** `low`, `high`: opposite corners of the box that is shown, mm. `label`: what it shows. `arm`: from
   * its centre to the viewer, as a multiple of its diagonal. */
  static async create(place, low, high, label, arm) {
    await load();
    return new Space(place, low, high, label, arm);
  }

  constructor(place, low, high, label, arm = [-0.6, -1.3, 0.75]) {
    this.low = new THREE.Vector3(...low);
    this.high = new THREE.Vector3(...high);
    this.size = this.high.distanceTo(this.low) || 1;
    this.frame = h("div", { class: "space", tabindex: 0, role: "img" });
    this.name(label);
    place.append(this.frame);
    this.scene = new THREE.Scene();
    this.texts = [];
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.frame.append(this.renderer.domElement);
    this.#look(arm);
    const box = new THREE.Box3Helper(new THREE.Box3(this.low, this.high));
    paint(box.material, "line");
    this.add(box);
    for (const [i, name] of ["X", "Y", "Z"].entries()) this.#axisName(i, name);
    this.frame.addEventListener("keydown", (event) => this.#key(event));
    this.#oneFinger();
    this.observer = new ResizeObserver(() => this.#resize());
    this.observer.observe(this.frame);
    this.endPalette = onPalette(() => this.#repaint());
  }

  #repaint() {
    this.scene.traverse(({ material, userData }) => {
      if (material?.userData.role) paint(material, material.userData.role);
      if (!userData.words) return;
      material.map.dispose();
      material.map = picture(userData.words);
    });
    this.draw();
  }

  /** What a screen reader reads. */
  name(label) {
    this.frame.setAttribute("aria-label", `${label}. Arrow keys turn it, + and - zoom.`);
  }

  /** From the centre to the viewer, for create(). */
  get arm() {
    return this.camera.position.clone().sub(this.controls.target).divideScalar(this.size).toArray();
  }

  #look(arm) {
    const centre = this.low.clone().add(this.high).multiplyScalar(0.5);
    this.camera = new THREE.PerspectiveCamera(kFov, 1, this.size / 100, this.size * 20);
    this.camera.up.set(0, 0, 1);
    this.camera.position.copy(centre).add(new THREE.Vector3(...arm).multiplyScalar(this.size));
    this.controls = new THREE.OrbitControls(this.camera, this.renderer.domElement);
    this.controls.enableKeys = false;
    this.controls.touches.TWO = THREE.TOUCH.DOLLY_ROTATE;
    this.controls.target.copy(centre);
    this.controls.update();
    this.controls.addEventListener("change", () => this.draw());
  }

  /** Turns the viewer about the vertical, and up; rad. */
  #turn(around, up) {
    const arm = this.camera.position.clone().sub(this.controls.target);
    const at = new THREE.Spherical().setFromVector3(new THREE.Vector3(arm.x, arm.z, -arm.y));
    at.theta += around;
    at.phi = Math.min(Math.PI - 0.05, Math.max(0.05, at.phi + up));
    const turned = new THREE.Vector3().setFromSpherical(at);
    this.#lookFrom(arm.set(turned.x, -turned.z, turned.y));
  }

  #lookFrom(arm) {
    this.camera.position.copy(this.controls.target).add(arm);
    this.controls.update();
    this.draw();
  }

  #key(event) {
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] };
    const zooms = { "+": 0.9, "-": 1.1 };
    if (turns[event.key]) this.#turn(...turns[event.key]);
    else if (zooms[event.key])
      this.#lookFrom(this.camera.position.clone().sub(this.controls.target).multiplyScalar(zooms[event.key]));
    else return;
    event.preventDefault();
  }

  /** One finger: OrbitControls would keep the browser from scrolling, so it sees two fingers only. */
  #oneFinger() {
    for (const name of ["touchstart", "touchmove"])
      this.frame.addEventListener(name, (event) => {
        if (event.touches.length === 1) event.stopPropagation();
      }, { capture: true, passive: true });

    const fingers = new Map();  // x in pixels, by pointer
    this.frame.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "touch") fingers.set(event.pointerId, event.clientX);
    });
    this.frame.addEventListener("pointermove", (event) => {
      if (!fingers.has(event.pointerId)) return;
      const moved = event.clientX - fingers.get(event.pointerId);
      fingers.set(event.pointerId, event.clientX);
      // A turn for the height of the view, as OrbitControls does.
      if (fingers.size === 1) this.#turn(-2 * Math.PI * moved / this.frame.clientHeight, 0);
    });
    // A finger that scrolls the page is cancelled.
    for (const name of ["pointerup", "pointercancel"])
      this.frame.addEventListener(name, (event) => fingers.delete(event.pointerId));
  }

  #axisName(i, name) {
    const at = this.low.clone();
    at.setComponent(i, this.high.getComponent(i) + 0.06 * this.size);
    this.text(name, at);
  }

  /** A text that always faces the viewer. Of texts that overlap the one is shown whose userData.first
   * is true, else the nearest. */
  text(words, at) {
    const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map: picture(words), depthTest: false }));
    Object.assign(sprite.userData, { words, width: widthOf(words), first: false });
    sprite.scale.set(0.24 * this.size, 0.06 * this.size, 1);
    sprite.position.copy(at);
    this.texts.push(sprite);
    return this.add(sprite);
  }

  /** Where a text is in the view, in pixels; `depth`: distance from the viewer, mm. */
  #rectangleOf(sprite) {
    const { clientWidth, clientHeight } = this.frame;
    const depth = -sprite.position.clone().applyMatrix4(this.camera.matrixWorldInverse).z;
    const at = sprite.position.clone().project(this.camera);
    const perUnit = clientHeight / (2 * depth * Math.tan(this.camera.fov / 2 * Math.PI / 180));
    return { sprite, depth, first: sprite.userData.first, x: (at.x + 1) / 2 * clientWidth, y: (1 - at.y) / 2 * clientHeight,
      width: sprite.userData.width * sprite.scale.x * perUnit, height: 0.8 * sprite.scale.y * perUnit };
  }

  /** Hides the texts that another one would cover. */
  #placeTexts() {
    this.camera.updateMatrixWorld();
    const shown = withoutOverlap(this.texts.map((sprite) => this.#rectangleOf(sprite)));
    const sprites = new Set(shown.map(({ sprite }) => sprite));
    this.texts.forEach((sprite) => { sprite.visible = sprites.has(sprite); });
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
  path(points, role) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points.flat(), 3));
    return this.add(new THREE.Line(geometry, paint(new THREE.LineBasicMaterial(), role)));
  }

  /** A polyline that grows by a point [x, y, z] with each call of what is returned. */
  growingPath(role) {
    const line = this.path([], role);
    line.frustumCulled = false;  // where it will be is not known yet
    let positions = new Float32Array(0), count = 0;
    return (point) => {
      if (3 * count === positions.length) {
        const more = new Float32Array(Math.max(3 * 1024, 2 * positions.length));
        more.set(positions);
        positions = more;
        line.geometry.dispose();
        line.geometry = new THREE.BufferGeometry();
        line.geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
      }
      positions.set(point, 3 * count);
      ++count;
      line.geometry.setDrawRange(0, count);
      line.geometry.attributes.position.needsUpdate = true;
      this.draw();
    };
  }

  /** Lines [[from, to], ..]. */
  segments(lines, role) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(lines.flat(2), 3));
    return this.add(new THREE.LineSegments(geometry, paint(new THREE.LineBasicMaterial(), role)));
  }

  dots(points, role, share = 0.012) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points.flat(), 3));
    return this.add(new THREE.Points(geometry,
      paint(new THREE.PointsMaterial({ size: share * this.size }), role)));
  }

  ball(at, radius, role, wireframe = false) {
    const ball = new THREE.Mesh(new THREE.SphereBufferGeometry(radius, wireframe ? 8 : 24, wireframe ? 6 : 16),
      paint(new THREE.MeshBasicMaterial({ wireframe }), role));
    ball.position.set(...at);
    return this.add(ball);
  }

  /** A square plate whose face is at `at`, behind it in the direction opposite to `normal`. */
  plate(at, normal, side, role, wireframe = false) {
    const thickness = 0.25 * side;
    const plate = new THREE.Mesh(new THREE.BoxBufferGeometry(side, side, thickness),
      paint(new THREE.MeshBasicMaterial({ wireframe }), role));
    const n = new THREE.Vector3(...normal).normalize();
    plate.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), n);
    plate.position.set(...at).addScaledVector(n, -0.5 * thickness);
    return this.add(plate);
  }

  /** The edges of the convex hull of points. */
  hull(points, role) {
    if (points.length < 4) return null;
    const hull = new THREE.ConvexGeometry(points.map((p) => new THREE.Vector3(...p)));
    const edges = new THREE.EdgesGeometry(hull, 1);
    hull.dispose();
    return this.add(new THREE.LineSegments(edges, paint(new THREE.LineBasicMaterial(), role)));
  }

  /** Draws in the next frame. */
  draw() {
    if (this.drawing) return;
    this.drawing = requestAnimationFrame(() => {
      this.drawing = 0;
      this.#placeTexts();
      this.renderer.render(this.scene, this.camera);
    });
  }

  #resize() {
    const { clientWidth, clientHeight } = this.frame;
    if (clientWidth === 0) return;
    this.renderer.setSize(clientWidth, clientHeight);
    this.camera.aspect = clientWidth / clientHeight;
    // A view that is higher than wide, as on a telephone, shows the whole width all the same.
    const narrow = Math.max(1, kLeastAspect / this.camera.aspect);
    this.camera.fov = 2 * Math.atan(narrow * Math.tan(kFov / 2 * Math.PI / 180)) * 180 / Math.PI;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  end() {
    this.endPalette();
    this.observer.disconnect();
    cancelAnimationFrame(this.drawing);
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}
