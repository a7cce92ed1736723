// A surface that moves, drawn by WebGL 2: played or at an instant, turned, enlarged, with axes and colours.
// showSurface(holder, surface) gives { show(motion) }; docs of the data: viewer.py.
const showSurface = (() => {
  const RAMPS = {
    viridis: [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37]],
    coolwarm: [[59, 76, 192], [98, 130, 234], [141, 176, 254], [185, 208, 249], [221, 220, 220], [245, 196, 172], [244, 152, 122], [221, 95, 75], [180, 4, 38]],
  };
  const PERIOD = 3000; // milliseconds in which a period is played
  const VERTEX = `#version 300 es
in vec3 place; in vec3 move; in float colour;
uniform mat3 turn; uniform vec3 centre; uniform vec2 shift; uniform vec2 stretch;
uniform float amount; uniform float depth; uniform float behind;
out vec3 seen; out float shade;
void main() {
  seen = turn * (place + amount * move - centre);
  shade = colour;
  gl_Position = vec4((seen.xy + shift) * stretch, -seen.z * depth + behind, 1.0);
}`;
  const FRAGMENT = `#version 300 es
precision highp float;
in vec3 seen; in float shade;
uniform sampler2D ramp; uniform vec4 plain; uniform bool lit;
out vec4 result;
void main() {
  vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
  float light = lit ? 0.6 + 0.4 * abs(dot(normal, normalize(vec3(0.3, 0.5, 1.0)))) : 1.0;
  vec4 own = plain.a > 0.0 ? plain : vec4(texture(ramp, vec2(shade * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb, 1.0);
  result = vec4(light * own.rgb, own.a);
}`;
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const product = (a, b) => a.map((row) => [0, 1, 2].map((j) => row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j]));
  const aboutX = (t) => [[1, 0, 0], [0, Math.cos(t), -Math.sin(t)], [0, Math.sin(t), Math.cos(t)]];
  const aboutY = (t) => [[Math.cos(t), 0, Math.sin(t)], [0, 1, 0], [-Math.sin(t), 0, Math.cos(t)]];
  const rounded = (value) => Number(value.toPrecision(3));

  // a largest value for a bar of colours, and into how many parts its ticks cut it
  function roundTop(largest) {
    if (!(largest > 0)) return [1, 5];
    const power = 10 ** Math.floor(Math.log10(largest));
    const [lead, parts] = [[1, 5], [1.5, 3], [2, 4], [2.5, 5], [3, 3], [4, 4], [5, 5], [6, 3], [8, 4], [10, 5]].find(([lead]) => largest <= lead * power * (1 + 1e-9)) || [10, 5];
    return [lead * power, parts];
  }
  function lengthUnit(largest) {
    return [[1, "m"], [1e-3, "mm"], [1e-6, "µm"], [1e-9, "nm"]].find(([factor]) => largest >= 0.5 * factor) || [1e-9, "nm"];
  }
  function roundFactor(value) {
    if (!(value > 0)) return 1;
    const power = 10 ** Math.floor(Math.log10(value));
    return power * Math.max(...[1, 2, 5].filter((lead) => lead * power <= value * (1 + 1e-9)));
  }
  function made(kind, place, properties = {}, ...children) {
    const found = Object.assign(document.createElement(kind), properties);
    found.append(...children);
    place.append(found);
    return found;
  }

  return function showSurface(holder, surface) {
    // --- what is on the page ---
    const root = made("div", holder, { className: "viewer" });
    const picture = made("div", root, { className: "viewer-picture" });
    const canvas = made("canvas", picture, { tabIndex: 0, className: "viewer-canvas" });
    canvas.setAttribute("aria-label", "the structure; drag to turn it, shift and drag to move it, wheel to enlarge it");
    const axes = made("canvas", picture, { className: "viewer-axes" });
    const said = made("div", picture, { className: "viewer-said" });
    const bar = made("div", root, { className: "viewer-bar" });
    const play = made("button", bar, { type: "button", className: "viewer-play" });
    const slider = made("input", made("label", bar, {}, "instant "), { type: "range", min: 0, max: 1, step: "any", value: 0, className: "viewer-instant" });
    const size = made("input", made("label", bar, {}, "size "), { type: "range", min: 0, max: 4, step: 0.01, value: 1, className: "viewer-size" });
    const back = made("button", bar, { type: "button", textContent: "first view", className: "viewer-home" });
    const legend = made("div", root, { className: "viewer-legend" });
    const label = made("div", legend, { className: "viewer-label" });
    const strip = made("canvas", legend, { width: 256, height: 1, className: "viewer-strip" });
    const ticks = made("div", legend, { className: "viewer-ticks" });

    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    if (!gl) {
      said.textContent = "This browser offers no WebGL 2, so nothing can be drawn.";
      root.dataset.state = "no WebGL 2";
      return { show() {}, root };
    }

    // --- the surface ---
    const points = new Float32Array(bytes(surface.points)), surfaceCount = surface.count;
    const moves = surface.moves.map((text) => new Int16Array(bytes(text)));
    const gap = new Float32Array(bytes(surface.gap)), moved = new Float32Array(points.length);
    const shades = new Float32Array(points.length / 3);
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const part = gl.createShader(kind);
      gl.shaderSource(part, source);
      gl.compileShader(part);
      if (!gl.getShaderParameter(part, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(part));
      gl.attachShader(program, part);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    const uniform = (name) => gl.getUniformLocation(program, name);
    function attribute(name, count) {
      const buffer = gl.createBuffer(), at = gl.getAttribLocation(program, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, count, gl.FLOAT, false, 0, 0);
      return (values) => {
        gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
        gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
      };
    }
    attribute("place", 3)(points);
    const setMoves = attribute("move", 3), setShades = attribute("colour", 1);
    function indices(text) {
      const values = new Uint32Array(bytes(text)), buffer = gl.createBuffer();
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, values, gl.STATIC_DRAW);
      return { buffer, count: values.length };
    }
    const faces = indices(surface.triangles), edges = indices(surface.edges);
    const bodies = surface.bodies.map((body) => ({ ...indices(body.triangles), colour: body.colour }));
    bodies.sort((a, b) => b.colour[3] - a.colour[3]); // what is seen through comes last
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < points.length; i++) {
      low[i % 3] = Math.min(low[i % 3], points[i]);
      high[i % 3] = Math.max(high[i % 3], points[i]);
    }
    const centre = low.map((a, k) => (a + high[k]) / 2), half = low.map((a, k) => (high[k] - a) / 2);
    const radius = Math.hypot(...half) || 1;

    function useRamp(name) {
      const stops = RAMPS[name], ramp = new Uint8Array(256 * 4);
      for (let i = 0; i < 256; i++) {
        const at = i / 255 * 8, k = Math.min(Math.floor(at), 7);
        ramp.set([...stops[k].map((c, m) => c + (at - k) * (stops[k + 1][m] - c)), 255], 4 * i);
      }
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, ramp);
      const context = strip.getContext("2d"), image = context.createImageData(256, 1);
      image.data.set(ramp);
      context.putImageData(image, 0, 0);
    }

    // --- the motion: coordinates of the moves at some instants of a period ---
    let motion = null, phase = 0, playing = false, turned = false, before = 0, waiting = false;
    let turn, shift, zoom;
    function home() {
      turn = motion.view || surface.view;
      shift = [0, 0];
      zoom = 1;
      turned = false;
    }
    function frameAt(part) { // the instants before and after a part of the period, and where between them
      const { parts } = motion, count = parts.length;
      let b = parts.findIndex((value) => value > part + 1e-9);
      if (b < 0) b = count;
      const a = (b + count - 1) % count, start = b === 0 ? parts[a] - 1 : parts[a], end = b === count ? parts[0] + 1 : parts[b];
      return [a, b % count, end > start ? (part - start) / (end - start) : 0];
    }
    function moveTo(part) {
      const count = moves.length, swing = Math.cos(2 * Math.PI * part);
      const [a, b, between] = motion.swing ? [0, 0, 0] : frameAt(part);
      moved.fill(0);
      moves.forEach((shape, k) => {
        const q = surface.quanta[k] * (motion.swing ? swing * motion.coordinates[k] : motion.coordinates[a * count + k] * (1 - between) + motion.coordinates[b * count + k] * between);
        if (q !== 0) for (let i = 0; i < moved.length; i++) moved[i] += q * shape[i];
      });
      // modes have no size: their stops stand off by the gap as it is
      const stand = motion.swing ? 1 / (motion.factor * Number(size.value) || Infinity) : 1;
      for (let i = 0; i < gap.length; i++) moved[3 * surfaceCount + i] += stand * gap[i];
      for (let p = 0; p < surfaceCount; p++) {
        if (motion.swing) shades[p] = 0.5 + swing * (motion.colours[p] / 255 - 0.5);
        else if (motion.colours) shades[p] = (motion.colours[a * surfaceCount + p] * (1 - between) + motion.colours[b * surfaceCount + p] * between) / 255;
        else shades[p] = Math.hypot(moved[3 * p], moved[3 * p + 1], moved[3 * p + 2]) / motion.range;
      }
      setMoves(moved);
      setShades(shades);
    }
    function largestMove() {
      let most = 0;
      for (const part of motion.parts) {
        moveTo(part);
        for (let p = 0; p < surfaceCount; p++) most = Math.max(most, Math.hypot(moved[3 * p], moved[3 * p + 1], moved[3 * p + 2]));
      }
      return most;
    }

    function largestFactor() { // at which no stop sinks in further than it may
      const depths = surface.stops.map((stop) => Math.max(...motion.parts.map((_, a) => stop.moves.reduce((sum, move, k) => sum + move * motion.coordinates[a * stop.moves.length + k], -stop.gap))));
      return Math.min(Infinity, ...surface.stops.map((stop, i) => depths[i] > 0 ? stop.room / depths[i] : Infinity));
    }

    function show(given) {
      motion = { ...given, coordinates: new Float32Array(bytes(given.coordinates)), colours: given.colours ? new Uint8Array(bytes(given.colours)) : null, range: 1 };
      const times = given.times ? [...new Float32Array(bytes(given.times))] : [0];
      motion.parts = times.map((time) => given.period ? time / given.period : 0);
      const most = largestMove();
      motion.factor = given.swing ? surface.reach / (most || 1) : roundFactor(Math.min(surface.reach / (most || 1), largestFactor()));
      let [top, parts] = [given.top, given.parts], unit = given.unit;
      if (!motion.colours) {
        const [length, name] = lengthUnit(most);
        [top, parts] = roundTop(most / length);
        motion.range = top * length || 1;
        unit = name;
      }
      useRamp(given.swing ? "coolwarm" : "viridis");
      label.textContent = (given.label || "displacement") + (unit ? `, ${unit}` : "");
      ticks.replaceChildren();
      for (let i = 0; i <= parts; i++) {
        const at = i / parts;
        made("span", ticks, { textContent: String(rounded(given.swing ? top * (2 * at - 1) : top * at)) }).style.left = `${100 * at}%`;
      }
      const still = motion.parts.length < 2 && !given.swing;
      play.hidden = slider.parentNode.hidden = still;
      if (!turned) home();
      setPhase(given.first ? given.first / given.period : 0);
      setPlaying(Boolean(given.swing) && !matchMedia("(prefers-reduced-motion: reduce)").matches && !still);
    }
    function setPhase(part) {
      phase = ((part % 1) + 1) % 1;
      slider.value = phase;
      draw();
    }
    function setPlaying(on) {
      playing = on;
      play.textContent = on ? "❚❚ pause" : "▶ play";
      if (on) {
        before = performance.now();
        requestAnimationFrame(advance);
      }
    }
    function advance(now) {
      if (!playing) return;
      if (canvas.offsetParent) setPhase(phase + (now - before) / PERIOD);
      before = now;
      requestAnimationFrame(advance);
    }

    // --- drawing ---
    function draw() {
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => { waiting = false; drawNow(); });
    }
    function drawNow() {
      if (!motion || !canvas.clientWidth) return;
      moveTo(phase);
      const width = Math.round(canvas.clientWidth * devicePixelRatio), height = Math.round(canvas.clientHeight * devicePixelRatio);
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
      gl.viewport(0, 0, width, height);
      gl.clearColor(1, 1, 1, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      gl.enable(gl.POLYGON_OFFSET_FILL);
      gl.polygonOffset(2, 4);
      const rows = motion.view || surface.view, amount = motion.factor * Number(size.value);
      const [wide, tall] = [0, 1].map((k) => 2 * (rows[k].reduce((sum, c, m) => sum + Math.abs(c) * half[m], 0) + surface.reach));
      const scale = zoom * Math.min(0.94 * width / wide, 0.86 * height / tall);
      gl.uniformMatrix3fv(uniform("turn"), true, turn.flat());
      gl.uniform3fv(uniform("centre"), centre);
      gl.uniform2fv(uniform("shift"), shift);
      gl.uniform2f(uniform("stretch"), 2 * scale / width, 2 * scale / height);
      gl.uniform1f(uniform("depth"), 0.2 / radius);
      gl.uniform1f(uniform("amount"), amount);
      drawPart(gl.TRIANGLES, faces, [0, 0, 0, 0], true);
      gl.uniform1f(uniform("behind"), -0.0015); // edges lie before their faces
      drawPart(gl.LINES, edges, [0.12, 0.12, 0.12, 1], false);
      gl.uniform1f(uniform("amount"), 0); // what is at rest lies behind what it coincides with
      gl.uniform1f(uniform("behind"), 0.004);
      drawPart(gl.LINES, edges, [0.66, 0.7, 0.74, 1], false);
      gl.uniform1f(uniform("behind"), 0);
      gl.uniform1f(uniform("amount"), amount);
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
      for (const body of bodies) drawPart(gl.TRIANGLES, body, body.colour, true);
      gl.disable(gl.BLEND);
      canvas.pixelsPerMetre = scale / devicePixelRatio;
      drawAxes();
      say(amount);
      root.dataset.state = gl.getError() === gl.NO_ERROR ? "drawn" : "failed";
    }
    function drawPart(kind, part, colour, lit) {
      gl.uniform4fv(uniform("plain"), colour);
      gl.uniform1i(uniform("lit"), lit ? 1 : 0);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, part.buffer);
      gl.drawElements(kind, part.count, gl.UNSIGNED_INT, 0);
    }
    function drawAxes() {
      const side = 78, context = axes.getContext("2d");
      if (axes.width !== side * devicePixelRatio) axes.width = axes.height = side * devicePixelRatio;
      context.setTransform(devicePixelRatio, 0, 0, devicePixelRatio, 0, 0);
      context.clearRect(0, 0, side, side);
      context.font = "12px system-ui, sans-serif";
      [context.textAlign, context.textBaseline] = ["center", "middle"];
      context.lineWidth = 2;
      const order = [0, 1, 2].sort((a, b) => turn[2][a] - turn[2][b]);
      for (const k of order) {
        const [x, y] = [turn[0][k], -turn[1][k]];
        context.strokeStyle = context.fillStyle = ["#c0392b", "#1e8449", "#2455a4"][k];
        context.beginPath();
        context.moveTo(side / 2, side / 2);
        context.lineTo(side / 2 + 25 * x, side / 2 + 25 * y);
        context.stroke();
        context.fillText("xyz"[k], side / 2 + 33 * x, side / 2 + 33 * y);
      }
    }
    function say(amount) {
      const parts = [motion.title];
      if (!motion.swing) parts.push(`deflection drawn × ${rounded(amount)}`);
      if (motion.period) parts.push(`t = ${rounded(1e3 * phase * motion.period)} ms`);
      if (surface.stops.length) parts.push(surface.stops.length > 1 ? "red: the stops" : "red: the stop");
      said.textContent = parts.filter(Boolean).join("; ");
    }

    // --- what is done with it ---
    let held = null;
    canvas.addEventListener("pointerdown", (event) => {
      held = [event.clientX, event.clientY];
      canvas.focus({ preventScroll: true });
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointerup", () => { held = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (!held) return;
      const dx = event.clientX - held[0], dy = event.clientY - held[1];
      held = [event.clientX, event.clientY];
      if (event.shiftKey) shift = [shift[0] + dx / canvas.pixelsPerMetre, shift[1] - dy / canvas.pixelsPerMetre];
      else turn = product(product(aboutX(dy / 150), aboutY(dx / 150)), turn);
      turned = true;
      draw();
    });
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas) return; // else the page scrolls
      event.preventDefault();
      zoom = Math.min(Math.max(zoom * Math.exp(-event.deltaY / 500), 0.1), 100);
      draw();
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };
      if (!(event.key in steps)) return;
      event.preventDefault();
      const [x, y] = steps[event.key];
      turn = product(product(aboutX(x / 12), aboutY(y / 12)), turn);
      turned = true;
      draw();
    });
    play.addEventListener("click", () => setPlaying(!playing));
    slider.addEventListener("input", () => { setPlaying(false); setPhase(Number(slider.value)); });
    size.addEventListener("input", draw);
    back.addEventListener("click", () => { home(); draw(); });
    new ResizeObserver(draw).observe(picture);
    return { show, setPhase, drawNow, canvas, gl, root };
  };
})();
