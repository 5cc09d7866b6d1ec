// A surface in WebGL 2: heights with a picture on them, and lines. It draws only when asked.

const GROUND = `#version 300 es
layout(location = 0) in float x;
layout(location = 1) in float y;
layout(location = 2) in float z;
uniform mat3 turn;
uniform vec3 low, mm, middle;
uniform vec4 fit, texel;
uniform float near, columns;
out vec3 place;
out vec2 at;
void main() {
  place = turn * (low + mm * vec3(x, y, z) - middle);
  at = vec2(gl_VertexID % int(columns), gl_VertexID / int(columns)) * texel.xy + texel.zw;
  gl_Position = vec4(place.xy * fit.xy + fit.zw, -place.z * near, 1);
}`;
// Each triangle has its own normal; light comes from above on the left.
const SHADE = `#version 300 es
precision highp float;
uniform sampler2D picture;
in vec3 place;
in vec2 at;
out vec4 colour;
void main() {
  vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
  float light = abs(dot(normal, normalize(vec3(-0.5, 0.6, 1))));
  colour = vec4(texture(picture, at).rgb * (0.35 + 0.7 * light), 1);
}`;
// A piece of a line is a strip of four corners, a little in front of the surface.
const STRIP = `#version 300 es
layout(location = 0) in vec3 from;
layout(location = 1) in vec3 to;
layout(location = 2) in vec4 look;
layout(location = 3) in float wide;
uniform mat3 turn;
uniform vec3 middle;
uniform vec4 fit;
uniform vec2 pixel;
uniform float near;
flat out vec4 ink;
void main() {
  vec3 a = turn * (from - middle), b = turn * (to - middle);
  bool first = gl_VertexID < 2;
  vec3 end = first ? a : b;
  vec2 along = normalize((b - a).xy * fit.xy / pixel + vec2(1e-6, 0));
  vec2 off = vec2(-along.y, along.x) * (gl_VertexID % 2 == 0 ? 0.5 : -0.5) + along * (first ? -0.25 : 0.25);
  ink = vec4(look.rgb * look.a, look.a);
  gl_Position = vec4(end.xy * fit.xy + fit.zw + off * wide * pixel, -end.z * near - 0.005, 1);
}`;
const INK = `#version 300 es
precision highp float;
flat in vec4 ink;
out vec4 colour;
void main() { colour = ink; }`;

// Of a piece of a line: both ends, colour with opacity, width.
const PIECE = [3, 3, 4, 1], SIZE = 11;

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  return made;
}

// What draws on a canvas while its context lives; null without WebGL 2.
export function surface(canvas, antialias) {
  const gl = canvas.getContext("webgl2", { antialias, preserveDrawingBuffer: true });
  if (!gl) return null;
  const ground = program(gl, GROUND, SHADE), pieces = program(gl, STRIP, INK);
  const [words, corners, lines] = [1, 2, 3].map(() => gl.createBuffer());
  const [sheet, strips] = [gl.createVertexArray(), gl.createVertexArray()];
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  gl.bindVertexArray(strips);
  gl.bindBuffer(gl.ARRAY_BUFFER, lines);
  PIECE.reduce((offset, size, at) => {
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, size, gl.FLOAT, false, 4 * SIZE, offset);
    gl.vertexAttribDivisor(at, 1);
    return offset + 4 * size;
  }, 0);
  gl.enable(gl.DEPTH_TEST);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  let shown, count = 0, strokes = 0;

  function use(made, values) {
    gl.useProgram(made);
    for (const name of Object.keys(values)) {
      const place = gl.getUniformLocation(made, name), value = values[name];
      if (name === "turn") gl.uniformMatrix3fv(place, false, value); else gl[`uniform${value.length}fv`](place, value);
    }
  }

  return {
    // Shows heights with the corners of their triangles, and a picture of the same frame on them.
    put(heights, triangles, picture) {
      const { low, mm, width, height, stride } = heights, pixel = Math.round(stride * width / picture.width);
      const [u, v] = [1 / (pixel * picture.width), 1 / (pixel * picture.height)];
      shown = { low, mm, columns: [width], texel: [stride * u, stride * v, 0.5 * u, 0.5 * v] };
      count = triangles.length;
      gl.bindVertexArray(sheet);
      gl.bindBuffer(gl.ARRAY_BUFFER, words);
      gl.bufferData(gl.ARRAY_BUFFER, heights.words, gl.STATIC_DRAW);
      for (let at = 0; at < 3; at += 1) {
        gl.enableVertexAttribArray(at);
        gl.vertexAttribPointer(at, 1, gl.UNSIGNED_SHORT, false, 2, 2 * at * width * height);
      }
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, corners);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, picture);
    },
    line(numbers) {
      strokes = numbers.length / SIZE;
      gl.bindBuffer(gl.ARRAY_BUFFER, lines);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
    },
    // Draws once, or nothing: turned about the middle, fit to the canvas; `near` is depth per mm, `pixel` the size of one of the screen.
    draw(seen) {
      const { width, height } = canvas;
      gl.viewport(0, 0, width, height);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      if (!seen) return;
      const { turn, middle, fit, near, pixel } = seen;
      use(ground, Object.assign({ turn, middle, fit, near }, shown));
      gl.bindVertexArray(sheet);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0);
      use(pieces, { turn, middle, fit, near, pixel });
      // Of lines that cross, the later one lies above.
      gl.depthMask(false);
      gl.bindVertexArray(strips);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, strokes);
      gl.depthMask(true);
    },
    // Frees memory.
    free() {
      const held = gl.getExtension("WEBGL_lose_context");
      if (held) held.loseContext();
    },
  };
}
