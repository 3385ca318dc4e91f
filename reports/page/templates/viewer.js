"use strict";
// Every method's map of one model: the surface under its texture, beside the map in the plane.
// One WebGL context draws all tiles, one after the other, into the 2D canvases of the page.
(() => {
  const facts = JSON.parse(document.getElementById("facts").textContent);
  const MODES = ["checker", "normals", "angle", "area", "seams"];
  const FIELDS = 44; // of the checkerboard, along the diagonal of the model's box
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const say = document.getElementById("viewer-says");
  const { dot, file, summed, connected, places, step, points, sharing, rough } = window.unpack(facts);
  const { FACES, LINES } = window.shaders(facts.levels);

  // --- geometry ---

  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => { const length = Math.hypot(...a) || 1; return a.map((x) => x / length); };

  // Values of the rows that the corners refer to, one after the other.
  function gathered(values, width, corners) {
    const found = new Float32Array(corners.length * width);
    for (let at = 0; at < corners.length; at++)
      for (let k = 0; k < width; k++) found[at * width + k] = values[corners[at] * width + k];
    return found;
  }

  // Normals of the corners, by the area of the faces around; across a crease of 50° there is an edge.
  function cornerNormals(positions, faces, count) {
    const normals = new Float32Array(positions.length);
    const own = new Float32Array(faces.length); // (F, 3), as long as the area
    const start = new Uint32Array(count + 1);
    for (const vertex of faces) start[vertex + 1]++;
    for (let vertex = 0; vertex < count; vertex++) start[vertex + 1] += start[vertex];
    const around = new Uint32Array(faces.length);
    const filled = start.slice();
    for (let face = 0; face < faces.length / 3; face++) {
      const at = (k) => positions.subarray(9 * face + 3 * k, 9 * face + 3 * k + 3);
      const [a, b, c] = [at(0), at(1), at(2)];
      own.set(cross([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]), 3 * face);
      for (let k = 0; k < 3; k++) around[filled[faces[3 * face + k]]++] = face;
    }
    const limit = Math.cos((50 * Math.PI) / 180);
    for (let corner = 0; corner < faces.length; corner++) {
      const face = 3 * Math.floor(corner / 3);
      const n = [own[face], own[face + 1], own[face + 2]];
      const length = Math.hypot(...n);
      const sum = [0, 0, 0];
      for (let at = start[faces[corner]]; at < start[faces[corner] + 1]; at++) {
        const m = own.subarray(3 * around[at], 3 * around[at] + 3);
        if (dot(n, m) >= limit * length * Math.hypot(...m)) for (let k = 0; k < 3; k++) sum[k] += m[k];
      }
      normals.set(unit(sum), 3 * corner);
    }
    return normals;
  }

  // --- drawing ---

  const canvas = document.createElement("canvas");
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: true });

  function program([vertex, fragment]) {
    const made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    const places = {};
    for (let at = 0; at < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); at++) {
      const { name } = gl.getActiveUniform(made, at);
      places[name] = gl.getUniformLocation(made, name);
    }
    return { made, places };
  }

  function attribute(of, name, values, width) {
    const place = gl.getAttribLocation(of.made, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, width, values instanceof Uint8Array ? gl.UNSIGNED_BYTE : gl.FLOAT, false, 0, 0);
  }

  // A vertex array of lines between the rows `ends` of `values`.
  function lines(values, width, ends) {
    const count = ends.length / 2;
    const [from, to, side] = [new Float32Array(18 * count), new Float32Array(18 * count), new Float32Array(12 * count)];
    const corners = [[0, -0.5], [1, -0.5], [1, 0.5], [0, -0.5], [1, 0.5], [0, 0.5]];
    for (let line = 0; line < count; line++)
      for (let k = 0; k < 6; k++) {
        for (let i = 0; i < width; i++) {
          from[18 * line + 3 * k + i] = values[ends[2 * line] * width + i];
          to[18 * line + 3 * k + i] = values[ends[2 * line + 1] * width + i];
        }
        side.set(corners[k], 12 * line + 2 * k);
      }
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    attribute(stroke, "from", from, 3);
    attribute(stroke, "to", to, 3);
    attribute(stroke, "side", side, 2);
    return { array, count: 6 * count };
  }

  const state = { mode: 0, chosen: -1, axes: null, zoom: 1, shift: [0, 0] };
  const cards = [];
  let paint, stroke, shape;

  function start() {
    paint = program(FACES);
    stroke = program(LINES);
    const colours = new Uint8Array([...facts.scales.angle, ...facts.scales.area].flatMap((hex) =>
      [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16))));
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, colours.length / 6, 2, 0, gl.RGB, gl.UNSIGNED_BYTE, colours);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.LINEAR);
    gl.enable(gl.DEPTH_TEST);
  }

  async function readShape() {
    const given = await file(facts.shape);
    if (given.large) throw new Error(`${given.large.toLocaleString()} faces are too many for the viewer: pictures only.`);
    const faces = connected(given.places, given.faces), order = summed(given.order);
    const steps = places(given.vertices, faces, given.box.bits), vertices = points(steps, given.box);
    const positions = gathered(vertices, 3, faces);
    shape = {
      steps, box: given.box, outer: sharing(faces), vertices, faces, order, positions, normals: cornerNormals(positions, faces, vertices.length / 3),
      sky: gathered(places(given.sky, faces, facts.sky), 2, faces).map((step) => step / (2 ** facts.sky - 1)),
      centre: given.centre, half: given.half, size: given.size, axes: given.axes.flat(),
    };
    state.axes = shape.axes;
  }

  class Tile {
    constructor(card, element, plane) {
      Object.assign(this, { card, element, plane, zoom: 1, shift: [0, 0] });
      this.context = element.getContext("2d");
      listen(this);
    }
    // What is shared by all tiles of the surface, and each layout's own.
    get look() { return this.plane ? this : state; }
    get origin() { return [0, 1].map((k) => (this.plane ? this.card.middle[k] : 0) + this.look.shift[k]); }
    get half() { return (this.plane ? this.card.half : shape.half) / this.look.zoom; }
    uniforms({ places }, width, height) {
      const reach = Math.min(width, height) / 2;
      gl.uniform2f(places.scale, reach / (width / 2) / this.half, reach / (height / 2) / this.half);
      gl.uniform2f(places.shift, ...this.origin);
      gl.uniform1f(places.depth, this.plane ? 1 : 1 / shape.size);
      gl.uniform1i(places.plane, this.plane);
      gl.uniformMatrix3fv(places.axes, true, state.axes);
      gl.uniform3fv(places.centre, shape.centre);
    }
    faces(width, height, picking) {
      gl.useProgram(paint.made);
      this.uniforms(paint, width, height);
      gl.uniform1i(paint.places.mode, state.mode);
      gl.uniform1i(paint.places.picking, picking);
      gl.uniform1i(paint.places.chosen, state.chosen);
      gl.uniform1f(paint.places.fields, FIELDS / shape.size);
      gl.bindVertexArray(this.card.array);
      gl.drawArrays(gl.TRIANGLES, 0, shape.faces.length);
    }
    stroke(lines, width, height, colour, pixels) {
      if (!lines.count) return;
      gl.useProgram(stroke.made);
      this.uniforms(stroke, width, height);
      gl.uniform2f(stroke.places.pixel, 2 / width, 2 / height);
      gl.uniform1f(stroke.places.width, pixels * devicePixelRatio);
      gl.uniform4fv(stroke.places.tone, colour);
      gl.bindVertexArray(lines.array);
      gl.drawArrays(gl.TRIANGLES, 0, lines.count);
    }
    draw() {
      const box = this.element.getBoundingClientRect();
      const [width, height] = [box.width, box.height].map((side) => Math.max(1, Math.round(side * devicePixelRatio)));
      if (canvas.width < width || canvas.height < height) [canvas.width, canvas.height] = [Math.max(canvas.width, width), Math.max(canvas.height, height)];
      Object.assign(this.element, { width, height });
      gl.viewport(0, 0, width, height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      this.faces(width, height, false);
      const green = [0, 0.72, 0.22, 1], ink = dark.matches ? [0.75, 0.75, 0.73, 1] : [0.13, 0.13, 0.15, 1];
      const showing = state.mode === 4 || (!this.plane && state.mode === 0);
      if (this.plane) this.stroke(this.card.border, width, height, ink, 1);
      if (this.plane) this.stroke(this.card.cut, width, height, showing ? green : ink, showing ? 1.6 : 1);
      else if (showing) this.stroke(this.card.seams, width, height, green, 2);
      this.context.clearRect(0, 0, width, height);
      this.context.drawImage(canvas, 0, canvas.height - height, width, height, 0, 0, width, height);
      this.mark(width, height);
    }
    // A ring around the chosen face, which may be smaller than a pixel; dashed where it is turned away.
    mark(width, height) {
      if (state.chosen < 0) return;
      const source = this.plane ? this.card.uv : shape.positions;
      const size = this.plane ? 2 : 3, first = 3 * size * state.chosen;
      let middle = [0, 1, 2].map((k) => (source[first + k] + source[first + size + k] + source[first + 2 * size + k]) / 3);
      let hidden = false;
      if (!this.plane) {
        const rows = [0, 3, 6].map((at) => state.axes.slice(at, at + 3));
        const from = middle.map((x, k) => x - shape.centre[k]);
        const normal = [0, 1, 2].map((k) => shape.normals[first + k] + shape.normals[first + 3 + k] + shape.normals[first + 6 + k]);
        hidden = dot(rows[2], normal) < 0;
        middle = rows.map((row) => dot(row, from));
      }
      const shift = this.origin;
      const scale = Math.min(width, height) / 2 / this.half;
      const [x, y] = [width / 2 + (middle[0] - shift[0]) * scale, height / 2 - (middle[1] - shift[1]) * scale];
      for (const [colour, line] of [["#fff", 4], ["#c02080", 2]]) {
        this.context.beginPath();
        this.context.setLineDash(hidden ? [3 * devicePixelRatio, 3 * devicePixelRatio] : []);
        this.context.lineWidth = line * devicePixelRatio;
        this.context.strokeStyle = colour;
        this.context.arc(x, y, 7 * devicePixelRatio, 0, 2 * Math.PI);
        this.context.stroke();
      }
    }
    // The face at a place of the tile (in CSS pixels), -1 for none.
    face(x, y) {
      const box = this.element.getBoundingClientRect();
      gl.bindFramebuffer(gl.FRAMEBUFFER, probe());
      gl.viewport(-Math.floor(x), -Math.floor(box.height - y), box.width, box.height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      this.faces(box.width, box.height, true);
      const pixel = new Uint8Array(4);
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      return pixel[0] + 256 * pixel[1] + 65536 * pixel[2] - 1;
    }
  }

  let found;
  // A frame buffer of one pixel.
  function probe() {
    if (found) return found;
    found = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, found);
    for (const [place, format] of [[gl.COLOR_ATTACHMENT0, gl.RGBA8], [gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24]]) {
      const buffer = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, 1, 1);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, buffer);
    }
    return found;
  }

  let waiting = false;
  function draw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      for (const card of cards) if (card.near) for (const tile of card.tiles) tile.draw();
    });
  }

  // --- hands: pointer, wheel, keys ---

  function turn(x, y) { // by angles about the screen's axes
    const [right, up, back] = [0, 3, 6].map((at) => state.axes.slice(at, at + 3));
    const mix = (a, b, angle) => a.map((value, k) => Math.cos(angle) * value + Math.sin(angle) * b[k]);
    const sideways = mix(back, right, -x);
    const toward = unit(mix(sideways, up, y));
    const level = unit(cross(mix(up, sideways, -y), toward));
    state.axes = [...level, ...cross(toward, level), ...toward];
  }

  function move(tile, x, y) {
    const box = tile.element.getBoundingClientRect();
    if (!tile.plane) return turn((x / box.width) * Math.PI, (y / box.width) * Math.PI);
    const step = (2 * tile.half) / Math.min(box.width, box.height);
    tile.shift[0] -= x * step;
    tile.shift[1] += y * step;
  }

  function zoom(tile, factor) { tile.look.zoom = Math.min(Math.max(tile.look.zoom * factor, 0.5), 60); }

  function reset(tile) {
    Object.assign(tile.look, { zoom: 1, shift: [0, 0] });
    if (!tile.plane) state.axes = shape.axes;
  }

  function choose(face) {
    if (face === state.chosen) return;
    state.chosen = face;
    for (const card of cards) card.tell();
    draw();
  }

  function listen(tile) {
    const { element } = tile;
    let held = null;
    const at = (event) => { const box = element.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    element.addEventListener("pointerdown", (event) => { held = [event.clientX, event.clientY]; element.setPointerCapture(event.pointerId); });
    for (const end of ["pointerup", "pointercancel"]) element.addEventListener(end, () => { held = null; });
    element.addEventListener("pointermove", (event) => {
      if (held) {
        move(tile, event.clientX - held[0], event.clientY - held[1]);
        held = [event.clientX, event.clientY];
        draw();
      } else choose(tile.face(...at(event)));
    });
    element.addEventListener("pointerleave", () => { if (!held) choose(-1); });
    element.addEventListener("blur", () => choose(-1));
    element.addEventListener("dblclick", () => { reset(tile); draw(); });
    element.addEventListener("wheel", (event) => {
      // The page scrolls unless the tile was clicked into.
      if (document.activeElement !== element && !event.ctrlKey) return;
      event.preventDefault();
      zoom(tile, Math.exp(-event.deltaY / 400));
      draw();
    }, { passive: false });
    element.addEventListener("keydown", (event) => {
      const steps = { ArrowLeft: [-24, 0], ArrowRight: [24, 0], ArrowUp: [0, -24], ArrowDown: [0, 24] };
      if (event.key in steps) move(tile, ...steps[event.key].map((step) => (tile.plane ? -step : step)));
      else if (event.key === "+" || event.key === "=") zoom(tile, 1.25);
      else if (event.key === "-") zoom(tile, 0.8);
      else if (event.key === "0") reset(tile);
      else return;
      event.preventDefault();
      const box = element.getBoundingClientRect();
      choose(tile.face(box.width / 2, box.height / 2)); // what a hand without a pointer points at
      draw();
    });
  }

  // --- the page ---

  class Card {
    constructor(element) {
      Object.assign(this, { element, near: false, ready: false, tiles: [] });
      this.note = element.querySelector(".chosen");
    }
    async read() {
      const given = await file(this.element.dataset.map);
      const moved = summed(given.moved), kind = given.state;
      const corners = shape.faces.slice();
      for (let at = 0; at < moved.length; at += 2) corners[moved[at]] = moved[at + 1];
      const vertexOf = Uint32Array.from({ length: corners.reduce((most, row) => Math.max(most, row), 0) + 1 }, (_, row) => row);
      for (let at = 0; at < moved.length; at += 2) vertexOf[moved[at + 1]] = shape.faces[moved[at]];
      const space = (row) => [0, 1, 2].map((k) => shape.steps[3 * vertexOf[row] + k]);
      const steps = places(given.uv, corners, given.box.bits, space);
      const rows = points(steps, given.box);
      const { angle, area } = given;
      for (let face = 0; face < kind.length; face++) {
        const own = [0, 1, 2].map((k) => corners[3 * face + k]);
        const [a, b] = kind[face] % 2 ? [facts.levels + 1, facts.levels + 1]
          : rough(own.map(space), own.map((row) => [steps[2 * row], steps[2 * row + 1]]), step(given.box) / step(shape.box));
        angle[face] += a;
        area[face] += b;
      }
      const open = sharing(corners), border = [], seams = [];
      for (let at = 0; at < corners.length; at++)
        if (open[at] === 1 && kind[Math.floor(at / 3)] < 4) (shape.outer[at] === 1 ? border : seams).push(corners[at], corners[at % 3 === 2 ? at - 2 : at + 1]);
      Object.assign(this, { uv: gathered(rows, 2, corners), angle, area, kind });
      const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
      for (let at = 0; at < this.uv.length; at++) {
        low[at % 2] = Math.min(low[at % 2], this.uv[at]);
        high[at % 2] = Math.max(high[at % 2], this.uv[at]);
      }
      this.middle = low.map((x, k) => (x + high[k]) / 2);
      this.half = (Math.max(high[0] - low[0], high[1] - low[1]) / 2) * 1.04 || 1;
      const heat = new Uint8Array(3 * corners.length);
      for (let corner = 0; corner < corners.length; corner++) {
        const face = Math.floor(corner / 3);
        heat.set([angle[face], area[face], kind[face]], 3 * corner);
      }
      this.array = gl.createVertexArray();
      gl.bindVertexArray(this.array);
      attribute(paint, "position", shape.positions, 3);
      attribute(paint, "normal", shape.normals, 3);
      attribute(paint, "uv", this.uv, 2);
      attribute(paint, "heat", heat, 3);
      attribute(paint, "sky", shape.sky, 2);
      this.border = lines(rows, 2, border);
      this.cut = lines(rows, 2, seams);
      this.seams = lines(shape.vertices, 3, seams.map((row) => vertexOf[row]));
      for (const [at, place] of [...this.element.querySelectorAll(".tile")].entries()) {
        const surface = document.createElement("canvas");
        surface.tabIndex = 0;
        surface.setAttribute("role", "img");
        surface.setAttribute("aria-label", place.dataset.label);
        place.replaceChildren(surface);
        this.tiles.push(new Tile(this, surface, at === 1));
      }
      this.element.dataset.ready = "";
      this.ready = true;
    }
    async show() {
      this.near = true;
      if (!this.started) {
        this.started = true;
        try { await this.read(); } catch (error) { this.note.textContent = `No 3D view: ${error.message}`; }
      }
      draw();
    }
    tell() {
      if (!this.ready) return;
      const face = state.chosen;
      const value = ([low, high], step) => 2 ** (low + ((high - low) * step) / facts.levels);
      const words = (step, name, limits) => step > facts.levels ? `${name} not defined`
        : `${name} ${step === facts.levels ? "≥ " : step === 0 && limits[0] < 0 ? "≤ " : ""}${value(limits, step).toFixed(2)}`;
      this.note.textContent = face < 0 ? "" : `face ${shape.order[face]}: ${words(this.angle[face], "stretch", facts.limits.angle)}, `
        + `${words(this.area[face], "area ×", facts.limits.area)}${["", ", spans a seam", ", flipped", ", flipped", "", ", left out by the map"][this.kind[face]]}`;
    }
  }

  function modes() {
    for (const button of document.querySelectorAll("input[name=mode]"))
      button.addEventListener("change", () => {
        state.mode = MODES.indexOf(button.value);
        for (const legend of document.querySelectorAll("[data-legend]")) legend.hidden = legend.dataset.legend !== button.value;
        draw();
      });
    document.getElementById("reset").addEventListener("click", () => {
      for (const card of cards) for (const tile of card.tiles) reset(tile);
      draw();
    });
  }

  async function run() {
    if (!facts.shape) return;
    if (!gl) throw new Error("this browser has no WebGL 2: pictures only.");
    start();
    await readShape();
    modes();
    for (const element of document.querySelectorAll("article[data-map]")) cards.push(new Card(element));
    const watch = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        const card = cards.find((one) => one.element === entry.target);
        if (entry.isIntersecting) card.show();
        else card.near = false;
      }
    }, { rootMargin: "300px" });
    for (const card of cards) watch.observe(card.element);
    addEventListener("resize", draw);
    dark.addEventListener("change", draw);
    document.documentElement.dataset.viewer = "ready";
    say.hidden = true;
  }

  document.getElementById("model").addEventListener("change", (event) => { location.href = event.target.value; });
  run().catch((error) => { say.textContent = `No 3D views: ${error.message}`; document.body.dataset.viewer = "none"; });
})();
