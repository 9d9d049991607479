// A picture of triangles, lines and dots in a canvas, with a depth buffer of its own.
const PALETTES = {
  heat: ["f3ece0", "fdd8a8", "fdbb84", "fc8d59", "ef6548", "d7301f", "b30000", "7f0000"],
  viridis: ["440154", "472d7b", "3b528b", "2c728e", "21918c", "28ae80", "5ec962", "addc30", "fde725"],
};

function palette(colours, bands = false) {  // 256 colours as bytes, between the given ones or in bands
  const known = colours.map((text) => [0, 2, 4].map((at) => parseInt(text.slice(at, at + 2), 16)));
  return Uint8Array.from({length: 768}, (_, i) => {
    const place = (Math.floor(i / 3) / 255) * (known.length - 1), c = i % 3, first = Math.min(Math.floor(place), known.length - 2);
    return bands ? known[Math.min(known.length - 1, Math.floor((Math.floor(i / 3) / 256) * known.length))][c] : known[first][c] + (place - first) * (known[first + 1][c] - known[first][c]);
  });
}

const MOST_PIXELS = 1.2e7;  // of one picture, 150 MB

class Painter {
  constructor(canvas) { this.canvas = canvas; this.context = canvas.getContext("2d", {willReadFrequently: true}); }

  wanted(moving) {  // canvas per page pixel; painted per canvas pixel, whose means are shown; the size
    const ratio = moving ? 1 : Math.min(window.devicePixelRatio || 1, 2), size = [this.canvas.clientWidth, this.canvas.clientHeight].map((length) => Math.max(1, Math.round(length * ratio)));
    return [ratio, moving || 4 * size[0] * size[1] > MOST_PIXELS ? 1 : 2, ...size];
  }

  fits() { const [, , ...size] = this.wanted(false); return size[0] === this.canvas.width && size[1] === this.canvas.height; }

  begin(moving) {  // an empty picture, as large as the canvas is
    const [ratio, fine, wide, tall] = this.wanted(moving), width = wide * fine, height = tall * fine, many = width * height;
    if (!(this.room?.length >= many)) Object.assign(this, {room: new Float32Array(many), owners: new Int32Array(many), colours: new Uint32Array(many)});
    if (wide !== this.image?.width || tall !== this.image.height) {
      this.image = this.context.createImageData(wide, tall);
      Object.assign(this.canvas, {width: wide, height: tall});
    }
    Object.assign(this, {ratio, fine, width, height, dense: ratio * fine, depth: this.room.subarray(0, many), owner: this.owners.subarray(0, many), pixels: this.colours.subarray(0, many)});
    this.depth.fill(-Infinity); this.owner.fill(-1); this.pixels.fill(0xffffffff);
  }

  resolve() {  // the painted pixels as those of the canvas
    const {pixels, width, fine, image} = this, shown = new Uint32Array(image.data.buffer), mean = (a, b) => (a & b) + (((a ^ b) & 0xfefefefe) >>> 1);
    if (fine === 1) { shown.set(pixels); return; }
    for (let y = 0, k = 0; y < image.height; y++) for (let x = 0, i = 2 * y * width; x < image.width; x++, i += 2) shown[k++] = mean(mean(pixels[i], pixels[i + 1]), mean(pixels[i + width], pixels[i + width + 1]));
  }

  look(axes, centre, scale, middle) {  // unit vectors to the right, up and to the eye; the point in the middle [pixels of the page]
    Object.assign(this, {axes, centre, scale: scale * this.dense, middle: middle.map((value) => value * this.dense)});
  }

  place(x, y, z) {  // in the picture, and its distance towards the eye [pixels]
    const [right, up, eye] = this.axes, a = (x - this.centre[0]) * this.scale, b = (y - this.centre[1]) * this.scale, c = (z - this.centre[2]) * this.scale;
    return [this.middle[0] + right[0] * a + right[1] * b + right[2] * c, this.middle[1] - up[0] * a - up[1] * b - up[2] * c, eye[0] * a + eye[1] * b + eye[2] * c];
  }

  places(xyz) {
    const made = [0, 1, 2].map(() => new Float64Array(xyz[0].length));
    for (let i = 0; i < xyz[0].length; i++) { const at = this.place(xyz[0][i], xyz[1][i], xyz[2][i]); for (let c = 0; c < 3; c++) made[c][i] = at[c]; }
    return made;
  }

  // Triangles coloured by values between low and high; of `sheer` ones a quarter of the pixels, `bare` ones fade to nothing. `first` is the number of the first one for `owner`.
  triangles([px, py, pz], cells, values, {table, low, high, lit = true, sheer = false, bare = false, towards = 0, first = 0}) {
    const {width, height, depth, pixels, owner} = this, step = 255 / (high - low);
    for (let t = 0; t < cells.length; t += 3) {
      const a = cells[t], b = cells[t + 1], c = cells[t + 2], ax = px[a], ay = py[a], az = pz[a] + towards;
      const bx = px[b] - ax, by = py[b] - ay, cx = px[c] - ax, cy = py[c] - ay, area = bx * cy - cx * by;
      if (!(Math.abs(area) > 1e-9)) continue;
      const top = Math.max(0, Math.ceil(ay + Math.min(0, by, cy) - 0.5)), bottom = Math.min(height - 1, Math.floor(ay + Math.max(0, by, cy) - 0.5));
      if (top > bottom) continue;
      const bz = pz[b] + towards - az, cz = pz[c] + towards - az, zx = (bz * cy - cz * by) / area, zy = (cz * bx - bz * cx) / area;
      const av = (values[a] - low) * step, bv = (values[b] - values[a]) * step, cv = (values[c] - values[a]) * step, vx = (bv * cy - cv * by) / area, vy = (cv * bx - bv * cx) / area;
      const light = lit ? 0.62 + 0.38 / Math.sqrt(1 + zx * zx + zy * zy) : 1;
      for (let y = top; y <= bottom; y++) {
        const down = y + 0.5 - ay;
        let left = Infinity, right = -Infinity;
        if ((down >= 0) !== (down >= by)) left = right = (down * bx) / by;  // where the sides of the triangle cross the line
        if ((down >= 0) !== (down >= cy)) { const x = (down * cx) / cy; left = Math.min(left, x); right = Math.max(right, x); }
        if ((down >= by) !== (down >= cy)) { const x = bx + ((down - by) * (cx - bx)) / (cy - by); left = Math.min(left, x); right = Math.max(right, x); }
        const from = Math.max(0, Math.ceil(ax + left - 0.5001)), to = Math.min(width - 1, Math.floor(ax + right - 0.4999));
        for (let x = from, k = y * width + from; x <= to; x++, k++) {
          const across = x + 0.5 - ax, z = az + zx * across + zy * down;
          if (z <= depth[k] || (sheer && (x | y) & 1)) continue;
          const v = av + vx * across + vy * down, n = 3 * (v > 0 ? (v < 255 ? Math.round(v) : 255) : 0);
          if (bare && v < 6 + 12 * (x & 1) + 6 * (y & 1)) continue;
          depth[k] = z;
          owner[k] = first + t / 3;
          pixels[k] = v === v ? 0xff000000 | ((table[n + 2] * light) << 16) | ((table[n + 1] * light) << 8) | (table[n] * light) : 0xff999999;
        }
      }
    }
  }

  lines([px, py, pz], pairs, grey, thick) {  // a little nearer than the surface that they lie on
    const {width, height, depth, pixels} = this, colour = 0xff000000 | (grey << 16) | (grey << 8) | grey, wide = Math.max(1, Math.round(thick * this.dense));
    for (let i = 0; i < pairs.length; i += 2) {
      const a = pairs[i], b = pairs[i + 1], dx = px[b] - px[a], dy = py[b] - py[a], dz = pz[b] - pz[a];
      let low = 0, high = 1;  // the part of the line inside the picture
      for (const [start, way, end] of [[px[a], dx, width], [py[a], dy, height]]) {
        if (Math.abs(way) < 1e-12) { if (!(start >= 0 && start <= end)) high = -1; continue; }
        low = Math.max(low, Math.min(-start / way, (end - start) / way)); high = Math.min(high, Math.max(-start / way, (end - start) / way));
      }
      if (!(low <= high)) continue;
      const steps = Math.max(1, Math.ceil((high - low) * Math.max(Math.abs(dx), Math.abs(dy))));
      for (let n = 0; n <= steps; n++) {
        const s = low + ((high - low) * n) / steps, x0 = Math.floor(px[a] + s * dx - (wide - 1) / 2), y0 = Math.floor(py[a] + s * dy - (wide - 1) / 2), z = pz[a] + s * dz;
        for (let y = Math.max(0, y0); y < Math.min(height, y0 + wide); y++) for (let x = Math.max(0, x0); x < Math.min(width, x0 + wide); x++) {
          const k = y * width + x;
          if (z + 2 > depth[k]) { depth[k] = z; pixels[k] = colour; }
        }
      }
    }
  }

  dots([px, py, pz], values, radius, {table, low, high, towards = 4, first = 0}) {
    const {width, height, depth, pixels, owner} = this, size = radius * this.dense;
    for (let i = 0; i < px.length; i++) {
      if (!Number.isFinite(px[i] + py[i])) continue;
      if (!Number.isFinite(values[i])) continue;
      const n = 3 * Math.max(0, Math.min(255, Math.round(((values[i] - low) * 255) / (high - low)))), z = pz[i] + towards;
      for (let y = Math.max(0, Math.ceil(py[i] - size)); y <= Math.min(height - 1, py[i] + size); y++) for (let x = Math.max(0, Math.ceil(px[i] - size)); x <= Math.min(width - 1, px[i] + size); x++) {
        const k = y * width + x;
        if (Math.hypot(x - px[i], y - py[i]) > size || z <= depth[k]) continue;
        depth[k] = z; owner[k] = first + i;
        pixels[k] = 0xff000000 | (table[n + 2] << 16) | (table[n + 1] << 8) | table[n];
      }
    }
  }

  ribbon([px, py, pz], pairs, wide) {  // lines in the plane as triangles: places, corners, the node behind each
    const many = pairs.length / 2, places = [0, 1, 2].map(() => new Float64Array(4 * many)), cells = [], from = [];
    for (let i = 0; i < many; i++) {
      const [a, b] = [pairs[2 * i], pairs[2 * i + 1]], dx = px[b] - px[a], dy = py[b] - py[a], half = (wide * this.dense) / 2 / (Math.hypot(dx, dy) || 1);
      [a, a, b, b].forEach((node, k) => { const side = k % 2 ? half : -half; places[0][4 * i + k] = px[node] - side * dy; places[1][4 * i + k] = py[node] + side * dx; places[2][4 * i + k] = pz[node]; from.push(node); });
      cells.push(4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 1, 4 * i + 3, 4 * i + 2);
    }
    return {places, cells, from};
  }

  end([left, right, top, bottom]) {  // shows the picture within these limits; then the context draws in pixels
    this.resolve();
    this.context.setTransform(1, 0, 0, 1, 0, 0);
    this.context.fillStyle = "#fff";
    this.context.fillRect(0, 0, this.width, this.height);
    this.context.putImageData(this.image, 0, 0, ...[left, top, right - left, bottom - top].map((value) => Math.round(value * this.ratio)));
    this.context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
  }

  text(words, x, y, align = "center") {
    const {context} = this;
    Object.assign(context, {font: "12px -apple-system, 'Segoe UI', Helvetica, Arial, sans-serif", textAlign: align, textBaseline: "middle", fillStyle: "#1b1b1b", strokeStyle: "#fff", lineWidth: 3});
    const wide = context.measureText(words).width, before = wide * {left: 0, center: 0.5, right: 1}[align];  // no word is cut
    x = Math.max(before + 2, Math.min(this.width / this.dense - 2 - wide + before, x));
    context.strokeText(words, x, y);
    context.fillText(words, x, y);
  }

  stroke(points, colour, width, fill = "") {
    const {context} = this;
    Object.assign(context, {strokeStyle: colour, lineWidth: width, lineCap: "round"});
    context.beginPath();
    points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
    if (fill) { context.fillStyle = fill; context.fill(); }
    context.stroke();
  }

  arrow([x, y], [dx, dy]) {
    const length = Math.hypot(dx, dy), head = Math.min(6, 0.5 * length), [a, b] = length > 0 ? [(dx * head) / length, (dy * head) / length] : [0, 0];
    for (const [colour, width] of [["#fff", 3.2], ["#000", 1.4]]) {
      this.stroke([[x, y], [x + dx, y + dy]], colour, width);
      this.stroke([[x + dx - a - b / 2, y + dy - b + a / 2], [x + dx, y + dy], [x + dx - a + b / 2, y + dy - b - a / 2]], colour, width);
    }
  }

  bar(words, {table, low, high, names, shown = names?.map((_, i) => i)}, y) {  // of the colours, with ticks, or with the names of those shown
    const {context} = this, wide = this.width / this.dense, length = Math.min(0.88 * wide, names ? 130 * shown.length : 480), left = (wide - length) / 2;
    for (let i = 0; i < length; i++) {
      const n = 3 * Math.floor(255 * (names ? (shown[Math.floor((shown.length * i) / length)] + 0.5) / names.length : i / length)); context.fillStyle = `rgb(${table[n]},${table[n + 1]},${table[n + 2]})`; context.fillRect(left + i, y, 1.5, 10);
    }
    this.text(words, wide / 2, y - 9);
    if (names) shown.forEach((value, i) => this.text(names[value], left + (length * (i + 0.5)) / shown.length, y + 19));
    else for (const value of ticks(low, high, length > 400 ? 6 : 4)) this.text(short(value), left + (length * (value - low)) / (high - low), y + 19);
  }
}
