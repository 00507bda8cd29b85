// The 3-D view of a report: surface and cuts, before and after, recorded points with arrows, a ball. WebGL 2, no library.
"use strict";
(() => {
  const holder = document.getElementById("scene");
  const said = JSON.parse(document.getElementById("scene-data").textContent);
  const canvas = holder.querySelector("canvas");
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });
  if (!gl) {
    holder.classList.add("no-webgl");
    return;
  }
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const floats = (text) => new Float32Array(bytes(text));
  const points = floats(said.points), triangles = new Uint32Array(bytes(said.triangles));
  const fields = said.fields.map((field) => ({ ...field, values: floats(field.values) }));
  const where = floats(said.recorded);
  const arrows = said.arrows.map((one) => ({ ...one, vectors: floats(one.vectors), shown: one.shown }));

  // middle and size of the body
  const low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
  for (let i = 0; i < points.length; i++) {
    low[i % 3] = Math.min(low[i % 3], points[i]);
    high[i % 3] = Math.max(high[i % 3], points[i]);
  }
  const middle = low.map((value, k) => (value + high[k]) / 2);
  let size = 1e-6;
  for (let i = 0; i < points.length; i += 3) size = Math.max(size, Math.hypot(...middle.map((value, k) => points[i + k] - value)));

  // small linear algebra: rotations as rows of three vectors
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => { const l = Math.hypot(...a) || 1; return a.map((value) => value / l); };
  const times = (A, B) => A.map((row) => [0, 1, 2].map((j) => row[0] * B[0][j] + row[1] * B[1][j] + row[2] * B[2][j]));
  const about = (axis, angle) => {
    const c = Math.cos(angle), s = Math.sin(angle);
    return axis === 0 ? [[1, 0, 0], [0, c, -s], [0, s, c]] : [[c, 0, s], [0, 1, 0], [-s, 0, c]];
  };
  // picture axes right, up, towards the viewer, in RAS
  const VIEWS = {
    front: [[-1, 0, 0], [0, 0, 1], [0, 1, 0]],
    left: [[0, -1, 0], [0, 0, 1], [-1, 0, 0]],
    above: [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
  };
  const START = times(about(0, 0.35), times(about(1, -0.6), VIEWS.front));
  const eye = { R: START, zoom: 1, shift: [0, 0] };

  const VERTEX = `#version 300 es
    in vec3 place, normal; in vec4 colour;
    uniform mat3 R; uniform vec3 middle; uniform vec2 scale, shift; uniform float depth;
    out vec3 n; out vec4 c;
    void main() {
      vec3 p = R * (place - middle);
      n = R * normal; c = colour;
      gl_Position = vec4(p.xy * scale + shift, -p.z / depth, 1.0);
    }`;
  const FRAGMENT = `#version 300 es
    precision mediump float;
    in vec3 n; in vec4 c; uniform float opacity; out vec4 found;
    void main() {
      float light = 0.55 + 0.45 * abs(normalize(n).z);
      float a = c.a * opacity;
      found = vec4(c.rgb * light * a, a);
    }`;
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  ["place", "normal", "colour"].forEach((name, k) => gl.bindAttribLocation(program, k, name));
  gl.linkProgram(program);
  gl.useProgram(program);
  const uniform = (name) => gl.getUniformLocation(program, name);

  const body = () => {
    const array = gl.createVertexArray(), buffers = [0, 1, 2, 3].map(() => gl.createBuffer());
    let count = 0;
    const send = (k, data, width, type, normalized) => {
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[k]);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(k);
      gl.vertexAttribPointer(k, width, type, normalized, 0, 0);
    };
    return {
      places: (data) => send(0, data, 3, gl.FLOAT, false),
      normals: (data) => send(1, data, 3, gl.FLOAT, false),
      colours: (data) => send(2, data, 4, gl.UNSIGNED_BYTE, true),
      faces: (data) => {
        gl.bindVertexArray(array);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[3]);
        gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, data, gl.STATIC_DRAW);
        count = data.length;
      },
      draw: (opacity) => {
        gl.bindVertexArray(array);
        gl.uniform1f(uniform("opacity"), opacity);
        gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0);
      },
    };
  };

  // the anatomy and planes through it, all of triangles that move
  const minus = (a, b) => a.map((value, k) => value - b[k]);
  const skin = (points, triangles, moves, values) => {
    const shown = body(), moved = new Float32Array(points), normals = new Float32Array(points.length);
    const at = (i) => [moved[3 * i], moved[3 * i + 1], moved[3 * i + 2]];
    const move = (factor) => {
      if (moves) for (let i = 0; i < points.length; i++) moved[i] = points[i] + factor * moves[i];
      normals.fill(0);
      for (let f = 0; f < triangles.length; f += 3) {
        const [a, b, c] = [0, 1, 2].map((k) => at(triangles[f + k])), n = cross(minus(b, a), minus(c, a));
        for (let k = 0; k < 3; k++) for (let j = 0; j < 3; j++) normals[3 * triangles[f + k] + j] += n[j];
      }
      for (let i = 0; i < normals.length; i += 3) normals.set(unit([...normals.slice(i, i + 3)]), i);
      shown.places(moved);
      shown.normals(normals);
    };
    shown.faces(triangles);
    return { move, values, colours: shown.colours, draw: shown.draw, shown: false };
  };
  const anatomy = skin(points, triangles, said.moves && floats(said.moves), fields.map((field) => field.values));
  const cuts = said.cuts.map((cut) =>
    skin(floats(cut.points), new Uint32Array(bytes(cut.triangles)), cut.moves && floats(cut.moves), cut.values.map(floats)));
  const move = (factor) => { for (const one of [anatomy, ...cuts]) one.move(factor); };
  const shade = (part) => {
    const stops = said.colours, at = Math.max(0, Math.min(1, part)) * (stops.length - 1), k = Math.min(stops.length - 2, Math.floor(at));
    return stops[k].map((value, j) => value + (at - k) * (stops[k + 1][j] - value));
  };
  const paint = (number) => {
    const field = fields[number], span = field.high - field.low || 1;
    for (const one of [anatomy, ...cuts]) {
      const values = one.values[number], colours = new Uint8Array(4 * values.length);
      for (let i = 0; i < values.length; i++) colours.set([...shade((values[i] - field.low) / span), 255], 4 * i);
      one.colours(colours);
    }
    const bar = holder.querySelector(".bar");
    bar.querySelector(".low").textContent = field.low_text;
    bar.querySelector(".high").textContent = field.high_text;
    bar.querySelector(".label").textContent = field.label;
    const mark = bar.querySelector(".mark"), place = field.mark === null ? -1 : (field.mark - field.low) / span;
    mark.hidden = !(place > 0 && place < 1);
    mark.style.left = `${100 * place}%`;
    mark.title = field.mark_text;
    bar.querySelector(".mark-text").textContent = mark.hidden ? field.note : field.mark_text;
  };

  // shafts with cones, little octahedra, a ball: all as triangles
  const shapes = body(), ball = body();
  const shape = { places: [], normals: [], colours: [], faces: [] };
  const ring = (from, direction, radius, across, colour) => {
    const start = shape.places.length / 3;
    for (let k = 0; k < 6; k++) {
      const c = Math.cos((k * Math.PI) / 3), s = Math.sin((k * Math.PI) / 3);
      const out = across[0].map((value, j) => c * value + s * across[1][j]);
      shape.places.push(...from.map((value, j) => value + radius * out[j]));
      shape.normals.push(...out);
      shape.colours.push(...colour, 255);
    }
    return start;
  };
  const join = (a, b) => {
    for (let k = 0; k < 6; k++) shape.faces.push(a + k, a + ((k + 1) % 6), b + k, b + k, a + ((k + 1) % 6), b + ((k + 1) % 6));
  };
  const arrow = (from, vector, colour, width) => {
    const length = Math.hypot(...vector), d = unit(vector);
    const first = unit(cross(d, Math.abs(d[0]) < 0.8 ? [1, 0, 0] : [0, 1, 0])), across = [first, cross(d, first)];
    const head = Math.min(5 * width, 0.5 * length), neck = from.map((value, k) => value + (length - head) * d[k]);
    const tip = from.map((value, k) => value + vector[k]);
    join(ring(from, d, width, across, colour), ring(neck, d, width, across, colour));
    join(ring(neck, d, 2.4 * width, across, colour), ring(tip, d, 0, across, colour));
  };
  const dot = (from, radius, colour) => {
    const start = shape.places.length / 3;
    for (const n of [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]]) {
      shape.places.push(...from.map((value, k) => value + radius * n[k]));
      shape.normals.push(...n);
      shape.colours.push(...colour, 255);
    }
    for (const f of [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]) shape.faces.push(...f.map((k) => start + k));
  };
  let enlarged = said.enlarged;
  const fill = () => {
    for (const key of Object.keys(shape)) shape[key].length = 0;
    for (let i = 0; i < where.length; i += 3) dot([...where.slice(i, i + 3)], 0.009 * size, [70, 70, 70]);
    for (const one of arrows) {
      if (!one.shown) continue;
      for (let i = 0; i < where.length; i += 3) {
        const vector = [0, 1, 2].map((k) => enlarged * one.vectors[i + k]);
        if (Math.hypot(...vector) > 1e-3 * size) arrow([...where.slice(i, i + 3)], vector, one.colour, 0.007 * size);
      }
    }
    shapes.places(new Float32Array(shape.places));
    shapes.normals(new Float32Array(shape.normals));
    shapes.colours(new Uint8Array(shape.colours));
    shapes.faces(new Uint32Array(shape.faces));
  };
  if (said.ball) {
    const places = [], out = [], colours = [], faces = [], M = 24, N = 48;
    for (let i = 0; i <= M; i++) for (let j = 0; j <= N; j++) {
      const a = (Math.PI * i) / M, b = (2 * Math.PI * j) / N, n = [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)];
      places.push(...said.ball.centre.map((value, k) => value + said.ball.radius * n[k]));
      out.push(...n);
      colours.push(0, 158, 115, 255);
      if (i < M && j < N) { const k = i * (N + 1) + j; faces.push(k, k + 1, k + N + 1, k + 1, k + N + 2, k + N + 1); }
    }
    ball.places(new Float32Array(places));
    ball.normals(new Float32Array(out));
    ball.colours(new Uint8Array(colours));
    ball.faces(new Uint32Array(faces));
  }

  const state = { opacity: 0.3, ball: true };
  const triad = holder.querySelector(".triad");
  let waiting = false;
  const draw = () => {
    waiting = false;
    const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(h * ratio);
    }
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const least = Math.min(w, h), scale = (eye.zoom * least) / (1.06 * size);
    gl.uniform2f(uniform("scale"), scale / w, scale / h);
    gl.uniform2f(uniform("shift"), (2 * eye.shift[0]) / w, (2 * eye.shift[1]) / h);
    gl.uniform3fv(uniform("middle"), middle);
    gl.uniform1f(uniform("depth"), 2.5 * size);
    gl.uniformMatrix3fv(uniform("R"), true, eye.R.flat());
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    gl.disable(gl.BLEND);
    if (where.length) shapes.draw(1);
    for (const cut of cuts) if (cut.shown) cut.draw(1);
    const solid = state.opacity > 0.995;
    if (solid) anatomy.draw(1);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    if (said.ball && state.ball) ball.draw(0.55);
    if (!solid) {
      // what is farther first: back faces, then front faces
      gl.enable(gl.CULL_FACE);
      for (const side of [gl.FRONT, gl.BACK]) {
        gl.cullFace(side);
        anatomy.draw(state.opacity);
      }
    }
    ["R", "A", "S"].forEach((letter, k) => {
      const x = 40 + 28 * eye.R[0][k], y = 40 - 28 * eye.R[1][k], line = triad.querySelector(`.line-${letter}`), text = triad.querySelector(`.text-${letter}`);
      line.setAttribute("x2", x);
      line.setAttribute("y2", y);
      text.setAttribute("x", 40 + 1.28 * (x - 40));
      text.setAttribute("y", 40 + 1.28 * (y - 40));
    });
  };
  const redraw = () => { if (!waiting) { waiting = true; requestAnimationFrame(draw); } };
  const rotate = (dx, dy) => { eye.R = times(about(0, dy), times(about(1, dx), eye.R)); redraw(); };
  const pan = (dx, dy) => { eye.shift = [eye.shift[0] + dx, eye.shift[1] - dy]; redraw(); };
  const zoom = (factor) => {
    const before = eye.zoom;
    eye.zoom = Math.max(0.3, Math.min(30, before * factor));
    // the middle of the picture stays where it is
    eye.shift = eye.shift.map((value) => (value * eye.zoom) / before);
    redraw();
  };
  const look = (name) => { Object.assign(eye, { R: VIEWS[name] || START, zoom: 1, shift: [0, 0] }); redraw(); };

  const held = new Map();
  canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); held.set(e.pointerId, [e.clientX, e.clientY]); });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (e) => held.delete(e.pointerId));
  canvas.addEventListener("pointermove", (e) => {
    const before = held.get(e.pointerId);
    if (!before) return;
    const dx = e.clientX - before[0], dy = e.clientY - before[1];
    held.set(e.pointerId, [e.clientX, e.clientY]);
    if (held.size === 2) {
      const [other] = [...held].filter(([id]) => id !== e.pointerId).map(([, value]) => value);
      const apart = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]) || 1;
      zoom(apart([e.clientX, e.clientY]) / apart(before));
      pan(dx / 2, dy / 2);
    } else if (e.shiftKey || e.buttons & 6) pan(dx, dy);
    else rotate(0.01 * dx, 0.01 * dy);
  });
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
  canvas.addEventListener("wheel", (e) => { e.preventDefault(); zoom(Math.exp(-0.0015 * e.deltaY)); }, { passive: false });
  canvas.addEventListener("keydown", (e) => {
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
    if (steps) e.shiftKey ? pan(20 * steps[0], 20 * steps[1]) : rotate(0.12 * steps[0], 0.12 * steps[1]);
    else if (e.key === "+" || e.key === "=") zoom(1.15);
    else if (e.key === "-") zoom(1 / 1.15);
    else if (e.key === "0" || e.key === "Home") look("start");
    else return;
    e.preventDefault();
  });

  holder.querySelectorAll("input[name=field]").forEach((input) => input.addEventListener("change", () => { paint(+input.value); redraw(); }));
  holder.querySelectorAll("input[name=arrows]").forEach((input) => input.addEventListener("change", () => { arrows[+input.value].shown = input.checked; fill(); redraw(); }));
  holder.querySelectorAll("button[data-view]").forEach((button) => button.addEventListener("click", () => look(button.dataset.view)));
  const on = (name, act) => holder.querySelector(`input[name=${name}]`)?.addEventListener("input", (e) => { act(e.target); redraw(); });
  on("opacity", (input) => { state.opacity = +input.value; });
  on("enlarged", (input) => { enlarged = +input.value; input.nextElementSibling.textContent = `${enlarged} times`; fill(); });
  on("moves", (input) => { input.nextElementSibling.textContent = `${input.value} times`; move(+input.value); });
  holder.querySelectorAll("input[name=cuts]").forEach((input) => input.addEventListener("change", () => { cuts[+input.value].shown = input.checked; redraw(); }));
  on("ball", (input) => { state.ball = input.checked; });
  new ResizeObserver(redraw).observe(canvas);
  holder.classList.add("ready");
  move(said.exaggeration);
  paint(0);
  fill();
  draw();
})();
