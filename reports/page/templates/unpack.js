"use strict";
// Reads what `reports/page/viewer.py` wrote: the shape of a model, and each of its maps.
window.unpack = (facts) => {
  // Every file is a script that puts one object into `received`.
  function script(address) {
    return new Promise((resolve, reject) => {
      const element = document.createElement("script");
      element.src = address;
      element.onload = resolve;
      element.onerror = () => reject(new Error(`${address} is missing`));
      document.head.append(element);
    });
  }

  const dot = (a, b) => { let sum = a[0] * b[0]; for (let k = 1; k < a.length; k++) sum += a[k] * b[k]; return sum; };

  // The object of `script` of viewer.py, its arrays in place of their description.
  async function file(address) {
    await script(address);
    const name = address.slice(address.lastIndexOf("/") + 1);
    const { data, arrays, ...given } = window.received[name];
    delete window.received[name];
    const stream = new Blob([eights(data)]).stream().pipeThrough(new DecompressionStream("deflate"));
    const planes = new Uint8Array(await new Response(stream).arrayBuffer());
    let start = 0;
    for (const [key, [bytes, rows, columns]] of Object.entries(arrays)) {
      const values = new { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array }[bytes](rows * columns);
      for (let at = 0; at < bytes; at++)
        for (let column = 0; column < columns; column++)
          for (let row = 0; row < rows; row++) values[row * columns + column] += planes[start++] * 2 ** (8 * at);
      given[key] = Object.assign(values, { columns });
    }
    return given;
  }

  // The bytes whose bits stand in a text by sevens.
  function eights(text) {
    const bytes = new Uint8Array(Math.floor((text.length * 7) / 8));
    let held = 0, bits = 0, at = 0;
    for (let place = 0; place < text.length; place++) {
      held = (held << 7) | text.charCodeAt(place);
      bits += 7;
      if (bits < 8) continue;
      bits -= 8;
      bytes[at++] = held >> bits;
      held &= (1 << bits) - 1;
    }
    return bytes;
  }

  // Undoes `zigzag`.
  const signed = (step) => (step % 2 ? -(step + 1) / 2 : step / 2);

  // Undoes `steps`: sums down the rows.
  function summed(values) {
    for (let at = 0; at < values.length; at++) values[at] = signed(values[at]) + (values[at - values.columns] ?? 0);
    return values;
  }

  // The faces: a corner is that of the face before which `places` says or, at 3, given by how far it
  // is below the highest before; 0 is a new one.
  function connected(places, below) {
    const faces = new Uint32Array(3 * places.length);
    let next = 0, at = 0;
    for (let corner = 0; corner < faces.length; corner++) {
      const k = corner % 3, place = k === 2 ? 3 : (places[(corner - k) / 3] >> (2 * k)) & 3;
      if (place < 3) faces[corner] = faces[corner - k - 3 + place];
      else { const step = below[at++]; faces[corner] = step ? next - step : next++; }
    }
    return faces;
  }

  // The `growth` of viewer.py: calls `each` of a row and of the three that it is predicted from.
  function grow(corners, each) {
    const base = corners.reduce((most, row) => Math.max(most, row), 0) + 1;
    const opposite = new Map(), seen = new Uint8Array(base);
    const edge = (one, two) => Math.min(one, two) * base + Math.max(one, two);
    let before = -1;
    for (let face = 0; face < corners.length; face += 3) {
      for (let k = 0; k < 3; k++) {
        const row = corners[face + k];
        if (seen[row]) continue;
        seen[row] = 1;
        const [one, two] = [corners[face + ((k + 1) % 3)], corners[face + ((k + 2) % 3)]];
        const three = opposite.get(edge(one, two));
        if (three === undefined) each(row, before, before, before);
        else each(row, one, two, three);
        before = row;
      }
      for (let k = 0; k < 3; k++) {
        const key = edge(corners[face + k], corners[face + ((k + 1) % 3)]);
        if (!opposite.has(key)) opposite.set(key, corners[face + ((k + 2) % 3)]);
      }
    }
  }

  // `unfolded` of viewer.py, operation by operation; `space` gives the place of a row.
  function shares(space, row, one, two, three) {
    const start = space(one);
    const from = (of) => space(of).map((x, k) => x - start[k]);
    const edge = from(two), square = dot(edge, edge);
    const fromEdge = (of) => {
      const apart = from(of), along = dot(apart, edge) / square;
      const off = apart.map((x, k) => x - along * edge[k]);
      return [along, Math.sqrt(dot(off, off))];
    };
    const [along, height] = fromEdge(row), [known, least] = fromEdge(three);
    if (!(square > 0 && height <= facts.steepest * least && least > 0)) return [1, 1, -1];
    const third = -height / least, second = along - third * known;
    return [1 - second - third, second, third];
  }

  // Undoes `surprises`: the places (rows, columns) of the rows that `corners` name, in whole steps.
  function places(surprises, corners, bits, space) {
    const { columns } = surprises, mask = 2 ** bits - 1;
    const found = new Int32Array(columns * (corners.reduce((most, row) => Math.max(most, row), 0) + 1));
    let at = 0;
    grow(corners, (row, one, two, three) => {
      const [a, b, c] = space && one >= 0 ? shares(space, row, one, two, three) : [1, 1, -1];
      for (let k = 0; k < columns; k++, at++) {
        const value = (of) => (of < 0 ? 0 : found[of * columns + k]);
        const guess = Math.floor(a * value(one) + b * value(two) + c * value(three) + 0.5);
        found[row * columns + k] = (guess + signed(surprises[at])) & mask;
      }
    });
    return found;
  }

  const step = ({ side, bits }) => side / (2 ** bits - 1);
  const points = (steps, box) => Float32Array.from(steps, (at, k) => box.low[k % box.low.length] + at * step(box));

  // How many faces have the edge from each corner to the next of its face.
  function sharing(corners) {
    const base = corners.reduce((most, row) => Math.max(most, row), 0) + 1;
    const next = (at) => (at % 3 === 2 ? at - 2 : at + 1);
    const key = (at) => Math.min(corners[at], corners[next(at)]) * base + Math.max(corners[at], corners[next(at)]);
    const count = new Map();
    for (let at = 0; at < corners.length; at++) count.set(key(at), (count.get(key(at)) ?? 0) + 1);
    return Uint8Array.from(corners, (_, at) => Math.min(count.get(key(at)), 2));
  }

  // `rough` of viewer.py for one face, as levels: [angle, area].
  function rough(space, plane, scale) {
    const [a, b] = [1, 2].map((k) => space[k].map((x, i) => x - space[0][i]));
    const [p, q] = [1, 2].map((k) => plane[k].map((x, i) => x - plane[0][i]));
    const aa = dot(a, a), ab = dot(a, b), bb = dot(b, b);
    const area = Math.sqrt(Math.max(aa * bb - ab * ab, 0));
    const flat = Math.abs(p[0] * q[1] - p[1] * q[0]);
    const half = (bb * dot(p, p) - 2 * ab * dot(p, q) + aa * dot(q, q)) / (area * flat) / 2;
    const found = { angle: Math.log2(half + Math.sqrt(Math.max(half * half - 1, 0))), area: Math.log2((flat / area) * scale ** 2) };
    return ["angle", "area"].map((name) => {
      const [low, high] = facts.limits[name];
      if (!(area > 0) || Number.isNaN(found[name])) return facts.levels + 1;
      return Math.round(Math.min(Math.max((found[name] - low) / (high - low), 0), 1) * facts.levels);
    });
  }

  return { dot, file, summed, connected, places, step, points, sharing, rough };
};
